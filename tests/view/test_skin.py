"""Outer faces of meshes: areas and volumes of closed bodies, whatever cells they are of."""

from __future__ import annotations

import numpy as np
import pytest
from tolerances import ROUNDING

from fretwave import fe
from fretwave.fe.mesh import VTK_LATTICE
from fretwave.model.cells import KINDS
from fretwave.plots import solid
from fretwave.view.skin import numbered, skin
from fretwave.view.vtkhdf import linear_cells

pytestmark = pytest.mark.ranks(1)
BOX = (3.0, 2.0, 1.0)
#: Tetrahedra and wedges of a cube of eight corners in VTK's order; signs of both orientations occur.
TETRAHEDRA = [[0, 1, 3, 4], [1, 2, 3, 6], [1, 6, 4, 5], [3, 4, 6, 7], [1, 3, 4, 6]]
WEDGES = [[0, 1, 3, 4, 5, 7], [1, 2, 3, 5, 6, 7]]


def box(order):
    def place(u):
        return u * BOX

    return fe.join([fe.Block("box", (3, 2, 2), place)], order)


def cells_of(kind):
    """The box of cells of a kind: nodes, and the table with VTK's number."""
    mesh = box(1 if kind in ("hexahedron", "wedge", "tetrahedron") else 2)
    table, number = np.asarray(mesh.vtk_cells), KINDS[kind].vtk if kind in KINDS else 0
    if kind == "cut_hexahedron":
        return mesh.nodes, (linear_cells(table, VTK_LATTICE), KINDS["hexahedron"].vtk)
    if kind == "triquadratic_hexahedron":
        return mesh.nodes, (table, number)
    if kind == "quadratic_hexahedron":
        return mesh.nodes, (table[:, :20], number)
    parts = {"tetrahedron": TETRAHEDRA, "wedge": WEDGES, "hexahedron": [list(range(8))]}[kind]
    if kind == "tetrahedron":  # cut alike in all cells, the box would not be closed: one cell
        table = table[:1]
    return mesh.nodes, (np.concatenate([table[:, part] for part in parts]), number)


@pytest.mark.parametrize(
    "kind", ["hexahedron", "quadratic_hexahedron", "triquadratic_hexahedron", "cut_hexahedron", "wedge", "tetrahedron"]
)
@pytest.mark.parametrize("side", [1.0, -1.0], ids=["", "mirrored"])
def test_faces_close_the_body_and_look_outwards(kind, side):
    """Also of cells that were read inside out."""
    nodes, cells = cells_of(kind)
    nodes = nodes * [side, 1.0, 1.0]
    size = np.ptp(nodes[np.unique(cells[0])], axis=0)
    faces = skin(nodes, [cells])
    area, volume = 0.0, 0.0
    for table in faces:
        corners = nodes[table]
        following = np.roll(corners, -1, axis=1)
        vectors = np.cross(corners, following).sum(axis=1) / 2
        area += np.linalg.norm(vectors, axis=1).sum()
        volume += np.einsum("nx,nx->", vectors, corners.mean(axis=1)) / 3
    assert volume == pytest.approx(np.prod(size), rel=ROUNDING)
    assert area == pytest.approx(2 * (size[0] * size[1] + size[1] * size[2] + size[2] * size[0]), rel=ROUNDING)


def test_inner_nodes_are_left_out():
    mesh = box(1)
    used, faces = numbered(skin(mesh.nodes, [(np.asarray(mesh.vtk_cells), KINDS["hexahedron"].vtk)]))
    on_side = np.any((mesh.nodes == 0) | (mesh.nodes == BOX), axis=1)
    assert used.tolist() == np.flatnonzero(on_side).tolist() and 0 < len(used) < len(mesh.nodes)
    assert sum(map(len, faces)) == 2 * (3 * 2 + 2 * 2 + 3 * 2)
    assert max(face.max() for face in faces) == len(used) - 1


def test_shells_have_both_sides():
    nodes = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    (faces,) = skin(nodes, [(np.array([[0, 1, 2, 3]]), KINDS["quadrilateral"].vtk)])
    assert sorted(solid.normals(nodes[faces])[:, 2].tolist()) == pytest.approx([-1.0, 1.0])


def test_nodes_alone_have_no_faces():
    assert skin(np.zeros((2, 3)), [(np.array([[0], [1]]), 1)]) == []


def test_faces_between_neighbours_are_inside():
    """Two cubes side by side: each has the common face, the pair has ten."""
    mesh = fe.join([fe.Block("cube", (1, 1, 1), lambda u: u)], 1)
    (faces,) = skin(mesh.nodes, [(np.asarray(mesh.vtk_cells), KINDS["hexahedron"].vtk)])
    both = np.concatenate([mesh.nodes, mesh.nodes + [1.0, 0, 0]])
    around = np.concatenate([faces, faces + len(mesh.nodes)])
    kept = around[solid.unshared(both[around])]
    assert len(around) == 12 and len(kept) == 10
    assert not np.any(np.all(both[kept][:, :, 0] == 1.0, axis=1))


def test_a_solid_shows_the_side_towards_the_eye():
    from fretwave.plots import style

    mesh = fe.join([fe.Block("cube", (1, 1, 1), lambda u: u)], 1)
    (faces,) = skin(mesh.nodes, [(np.asarray(mesh.vtk_cells), KINDS["hexahedron"].vtk)])
    _, axes = style.new_figure(3.0)
    drawn = solid.draw(axes, mesh.nodes, faces, solid.Camera(30.0, 20.0), values=mesh.nodes[:, 2])
    assert len(drawn.get_paths()) == 3  # of six
    colours = drawn.get_facecolor()[:, :3]
    hues = colours / np.linalg.norm(colours, axis=1, keepdims=True)  # the light dims all three alike
    expected = np.array([drawn.cmap(value)[:3] for value in (0.5, 0.5, 1.0)])  # of its sides, and its top
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    top = np.argmin(np.linalg.norm(hues - expected[2], axis=1))
    np.testing.assert_allclose(hues[[k for k in range(3) if k != top] + [top]], expected, atol=2e-3)
    assert colours[top].sum() > 0.7 * np.sum(drawn.cmap(1.0)[:3])
