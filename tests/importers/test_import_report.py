"""What ``fretwave import`` reports of a model, and its other options."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse as sp
from models import hexahedra
from models.matrix_files import Held, write_calculix, write_coordinate, write_npz
from tolerances import LAST_BIT

from fretwave.commands.main import main
from fretwave.results import model_file

pytestmark = pytest.mark.ranks(1)


@pytest.fixture(scope="module")
def held() -> Held:
    return Held()


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


def test_dofs_inside_elements_do_not_move_rigidly(held: Held, tmp_path: Path, capfd) -> None:
    """A node numbered beyond the mesh's, pushed by strain alone, as an incompatible mode: mass and motions stay."""
    bar, n = held.bar, len(held.bar.nodes)
    pushed, heavy = bar.K[:, :3], bar.M[:3, :3]
    K = sp.bmat([[bar.K, pushed], [pushed.T, 2 * bar.K[:3, :3]]], format="csr")
    M = sp.bmat([[bar.M, bar.M[:, :3]], [bar.M[:3], 2 * heavy]], format="csr")
    labels = np.column_stack([np.repeat([*range(1, n + 1), 900], 3), np.tile([1, 2, 3], n + 1)])
    parts = [write_calculix(tmp_path, sp.csr_matrix(A), letter, labels) for letter, A in (("M", M), ("K", K))]
    np.savez(tmp_path / "nodes.npz", coordinates=bar.nodes)
    command = ["import", str(tmp_path / "m.h5"), "--mass", parts[0], "--stiffness", parts[1], "--units", "m-kg-s"]
    assert main([*command, "--coordinates", str(tmp_path / "nodes.npz")]) == 0
    text = capfd.readouterr().out
    mass = hexahedra.DENSITY * 0.06 * 0.02 * 0.01
    assert f"at {n + 1} nodes, 1 of them inside elements" in text
    assert f"mass: {mass:.6g} along x, {mass:.6g} along y, {mass:.6g} along z [kg]\n" in text
    assert "rigid modes: 6 found, expected 6" in text and "warning" not in text


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
    heavier = sp.diags(1 + 0.5 * (cut == 0)) @ bar.M.multiply(sp.eye(len(cut)))
    assert "the mass differs along x, y and z" in report_of(tmp_path, heavier, bar.K, bar.nodes, capfd)
    loose = report_of(tmp_path, *(sp.diags(cut) @ A @ sp.diags(cut) for A in (bar.M, bar.K)), bar.nodes, capfd)
    assert "warning: 1 dof with no mass" in loose
    assert "the frequencies cannot be computed (the mass matrix has a zero diagonal entry): is a dof" in loose
    assert model_file.read_model(tmp_path / "m.h5").n_dof == len(cut)
    K = bar.K - sp.diags(1e-3 * bar.K.diagonal().max() * (cut == 0))
    text = report_of(tmp_path, bar.M, K, bar.nodes, capfd)
    assert "warning: K is negative for a motion" in text and "is unstable so" in text and "PETSc" not in text


def test_buckled_and_spinning_structures_are_told(held: Held, tmp_path: Path, capfd) -> None:
    """K - Omega^2 M beyond the lowest frequency: indefinite with a positive diagonal, and taken."""
    squares = scipy.linalg.eigh(held.K.toarray(), held.M.toarray(), eigvals_only=True)
    K = sp.csr_matrix(held.K - 1.5 * squares[0] * held.M)
    parts = [write_npz(tmp_path, A, letter, held.labels) for letter, A in (("M", held.M), ("K", K))]
    assert main(["import", str(tmp_path / "m.h5"), "--mass", parts[0], "--stiffness", parts[1]]) == 0
    assert f"omega^2 = {-0.5 * squares[0]:.4g}. A buckled structure" in capfd.readouterr().out


def test_damping_names_and_tables(held: Held, tmp_path: Path, capfd) -> None:
    """C beside M and K; a table of dofs as CSV; coordinates as CSV; the units; what was read."""
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
    assert main([*command, *tables, "--units", "m-kg-s", "--name", "tip=24z", "--name", "side=n24y"]) == 0
    model = model_file.read_model(tmp_path / "m.h5")
    assert abs(model.C - 1e-6 * held.K).max() == 0
    assert model.dof_names[-3:] == ["n24x", "side", "tip"] and model.dofs == {"tip": 53, "side": 52}
    units, sources = model_file.read_sources(tmp_path / "m.h5")
    assert units == "m-kg-s"
    assert [(s.role, s.path) for s in sources][2:4] == [("damping", "C.npz"), ("coordinates", "nodes.csv")]
    assert sources[0].bytes == (tmp_path / "M.npz").stat().st_size and len(sources[0].sha256) == 64
    np.testing.assert_array_equal(model.coordinates, held.bar.nodes)
    assert "C: " in capfd.readouterr().out


def test_held_dofs_keep_the_numbering_of_the_others(held: Held, tmp_path: Path) -> None:
    """Abaqus' coordinate format has no labels, but held dofs: rows stand node by node before those are left out."""
    K, bar = held.bar.K.tolil(), held.bar
    ends = bar.layer(0.0)
    K[ends, ends] = 1e36
    given = [write_coordinate(tmp_path, sp.csr_matrix(A), name, held.labels) for name, A in (("M", bar.M), ("K", K))]
    np.savez(tmp_path / "nodes.npz", coordinates=bar.nodes)
    command = ["import", str(tmp_path / "m.h5"), "--mass", given[0], "--stiffness", given[1]]
    assert main([*command, "--coordinates", str(tmp_path / "nodes.npz")]) == 0
    model = model_file.read_model(tmp_path / "m.h5")
    np.testing.assert_array_equal(model.labels, held.labels)
    assert abs(model.K - held.K).max() <= LAST_BIT * abs(held.K).max()


WRONG_OPTIONS = {
    "a dof twice": (["--dofs", "twice.csv"], "stands twice in the table"),
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
    np.savetxt("twice.csv", np.vstack([held.labels[:-1], held.labels[:1]]), fmt="%d", delimiter=",")
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
