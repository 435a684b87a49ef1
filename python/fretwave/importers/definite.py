"""Mass that is negative for a motion, and stiffness that is negative at a dof: matrices of no structure."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import ArpackNoConvergence, eigsh

from ..errors import InputError
from ..model.checks import DENSE_LIMIT, NAMES, smallest_eigenvalue
from ..model.sectors import Sparse
from ..model.structure import Structure

#: Eigenvalues of the diagonally scaled mass below zero by less, over the largest, are the digits of its file.
DIGITS = 1e-6
#: Steps of Lanczos: the scaled mass of elements has eigenvalues within two decades.
STEPS = 300


def check_definite(model: Structure, where: str) -> None:
    """No motion has a negative mass, no dof a negative stiffness; K may be negative for a motion (buckled, spinning).

    Raises
    ------
    InputError
    """
    for letter in "MK":
        diagonal = getattr(model, letter).diagonal()
        worst = int(np.argmin(diagonal))
        if diagonal[worst] < 0:
            measured = f"{diagonal[worst]:.4g} at {model.dof_names[worst]}, {int((diagonal < 0).sum())} such dofs"
            what, fix = f"the {NAMES[letter]} has a negative diagonal entry", "correct the sign, or what wrote the file"
            raise InputError(what, where, measured, "0 or more at every dof", fix)
    lowest = _lowest(model.M)
    if lowest < -DIGITS:
        measured, fix = f"smallest eigenvalue {lowest:.3g} of the largest", "export it again; are its rows those of K?"
        raise InputError("the mass matrix is negative for a motion", where, measured, "0 or more", fix)


def _lowest(M: Sparse) -> float:
    """Of the scaled eigenvalues, over the largest; of a large matrix an upper bound (Ritz), so that none is made up."""
    if M.shape[0] <= DENSE_LIMIT:
        return smallest_eigenvalue(M)[0]
    diagonal = np.asarray(M.diagonal())
    scale = sp.diags(1 / np.sqrt(np.where(diagonal == 0, 1.0, diagonal)))
    start = np.random.default_rng(1).normal(size=len(diagonal))
    try:
        low, high = (eigsh(scale @ M @ scale, 1, which=end, v0=start, tol=1e-2, maxiter=STEPS) for end in ("SA", "LA"))
        return float(low[0][0] / high[0][0])
    except ArpackNoConvergence:
        return 0.0
