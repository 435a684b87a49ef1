"""Faces of a sector that is plain matrices: directions by names of dofs, against the whole ring in one frame."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from command_line import call
from tolerances import ROUNDING

from fretwave.case.load import load_case
from fretwave.errors import CaseErrors

pytestmark = pytest.mark.ranks(1)
SECTORS = 6
ANGLE = 2 * np.pi / SECTORS
#: Of the low and the high node, which lie on the faces, and one between: radius, angle, height.
NODES = ((1.0, -ANGLE / 2, 0.0), (1.0, ANGLE / 2, 0.0), (1.3, 0.0, 0.15))
BARS = ((0, 1, 4.0), (0, 2, 2.0), (1, 2, 1.5))
GROUND = ((0.2, 0.1, 0.3), (0.2, 0.1, 0.3), (0.3, 0.4, 0.5))  #: radial, tangential, axial
MASS = np.repeat([0.5, 0.5, 2.0], 3)

LOW, HIGH = ["lx", "ly", "lz"], ["hx", "hy", "hz"]
CASE = """
[model]
dofs = {dofs}
M = {M}
K = {K}
sectors = 6
low = {low}
high = {high}
{axis}

[[analysis]]
name = "linear"
type = "linear"
modes = 6
"""


def turn(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def stiffness() -> np.ndarray:
    """Bars and springs to ground of a sector, along x, y, z."""
    places = [turn(angle) @ (radius, 0.0, height) for radius, angle, height in NODES]
    K = np.zeros((9, 9))
    for i, j, k in BARS:
        row = np.zeros((3, 3))
        row[i] = (places[j] - places[i]) / np.linalg.norm(places[j] - places[i])
        row[j] = -row[i]
        K += k * np.outer(row, row)
    for node, (springs, (_, angle, _)) in enumerate(zip(GROUND, NODES)):
        own = slice(3 * node, 3 * node + 3)
        K[own, own] += turn(angle) @ np.diag(springs) @ turn(angle).T
    return K


def ring() -> np.ndarray:
    """Squares of the circular frequencies of all sectors, on the dofs of space."""
    K, M = np.zeros((2, 6 * SECTORS, 6 * SECTORS))
    for sector in range(SECTORS):
        T = np.zeros((9, 6 * SECTORS))
        for node, place in enumerate((2 * sector, 2 * ((sector + 1) % SECTORS), 2 * sector + 1)):
            T[3 * node : 3 * node + 3, 3 * place : 3 * place + 3] = turn(sector * ANGLE).T
        K += T.T @ stiffness() @ T
        M += T.T @ np.diag(MASS) @ T
    return np.linalg.eigvalsh(K / np.sqrt(np.outer(M.diagonal(), M.diagonal())))


def put(folder: Path, low: list[str], high: list[str], axis: str = 'axis = "z"', names: str = "xyz") -> Path:
    """A case; directions may have other names."""
    dofs = [node + way for node in "lhm" for way in names]
    text = CASE.format(dofs=dofs, M=np.diag(MASS).tolist(), K=stiffness().tolist(), low=low, high=high, axis=axis)
    path = folder / "case.toml"
    path.write_text(text.replace("'", '"'))
    return path


@pytest.mark.parametrize("order", [[0, 1, 2], [2, 1, 0], [1, 2, 0]])
def test_in_any_order_the_sector_has_the_frequencies_of_the_ring(order: list[int], tmp_path: Path, capfd) -> None:
    path = put(tmp_path, [LOW[k] for k in order], [HIGH[k] for k in order])
    wheel = load_case(path).structure.around()
    K, m = wheel.K.toarray(), wheel.M.diagonal()
    np.testing.assert_allclose(np.linalg.eigvalsh(K / np.sqrt(np.outer(m, m))), ring(), rtol=ROUNDING)
    assert call("check", path, "--no-solve") == 0
    said = capfd.readouterr().out
    assert "read from their names; low, high, sectors and axis are not checked" in said


@pytest.mark.parametrize(
    "low, high, axis, words",
    [
        (LOW, HIGH, "", ("the axis of the wheel is not known", 'axis = "z"', "other names")),
        (LOW, ["hy", "hx", "hz"], 'axis = "z"', ("differ in direction", "lx and hy")),
        (LOW[:2], HIGH[:2], 'axis = "z"', ("some of its directions only", "lx, ly")),
    ],
)
def test_faces_that_are_refused(low: list[str], high: list[str], axis: str, words: tuple[str, ...], tmp_path) -> None:
    with pytest.raises(CaseErrors) as caught:
        load_case(put(tmp_path, low, high, axis))
    assert all(word in str(caught.value) for word in (*words, "fix:"))


@pytest.mark.parametrize(
    "names, count, axis, said",
    [
        ("rta", 3, "", "taken to turn with the sector; low, high, sectors are not checked"),
        ("rta", 3, 'axis = "z"', "taken as x, y, z of each node, in the order of low and high"),
        ("xyz", 2, "", "taken to turn with the sector"),
    ],
)
def test_what_is_not_known_is_said(names: str, count: int, axis: str, said: str, tmp_path: Path) -> None:
    low, high = (["lhm"[node] + way for way in names[:count]] for node in (0, 1))
    assert any(said in note for note in load_case(put(tmp_path, low, high, axis, names)).notes)


def test_names_of_the_import(tmp_path: Path) -> None:
    """``n17rx`` is a rotation; a node whose name ends in r has displacements."""
    from fretwave.case.face_moves import labels_by_name
    from fretwave.model.structure import Structure

    names = ["n1rx", "n1x", "barx", "m"]
    structure = Structure(np.eye(4), np.eye(4), names=names)
    labels = labels_by_name(structure, np.array([0, 1]), np.array([2]), "z")
    assert labels is not None and labels.tolist() == [[1, 4], [1, 1], [0, 1], [-1, -1]]
    assert labels_by_name(structure, np.array([0]), np.array([3]), "z") is None
