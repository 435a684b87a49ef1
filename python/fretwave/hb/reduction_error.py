"""Error of a reduced nonlinear mode against the unreduced model, without solving the unreduced model."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from .. import _core
from ..arrays import Array, Complex
from ..errors import InputError, NotConverged
from ..kinds import of_their_kinds
from ..model.reduction import Reduction
from ..model.sectors import Sparse
from .nonlinear_mode import NonlinearMode
from .omitted import harmonic_factors

if TYPE_CHECKING:
    from mpi4py import MPI


#: Left of the interior residual when its correction is taken as solved, and the rounds given to it.
TOLERANCE, MOST_ROUNDS = 1e-4, 30
#: Times the entries of a matrix, from which it is not put on another's pattern: the memory would grow as much.
FULLER = 3


@dataclass(frozen=True)
class NonlinearError:
    """What the unreduced model would change at one point, at the same amplitude, to first order.

    Attributes
    ----------
    omega, beta : float [1/s]
    zeta : float
    residual : float
        2-norm of the unreduced equations' residual over that of the elastic forces of the motion.
    wall_s : float [s]
    """

    omega: float
    beta: float
    zeta: float
    residual: float
    wall_s: float


@of_their_kinds
def nonlinear_error(
    reduction: Reduction,
    problem: NonlinearMode,
    y: PETSc.Vec,
    load: npt.ArrayLike | None = None,
    C: Sparse | None = None,
) -> NonlinearError:
    """Estimated error of a reduced nonlinear mode at a converged point y. Collective.

    Contact acts on kept dofs, so the expanded motion T Q leaves a residual r_n on the internal dofs alone, linear in
    each harmonic. With the correction w_n = -Z_ii(s_n)^-1 r_n of the internal dofs, one Newton step of the unreduced
    equations, less the feedback of the step's reduced part on w, is

        J_r dy = -T^T Z w,

    J_r the reduced problem's bordered Jacobian, the amplitude fixed. Its scalars are the change of beta and omega.

    Parameters
    ----------
    problem : NonlinearMode
        Of a model with the reduction's matrices; its dofs are the reduced coordinates.
    load : (n_dof,), optional
        Static load on the unreduced model, where it reaches internal dofs (contact loads do not).
    C : (n_dof, n_dof), optional
        Damping of the unreduced model, in place of the reduction's.

    Raises
    ------
    NotConverged
        A harmonic lies on a resonance of the internal dofs.
    """
    began = time.perf_counter()
    if problem.model.n_dof != reduction.size:
        raise InputError(
            "the problem is not on the reduced coordinates",
            None,
            f"{problem.model.n_dof} dofs",
            f"{reduction.size}",
            "build the problem's model from the reduction's M, K, C",
        )
    full = reduction._model
    comm, Q = full.comm, problem.model.comm.bcast(problem.coefficients(y))
    X = full.distribute(reduction.expand(Q))
    P = np.zeros(full.n_dof) if load is None else np.asarray(load, dtype=float)
    interior = _Interior(reduction, C)
    step, residual, forces = np.zeros_like(Q), 0.0, 0.0
    try:
        for column, order, factors in harmonic_factors(problem, y):
            x: Complex = X[:, column] - 1j * (X[:, column + 1] if order else np.zeros(len(X)))
            r = interior.restrict(interior.product(factors, x) - (0 if order else full.distribute(P)))
            z = interior.product(factors, interior.correction(factors, r, order))
            residual += _square(comm, r)
            forces += _square(comm, interior.product((1.0, 0.0, 0.0), x))
            rows = reduction._core.project(np.ascontiguousarray(np.column_stack([z.real, -z.imag])))
            step[:, column : column + (2 if order else 1)] = rows[:, : (2 if order else 1)]
    finally:
        interior.destroy()
    change = _reduced_step(problem, y, step)
    return NonlinearError(**change, residual=float(np.sqrt(residual / forces)), wall_s=time.perf_counter() - began)


def _square(comm: MPI.Comm, v: Complex) -> float:
    return float(comm.allreduce(np.vdot(v, v).real))


def _reduced_step(problem: NonlinearMode, y: PETSc.Vec, rows: Array) -> dict[str, float]:
    """Change of the state by J_r dy = -rows, at the same amplitude. Collective."""
    before = problem.state(y)
    newton = _core.Newton(problem.core, problem.prefix, past_kinks=False)
    row, right, change = y.duplicate(), y.duplicate(), y.duplicate()
    begin, end = y.getOwnershipRange()
    for vector in (row, right, change):
        vector.set(0.0)
    if end == y.getSize():
        row.setValue(end - 1, 1.0)  # the amplitude
    row.assemble()
    last = min(end, rows.size)
    if begin < last:
        scale = problem.core.stiffness_scale * before["amplitude"]
        right.setValues(np.arange(begin, last, dtype=PETSc.IntType), -rows.ravel()[begin:last] / scale)
    right.assemble()
    newton.system.close(row, 0.0)
    if not newton.linear(y, right, change):
        raise NotConverged("the linear system of the reduction's error is not solved")
    change.axpy(1.0, y)
    after = problem.state(change)
    for vector in (row, right, change):
        vector.destroy()
    return {key: after[key] - before[key] for key in ("omega", "beta", "zeta")}


class _Interior:
    """The unreduced matrices, and Z_n on the internal dofs, for complex rows of this rank."""

    def __init__(self, reduction: Reduction, C: Sparse | None = None) -> None:
        K, *damping, M = reduction._model._matrices
        self.owned = [] if C is None else [reduction._model._matrix(C, "C")]
        self.terms = dict(zip((0, 2, 1), (K, M, *(self.owned or damping))))
        self.begin, end = K.getOwnershipRange()
        self.inside = np.setdiff1d(np.arange(self.begin, end), reduction.keep).astype(PETSc.IntType)
        self.x, self.y = K.createVecs()
        self.comm = reduction._model.comm
        where = PETSc.IS().createGeneral(self.inside, comm=K.getComm())
        blocks = {order: A.createSubMatrix(where, where) for order, A in self.terms.items()}
        where.destroy()
        Z = _sum(blocks)
        self.blocks = {order: _on_pattern(Z, A) for order, A in blocks.items()}
        self.solver = _Solver(Z)

    def restrict(self, v: Complex) -> Complex:
        """Internal rows alone, zero elsewhere."""
        out = np.zeros_like(v)
        out[self.inside - self.begin] = v[self.inside - self.begin]
        return out

    def product(self, factors: tuple[complex, complex, complex], v: Complex) -> Complex:
        out = np.zeros(len(v), dtype=complex)
        for order, A in self.terms.items():
            if factors[order] == 0:
                continue
            for unit, part in ((1, np.real(v)), (1j, np.imag(v))):
                self.x.setArray(np.ascontiguousarray(part))
                A.mult(self.x, self.y)
                out += factors[order] * unit * self.y.getArray(readonly=True)
        return out

    def correction(self, factors: tuple[complex, complex, complex], r: Complex, order: int) -> Complex:
        """w = -Z_ii^-1 r: by the factors of Re Z_ii, the small rest (damping) by iteration."""
        w, left, size = np.zeros_like(r, dtype=complex), r.astype(complex), _square(self.comm, r)
        if size == 0:
            return w
        self.solver.factorise({k: float(np.real(factors[k])) for k in self.blocks}, self.blocks)
        for _ in range(MOST_ROUNDS):
            for unit, part in ((1, left.real), (1j, left.imag)):
                w[self.inside - self.begin] -= unit * self.solver(part[self.inside - self.begin])
            left = r + self.restrict(self.product(factors, w))
            if _square(self.comm, left) <= TOLERANCE**2 * size:
                return w
        raise NotConverged(
            "the reduction's error cannot be estimated",
            f"harmonic {order}",
            f"residual {np.sqrt(_square(self.comm, left) / size):.1g} after {MOST_ROUNDS} rounds",
            f"{TOLERANCE:.0e}",
            "keep more component modes: this harmonic excites a resonance of the internal dofs",
        )

    def destroy(self) -> None:
        self.solver.destroy()
        for thing in (*(block for block, _ in self.blocks.values()), *self.owned, self.x, self.y):
            thing.destroy()


#: A matrix and how its entries lie to those of another (PETSc's `Mat.Structure`), to which it is added.
Block = tuple[PETSc.Mat, PETSc.Mat.Structure]


def _sum(matrices: dict[int, PETSc.Mat]) -> PETSc.Mat:
    """With the entries of all. Collective."""
    first, *others = matrices.values()
    total = first.copy()
    for A in others:
        total.axpy(1.0, A)
    return total


def _on_pattern(Z: PETSc.Mat, A: PETSc.Mat) -> Block:
    """A, which is taken over, with zeros where Z has entries: PETSc adds it at once then. Collective.

    Beside much fuller ones, such as damping by mode, it stays as it is.
    """
    if (
        FULLER * A.getInfo(PETSc.Mat.InfoType.GLOBAL_SUM)["nz_used"]
        < Z.getInfo(PETSc.Mat.InfoType.GLOBAL_SUM)["nz_used"]
    ):
        return A, PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN
    out = Z.copy()
    out.zeroEntries()
    out.axpy(1.0, A, PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
    A.destroy()
    return out, PETSc.Mat.Structure.SAME_NONZERO_PATTERN


class _Solver:
    """L D L^T of real symmetric matrices on the internal dofs, one after the other, all of Z's pattern."""

    def __init__(self, Z: PETSc.Mat) -> None:
        Z.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        self.Z = Z
        self.ksp = PETSc.KSP().create(Z.getComm())
        self.ksp.setType("preonly")
        pc = self.ksp.getPC()
        pc.setType("cholesky")
        pc.setFactorSolverType("mumps")
        self.x, self.b = Z.createVecs()

    def factorise(self, factors: dict[int, float], terms: dict[int, Block]) -> None:
        """The sum of the terms. Collective."""
        self.Z.zeroEntries()
        for order, (A, structure) in terms.items():
            self.Z.axpy(factors[order], A, structure)
        self.ksp.setOperators(self.Z)
        self.ksp.setUp()

    def __call__(self, rows: Array) -> Array:
        """This rank's internal rows."""
        self.b.setArray(rows)
        self.ksp.solve(self.b, self.x)
        solution: Array = self.x.getArray(readonly=True).copy()
        return solution

    def destroy(self) -> None:
        for thing in (self.ksp, self.Z, self.x, self.b):
            thing.destroy()
