"""CalculiX' C3D8I: three inner nodes a cell carry its incompatible modes, numbered on from the deck's, cell by cell."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..arrays import IntArray
from ..errors import InputError
from ..importers.internal import internal_nodes
from ..model.structure import Structure


def with_inner_nodes(structure: Structure, where: str) -> Structure:
    """The structure with them. Without them a cell that bends has no strain across, and too much shear.

    Raises
    ------
    InputError
        Not every hexahedron has three.
    """
    inner, cells = internal_nodes(structure), structure.hexahedra
    if not len(inner) or structure.coordinates is None or structure.displacements is None or cells is None:
        return structure
    if cells.shape[1] != 8 or len(inner) != 3 * len(cells):
        measured = f"{len(inner)} inner nodes of {len(cells)} hexahedra of {cells.shape[1]} nodes"
        what, fix = "it is not known which cells have incompatible modes", "mesh all hexahedra of 8 nodes as C3D8I"
        raise InputError(what, where, measured, "three of each cell, or none", fix)
    count, middles = len(structure.coordinates), structure.coordinates[cells].mean(axis=1)
    return replace(
        structure,
        coordinates=np.vstack([structure.coordinates, np.repeat(middles, 3, axis=0)]),
        displacements=np.vstack([structure.displacements, _dofs(structure, inner)]),
        hexahedra=np.hstack([cells, count + np.arange(3 * len(cells)).reshape(-1, 3)]),
        node_numbers=np.append(np.asarray(structure.node_numbers), inner),
    )


def _dofs(structure: Structure, inner: IntArray) -> IntArray:
    """(n_inner, 3) along x, y, z, -1 where there is none."""
    assert structure.labels is not None
    node, direction = structure.labels.T
    found = np.full((len(inner), 3), -1, dtype=np.int64)
    own = np.flatnonzero(np.isin(node, inner))
    found[np.searchsorted(inner, node[own]), direction[own] - 1] = own
    return found
