"""Low and high face of a sector: which nodes match when one is turned onto the other."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from ..arrays import Array, Indices
from ..errors import InputError
from ..given import masked, place, whole
from ..model.sectors import check_number, rotation

#: Distance of matching nodes, as a share of the faces' extent.
TOLERANCE = 1e-6
#: A number of sectors is whole to this share.
WHOLE = 1e-6
SHOWN = 5


class _Nearest(NamedTuple):
    """Nearest nodes of the low face, turned, and the high one."""

    partner: Indices
    low_gap: Array
    high_gap: Array

    @property
    def farthest(self) -> float:
        return float(max(self.low_gap.max(initial=0.0), self.high_gap.max(initial=0.0)))


def match_faces(
    xyz: npt.ArrayLike,
    low: npt.ArrayLike,
    high: npt.ArrayLike,
    sectors: int,
    axis: str = "z",
    tolerance: float | None = None,
    numbers: npt.ArrayLike | None = None,
) -> tuple[Indices, Indices]:
    """Nodes of the two faces in matching order: the low face turned by 2 pi / N about the axis lies on the high one.

    Parameters
    ----------
    xyz : (n_nodes, 3) [length]
    low, high : node numbers of the faces, in any order
    tolerance : [length], optional
        Largest distance of matching nodes; default 1e-6 of the faces' extent.
    numbers : (n_nodes,), optional
        What messages call the nodes; default their place.

    Returns
    -------
    low, high : (n_face,)
        low as given, high reordered to match.

    Raises
    ------
    InputError
        With the nodes that have no partner, and what would match: the faces swapped, another number of sectors or
        axis; or for nodes on the axis, which both faces share, and such as are not there.
    """
    if masked(xyz):
        fix = "give the coordinates of all nodes"
        raise InputError("nodes of a mesh have no places", "xyz", "masked entries", "(n_nodes, 3) numbers", fix)
    points, low, high = np.asarray(xyz, dtype=float), _nodes("low", low), _nodes("high", high)
    sectors = check_number(sectors)
    for node in (end for nodes in (low, high) if len(nodes) for end in (nodes.min(), nodes.max())):
        place("node", node, len(points))
    called = np.arange(len(points)) if numbers is None else np.asarray(numbers)
    _check_given(points, low, high, axis, called)
    extent = float(np.ptp(points[np.concatenate([low, high])], axis=0).max())
    limit = TOLERANCE * extent if tolerance is None else tolerance
    near = _nearest(points[low], points[high], 2 * np.pi / sectors, axis)
    matched = near.farthest <= limit and len(low) == len(high) == len(np.unique(near.partner))
    found, fix = ("", "") if matched else _explained(points[low], points[high], sectors, axis, limit)
    if not found:
        _refuse_axis(points, low, axis, called)
    if matched:
        return low, high[near.partner]
    alone_low, alone_high = low[near.low_gap > limit], high[near.high_gap > limit]
    raise InputError(
        "the faces of the sector do not match",
        _listed("low", points, alone_low, called) + "; " + _listed("high", points, alone_high, called),
        f"{len(alone_low)} of {len(low)} low and {len(alone_high)} of {len(high)} high nodes without a partner, "
        f"the farthest {near.farthest:.3g} away{found}",
        f"the low face turned by 360/{sectors} degrees about {axis} on the high face, to {limit:.2g}",
        fix,
    )


def _nodes(name: str, given: npt.ArrayLike) -> Indices:
    """Node numbers of a face; an empty list is none."""
    found = np.asarray(None if masked(given) else given)
    if found.dtype.kind in "iu":
        return found.astype(np.intp)
    logical = any(isinstance(one, (bool, np.bool_)) for one in found.flat)
    if logical or not all(_is_whole(one) for one in found.flat):
        measured = "masked entries" if masked(given) else str(found.dtype)
        fix = "give node numbers, not a mask" if logical or masked(given) else "give node numbers"
        raise InputError(f"nodes of the {name} face are not whole numbers", None, measured, "integers", fix)
    return found.astype(np.intp)


def _is_whole(one: object) -> bool:
    """Also one that a file of floats has given."""
    return whole(one) is not None or (isinstance(one, (float, np.floating)) and bool(one % 1 == 0))


def _nearest(low: Array, high: Array, angle: float, axis: str) -> _Nearest:
    turned = low @ rotation(angle, axis).T
    low_gap, partner = cKDTree(high).query(turned)
    high_gap, _ = cKDTree(turned).query(high)
    return _Nearest(partner, low_gap, high_gap)


def _explained(low: Array, high: Array, sectors: int, axis: str, limit: float) -> tuple[str, str]:
    """What lies on the high face instead, added to what was measured, and the fix."""
    found = [(about, angle) for about in "xyz" if (angle := _angle_between(low, high, about))]
    found = [(about, angle) for about, angle in found if _nearest(low, high, angle, about).farthest <= limit]
    # half a turn about another axis is the mirror image of a sector that has one
    found = [(about, angle) for about, angle in found if about == axis or abs(angle) < 0.99 * np.pi]
    if not found:
        return "", "mesh both faces alike"
    about, angle = min(found, key=lambda one: (abs(2 * np.pi / abs(one[1]) - sectors) > 0.5, one[0] != axis))
    said = f"; turned by {np.degrees(angle):.6g} degrees about {about} it lies there"
    number = 2 * np.pi / abs(angle)
    if abs(number / round(number) - 1) > WHOLE:
        return said, f"model a sector of 360/{sectors} degrees"
    changes = ["swap low and high"] if angle < 0 else []
    changes += [f"give {round(number)} sectors"] if round(number) != sectors else []
    changes += [f"give the axis {about}"] if about != axis else []
    return said, " and ".join(changes)


def _angle_between(low: Array, high: Array, axis: str) -> float:
    """From the middle of one face to that of the other about an axis, -pi to pi [rad]."""
    first, second = (np.roll(face.mean(axis=0), -1 - "xyz".index(axis))[:2] for face in (low, high))
    return float(np.angle(complex(*second) / complex(*first))) if np.any(first) else 0.0


def _check_given(points: Array, low: Indices, high: Indices, axis: str, called: npt.NDArray[np.int64]) -> None:
    both = np.intersect1d(low, high)
    if len(low) and len(high) and not len(both):
        return
    _refuse_axis(points, both, axis, called)
    measured = f"{len(low)} low and {len(high)} high nodes"
    measured += f", {len(both)} of them on both, the first {called[both[0]]}" if len(both) else ""
    fix = "give each node to one face" if len(both) else "name the nodes of both faces"
    raise InputError("the faces of the sector are not two", None, measured, "different nodes on each", fix)


def _refuse_axis(points: Array, face: Indices, axis: str, called: npt.NDArray[np.int64]) -> None:
    radius = np.linalg.norm(np.delete(points, "xyz".index(axis), axis=1), axis=1)
    on_axis = face[radius[face] <= TOLERANCE * radius.max(initial=0.0)]
    if len(on_axis):
        raise InputError(
            "nodes of the faces lie on the axis",
            _listed("low", points, on_axis, called),
            f"{len(on_axis)} nodes",
            "none: all sectors would share them",
            "give the wheel a hole along its axis",
        )


def _listed(face: str, points: Array, nodes: Indices, called: npt.NDArray[np.int64]) -> str:
    shown = ", ".join(f"{called[n]} ({', '.join(f'{x:.6g}' for x in points[n])})" for n in nodes[:SHOWN])
    more = f" and {len(nodes) - SHOWN} more" if len(nodes) > SHOWN else ""
    return f"{face} face: {shown or 'none'}{more}"
