"""Kinds of cells that a mesh may have, by name: nodes of a cell, in VTK's order, and VTK's number (vtkCellType.h)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from ..arrays import Array, Indices


class Kind(NamedTuple):
    """Nodes of a cell, and what VTK calls it."""

    nodes: int
    vtk: int


KINDS = {
    "triangle": Kind(3, 5),
    "quadrilateral": Kind(4, 9),
    "tetrahedron": Kind(4, 10),
    "wedge": Kind(6, 13),
    "hexahedron": Kind(8, 12),
    "quadratic_tetrahedron": Kind(10, 24),
    "quadratic_wedge": Kind(15, 26),
    "quadratic_hexahedron": Kind(20, 25),
    "triquadratic_hexahedron": Kind(27, 29),
}
#: VTK's number of hexahedra by their nodes.
HEXAHEDRA = {kind.nodes: kind.vtk for name, kind in KINDS.items() if name.endswith("hexahedron")}


def normals(corners: Array) -> Array:
    """Unit normals (n, 3) of polygons (n, k, 3), out of the side on which they run counter-clockwise."""
    middle = corners - corners.mean(axis=1, keepdims=True)
    found = np.cross(middle, np.roll(middle, -1, axis=1)).sum(axis=1)
    return np.asarray(found / np.maximum(np.linalg.norm(found, axis=1, keepdims=True), np.finfo(float).tiny))


def wrong_cells(cells: Mapping[str, Indices], n_nodes: int) -> str | None:
    """What does not fit in cells by their kinds, None when nothing does not."""
    for name, table in cells.items():
        if name not in KINDS:
            return f"there is no kind of cell '{name}', known are {', '.join(KINDS)}"
        if table.ndim != 2 or table.shape[1] != KINDS[name].nodes:
            return f"cells '{name}' have the shape {table.shape}, not (n_cells, {KINDS[name].nodes})"
        if table.size and not 0 <= table.min() <= table.max() < n_nodes:
            return f"cells '{name}' have the nodes {table.min()} to {table.max()} of {n_nodes}"
    return None
