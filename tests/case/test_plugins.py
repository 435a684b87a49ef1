"""A law and an analysis, each one file that a case names: right in table, picture and view, by the command line."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import h5py
import numpy as np
import pytest
from command_line import call
from models import three_pads
from models.three_pads import CONTACT, FRICTION, LIFTED, SPRINGS
from models.vtkhdf_files import read_step
from tolerances import SOLVED

from fretwave import registry
from fretwave.case import plugins
from fretwave.case.analysis import AnalysisSection, forget_analysis
from fretwave.case.load import load_case
from fretwave.results.reader import Run

pytestmark = pytest.mark.ranks(1)

MODELS = Path(three_pads.__file__).parent
#: As where neither MPI nor PETSc is installed.
BLOCKED = """
import sys

class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in ("mpi4py", "petsc4py", "slepc4py") or name == "fretwave._core":
            raise ModuleNotFoundError(name)

sys.meta_path.insert(0, Blocked())
from fretwave import main
sys.exit(main(sys.argv[1:]))
"""
FREQUENCIES = [10.0, 100.0, 300.0]
LOSS = 0.02
CASE = f"""
plugins = ["toy_law.py", "toy_analysis.py"]

[model]
builder = "model.py"
mass_damping = 2.0

[preload]
pair_loads = false
loads = ["press"]

[[contact]]
name = "pads"
law = "toy_pad"
squeeze = {CONTACT}
shear = {CONTACT}
rub = {FRICTION}

[[analysis]]
name = "line"
type = "receptance"
dof = "across"
frequency = {FREQUENCIES}
loss = {LOSS}
modes = 9
after = "rest"

[[analysis]]
name = "rest"
type = "static"

[[analysis]]
name = "mode"
type = "mode"
linear_mode = 2
harmonics = 2
samples = 64
normalise = "across"
amplitude = [1e-8, 1e-7]
"""


@pytest.fixture(autouse=True)
def forgotten():
    """Each test ends without plug-ins, as a process of the command line begins."""
    yield
    forget_all()


def forget_all() -> None:
    for plugin in plugins.loaded():
        plugins.forget(plugin.path)


def put(folder: Path, text: str = CASE, **files: str) -> Path:
    """The case with its files in a folder."""
    shutil.copy(MODELS / "three_pads.py", folder / "model.py")
    for name in ("toy_law.py", "toy_analysis.py"):
        shutil.copy(MODELS / name, folder / name)
    for name, content in files.items():
        (folder / f"{name}.py").write_text(content)
    (folder / "case.toml").write_text(text)
    return folder / "case.toml"


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> Path:
    """The finished run of a process that then knew the plug-ins."""
    folder = tmp_path_factory.mktemp("toys")
    assert call("run", put(folder), "--out", folder / "run") == 0
    return folder / "run"


def expected(frequency: float) -> complex:
    """1 N over the dynamic stiffness of the one dof: a mass of 4 kg on ground and stuck contact springs."""
    stiffness = SPRINGS[1] + CONTACT
    return 1.0 / (stiffness * (1 + 1j * LOSS) - 4.0 * (2 * np.pi * frequency) ** 2)


def test_an_analysis_of_one_file_is_right_in_its_table(run: Path) -> None:
    table = Run(run).table("line")
    assert table["frequency_hz"].tolist() == FREQUENCIES
    assert table["amplitude"] == pytest.approx([abs(expected(f)) for f in FREQUENCIES], rel=SOLVED)
    assert "rest, line, mode" in (run / "run.log").read_text().splitlines()[1], "after the analysis that it needs"
    assert "line: 3 frequencies, 3 pairs at rest" in (run / "run.log").read_text()


def test_an_analysis_of_one_file_draws_its_picture(run: Path) -> None:
    assert (run / "line_receptance.png").exists(), "drawn by the run"
    (run / "line_receptance.png").unlink()
    assert call("plot", run, "--only", "line") == 0
    assert (run / "line_receptance.png").exists()


def test_its_figure_has_the_table_s_values(run: Path) -> None:
    call("plot", run, "--only", "none_of_them")  # knows the plug-ins from then on
    figures = dict(registry.kinds()["receptance"].figures(Run(run)))
    (line,) = figures["line_receptance"].axes[0].get_lines()
    assert line.get_xydata()[:, 1] == pytest.approx([abs(expected(f)) for f in FREQUENCIES], rel=SOLVED)


def test_an_analysis_of_one_file_is_right_in_the_view(run: Path) -> None:
    """Four phases of the motion x(t) = Re X e^{i omega t} of the one dof that moves, at the last frequency."""
    assert call("view", run, "--analysis", "line", "--phases", "4", "--point", 2) == 0
    for phase in range(4):
        moved = read_step(run / "line.vtkhdf", phase)["displacement"]
        x = (expected(FREQUENCIES[2]) * np.exp(1j * phase * np.pi / 2)).real
        assert moved[0, 1] == pytest.approx(x, rel=SOLVED)
        assert np.abs(np.delete(moved.ravel(), 1)).max() <= SOLVED * abs(x)


def test_a_law_of_one_file_is_right_in_table_picture_and_view(run: Path) -> None:
    """What sticks, slips and hangs is known in closed form (`three_pads`)."""
    words = ["stick", "slip", "open"]
    table = Run(run).table("rest")
    assert table["status"].tolist() == words
    assert table["gap"] == pytest.approx([0.0, 0.0, LIFTED], rel=SOLVED, abs=1e-18)
    assert (run / "mode_map_pads.png").exists()
    assert call("view", run, "--analysis", "mode", "--phases", "4") == 0
    for phase in range(4):
        assert read_step(run / "mode_contact.vtkhdf", phase)["status"].tolist() == [0, 1, 2]


def test_check_says_what_a_plugin_s_analysis_would_do(tmp_path, capfd) -> None:
    assert call("check", put(tmp_path)) == 0
    assert "line: receptance of across at 3 frequencies" in capfd.readouterr().out


def test_keys_of_a_plugin_are_listed(tmp_path, capfd) -> None:
    assert call("check", "--keys", put(tmp_path)) == 0
    told = capfd.readouterr().out
    assert '[[analysis]] with type = "receptance"' in told and "loss factor of all modes" in told


def test_checks_of_a_plugin_are_told_with_their_places(tmp_path, capfd) -> None:
    text = CASE.replace('dof = "across"', 'dof = "acros"').replace(f"{FREQUENCIES}", "[10.0, 3.0]")
    assert call("check", put(tmp_path, text)) == 2
    told = capfd.readouterr().err
    assert "unknown dof 'acros'" in told and "did you mean `across`?" in told
    assert "line.frequency is out of order" in told and "case.toml:23 (line.frequency)" in told


def test_two_ranks_know_the_plugins(tmp_path, launch) -> None:
    """The case is read on one rank alone and sent to the other."""
    put(tmp_path)
    run = launch(2, "-m", "fretwave", "run", str(tmp_path / "case.toml"), "--out", str(tmp_path / "run"), timeout=300)
    assert run.returncode == 0, run.stderr
    assert Run(tmp_path / "run").table("line")["amplitude"][1] == pytest.approx(abs(expected(100.0)), rel=SOLVED)
    assert Run(tmp_path / "run").table("rest")["status"].tolist() == ["stick", "slip", "open"]


def test_a_changed_plugin_is_a_changed_case(run: Path, tmp_path, capfd) -> None:
    shutil.copytree(run.parent, tmp_path / "all")
    folder = tmp_path / "all" / "run"
    record = (folder / "run.json").read_text().replace(str(run.parent), str(tmp_path / "all"))
    (folder / "run.json").write_text(record)
    forget_all()
    plugin = tmp_path / "all" / "toy_analysis.py"
    for code, said in ((0, "line: already done"), (2, "plugins.toy_analysis.py")):
        assert call("resume", folder, "--no-plots") == code
        told = capfd.readouterr()
        assert said in told.out + told.err
        plugin.write_text(plugin.read_text() + "\n# another text\n")


def test_a_finished_run_is_drawn_where_neither_plugin_nor_mpi_is(run: Path, tmp_path, launch) -> None:
    """The record keeps the texts."""
    shutil.copytree(run, tmp_path / "run")
    record = (tmp_path / "run" / "run.json").read_text().replace(str(run.parent), str(tmp_path / "gone"))
    (tmp_path / "run" / "run.json").write_text(record)
    (tmp_path / "run" / "line_receptance.png").unlink(missing_ok=True)
    done = launch(1, "-c", BLOCKED, "plot", str(tmp_path / "run"), timeout=300)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "run" / "line_receptance.png").exists() and "nothing of the plug-in" not in done.stdout


def test_a_plugin_s_analysis_is_swept(tmp_path) -> None:
    text = CASE + '[[analysis]]\nname = "losses"\ntype = "sweep"\nof = "line"\nover = { line.loss = [0.02, 0.5] }\n'
    assert call("run", put(tmp_path, text), "--out", tmp_path / "run", "--only", "losses", "--no-plots") == 0
    with h5py.File(tmp_path / "run" / "results.h5") as file:
        points, amplitude = file["losses/summary/points"][()], file["losses/points/amplitude"][()]
    assert points.tolist() == [3, 3]
    assert amplitude[:3] == pytest.approx([abs(expected(f)) for f in FREQUENCIES], rel=SOLVED)
    assert (amplitude[3:] < amplitude[:3]).all()


def test_a_reduction_keeps_the_dofs_that_a_plugin_s_analysis_names(tmp_path) -> None:
    chain = [[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 2.0]]
    case = tmp_path / "case.toml"
    shutil.copy(MODELS / "toy_analysis.py", tmp_path)
    case.write_text(f"""
plugins = ["toy_analysis.py"]
[model]
dofs = ["a", "b", "c"]
M = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
K = {chain}
[reduction]
modes = 1
[[analysis]]
name = "line"
type = "receptance"
dof = "b"
frequency = [0.1]
""")
    assert load_case(case).keep == [1]


ANALYSIS = """
import fretwave as fw
from typing import Literal
class {name}(fw.AnalysisSection):
    {body}
fw.register_analysis({name})
"""


def test_a_plugin_that_fails_takes_no_kind_of_the_package_along(tmp_path) -> None:
    """One that it asked for first; in a process of its own, for here all are there already."""
    (tmp_path / "bad.py").write_text(
        ANALYSIS.format(name="Own", body='type: Literal["forced"]\n    def run(self, c): ...')
    )
    code = """
from pathlib import Path
import fretwave as fw
from fretwave import registry
from fretwave.case import plugins
try:
    plugins.load_file(Path("bad.py"))
except fw.InputError as error:
    print("two files register" in str(error), "forced" in registry.kinds())
"""
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=True, capture_output=True, text=True)
    assert done.stdout.split() == ["True", "True"]


WRONG = {
    "raises": ("x = 1\n1 / 0\n", "the plug-in failed: ZeroDivisionError", "bad.py:2"),
    "does not parse": ("x = 1\n\nclass (:\n", "the plug-in failed: SyntaxError", "bad.py:3"),
    "leaves": ("import sys\nsys.exit(3)\n", "the plug-in failed: SystemExit", "bad.py:2"),
    "adds nothing": ("x = 1\n", "the plug-in adds nothing", "bad.py"),
    "is no analysis": ("import fretwave as fw\nfw.register_analysis(int)\n", "it is no kind of analysis", "bad.py:2"),
    "has no run": (ANALYSIS.format(name="Idle", body='type: Literal["idle"]'), "it has no `run`", "bad.py:6"),
    "has no name": (ANALYSIS.format(name="Idle", body="def run(self, c): ..."), "`type` is no single name", "bad.py:6"),
    "hides a method": (
        ANALYSIS.format(name="Idle", body='type: Literal["idle"]\n    needs: str = "x"\n    def run(self, c): ...'),
        "a key has the name of a method",
        "bad.py:8",
    ),
    "draws with nothing": (
        ANALYSIS.format(name="Idle", body='type: Literal["idle"]\n    pictures = ("x",)\n    def run(self, c): ...'),
        "its pictures are not there",
        "bad.py:8",
    ),
    "takes a name of the package": (
        ANALYSIS.format(name="Idle", body='type: Literal["mode"]\n    def run(self, c): ...'),
        "two files register a type of analysis 'mode'",
        "bad.py:7",
    ),
    "takes a name of another": (
        (MODELS / "toy_analysis.py").read_text() + "# another file\n",
        "two files register a type of analysis 'receptance'",
        "bad.py:18",
    ),
    "takes a law of another": (
        (MODELS / "toy_law.py").read_text() + "# another file\n",
        "two files register a contact law 'toy_pad'",
        "bad.py:9",
    ),
    "takes a compiled law": (
        (MODELS / "toy_law.py").read_text().replace('"toy_pad"', '"jenkins"'),
        "a contact law of this name is there already",
        "bad.py:9",
    ),
}


@pytest.mark.parametrize("slip", WRONG)
@pytest.mark.filterwarnings("ignore::UserWarning")
def test_what_a_plugin_does_wrong_is_said_with_its_line(slip: str, tmp_path, capfd) -> None:
    text, what, where = WRONG[slip]
    case = put(tmp_path, CASE.replace('"toy_analysis.py"]', '"toy_analysis.py", "bad.py"]'), bad=text)
    assert call("check", case) == 2
    told = capfd.readouterr().err
    assert what in told and where in told and "fix:" in told and "Traceback" not in told
    assert told.count("error") == 1, "not also all that it would have added"


def test_what_a_plugin_raises_in_a_run_is_not_called_a_defect_of_ours(tmp_path, launch) -> None:
    case = put(tmp_path)
    plugin = tmp_path / "toy_analysis.py"
    text = plugin.read_text().replace("        writer.close(", "        raise KeyError('lost')\n        writer.close(")
    plugin.write_text(text)
    line = 1 + text[: text.index("raise KeyError")].count("\n")
    run = launch(
        1, "-m", "fretwave", "run", str(case), "--out", str(tmp_path / "run"), "--only", "rest,line", timeout=300
    )
    assert run.returncode == 1 and "Traceback" not in run.stderr
    assert f"toy_analysis.py:{line}" in run.stderr and "correct the plug-in" in run.stderr
    assert "defect of fretwave" not in run.stderr


def test_a_picture_that_fails_leaves_the_others(run: Path, tmp_path, capfd) -> None:
    shutil.copytree(run.parent, tmp_path / "all")
    folder, plugin = tmp_path / "all" / "run", tmp_path / "all" / "toy_analysis.py"
    (folder / "run.json").write_text((folder / "run.json").read_text().replace(str(run.parent), str(tmp_path / "all")))
    (folder / "mode_map_pads.png").unlink(missing_ok=True)
    forget_all()
    plugin.write_text(plugin.read_text().replace("yield f", "yield no_such_name, f"))
    assert call("plot", folder) == 0
    assert "no picture 'receptance' of these results: NameError" in capfd.readouterr().out
    assert (folder / "mode_map_pads.png").exists()


@pytest.mark.parametrize(
    "given, what",
    [
        ('["toy_lav.py", "toy_analysis.py"]', "there is no such plug-in"),
        ('"toy_law.py"', "plugins is no list of files"),
        ('["model.h5"]', "there is no such plug-in"),
    ],
)
def test_a_plugin_that_is_not_there_is_said_with_the_key_s_place(given: str, what: str, tmp_path, capfd) -> None:
    case = put(tmp_path, CASE.replace('["toy_law.py", "toy_analysis.py"]', given))
    assert call("check", case) == 2
    told = capfd.readouterr().err
    assert what in told and "case.toml:2 (plugins" in told and "fix:" in told
    if "lav" in given:
        assert "did you mean `toy_law.py`?" in told


def test_a_file_that_changed_takes_the_place_of_what_it_was(tmp_path) -> None:
    """Within one process, a script or a notebook."""
    case = put(tmp_path)
    load_case(case)
    first = registry.kinds()["receptance"]
    assert load_case(case).analyses["line"].__class__ is first, "the same text is executed once"
    (tmp_path / "toy_analysis.py").write_text((MODELS / "toy_analysis.py").read_text().replace("0.01,", "0.03,"))
    second = load_case(case).analyses["line"].__class__
    assert second is not first and second.model_fields["loss"].default == 0.03
    assert registry.kinds()["receptance"] is second


def test_a_script_may_register_again_what_it_changed(monkeypatch) -> None:
    """A cell of a notebook that is run twice."""
    notebook = ModuleType("notebook")
    monkeypatch.setitem(sys.modules, "notebook", notebook)
    for _ in range(2):
        exec((MODELS / "toy_analysis.py").read_text(), notebook.__dict__)
        assert registry.kinds()["receptance"] is notebook.Receptance
    forget_analysis(notebook.Receptance)
    assert "receptance" not in registry.kinds()


def test_the_recipe_names_all_that_a_kind_may_have_of_its_own() -> None:
    """What the package's own kinds change of `AnalysisSection` stands in CONTRIBUTING."""
    recipe = (Path(__file__).parents[2] / "src" / "CONTRIBUTING.md").read_text()
    general = {name for name in vars(AnalysisSection) if not name.startswith(("_", "model_"))}
    classes = {base for kind in registry.kinds().values() for base in kind.__mro__ if issubclass(base, AnalysisSection)}
    own = {name for one in classes - {AnalysisSection} for name in general & set(vars(one))}
    assert "spins" in own and [name for name in sorted(own) if not re.search(rf"`[^|]*\b{name}\b", recipe)] == []
