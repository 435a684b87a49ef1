"""``fretwave check`` solves the state at rest: closed forms of first slip, against branches, and what it warns of."""

from __future__ import annotations

import csv
import re
from pathlib import Path

import h5py
import numpy as np
import pytest
from command_line import call
from models.pad_beside_ground import KN, KT, MODEL, MU, N0, PAD, K
from tolerances import SOLVED

pytestmark = pytest.mark.ranks(1)
LAP_JOINT = Path(__file__).parents[2] / "cases" / "lap_joint" / "case.toml"

CASE = f"""{MODEL}
[preload]
pair_loads = true
{PAD}
[[analysis]]
name = "mode"
type = "mode"
method = "CNM"
harmonics = 5
samples = 128
normalise = "x"
amplitude = [0.1, 3.0]
step = {{ maximum = 0.1 }}
"""
NUMBER = r"([-+.e0-9]+)"


def put(folder: Path, text: str = CASE) -> Path:
    path = folder / "case.toml"
    path.write_text(text)
    return path


def slips(said: str) -> list[float]:
    """First slip and slip in every period."""
    found = re.search(f"first slip expected at a = {NUMBER} m of x .*, in every period from about {NUMBER} m", said)
    assert found, said
    return [float(text) for text in found.groups()]


def expected() -> tuple[float, float, float]:
    """Of the pad in the lowest stuck mode: where mu N0 = (kt |x| + mu kn |y|), where mu N0 = kt |x|; frequency."""
    values, shapes = np.linalg.eigh(K + np.diag([KT, KN]))
    y = abs(shapes[1, 0] / shapes[0, 0])
    return MU * N0 / (KT + MU * KN * y), MU * N0 / KT, float(np.sqrt(values[0]) / 2 / np.pi)


def test_state_at_rest_and_first_slip_in_closed_form(tmp_path: Path, capfd) -> None:
    assert call("check", put(tmp_path)) == 0
    said = capfd.readouterr().out
    first, lasting, hertz = expected()
    assert "at rest: 1 stick, 0 slip, 0 open; normal forces sum to 2 N" in said
    assert f"linear mode 1 with contact as at rest: {hertz:.6g} Hz" in said
    assert slips(said) == pytest.approx([first, lasting], rel=5e-3)  # as printed
    assert first < 0.9 * lasting and "within the amplitudes asked for" in said and "warning" not in said


@pytest.mark.parametrize("friction", [0.0, 1e-6])
def test_without_friction_the_mode_at_rest_slides(tmp_path: Path, capfd, friction: float) -> None:
    """Its spring along the tangent holds as soon as there is any friction; the run says the same frequency."""
    path = put(tmp_path, CASE.replace(f"friction_coefficient = {MU}", f"friction_coefficient = {friction}"))
    assert call("check", path) == 0
    said = capfd.readouterr().out
    squares, shapes = np.linalg.eigh(K + np.diag([KT if friction else 0.0, KN]))
    assert f"linear mode 1 with contact as at rest: {np.sqrt(squares[0]) / 2 / np.pi:.6g} Hz" in said
    assert ("warning: no pair of contact 'pad' has friction" in said) == (friction == 0.0)
    if friction == 0.0:
        assert "at rest: 0 stick, 1 slip" in said
        assert call("run", path, "--no-plots", "-q", "--out", tmp_path / "run") == 0
        with open(tmp_path / "run" / "mode.csv", newline="") as file:
            rows = [(float(row["amplitude"]), float(row["omega"])) for row in csv.DictReader(file)]
        lift_off = N0 / KN * abs(shapes[0, 0] / shapes[1, 0])
        closed = [omega for amplitude, omega in rows if amplitude < lift_off]
        assert len(closed) > 5
        np.testing.assert_allclose(closed, np.sqrt(squares[0]), rtol=SOLVED)


def test_a_pair_without_friction_behind_its_gap_moves_no_number(tmp_path: Path, capfd) -> None:
    """Far stiffer than the structure, it would make the second mode the first one if it were closed."""
    behind = {f"normal_load = {N0}": "normal_load = 0.0\ngap = 1.0", f"coefficient = {MU}": "coefficient = 0.0"}
    behind |= {f"normal_stiffness = {KN}": "normal_stiffness = 1e4"}
    text = CASE
    for old, new in behind.items():
        assert old in text
        text = text.replace(old, new)
    assert call("check", put(tmp_path, text)) == 0
    lowest = np.sqrt(np.linalg.eigvalsh(K)[0]) / 2 / np.pi
    assert f"linear mode 1 with contact as at rest: {lowest:.6g} Hz" in capfd.readouterr().out


def test_a_body_that_friction_alone_would_hold_keeps_its_number(tmp_path: Path, capfd) -> None:
    """A block of 10 kg slides without friction, 1 kg swings on it: not mode 1, the rigid motion, but the swing."""
    matrices = "M = [[10.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]\n"
    matrices += "K = [[0.1, 0.0, -0.1], [0.0, 2.0, 0.0], [-0.1, 0.0, 0.1]]\n"
    text = CASE.replace('dofs = ["x", "y"]', 'dofs = ["x", "y", "z"]').replace('= "x"', '= "z"')
    text = re.sub("M = .*\nK = .*\n", matrices, text).replace(f"coefficient = {MU}", "coefficient = 0.0")
    assert call("check", put(tmp_path, text)) == 0
    swing = np.sqrt(0.1 * (1 + 1 / 10)) / 2 / np.pi
    assert f"linear mode 1 with contact as at rest: {swing:.6g} Hz" in capfd.readouterr().out


def settled() -> float:
    """Where the branch is damped: mu N = kt |x|, N less by what the settled slider's mean force c = mu kn |y| takes.

    That is kn c G, G = 1 / det of the structure with its closed pair, by which a tangential force moves the normal.
    """
    y, G = 1.0, 1 / np.linalg.det(K + np.diag([0.0, KN]))
    return MU * N0 / (KT + MU * KN * G * MU * KN * y)


def test_a_branch_is_damped_from_there(tmp_path: Path, capfd) -> None:
    """Not from first slip on; the estimate leaves out what the settled slider does through the structure, 8 % here."""
    assert call("run", put(tmp_path), "--no-plots", "-q", "--out", tmp_path / "run") == 0
    with open(tmp_path / "run" / "mode.csv", newline="") as file:
        rows = [(float(row["amplitude"]), float(row["zeta"])) for row in csv.DictReader(file)]
    first, lasting, _ = expected()
    assert settled() == pytest.approx(lasting, rel=0.08)
    before = [zeta for a, zeta in rows if first < a < 0.9999 * settled()]
    beyond = [zeta for a, zeta in rows if 1.0001 * settled() < a < lasting]
    assert len(before) > 3 and max(map(abs, before)) < SOLVED
    assert len(beyond) > 1 and min(beyond) > 1e-3


def test_normal_loads_are_balanced_unless_told_otherwise(tmp_path: Path, capfd) -> None:
    """Without [preload] as with it, and a note says so; `balanced = false` gives (K + kn) x = -N0 at rest."""
    path = put(tmp_path, CASE.replace("[preload]\npair_loads = true\n", ""))
    assert call("check", path) == 0
    said = capfd.readouterr().out
    assert "normal forces sum to 2 N" in said and slips(said) == pytest.approx(expected()[:2], rel=5e-3)
    assert "note: contact 'pad': its normal_load is taken as balanced" in said
    assert call("check", path, "--set", "preload.balanced=false") == 0
    said = capfd.readouterr().out
    x, y = np.linalg.solve(K + np.diag([KT, KN]), [0.0, -N0])
    assert f"normal forces sum to {N0 + KN * y:.5g} N" in said and "note" not in said
    assert KT * abs(x) < MU * (N0 + KN * y), "it sticks"
    assert "at rest: 1 stick" in said


LOADED = """
[model]
dofs = ["x"]
M = [[1.0]]
K = [[3.0]]
loads_at_speed = { pull = { 3000 = [0.2] } }
speed_rpm = 3000.0
[preload]
loads = ["pull"]
[[contact]]
name = "slider"
law = "jenkins"
pairs = ["x"]
tangential_stiffness = 2.0
friction_limit = 1.0
"""
FORCED = """
[[analysis]]
name = "forced"
type = "forced"
harmonics = 5
samples = 64
force = { x = 0.1 }
levels = [1.0]
frequency = [0.2, 0.5]
observe = "x"
"""


@pytest.mark.parametrize("analysis", [CASE[CASE.index("[[analysis]]") :], FORCED])
@pytest.mark.parametrize("loads, kept", [(True, [0, 1, 2, 3, 4, 5]), (False, [1, 3, 5])])
def test_harmonics_are_those_that_a_run_keeps(tmp_path: Path, capfd, analysis: str, loads, kept) -> None:
    """Of a law that is odd without load, about the displacement of one: even harmonics and the mean are kept."""
    path = put(tmp_path, (LOADED if loads else LOADED.replace('[preload]\nloads = ["pull"]\n', "")) + analysis)
    name = "mode" if '"mode"' in analysis else "forced"
    assert call("check", path) == 0
    said = capfd.readouterr().out
    assert call("run", path, "--no-plots", "-q", "--out", tmp_path / "run") == 0
    with h5py.File(tmp_path / "run" / "results.h5") as file:
        numbers = sorted({int(label.decode().rstrip("cs")) for label in file[name]["harmonic"][:]})
        assert numbers == kept and f"1 x {file[name]['coefficients'].shape[2]} = " in said
    assert ("even harmonics and the mean" in said) == (0 not in kept)


def test_amplitudes_that_never_slip(tmp_path: Path, capfd) -> None:
    assert call("check", put(tmp_path), "--set", "mode.amplitude=[0.01, 0.1]") == 0
    said = capfd.readouterr().out
    assert "warning: no amplitude of 'mode' is expected to make a pair slip in every period" in said
    assert "measured: at most 0.1 m" in said and f"more than about {expected()[1]:.3g} m" in said and "  fix: " in said


def warned(capfd, path: Path, *overrides: str) -> str:
    """What one warning says, with exit code 0."""
    assert call("check", path, "--no-solve", *(word for text in overrides for word in ("--set", text))) == 0
    said = capfd.readouterr().out
    assert said.count("warning: ") == 1, said
    warning = said.split("warning: ")[1]
    assert all(f"  {label}:" in warning for label in ("where", "measured", "expected", "fix"))
    return warning


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("contact.pad.normal_stiffness=1e6", ("far stiffer", "pad.normal_stiffness", "pair 0, 5e+05 times", "own 2")),
        ("contact.pad.tangential_stiffness=1e-5", ("far softer", "pad.tangential_stiffness", "3e-06 times", "own 3")),
        ("contact.pad.friction_coefficient=30.0", ("coefficient of friction", "pad.friction_coefficient", "at most 2")),
        ("contact.pad.normal_load=0.0", ("no pair of contact 'pad' is loaded", "pad.normal_load", "0 in every pair")),
    ],
)
def test_numbers_that_look_wrong_beside_others(tmp_path: Path, capfd, override: str, words: tuple[str, ...]) -> None:
    warning = warned(capfd, put(tmp_path), override)
    assert all(word in warning for word in words), warning


@pytest.mark.parametrize(("stiffness", "said"), [(5e-5, False), (5e-6, True)])
def test_a_contact_softer_than_its_node_alone_holds(tmp_path: Path, capfd, stiffness: float, said: bool) -> None:
    """At the end of ten unit springs in a row, 1/10 together, a spring k is the share k / (k + 1/10): 5e-4 or 5e-5."""
    n = 10
    chain = np.diag([2.0] * (n - 1) + [1.0]) - np.eye(n, k=1) - np.eye(n, k=-1)
    text = f"""
[model]
dofs = {[f"x{k}" for k in range(n)]}
M = {np.eye(n).tolist()}
K = {chain.tolist()}
[[contact]]
name = "end"
law = "jenkins"
pairs = ["x9"]
tangential_stiffness = {stiffness}
friction_limit = 1.0
[[analysis]]
name = "modes"
type = "linear"
"""
    assert call("check", put(tmp_path, text), "--no-solve") == 0
    assert ("contact 'end' is far softer" in capfd.readouterr().out) == said


@pytest.mark.parametrize(
    "override",
    ["contact.pad.normal_stiffness=1.9e4", "contact.pad.friction_coefficient=2.0", "contact.pad.gap=-1.0"],
)
def test_numbers_that_do_not(tmp_path: Path, capfd, override: str) -> None:
    """Just below a bound; a load of 0 beside an interference."""
    more = ("--set", "contact.pad.normal_load=0.0") if "gap" in override else ()
    assert call("check", put(tmp_path), "--no-solve", "--set", override, *more) == 0
    assert "warning" not in capfd.readouterr().out


def test_the_wheel_that_stands_still_and_the_amplitude_of_its_size(capfd) -> None:
    """Centrifugal loads at speed 0; metres for millimetres."""
    cases = LAP_JOINT.parents[1]
    warning = warned(capfd, cases / "blisk_lumped" / "case.toml", "model.options.speed_rpm=0.0")
    assert "contact 'groove' is loaded" in warning and "model.options.speed_rpm = 0" in warning
    assert "give a speed above 0" in warning
    warning = warned(capfd, LAP_JOINT, "mode.amplitude=[0.1, 400.0]")
    assert "'mode' goes to amplitudes of the model's own size" in warning and "400 mm" in warning


@pytest.mark.parametrize("name", ["two_dof", "blisk_lumped", "blisk_ring --quick", "lap_joint"])
def test_cases_that_are_shipped_look_right(capfd, name: str) -> None:
    """That of blisk_ring on its coarse mesh: the reduction of the fine one takes a minute."""
    name, *short = name.split()
    assert call("check", LAP_JOINT.parents[1] / name / "case.toml", *short) == 0
    assert "warning" not in capfd.readouterr().out


def test_without_solving(tmp_path: Path, capfd) -> None:
    assert call("check", put(tmp_path), "--no-solve", "--set", "mode.amplitude=[0.01, 0.1]") == 0
    said = capfd.readouterr().out
    assert "no errors" in said and "at rest" not in said and "warning" not in said


def test_no_state_at_rest_is_told_after_all_else(tmp_path: Path, capfd) -> None:
    """A body that friction alone could hold, without a load: the mode is a rigid motion, in `run` as here."""
    text = CASE.replace(f"K = {K.tolist()}", "K = [[0.0, 0.0], [0.0, 2.0]]").replace(f"load = {N0}", "load = 0.0")
    assert call("check", put(tmp_path, text)) == 2
    out, err = capfd.readouterr()
    assert "harmonics 0, 1" in out
    assert "nothing holds the structure at rest" in err and "analysis 'mode'" in err and "dof x moves most" in err


def test_analyses_without_a_state_at_rest_end_as_their_run_does(tmp_path: Path, capfd) -> None:
    """A pad that pushes itself off its own contact, in two analyses: one message, exit code 3, the free dof named."""
    text = CASE.replace(f"K = {K.tolist()}", "K = [[3.0, 0.0], [0.0, 0.0]]").replace(
        "pair_loads = true", "balanced = false"
    )
    again = text[text.index("[[analysis]]") :].replace('"mode"\ntype', '"again"\ntype')
    assert call("check", put(tmp_path, text + again)) == 3
    said = capfd.readouterr().err
    assert said.count("error:") == 1 and "analysis 'mode'" in said and "analysis 'again'" in said
    assert "no static equilibrium" in said and "dof y most" in said


@pytest.mark.parametrize("stiffness", [1e9, 1e12, 1e15, 1e18])
def test_contact_however_stiff_hides_no_frequency(capfd, stiffness: float) -> None:
    """The first stuck frequency is that of ties, which CalculiX gives 42.5672 Hz (cases/lap_joint/README.md)."""
    both = [f"--set=contact.joint.{name}_stiffness={stiffness:g}" for name in ("normal", "tangential")]
    assert call("check", LAP_JOINT, "--only", "rest", *both) == 0
    out = capfd.readouterr().out
    assert "stuck contact: 42.5672 to 1080.94 Hz are off by 1.9e-06 (first)" in out
    assert "25 stick, 0 slip, 0 open; normal forces sum to 500 N" in out


def test_on_two_ranks_as_on_one(launch) -> None:
    told = []
    for ranks in (1, 2):
        done = launch(ranks, "-m", "fretwave", "check", str(LAP_JOINT), "--only", "rest,mode")
        assert (done.returncode, done.stderr) == (0, "")
        told.append([line for line in done.stdout.splitlines() if "reduction" not in line])
    one, two = ([re.sub(r"\(solved in .*\)", "", line) for line in lines] for lines in told)
    assert one == two
    assert any("25 stick, 0 slip, 0 open; normal forces sum to 500 N" in line for line in one)


RIGID = """law = "regularised_coulomb"
pairs = ["y"]
friction_limit = 5.0
regularisation_velocity = 0.05

[[analysis]]"""


def test_a_mode_that_rigid_contact_does_not_leave_is_refused(tmp_path: Path, capfd) -> None:
    """Two dofs, one held, and the second mode asked for: in `run` as here."""
    text = re.sub(r'law = "coulomb_2d".*?\[\[analysis\]\]', RIGID, CASE, flags=re.S).replace("pair_loads = true", "")
    case = put(tmp_path, text.replace('normalise = "x"', 'normalise = "x"\nlinear_mode = 2'))
    for command in (["check", case], ["run", case, "--no-plots", "--out", tmp_path / "run"]):
        assert call(*command) == 2
        said = capfd.readouterr().err
        assert "there is no linear mode 2" in said and "fix:" in said
