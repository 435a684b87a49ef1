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


def check_unjoined(model: Structure, where: str) -> None:
    """K joins no two nodes of a pair that M leaves apart; elements and reductions join them in both.

    Raises
    ------
    InputError
        It does.
    """
    for name, pairs in model.pairs.items():
        if pairs.nodes is not None and model.labels is not None:
            _check(name, pairs, model, where)


def _check(name: str, pairs: Pairs, model: Structure, where: str) -> None:
    assert pairs.nodes is not None and model.labels is not None
    nodes, node = np.asarray(pairs.nodes), model.labels[:, 0]
    B = abs(sp.csr_matrix(by_sector(pairs.B)[0]))
    reached = (sp.kron(sp.identity(len(nodes)), np.ones((1, pairs.components))) @ B).sign().tocsr()
    ends = reached.tocoo()
    mine = node[ends.col] == nodes[ends.row, 0]
    first, second = (
        sp.csr_matrix((np.ones(side.sum()), (ends.row[side], ends.col[side])), reached.shape) for side in (mine, ~mine)
    )
    strength = np.where(_between(first, second, model.M) > 0, 0.0, _between(first, second, model.K))
    joined, worst = int((strength > STIFF).sum()), int(np.argmax(strength))
    if joined:
        a, b = nodes[worst]
        measured = f"K joins both sides of {joined} of {len(nodes)} pairs, M does not; nodes {a} and {b} by"
        fix = "export again without contact between these sides (*CONTACT PAIR, contact elements, springs)"
        raise InputError(
            f"the stiffness holds the contact '{name}' already",
            where,
            f"{measured} {strength[worst]:.2g} of their own stiffness",
            "two bodies that nothing joins there",
            fix,
        )


def _between(first: sp.csr_matrix, second: sp.csr_matrix, A: Sparse) -> Array:
    """Largest |A_ij| / sqrt(A_ii A_jj) of each pair, i a dof (n_pairs, n_dof) of its first side, j of its second."""
    diagonal = np.asarray(A.diagonal())
    scale = sp.diags(1 / np.sqrt(np.where(diagonal > 0, diagonal, np.inf)))
    found = (first @ abs(scale @ sp.csr_matrix(A) @ scale)).multiply(second)
    return np.asarray(sp.csr_matrix(found).max(axis=1).toarray()).ravel()
