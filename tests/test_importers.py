"""Importers: one small model through every format, triangles, pairs, and what wrong input is told."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path

import h5py
import hexahedra
import numpy as np
import pytest
import scipy.io
import scipy.linalg
import scipy.sparse as sp
from petsc4py import PETSc

import fretwave as fw
from fretwave import model_file
from fretwave.cli import main
from fretwave.importers import assemble, read_matrix
from fretwave.importers.nodes import read_nodes

pytestmark = pytest.mark.ranks(1)

DATA = Path(__file__).parent / "data" / "calculix"


class Held:
    """A bar held at x = 0: matrices of the free dofs, and node (from 1) and direction of each."""

    def __init__(self) -> None:
        self.bar = hexahedra.bar((3, 2, 1), (0.06, 0.02, 0.01))
        self.free = np.setdiff1d(np.arange(self.bar.K.shape[0]), self.bar.layer(0.0))
        self.M, self.K = (symmetric(A[self.free][:, self.free]) for A in (self.bar.M, self.bar.K))
        self.labels = np.column_stack([self.free // 3 + 1, self.free % 3 + 1])


def symmetric(A: sp.csr_matrix) -> sp.csr_matrix:
    """Without the rounding of the assembly: a triangle then says all."""
    lower = sp.tril(A, -1)
    return (lower + lower.T + sp.diags(A.diagonal())).tocsr()


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


def text_of(A: sp.spmatrix, line: Callable[[int, int, float], str]) -> str:
    found = A.tocoo()
    return "".join(line(i, j, v) + "\n" for i, j, v in zip(found.row.tolist(), found.col.tolist(), found.data.tolist()))


# One writer a format: (folder, matrix, letter, labels) -> what --mass or --stiffness is given.


def write_npz(folder: Path, A: sp.csr_matrix, letter: str, _: np.ndarray) -> str:
    sp.save_npz(folder / f"{letter}.npz", A)
    return str(folder / f"{letter}.npz")


def write_dense_npz(folder: Path, A: sp.csr_matrix, letter: str, _: np.ndarray) -> str:
    np.savez(folder / f"{letter}d.npz", **{letter: A.toarray(), "other": np.zeros((3, 3))})
    return str(folder / f"{letter}d.npz")


def write_npy(folder: Path, A: sp.csr_matrix, letter: str, _: np.ndarray) -> str:
    np.save(folder / f"{letter}.npy", A.toarray())
    return str(folder / f"{letter}.npy")


def write_mtx(folder: Path, A: sp.csr_matrix, letter: str, _: np.ndarray) -> str:
    scipy.io.mmwrite(str(folder / f"{letter}.mtx"), A, symmetry="symmetric", precision=17)
    return str(folder / f"{letter}.mtx")


def write_general_mtx(folder: Path, A: sp.csr_matrix, letter: str, _: np.ndarray) -> str:
    scipy.io.mmwrite(str(folder / f"{letter}g.mtx"), A, symmetry="general", precision=17)
    return str(folder / f"{letter}g.mtx")


def write_v5(folder: Path, A: sp.csr_matrix, letter: str, _: np.ndarray) -> str:
    scipy.io.savemat(folder / f"{letter}5.mat", {"A": A, "x": "text"})
    return f"{folder / letter}5.mat:A"


def write_v73(folder: Path, A: sp.csr_matrix, letter: str, _: np.ndarray) -> str:
    """As MATLAB's ``save -v7.3``: 512 bytes of heading, then HDF5."""
    path, columns = folder / f"{letter}73.mat", A.tocsc()
    with h5py.File(path, "w", userblock_size=512) as file:
        group = file.create_group({"M": "mass", "K": "stiffness"}[letter])
        group.attrs["MATLAB_class"] = np.bytes_("double")
        group.attrs["MATLAB_sparse"] = np.uint64(A.shape[0])
        group["data"], group["ir"] = columns.data, columns.indices.astype("u8")
        group["jc"] = columns.indptr.astype("u8")
        file["full"] = np.arange(6.0).reshape(2, 3)
    heading = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(116) + bytes(8) + struct.pack("<H", 0x0200) + b"IM"
    with path.open("r+b") as file:
        file.write(heading)
    return str(path)


def write_petsc(folder: Path, A: sp.csr_matrix, letter: str, _: np.ndarray) -> str:
    mat = PETSc.Mat().createAIJ(A.shape, csr=(A.indptr, A.indices, A.data), comm=PETSc.COMM_SELF)
    viewer = PETSc.Viewer().createBinary(str(folder / f"{letter}.bin"), "w", comm=PETSc.COMM_SELF)
    mat.view(viewer)
    viewer.destroy()
    return str(folder / f"{letter}.bin")


def write_dense_petsc(folder: Path, A: sp.csr_matrix, letter: str, _: np.ndarray) -> str:
    mat = PETSc.Mat().createDense(A.shape, array=A.toarray(), comm=PETSc.COMM_SELF)
    viewer = PETSc.Viewer().createBinary(str(folder / f"{letter}d.bin"), "w", comm=PETSc.COMM_SELF)
    viewer.pushFormat(PETSc.Viewer.Format.NATIVE)
    mat.view(viewer)
    viewer.destroy()
    return str(folder / f"{letter}d.bin")


def write_long_petsc(folder: Path, A: sp.csr_matrix, letter: str, _: np.ndarray) -> str:
    """As PETSc with 64-bit indices writes it."""
    integers = [[1211216, *A.shape, A.nnz], np.diff(A.indptr), A.indices]
    content = b"".join(np.asarray(part).astype(">i8").tobytes() for part in integers) + A.data.astype(">f8").tobytes()
    (folder / f"{letter}64.bin").write_bytes(content)
    return str(folder / f"{letter}64.bin")


def write_calculix(folder: Path, A: sp.csr_matrix, letter: str, labels: np.ndarray) -> str:
    """Upper triangle, column by column, "%d %d %20.13e" (CalculiX, matrixstorage.c)."""
    path = folder / ("job.mas" if letter == "M" else "job.sti")
    upper = sp.triu(A).tocsc().T  # rows of the transpose: columns in their order
    path.write_text(text_of(upper.tocsr(), lambda i, j, v: f"{j + 1} {i + 1} {v:20.13e}"))
    path.with_suffix(".dof").write_text("".join(f"{node}.{direction}\n" for node, direction in labels))
    return str(path)


def write_abaqus(folder: Path, A: sp.csr_matrix, letter: str, labels: np.ndarray) -> str:
    """Matrix input (Abaqus Keywords Reference, *MATRIX INPUT): a triangle in an order of dofs of the code's own."""
    order = np.random.default_rng(1).permutation(len(labels))
    names = [f"{node},{direction}" for node, direction in labels[order]]
    lower = sp.tril(A[order][:, order])
    lines = text_of(lower, lambda i, j, v: f"{names[i]}, {names[j]}, {v:.16e}")
    (folder / f"job_{letter}1.mtx").write_text("** Abaqus\n" + lines)
    return str(folder / f"job_{letter}1.mtx")


def write_coordinate(folder: Path, A: sp.csr_matrix, letter: str, _: np.ndarray) -> str:
    """FORMAT=COORDINATE: row, column, entry, all entries."""
    (folder / f"job_{letter}2.mtx").write_text(text_of(A, lambda i, j, v: f"{i + 1} {j + 1} {v:.16e}"))
    return str(folder / f"job_{letter}2.mtx")


EXACT = {
    "npz": write_npz,
    "dense npz": write_dense_npz,
    "npy": write_npy,
    "Matrix Market": write_mtx,
    "Matrix Market, general": write_general_mtx,
    "MATLAB 5": write_v5,
    "MATLAB 7.3": write_v73,
    "PETSc": write_petsc,
    "PETSc, dense": write_dense_petsc,
    "PETSc, 64-bit": write_long_petsc,
    "Abaqus, matrix input": write_abaqus,
    "Abaqus, coordinate": write_coordinate,
}


@pytest.mark.parametrize("kind", [*EXACT, "CalculiX"])
def test_one_model_through_every_format(held: Held, kind: str, tmp_path: Path) -> None:
    """Bitwise but for CalculiX, which writes 14 digits."""
    write = EXACT.get(kind, write_calculix)
    given = [write(tmp_path, A, letter, held.labels) for letter, A in (("M", held.M), ("K", held.K))]
    assert main(["import", str(tmp_path / "m.h5"), "--mass", given[0], "--stiffness", given[1]]) == 0
    model = model_file.read(tmp_path / "m.h5")
    for A, was in ((model.M, held.M), (model.K, held.K)):
        assert abs(A - was).max() <= (0 if kind in EXACT else 5e-14) * abs(was).max()
        assert abs(A - A.T).max() == 0
    np.testing.assert_allclose(
        frequencies(model.K, model.M), frequencies(held.K, held.M), rtol=1e-12 + digits(held, kind)
    )
    if kind in ("CalculiX", "Abaqus, matrix input"):
        assert model.names[0] == "n7x"
        np.testing.assert_array_equal(np.column_stack([model.node, model.direction]), held.labels)


def test_matrices_that_calculix_wrote(tmp_path: Path, capfd) -> None:
    """A deck, its matrices and its frequencies of CalculiX 2.20, which prints seven digits: 5e-7 at worst."""
    parts = ["--mass", str(DATA / "block.mas"), "--stiffness", str(DATA / "block.sti")]
    assert main(["import", str(tmp_path / "m.h5"), *parts, "--coordinates", str(DATA / "block.inp")]) == 0
    model = model_file.read(tmp_path / "m.h5")
    found = frequencies(model.K, model.M)[: len(CALCULIX_HZ)]
    np.testing.assert_allclose(found, CALCULIX_HZ, rtol=5e-7)
    assert model.names[:3] == ["n5x", "n5y", "n5z"]
    assert [s.role for s in model.sources] == ["mass", "stiffness", "coordinates", "dofs"]
    text = capfd.readouterr().out
    for said in (
        "upper triangle, mirrored",
        "rigid modes: 0 found, expected 0",
        "without the 4 nodes that have no dof",
    ):
        assert said in text
    assert "SI (m, kg, s)" in text and "warning" not in text


#: Of CalculiX, *FREQUENCY on the deck of block.inp.
CALCULIX_HZ = [8099.358, 13332.14, 14782.41, 34664.54]


@pytest.mark.ranks(1, 2)
def test_import_on_any_number_of_ranks(comm, shared_tmp: Path, capfd) -> None:
    """Rank 0 reads and writes; the frequencies are computed together, and one rank speaks."""
    parts = ["--mass", str(DATA / "block.mas"), "--stiffness", str(DATA / "block.sti")]
    assert main(["import", str(shared_tmp / "m.h5"), *parts]) == 0
    comm.barrier()
    assert model_file.read(shared_tmp / "m.h5").size == 24
    assert capfd.readouterr().out.count("8099.36, 13332.1, 14782.4, 34664.5") == (comm.rank == 0)


def test_report_of_a_free_body(held: Held, tmp_path: Path, capfd) -> None:
    bar = held.bar
    text = report_of(tmp_path, bar.M, bar.K, bar.nodes, capfd)
    mass = hexahedra.DENSITY * 0.06 * 0.02 * 0.01
    assert f"mass: {mass:.6g} along x, {mass:.6g} along y, {mass:.6g} along z\n" in text
    assert "rigid modes: 6 found, expected 6" in text
    elastic = np.sqrt(scipy.linalg.eigh(bar.K.toarray(), bar.M.toarray(), eigvals_only=True)[6:12]) / (2 * np.pi)
    assert "first frequencies [1/time]: " + ", ".join(f"{value:.6g}" for value in elastic) in text
    assert "warning" not in text


def report_of(folder: Path, M: sp.spmatrix, K: sp.spmatrix, nodes: np.ndarray, capfd: pytest.CaptureFixture) -> str:
    parts = [write_npz(folder, sp.csr_matrix(A), letter, np.zeros(0)) for letter, A in (("M", M), ("K", K))]
    np.savez(folder / "nodes.npz", coordinates=nodes)
    command = ["import", str(folder / "m.h5"), "--mass", parts[0], "--stiffness", parts[1]]
    assert main([*command, "--coordinates", str(folder / "nodes.npz")]) == 0
    return capfd.readouterr().out


def test_report_warns_of_a_mechanism(tmp_path: Path, capfd) -> None:
    """Two bricks that share one edge turn about it: a seventh motion without force in one body."""
    brick = hexahedra.bar((1, 1, 1), (0.02, 0.02, 0.02))
    other = brick.nodes + [0.02, 0, 0]
    shared = {
        8 + k: int(np.flatnonzero(np.isclose(brick.nodes, x).all(axis=1)))
        for k, x in enumerate(other)
        if x[0] < 0.021 and x[2] == 0
    }
    rest = [k for k in range(8, 16) if k not in shared]
    place = {**shared, **{k: 8 + number for number, k in enumerate(rest)}}
    joined = np.array([place.get(k, k) for k in range(16)])
    T = sp.kron(sp.csr_matrix((np.ones(16), (np.arange(16), joined))), sp.identity(3))
    M, K = (T.T @ sp.block_diag([A, A]) @ T for A in (brick.M, brick.K))
    text = report_of(tmp_path, M, K, np.vstack([brick.nodes, other])[[*range(8), *rest]], capfd)
    assert "rigid modes: 7 found, expected 6" in text
    assert "warning: K has 7 rigid modes, the nodes and what holds them let expect 6: a mechanism" in text


def test_report_warns_of_what_cannot_be(held: Held, tmp_path: Path, capfd) -> None:
    """Grams beside newtons and metres; a dof without stiffness; a dof without mass in one direction."""
    bar, cut = held.bar, np.ones(held.bar.K.shape[0])
    assert "warning: units" in report_of(tmp_path, 1e3 * bar.M, bar.K, bar.nodes, capfd)
    cut[-1] = 0
    text = report_of(tmp_path, bar.M, sp.diags(cut) @ bar.K @ sp.diags(cut), bar.nodes, capfd)
    assert "warning: 1 dof with no stiffness, the first is n24z" in text
    text = report_of(tmp_path, sp.diags(1 - 2 * (cut == 0)) @ bar.M.multiply(sp.eye(len(cut))), bar.K, bar.nodes, capfd)
    assert "warning: 1 dof with negative mass, the first is n24z" in text
    assert "the mass differs along x, y and z" in text
    loose = report_of(tmp_path, *(sp.diags(cut) @ A @ sp.diags(cut) for A in (bar.M, bar.K)), bar.nodes, capfd)
    assert "warning: 1 dof with no mass" in loose and "warning: the frequencies cannot be computed" in loose
    assert model_file.read(tmp_path / "m.h5").size == len(cut)
    K = bar.K - sp.diags(1e-3 * bar.K.diagonal().max() * (cut == 0))
    assert "warning: K is negative for a motion" in report_of(tmp_path, bar.M, K, bar.nodes, capfd)


@pytest.mark.parametrize("asked", ["auto", "right"])
@pytest.mark.parametrize("side", ["lower", "upper", "full"])
def test_triangles(held: Held, side: str, asked: str, tmp_path: Path) -> None:
    part = {"lower": sp.tril, "upper": sp.triu, "full": sp.csr_matrix}[side](held.K).tocsr()
    given = {"K": read_matrix(write_npz(tmp_path, part, "K", held.labels), "K")}
    found = assemble(given, side if asked == "right" else "auto")
    assert (found.matrices["K"] != held.K).nnz == 0
    assert found.symmetry["K"].startswith(side)


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


DECK = """*HEADING
 a plate
** comment
*Node, nset=All
 10, 0., 0., 0.
 20, 1., 0., 0.
 30, 1., 1.
*NODE
 40, 0., 1., 5e-1
*NSET, NSET=Odd,
 GENERATE
 10, 30, 20
*ELEMENT, TYPE=S4
 1, 10, 20, 30, 40
*INCLUDE, INPUT=sets.inp
*STEP
"""


def test_deck(tmp_path: Path) -> None:
    (tmp_path / "plate.inp").write_text(DECK)
    (tmp_path / "sets.inp").write_text("*NSET, NSET=BOTH\nodd, 40\n")
    nodes = read_nodes(tmp_path / "plate.inp")
    np.testing.assert_array_equal(nodes.numbers, [10, 20, 30, 40])
    np.testing.assert_array_equal(nodes.coordinates[2:], [[1, 1, 0], [0, 1, 0.5]])
    assert {name: list(members) for name, members in nodes.sets.items()} == {
        "ALL": [10, 20, 30],
        "ODD": [10, 30],
        "BOTH": [10, 30, 40],
    }


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("*NODE, SYSTEM=C\n1, 1., 0., 0.\n", "not rectangular"),
        ("*NODE\n1, 1., zero, 0.\n", "this is no node"),
        ("*NODE\n1, 1.\n*NODE\n1, 2.\n", "stands twice"),
        ("*NODE\n1, 1.\n*NSET, NSET=A\nB\n", "names 'B'"),
        ("*INSTANCE, NAME=I, PART=P\n0., 0., 1.\n", "an instance is moved"),
        ("*HEADING\n", "has no nodes"),
        ("*INCLUDE, INPUT=nowhere.inp\n", "does not exist"),
        ("1, 0., 0., 0.\n2, 0., 0.\n", "no table"),
    ],
)
def test_wrong_decks(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "deck.inp").write_text(text)
    with pytest.raises(fw.InputError, match=said):
        read_nodes(tmp_path / "deck.inp")


class Two:
    """Two bars end to end, not joined: the first one's end and the second one's begin coincide."""

    def __init__(self) -> None:
        self.first = hexahedra.bar((2, 2, 1), (0.04, 0.02, 0.01))
        self.whole = hexahedra.bar((4, 2, 1), (0.08, 0.02, 0.01))
        self.nodes = np.vstack([self.first.nodes, self.first.nodes + [0.04, 0, 0]])
        self.ends = np.flatnonzero(np.isclose(self.nodes[:, 0], 0.04)) + 1
        self.M, self.K = (sp.block_diag([A, A], format="csr") for A in (self.first.M, self.first.K))

    def write(self, folder: Path) -> list[str]:
        parts = [write_npz(folder, A, letter, np.zeros(0)) for letter, A in (("M", self.M), ("K", self.K))]
        mine = self.ends <= len(self.first.nodes)
        np.savez(folder / "n.npz", coordinates=self.nodes, left=self.ends[mine], right=np.flip(self.ends[~mine]))
        coordinates = ["--coordinates", str(folder / "n.npz")]
        return ["import", str(folder / "m.h5"), "--mass", parts[0], "--stiffness", parts[1], *coordinates]


def test_pairs_of_coincident_nodes_join_two_bodies(tmp_path: Path, capfd) -> None:
    """Without relative motion two bars are one; a common rigid motion moves no pair."""
    two = Two()
    command = [*two.write(tmp_path), "--pairs", "joint=LEFT", "RIGHT", "--normal", "2,0,0"]
    assert main(command) == 0
    assert "expected 12 (2 bodies" in capfd.readouterr().out
    model = model_file.read(tmp_path / "m.h5")
    joint = model.contacts["joint"]
    np.testing.assert_array_equal(two.nodes[joint.nodes[:, 0] - 1], two.nodes[joint.nodes[:, 1] - 1])
    np.testing.assert_allclose(joint.frames[:, 0], np.broadcast_to([1.0, 0, 0], (6, 3)))
    np.testing.assert_array_equal(joint.positions[:, 0], 0.04)
    moved = np.zeros((len(two.nodes), 3))
    moved[: len(two.first.nodes), 0] = 1.0
    np.testing.assert_allclose((joint.B @ moved.ravel()).reshape(-1, 3), np.broadcast_to([1.0, 0, 0], (6, 3)))
    rotation = np.cross([0.3, 0.5, 0.7], two.nodes).ravel()
    assert abs(joint.B @ rotation).max() < 1e-15
    T = scipy.linalg.null_space(joint.B.toarray())
    K, M, whole = T.T @ model.K @ T, T.T @ model.M @ T, two.whole
    joined = scipy.linalg.eigh(K, M, eigvals_only=True)[6:]
    np.testing.assert_allclose(
        joined, scipy.linalg.eigh(whole.K.toarray(), whole.M.toarray(), eigvals_only=True)[6:], rtol=1e-9
    )


def test_pairs_from_a_table(tmp_path: Path) -> None:
    """Against ground with an own normal and area each; nodes that are held drop out of B."""
    two = Two()
    (tmp_path / "pairs.csv").write_text("node_a,node_b,nx,ny,nz,area\n1,,0,0,-2,3e-6\n2,3,0,1,1,4e-6\n")
    command = [*two.write(tmp_path), "--pairs", str(tmp_path / "pairs.csv"), "--name", "tip=8y"]
    assert main(command) == 0
    model = model_file.read(tmp_path / "m.h5")
    contact = model.contacts["contact"]
    np.testing.assert_array_equal(contact.areas, [3e-6, 4e-6])
    np.testing.assert_array_equal(contact.nodes, [[1, 0], [2, 3]])
    x = np.random.default_rng(2).normal(size=(len(two.nodes), 3))
    u = (contact.B @ x.ravel()).reshape(-1, 3)
    np.testing.assert_allclose(u[0, 0], -x[0, 2])
    np.testing.assert_allclose(u[1, 0], (x[1] - x[2]) @ [0, 1, 1] / np.sqrt(2))
    np.testing.assert_allclose(np.linalg.norm(u, axis=1), [np.linalg.norm(x[0]), np.linalg.norm(x[1] - x[2])])
    assert model.names[int(model.kept[0])] == "tip" and int(model.kept[0]) == 22


WRONG_PAIRS = {
    "set": (["--pairs", "LEFT", "RIHGT", "--normal", "1,0,0"], "did you mean `RIGHT`?"),
    "normal": (["--pairs", "LEFT", "RIGHT"], "--normal X,Y,Z"),
    "direction": (["--pairs", "LEFT", "RIGHT", "--normal", "1,0"], "x,y,z"),
    "file": (["--pairs", "nowhere.csv"], "does not exist"),
    "three": (["--pairs", "LEFT", "RIGHT", "MORE"], "[NAME=]SET_A SET_B"),
    "twice": (["--pairs", "a=LEFT", "RIGHT", "--pairs", "a=LEFT", "RIGHT", "--normal", "1,0,0"], "own name"),
    "parallel": (["--pairs", "LEFT", "RIGHT", "--normal", "1,0,0", "--tangent", "1,0,0"], "parallel"),
    "dof": (["--name", "tip=n99x"], "cannot be named"),
}


@pytest.mark.parametrize("wrong", WRONG_PAIRS)
def test_wrong_pairs(wrong: str, tmp_path: Path, capfd) -> None:
    arguments, said = WRONG_PAIRS[wrong]
    assert main([*Two().write(tmp_path), *arguments]) == 2
    text = capfd.readouterr().err
    assert said in text and "where:" in text
    assert not (tmp_path / "m.h5").exists()


def test_unmatched_nodes_are_named(tmp_path: Path, capfd) -> None:
    two = Two()
    two.nodes[two.ends[0] - 1] += [0, 1e-3, 0]
    assert main([*two.write(tmp_path), "--pairs", "LEFT", "RIGHT", "--normal", "1,0,0"]) == 2
    text = capfd.readouterr().err
    partner = two.ends[len(two.ends) // 2]
    assert f"2 of 6 + 6 nodes: {two.ends[0]} (0.001 away), {partner} (0.001 away)" in text
    assert main([*two.write(tmp_path), "--pairs", "LEFT", "RIGHT", "--normal", "1,0,0", "--tolerance", "2e-3"]) == 0


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


@pytest.mark.parametrize(("asked", "said"), [("lower", "6 in the other"), ("full", "1 stray")])
def test_asked_for_another_triangle(asked: str, said: str, tmp_path: Path, held: Held) -> None:
    A = np.triu(np.ones((4, 4)))
    A[3, 0] = 1 if asked == "full" else 0
    given = {"K": read_matrix(write_npz(tmp_path, sp.csr_matrix(A), "K", held.labels), "K")}
    with pytest.raises(fw.InputError, match=said):
        assemble(given, asked)


def test_matlab_files_are_told_apart_by_what_they_begin_with(held: Held, tmp_path: Path) -> None:
    for write, kind in ((write_v5, "MATLAB 5"), (write_v73, "MATLAB 7.3")):
        path = Path(write(tmp_path, held.K, "K", held.labels).removesuffix(":A"))
        renamed = path.rename(tmp_path / "matrix.data")
        assert read_matrix(str(renamed) + (":A" if write is write_v5 else ""), "K").kind == kind


def test_damping_names_and_tables(held: Held, tmp_path: Path, capfd) -> None:
    """C beside M and K; a table of dofs as CSV; coordinates as CSV; a note on units; what was read."""
    C = sp.tril(1e-6 * held.K).tocsr()
    parts = [write_npz(tmp_path, A, letter, held.labels) for letter, A in (("M", held.M), ("K", held.K), ("C", C))]
    np.savetxt(tmp_path / "dofs.csv", held.labels, fmt="%d", delimiter=",")
    numbers = np.arange(1, len(held.bar.nodes) + 1)
    np.savetxt(
        tmp_path / "nodes.csv",
        np.column_stack([numbers, held.bar.nodes]),
        delimiter=", ",
        header="node, x, y, z",
        comments="",
    )
    command = ["import", str(tmp_path / "m.h5"), "--mass", parts[0], "--stiffness", parts[1], "--damping", parts[2]]
    tables = ["--dofs", str(tmp_path / "dofs.csv"), "--coordinates", str(tmp_path / "nodes.csv")]
    assert main([*command, *tables, "--units", "kg, N, m", "--name", "tip=24z", "--name", "side=n24y"]) == 0
    model = model_file.read(tmp_path / "m.h5")
    assert abs(model.C - 1e-6 * held.K).max() == 0
    assert model.names[-3:] == ["n24x", "side", "tip"] and sorted(model.kept) == [52, 53]
    assert model.units == "kg, N, m"
    assert [(s.role, s.path) for s in model.sources][2:4] == [("damping", "C.npz"), ("coordinates", "nodes.csv")]
    assert model.sources[0].bytes == (tmp_path / "M.npz").stat().st_size and len(model.sources[0].sha256) == 64
    np.testing.assert_array_equal(model.coordinates, held.bar.nodes)
    assert "C: " in capfd.readouterr().out


WRONG_OPTIONS = {
    "short table": (["--dofs", "short.csv"], "the table of dofs does not fit"),
    "no table": (["--dofs", "nowhere.dof"], "does not exist"),
    "wrong table": (["--dofs", "wrong.dof"], "this is no table of dofs"),
    "no coordinates": (["--coordinates", "nowhere.csv"], "does not exist"),
    "nodes and dofs": (["--coordinates", "two.csv"], "which dof belongs to which node"),
    "sets without nodes": (["--pairs", "A", "B", "--normal", "0,0,1"], "the matrices do not"),
    "table of pairs": (["--dofs", "good.csv", "--pairs", "pairs.csv"], "pairs.csv:2"),
    "pairs that are held": (["--dofs", "good.csv", "--pairs", "held.csv"], "cannot move"),
    "a name twice": (["--name", "a=0", "--name", "a=1"], "cannot be named"),
}


@pytest.mark.parametrize("wrong", WRONG_OPTIONS)
def test_wrong_options(held: Held, wrong: str, tmp_path: Path, capfd, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    for letter, A in (("M", held.M), ("K", held.K)):
        write_npz(tmp_path, A, letter, held.labels)
    np.savetxt("good.csv", held.labels, fmt="%d", delimiter=",")
    texts = {"short.csv": "1,1\n", "wrong.dof": "1.x\n", "two.csv": "1,0,0,0\n2,1,0,0\n"}
    texts |= {"pairs.csv": "node_a,node_b,nx,ny,nz,area\n1,0,0,0\n", "held.csv": "1,2,0,0,1\n"}
    for name, text in texts.items():
        Path(name).write_text(text)
    arguments, said = WRONG_OPTIONS[wrong]
    assert main(["import", "m.h5", "--mass", "M.npz", "--stiffness", "K.npz", *arguments]) == 2
    text = capfd.readouterr().err
    assert said in text and "where:" in text and not Path("m.h5").exists()


def test_nothing_is_overwritten(held: Held, tmp_path: Path, capfd) -> None:
    given = [write_npz(tmp_path, A, letter, held.labels) for letter, A in (("M", held.M), ("K", held.K))]
    for out, said in ((given[0], "would replace one of the matrices"), (str(tmp_path / "no" / "m.h5"), "folder")):
        assert main(["import", out, "--mass", given[0], "--stiffness", given[1]]) == 2
        assert said in capfd.readouterr().err
