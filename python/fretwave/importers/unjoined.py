"""Whether the stiffness holds the contact already: matrices of a step in which the bodies touched, or are tied.

Codes linearise closed contact and add it to K (Dhondt, CalculiX CrunchiX User's Manual, *FREQUENCY with PERTURBATION;
SIMULIA, Abaqus Keywords Reference, *MATRIX GENERATE): a spring between the sides, which the pairs would add again.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from ..arrays import Array
from ..errors import InputError
from ..model.pairs import Pairs
from ..model.sectors import Sparse, by_sector
from ..model.structure import Structure

#: K between the nodes of a pair, over their own stiffness, that is no weak spring of a static step.
STIFF = 1e-4
#: Share of the pairs that closed contact joins at least; single ones may be bolts or springs.
MOST = 0.5


def check_unjoined(model: Structure, where: str) -> list[str]:
    """K joins no two nodes of a pair that M leaves apart; elements and reductions join them in both.

    A warning where few pairs are joined, or other nodes across the sides too, as a reduction does, or where M is
    lumped, which leaves all nodes apart.

    Raises
    ------
    InputError
        It joins most pairs, and these alone.
    """
    known = {name: pairs for name, pairs in model.pairs.items() if pairs.nodes is not None and model.labels is not None}
    return [said for name, pairs in known.items() if (said := _check(name, pairs, model, where))]


def _check(name: str, pairs: Pairs, model: Structure, where: str) -> str:
    nodes = np.asarray(pairs.nodes)
    first, second = _sides(pairs, model)
    in_M, in_K = (_scaled(A, first) for A in (model.M, model.K))
    strength = np.where(_between(first, second, in_M) > 0, 0.0, _between(first, second, in_K))
    joined, worst = int((strength > STIFF).sum()), int(np.argmax(strength))
    if not joined:
        return ""
    a, b = nodes[worst]
    measured = f"K joins both sides of {joined} of {len(nodes)} pairs, M does not; nodes {a} and {b} by"
    measured += f" {strength[worst]:.2g} of their own stiffness"
    if joined < MOST * len(nodes) or not _joins_nodes(in_M, model) or _joins_others(first, second, in_K):
        return f"contact '{name}': {measured}: does the stiffness hold the contact already?"
    what, expected = f"the stiffness holds the contact '{name}' already", "two bodies that nothing joins there"
    fix = "export again without contact between these sides (*CONTACT PAIR, contact elements, springs)"
    raise InputError(what, where, measured, expected, fix)


def _sides(pairs: Pairs, model: Structure) -> tuple[sp.csr_matrix, sp.csr_matrix]:
    """Dofs that each pair reaches on its first and on its second side (n_pairs, n_dof)."""
    assert pairs.nodes is not None and model.labels is not None
    nodes, node = np.asarray(pairs.nodes), model.labels[:, 0]
    B = abs(sp.csr_matrix(by_sector(pairs.B)[0]))
    reached = (sp.kron(sp.identity(len(nodes)), np.ones((1, pairs.components))) @ B).sign().tocsr()
    ends = reached.tocoo()
    mine = node[ends.col] == nodes[ends.row, 0]
    first, second = (
        sp.csr_matrix((np.ones(side.sum()), (ends.row[side], ends.col[side])), reached.shape) for side in (mine, ~mine)
    )
    return first, second


def _scaled(A: Sparse, first: sp.csr_matrix) -> sp.csr_matrix:
    """|A_ij| / sqrt(A_ii A_jj) in the rows i that the first sides reach, others empty."""
    diagonal = np.asarray(A.diagonal())
    scale = 1 / np.sqrt(np.where(diagonal > 0, diagonal, np.inf))
    rows = np.unique(first.indices)
    part = abs(sp.csr_matrix(A)[rows] @ sp.diags(scale)).tocoo()
    return sp.csr_matrix((part.data * scale[rows][part.row], (rows[part.row], part.col)), A.shape)


def _between(first: sp.csr_matrix, second: sp.csr_matrix, scaled: sp.csr_matrix) -> Array:
    """Largest scaled entry of each pair, its row on the first side, its column on the second."""
    found = (first @ scaled).multiply(second)
    return np.asarray(sp.csr_matrix(found).max(axis=1).toarray()).ravel()


def _joins_nodes(scaled: sp.csr_matrix, model: Structure) -> bool:
    assert model.labels is not None
    found, node = scaled.tocoo(), model.labels[:, 0]
    return bool(((node[found.row] != node[found.col]) & (found.data > 0)).any())


def _joins_others(first: sp.csr_matrix, second: sp.csr_matrix, scaled: sp.csr_matrix) -> bool:
    """A dof of a first side to one of a second side that no pair of its own reaches."""
    lower = np.setdiff1d(second.indices, first.indices)
    across = sp.csr_matrix(scaled[:, lower] > STIFF)
    partners = (first.T @ second[:, lower]).sign()
    return bool((across - across.multiply(partners)).count_nonzero())
