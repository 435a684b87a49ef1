"""Whether a sector's faces are complete: nodes that lie on the next sector's, and that nothing joins to them.

Every sector brings its own copy of them, so that the wheel is cut open there, at a node on the axis into N points.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from ..arrays import IntArray
from ..errors import InputError
from ..model.sectors import by_sector
from ..model.structure import Structure
from ..texts import counted
from .nodes import Nodes
from .pairs import listed, reach_of
from .sector import SectorFaces


def check_untied(model: Structure, wheel: SectorFaces, nodes: Nodes, tolerance: float | None) -> list[str]:
    """A warning of free nodes that lie where the next sector's do, and are on no face and in no contact with it.

    Raises
    ------
    InputError
        A free node lies on the axis, where all sectors would share it.
    """
    assert model.labels is not None
    own = nodes.places(np.intersect1d(nodes.numbers, model.labels[:, 0]))
    points, numbers = nodes.coordinates[own], nodes.numbers[own]
    gap, partner = cKDTree(points).query(points @ wheel.turn.T)
    there = gap <= reach_of(nodes, tolerance)
    centre = numbers[np.linalg.norm(points @ wheel.turn.T - points, axis=1) <= reach_of(nodes, None)]
    if len(centre):
        where, fix = f"{nodes.where}, nodes {_listed(centre)}", "give the wheel a hole along its axis, or hold them"
        raise InputError("free nodes lie on the axis", where, f"{len(centre)} nodes", "none: all share them", fix)
    joined = np.isin(numbers, _joined(model, wheel, nodes))
    loose = there & ~joined & ~joined[partner] & (partner != np.arange(len(own)))
    if not loose.any():
        return []
    which, faces = counted(int(loose.sum()), "free node"), f"{wheel.low} and {wheel.high}"
    ends = f"({_listed(numbers[loose])}) turned to the next sector lie on its nodes {_listed(numbers[partner[loose]])}"
    return [f"{which} {ends}, and nothing joins them: are {faces} complete? Else the wheel is cut there"]


def _joined(model: Structure, wheel: SectorFaces, nodes: Nodes) -> IntArray:
    """Numbers of nodes on the faces, and of those in contact with the next sector."""
    assert model.labels is not None
    found = [nodes.node_set(wheel.low), nodes.node_set(wheel.high)]
    for pairs in model.pairs.values():
        if 1 in (parts := by_sector(pairs.B)):
            found += [model.labels[np.unique(part.nonzero()[1]), 0] for part in parts.values()]
    return np.concatenate(found)


def _listed(numbers: IntArray) -> str:
    return listed([str(number) for number in numbers])
