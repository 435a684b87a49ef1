"""Areas of a side's nodes by which CalculiX' contact from node to surface makes forces of pressures.

Each node of the dependent side has a spring; its area is a share of those of its faces, which is not the integral of a
shape function: of faces of 3 and 4 nodes equal shares, of 6 and 8 nodes nearly all is the middle nodes' (CalculiX
CrunchiX 2.20, the weights of slave nodes; nodal forces K u over pressures are these within 3e-4, the spring's offset).
"""

from __future__ import annotations

import numpy as np

from ..arrays import Array
from .shapes import corners_of
from .surfaces import Side, nodal_areas

#: Share of a face of so many nodes that a corner has; middle nodes have the rest between them.
CORNER = {3: 1 / 3, 4: 1 / 4, 6: 1 / 999, 8: 1 / 100}


def spring_areas(side: Side) -> Array:
    """Of each node (n,) [length^2], zero of a node on no face."""
    areas = np.zeros(len(side.numbers))
    for table in side.faces:
        size = nodal_areas(side.points[table]).sum(axis=1)
        np.add.at(areas, table, size[:, None] * shares(table.shape[1]))
    return areas


def shares(count: int) -> Array:
    """(count,) of a face, corners first."""
    corners, corner = corners_of(count), CORNER[count]
    middle = (1 - corners * corner) / corners
    return np.array([corner] * corners + [middle] * (count - corners))
