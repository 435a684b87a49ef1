"""Case files and options that nobody should write: each is refused in words with exit code 2, or run; none breaks."""

from __future__ import annotations

import shutil
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from random import Random

import numpy as np
import pytest
from command_line import call
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from models.chain_case import BUILDER

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "cases" / "robustness"))
import bases  # noqa: E402
from commands import Worker  # noqa: E402
from mutations import as_toml, mutated  # noqa: E402

from fretwave.mpi.petsc_values import complaint  # noqa: E402
from fretwave.post.cycles import extract  # noqa: E402
from fretwave.post.mode_curve import ModeCurve  # noqa: E402
from fretwave.post.response_peaks import peak_table  # noqa: E402

pytestmark = pytest.mark.ranks(1)


@pytest.fixture(scope="module")
def worker() -> Iterator[Worker]:
    with Worker() as one:
        yield one


@pytest.fixture(scope="module")
def folder() -> Iterator[Path]:
    with tempfile.TemporaryDirectory() as name:
        bases.prepare(Path(name))
        yield Path(name)


@settings(max_examples=100, deadline=None, derandomize=True, database=None, suppress_health_check=list(HealthCheck))
@given(base=st.sampled_from(sorted(bases.SHORT)), random=st.randoms(use_true_random=False), run=st.integers(0, 9))
def test_mutated_cases_are_refused_or_run(worker: Worker, folder: Path, base: str, random: Random, run: int) -> None:
    """The short form of cases/robustness/fuzz_cases.py."""
    case = bases.SHORT[base]()
    (folder / base / "case.toml").write_text(as_toml(mutated(random, case)), encoding="utf-8")
    only = random.choice(case["analysis"])["name"]
    action = ["run", "--no-plots", "--out", str(folder / "out"), "--only", only] if run == 0 else ["check"]
    ended = worker.run([*action, "case.toml"], folder / base, 60.0)
    assert not ended.bad, (ended.outcome, ended.text)


@pytest.mark.parametrize("base", bases.SHORT)
def test_the_right_cases_are_right(worker: Worker, folder: Path, base: str) -> None:
    """What is mutated passes all checks: else nothing behind them would be reached."""
    (folder / base / "case.toml").write_text(as_toml(bases.SHORT[base]()), encoding="utf-8")
    assert worker.run(["check", "case.toml"], folder / base, 60.0).outcome == "done"


#: What stands in place of a line of two_dof -> what is said.
WRONG_LINES = {
    'type = ["mode"]': ('type = "mode"', "unknown type of analysis"),
    "type = {}": ('type = "mode"', "unknown type of analysis"),
    "harmonics = 1000000000000000000000000000000": ("harmonics = 21", "<= 2147483647"),
    f"harmonics = {'9' * 400}": ("harmonics = 21", "<= 2147483647"),
    f"harmonics = {'9' * 5000}": ("harmonics = 21", "is not TOML"),
    f"harmonics = {'[' * 3000}{']' * 3000}": ("harmonics = 21", "is not TOML"),
    f"harmonics = {'[' * 50}{']' * 50}": ("harmonics = 21", "nested too deeply"),
    "samples = 1099511627776": ("samples = 1024", "<= 2147483647"),
    "samples = 2147483646": ("samples = 1024", "of memory: 2147483646 samples"),
    "harmonics = 2147483647": ("harmonics = 21\nsamples = 1024", "of memory"),
    "periods = 2147483647": ("periods = 60", "of memory"),
    f'name = "{"x" * 5000}"': ('name = "mode"', "at most 100 characters"),
    'name = "a/b"': ('name = "mode"', "a name of letters"),
    'name = "m\u00b2"': ('name = "mode"', "a name of letters"),
    'dofs = ["m1\\n", "m2"]': ('dofs = ["m1", "m2"]', "printable characters"),
    'dofs = ["", "m2"]': ('dofs = ["m1", "m2"]', "printable characters"),
    'title = "\\u0000"': ('title = "Two-dof oscillator with a friction damper"', "the character NUL"),
    "friction_limit = 1000000000000000000000000000000.0e300": ("friction_limit = 5.0", "is not finite"),
    f"friction_limit = {10**399}": ("friction_limit = 5.0", "is not finite"),
    "M = [[1.0, 0.0], [0.0, 1e300]]": ("M = [[1.0, 0.0], [0.0, 0.02]]", "too large"),
    'M = "\\u00b2.npz"': ("M = [[1.0, 0.0], [0.0, 0.02]]", "does not exist"),
    f'M = "{"x" * 5000}.npz"': ("M = [[1.0, 0.0], [0.0, 0.02]]", "does not exist"),
    "M = []": ("M = [[1.0, 0.0], [0.0, 0.02]]", "differ in length"),
    'petsc = "-snes_rtol nan"': ('method = "CNM"', "0 to below 1"),
}


@pytest.mark.parametrize("wrong", WRONG_LINES, ids=lambda text: text[:30])
def test_wrong_value_is_refused_in_words(wrong: str, tmp_path: Path, capfd) -> None:
    right, said = WRONG_LINES[wrong]
    text = (bases.TWO_DOF / "case.toml").read_text(encoding="utf-8")
    assert right in text
    (tmp_path / "case.toml").write_text(text.replace(right, wrong, 1), encoding="utf-8")
    assert call("check", tmp_path / "case.toml") == 2
    error = capfd.readouterr().err
    assert said in error and "Traceback" not in error and len(error) < 5000


@pytest.mark.parametrize(
    "override",
    [
        *("mode.\u00b2=1", "mode.harmonics=[", "mode.harmonics=1\n2=3", f"mode.harmonics={'9' * 5000}", "=", "a..b=1"),
        *(
            f"mode.harmonics={'[' * 3000}",
            "model.M.0.0=1",
            "contact.damper.pairs.99999999999999999999=1",
            "mode.type=[]",
        ),
    ],
    ids=lambda text: text[:25],
)
def test_wrong_override_is_refused_in_words(override: str, capfd) -> None:
    assert call("check", bases.TWO_DOF / "case.toml", "--set", override) == 2
    error = capfd.readouterr().err
    assert error.startswith("error: ") and "Traceback" not in error and len(error) < 5000


#: PETSc options of a mode -> what was expected of them.
WRONG_OPTIONS = {
    "-snes_rtol abc": "a number from 0 to below 1",
    "-snes_rtol 1e400": "a number from 0 to below 1",
    "-snes_stol -1": "a finite number from 0 up",
    "-snes_max_it -5": "a whole number from 0 up",
    "-snes_max_it": "a whole number from 0 up",
    "-snes_type": "the name of a type",
    "-ksp_type nonsense": "a name that PETSc knows",
    "-pc_type nonsense": "a name that PETSc knows",
    "-snes_linesearch_type nonsense": "a name that PETSc knows",
    "-snes_lag_jacobian 0": "what the solvers in use can do",
    "-snes_force_iteration 2": "true or false",
    "-snes_lag_preconditioner 2.5": "a whole number of 32 bits",
    "-ksp_rtol 0.5": "options of the solvers in use",
    "-": "pairs",
}


@pytest.mark.parametrize("wrong", WRONG_OPTIONS)
def test_wrong_petsc_option_is_bad_input(wrong: str, tmp_path: Path, capfd) -> None:
    """Named with its value and what was expected; PETSc's own words stay inside."""
    (tmp_path / "case.toml").write_text(as_toml(bases.two_dof()), encoding="utf-8")
    assert call("run", tmp_path / "case.toml", "--only", "mode", "--out", tmp_path / "out", f"--petsc={wrong}") == 2
    error = capfd.readouterr().err
    assert wrong.split()[0] in error and WRONG_OPTIONS[wrong] in error
    assert "PETSC ERROR" not in error and ".cpp" not in error and not (tmp_path / "out").exists()


def test_right_values_of_options_pass() -> None:
    right = {"snes_rtol": "1e-9", "ksp_max_it": "200", "snes_atol": "0", "snes_monitor": None, "pc_type": "lu"}
    assert [complaint(name, value) for name, value in right.items()] == [None] * len(right)


#: A builder's text -> what is said of it, beside its file and line.
BUILDERS = {
    "import sys\ndef build(**o):\n    sys.exit(0)\n": ("SystemExit", "model.py:3"),
    "def build(**o):\n    return 3\n": ("returned int", "model.py"),
    "def build(n: int = 1):\n    return [] + n\n": ("TypeError", "model.py:2"),
    "def build(**o):\n    return build(**o)\n": ("RecursionError", "model.py:2"),
    "import fretwave\ndef build(**o):\n    return fretwave.Structure(M='a', K=None)\n": (
        "no usable model",
        "model.py",
    ),
    "import fretwave\ndef build(**o):\n    return fretwave.Structure(M=[[1.0]], K=[[1.0]], dofs=3)\n": (
        "no usable model",
        "model.py",
    ),
    "import fretwave, numpy as np\ndef build(**o):\n    return fretwave.Structure(*np.zeros((2, 0, 0)))\n": (
        "no dofs",
        "model.py",
    ),
    "import fretwave\ndef build(**o):\n    return fretwave.Structure([[float('nan')]], [[1.0]], dofs={'tip': 0})\n": (
        "not a number",
        "case.toml",
    ),
}


@pytest.mark.parametrize("text", BUILDERS, ids=lambda text: BUILDERS[text][0])
def test_whatever_a_builder_does_is_said_with_its_line(text: str, tmp_path: Path, capfd) -> None:
    (tmp_path / "model.py").write_text(text)
    (tmp_path / "case.toml").write_text(
        '[model]\nbuilder = "model.py"\n[[analysis]]\nname = "mode"\ntype = "mode"\nharmonics = 1\nnormalise = "tip"\n'
        "amplitude = [0.1, 1.0]\n"
    )
    assert call("check", tmp_path / "case.toml") == 2
    error = capfd.readouterr().err
    assert all(said in error for said in BUILDERS[text]) and "Traceback" not in error


def test_option_of_another_type_names_the_builders_line(tmp_path: Path, capfd) -> None:
    """A builder that checks no types: its own exception comes out as a message."""
    shutil.copy(BUILDER, tmp_path / "model.py")
    (tmp_path / "case.toml").write_text(as_toml(bases.chain()))
    assert call("check", tmp_path / "case.toml", "--set", "model.options.tilt=3") == 2
    assert "tilt" in capfd.readouterr().err
    text = (tmp_path / "model.py").read_text().replace("tuple[float, float]", "Any")
    (tmp_path / "model.py").write_text(text.replace("    n = 3 * o.masses\n", "    n = 3 * o.masses\n    o.tilt[5]\n"))
    assert call("check", tmp_path / "case.toml", "--set", "model.options.tilt=3") == 2
    error = capfd.readouterr().err
    assert "TypeError" in error and "model.py:" in error


@pytest.mark.parametrize("rows", [1, 2])
def test_a_branch_of_one_point_has_its_values_there_and_no_peak(rows: int) -> None:
    """Twice the same point is one as well."""
    same = {"amplitude": 0.1, "omega": 2.0, "omega0": 2.0, "zeta": 0.01, "level": 1.0, "phase": 0.0}
    table = {name: np.full(rows, value) for name, value in same.items()} | {"event": np.full(rows, "")}
    curve = ModeCurve.from_table(table)
    (found,) = curve.all_at(0.1)
    assert (found.omega, found.zeta) == pytest.approx((2.0, 0.01)) and not curve.all_at(0.2) and not curve.crossings()
    peaks = peak_table(table, {"mode": curve})
    assert len(peaks["level"]) == 1 and all(np.isnan(peaks[name][0]) for name in peaks if name != "level")
    assert len(extract(np.zeros(1), np.ones(1), np.zeros(1))) == 0


def test_pictures_of_a_branch_of_two_points(tmp_path: Path, capfd) -> None:
    (tmp_path / "case.toml").write_text(as_toml(bases.two_dof()), encoding="utf-8")
    short = [f"--set={name}.step.max_points=2" for name in ("mode", "forced")]
    assert call("run", tmp_path / "case.toml", "--only", "mode,forced", "--out", tmp_path / "out", *short) == 3
    assert call("plot", tmp_path / "out") == 0
    assert "Warning" not in capfd.readouterr().err and (tmp_path / "out" / "mode_backbone.png").exists()


def test_a_time_integration_starts_on_its_mode(tmp_path: Path, capfd) -> None:
    case = tmp_path / "case.toml"
    case.write_text(as_toml(bases.two_dof()), encoding="utf-8")
    outside = ["--set", "free_decay.amplitude=[2.0]", "--out", tmp_path / "other"]
    assert call("run", case, "--only", "mode,free_decay", "--set=mode.step.max_points=2", *outside) == 2
    assert "outside the mode's branch" in capfd.readouterr().err
    stopped = ["--set=mode.step.max_points=2", "--out", tmp_path / "out"]
    assert call("run", case, "--only", "mode,free_decay", "--set", "free_decay.amplitude=[0.12]", *stopped) == 3
    assert "does not reach start 0" in capfd.readouterr().err


def test_sliders_are_not_integrated_without_their_memory(tmp_path: Path, capfd) -> None:
    case = tmp_path / "case.toml"
    text = (bases.TWO_DOF / "case.toml").read_text(encoding="utf-8")
    text = text.replace("regularisation_velocity = 0.05 ", "tangential_stiffness = 1e13")
    case.write_text(text.replace('law = "regularised_coulomb"', 'law = "jenkins"'), encoding="utf-8")
    assert call("check", case) == 2
    error = capfd.readouterr().err
    assert all(f"{name} needs time integration" in error for name in ("forced.time_points", "free_decay.type"))
