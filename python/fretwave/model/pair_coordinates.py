"""Displacements of contact pairs as coordinates of a model, so that a reduction keeps them alone.

A pair that takes the mean over its cell reaches many dofs, all of which a Craig-Bampton reduction would have to keep.
Here as many dofs of a pair as it has rows, which no other pair reaches, give their places to the rows' values u = B x,

    x_p = B_p^-1 (u - B_r x_r),

an exact change of variables x = T z that leaves all other dofs as they are.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import scipy.linalg
import scipy.sparse as sp

from ..arrays import Array, IntArray
from ..errors import InputError
from ..kinds import of_their_kinds
from .sectors import real_csr
from .structure import Structure

#: Smallest pivot of a pair's rows over the largest.
REGULAR = 1e-3


@of_their_kinds
def on_pair_coordinates(structure: Structure) -> Structure:
    """The same structure in coordinates of which each row of its pairs is one; `expansion` leads back to the dofs.

    Raises
    ------
    InputError
        A sector, a wheel or a model reduced before; a pair has not as many dofs of its own as rows.
    """
    if structure.sectors or structure.expansion is not None:
        raise InputError("pairs are made coordinates of plain structures alone", fix="leave the pairs as they are")
    places = dict(_places(structure))
    T = _transformation(structure, places)

    def congruent(A: object) -> sp.csr_matrix:
        product = sp.csr_matrix(T.T @ real_csr(A) @ T)
        return sp.csr_matrix((product + product.T) / 2)

    totals = {name: structure.resultant([name]) for name in structure.loads}
    return replace(
        structure,
        M=congruent(structure.M),
        K=congruent(structure.K),
        C=None if structure.C is None else congruent(structure.C),
        pairs={name: replace(pairs, B=_units(places[name], T)) for name, pairs in structure.pairs.items()},
        loads={name: T.T @ load for name, load in structure.loads.items()},
        resultants={name: total for name, total in totals.items() if total is not None},
        expansion=T,
    )


def _places(structure: Structure) -> Iterator[tuple[str, IntArray]]:
    """Dofs that give their places to the rows of each contact."""
    shared = np.zeros(structure.n_dof, dtype=int)
    for _, B in _pairs(structure):
        shared[np.unique(B.indices)] += 1
    shared[list(structure.dofs.values())] += 2  # what is observed stays as it is
    found: dict[str, list[int]] = {name: [] for name in structure.pairs}
    for name, B in _pairs(structure):
        own = np.unique(B.indices)
        number = len(found[name]) // structure.pairs[name].components
        found[name] += _pivots(B, own[shared[own] == 1], f"contact '{name}', pair {number}")
    for name, dofs in found.items():
        yield name, np.array(dofs, dtype=np.int64)


def _pairs(structure: Structure) -> Iterator[tuple[str, sp.csr_matrix]]:
    """Rows of B, pair by pair."""
    for name, pairs in structure.pairs.items():
        B = real_csr(pairs.B)
        B.eliminate_zeros()
        for first in range(0, B.shape[0], pairs.components):
            yield name, B[first : first + pairs.components]


def _pivots(B: sp.csr_matrix, dofs: IntArray, where: str) -> list[int]:
    """As many of the dofs as B has rows, on which it is regular."""
    count = B.shape[0]
    if len(dofs) >= count:
        R, order = scipy.linalg.qr(B[:, dofs].toarray(), mode="r", pivoting=True)
        if abs(R[count - 1, count - 1]) > REGULAR * abs(R[0, 0]):
            return [int(dof) for dof in dofs[order[:count]]]
    fix = "leave the pairs as they are, or take a finer mesh under them"
    raise InputError("a pair has not as many dofs of its own as it has rows", where, None, f"{count}", fix)


def _transformation(structure: Structure, places: dict[str, IntArray]) -> sp.csr_matrix:
    """T (n_dof, n_dof)."""
    n, pivots = structure.n_dof, np.concatenate(list(places.values()))
    rest = np.setdiff1d(np.arange(n), pivots)
    parts = [sp.coo_matrix((np.ones(len(rest)), (rest, rest)), shape=(n, n))]
    done = dict.fromkeys(places, 0)
    for name, B in _pairs(structure):
        own = places[name][done[name] : done[name] + B.shape[0]]
        done[name] += B.shape[0]
        others = np.setdiff1d(B.indices, own)
        inverse = np.linalg.inv(B[:, own].toarray())
        rows: Array = np.hstack([inverse, -inverse @ B[:, others].toarray()])
        columns = np.concatenate([own, others])
        at = np.repeat(own, len(columns)), np.tile(columns, len(own))
        parts.append(sp.coo_matrix((rows.ravel(), at), shape=(n, n)))
    return sp.csr_matrix(sum(parts[1:], parts[0].tocsr()))


def _units(places: IntArray, T: sp.csr_matrix) -> sp.csr_matrix:
    """Rows that take one coordinate each."""
    count = len(places)
    return sp.csr_matrix((np.ones(count), (np.arange(count), places)), shape=(count, T.shape[1]))
