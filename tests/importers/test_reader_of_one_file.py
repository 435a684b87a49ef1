"""The recipe of a reader of matrix files: one file, known to a case and to ``fretwave import``."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp
from command_line import call
from models import toy_format
from tolerances import SOLVED

from fretwave.case import plugins
from fretwave.errors import InputError
from fretwave.importers import formats, read_matrix
from fretwave.results import model_file
from fretwave.results.reader import Run

pytestmark = pytest.mark.ranks(1)

TOY = Path(toy_format.__file__)
formats.forget_format(toy_format.read)  # known by its import here; each test brings it as a user does
M = np.diag([1.0, 2.0, 4.0])
K = np.array([[3.0, -1.0, 0.0], [-1.0, 3.0, -1.0], [0.0, -1.0, 1.0 / 3.0]]) * 1e4
CASE = """
plugins = ["toy_format.py"]
[model]
dofs = ["a", "b", "c"]
M = "M.tri"
K = "K.tri"
C = [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]
[[contact]]
name = "damper"
law = "jenkins"
tangential_stiffness = 1e3
friction_limit = 1.0
pairs = ["c"]
[[analysis]]
name = "mode"
type = "mode"
harmonics = 1
samples = 16
normalise = "a"
amplitude = [1e-6, 2e-6]
"""


@pytest.fixture(autouse=True)
def forgotten():
    yield
    for plugin in plugins.loaded():
        plugins.forget(plugin.path)


def put(folder: Path) -> Path:
    shutil.copy(TOY, folder)
    for name, A in (("M", M), ("K", K)):
        entries = sp.coo_matrix(A)
        lines = np.column_stack([entries.row + 1, entries.col + 1, entries.data])
        np.savetxt(folder / f"{name}.tri", lines, "%.17g", header="row column value", comments="")
    (folder / "case.toml").write_text(CASE)
    return folder / "case.toml"


def test_a_case_reads_it(tmp_path: Path) -> None:
    """Stuck, the damper is a spring: the table has the linear frequency."""
    assert call("run", put(tmp_path), "--out", tmp_path / "run", "--no-plots") == 0
    stuck = K + np.diag([0.0, 0.0, 1e3])
    omega = np.sqrt(np.linalg.eigvals(np.linalg.solve(M, stuck)).real.min())
    assert Run(tmp_path / "run").table("mode")["omega"] == pytest.approx(omega, rel=SOLVED)


def test_the_importer_reads_it(tmp_path: Path) -> None:
    put(tmp_path)
    out, mass, stiffness = (tmp_path / name for name in ("model.h5", "M.tri", "K.tri"))
    plugin = tmp_path / "toy_format.py"
    assert call("import", out, "--mass", mass, "--stiffness", stiffness, "--plugin", plugin, "--modes", 1) == 0
    model = model_file.read_model(out)
    assert np.array_equal(model.M.toarray(), M) and np.array_equal(model.K.toarray(), K)


def test_a_damaged_file_is_refused_in_words(tmp_path: Path, capfd) -> None:
    case = put(tmp_path)
    (tmp_path / "K.tri").write_text("row column value\n1 1 none\n")
    assert call("check", case) == 2
    assert "K.tri: ValueError: could not convert string" in capfd.readouterr().err
    with pytest.raises(InputError, match=r"the file of K cannot be read"):
        read_matrix(str(tmp_path / "K.tri"), "K")


def test_without_the_plugin_the_format_is_not_known(tmp_path: Path) -> None:
    put(tmp_path)
    with pytest.raises(InputError, match="the format of the file of K is not known"):
        read_matrix(str(tmp_path / "K.tri"), "K")


def test_one_suffix_has_one_reader(tmp_path: Path) -> None:
    put(tmp_path)
    plugins.load_file(tmp_path / "toy_format.py")
    (tmp_path / "other.py").write_text(TOY.read_text() + "# another file\n")
    with pytest.raises(InputError, match=r"two files register a format of matrices '\.tri'"):
        plugins.load_file(tmp_path / "other.py")
    with pytest.raises(InputError, match="it is no suffix"):
        formats.register_format("tri")


RETURNED = {
    "nothing": "None",
    "two": "(A, A)",
    "words": "A.astype(str)",
    "flat": "A.ravel()",
    "masked": "np.ma.masked_equal(A, -1e4)",
}


@pytest.mark.parametrize("name", RETURNED)
def test_a_reader_that_returns_no_matrix_is_told_so(name: str, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    """What stood behind a mask was taken, and the others were sent to the formats of the package."""
    path = put(tmp_path)
    text = TOY.read_text().replace("return coo_matrix(", "A = coo_matrix(")
    (tmp_path / "toy_format.py").write_text(f"{text.rstrip()}.toarray()\n    return {RETURNED[name]}\n")
    assert call("check", path) == 2
    told = " ".join(capsys.readouterr().err.split())
    assert "the reader of .tri files returned no matrix of numbers" in told and "correct the plug-in" in told


def test_what_a_reader_raises_is_told_with_its_kind(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    path = put(tmp_path)
    (tmp_path / "K.tri").write_text("heading\n1 x 2\n")
    assert call("check", path) == 2
    told = " ".join(capsys.readouterr().err.split())
    assert "K.tri: ValueError: " in told and "write it again, or correct the plug-in" in told and "savez" not in told
