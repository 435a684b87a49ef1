"""Low and high face of a sector: which nodes match when one is turned onto the other."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from ..arrays import Array, Indices
from ..errors import InputError
from ..model.sectors import rotation

#: Distance of matching nodes, as a share of the face's extent.
TOLERANCE = 1e-6
SHOWN = 5


def match_faces(
    xyz: npt.ArrayLike, low: npt.ArrayLike, high: npt.ArrayLike, sectors: int, axis: str = "z"
) -> tuple[Indices, Indices]:
    """Nodes of the two faces in matching order: the low face turned by 2 pi / N about the axis lies on the high one.

    Parameters
    ----------
    xyz : (n_nodes, 3) [length]
    low, high : node numbers of the faces, in any order

    Returns
    -------
    low, high : (n_face,)
        low as given, high reordered to match.

    Raises
    ------
    InputError
        With the nodes that have no partner; or for nodes on the axis, which both faces share.
    """
    points, low, high = np.asarray(xyz, dtype=float), np.asarray(low, dtype=np.intp), np.asarray(high, dtype=np.intp)
    _refuse_axis(points, low, axis)
    turned = points[low] @ rotation(2 * np.pi / sectors, axis).T
    limit = TOLERANCE * float(np.ptp(points[low], axis=0).max())
    gap, partner = cKDTree(points[high]).query(turned)
    back, _ = cKDTree(turned).query(points[high])
    alone_low, alone_high = low[gap > limit], high[back > limit]
    if len(alone_low) or len(alone_high) or len(low) != len(high):
        raise InputError(
            "the faces of the sector do not match",
            _listed("low", points, alone_low) + "; " + _listed("high", points, alone_high),
            f"{len(alone_low)} of {len(low)} low and {len(alone_high)} of {len(high)} high nodes without a partner, "
            f"the farthest {max(gap.max(), back.max()):.3g} away",
            f"the low face turned by 360/{sectors} degrees about {axis} on the high face, to {limit:.2g}",
            "mesh both faces alike, check the number of sectors and the axis, or swap low and high",
        )
    return low, high[partner]


def _refuse_axis(points: Array, low: Indices, axis: str) -> None:
    radius = np.linalg.norm(np.delete(points[low], "xyz".index(axis), axis=1), axis=1)
    on_axis = low[radius <= TOLERANCE * radius.max(initial=0.0)]
    if len(on_axis):
        raise InputError(
            "nodes of the faces lie on the axis",
            _listed("low", points, on_axis),
            f"{len(on_axis)} nodes",
            "none: all sectors would share them",
            "give the wheel a hole along its axis",
        )


def _listed(face: str, points: Array, nodes: Indices) -> str:
    shown = ", ".join(f"{node} ({', '.join(f'{x:.6g}' for x in points[node])})" for node in nodes[:SHOWN])
    more = f" and {len(nodes) - SHOWN} more" if len(nodes) > SHOWN else ""
    return f"{face} face: {shown or 'none'}{more}"
