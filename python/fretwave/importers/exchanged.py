"""Mass and stiffness that were exchanged, or are of two models.

Whatever the units of length and mass, K over M is 1 / time^2, with seconds in all known systems. Its mean over the dofs
is about the square of the speed of sound over an element's length: above 1e3 1/s^2 for metres of rubber. Elements put
mass and stiffness between the same nodes; further mass (a fluid's) or stiffness (springs) adds on one side.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from ..arrays import IntArray
from ..errors import InputError
from .entries import Assembled

#: Mean K / M [1/s^2] that no mesh has: that of exchanged matrices is the inverse of a large number.
LEAST_RATIO = 1e-4
#: Share of the pairs of nodes that M joins and K does not, and the other way, from which these are two models.
STRANGE = 0.05
#: The same of single dofs, where nodes are not known, from which it is a warning: meshes along the axes have zeros in K
#: where M has none, tetrahedra in nearly half of the places.
STRANGE_DOFS = 0.2


def check_one_model(found: Assembled, where: str) -> None:
    """M is the mass and K the stiffness of one model; where nodes are not known doubts are among the warnings.

    Raises
    ------
    InputError
        They seem exchanged, or of two models.
    """
    M, K = found.matrices["M"], found.matrices["K"]
    mass, stiffness = float(M.diagonal().sum()), float(K.diagonal().sum())
    if mass > 0 and 0 < stiffness < LEAST_RATIO * mass:
        measured = f"trace K / trace M = {stiffness / mass:.3g}"
        expected, fix = f"above {LEAST_RATIO:g} 1/s^2", "exchange --mass and --stiffness"
        raise InputError("mass and stiffness seem exchanged", where, measured, expected, fix)
    joined, strange = [_joined(A, found.labels) for A in (M, K)], STRANGE if found.labels is not None else STRANGE_DOFS
    alone = [_alone(joined[k], joined[1 - k]) for k in (0, 1)]
    if min(alone) <= strange:
        return
    what = "nodes" if found.labels is not None else "dofs"
    measured = f"{alone[0]:.0%} of the {what} that M joins are apart in K, {alone[1]:.0%} of K's in M"
    if found.labels is None:
        found.warnings.append(f"{where} may be of two models ({measured}): give --dofs FILE, which tells it by nodes")
        return
    fix = "export both from one step of one model"
    raise InputError("mass and stiffness are of two models", where, measured, f"at most {strange:.0%} of M's", fix)


def _joined(A: sp.csr_matrix, labels: IntArray | None) -> sp.csr_matrix:
    """Which nodes, or dofs where those are not known, a matrix joins."""
    place = np.arange(A.shape[0]) if labels is None else np.unique(labels[:, 0], return_inverse=True)[1]
    P = sp.csr_matrix((np.ones(len(place)), (np.arange(len(place)), place.ravel())))
    found = (P.T @ abs(A).sign() @ P).sign().tocsr()
    beside = found - sp.diags(found.diagonal())
    beside.eliminate_zeros()
    return beside.tocsr()


def _alone(one: sp.csr_matrix, other: sp.csr_matrix) -> float:
    """Share of one's entries where the other has none."""
    return 1.0 - one.multiply(other).nnz / one.nnz if one.nnz else 0.0
