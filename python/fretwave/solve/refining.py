"""A branch on as many harmonics and samples as an accuracy asks for, point by point."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from petsc4py import PETSc

from .. import _core
from ..hb.harmonic_problem import HarmonicProblem
from ..hb.harmonics import Harmonics
from ..hb.states import Estimate
from ..mpi.destroyable import Owned
from .accuracy import MOST_SAMPLES, ROUNDS, TOLERATED, Aim, limiting, most_harmonics
from .continuation import Continuation
from .point import Point
from .steps import StepControl

#: Points so near to each other (relative, in the parameter) tell how two sets differ.
NEAR = 0.02
#: What a point has cost, also where it was refused.
SUMS = ("newton", "linear", "wall_s")
#: What limits it, by source of error.
LIMITS = {
    "harmonics": "harmonics ({most} at most)",
    "samples": f"samples ({MOST_SAMPLES} at most)",
    "solver": "the solver (tighter tolerance: -snes_rtol)",
    "unknown": "errors that cannot be estimated",
    "reduction": "the reduction (more component modes: [reduction] modes)",
}


class RefiningContinuation(Continuation):
    """A continuation that changes its set of harmonics and samples along the branch. Collective.

    A point whose estimated error exceeds the accuracy is solved again on a larger set before it is handed out, three
    times at most, and the branch goes on from there; where the estimate has room, smaller sets are taken. `problem` is
    that of the present point.

    Parameters
    ----------
    accuracy : float
        Relative, of zeta and omega of a mode, of the complex amplitude of a response.
    least : Harmonics, optional
        The smallest set that is taken; by default the problem's.
    """

    def __init__(
        self,
        problem: HarmonicProblem,
        y0: PETSc.Vec,
        stop: tuple[float, float],
        steps: StepControl | None = None,
        report_at: Sequence[float] = (),
        upwards: bool | None = None,
        *,
        accuracy: float,
        least: Harmonics | None = None,
    ) -> None:
        super().__init__(problem, y0, stop, steps, report_at, upwards)
        self.accuracy, self.least, self._largest = accuracy, least or problem.harmonics, problem
        self._settings = (steps or StepControl()).core(), list(report_at)
        self._aim = Aim(most_harmonics=most_harmonics(problem.model.n_dof))
        self._present: Point | None = None  # the last point handed out, and what it solves
        self._of = problem
        self._missed_before: list[str] = []
        self._helped_before: dict[str, int] = {}
        self.points, self.missed_by = 0, dict[str, int]()

    def __next__(self) -> Point:
        if self._present is not None and not self._core.ends:
            wanted = self._aim.next(self.problem.harmonics, self.least)
            if wanted is not None and (moved := self._move(wanted, self._present, "next_step")) is not None:
                moved.destroy()
        point = super().__next__()
        shares = self._judged(point)
        for _ in range(ROUNDS):
            before, wanted = self.problem.harmonics, self._aim.finer(self.problem.harmonics, shares)
            again = None if wanted is None else self._again(wanted, point)
            if again is None:
                break
            near = abs(again.parameter - point.parameter) < NEAR * abs(point.parameter)
            point, then, shares = again, shares, self._judged(again)
            if near:
                self._aim.compare(before, then, self.problem.harmonics, shares)
        self._aim.see(shares)
        self.points += 1
        if not shares["all"] <= 1:
            source = limiting(shares)
            self.missed_by[source] = self.missed_by.get(source, 0) + 1
        self._present, self._of, self._last = point, self.problem, point.y
        return point

    def _again(self, harmonics: Harmonics, point: Point) -> Point | None:
        """The step anew on a larger set, from the last point; the first point itself. None: it fails. Collective.

        Step control then sees the branch of that set, as the cubic through the points does.
        """
        kept = self.problem, self._core, self._missed_before, self._helped_before
        found = self._move(harmonics, self._present or point, "step")
        if found is not None and self._present is not None:
            found.destroy()
            try:
                found = super().__next__()
            except StopIteration:
                found, self._over = None, False
                self.problem, self._core, self._missed_before, self._helped_before = kept
        if found is None:
            return None
        point.destroy()
        return replace(found, **{name: getattr(point, name) + getattr(found, name) for name in SUMS})

    def _judged(self, point: Point) -> dict[str, float]:
        """Its distances from the true branch over what the accuracy allows; its errors are kept. Collective."""
        assert self.problem.meaning is not None
        found = self.problem.estimate(point.y, point.tangent) or Estimate.none(self.problem.meaning)
        point.errors = found.columns
        return {name: distance / self.accuracy for name, distance in found.distances().items()}

    def _move(self, harmonics: Harmonics, point: Point, step: str) -> Point | None:
        """The point on another set, from which the branch goes on; None where the corrector fails there. Collective.

        Parameters
        ----------
        step : what the continuation calls the length to go on with: "step" that has led from the point, or "next_step"
        """
        problem, state = self.problem.on(harmonics), self._standing()
        core = _core.Continuation(problem.core, problem.prefix, self._low, self._high, *self._settings)
        of = self._of if point is self._present else self.problem
        y, tangent = (of.embedded(problem, v) for v in (point.y, point.tangent))
        where = float(state[step]), point.index + 1, bool(state["wary"])
        found = core.take_over(y, tangent, *where, point.event, bool(state["upwards"]), float(state["began"]))
        y.destroy()
        tangent.destroy()
        if found is None:
            problem.destroy()
            return None
        self._missed_before, self._helped_before = self.missed, self.fallbacks
        problem.errors_wall_s = self.problem.errors_wall_s
        self.problem.forget_errors()
        self.problem, self._core = problem, core
        if problem.harmonics.block_size >= self.largest.harmonics.block_size:
            self._largest = problem
        self.tell(f"{_place(problem, point)}: harmonics up to {harmonics.orders[-1]}, {harmonics.samples} samples")
        return Point(**{**found, "index": point.index, "step": point.step})

    @property
    def converged(self) -> bool:
        """The branch ended as asked, and kept the accuracy at all but TOLERATED of its points."""
        return super().converged and not self._too_inaccurate

    @property
    def reason(self) -> str:
        return f"{super().reason}; {self.accuracy_text}" if self._too_inaccurate else super().reason

    @property
    def missed(self) -> list[str]:
        return [*self._missed_before, *super().missed]

    @property
    def fallbacks(self) -> dict[str, Any]:
        now = super().fallbacks
        return {**now, **{name: now[name] + n for name, n in self._helped_before.items() if name != "said"}}

    @property
    def largest(self) -> HarmonicProblem:
        return self._largest

    @property
    def accuracy_text(self) -> str:
        missed = sum(self.missed_by.values())
        text = f"accuracy {self.accuracy:g} kept at {self.points - missed} of {self.points} points"
        most = self._aim.most_harmonics
        limits = (f", {n} limited by {LIMITS[source].format(most=most)}" for source, n in self.missed_by.items())
        return text + "".join(limits)

    @property
    def _too_inaccurate(self) -> bool:
        return sum(self.missed_by.values()) > TOLERATED * self.points

    def snapshot(self) -> dict[str, Any]:
        found = super().snapshot()
        harmonics, missed = self.problem.harmonics, [self.missed_by.get(source, 0) for source in LIMITS]
        sizes: dict[str, float] = {
            "harmonics": harmonics.orders[-1],
            "samples": harmonics.samples,
            "points": self.points,
            "accuracy": self.accuracy,
        }
        return {**found, **sizes, "aim": np.array(self._aim.state), "missed_by": np.array(missed)}

    @classmethod
    def restore(
        cls,
        problem: HarmonicProblem,
        snapshot: dict[str, Any] | None,
        stop: tuple[float, float],
        steps: StepControl | None = None,
        report_at: Sequence[float] = (),
    ) -> RefiningContinuation:
        """Goes on on the snapshot's set, `problem` having the least. Collective."""
        given = cls._told(problem, snapshot)
        now = problem.on(problem.harmonics.up_to(int(given["harmonics"]), int(given["samples"])))
        kept: dict[str, Any] = {"accuracy": float(given["accuracy"]), "least": problem.harmonics}
        with Owned() as own:
            y0 = own(cls._scatter(now, given["y"]))
            branch = cls(now, y0, stop, steps, report_at, bool(given["upwards"]), **kept)
        branch._go_on(given)
        branch._aim, branch.points = Aim.of(given["aim"]), int(given["points"])
        branch.missed_by = {source: int(n) for source, n in zip(LIMITS, given["missed_by"]) if n}
        branch._present, branch._of = branch.repeated, branch.problem
        return branch

    def destroy(self) -> None:
        """Free the solver, and what estimates errors. Collective."""
        self.problem.forget_errors()
        super().destroy()


def keeping(accuracy: float | None) -> tuple[type[Continuation], dict[str, Any]]:
    """The continuation that keeps an accuracy, or none, and what it is made with for that."""
    return (Continuation, {}) if accuracy is None else (RefiningContinuation, {"accuracy": accuracy})


def _place(problem: HarmonicProblem, point: Point) -> str:
    assert problem.meaning is not None
    return f"{problem.meaning.parameter} {point.parameter:.4g}"
