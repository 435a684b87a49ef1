"""A dof by a name that the model does not have: never corrected to one that is another quantity."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from command_line import call
from models.matrix_files import Held, write_npz

from fretwave.model.structure import Structure
from fretwave.results.missing_dof import missing_dof

pytestmark = pytest.mark.ranks(1)
CASE = """
[model]
file = "m.h5"
stiffness_damping = 1e-6

[[analysis]]
name = "forced"
type = "forced"
harmonics = 1
observe = "OBSERVED"
force = { tip = 1.0 }
frequency = [100.0, 110.0]
levels = [1.0]
step = { maximum = 5.0 }
"""


def imported(folder: Path, *options: str) -> int:
    """A bar held at x = 0, whose nodes are 1 to 24 with 1, 5, 9, ... at the hold; the numbers are the mesh's own."""
    held = Held()
    parts = [write_npz(folder, A, letter, held.labels) for letter, A in (("M", held.M), ("K", held.K))]
    np.savetxt(folder / "dofs.csv", held.labels, fmt="%d", delimiter=",")
    numbers = np.arange(1, len(held.bar.nodes) + 1)
    np.savetxt(folder / "nodes.csv", np.column_stack([numbers, held.bar.nodes]), delimiter=",")
    tables = ["--dofs", folder / "dofs.csv", "--coordinates", folder / "nodes.csv"]
    return call("import", folder / "m.h5", "--mass", parts[0], "--stiffness", parts[1], *tables, *options)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("named")
    assert imported(path, "--name", "tip=n24z", "--units", "m-kg-s") == 0
    return path


def held_node() -> int:
    return next(node for node in range(1, 25) if node not in Held().labels[:, 0])


@pytest.mark.parametrize(
    ("dof", "fix"),
    [
        ("n24z", "n24z is called `tip`"),
        ("n1234z", "name a node of the mesh: it has no node 1234"),
        (f"n{held_node()}z", f"node {held_node()} is held: it is not in the matrices"),
        ("n24rx", "node 24 is held along rx (not in the matrices), and free along x, y, z"),
        ("tipp", "did you mean `tip`?"),
    ],
)
def test_what_a_case_is_told(dof: str, fix: str, folder: Path, capfd) -> None:
    (folder / "case.toml").write_text(CASE.replace("OBSERVED", dof))
    assert call("check", folder / "case.toml", "--no-solve") == 2
    assert f"fix:      {fix}\n" in capfd.readouterr().err


def test_what_the_import_is_told(tmp_path: Path, capfd) -> None:
    assert imported(tmp_path, "--name", f"tip={held_node()}y") == 2
    assert f"node {held_node()} is held" in capfd.readouterr().err
    assert imported(tmp_path, "--name", "tip=n24z", "--name", "end=n24z") == 2
    assert "n24z is called `tip`" in capfd.readouterr().err


def test_what_probe_says(folder: Path, capfd) -> None:
    path = folder / "probed.toml"
    path.write_text(CASE.replace("OBSERVED", "tip"))
    assert call("run", path, "--no-plots", "-q", "--out", folder / "run") == 0
    assert call("probe", folder / "run", "--dof", "n24z") == 2
    assert "fix:      n24z is called `tip`\n" in capfd.readouterr().err
    assert call("probe", folder / "run", "--node", held_node()) == 0
    assert "held along x, y, z (no dof of the model)" in capfd.readouterr().out
    assert call("probe", folder / "run", "--node", 24) == 0
    assert "held" not in capfd.readouterr().out


def test_a_dof_of_the_high_face_is_the_next_sectors() -> None:
    names = ["n1x", "n2x", "n3x"]
    labels = np.array([[1, 1], [2, 1], [3, 1]])
    given = Structure(np.eye(3), np.eye(3), names=names, labels=labels, low=np.array([0]), high=np.array([1]))
    found = missing_dof(given, "n2x", ["n1x", "n3x"])
    assert found == "n2x is on the high face, which is the next sector's low face: there it is `n1x`"
    assert missing_dof(Structure(np.eye(2), np.eye(2), names=["a", "tip"]), "tp", ["a", "tip"]) == "did you mean `tip`?"
