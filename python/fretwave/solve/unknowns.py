"""The unknowns of a branch's points, each rank's own part of them, as NumPy arrays: no Vec outlives its point."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Array
from ..errors import InputError
from ..given import real
from .hermite import between, derivatives, piece, slopes

if TYPE_CHECKING:
    from petsc4py import PETSc

    from ..hb.harmonic_problem import HarmonicProblem


class Unknowns:
    """Points y of a branch with their unit tangents, and the steps between them. Collective where it says so.

    Parameters
    ----------
    keep : bool
        All points; else the last one alone, which the next step is measured from.

    Attributes
    ----------
    problem : HarmonicProblem
        Of the last point; of all when closed.
    slopes : list
        Of each step, the factors that make its two tangents derivatives (`hermite.slopes`).
    """

    def __init__(self, problem: HarmonicProblem, keep: bool) -> None:
        self.problem, self.keep = problem, keep
        self.y: list[Array] = []
        self.tangents: list[Array] = []
        self.slopes: list[tuple[float, float] | None] = []
        self._of: list[HarmonicProblem] = []
        self._row = np.empty(0)
        self._weights = problem.core.unknowns()

    def add(self, y: PETSc.Vec, tangent: PETSc.Vec, problem: HarmonicProblem | None = None) -> None:
        """The next point, maybe on another set of harmonics than the one before. Collective."""
        problem = problem or self.problem
        y_here, t_here = y.getArray(readonly=True).copy(), tangent.getArray(readonly=True).copy()
        if self.y:
            before, row = (_embedded(values, self._of[-1], problem) for values in (self.y[-1], self._row))
            length, along = problem.model.comm.allreduce(np.array([row @ (y_here - before), row @ t_here]))
            self.slopes.append(slopes(float(length), float(along)))
        if problem is not self.problem:
            self._weights.destroy()
            self.problem, self._weights = problem, problem.core.unknowns()
        problem.core.metric(y, self._weights)
        self._row = self._weights.getArray(readonly=True) * t_here
        if not self.keep:
            self.y, self.tangents, self._of, self.slopes = [], [], [], self.slopes[-1:]
        self.y.append(y_here)
        self.tangents.append(t_here)
        self._of.append(problem)

    def close(self, problem: HarmonicProblem | None = None) -> None:
        """No more points: all are unknowns of this problem from now on, which has the most harmonics. Collective."""
        self._weights.destroy()
        self.problem = problem or self.problem
        if self.keep:
            self.y, self.tangents = (
                [_embedded(values, one, self.problem) for values, one in zip(kept, self._of)]
                for kept in (self.y, self.tangents)
            )
        self._of = []

    def vector(self, place: float) -> PETSc.Vec:
        """Unknowns at a place. Collective."""
        given = real(place, in_array=True)
        if given is None or not 0 <= given <= len(self.y) - 1:
            expected, fix = f"0 to {len(self.y) - 1}", "take a row's number, or a place that `at` gives"
            raise InputError("the branch has no such place", None, repr(place), expected, fix)
        i, x = piece(given, len(self.y))
        values = self.y[i]
        if x > 0:
            y0, t0, y1, t1 = self.y[i], self.tangents[i], self.y[i + 1], self.tangents[i + 1]
            begin, end = derivatives(self.slopes[i], y0, t0, y1, t1)
            values = between(x, y0, begin, y1, end)
        vector = self.problem.core.unknowns()
        vector.setArray(values)
        return vector


def _embedded(values: Array, one: HarmonicProblem, other: HarmonicProblem) -> Array:
    """This rank's part of a vector of one problem, as that of another one. Collective."""
    if one is other:
        return values
    v = one.core.unknowns()
    v.setArray(values)
    w = one.embedded(other, v)
    found: Array = w.getArray(readonly=True).copy()
    v.destroy()
    w.destroy()
    return found
