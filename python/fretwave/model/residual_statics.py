"""The static displacement of a component that its component modes do not have.

Loads on internal dofs are carried to the kept ones as they are, but between them the lowest component modes alone
bend: left is (K_ii^-1 - Phi omega^-2 Phi^T) f_i, the residual flexibility (S. Rubin, Improved component-mode
representation for structural dynamic analysis, AIAA J. 13(8), 1975), which moves no kept dof and works with no mode.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from ..arrays import Array


def held_displacement(K: PETSc.Mat, keep: npt.NDArray[np.intp], forces: Array) -> Array:
    """K_ii^-1 f_i with the kept dofs held, zero at these. Collective.

    Parameters
    ----------
    K : (n_dof, n_dof), symmetric
    keep : dofs that are held
    forces : (n_local, n), rows of this rank [force]

    Returns
    -------
    (n_local, n) [length]
    """
    begin, end = K.getOwnershipRange()
    inside = np.setdiff1d(np.arange(begin, end), keep)
    where = PETSc.IS().createGeneral(inside.astype(PETSc.IntType), comm=K.getComm())
    K_ii = K.createSubMatrix(where, where)
    K_ii.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    ksp, (x, b) = PETSc.KSP().create(K.getComm()), K_ii.createVecs()
    ksp.setType("preonly")
    ksp.getPC().setType("cholesky")
    ksp.getPC().setFactorSolverType("mumps")
    ksp.setOperators(K_ii)
    found = np.zeros_like(forces)
    for column in range(forces.shape[1]):
        b.setArray(np.ascontiguousarray(forces[inside - begin, column]))
        ksp.solve(b, x)
        found[inside - begin, column] = x.getArray(readonly=True)
    for thing in (ksp, x, b, K_ii, where):
        thing.destroy()
    return found
