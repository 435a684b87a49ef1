"""What the component modes that a reduction has left out add to the equations of a point."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from petsc4py import PETSc

from ..arrays import Complex

if TYPE_CHECKING:
    from .harmonic_problem import HarmonicProblem


def harmonic_factors(
    problem: HarmonicProblem, y: PETSc.Vec
) -> Iterator[tuple[int, int, tuple[complex, complex, complex]]]:
    """First column, order and factors of K, C, M in Z_n."""
    damping, column = problem.inertia_damping(y), 0
    for order, s in zip(problem.harmonics.orders, problem.core.exponents(y)):
        yield column, order, (1.0, s, s * s - damping * s)
        column += 2 if order else 1


def omitted_residual(problem: HarmonicProblem, y: PETSc.Vec) -> PETSc.Vec | None:
    """r of y in the equations with these modes, less the problem's own; None where nothing is left out. Collective.

    To first order they move as the motion at y drives them, which adds f_n (`OmittedModes`) to Z_n q_n. The mean does
    not drive them.
    """
    omitted = problem.model.omitted
    if omitted is None or not len(omitted.omega):
        return None
    Q = problem.model.comm.bcast(problem.coefficients(y))
    rows = np.zeros_like(Q)
    for column, order, (_, s, inertia) in harmonic_factors(problem, y):
        if order:
            x: Complex = Q[:, column] - 1j * Q[:, column + 1]
            f = omitted.forces(s, inertia, x, order * problem.model.core.theta)
            rows[:, column], rows[:, column + 1] = f.real, -f.imag
    r = problem.core.equations()
    r.set(0.0)
    begin, end = r.getOwnershipRange()
    last = min(end, rows.size)
    scale = problem.core.stiffness_scale * problem.amplitude_scale(y)
    if begin < last:
        r.setValues(np.arange(begin, last, dtype=PETSc.IntType), rows.ravel()[begin:last] / scale)
    r.assemble()
    return r
