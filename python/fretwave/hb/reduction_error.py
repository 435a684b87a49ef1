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
from ..model.reduction import Reduction
from .omitted import harmonic_factors
from .problems import NonlinearMode

if TYPE_CHECKING:
    from mpi4py import MPI


#: Left of the interior residual when its correction is taken as solved, and the rounds given to it.
TOLERANCE, MOST_ROUNDS = 1e-4, 30


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


def nonlinear_error(
    reduction: Reduction, problem: NonlinearMode, y: PETSc.Vec, load: npt.ArrayLike | None = None
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
    interior = _Interior(reduction)
    step, residual, forces = np.zeros_like(Q), 0.0, 0.0
    for column, order, factors in harmonic_factors(problem, y):
        x: Complex = X[:, column] - 1j * (X[:, column + 1] if order else np.zeros(len(X)))
        r = interior.restrict(interior.product(factors, x) - (0 if order else full.distribute(P)))
        z = interior.product(factors, interior.correction(factors, r, order))
        residual += _square(comm, r)
        forces += _square(comm, interior.product((1.0, 0.0, 0.0), x))
        rows = reduction._core.project(np.ascontiguousarray(np.column_stack([z.real, -z.imag])))
        step[:, column : column + (2 if order else 1)] = rows[:, : (2 if order else 1)]
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

    def __init__(self, reduction: Reduction) -> None:
        matrices = reduction._model._matrices
        self.terms = [(0, matrices[0]), (2, matrices[-1])] + ([(1, matrices[1])] if len(matrices) == 3 else [])
        self.begin, end = matrices[0].getOwnershipRange()
        self.inside = np.setdiff1d(np.arange(self.begin, end), reduction.keep).astype(PETSc.IntType)
        self.where = PETSc.IS().createGeneral(self.inside, comm=matrices[0].getComm())
        self.x, self.y = matrices[0].createVecs()
        self.comm = reduction._model.comm

    def restrict(self, v: Complex) -> Complex:
        """Internal rows alone, zero elsewhere."""
        out = np.zeros_like(v)
        out[self.inside - self.begin] = v[self.inside - self.begin]
        return out

    def product(self, factors: tuple[complex, complex, complex], v: Complex) -> Complex:
        out = np.zeros(len(v), dtype=complex)
        for order, A in self.terms:
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
        solver = self._factor(tuple(float(np.real(c)) for c in factors))
        for _ in range(MOST_ROUNDS):
            for unit, part in ((1, left.real), (1j, left.imag)):
                w[self.inside - self.begin] -= unit * solver(part[self.inside - self.begin])
            left = r + self.restrict(self.product(factors, w))
            if _square(self.comm, left) <= TOLERANCE**2 * size:
                solver.destroy()
                return w
        solver.destroy()
        raise NotConverged(
            "the reduction's error cannot be estimated",
            f"harmonic {order}",
            f"residual {np.sqrt(_square(self.comm, left) / size):.1g} after {MOST_ROUNDS} rounds",
            f"{TOLERANCE:.0e}",
            "keep more component modes: this harmonic excites a resonance of the internal dofs",
        )

    def _factor(self, factors: tuple[float, ...]) -> _Solver:
        Z = None
        for order, A in self.terms:
            part = A.createSubMatrix(self.where, self.where)
            part.scale(factors[order])
            if Z is None:
                Z = part
            else:
                Z.axpy(1.0, part)
                part.destroy()
        return _Solver(Z)

    def destroy(self) -> None:
        for thing in (self.where, self.x, self.y):
            thing.destroy()


class _Solver:
    """L D L^T of a real symmetric matrix on the internal dofs."""

    def __init__(self, Z: PETSc.Mat) -> None:
        Z.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        self.Z = Z
        self.ksp = PETSc.KSP().create(Z.getComm())
        self.ksp.setOperators(Z)
        self.ksp.setType("preonly")
        pc = self.ksp.getPC()
        pc.setType("cholesky")
        pc.setFactorSolverType("mumps")
        self.ksp.setUp()
        self.x, self.b = Z.createVecs()

    def __call__(self, rows: Array) -> Array:
        """This rank's internal rows."""
        self.b.setArray(rows)
        self.ksp.solve(self.b, self.x)
        solution: Array = self.x.getArray(readonly=True).copy()
        return solution

    def destroy(self) -> None:
        for thing in (self.ksp, self.Z, self.x, self.b):
            thing.destroy()
