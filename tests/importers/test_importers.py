"""Importers: one small model through every format, triangles, and what wrong files are told."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse as sp
from models.matrix_files import EXACT, Held, write_calculix, write_npz, write_petsc, write_v5, write_v73
from tolerances import ROUNDING

import fretwave as fw
from fretwave.commands.main import main
from fretwave.importers import assemble, read_matrix
from fretwave.results import model_file

pytestmark = pytest.mark.ranks(1)

DATA = Path(__file__).parents[1] / "data" / "calculix"


@pytest.fixture(scope="module")
def held() -> Held:
    return Held()


def frequencies(K: sp.spmatrix, M: sp.spmatrix) -> np.ndarray:
    return np.sqrt(scipy.linalg.eigh(K.toarray(), M.toarray(), eigvals_only=True)) / (2 * np.pi)


def digits(held: Held, kind: str) -> float:
    """What 14 digits of the entries allow: d(omega)/omega <= 5e-14 |phi|^T (|K| + omega^2 |M|) |phi| / (2 omega^2)."""
    if kind in EXACT:
        return 0.0
    squares, shapes = scipy.linalg.eigh(held.K.toarray(), held.M.toarray())
    share = [abs(x) @ ((abs(held.K) + s * abs(held.M)) @ abs(x)) / (2 * s) for s, x in zip(squares, shapes.T)]
    return float(5e-14 * max(share))


@pytest.mark.parametrize("kind", [*EXACT, "CalculiX"])
def test_one_model_through_every_format(held: Held, kind: str, tmp_path: Path) -> None:
    """Bitwise but for CalculiX, which writes 14 digits."""
    write = EXACT.get(kind, write_calculix)
    given = [write(tmp_path, A, letter, held.labels) for letter, A in (("M", held.M), ("K", held.K))]
    assert main(["import", str(tmp_path / "m.h5"), "--mass", given[0], "--stiffness", given[1]]) == 0
    model = model_file.read_model(tmp_path / "m.h5")
    for A, was in ((model.M, held.M), (model.K, held.K)):
        assert abs(A - was).max() <= (0 if kind in EXACT else 5e-14) * abs(was).max()
        assert abs(A - A.T).max() == 0
    np.testing.assert_allclose(
        frequencies(model.K, model.M), frequencies(held.K, held.M), rtol=ROUNDING + digits(held, kind)
    )
    if kind in ("CalculiX", "Abaqus, matrix input"):
        assert model.dof_names[0] == "n7x"
        np.testing.assert_array_equal(model.labels, held.labels)


def test_matrices_that_calculix_wrote(tmp_path: Path, capfd) -> None:
    """A deck, its matrices and its frequencies of CalculiX 2.20, which prints seven digits: 5e-7 at worst."""
    parts = ["--mass", str(DATA / "block.mas"), "--stiffness", str(DATA / "block.sti")]
    assert main(["import", str(tmp_path / "m.h5"), *parts, "--coordinates", str(DATA / "block.inp")]) == 0
    model = model_file.read_model(tmp_path / "m.h5")
    found = frequencies(model.K, model.M)[: len(CALCULIX_HZ)]
    np.testing.assert_allclose(found, CALCULIX_HZ, rtol=5e-7)
    assert model.dof_names[:3] == ["n5x", "n5y", "n5z"]
    assert [s.role for s in model_file.read_sources(tmp_path / "m.h5")[1]] == [
        "mass",
        "stiffness",
        "coordinates",
        "dofs",
    ]
    text = capfd.readouterr().out
    for said in (
        "upper triangle, mirrored",
        "rigid modes: 0 found, expected 0",
        "without the 4 nodes that have no dof",
    ):
        assert said in text
    assert "units: like m-kg-s for a solid" in text and "warning" not in text


#: Of CalculiX, *FREQUENCY on the deck of block.inp.
CALCULIX_HZ = [8099.358, 13332.14, 14782.41, 34664.54]


@pytest.mark.ranks(1, 2)
def test_import_on_any_number_of_ranks(comm, shared_tmp: Path, capfd) -> None:
    """Rank 0 reads and writes; the frequencies are computed together, and one rank speaks."""
    parts = ["--mass", str(DATA / "block.mas"), "--stiffness", str(DATA / "block.sti")]
    assert main(["import", str(shared_tmp / "m.h5"), *parts]) == 0
    comm.barrier()
    assert model_file.read_model(shared_tmp / "m.h5").n_dof == 24
    assert capfd.readouterr().out.count("8099.36, 13332.1, 14782.4, 34664.5") == (comm.rank == 0)


@pytest.mark.parametrize("asked", ["auto", "right"])
@pytest.mark.parametrize("side", ["lower", "upper", "full"])
def test_triangles(held: Held, side: str, asked: str, tmp_path: Path) -> None:
    part = {"lower": sp.tril, "upper": sp.triu, "full": sp.csr_matrix}[side](held.K).tocsr()
    given = {"K": read_matrix(write_npz(tmp_path, part, "K", held.labels), "K")}
    found = assemble(given, side if asked == "right" else "auto")
    assert (found.matrices["K"] != held.K).nnz == 0
    assert found.symmetry["K"].startswith(side)


@pytest.mark.parametrize("asked", ["auto", "lower", "upper"])
def test_a_triangle_in_an_order_of_its_own(held: Held, asked: str, tmp_path: Path) -> None:
    """A triangle by Abaqus' numbering lies on both sides of the diagonal of ours."""
    found = assemble({"K": read_matrix(EXACT["Abaqus, matrix input"](tmp_path, held.K, "K", held.labels), "K")}, asked)
    assert (found.matrices["K"] != held.K).nnz == 0
    assert found.symmetry["K"] == "one triangle, mirrored"


def test_a_diagonal_mass_is_no_triangle(tmp_path: Path) -> None:
    entries = read_matrix(write_npz(tmp_path, sp.eye(4, format="csr"), "M", np.zeros(0)), "M")
    entries_k = read_matrix(write_npz(tmp_path, sp.eye(4, format="csr"), "K", np.zeros(0)), "K")
    assert assemble({"M": entries, "K": entries_k}).symmetry["M"] == "diagonal"


def test_abaqus_leaves_out_what_it_held(tmp_path: Path) -> None:
    """1e36 on the diagonal of K is Abaqus' way to hold a dof; internal nodes (negative) stay, last."""
    (tmp_path / "K.mtx").write_text("1,1, 1,1, 1e36\n2,1, 2,1, 3.0\n-1,1, -1,1, 5.0\n-1,1, 2,1, -2.0\n")
    (tmp_path / "M.mtx").write_text("1,1, 1,1, 7.0\n2,1, 2,1, 1.0\n-1,1, -1,1, 2.0\n")
    given = {letter: read_matrix(str(tmp_path / f"{letter}.mtx"), letter) for letter in "MK"}
    found = assemble(given)
    assert found.names == ["n2x", "n-1x"]
    np.testing.assert_array_equal(found.matrices["K"].toarray(), [[3.0, -2.0], [-2.0, 5.0]])
    np.testing.assert_array_equal(found.matrices["M"].toarray(), [[1.0, 0.0], [0.0, 2.0]])
    assert found.notes == ["left out: 1 dof held by a penalty on the diagonal of K"]


def test_abaqus_dofs_without_mass_are_said(tmp_path: Path) -> None:
    (tmp_path / "K.mtx").write_text("1,1, 1,1, 2.0\n2,1, 1,1, -1.0\n2,1, 2,1, 2.0\n")
    (tmp_path / "M.mtx").write_text("2,1, 2,1, 1.0\n")
    found = assemble({letter: read_matrix(str(tmp_path / f"{letter}.mtx"), letter) for letter in "MK"})
    assert found.matrices["M"].shape == (2, 2)
    assert found.notes == ["1 dof without an entry in M, the first is n1x"]


def write_text(name: str, text: str) -> Callable[[Path], str]:
    def write(folder: Path) -> str:
        (folder / name).write_text(text)
        return str(folder / name)

    return write


def write_array(array: np.ndarray) -> Callable[[Path], str]:
    def write(folder: Path) -> str:
        np.save(folder / "A.npy", array)
        return str(folder / "A.npy")

    return write


def several(folder: Path) -> str:
    np.savez(folder / "several.npz", A=np.eye(2), B=np.eye(2))
    return str(folder / "several.npz")


def stray(folder: Path) -> str:
    A = np.triu(np.ones((5, 5))) + 5 * np.eye(5)
    A[4, 0] = 0.5
    np.save(folder / "A.npy", A)
    return str(folder / "A.npy")


def cut_petsc(folder: Path) -> str:
    path = Path(write_petsc(folder, sp.eye(5, format="csr"), "K", np.zeros(0)))
    path.write_bytes(path.read_bytes()[:-3])
    return str(path)


def cyclic(folder: Path) -> str:
    (folder / "job.dof").write_text("1.1\n")
    return write_text("job.sti", "1 1 2.0\n2 2 2.0\n")(folder)


WRONG: dict[str, tuple[Callable[[Path], str], str]] = {
    "missing": (lambda folder: str(folder / "K.npz"), "does not exist"),
    "not square": (write_array(np.ones((2, 3))), "2 x 3"),
    "another size": (write_array(np.eye(3)), "M and K differ in size"),
    "not a number": (write_array(np.array([[1.0, np.nan], [np.nan, 1.0]])), "K[0][1] = nan"),
    "complex": (write_array(np.eye(2) * 1j), "K is complex"),
    "not symmetric": (write_array(np.array([[2.0, 1.0], [0.5, 2.0]])), "not symmetric"),
    "stray": (stray, "1 stray entries"),
    "which of several": (several, "it holds A, B"),
    "variable": (lambda folder: several(folder) + ":D", "no variable D"),
    "unknown format": (write_text("K.txt", "hello\n"), "is not known"),
    "four columns": (write_text("K.mtx", "1 2 3 4\n"), "is not known"),
    "cut line": (write_text("K.mtx", "1 1 3.0\n1 2\n"), "no table of 3 columns"),
    "index from 0": (write_text("K.mtx", "0 0 3.0\n"), "not a number from 1 on"),
    "label": (write_text("K.mtx", "1,1,1.5,1,3.0\n"), "not a whole number"),
    "cut PETSc file": (cut_petsc, "cannot be read"),
    "table of dofs": (cyclic, "that of a nodal diameter"),
    "cut MATLAB file": (write_text("K.mat", "MATLAB 5.0 MAT-file, cut"), "cannot be read"),
    "cut MATLAB 7.3 file": (write_text("K.mat", "MATLAB 7.3 MAT-file, cut"), "cannot be read"),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_wrong_matrices(wrong: str, tmp_path: Path, capfd) -> None:
    write, said = WRONG[wrong]
    np.save(tmp_path / "M.npy", np.eye(5 if wrong == "stray" else 2))
    command = ["import", str(tmp_path / "m.h5"), "--mass", str(tmp_path / "M.npy"), "--stiffness", write(tmp_path)]
    assert main(command) == 2
    text = capfd.readouterr().err
    assert text.startswith("error: ") and said in text and "  where: " in text
    assert not (tmp_path / "m.h5").exists()


@pytest.mark.parametrize(
    ("asked", "corner", "said"),
    [("lower", 0, "6 in the other"), ("full", 1, "1 stray"), ("full", 0, "none in the other")],
)
def test_asked_for_another_triangle(asked: str, corner: float, said: str, tmp_path: Path, held: Held) -> None:
    A = np.triu(np.ones((4, 4)))
    A[3, 0] = corner
    given = {"K": read_matrix(write_npz(tmp_path, sp.csr_matrix(A), "K", held.labels), "K")}
    with pytest.raises(fw.InputError, match=said):
        assemble(given, asked)


def test_matlab_files_are_told_apart_by_what_they_begin_with(held: Held, tmp_path: Path) -> None:
    for write, kind in ((write_v5, "MATLAB 5"), (write_v73, "MATLAB 7.3")):
        path = Path(write(tmp_path, held.K, "K", held.labels).removesuffix(":A"))
        renamed = path.rename(tmp_path / "matrix.data")
        assert read_matrix(str(renamed) + (":A" if write is write_v5 else ""), "K").kind == kind
