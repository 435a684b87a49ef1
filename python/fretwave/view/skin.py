"""The outer faces of a mesh: all that is seen of it, a small part of its nodes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..arrays import Array, IntArray
from ..importers.cells import FACES
from ..model.cells import KINDS, normals
from .vtkhdf import Cells

#: VTK's polygon: any number of points around.
POLYGON = 7


def skin(nodes: Array, cells: Sequence[Cells]) -> list[IntArray]:
    """Points around each outer face (n, k) by their number k, counter-clockwise from outside; shells from both sides.

    Parameters
    ----------
    nodes : (n_nodes, 3)
    cells : tables with VTK's number of their kind
        Faces of triquadratic hexahedra have no middle node here: those of quadratic ones, whose nodes come first.
    """
    names = {kind.vtk: name for name, kind in KINDS.items() if name in FACES}
    names[KINDS["triquadratic_hexahedron"].vtk] = "quadratic_hexahedron"
    known = [(np.asarray(table)[:, : KINDS[names[vtk]].nodes], names[vtk]) for table, vtk in cells if vtk in names]
    faces = [face for table, name in known for face in _faces(nodes, table, name)]
    widths = sorted({face.shape[1] for face, _ in faces})
    return [np.concatenate([_outer(f, solid) for f, solid in _of_width(faces, width)]) for width in widths]


def _of_width(faces: Sequence[tuple[IntArray, bool]], width: int) -> list[tuple[IntArray, bool]]:
    """All of solids together, for two of them share a face, and all of shells."""
    parts = [([face for face, solid in faces if solid is of and face.shape[1] == width], of) for of in (True, False)]
    return [(np.concatenate(found), of) for found, of in parts if found]


def _faces(nodes: Array, table: IntArray, name: str) -> list[tuple[IntArray, bool]]:
    """All faces of cells of one kind, and whether these are solids."""
    solid = KINDS[name].vtk not in (KINDS["triangle"].vtk, KINDS["quadrilateral"].vtk)
    middle = nodes[table].mean(axis=1)
    found = [table[:, _around(face)] for face in FACES[name]]
    return [(_outwards(nodes, face, middle) if solid else face, solid) for face in found]


def _around(face: Sequence[int]) -> list[int]:
    """Nodes of a face around it: FACES has its corners, then the nodes between them, if there are any."""
    corners = len(face) // 2 if len(face) > 4 else len(face)
    if corners == len(face):
        return list(face)
    return [node for pair in zip(face[:corners], face[corners:]) for node in pair]


def _outwards(nodes: Array, face: IntArray, middle: Array) -> IntArray:
    """The way round that a cell of any order of nodes, a wedge or one read mirrored, is inside."""
    corners = nodes[face]
    inwards = np.einsum("nx,nx->n", normals(corners), corners.mean(axis=1) - middle) < 0
    return np.asarray(np.where(inwards[:, None], face[:, ::-1], face))


def _outer(faces: IntArray, solid: bool) -> IntArray:
    """Those of one cell alone."""
    if not solid:
        return faces
    _, first, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    return np.asarray(faces[np.sort(first[count == 1])])


def numbered(faces: Sequence[IntArray]) -> tuple[IntArray, list[IntArray]]:
    """The nodes that faces have, ascending, and the faces in the numbers of these."""
    used = np.unique(np.concatenate([face.ravel() for face in faces]))
    return used, [np.searchsorted(used, face) for face in faces]
