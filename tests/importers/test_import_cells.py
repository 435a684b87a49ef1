"""Cells of input decks: every kind, in VTK's order, kept in the model file and drawn."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tolerances import LAST_BIT

import fretwave as fw
from fretwave.importers.cells import FACES
from fretwave.importers.nodes import cells_of, read_nodes
from fretwave.model.cells import KINDS

pytestmark = pytest.mark.ranks(1)

#: Corners of each shape by the manuals, and the edges whose middle nodes follow them in a deck (from 1).
TETRAHEDRON = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
WEDGE = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (0, 1, 1)]
HEXAHEDRON = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
TETRAHEDRON_EDGES = "12 23 31 14 24 34"
WEDGE_EDGES = "12 23 31 45 56 64 14 25 36"
HEXAHEDRON_EDGES = "12 23 34 41 56 67 78 85 15 26 37 48"
#: The same edges in the order of VTK's cells (from 0; vtkQuadraticTetra.h, ...Wedge.h, ...Hexahedron.h).
VTK_EDGES = {
    "quadratic_tetrahedron": "01 12 20 03 13 23",
    "quadratic_wedge": "01 12 20 34 45 53 03 14 25",
    "quadratic_hexahedron": "01 12 23 30 45 56 67 74 04 15 26 37",
}
DECKS = {
    "tetrahedron": ("C3D4", TETRAHEDRON, ""),
    "quadratic_tetrahedron": ("C3D10M", TETRAHEDRON, TETRAHEDRON_EDGES),
    "wedge": ("C3D6", WEDGE, ""),
    "quadratic_wedge": ("C3D15", WEDGE, WEDGE_EDGES),
    "hexahedron": ("C3D8I", HEXAHEDRON, ""),
    "quadratic_hexahedron": ("C3D20R", HEXAHEDRON, HEXAHEDRON_EDGES),
    "triangle": ("S3", TETRAHEDRON[:3], ""),
    "quadrilateral": ("S4R", HEXAHEDRON[:4], ""),
}
SHELLS = ("triangle", "quadrilateral")


def one_cell(folder: Path, kind: str) -> Path:
    """A deck of one element, its nodes 10, 20, ..., its data over two lines."""
    element, corners, edges = DECKS[kind]
    x = np.array(corners, dtype=float)
    x = np.vstack([x, *((x[int(a) - 1] + x[int(b) - 1])[None] / 2 for a, b in edges.split())])
    nodes = "".join(f"{10 * k}, {', '.join(map(str, row))}\n" for k, row in enumerate(x.tolist(), 1))
    names = [str(10 * k) for k in range(1, len(x) + 1)]
    data = f"7, {', '.join(names[:2])},\n {', '.join(names[2:])}\n"
    path = folder / "deck.inp"
    path.write_text(f"*NODE, NSET=ALL\n{nodes}*ELEMENT, TYPE={element}, ELSET=ONE\n{data}")
    return path


@pytest.mark.parametrize("kind", DECKS)
def test_a_cell_is_in_the_order_of_vtk(kind: str, tmp_path: Path) -> None:
    """Middle nodes lie between the corners that VTK names; the first face of a wedge alone looks outwards."""
    nodes = read_nodes(one_cell(tmp_path, kind))
    hexahedra, others = cells_of(nodes)
    cells = others[kind] if hexahedra is None else hexahedra
    assert cells.shape == (1, KINDS[kind].nodes)
    x = nodes.coordinates[cells[0]]
    for k, (a, b) in enumerate(VTK_EDGES.get(kind, "").split(), len(DECKS[kind][1])):
        np.testing.assert_array_equal(x[k], (x[int(a)] + x[int(b)]) / 2)
    inwards = np.cross(x[1] - x[0], x[2] - x[1]) @ (x[len(DECKS[kind][1]) - 1] - x[0])
    assert np.sign(inwards) == (0 if kind in SHELLS else -1 if "wedge" in kind else 1)


@pytest.mark.parametrize("kind", [kind for kind in DECKS if kind not in SHELLS])
def test_faces_look_outwards_and_close(kind: str, tmp_path: Path) -> None:
    """The normals of all faces, as long as their areas, add up to nothing; middle nodes lie between neighbours."""
    nodes = read_nodes(one_cell(tmp_path, kind))
    (block,) = nodes.elements.blocks.values()
    total, centre = np.zeros(3), nodes.coordinates[nodes.places(block.nodes[0])].mean(axis=0)
    for face in FACES[kind]:
        x = nodes.coordinates[nodes.places(block.nodes[0, face])]
        corners = x[: len(face) if len(face) < 5 else len(face) // 2]
        normal = sum(np.cross(a, b) for a, b in zip(corners, np.roll(corners, -1, axis=0))) / 2
        assert normal @ (corners.mean(axis=0) - centre) > 0
        between = (corners + np.roll(corners, -1, axis=0)) / 2
        np.testing.assert_array_equal(x[len(corners) :], between[: len(x) - len(corners)])
        total += normal
    np.testing.assert_allclose(total, 0, atol=LAST_BIT)


def test_cells_of_several_kinds_are_kept(tmp_path: Path) -> None:
    """C3D20 beside C3D8 and C3D4, each with all its nodes; what is no solid and no shell is passed over."""
    numbers = list(range(1, 33))
    rows = "".join(f"{n}, {n}., 0., 0.\n" for n in numbers)
    text = [("C3D20R", numbers[:20]), ("c3d8", numbers[20:28]), ("C3D4", numbers[28:]), ("SPRING2", [1, 2])]
    blocks = [f"*ELEMENT, TYPE={kind}\n{k}, {', '.join(map(str, own))}\n" for k, (kind, own) in enumerate(text, 1)]
    (tmp_path / "deck.inp").write_text(f"*NODE\n{rows}{''.join(blocks)}")
    hexahedra, others = cells_of(read_nodes(tmp_path / "deck.inp"))
    assert hexahedra is not None and hexahedra.tolist() == [list(range(20, 28))]
    assert {kind: table.tolist() for kind, table in others.items()} == {
        "quadratic_hexahedron": [list(range(20))],
        "tetrahedron": [list(range(28, 32))],
    }


def test_cells_stand_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    """In which CalculiX numbers the inner nodes of C3D8I, whatever the deck's order is."""
    rows = "".join(f"{n}, {n}., 0., 0.\n" for n in range(1, 13))
    text = f"*NODE\n{rows}*ELEMENT, TYPE=C3D4\n9, 9, 10, 11, 12\n*ELEMENT, TYPE=C3D4\n7, 1, 2, 3, 4\n8, 5, 6, 7, 8\n"
    (tmp_path / "deck.inp").write_text(text)
    _, others = cells_of(read_nodes(tmp_path / "deck.inp"))
    assert others["tetrahedron"].tolist() == [[0, 1, 2, 3], [4, 5, 6, 7], [8, 9, 10, 11]]


def test_cells_of_a_model_file(tmp_path: Path) -> None:
    """Kept beside hexahedra; a cell that names no node is refused, in a file and of a builder."""
    n, eye = 12, np.eye(12)
    labels = np.column_stack([np.repeat([1, 2, 3, 4], 3), np.tile([1, 2, 3], 4)])
    corners = np.array(TETRAHEDRON, dtype=float)
    cells = {"tetrahedron": np.array([[0, 1, 2, 3]]), "triangle": np.array([[0, 2, 1]])}
    parts = dict(labels=labels, node_numbers=np.arange(1, 5), coordinates=corners, names=[f"d{k}" for k in range(n)])
    model = fw.Structure(eye, eye, cells=cells, **parts)
    assert model.complaint() is None
    fw.write_model(tmp_path / "m.h5", model)
    found = fw.read_model(tmp_path / "m.h5")
    assert {kind: table.tolist() for kind, table in found.cells.items()} == {k: v.tolist() for k, v in cells.items()}
    for wrong, said in (
        ({"tetrahedron": np.array([[0, 1, 2, 4]])}, "nodes 0 to 4 of 4"),
        ({"tetrahedron": np.array([[0, 1, 2]])}, r"shape \(1, 3\)"),
        ({"tetraeder": cells["tetrahedron"]}, "no kind of cell 'tetraeder'"),
    ):
        with pytest.raises(fw.InputError, match=said):
            fw.write_model(tmp_path / "wrong.h5", fw.Structure(eye, eye, cells=wrong, **parts))
