"""Error of a reduced sector's nonlinear wave against the unreduced sector: `reduction_error` with the wave's phases.

On the dofs of the tied sector harmonic n of the expanded wave is x_n = S_n q_n, S_n = T (sum_k e^{-i k n theta} T_k)
with the reduction's T on both faces. Contact acts on dofs that are coordinates of their own, so that the residual r_n
of the unreduced equations is linear on all others, i: inner dofs, and those of the face where it moves in interface
modes. With w_n = -Z_ii(s_n)^-1 r_n on them, J_r dy = -S^H Z w (`fretwave.hb.reduction_error`).
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

import numpy as np
import scipy.sparse as sp
from petsc4py import PETSc

from ..arrays import Array, Complex
from ..hb.nonlinear_mode import NonlinearMode
from ..hb.omitted import harmonic_factors
from ..hb.reduction_error import NonlinearError, _reduced_step
from .reduction import SectorReduction

Terms = Mapping[int, Any]


def sector_nonlinear_error(
    reduction: SectorReduction,
    terms: tuple[Terms, Terms, Terms],
    problem: NonlinearMode,
    y: PETSc.Vec,
    load: Array | None = None,
) -> NonlinearError:
    """Estimated error of a nonlinear wave of the reduced sector at a converged point y. Collective.

    Ranks take harmonics in turn.

    Parameters
    ----------
    terms : K, C, M of the unreduced, tied sector, {k: (n_dof, n_dof)} each
    problem : NonlinearMode
        Of the reduced sector.
    load : (n_dof,), optional
        Static load on the tied sector.
    """
    began, comm = time.perf_counter(), problem.model.comm
    wave = _Wave(reduction, problem.model.nodal_diameter)
    Q = comm.bcast(problem.coefficients(y))
    harmonics = list(harmonic_factors(problem, y))
    X = wave.expand(Q, harmonics)
    forces, sizes = np.zeros((len(X), len(harmonics)), dtype=complex), np.zeros(2)
    for place, (_, order, factors) in list(enumerate(harmonics))[comm.rank :: comm.size]:
        x = X[:, place]
        Z = wave.stiffness(terms, factors, order)
        r = Z @ x - (load if load is not None and order == 0 else 0.0)
        r[wave.kept] = 0.0
        w = np.zeros_like(r)
        w[wave.others] = -_solve(Z[wave.others][:, wave.others], r[wave.others])
        forces[:, place] = Z @ w
        elastic = wave.stiffness(terms, (1.0, 0.0, 0.0), order) @ x
        sizes += [np.vdot(r, r).real, np.vdot(elastic, elastic).real]
    step = wave.project(comm.allreduce(forces), harmonics, Q.shape)
    residual, elastic_size = comm.allreduce(sizes)
    change = _reduced_step(problem, y, step)
    wall = time.perf_counter() - began
    return NonlinearError(**change, residual=float(np.sqrt(residual / elastic_size)), wall_s=wall)


class _Wave:
    """Motions of the tied sector from those of the reduced one, harmonic by harmonic.

    Attributes
    ----------
    kept, others : dofs of the tied sector that are coordinates of their own, and all others
    """

    def __init__(self, reduction: SectorReduction, nodal_diameter: int) -> None:
        full = reduction.unreduced
        self.reduction, self.ties = reduction, reduction.sector().ties
        self.theta = 2 * np.pi * nodal_diameter / reduction.sectors
        own = sp.csr_matrix(full.ties[0])
        self.rows = np.nonzero(np.diff(own.indptr))[0]  # dofs of the uncut sector that the tied one has, in order
        self.kept = np.nonzero(np.isin(self.rows, list(reduction.places)))[0]
        self.others = np.setdiff1d(np.arange(len(self.rows)), self.kept)
        self.n_full = own.shape[0]

    def stiffness(self, terms: tuple[Terms, Terms, Terms], factors: tuple[complex, ...], order: int) -> sp.csr_matrix:
        """Z_n = sum_k e^{-i k n theta} (K_k + s C_k + (s^2 ..) M_k)."""
        total: Any = 0
        for factor, parts in zip(factors, terms):
            for k, A in parts.items() if factor else ():
                total = total + factor * np.exp(-1j * k * order * self.theta) * sp.csr_matrix(A)
        return sp.csr_matrix(total)

    def expand(self, Q: Array, harmonics: list[Any]) -> Complex:
        """(n_dof, n_harmonics) from coefficients (n_r, m). Collective."""
        columns = []
        for column, order, _ in harmonics:
            q = Q[:, column] - 1j * (Q[:, column + 1] if order else 0.0)
            columns.append(sum(np.exp(-1j * k * order * self.theta) * (T @ q) for k, T in self.ties.items()))
        both = np.column_stack(columns)
        X = self.reduction.expand(both.real) + 1j * self.reduction.expand(both.imag)
        return np.asarray(X[self.rows])

    def project(self, forces: Complex, harmonics: list[Any], shape: tuple[int, int]) -> Array:
        """S^H f as coefficients (n_r, m). Collective."""
        full = np.zeros((self.n_full, len(harmonics)), dtype=complex)
        full[self.rows] = forces
        both = self.reduction.project(full.real) + 1j * self.reduction.project(full.imag)
        out = np.zeros(shape)
        for place, (column, order, _) in enumerate(harmonics):
            turns = {k: np.exp(1j * k * order * self.theta) for k in self.ties}
            z: Any = sum(turns[k] * (T.T @ both[:, place]) for k, T in self.ties.items())
            out[:, column] = z.real
            if order:
                out[:, column + 1] = -z.imag
        return out


def _solve(Z: sp.csr_matrix, r: Complex) -> Complex:
    """By MUMPS, in real form [[re, -im], [im, re]]."""
    R = sp.csr_matrix(sp.bmat([[Z.real, -Z.imag], [Z.imag, Z.real]]))
    A = PETSc.Mat().createAIJ(R.shape, csr=(R.indptr, R.indices, R.data), comm=PETSc.COMM_SELF)
    A.assemble()
    ksp = PETSc.KSP().create(PETSc.COMM_SELF)
    ksp.setOperators(A)
    ksp.setType("preonly")
    ksp.getPC().setType("lu")
    ksp.getPC().setFactorSolverType("mumps")
    b, x = A.createVecs()
    b.setArray(np.concatenate([r.real, r.imag]))
    ksp.solve(b, x)
    found = x.getArray(readonly=True).copy()
    for thing in (ksp, A, b, x):
        thing.destroy()
    return np.asarray(found[: len(r)] + 1j * found[len(r) :])
