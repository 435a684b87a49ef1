"""Node sets of input decks, and contact pairs of matching nodes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy.linalg
from models.two_bars import Two
from tolerances import LAST_BIT, SOLVED

import fretwave as fw
from fretwave.commands.main import main
from fretwave.importers.nodes import read_nodes
from fretwave.results import model_file

pytestmark = pytest.mark.ranks(1)

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
        ("*NODE\n1, 1.\n*ELEMENT, TYPE=C3D8\n1, 1, 2, 3\n", "this is no element"),
        ("*NODE, SYSTEM=C\n1, 1., 0., 0.\n", "not rectangular"),
        ("*NODE\n1, 1., zero, 0.\n", "this is no node"),
        ("*NODE\n1_2, 1., 0., 0.\n", "this is no node"),
        ("*NODE\n1, 1.\n*NSET, NSET=A, GENERATE\n1, 1_0\n", "this is no node set"),
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


def test_pairs_of_coincident_nodes_join_two_bodies(tmp_path: Path, capfd) -> None:
    """Without relative motion two bars are one; a common rigid motion moves no pair."""
    two = Two()
    command = [*two.write(tmp_path), "--pairs", "joint=LEFT", "RIGHT", "--normal", "2,0,0"]
    assert main(command) == 0
    assert "expected 12 (2 bodies" in capfd.readouterr().out
    model = model_file.read_model(tmp_path / "m.h5")
    joint = model.pairs["joint"]
    np.testing.assert_array_equal(two.nodes[joint.nodes[:, 0] - 1], two.nodes[joint.nodes[:, 1] - 1])
    np.testing.assert_allclose(joint.frames[:, 0], np.broadcast_to([1.0, 0, 0], (6, 3)))
    np.testing.assert_array_equal(joint.points[:, 0], 0.04)
    moved = np.zeros((len(two.nodes), 3))
    moved[: len(two.first.nodes), 0] = 1.0
    np.testing.assert_allclose((joint.B @ moved.ravel()).reshape(-1, 3), np.broadcast_to([1.0, 0, 0], (6, 3)))
    rotation = np.cross([0.3, 0.5, 0.7], two.nodes).ravel()
    assert abs(joint.B @ rotation).max() < LAST_BIT
    T = scipy.linalg.null_space(joint.B.toarray())
    K, M, whole = T.T @ model.K @ T, T.T @ model.M @ T, two.whole
    joined = scipy.linalg.eigh(K, M, eigvals_only=True)[6:]
    np.testing.assert_allclose(
        joined, scipy.linalg.eigh(whole.K.toarray(), whole.M.toarray(), eigvals_only=True)[6:], rtol=SOLVED
    )


def test_pairs_from_a_table(tmp_path: Path) -> None:
    """Against ground with an own normal and area each, or 14 mm apart, which is told to be meant."""
    two = Two()
    (tmp_path / "pairs.csv").write_text("node_a,node_b,nx,ny,nz,area\n1,,0,0,-2,3e-6\n2,3,0,1,1,4e-6\n")
    command = [*two.write(tmp_path), "--pairs", str(tmp_path / "pairs.csv"), "--name", "tip=8y", "--tolerance", "1e-4"]
    assert main(command) == 0
    model = model_file.read_model(tmp_path / "m.h5")
    contact = model.pairs["contact"]
    np.testing.assert_array_equal(contact.areas, [3e-6, 4e-6])
    np.testing.assert_array_equal(contact.nodes, [[1, 0], [2, 3]])
    x = np.random.default_rng(2).normal(size=(len(two.nodes), 3))
    u = (contact.B @ x.ravel()).reshape(-1, 3)
    np.testing.assert_allclose(u[0, 0], -x[0, 2])
    np.testing.assert_allclose(u[1, 0], (x[1] - x[2]) @ [0, 1, 1] / np.sqrt(2))
    np.testing.assert_allclose(np.linalg.norm(u, axis=1), [np.linalg.norm(x[0]), np.linalg.norm(x[1] - x[2])])
    assert model.dofs == {"tip": 22} and model.dof("tip") == 22


WRONG_TABLES = {
    "order": ("node_b,node_a,nx,ny,nz,area\n3,2,0,1,1,4e-6\n", "another order", "node_a,node_b,nx,ny,nz,area"),
    "area first": ("node_a,node_b,area,nx,ny,nz\n2,3,4e-6,0,1,1\n", "another order", "pairs.csv:1"),
    "one area": ("1,,0,0,-2,3e-6\n2,3,0,1,1\n", "uneven", "some have none"),
    "no number": ("1,,0,0,-2,3e-6\n2,3,0,1,1,nan\n", "no pair", "pairs.csv:2"),
    "endless area": ("1,,0,0,-2,inf\n", "no pair", "pairs.csv:1"),
    "endless normal": ("1,,0,0,-inf,3e-6\n", "no pair", "pairs.csv:1"),
    "turned round": ("2,3,0,1,1,4e-6\n3,2,0,-1,-1,4e-6\n", "stands twice", "pair 2"),
    "longer normal": ("2,3,0,1,1,4e-6\n2,3,0,2,2,4e-6\n", "stands twice", "pair 2"),
    "nothing": ("node_a,node_b,nx,ny,nz,area\n", "no pairs", "no pair"),
}


@pytest.mark.parametrize("wrong", WRONG_TABLES)
def test_wrong_tables_of_pairs(wrong: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """None is read as another contact: a normal of no number was left out, areas of some pairs dropped those of all."""
    text, *said = WRONG_TABLES[wrong]
    (tmp_path / "pairs.csv").write_text(text)
    command = [*Two().write(tmp_path), "--pairs", str(tmp_path / "pairs.csv"), "--tolerance", "1e-4"]
    assert main(command) == 2
    error = capfd.readouterr().err
    assert all(word in error for word in (*said, "pairs.csv", "fix:")), error


@pytest.mark.parametrize("line", ["2,3,0,1,1", "2,3,0,1,1,", '"node_a","node_b","nx","ny","nz"\n2,3,0,1,1'])
def test_areas_that_are_left_out(line: str, tmp_path: Path) -> None:
    (tmp_path / "pairs.csv").write_text(line + "\n")
    command = [*Two().write(tmp_path), "--pairs", str(tmp_path / "pairs.csv"), "--tolerance", "1e-4"]
    assert main(command) == 0
    assert model_file.read_model(tmp_path / "m.h5").pairs["contact"].areas is None


def test_pairs_with_ground(tmp_path: Path) -> None:
    two = Two()
    assert main([*two.write(tmp_path), "--pairs", "wall=LEFT", "ground", "--normal", "1,0,0"]) == 0
    wall = model_file.read_model(tmp_path / "m.h5").pairs["wall"]
    moved = np.arange(3.0 * len(two.nodes)).reshape(-1, 3)
    u = (wall.B @ moved.ravel()).reshape(-1, 3)
    np.testing.assert_allclose(u[:, 0], moved[wall.nodes[:, 0] - 1, 0])
    np.testing.assert_array_equal(wall.nodes[:, 1], 0)


WRONG_PAIRS = {
    "set": (["--pairs", "LEFT", "RIHGT", "--normal", "1,0,0"], "did you mean `RIGHT`?"),
    "normal": (["--pairs", "LEFT", "RIGHT"], "--normal X,Y,Z"),
    "direction": (["--pairs", "LEFT", "RIGHT", "--normal", "1,0"], "x,y,z"),
    "both": (["--pairs", "LEFT", "LEFT", "--normal", "1,0,0"], "in both sets"),
    "file": (["--pairs", "nowhere.csv"], "does not exist"),
    "three": (["--pairs", "LEFT", "RIGHT", "MORE"], "[NAME=]SET_A SET_B"),
    "twice": (["--pairs", "a=LEFT", "RIGHT", "--pairs", "a=LEFT", "RIGHT", "--normal", "1,0,0"], "own name"),
    "parallel": (["--pairs", "LEFT", "RIGHT", "--normal", "1,0,0", "--tangent", "1,0,0"], "parallel"),
    "dof": (["--name", "tip=n99x"], "cannot be named"),
    "name of two words": (["--name", "blade tip=n8y"], "write blade_tip=n8y"),
    "number for a name": (["--name", "7=n8y"], "write tip=n8y"),
    "name of two dofs": (["--name", "tip=n8y", "--name", "tip=n8x"], "another dof is called tip: choose another name"),
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
