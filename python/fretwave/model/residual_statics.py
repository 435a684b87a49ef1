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
from ..errors import PetscError


def held_displacement(K: PETSc.Mat, keep: npt.NDArray[np.intp], forces: Array) -> Array:
    """K_ii^-1 f_i with the kept dofs held, zero at these, with one factorisation for all columns. Collective.

    Parameters
    ----------
    K : (n_dof, n_dof), symmetric
    keep : dofs that are held
    forces : (n_local, n), rows of this rank [force]

    Returns
    -------
    (n_local, n) [length]

    Raises
    ------
    PetscError
        K_ii could not be factorised.
    """
    begin, end = K.getOwnershipRange()
    inside = np.setdiff1d(np.arange(begin, end), keep)
    found, loads = np.zeros_like(forces), forces[inside - begin]
    loaded = np.flatnonzero(K.getComm().tompi4py().allreduce(np.abs(loads).sum(axis=0)))  # others move nothing
    if len(loaded):
        where = PETSc.IS().createGeneral(inside.astype(PETSc.IntType), comm=K.getComm())
        K_ii = K.createSubMatrix(where, where)
        found[np.ix_(inside - begin, loaded)] = _solved(K_ii, loads[:, loaded])
        for thing in (K_ii, where):
            thing.destroy()
    return found


def _solved(A: PETSc.Mat, b: Array) -> Array:
    """A^-1 b (n_local, n) of a symmetric matrix, by MUMPS. Collective."""
    A.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    ksp, (x, y) = PETSc.KSP().create(A.getComm()), A.createVecs()
    ksp.setType("preonly")
    ksp.getPC().setType("cholesky")
    ksp.getPC().setFactorSolverType("mumps")
    ksp.setOptionsPrefix("component_")  # of the reduction's own factorisation
    ksp.setOperators(A)
    ksp.setFromOptions()
    found = np.zeros_like(b)
    for column in range(b.shape[1]):
        y.setArray(np.ascontiguousarray(b[:, column]))
        ksp.solve(y, x)
        _check(ksp)
        found[:, column] = x.getArray(readonly=True)
    for thing in (ksp, x, y):
        thing.destroy()
    return found


def _check(ksp: PETSc.KSP) -> None:
    """PETSc goes on where a factorisation failed, with numbers that are none."""
    if ksp.getConvergedReason() < 0:
        info = ksp.getPC().getFactorMatrix().getMumpsInfog(1)
        what = "the displacement under the static loads with the kept dofs held cannot be solved for"
        fix = "keep dofs that stop every rigid motion, or run it where there is more memory"
        raise PetscError(what, None, f"MUMPS INFOG(1) = {info}", "0", fix)
