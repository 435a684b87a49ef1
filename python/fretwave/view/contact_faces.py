"""Contact pairs joined by triangles on each face of their contact, so that what they carry is seen as a surface."""

from __future__ import annotations

import numpy as np
from scipy.spatial import Delaunay, QhullError

from ..arrays import Array, Indices
from ..model.pairs import Pairs
from .vtkhdf import TRIANGLE, VERTEX

#: A triangle with a side longer than the median of the longest sides by this bridges a gap between pairs.
BRIDGE = 3.0


def surface(contact: Pairs) -> tuple[Indices, int]:
    """Cells on the pairs with VTK's number of their kind: triangles on each face, single points where that fails."""
    vertices = np.arange(contact.n_pairs)[:, None], VERTEX
    positions = _positions(contact)
    if positions is None:
        return vertices
    names, number = face_numbers(contact)
    try:
        cells = [_triangles(positions, np.flatnonzero(number == k)) for k in range(len(names))]
    except QhullError:  # fewer than three pairs, or all in a line
        return vertices
    return np.concatenate(cells), TRIANGLE


def _positions(contact: Pairs) -> Array | None:
    """Places on the face (n_pairs, 2): as given, or of the points across the mean normal."""
    if contact.positions is not None:
        return np.asarray(contact.positions, dtype=float)
    if contact.points is None or contact.frames is None or np.shape(contact.frames)[1] != 3:
        return None
    tangents = np.linalg.svd(np.asarray(contact.frames)[:, 0].mean(axis=0)[None])[2][1:]
    return np.asarray(np.asarray(contact.points) @ tangents.T)


def face_numbers(contact: Pairs) -> tuple[list[str], Indices]:
    """Names of the faces, and the number of each pair's."""
    given = list(contact.faces) if contact.faces is not None else [""] * contact.n_pairs
    names = list(dict.fromkeys(str(face) for face in given))
    return names, np.array([names.index(str(face)) for face in given])


def _triangles(positions: Array, pairs: Indices) -> Indices:
    """Of a face's pairs (n, 3), without those that bridge gaps."""
    places = positions[pairs]
    if len(pairs) < 3:
        raise QhullError("fewer than three pairs")
    corners = Delaunay(places).simplices
    sides = np.linalg.norm(places[corners] - places[np.roll(corners, 1, axis=1)], axis=2).max(axis=1)
    return np.asarray(pairs[corners[sides <= BRIDGE * np.median(sides)]])
