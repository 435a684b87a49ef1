"""Nodes of one side on the faces of the other: what ties meshes that do not match.

A node of the first side is tied to its closest point on a face of the second, whose motion the face's shape functions
give (node-to-surface; P. Wriggers, Computational Contact Mechanics, 2nd ed., Springer 2006, chapters 4 and 8). A linear
displacement common to both then gives no relative displacement where the node lies on the face.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from ..arrays import Array, IntArray
from .shapes import centre, outside, shape_functions
from .surfaces import Side

#: A node this far outside of a face, over the face's size, is on it still: curved faces meet at an angle.
SLACK = 1e-2
#: Steps of Gauss and Newton, and where they end.
STEPS, SMALL = 30, 1e-14
#: Keeps a metric regular where corners of a face coincide; what it leads to is the same.
TINY = 1e-300
#: Weights below are rounding.
LEAST = 1e-12


def project(points: Array, second: Side) -> tuple[sp.csr_matrix, Array]:
    """Weights (n, n_second) of the second side's nodes, and the distance (n,) of each point, infinite beside them."""
    rows, columns, values = [np.zeros(0, dtype=np.int64)] * 2 + [np.zeros(0)]
    best = np.full(len(points), np.inf)
    for table in second.faces:
        point, face = _near(points, second.points[table])
        u = _closest(points[point], second.points[table[face]])
        weights = shape_functions(table.shape[1], u)[0]
        gap = np.linalg.norm(points[point] - np.einsum("nm,nmx->nx", weights, second.points[table[face]]), axis=1)
        gap[outside(table.shape[1], u) > SLACK] = np.inf
        chosen = _least(point, gap, best)
        best[point[chosen]] = gap[chosen]
        kept = ~np.isin(rows, point[chosen])  # those that a face of another kind had
        nodes = table[face[chosen]]
        rows = np.append(rows[kept], np.repeat(point[chosen], table.shape[1]))
        columns, values = np.append(columns[kept], nodes), np.append(values[kept], weights[chosen])
    values[abs(values) < LEAST] = 0.0
    W = sp.csr_matrix((values, (rows, columns)), shape=(len(points), len(second.numbers)))
    W.eliminate_zeros()
    return W, best


def _near(points: Array, faces: Array) -> tuple[IntArray, IntArray]:
    """Pairs (point, face) of which a point is within a face's size of its middle."""
    middle = faces.mean(axis=1)
    size = np.linalg.norm(faces - middle[:, None], axis=-1).max(axis=1)
    near = cKDTree(middle).query_ball_point(points, 2 * float(size.max()))
    point = np.repeat(np.arange(len(points)), [len(found) for found in near])
    return point, np.array([face for found in near for face in found], dtype=np.int64)


def _closest(points: Array, faces: Array) -> Array:
    """Coordinates (n, 2) of the place on each face (n, m, 3) closest to its point (n, 3), by Gauss and Newton."""
    m = faces.shape[1]
    u = np.broadcast_to(centre(m), (len(points), 2)).copy()
    for _ in range(STEPS):
        values, gradients = shape_functions(m, u)
        along = gradients @ faces
        away = points - np.einsum("nm,nmx->nx", values, faces)
        metric = along @ along.swapaxes(1, 2)
        metric += (SMALL * np.trace(metric, axis1=1, axis2=2)[:, None, None] + TINY) * np.eye(2)
        step = np.linalg.solve(metric, along @ away[:, :, None])[:, :, 0]
        u = np.clip(u + step, -3.0, 3.0)  # far beside a face it does not matter where
        if abs(step).max(initial=0.0) < SMALL:
            break
    return u


def _least(point: IntArray, gap: Array, best: Array) -> IntArray:
    """Places of the nearest face of each point, where it is nearer than the best so far."""
    order = np.lexsort((gap, point))
    first = order[np.unique(point[order], return_index=True)[1]]
    return np.asarray(first[gap[first] < best[point[first]]])
