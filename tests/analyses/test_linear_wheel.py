"""`type = "linear"` of whole wheels: frequencies of the mistuned wheel, its modes around it, and its amplification."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy.linalg
from command_line import call
from models.linear_cases import CONTACT, GROUND, MASS, NEXT, ring
from models.solved_case import tables_of
from tolerances import REPEATED, TIGHT

from fretwave.case.load import load_case
from fretwave.errors import CaseErrors, InputError
from fretwave.plots import campbell
from fretwave.post.amplification import Family, largest_peak
from fretwave.post.blade_peaks import whitehead
from fretwave.results.reader import Run

ZETA, N = 0.004, 6
WHEEL = "wheel = true\n"
MISTUNED = WHEEL + "mistuning = { standard_deviation = 0.03, seed = 4 }\n"
FORCED = 'observe = "mass"\nengine_order = 2\n'
DAMPED = f'[damping]\nzeta = {ZETA}\ncontact = "stuck"\n'


def text(keys: str, tables: str = "", sectors: int = N) -> str:
    plain = ring(sectors).replace("speed_rpm = 6.0\n", "").replace("C = [[0.01, 0.0], [0.0, 0.0]]\n", "")
    return plain + keys + tables


@pytest.fixture
def solve(shared_tmp, comm):
    """Tables of a run of a case."""
    return lambda text, *names: tables_of(text, shared_tmp, comm, *names)


def wheel(deviations: np.ndarray, contact: float = CONTACT) -> np.ndarray:
    """Stiffness of the ring, each sector's own (ground and the spring to the next mass) by its deviation larger."""
    n, K = len(deviations), np.zeros((len(deviations), len(deviations)))
    for j, own in enumerate(1 + deviations):
        k = (j + 1) % n
        K[j, j] += GROUND * own
        K[np.ix_([j, k], [j, k])] += (NEXT * own + contact) * np.array([[1, -1], [-1, 1]])
    return K


def drawn(path: Path) -> np.ndarray:
    from fretwave.case.wheel import deviations_of

    return deviations_of(load_case(path).analyses["linear"].mistuning, N)


def test_frequencies_are_those_of_the_whole_wheel(solve, shared_tmp):
    (table,) = solve(text(MISTUNED + "modes = 1\n"), "linear")
    for limit, spring in (("stuck", CONTACT), ("free", 0.0)):
        own, K = table["contact"] == limit, wheel(drawn(shared_tmp / "case.toml"), spring)
        expected = np.sqrt(scipy.linalg.eigvalsh(K) / MASS)
        assert table["omega"][own] == pytest.approx(expected, rel=TIGHT)
        assert table["mode"][own].tolist() == [1, 2, 3, 4, 5, 6]


def test_a_tuned_wheel_has_the_modes_of_its_waves_around_it(solve):
    """Double modes of 1 and 2 nodal diameters, single ones of 0 and 3; what they look like is theirs."""
    (table,) = solve(text(WHEEL + 'modes = 1\nobserve = "mass"\ncontact = ["stuck"]\n'), "linear")
    diameters = np.array([0, 1, 1, 2, 2, 3])
    omega = np.sqrt((GROUND + 2 * (NEXT + CONTACT) * (1 - np.cos(2 * np.pi * diameters / N))) / MASS)
    assert table["omega"] == pytest.approx(omega, rel=TIGHT)
    assert table["diameters"].tolist() == diameters.tolist()
    assert table["diameters_share"] == pytest.approx(1.0, abs=REPEATED)
    assert table["participation"][[0, 5]] == pytest.approx(1.0, abs=REPEATED)


#: A mistuned ring of disks, and one that contact alone holds to them, each with springs to its own in the next sector.
TWO_RINGS = """
[model]
dofs = ["disk", "ring", "next", "ring_next"]
M = [[2.0, 0, 0, 0], [0, 0.3, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0]]
K = [[5.0, 0, -2.0, 0], [0, 1.1, 0, -0.7], [-2.0, 0, 2.0, 0], [0, -0.7, 0, 0.7]]
sectors = 6
low = ["disk", "ring"]
high = ["next", "ring_next"]

[[contact]]
name = "rub"
law = "jenkins"
pairs = [["ring", "disk"]]
tangential_stiffness = 3.0
friction_limit = 1.0

[[analysis]]
name = "linear"
type = "linear"
modes = 2
observe = "disk"
wheel = true
mistuning = { standard_deviation = 0.03, seed = 4 }
"""


def test_nothing_is_told_around_the_wheel_of_a_dof_that_stands_still(solve):
    """Without contact half of the modes are the ring's, in which disks move by rounding."""
    (table,) = solve(TWO_RINGS, "linear")
    still = table["largest_sector"] < 0
    assert sorted(table["contact"][still]) == N * ["free"]
    assert np.isnan(table["participation"][still]).all() and (table["diameters"][still] == -1).all()
    assert (table["participation"][~still] > 1 / N).all() and (table["diameters_share"][~still] > 0).all()


#: A sector of disk, blade and tip at random, the disk's spring to the next one's too: no mirror image of itself.
SEED, RUB, SECTORS = 5, 20.0, 7
DRAWN = np.random.default_rng(SEED).standard_normal((4, 4)).round(2)
SKEW, MASSES = DRAWN @ DRAWN.T + np.eye(4), np.diag([2.0, 0.5, 1.0])
DISKS = f"""
[model]
dofs = ["disk", "blade", "tip", "next"]
M = {np.pad(MASSES, (0, 1)).tolist()}
K = {SKEW.tolist()}
sectors = {SECTORS}
low = ["disk"]
high = ["next"]

[[contact]]
name = "rub"
law = "jenkins"
pairs = ["blade"]
tangential_stiffness = {RUB}
friction_limit = 1.0
"""


def disks(diameters: int, rub: float) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies [Hz] and shapes of a wave."""
    T = np.vstack([np.eye(3), [np.exp(-2j * np.pi * diameters / SECTORS), 0, 0]])
    squares, shapes = scipy.linalg.eigh(T.conj().T @ SKEW @ T + np.diag([0.0, rub, 0.0]), MASSES)
    return np.sqrt(squares) / (2 * np.pi), shapes


@pytest.mark.parametrize("keys", ["", WHEEL])
def test_the_mode_most_like_a_double_one_is_that_of_its_wave(solve, keys):
    """On the wheel as on one sector, however the solver turns the modes of a pair, on every number of ranks."""
    (table,) = solve(DISKS + f'[[analysis]]\nname = "linear"\ntype = "linear"\nmodes = 3\n{keys}', "linear")
    expected = []
    for diameters in range(SECTORS // 2 + 1):
        (stuck, shapes), (free, loose) = disks(diameters, RUB), disks(diameters, 0.0)
        alike = np.abs(shapes.conj().T @ MASSES @ loose).argmax(axis=1)
        copies = 2 if keys and 0 < 2 * diameters < SECTORS else 1
        expected += copies * list(zip(stuck, free[alike]))
    own = table["contact"] == "stuck"
    found = sorted(zip(table["frequency_hz"][own], table["other_hz"][own]))
    assert np.array(found) == pytest.approx(np.array(sorted(expected)), rel=TIGHT)


def response(deviations: np.ndarray, omega: np.ndarray) -> np.ndarray:
    """|x_j| (n_omega, N) under a unit force of engine order 2, all modes of the tuned wheel damped by ZETA."""
    tuned = wheel(np.zeros(N))
    C = 2 * ZETA * np.sqrt(MASS) * np.real(scipy.linalg.sqrtm(tuned))
    F = np.exp(-2j * np.pi * 2 * np.arange(N) / N)
    Z = wheel(deviations)[None] - omega[:, None, None] ** 2 * MASS * np.eye(N) + 1j * omega[:, None, None] * C
    return np.abs(np.linalg.solve(Z, np.broadcast_to(F, (len(omega), N))[..., None])[..., 0])


def test_amplification_is_that_of_the_response_solved_directly(solve, shared_tmp):
    """Over a fine grid of frequencies: the largest of all sectors, and the tuned F / (2 zeta k sqrt(1 - zeta^2))."""
    (table,) = solve(text(MISTUNED + "modes = 1\n" + FORCED + 'contact = ["stuck"]\n', DAMPED), "linear_amplification")
    deviations = drawn(shared_tmp / "case.toml")
    k = GROUND + 2 * (NEXT + CONTACT) * (1 - np.cos(2 * np.pi * 2 / N))
    tuned = 1 / (2 * ZETA * k * np.sqrt(1 - ZETA**2))
    assert table["tuned_amplitude"] == pytest.approx([tuned], rel=1e-8)
    assert table["tuned_frequency_hz"] == pytest.approx([np.sqrt(k / MASS * (1 - 2 * ZETA**2)) / (2 * np.pi)], rel=1e-5)
    grid = np.sqrt(k / MASS) * np.linspace(0.9, 1.1, 200_001)
    largest = np.concatenate([response(deviations, part) for part in np.array_split(grid, 40)])
    assert table["amplitude"] == pytest.approx([largest.max()], rel=1e-6)
    assert table["sector"].tolist() == [largest.max(axis=0).argmax()]
    assert table["amplification"] == pytest.approx(table["amplitude"] / tuned, rel=1e-8)


def mistuned_disks(deviations: np.ndarray, rub: float, damping: float, omega: np.ndarray) -> np.ndarray:
    """|tips| (n_omega, N) under a unit force of engine order 3 on the tips, each sector's own K by its deviation."""
    n = 3 * SECTORS
    K, M = np.kron(np.eye(SECTORS), np.diag([0.0, rub, 0.0])), np.kron(np.eye(SECTORS), MASSES)
    for j, own in enumerate(1 + deviations):
        place = np.array([3 * j, 3 * j + 1, 3 * j + 2, 3 * (j + 1) % n])
        K[np.ix_(place, place)] += own * SKEW
    F = np.zeros(n, dtype=complex)
    F[2::3] = np.exp(-2j * np.pi * 3 * np.arange(SECTORS) / SECTORS)
    Z = K + (1j * damping * omega - omega**2)[:, None, None] * M
    return np.abs(np.linalg.solve(Z, np.broadcast_to(F, (len(omega), n))[..., None])[:, 2::3, 0])


def highest_peak(size: np.ndarray) -> float:
    """Of all columns' maxima between the ends; nan where there are none."""
    inner = (size[1:-1] > size[:-2]) & (size[1:-1] > size[2:])
    return size[1:-1][inner].max(initial=-np.inf) if inner.any() else np.nan


@pytest.mark.parametrize("damping", [0.1, 0.3])
def test_peaks_about_every_mode_are_maxima_of_the_response(solve, shared_tmp, damping):
    """Nearer to it than to the next mode; weakly driven or much damped it has none, on the flanks of the others'."""
    deviations = np.array([0.02, -0.01, 0.03, 0.0, -0.02, 0.01, -0.03])
    tables = DISKS.replace("sectors", f"mass_damping = {damping}\nsectors", 1)
    keys = f'modes = 3\nobserve = "tip"\nengine_order = 3\nmistuning = {{ deviations = {deviations.tolist()} }}\n'
    (table,) = solve(tables + f'[[analysis]]\nname = "linear"\ntype = "linear"\n{WHEEL}{keys}', "linear_amplification")
    found, expected = np.column_stack([table["tuned_amplitude"], table["amplitude"]]), []
    for rub in (RUB, 0.0):
        hz = disks(3, rub)[0]
        ends = np.concatenate([[0.5 * hz[0]], 0.5 * (hz[1:] + hz[:-1]), [1.2 * hz[-1]]])
        for low, high in zip(ends, ends[1:]):
            omega = 2 * np.pi * np.linspace(low, high, 12_001)
            both = [mistuned_disks(own, rub, damping, omega) for own in (0 * deviations, deviations)]
            expected.append([highest_peak(both[0][:, :1]), highest_peak(both[1])])
    assert found == pytest.approx(np.array(expected), rel=1e-5, nan_ok=True)
    lost = np.isnan(expected).any(axis=1)
    assert (np.isnan(table["amplification"]) == lost).all() and lost.any() == (damping == 0.3)
    log = (shared_tmp / "run" / "run.log").read_text(encoding="utf-8")
    assert log.count("no peak of") == lost.sum()


def test_engine_orders_meet_every_mode_of_a_wheel_but_draw_no_diagram(solve, shared_tmp):
    (crossings,) = solve(text(MISTUNED + "modes = 1\nspeed_rpm = 6.0\n"), "linear_crossings")
    assert len(crossings["mode"]) == 2 * N * 6
    assert not list(campbell.figures(Run(shared_tmp / "run")))


def test_a_tuned_wheel_is_not_amplified(solve):
    (table,) = solve(text(WHEEL + "modes = 1\n" + FORCED, DAMPED), "linear_amplification")
    assert table["contact"].tolist() == ["stuck", "free"]
    assert table["amplification"] == pytest.approx(1.0, rel=1e-8)


@pytest.mark.ranks(1)
def test_no_pattern_passes_whiteheads_bound_and_some_come_near():
    """One degree of freedom a blade, one family, light damping: A of 200 patterns is between 1 and (1 + sqrt N) / 2."""
    rng, n, coupling = np.random.default_rng(1), 8, 0.01
    found = []
    for _ in range(200):
        deviations = 0.01 * rng.standard_normal(n)
        K = np.diag(1 + deviations) + coupling * (2 * np.eye(n) - np.roll(np.eye(n), 1, 0) - np.roll(np.eye(n), -1, 0))
        square, shapes = scipy.linalg.eigh(K)
        family = Family(np.sqrt(square), shapes.T.astype(complex), 2e-3 * np.eye(n, dtype=complex))
        force = np.exp(-2j * np.pi * 3 * np.arange(n) / n)
        tuned = 1 / (2e-3 * np.sqrt(1 + 2 * coupling * (1 - np.cos(2 * np.pi * 3 / n)) - 1e-6))
        found.append(largest_peak(family, force, np.array([0.9, 1.2])).amplitude / tuned)
    assert min(found) > 1.0 and 0.75 * whitehead(n) < max(found) < whitehead(n)


WRONG = {
    "mistuned waves": ("mistuning = { standard_deviation = 0.02 }\n", "mistuning", "beside `wheel = true`"),
    "observed waves": ('observe = "mass"\n', "observe", "beside `wheel = true`"),
    "no deviations": (WHEEL + 'mistuning = { of = "sector" }\n', "mistuning", "standard_deviation"),
    "no such part": (WHEEL + 'mistuning = { of = "blade", standard_deviation = 0.02 }\n', "of", "one of sector"),
    "waves of a wheel": (WHEEL + "nodal_diameters = [1]\n", "nodal_diameters", "modes of the whole wheel"),
    "no place of the force": (WHEEL + "engine_order = 2\n", "engine_order", "`observe` beside it"),
    "no such dof": (WHEEL + 'observe = "tip"\n', "observe", "one of mass"),
    "order nought": (WHEEL + 'observe = "mass"\nengine_order = 0\n', "engine_order", "a value >= 1"),
}


@pytest.mark.ranks(1)
@pytest.mark.parametrize("name", WRONG)
def test_what_is_of_no_wheel_is_refused(name, tmp_path):
    keys, place, expected = WRONG[name]
    path = tmp_path / "case.toml"
    path.write_text(text(keys), encoding="utf-8")
    with pytest.raises(CaseErrors, match=place) as caught:
        load_case(path)
    assert expected in str(caught.value) and str(caught.value).count("fix:") == 1


@pytest.mark.ranks(1)
def test_a_response_without_damping_is_refused_by_check(tmp_path, capfd):
    """It was found by the run alone, once all modes of the wheel were, and said no analysis."""
    path = tmp_path / "case.toml"
    for dampers, code in (("", 2), ('dampers = [{ dof = "mass", c = 0.1 }]\n', 0)):
        path.write_text(text(WHEEL + "modes = 1\n" + FORCED + dampers), encoding="utf-8")
        assert call("check", path) == code
    said = capfd.readouterr().err
    assert said.count("without damping has no peak") == 1 and "', engine_order" in said


def test_a_response_without_damping_is_refused(solve):
    with pytest.raises(InputError, match="without damping has no peak"):
        solve(text(WHEEL + "modes = 1\n" + FORCED))
