"""Which dof of a sector's faces moves which node along what, of a model that has no table of nodes: by names."""

from __future__ import annotations

import re

import numpy as np

from ..arrays import Indices, IntArray
from ..model.structure import Structure
from ..results.model_file import DIRECTIONS

#: ``n17rx`` is a rotation, ``barx`` a displacement of ``bar``.
_NAME = re.compile(r"(?P<node>n\d+)(?P<way>r[xyz])|(?P<other>.+)(?P<along>[xyz])")


def labels_by_name(structure: Structure, low: Indices, high: Indices, axis: str | None) -> IntArray | None:
    """A number for the node and the direction (n_dof, 2) of dofs named as ``n17y`` or ``tip_y``, -1 beside the faces.

    None where a dof of the faces has no such name or, without an axis, a node lacks one of x, y and z: nothing else
    speaks for the frame of space then.
    """
    all_names = structure.dof_names
    names = {int(dof): _NAME.fullmatch(all_names[dof]) for dof in (*low, *high)}
    moves = {dof: (name["node"] or name["other"], name["way"] or name["along"]) for dof, name in names.items() if name}
    nodes = sorted({node for node, _ in moves.values()})
    whole = {(node, way) for node in nodes for way in "xyz"} <= set(moves.values())
    if len(moves) < len(names) or not (whole or axis):
        return None
    labels = np.full((structure.n_dof, 2), -1, dtype=np.int64)
    for dof, (node, way) in moves.items():
        labels[dof] = nodes.index(node), DIRECTIONS.index(way) + 1
    return labels


def said_of_faces(structure: Structure, axis: str | None) -> str | None:
    """How faces that a case names were taken, of a model without places; None where places were compared.

    Parameters
    ----------
    structure : with the labels that were taken
    """
    if structure.coordinates is not None and structure.expansion is None:
        return None
    taken = "read from their names" if axis else "taken to turn with the sector"
    if axis and structure.labels is None:
        taken = "taken as x, y, z of each node, in the order of low and high"
    unknown = "low, high, sectors" + (" and axis" if axis else "")
    return f"directions of the faces' dofs are {taken}; {unknown} are not checked: no places of nodes are known"
