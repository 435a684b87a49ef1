"""Areas of a side's nodes where it lies on the other side in part.

Each face has the share of its area that the other side's faces cover, by their polygons of corners in its plane
(I. E. Sutherland and G. W. Hodgman, Reentrant polygon clipping, Comm. ACM 17, 1974); those of its nodes that lie on the
other side have it between them. The areas add up to the overlap, of plane faces exactly.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from ..arrays import Array, IntArray
from ..errors import InputError
from .surfaces import ALIKE, Side, nodal_areas

#: Share of the overlap that may be on faces of which no node lies on the other side.
LOST = 0.05


def overlap(first: Side, second: Side, on: npt.NDArray[np.bool_], where: str) -> Array:
    """Areas (n,) of the first side's nodes, zero of those that do not lie `on` the second.

    Raises
    ------
    InputError
        Much of the overlap is between them: the first side's mesh is too coarse for the second.
    """
    areas, lost, near = np.zeros(len(first.numbers)), 0.0, Polygons(second)
    for table in first.faces:
        shares, own = nodal_areas(first.points[table]), on[table]
        size = shares.sum(axis=1)
        for k in np.flatnonzero(~own.all(axis=1)):
            size[k] *= near.cover(first.points[table[k]])
        part = np.where(own, shares, 0.0)
        total = part.sum(axis=1)
        lost += float(size[total == 0].sum())
        np.add.at(areas, table, part * (size / np.where(total == 0, 1.0, total))[:, None])
    if lost > LOST * (areas.sum() + lost):
        measured = f"{lost:.3g} of {areas.sum() + lost:.3g} on faces of which no node lies on {second.where}"
        fix = f"write {second.name} first, whose mesh is finer"
        raise InputError("the overlap is between the first side's nodes", where, measured, f"at most {LOST:.0%}", fix)
    return np.asarray(areas * (1 + lost / areas.sum()))


class Polygons:
    """Corners of a side's faces, to be laid over others'."""

    def __init__(self, side: Side) -> None:
        self.corners = [x for table in side.faces for x in side.points[_corners(table)]]
        middles = np.array([x.mean(axis=0) for x in self.corners])
        self.size = max(np.linalg.norm(x - m, axis=1).max() for x, m in zip(self.corners, middles))
        self.tree = cKDTree(middles)

    def cover(self, face: Array) -> float:
        """The share of a face's corners (m, 3) that those cover which look at it, and are not over it by its size."""
        own = face[: _count(len(face))]
        middle, normal = own.mean(axis=0), _normal(own)
        reach = np.linalg.norm(own - middle, axis=1).max()
        along = (own[2] - own[0]) / np.linalg.norm(own[2] - own[0])
        plane = np.array([along, np.cross(normal, along)])
        flat, covered = (own - middle) @ plane.T, 0.0
        for k in self.tree.query_ball_point(middle, reach + self.size):
            other = self.corners[k] - middle
            if _normal(other) @ normal < -ALIKE and abs(other.mean(axis=0) @ normal) < reach:
                covered += _area(_clipped(other[::-1] @ plane.T, flat))
        return min(1.0, covered / _area(flat))


def _count(nodes: int) -> int:
    return 3 if nodes in (3, 6) else 4


def _corners(table: IntArray) -> IntArray:
    return table[:, : _count(table.shape[1])]


def _normal(corners: Array) -> Array:
    """Unit normal of a polygon (m, 3), by its diagonals or two edges."""
    found = np.cross(corners[2] - corners[0], corners[-1] - corners[1])
    return np.asarray(found / np.linalg.norm(found))


def _area(polygon: Array) -> float:
    """Of a plane polygon (m, 2)."""
    if len(polygon) < 3:
        return 0.0
    x, y = polygon.T
    return float(abs(x @ np.roll(y, -1) - y @ np.roll(x, -1))) / 2


def _clipped(polygon: Array, by: Array) -> Array:
    """What of a polygon (m, 2) is within a convex one, counterclockwise."""
    for start, end in zip(by, np.roll(by, -1, axis=0)):
        inward = np.array([start[1] - end[1], end[0] - start[0]])
        side = (polygon - start) @ inward
        kept = []
        for k in range(len(polygon)):
            if side[k - 1] * side[k] < 0:
                share = side[k - 1] / (side[k - 1] - side[k])
                kept.append(polygon[k - 1] + share * (polygon[k] - polygon[k - 1]))
            if side[k] >= 0:
                kept.append(polygon[k])
        polygon = np.array(kept).reshape(-1, 2)
    return polygon
