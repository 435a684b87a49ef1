"""Shape functions of faces: triangles of 3 and 6 nodes, quadrilaterals of 4 and 8, corners first, then middle nodes.

Each set is the polynomials that its nodes carry (O. C. Zienkiewicz and R. L. Taylor, The Finite Element Method, vol. 1,
chapter on standard element shape functions), found by solving for them at the nodes. Triangles lie between (0, 0),
(1, 0), (0, 1), quadrilaterals in [-1, 1]^2.
"""

from __future__ import annotations

import numpy as np

from ..arrays import Array
from ..fe.solids import polynomials

_CORNERS = {3: [(0, 0), (1, 0), (0, 1)], 4: [(-1, -1), (1, -1), (1, 1), (-1, 1)]}
#: Powers of both coordinates in the polynomials of a face of so many nodes.
_POWERS = {
    3: [(0, 0), (1, 0), (0, 1)],
    4: [(0, 0), (1, 0), (0, 1), (1, 1)],
    6: [(0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2)],
    8: [(0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2), (2, 1), (1, 2)],
}


def corners_of(count: int) -> int:
    """Corners of a face of so many nodes."""
    return count if count < 5 else count // 2


def node_places(count: int) -> Array:
    """(count, 2)"""
    corners = np.array(_CORNERS[corners_of(count)], dtype=float)
    middle = (corners + np.roll(corners, -1, axis=0)) / 2
    return np.vstack([corners, middle])[:count]


_SHAPES = {count: np.linalg.inv(polynomials(_POWERS[count], node_places(count))[0]) for count in _POWERS}


def shape_functions(count: int, u: Array) -> tuple[Array, Array]:
    """Of a face of count nodes at u (n, 2): values (n, count) and gradients (n, 2, count)."""
    values, gradients = polynomials(_POWERS[count], u)
    return values @ _SHAPES[count], gradients @ _SHAPES[count]


def outside(count: int, u: Array) -> Array:
    """How far u (n, 2) lies outside of a face, over its size; below zero inside."""
    if corners_of(count) == 3:
        return np.asarray(np.maximum(-u.min(axis=1), u.sum(axis=1) - 1))
    return np.asarray((abs(u).max(axis=1) - 1) / 2)


def centre(count: int) -> Array:
    """(2,)"""
    return np.asarray(node_places(count)[: corners_of(count)].mean(axis=0))


def gauss(count: int) -> tuple[Array, Array]:
    """Points (q, 2) and weights (q,) exact for squares of the shape functions on flat faces with straight edges."""
    x, w = np.sqrt(0.6) * np.array([-1.0, 0.0, 1.0]), np.array([5.0, 8.0, 5.0]) / 9
    if corners_of(count) == 4:
        return np.stack(np.meshgrid(x, x), axis=-1).reshape(-1, 2), np.outer(w, w).ravel()
    # D. A. Dunavant, Int. J. Numer. Methods Eng. 21 (1985), degree 4: two orbits of three points.
    orbits = ((0.445948490915965, 0.223381589678011), (0.091576213509771, 0.109951743655322))
    points = [place for a, _ in orbits for place in ((a, a), (1 - 2 * a, a), (a, 1 - 2 * a))]
    return np.array(points), np.repeat([weight / 2 for _, weight in orbits], 3)
