"""The scalar unknowns of a branch with their derivatives, as its points are found: what its cubic is made of."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..arrays import Array
from .hermite import Cubic, derivatives
from .unknowns import Unknowns

if TYPE_CHECKING:
    from petsc4py import PETSc

    from ..hb.harmonic_problem import HarmonicProblem


class Knot(NamedTuple):
    """A point's scalars, and their derivatives by the share of the step that ends there, at its begin and its end.

    No step ends at the first point: nan.
    """

    scalars: Array
    begin: Array
    end: Array


class Trace:
    """Knots of a branch, one after the other. Collective where it says so.

    Parameters
    ----------
    unknowns : Unknowns, optional
        Which measures the steps, and may keep all points.
    """

    def __init__(self, problem: HarmonicProblem, unknowns: Unknowns | None = None) -> None:
        self.problem, self.unknowns = problem, unknowns or Unknowns(problem, False)
        self._last: tuple[Array, Array] | None = None

    def add(self, y: PETSc.Vec, tangent: PETSc.Vec, problem: HarmonicProblem | None = None) -> Knot:
        """The next point, with its unit tangent; of this problem where its harmonics are others. Collective."""
        problem = problem or self.problem
        self.unknowns.add(y, tangent, problem)
        z, dz = problem.scalars(y), problem.scalars(tangent)
        begin, end = np.full((2, len(z)), np.nan)
        if self._last is not None:
            begin, end = derivatives(self.unknowns.slopes[-1], *self._last, z, dz)
        self._last = z, dz
        return Knot(z, begin, end)

    def close(self, problem: HarmonicProblem | None = None) -> None:
        """No more points; kept ones are of this problem from now on. Collective."""
        self.unknowns.close(problem)


def cubic_of(knots: Sequence[Knot]) -> Cubic:
    """Through all knots of one branch."""
    if not knots:
        return Cubic(np.empty((0, 0)), np.empty((0, 0)), np.empty((0, 0)))
    z, begin, end = (np.array([knot[part] for knot in knots]) for part in range(3))
    return Cubic(z, begin[1:], end[1:])
