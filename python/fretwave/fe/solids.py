"""Shape functions of solid cells by kind, in VTK's node orders, and the points at which their strain is best.

A kind's shape functions are the polynomials that its nodes carry (O. C. Zienkiewicz and R. L. Taylor, The Finite
Element Method, vol. 1, chapter on standard element shape functions), found by solving for them at the nodes.
Tetrahedra and the triangles of wedges lie between 0 and 1, all other coordinates between -1 and 1.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product

import numpy as np

from ..arrays import Array
from .mesh import VTK_LATTICE

Powers = Sequence[tuple[int, ...]]

#: Hexahedra of 8 nodes and three inner ones, whose motion is that of the modes 1 - u_k^2 (C3D8I: E. L. Wilson et al.
#: 1973; R. L. Taylor, P. J. Beresford and E. L. Wilson, Int. J. Numer. Methods Eng. 10 (1976)).
MODES = "incompatible_hexahedron"

#: Edges (places of two corners) in the order of their middle nodes, which follow the corners; in decks the same.
EDGES = {
    "quadratic_tetrahedron": ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)),
    "quadratic_wedge": ((0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)),
    "quadratic_hexahedron": (
        *((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4)),
        *((0, 4), (1, 5), (2, 6), (3, 7)),
    ),
}
_TETRAHEDRON = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
_WEDGE = [(0, 0, 1), (1, 0, 1), (0, 1, 1), (0, 0, -1), (1, 0, -1), (0, 1, -1)]


def _with_middles(kind: str, corners: Sequence[tuple[int, ...]]) -> Array:
    places = np.array(corners, dtype=float)
    middles = [(places[a] + places[b]) / 2 for a, b in EDGES.get(kind, ())]
    return np.vstack([places, *middles])


def _lattice(nodes: int) -> Array:
    return np.array(VTK_LATTICE[:nodes], dtype=float) - 1.0


#: Places (n_nodes, 3) of the nodes of each kind.
PLACES = {
    **{kind: _with_middles(kind, _TETRAHEDRON) for kind in ("tetrahedron", "quadratic_tetrahedron")},
    **{kind: _with_middles(kind, _WEDGE) for kind in ("wedge", "quadratic_wedge")},
    **{"hexahedron": _lattice(8), "quadratic_hexahedron": _lattice(20), "triquadratic_hexahedron": _lattice(27)},
}
_POWERS = list(product(range(3), repeat=3))
#: Powers of the coordinates in the polynomials of each kind.
_OF_NODES: dict[str, Powers] = {
    "tetrahedron": [p for p in _POWERS if sum(p) < 2],
    "quadratic_tetrahedron": [p for p in _POWERS if sum(p) < 3],
    "wedge": [p for p in _POWERS if p[0] + p[1] < 2 and p[2] < 2],
    "quadratic_wedge": [p for p in _POWERS if p[0] + p[1] < 3 and p[2] < 2 or p[0] + p[1] < 2 and p[2] == 2],
    "hexahedron": [p for p in _POWERS if max(p) < 2],
    "quadratic_hexahedron": [p for p in _POWERS if p.count(2) < 2],
    "triquadratic_hexahedron": _POWERS,
}

_FIFTH = (5 - np.sqrt(5)) / 20
_PAIR = (-1 / np.sqrt(3), 1 / np.sqrt(3))
_SIXTH = [(1 / 6, 1 / 6), (2 / 3, 1 / 6), (1 / 6, 2 / 3)]
_CUBE = np.array(list(product(_PAIR, repeat=3)))
#: Points of each kind at which strain is best (J. Barlow, Int. J. Numer. Methods Eng. 10 (1976): those of reduced
#: integration), and powers of the polynomials that go through its values there.
_BEST: dict[str, tuple[Array, Powers]] = {
    "tetrahedron": (np.full((1, 3), 0.25), [(0, 0, 0)]),
    "quadratic_tetrahedron": (
        _FIFTH + (1 - 4 * _FIFTH) * np.array(_TETRAHEDRON, dtype=float),
        _OF_NODES["tetrahedron"],
    ),
    "wedge": (np.array([(1 / 3, 1 / 3, z) for z in _PAIR]), [(0, 0, 0), (0, 0, 1)]),
    "quadratic_wedge": (np.array([(*place, z) for place in _SIXTH for z in _PAIR]), _OF_NODES["wedge"]),
    **{kind: (_CUBE, _OF_NODES["hexahedron"]) for kind in PLACES if kind.endswith("hexahedron")},
}

#: Volume of each kind of cell in its own coordinates.
_VOLUMES = {"tetrahedron": 1 / 6, "wedge": 1.0, "hexahedron": 8.0}
#: Points of Gauss between -1 and 1, and their lengths.
_THREE = list(zip((-np.sqrt(0.6), 0.0, np.sqrt(0.6)), (5 / 9, 8 / 9, 5 / 9)))
_CUBE_OF_THREE = list(product(_THREE, repeat=3))
_FULL = {
    **{
        kind: (
            np.array([[u for u, _ in point] for point in _CUBE_OF_THREE]),
            np.array([np.prod([size for _, size in point]) for point in _CUBE_OF_THREE]),
        )
        for kind in ("quadratic_hexahedron", "triquadratic_hexahedron")
    },
    "quadratic_wedge": (
        np.array([(*place, z) for place in _SIXTH for z, _ in _THREE]),
        np.array([size / 6 for _ in _SIXTH for _, size in _THREE]),
    ),
}


def polynomials(powers: Powers, u: Array) -> tuple[Array, Array]:
    """Products of powers of the coordinates at u (n, d): values (n, k) and derivatives (n, d, k)."""
    p = np.array(powers)
    factors = u[:, None, :] ** p
    slopes = p * u[:, None, :] ** np.maximum(p - 1, 0)
    axes = range(u.shape[1])
    along = [np.prod([slopes[..., b] if b == a else factors[..., b] for b in axes], axis=0) for a in axes]
    return factors.prod(axis=-1), np.stack(along, axis=1)


_SHAPES = {kind: np.linalg.inv(polynomials(_OF_NODES[kind], places)[0]) for kind, places in PLACES.items()}


def shape_functions(kind: str, u: Array) -> tuple[Array, Array]:
    """At u (n, 3): values (n, n_nodes) and derivatives (n, 3, n_nodes)."""
    values, slopes = polynomials(_OF_NODES[kind], u)
    return values @ _SHAPES[kind], slopes @ _SHAPES[kind]


def best_points(kind: str) -> Array:
    """(n_points, 3) at which strain is best."""
    return _BEST["hexahedron" if kind == MODES else kind][0]


def points_of_integration(kind: str, full: bool = False) -> tuple[Array, Array]:
    """Places (n_points, 3) and volumes (n_points,) in a cell's own coordinates: `best_points`, or enough for its K.

    Full integration of hexahedra of 20 and 27 nodes has 3 x 3 x 3 points, of quadratic wedges 3 over the height;
    that of other kinds has the best points.
    """
    points = best_points(kind)
    volume = next(volume for name, volume in _VOLUMES.items() if kind.endswith(name))
    if not full or kind not in _FULL:
        return points, np.full(len(points), volume / len(points))
    return _FULL[kind]


def extrapolation(kind: str) -> Array:
    """(n_nodes, n_points): values at the nodes, of no inner one, from those at `best_points` (Hinton and Campbell)."""
    kind = "hexahedron" if kind == MODES else kind
    points, powers = _BEST[kind]
    return np.asarray(polynomials(powers, PLACES[kind])[0] @ np.linalg.inv(polynomials(powers, points)[0]))


def outside(kind: str, u: Array) -> Array:
    """How far u (n, 3) lies outside of a cell, over its size; below zero inside."""
    return np.asarray(np.max(list(_beyond(kind, u)), axis=0))


def _beyond(kind: str, u: Array) -> Iterator[Array]:
    """What is above zero beyond each face."""
    if kind.endswith("hexahedron"):
        yield from ((abs(u[:, axis]) - 1) / 2 for axis in range(3))
        return
    between = u if kind.endswith("tetrahedron") else u[:, :2]
    yield from -between.T
    yield between.sum(axis=1) - 1
    if kind.endswith("wedge"):
        yield (abs(u[:, 2]) - 1) / 2
