"""A dof that a model does not have by this name: it has another, is held, is the next sector's, or is misspelt."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence

import numpy as np

from ..model.structure import Structure
from ..texts import nearest
from .model_file import DIRECTIONS

_NAME = re.compile(r"n?(\d+)(r?[xyz])")
Say = Callable[[str], str]


def missing_dof(
    structure: Structure, name: str, known: Sequence[str], say: Say = "did you mean `{}`?".format
) -> str | None:
    """A fix line for a dof that is not among the known names; None when nothing is to be said.

    Parameters
    ----------
    structure : of a sector with both its faces
    """
    names = structure.dof_names
    dof = names.index(name) if name in names else _by_move(structure, name)
    if dof is None:
        return _of_node(structure, name) or nearest(name, known, say)
    if structure.low is not None and structure.high is not None and dof in structure.high:
        partner = names[int(structure.low[list(structure.high).index(dof)])]
        return f"{name} is on the high face, which is the next sector's low face: there it is `{partner}`"
    return f"{name} is called `{names[dof]}`" if names[dof] in known else None


def _by_move(structure: Structure, name: str) -> int | None:
    """Number of the dof that ``n17y`` says by node and direction."""
    found = _NAME.fullmatch(name)
    if found is None or structure.labels is None:
        return None
    rows = np.flatnonzero((structure.labels == (int(found[1]), DIRECTIONS.index(found[2]) + 1)).all(axis=1))
    return int(rows[0]) if len(rows) else None


def _of_node(structure: Structure, name: str) -> str | None:
    """A node's direction that the matrices have not: held, where the mesh has the node."""
    found = _NAME.fullmatch(name)
    if found is None or structure.labels is None or structure.node_numbers is None:
        return None
    node, free = int(found[1]), [DIRECTIONS[k - 1] for n, k in structure.labels if n == int(found[1]) and k <= 6]
    if node not in structure.node_numbers:
        return f"name a node of the mesh: it has no node {node}"
    if free:
        return f"node {node} is held along {found[2]} (not in the matrices), and free along {', '.join(free)}"
    return f"node {node} is held: it is not in the matrices"
