"""`type = "linear"` from a case file: frequencies in the contact's three limits by hand, over waves, and crossings."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.sparse as sp
from models.linear_cases import CONTACT, GROUND, KN, KT, MASS, MASS_SHARE, NEXT, POINT, STIFFNESS_SHARE, K, M, ring
from tolerances import ROUNDING, TIGHT

from fretwave import LinearMode
from fretwave.analyses.parts.damped_basis import in_damped_basis
from fretwave.plots import campbell, safe
from fretwave.plots.linear_bands import bands, peaks
from fretwave.post.engine_orders import crossing_speeds, excited_by, frequency_at, usual_orders
from fretwave.report.report import report_run
from fretwave.results.reader import Run
from fretwave.results.stamp import stamp_of
from fretwave.run.order import RunOptions
from fretwave.run.runner import run_case


@pytest.fixture
def solve(shared_tmp, comm):
    """Folder of a run of a case."""

    def run(text: str) -> Path:
        path, out = shared_tmp / "case.toml", shared_tmp / "run"
        if comm.rank == 0:
            path.write_text(text, encoding="utf-8")
        comm.barrier()
        assert run_case(path, RunOptions(out=out, plots=False), comm) == 0
        return out

    return run


def table(folder: Path, name: str = "linear") -> list[dict[str, str]]:
    with open(folder / f"{name}.csv", newline="") as file:
        return list(csv.DictReader(file))


def column(rows: list[dict[str, str]], name: str, **where: object) -> list[float]:
    return [float(row[name]) for row in rows if all(row[key] == str(value) for key, value in where.items())]


def by_hand(stiffness: np.ndarray) -> np.ndarray:
    return np.sqrt(np.sort(np.linalg.eigvals(np.linalg.solve(M, stiffness)).real))


def wave(sectors: int, diameters: np.ndarray, spring: float) -> np.ndarray:
    """omega_d^2 = k / m + 2 kc / m (1 - cos(2 pi d / N)) of a ring of equal masses."""
    return np.sqrt((GROUND + 2 * spring * (1 - np.cos(2 * np.pi * diameters / sectors))) / MASS)


def test_contact_adds_its_springs_when_stuck_and_the_normal_one_when_sliding(solve):
    rows = table(solve(POINT))
    expected = {"stuck": K + np.diag([KN, KT, 0.0]), "sliding": K + np.diag([KN, 0.0, 0.0]), "free": K}
    assert [row["contact"] for row in rows] == [limit for limit in expected for _ in range(3)]
    for limit, stiffness in expected.items():
        omega = by_hand(stiffness)
        assert column(rows, "omega", contact=limit) == pytest.approx(omega, rel=TIGHT)
        assert column(rows, "frequency_hz", contact=limit) == pytest.approx(omega / (2 * np.pi), rel=TIGHT)
    assert column(rows, "mode", contact="free") == [1, 2, 3]


def test_damping_is_that_of_the_shares_of_mass_and_stiffness(solve):
    """Without contact both shares keep the modes: zeta = (a / omega + b omega) / 2. Springs of contact damp nothing."""
    rows = table(solve(POINT))

    def shares(omega):
        return (MASS_SHARE / omega + STIFFNESS_SHARE * omega) / 2

    assert column(rows, "zeta", contact="free") == pytest.approx(shares(by_hand(K)), rel=TIGHT)
    stuck = by_hand(K + np.diag([KN, KT, 0.0]))
    assert (np.array(column(rows, "zeta", contact="stuck")) < shares(stuck)).all()


def test_stuck_modes_know_the_sliding_mode_that_is_most_like_them(solve):
    """A weak friction spring hardly changes the shapes: the same order, no other limit has such a partner."""
    rows = table(solve(POINT))
    sliding = column(rows, "frequency_hz", contact="sliding")
    assert column(rows, "other_hz", contact="stuck") == pytest.approx(sliding, rel=TIGHT)
    assert np.isnan(column(rows, "other_hz", contact="sliding")).all()


def test_shapes_are_kept_as_coefficients_of_unit_modal_mass(solve):
    out = solve(POINT)
    with h5py.File(out / "results.h5") as file:
        group = file["linear"]
        shapes = group["coefficients"][()][:, :, 0] - 1j * group["coefficients"][()][:, :, 1]
        omega, amplitude = group["points/omega"][()], group["points/amplitude"][()]
    gram = shapes[6:].conj() @ M @ shapes[6:].T
    assert gram == pytest.approx(np.eye(3), abs=TIGHT)
    assert shapes[6:].conj() @ K @ shapes[6:].T == pytest.approx(np.diag(omega[6:] ** 2), abs=1e-9 * omega.max() ** 2)
    assert np.abs(shapes).max(axis=1) == pytest.approx(amplitude, rel=ROUNDING)


@pytest.mark.parametrize("sectors", [7, 8])
def test_every_wave_of_a_ring_of_masses_has_its_closed_form(solve, sectors):
    rows, diameters = table(solve(ring(sectors))), np.arange(sectors // 2 + 1)
    for limit, spring in (("stuck", NEXT + CONTACT), ("free", NEXT)):
        omega = wave(sectors, diameters, spring)
        assert column(rows, "nodal_diameter", contact=limit) == list(diameters)
        assert column(rows, "omega", contact=limit) == pytest.approx(omega, rel=TIGHT)
        assert column(rows, "zeta", contact=limit) == pytest.approx(0.01 / (2 * MASS * omega), rel=TIGHT)
    expected = wave(sectors, diameters, NEXT) / (2 * np.pi)
    assert column(rows, "other_hz", contact="stuck") == pytest.approx(expected, rel=TIGHT)


def test_engine_orders_meet_the_waves_that_they_excite_and_no_others(solve):
    """Order h at h n / 60: ND or N - ND of every wave, margins from the operating speed of 6 rev/min."""
    rows = table(solve(ring(8)), "linear_crossings")
    found = {(row["contact"], int(row["nodal_diameter"]), int(row["engine_order"])): row for row in rows}
    pairs = [(0, 8), (1, 1), (1, 7), (2, 2), (2, 6), (3, 3), (3, 5), (4, 4)]
    assert sorted(found) == sorted((limit, *pair) for limit in ("stuck", "free") for pair in pairs)
    for (limit, diameters, order), row in found.items():
        spring = NEXT + CONTACT * (limit == "stuck")
        speed = 60 / order * wave(8, np.array(diameters), spring) / (2 * np.pi)
        assert float(row["speed_rpm"]) == pytest.approx(speed, rel=TIGHT)
        assert float(row["margin"]) == pytest.approx(speed / 6.0 - 1.0, abs=TIGHT * (1 + speed / 6.0))


SECTOR = (
    POINT.replace('"n", "t", "m"]', '"n", "t", "m", "next"]\nsectors = 6\nlow = ["m"]\nhigh = ["next"]')
    .replace(str(M.tolist()), str(np.pad(M, (0, 1)).tolist()))
    .replace(str(K.tolist()), str((np.pad(K, (0, 1)) + 3.0 * np.outer([0, 0, 1, -1], [0, 0, 1, -1])).tolist()))
)
MODE = """
[[analysis]]
name = "mode"
type = "mode"
nodal_diameter = 2
linear_mode = 2
normalise = "t"
harmonics = 1
samples = 48
amplitude = [1e-4, 1e-3]
"""


def test_a_backbone_of_a_sector_has_the_same_limits(solve):
    """Stuck and closed and sliding, on the wave's own K: 3 (2 - 2 cos(2 pi 2 / 6)) = 9 joins the mass behind."""
    out = solve(SECTOR + MODE)
    mode = Run(out)["mode"]
    wave_of_two = K + np.diag([0.0, 0.0, 9.0])
    assert mode.asymptote("stuck") == pytest.approx(by_hand(wave_of_two + np.diag([KN, KT, 0.0]))[1], rel=TIGHT)
    assert mode.asymptote("sliding") == pytest.approx(by_hand(wave_of_two + np.diag([KN, 0.0, 0.0]))[1], rel=TIGHT)
    other = column(table(out), "other_hz", contact="stuck", nodal_diameter=2, mode=2)
    assert other == pytest.approx([mode.asymptote("sliding") / (2 * np.pi)], rel=TIGHT)


@pytest.mark.ranks(1)
def test_the_largest_damping_of_a_nonlinear_mode_is_marked_in_its_wave(solve):
    over = MODE.replace("linear_mode = 2", "linear_mode = 1").replace('"t"', '"mass"')
    out = solve(ring(6) + over.replace("[1e-4, 1e-3]", "[0.5, 50.0]"))
    run = Run(out)
    top = int(np.argmax(run["mode"]["zeta"]))
    assert 0 < top < len(run["mode"]) - 1
    (peak,) = peaks(run, run["linear"], bands(run["linear"]))
    assert (peak.diameter, peak.speed, peak.hz) == (2, None, run["mode"]["frequency_hz"][top])
    ((_, figure),) = safe.figures(run)
    (star,) = [line for line in figure.axes[0].get_lines() if line.get_marker() == "*"]
    assert star.get_xydata().tolist() == [[2, peak.hz]]
    stamp = stamp_of(run["mode"].attributes)
    run["mode"].attributes["case"] = json.dumps({**stamp, "contact.between.friction_limit": 2.0})
    assert not list(peaks(run, run["linear"], bands(run["linear"]))), "of the case before it changed"


@pytest.mark.ranks(1)
def test_orders_fold_back_at_half_the_sectors():
    assert [excited_by(h, 8) for h in range(1, 18)] == [1, 2, 3, 4, 3, 2, 1, 0, 1, 2, 3, 4, 3, 2, 1, 0, 1]
    assert [excited_by(h, 7) for h in range(1, 9)] == [1, 2, 3, 3, 2, 1, 0, 1]
    for n in (7, 8):  # the definition, h = k N +- d
        for h in range(1, 40):
            d = excited_by(h, n)
            assert 0 <= d <= n // 2 and (h - d) % n * ((h + d) % n) == 0
    assert usual_orders([0, 3], 8) == [3, 5, 8] and usual_orders([0], 0) == [1, 2, 3, 4, 5, 6]


def test_a_structure_on_its_contact_alone_has_no_crossings_of_rigid_motions(solve):
    """Two masses and a spring: without contact the first mode is rigid."""
    text = """
[model]
dofs = ["a", "b"]
M = [[1.0, 0.0], [0.0, 1.0]]
K = [[2.0, -2.0], [-2.0, 2.0]]

[[contact]]
name = "foot"
law = "jenkins"
pairs = ["a"]
tangential_stiffness = 3.0
friction_limit = 1.0

[[analysis]]
name = "linear"
type = "linear"
speed_rpm = 10.0
engine_orders = [2]
"""
    out = solve(text)
    free = column(table(out), "omega", contact="free")
    assert free[0] < 1e-6 and free[1] == pytest.approx(2.0, rel=TIGHT)
    speeds = column(table(out, "linear_crossings"), "speed_rpm", contact="free")
    assert speeds == pytest.approx([60 / 2 * 2.0 / (2 * np.pi)], rel=TIGHT)


@pytest.mark.ranks(1)
def test_the_diagrams_draw_the_table(solve):
    out = solve(ring(8))
    run = Run(out)
    hz = [band.hz[0] for band in bands(run["linear"])]
    assert hz == pytest.approx(wave(8, np.arange(5), NEXT + CONTACT) / (2 * np.pi), rel=TIGHT)
    (name, figure), *more = safe.figures(run)
    assert name == "linear_safe" and not more
    (axes,) = figure.axes
    lines = {line.get_label(): line for line in axes.get_lines()}
    assert "engine orders at 6 rev/min" in lines
    (orders,) = [line.get_xydata() for line in axes.get_lines() if line.get_linestyle() == "None"]
    assert orders[-1, 1] > 1.06 * max(hz) and [h for h, _ in orders] == [1, 2, 3, 4]
    assert orders[:, 1] == pytest.approx(0.1 * np.arange(1, 5))
    stuck = lines["mode 1, stuck"].get_xydata()
    assert np.abs(stuck.T - [np.arange(5), hz]).max() < ROUNDING
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("Nodal diameters", "Frequency [Hz]")
    ((name, figure),) = campbell.figures(run)
    assert name == "linear_campbell" and len(figure.axes) == 6
    shown = [axes for axes in figure.axes if axes.get_visible()]
    assert [axes.get_title() for axes in shown] == [f"{d} nodal diameter{'s' * (d != 1)}" for d in range(5)]
    for d, axes in enumerate(shown):
        met = [line.get_xydata()[0] for line in axes.get_lines() if line.get_label() == "crossing, stuck"]
        assert [x for x, _ in met] == pytest.approx([60 * hz[d] / h for h in usual_orders([d], 8)])


#: The ring's mass on a spring that grows with the speed squared, as a blade's does.
SPIN = 0.8
BUILDER = f"""
import numpy as np
import fretwave as fw

def build():
    M, spin = np.diag([{MASS}, 0.0]), np.diag([{SPIN}, 0.0])
    K = np.diag([{GROUND}, 0.0]) + {NEXT} * np.array([[1.0, -1.0], [-1.0, 1.0]])
    faces = {{"low": np.array([0]), "high": np.array([1])}}
    return fw.Structure(M, K, dofs={{"mass": 0, "next": 1}}, sectors=8, parts={{"spin": spin}}, **faces)
"""
TURNING = """
[model]
builder = "ring.py"

[[analysis]]
name = "linear"
type = "linear"
speed_rpm = 10.0
speeds_rpm = [0.0, 8.0, 16.0]
"""


@pytest.fixture
def turning(solve, shared_tmp, comm):
    if comm.rank == 0:
        (shared_tmp / "ring.py").write_text(BUILDER, encoding="utf-8")
    return solve(TURNING)


def test_stiffness_that_grows_with_the_speed_squared(turning):
    """omega^2 = omega_0^2 + Omega^2 k2 / m of every wave, and the closed form of where an order meets it."""
    rows, still = table(turning), wave(8, np.arange(5), NEXT) ** 2
    for speed in (0.0, 8.0, 16.0):
        omega = np.sqrt(still + (2 * np.pi * speed / 60) ** 2 * SPIN / MASS)
        assert column(rows, "omega", speed_rpm=speed) == pytest.approx(omega, rel=TIGHT)
    for row in table(turning, "linear_crossings"):
        order, d = int(row["engine_order"]), int(row["nodal_diameter"])
        speed = np.sqrt(still[d] / (order**2 - SPIN / MASS)) * 60 / (2 * np.pi)
        assert float(row["speed_rpm"]) == pytest.approx(speed, rel=TIGHT)
        assert float(row["frequency_hz"]) == pytest.approx(order * speed / 60, rel=TIGHT)


@pytest.mark.ranks(1)
def test_frequencies_between_speeds_and_an_order_that_never_meets():
    """Of y = f^2 piecewise linear in s = n^2: y = 4 + s / 900 up to 30 rev/min, 4.5 + s / 1800 beyond."""
    speeds, hz = np.array([0.0, 30.0, 60.0]), np.sqrt([4.0, 5.0, 6.5])
    assert frequency_at(speeds, hz, np.array([15.0, 45.0, 90.0])) ** 2 == pytest.approx([4.25, 5.625, 9.0])
    assert crossing_speeds(speeds, hz, 6) == pytest.approx([np.sqrt(4 / (1 / 100 - 1 / 900))])
    assert crossing_speeds(speeds, hz, 3) == pytest.approx([np.sqrt(4.5 / (1 / 400 - 1 / 1800))])
    assert crossing_speeds(speeds, hz, 1) == []  # 1 / 3600 < 1 / 1800: the frequency grows faster than the order


@pytest.mark.ranks(1)
def test_curves_of_the_turning_ring_are_drawn_through_its_speeds(turning):
    run = Run(turning)
    ((_, figure),) = campbell.figures(run)
    curve = max(figure.axes[0].get_lines(), key=lambda line: len(line.get_xdata()))
    speeds, hz = curve.get_xydata().T
    omega = np.sqrt(GROUND / MASS + (2 * np.pi * speeds / 60) ** 2 * SPIN / MASS)
    assert hz == pytest.approx(omega / (2 * np.pi), rel=TIGHT) and speeds[-1] == 12.5


@pytest.mark.ranks(1)
def test_a_report_names_every_stuck_mode(solve):
    """With what it becomes; `contact` is a column of words."""
    out = solve(ring(6) + MODE.replace("linear_mode = 2", "linear_mode = 1").replace('"t"', '"mass"'))
    linear = Run(out)["linear"]
    stuck = np.flatnonzero(linear["contact"] == "stuck")
    assert 0 < len(stuck) < len(linear)
    text = report_run(out).read_text(encoding="utf-8")
    for row in stuck:
        assert f">stuck, mode {linear['mode'][row]:.0f}<" in text
        assert f'data-from="linear/frequency_hz/{row}"' in text and f'data-from="linear/other_hz/{row}"' in text
    assert ">free, mode" not in text
    assert "other hz" not in text and ">frequency of the mode most like it, sliding or free [Hz]<" in text


@pytest.mark.parametrize("modes", [1, 2, 3])
@pytest.mark.parametrize("angle", [0.0, 0.3, np.pi / 4, 1.2])
def test_damping_of_a_double_mode_does_not_depend_on_the_axes(solve, angle, modes):
    """A mass on equal springs, a damper along a line at an angle: 0 and c / (2 m w). At 45 degrees it was half each.

    A gyroscopic part of C, which linear modes leave out, takes nothing from that, nor do modes that are not asked for.
    A third mass beside it, damped by itself.
    """
    c, along = 0.08, np.array([np.cos(angle), np.sin(angle), 0.0])
    C = c * np.outer(along, along) + np.diag([0.0, 0.0, 0.02])
    C += 0.02 * np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    matrices = f"M = {np.diag([2.0, 2.0, 1.0]).tolist()}\nK = {np.diag([18.0, 18.0, 25.0]).tolist()}\n"
    model = f'[model]\ndofs = ["x", "y", "z"]\n{matrices}C = {C.tolist()}\n'
    rows = table(solve(model + f'[[analysis]]\nname = "linear"\ntype = "linear"\nmodes = {modes}\n'))
    assert column(rows, "omega") == pytest.approx([3.0, 3.0, 5.0][:modes], rel=TIGHT)
    zeta = [0.0, c / (2 * 2.0 * 3.0), 0.02 / (2 * 5.0)]
    assert column(rows, "zeta") == pytest.approx(zeta[:modes], abs=ROUNDING)


@pytest.mark.parametrize("seed", range(3))
def test_modes_that_are_damped_alike_stay_next_to_their_axes(seed):
    """Of a triple one is damped: it is turned to, and the others are the same from any basis that `eigh` may give."""
    turn = np.linalg.qr(np.random.default_rng(seed).standard_normal((3, 3)))[0]
    found = []
    for signs in ([1.0, 1.0, 1.0], [1.0, -1.0, 1.0]):
        modes = [LinearMode(2.0, 0.0, shape, np.zeros(3)) for shape in (turn * signs).T]
        found.append(in_damped_basis(modes, sp.csr_array(np.diag([0.0, 0.0, 0.1]))))
    for mode, other in zip(*found):
        assert abs(mode.shape @ other.shape) == pytest.approx(1.0, abs=ROUNDING)
    shapes = np.array([mode.shape for mode in found[0]])
    assert shapes @ shapes.T == pytest.approx(np.eye(3), abs=ROUNDING)
    assert np.abs(shapes[:, 2]) == pytest.approx([0.0, 0.0, 1.0], abs=ROUNDING)
