"""Faces of a sector whose dofs are along x, y and z: what ties them is a turn of whole nodes about the wheel's axis."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..arrays import Indices, IntArray
from ..errors import InputError
from ..model.structure import Structure
from .faces import match_faces


def framed(
    structure: Structure, low: Indices, high: Indices, sectors: int, axis: str | None
) -> tuple[Indices, Indices, str | None]:
    """Faces whose dofs may be along x, y and z, in the order that a turn about the axis needs.

    Parameters
    ----------
    structure : whose dofs (n_dof,) may be known by node and direction, and its nodes by their places
    low, high : (n_face,) matching dofs

    Returns
    -------
    low, high : (n_face,)
        x, y, z of each node, where its directions are known.
    axis : about which they turn, None where nothing turns

    Raises
    ------
    InputError
        The axis is not known, a node is on the face with some directions only, or nodes do not match.
    """
    labels = moves_of(structure)
    if labels is None or len(low) != len(high):
        return low, high, axis
    if axis is None:
        raise InputError(
            "the dofs of the faces are along x, y and z, and the axis of the wheel is not known",
            None,
            f"{structure.dof_names[int(low[0])]} and {structure.dof_names[int(high[0])]}",
            "an axis about which their directions turn from sector to sector",
            f'add `axis = "{_axis_of(structure, labels, low, high, sectors)}"`'
            + (
                ""
                if structure.coordinates is not None
                else ", or whichever it is; dofs that turn along need other names"
            ),
        )
    if set(labels[np.append(low, high), 1]) <= {along := "xyz".index(axis) + 1, along + 3}:
        return low, high, None
    low, high = in_triples(labels, low, high, structure.dof_names)
    _check_places(structure, labels, low, high, sectors, axis)
    return low, high, axis


def moves_of(structure: Structure) -> IntArray | None:
    """Node and direction (n_dof, 2) of each dof: place among the coordinates, else number; None where unknown."""
    if structure.expansion is not None:
        return None
    if structure.coordinates is None:
        return structure.labels
    table = structure.dofs_of_nodes
    node, column = np.nonzero(table >= 0)
    found = np.full((structure.n_dof, 2), -1, dtype=np.int64)
    found[table[node, column]] = np.column_stack([node, column + 1])
    if structure.labels is not None:  # rotations are not among the displacements
        found[:, 1] = structure.labels[:, 1]
    return found


def in_triples(labels: IntArray, low: Indices, high: Indices, names: Sequence[str]) -> tuple[Indices, Indices]:
    """Matching dofs of two faces, node by node along x, y, z (and about x, y, z).

    Parameters
    ----------
    labels : (n_dof, 2) node and direction
    low, high : (n_face,) matching dofs, in any order
    names : (n_dof,) for messages

    Raises
    ------
    InputError
        Two matching dofs have different directions, or a node some directions only.
    """
    unlike = np.flatnonzero(labels[low, 1] != labels[high, 1])
    if len(unlike):
        measured = f"{names[low[unlike[0]]]} and {names[high[unlike[0]]]}"
        fix = "list both faces node by node, x, y, z"
        raise InputError("the faces' dofs differ in direction", None, measured, "the same direction on both", fix)
    order = np.lexsort((labels[low, 1], (labels[low, 1] - 1) // 3, labels[high, 0], labels[low, 0]))
    low, high = low[order], high[order]
    body = np.column_stack([labels[low, 0], labels[high, 0], (labels[low, 1] - 1) // 3])
    _, first, count = np.unique(body, axis=0, return_index=True, return_counts=True)
    if (count != 3).any():
        there = np.flatnonzero((body == body[first[count != 3][0]]).all(axis=1))
        raise InputError(
            "a node is on the sector's faces with some of its directions only",
            None,
            ", ".join(names[dof] for dof in low[there]),
            "its three directions: the frame turns from sector to sector",
            "name all three, or hold all three",
        )
    return low, high


def _check_places(structure: Structure, labels: IntArray, low: Indices, high: Indices, sectors: int, axis: str) -> None:
    """Nodes that are given as matching do so in space, where their places are known."""
    if structure.coordinates is None:
        return
    first, second = labels[low[::3], 0], labels[high[::3], 0]
    _, found = match_faces(structure.coordinates, first, second, sectors, axis, numbers=structure.node_numbers)
    wrong = np.flatnonzero(found != second)
    if len(wrong):
        names, k = structure.dof_names, 3 * int(wrong[0])
        lies = names[low[k]], names[np.flatnonzero(labels[:, 0] == found[wrong[0]])[0]]
        fix = "list the nodes of both faces in one order"
        measured = f"{names[low[k]]} with {names[high[k]]}, and {len(wrong) - 1} more"
        raise InputError("matching dofs lie at different places", None, measured, " with ".join(lies), fix)


def _axis_of(structure: Structure, labels: IntArray, low: Indices, high: Indices, sectors: int) -> str:
    """About which the faces match, as far as the nodes tell."""
    if structure.coordinates is None:
        return "z"
    for axis in "xyz":
        try:
            match_faces(structure.coordinates, np.unique(labels[low, 0]), np.unique(labels[high, 0]), sectors, axis)
        except InputError:
            continue
        return axis
    return "z"
