"""``[damping]`` of a case: responses and linear modes that have it, on every route, and what is refused."""

from __future__ import annotations

import json

import numpy as np
import pytest
import scipy.linalg
from command_line import call
from models.linear_cases import CONTACT, GROUND, MASS, NEXT, ring
from models.solved_case import tables_of
from tolerances import SOLVED, TIGHT

from fretwave.case.load import load_case
from fretwave.errors import CaseErrors

ZETA, FORCE, SLIDER = 0.01, 1e-4, 7.0
M = np.diag([2.0, 1.0, 0.5])
K = np.array([[50.0, -20.0, 0.0], [-20.0, 30.0, -10.0], [0.0, -10.0, 12.0]])
CHAIN = f"""
[model]
dofs = ["a", "b", "c"]
M = {M.tolist()}
K = {K.tolist()}

[[contact]]
name = "slider"
law = "jenkins"
pairs = ["a"]
tangential_stiffness = {SLIDER}
friction_limit = 1e6

[[analysis]]
name = "linear"
type = "linear"
"""
STUCK = 'contact = "stuck"\n'
REDUCED = "[reduction]\nmodes = 1\ncompare = 0\n"
#: A mass on the rim, tied to the next one, that carries a blade of two.
SECTOR = """
[model]
dofs = ["rim", "root", "tip", "next"]
M = [[2.0, 0, 0, 0], [0, 1.0, 0, 0], [0, 0, 0.5, 0], [0, 0, 0, 0]]
K = [[95.0, -40.0, 0, -30.0], [-40.0, 60.0, -20.0, 0], [0, -20.0, 20.0, 0], [-30.0, 0, 0, 30.0]]
sectors = 6
low = ["rim"]
high = ["next"]

[[contact]]
name = "shroud"
law = "jenkins"
pairs = ["tip"]
tangential_stiffness = 9.0
friction_limit = 1e6
"""
LINEAR = """
[[analysis]]
name = "linear"
type = "linear"
contact = ["stuck"]
"""
MODE = """
[[analysis]]
name = "mode"
type = "mode"
normalise = "%s"
harmonics = 3
samples = 64
amplitude = [0.05, 0.5]
"""
FORCED = """
[[analysis]]
name = "forced"
type = "forced"
harmonics = 1
samples = 32
levels = [1.0]
"""


def forced(dof: str, hz: np.ndarray, *keys: str) -> str:
    lines = [
        f"force = {{ {dof} = {FORCE} }}",
        f'observe = "{dof}"',
        f"frequency = [{0.9 * hz.min():.17g}, {1.1 * hz.max():.17g}]",
        f"report_at = {[float(f'{value:.17g}') for value in sorted(hz)]}",
    ]
    return FORCED + "\n".join([*lines, *keys]) + "\n"


@pytest.fixture
def solve(shared_tmp, comm):
    """Tables of a run of a case."""
    return lambda text, *names: tables_of(text, shared_tmp, comm, *names)


def reported(forced: dict[str, np.ndarray]) -> np.ndarray:
    return forced["amplitude"][forced["event"] == "report"]


def half_power(zeta: float) -> np.ndarray:
    """omega / omega0 where |H| is 1 / sqrt(2) of that at omega0: (1 - r^2)^2 + (2 zeta r)^2 = 8 zeta^2."""
    middle, half = 1 - 2 * zeta**2, 2 * zeta * np.sqrt(1 + zeta**2)
    return np.sqrt([middle - half, middle + half])


@pytest.mark.parametrize("keys", ["nodal_diameter = 2", "wheel = true\nnodal_diameter = 2"])
def test_a_wave_responds_with_the_peak_and_the_width_of_its_ratio(solve, keys):
    """One mode a wave: F / (2 zeta k) at its frequency, 1/sqrt(2) of it 2 zeta (1 + 2 zeta^2 + ..) apart."""
    omega = np.sqrt((GROUND + 2 * (NEXT + CONTACT) * (1 - np.cos(2 * np.pi * 2 / 6))) / MASS)
    ratios = np.array([half_power(ZETA)[0], 1.0, half_power(ZETA)[1]])
    text = ring(6).replace("speed_rpm = 6.0\n", "").replace("C = [[0.01, 0.0], [0.0, 0.0]]\n", "")
    text += f"[damping]\nQ = {0.5 / ZETA}\n{STUCK}" + forced("mass", omega * ratios / (2 * np.pi), keys)
    response, linear = solve(text, "forced", "linear")
    peak = FORCE / (2 * ZETA * MASS * omega**2)
    assert reported(response) == pytest.approx(peak * np.array([0.5**0.5, 1.0, 0.5**0.5]), rel=SOLVED)
    assert ratios[2] - ratios[0] == pytest.approx(2 * ZETA * (1 + 2 * ZETA**2), rel=10 * ZETA**4)
    assert linear["zeta"][linear["contact"] == "stuck"] == pytest.approx(ZETA, rel=TIGHT)


@pytest.mark.parametrize("reduction", ["", REDUCED])
@pytest.mark.parametrize(
    "form, zeta",
    [
        ("loss_factor = 0.02", [0.01, 0.01, 0.01]),
        ("zeta = [0.02, 0.005]", [0.02, 0.005, 0.0]),
        ("Q = { 2 = 100.0, 3 = 25.0 }", [0.0, 0.005, 0.02]),
    ],
)
def test_a_structure_responds_as_its_modes_one_by_one(solve, reduction, form, zeta):
    """x = sum_r phi_r phi_r^T F / (omega_r^2 - omega^2 + 2 i zeta_r omega_r omega), unreduced and reduced."""
    square, shapes = scipy.linalg.eigh(K + np.diag([SLIDER, 0.0, 0.0]), M)
    omega = np.sqrt(square)
    at = omega[1] * np.array([0.97, 1.0, 1.02])
    text = CHAIN + f"[damping]\n{form}\n{STUCK}" + reduction + forced("c", at / (2 * np.pi))
    response, linear = solve(text, "forced", "linear")
    parts = shapes[2] ** 2 / (square - at[:, None] ** 2 + 2j * np.array(zeta) * omega * at[:, None])
    assert reported(response) == pytest.approx(FORCE * np.abs(parts.sum(axis=1)), rel=SOLVED)
    assert linear["zeta"][linear["contact"] == "stuck"] == pytest.approx(zeta, rel=TIGHT, abs=TIGHT)


def test_it_is_added_to_what_else_is_in_C_and_of_the_limit_that_is_named(solve):
    shares = CHAIN.replace("[[contact]]", "mass_damping = 0.3\n\n[[contact]]", 1)
    (linear,) = solve(shares + '[damping]\nzeta = 0.01\ncontact = "free"\n', "linear")
    own = linear["contact"] == "free"
    assert linear["zeta"][own] == pytest.approx(0.01 + 0.3 / (2 * linear["omega"][own]), rel=TIGHT)


def test_at_every_speed_the_modes_there_have_it(solve):
    stiff = (K + np.diag([3.0, 2.0, 5.0])).tolist()
    text = CHAIN.replace("[[contact]]", f"at_speed = {{ 600 = {stiff} }}\n\n[[contact]]", 1)
    (linear,) = solve(text + "speeds_rpm = [0.0, 300.0, 600.0]\n[damping]\nzeta = 0.004\n" + STUCK, "linear")
    assert linear["zeta"][linear["contact"] == "stuck"] == pytest.approx(0.004, rel=TIGHT)
    assert len(set(linear["speed_rpm"])) == 3


def test_unless_told_the_modes_are_the_sliding_ones_and_all_stuck_ones_are_noted(solve, shared_tmp, comm):
    """A slider is no part of them: a sliding mode, without its spring, has the ratio that all modes have."""
    (linear,) = solve(CHAIN + "[damping]\nzeta = 0.01\n", "linear")
    assert linear["zeta"][linear["contact"] == "free"] == pytest.approx(0.01, rel=TIGHT)
    if comm.rank == 0:
        path = shared_tmp / "case.toml"
        assert not any("slip too" in note for note in load_case(path).notes)
        assert any("slip too" in note for note in load_case(path, ['damping.contact="stuck"']).notes)


WRONG = {
    "two forms": ("zeta = 0.01\nQ = 100.0", "is given beside zeta", "zeta is zeta 0.01, Q is zeta 0.005"),
    "three forms": ("zeta = 0.01\nloss_factor = 0.02\n", "is given beside zeta", "loss_factor is zeta 0.01"),
    "none": ('contact = "free"', "damps nothing", "zeta, Q or loss_factor"),
    "more than critical": ("zeta = 1.5", "damping.zeta", "a value < 1"),
    "below critical": ("Q = 0.4", "damping.Q", "a value > 0.5"),
    "negative": ("loss_factor = [0.01, -0.01]", "loss_factor[1]", "a value >= 0"),
    "no number of a mode": ("zeta = { first = 0.01 }", "is of no mode", "1 is the lowest"),
    "mode nought": ("zeta = { 0 = 0.01 }", "is of no mode", "1 is the lowest"),
    "no such limit": ('zeta = 0.01\ncontact = "open"', "damping.contact", "stuck"),
    "another word": ("zetta = 0.01", "unknown key 'zetta'", "did you mean `zeta`"),
}


@pytest.mark.ranks(1)
@pytest.mark.parametrize("name", WRONG)
def test_what_is_no_damping_is_refused(name, tmp_path):
    keys, what, expected = WRONG[name]
    path = tmp_path / "case.toml"
    path.write_text(CHAIN + f"[damping]\n{keys}\n", encoding="utf-8")
    with pytest.raises(CaseErrors) as caught:
        load_case(path)
    text = str(caught.value)
    assert what in text and expected in text and text.count("fix:") == 1 and "case.toml:" in text


@pytest.mark.ranks(1)
@pytest.mark.parametrize("command", ["check", "run"])
def test_a_mode_that_is_not_there_is_bad_input(command, tmp_path, capsys):
    path = tmp_path / "case.toml"
    path.write_text(CHAIN + "[damping]\nzeta = { 4 = 0.01 }\n", encoding="utf-8")
    assert call(command, path, *(["--out", tmp_path / "run"] if command == "run" else [])) == 2
    text = capsys.readouterr().err
    assert "mode 4" in text and "1 to 3 modes" in text and "case.toml:" in text and text.count("fix:") == 1


@pytest.mark.ranks(1)
def test_an_unreduced_model_too_large_is_refused_before_anything_runs(tmp_path, monkeypatch):
    from fretwave.model import modal_damping

    monkeypatch.setattr(modal_damping, "LARGEST", 8)
    path = tmp_path / "case.toml"
    for reduction, fix in (("", "add [reduction]"), (REDUCED + "error_at = 1e-3\n", "remove error_at")):
        path.write_text(CHAIN + "[damping]\nzeta = 0.01\n" + reduction, encoding="utf-8")
        with pytest.raises(CaseErrors, match="3 dofs") as caught:
            load_case(path)
        assert fix in str(caught.value)


@pytest.mark.ranks(1)
def test_check_says_it_and_another_value_is_another_case(tmp_path, capsys):
    path = tmp_path / "case.toml"
    path.write_text(CHAIN + "[damping]\nQ = 250.0\n", encoding="utf-8")
    assert call("check", path) == 0
    assert "damping of all modes with contact sliding: Q = 250.0 (zeta 0.002)" in capsys.readouterr().out
    assert load_case(path).digest != load_case(path, ["damping.Q=200"]).digest
    assert load_case(path, ["damping.Q=200"]).resolved["damping.Q"] == 200


def test_a_reduced_sector_and_its_wheel_have_it(solve):
    """Kept faces and one component mode: a reduction that leaves nothing out."""
    reduced = SECTOR + REDUCED + "[damping]\nzeta = [0.01, 0.02, 0.03]\n" + STUCK + LINEAR
    (linear,) = solve(reduced, "linear")
    for number, zeta in ((1, 0.01), (2, 0.02), (3, 0.03)):
        assert linear["zeta"][linear["mode"] == number] == pytest.approx(zeta, rel=TIGHT)
    (plain,) = solve(SECTOR + "[damping]\nzeta = [0.01, 0.02, 0.03]\n" + STUCK + LINEAR, "linear")
    assert linear["omega"] == pytest.approx(plain["omega"], rel=SOLVED) and len(plain["omega"]) == 12


@pytest.mark.ranks(1)
@pytest.mark.parametrize("sector", [False, True])
def test_the_error_of_a_reduction_knows_it(sector, tmp_path):
    """All component modes: the unreduced model, damped by its own modes, would change nothing."""
    text, dof, modes = (SECTOR, "tip", "1") if sector else (CHAIN[: CHAIN.index("[[analysis]]")], "a", "2")
    text += "[damping]\nzeta = 0.01\n" + REDUCED.replace("1", modes) + "error_at = 0.2\n" + MODE % dof
    text += "nodal_diameter = 1\n" if sector else ""
    path = tmp_path / "case.toml"
    path.write_text(text.replace("friction_limit = 1e6", "friction_limit = 1.0"), encoding="utf-8")
    assert call("run", path, "--no-plots", "--out", tmp_path / "run") == 0
    record = json.loads((tmp_path / "run" / "run.json").read_text(encoding="utf-8"))
    assert abs(record["analyses"]["mode"]["reduction_error"]["zeta"]) < SOLVED
