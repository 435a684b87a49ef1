"""Branches: pseudo-arclength continuation as a generator of points."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import astuple
from typing import Any

import numpy as np
from petsc4py import PETSc

from .. import _core
from ..errors import InputError
from ..given import listed, with_a_square
from ..hb.harmonic_problem import HarmonicProblem
from ..kinds import of_their_kinds
from ..mpi.destroyable import Owned
from ..mpi.log import event
from ..mpi.same import expect_same
from ..mpi.spread import Cuttable, Spread, fill
from ..texts import shortened
from .afar import far_from_start
from .point import Point
from .starting import given, starts
from .steps import StepControl

#: Relative change of sampled forces' harmonics on doubled samples above which a failure is put down to sampling.
ALIASING_LIMIT = 1e-3


#: Of a snapshot: the last anchor and the one before it.
_VECTORS = ("y", "tangent", "before_y", "before_tangent")


def _ends(stop: object) -> tuple[float, float]:
    found = listed(stop)
    if found.shape != (2,) or found.dtype.kind not in "biuf" or np.isnan(found).any():
        what, fix = "the range of the branch is no pair of numbers", "give for example stop=(0.1, 1.0)"
        raise InputError(what, "Continuation(stop=...)", shortened(repr(stop), 60), "(low, high)", fix)
    return float(found[0]), float(found[1])


def reports_of(given: object) -> list[float]:
    """Parameter values, as numbers."""
    values = listed(given)
    if values.ndim != 1 or values.dtype.kind not in "biuf" or not np.isfinite(values).all():
        fix = "give for example report_at=[0.1, 1.0]"
        raise InputError("no point can be located there", "report_at", repr(given), "a list of numbers", fix)
    return [float(value) for value in values]


class Continuation:
    """Follows a problem's branch from y0 until its parameter leaves (low, high). Collective.

    It hands out its points once, as files do their lines: a loop that was left goes on where it stood, and behind the
    last point there are none. `fretwave.follow` keeps them.

    Parameters
    ----------
    y0 : Vec
        First guess; Newton runs at its parameter.
    stop : (low, high)
        The last point lies on the value the branch reaches. One that begins at an end may fold back over it and come
        in again: it is followed a third of the range outside (a quarter of the end, or four times it, at the most),
        and its points are kept.
    report_at : parameter values at which points are located
    upwards : the parameter grows at first
    way : of which only the end counts, to be corrected anew: none of the problem's own events (peaks, zero damping) are
        located, but folds are; no report or stop is made better than any point; and a start that Newton does not find
        is not looked for on ways of its own, as it is otherwise (`started` tells)

    Attributes
    ----------
    tell : callable
        Told in words of each change of the set of harmonics, where an accuracy is kept.
    """

    @of_their_kinds
    def __init__(
        self,
        problem: HarmonicProblem,
        y0: PETSc.Vec,
        stop: tuple[float, float],
        steps: StepControl | None = None,
        report_at: Sequence[float] = (),
        upwards: bool | None = None,
        way: bool = False,
    ) -> None:
        low, high = stop = _ends(stop)
        if not low < high:
            raise InputError(
                "the range of the branch is empty", None, f"({low}, {high})", "low < high", "order the two stop values"
            )
        control, reports = steps or StepControl(), reports_of(report_at)
        ways = 0.0 if upwards is None else 2.0 * upwards - 1.0
        asked = [*stop, ways, *astuple(control), *reports]
        expect_same(problem.model.comm, "the ends, reports and steps of a branch", asked)
        with_a_square("an end of the branch", max(1.0, *(end for end in stop if end < np.inf)), "choose other units")
        self.problem, self._low, self._high = problem, low, high
        self._core = _core.Continuation(problem.core, problem.prefix, low, high, control.core(), reports)
        if way:
            self._core.follow_as_way()
        if upwards is None:
            start = problem.parameter(y0)
            upwards = bool(start < 0.5 * (low + high))
        self._upwards, self._begun, self._advice = upwards, False, ""
        self.repeated: Point | None = None
        self.resumed_at: tuple[PETSc.Vec, PETSc.Vec] | None = None
        self.way, self.started, self._first_reason = way, "", ""
        self._last: PETSc.Vec | None = None
        self._over, self._y0 = False, y0.copy()
        self.tell: Callable[[str], None] = lambda text: None

    def __repr__(self) -> str:
        if self._core is None:
            return "Continuation(destroyed)"
        return f"Continuation({self._low:g} to {self._high:g}: {self.reason or 'under way'}, of {self.problem})"

    @property
    def accuracy_text(self) -> str:
        """Where an accuracy was kept, and what limited it elsewhere; empty where none is asked for."""
        return ""

    @property
    def largest(self) -> HarmonicProblem:
        """That with the most harmonics, of those of its points."""
        return self.problem

    def last_entry(self, y: PETSc.Vec) -> float:
        """The parameter's entry of unknowns or a tangent, on every rank. Collective."""
        return self.problem.last_entry(y)

    def _first(self) -> dict[str, Any] | None:
        """The first point, by another way if Newton does not find it from the first guess."""
        point = self._core.start(self._y0, self._upwards)
        if self.way:
            return dict(point) if point is not None else None
        far = point is not None and not given(self._y0, point["y"]) and far_from_start(self.problem, point["y"])
        if point is not None and not far:
            return dict(point)
        if point is not None:
            Point(**point).destroy()
        reason = "the first point found is far from the linear mode" if far else str(self._core.reason)
        reasons: list[str] = []
        for how, y in starts(Continuation, self.problem, self._y0, reasons, far):
            point = self._core.start(y, self._upwards)
            y.destroy()
            if point is not None:
                self.started = how
                return dict(point)
        if far and not reasons:
            point = self._core.start(self._y0, self._upwards)
            return dict(point) if point is not None else None
        self._advice = "".join(f"; {other}" for other in reasons)
        self._first_reason = reason
        return None

    def __iter__(self) -> Continuation:
        return self

    def __next__(self) -> Point:
        if self._over:
            raise StopIteration
        self.problem.model.take_no_numbers()  # of the step to come alone
        with event("FwPoint"):
            point = self._core.next() if self._begun else self._first()
        last, self._begun = self._last, True
        self._last = None if point is None else point["y"]
        if point is None:
            self._over = True
            if last and not self.converged and "without bound" not in self._core.reason:
                self._advise(last)  # unless the caller has freed it
            raise StopIteration
        return Point(**point)

    def _advise(self, y: PETSc.Vec) -> None:
        """Where a law is sampled, a branch often breaks off at a force that changes within a sample."""
        aliasing = self.problem.diagnostics(y)["aliasing"]
        if aliasing > ALIASING_LIMIT:
            self._advice = (
                f"; the contact force may be poorly resolved in time (its harmonics change by {100 * aliasing:.2g} % on"
                f" doubled samples): if so, samples = {4 * self.problem.harmonics.samples} or a smoother law helps"
            )

    @property
    def converged(self) -> bool:
        """The branch ended as asked."""
        return bool(self._core.converged)

    @property
    def reason(self) -> str:
        """Why the branch ended."""
        return (self._first_reason or str(self._core.reason)) + self._advice

    @property
    def route(self) -> str:
        """How linear systems are solved, why so, and the memory of the Krylov route's factors."""
        return str(self._core.route)

    @property
    def fallbacks(self) -> dict[str, Any]:
        """How often a linear solve that failed was tried in a dearer way, and what is to be said of it.

        Returns
        -------
        dict
            rebuilt, condensed, whole : preconditioner built anew at the point, condensed contact system factorised,
            whole system factorised; said : of the last one, or why it could not be taken.
        """
        return dict(self._core.fallbacks)

    @property
    def snes(self) -> PETSc.SNES:
        """The corrector, to look into or to set options on."""
        return self._core.snes

    @property
    def anchor(self) -> PETSc.Vec | None:
        """Unknowns of the regular point that the branch last started a step from; None where it found no first one."""
        return self._core.anchor()["y"] or None

    def _standing(self) -> dict[str, Any]:
        """The numbers of `anchor` and of the step from there."""
        return {name: value for name, value in self._core.anchor().items() if name not in _VECTORS}

    @property
    def missed(self) -> list[str]:
        """Reports and events that were asked for or seen and could not be had, each with its reason."""
        return list(self._core.missed)

    def snapshot(self) -> dict[str, Any]:
        """All that `restore` needs to go on, of vectors each rank's part where there are several. Collective."""
        state, comm = dict(self._core.anchor()), self.problem.model.comm
        for name in [name for name in _VECTORS if name in state]:
            part = Spread(comm, state[name])
            state[name] = part if comm.size > 1 else part.local
        return state

    @classmethod
    def restore(
        cls,
        problem: HarmonicProblem,
        snapshot: dict[str, Any] | None,
        stop: tuple[float, float],
        steps: StepControl | None = None,
        report_at: Sequence[float] = (),
    ) -> Continuation:
        """Goes on after the snapshot's point. Collective.

        Rank 0 alone needs one that was taken on a single rank, or that an analysis kept; any number of ranks goes on
        from it. One of several ranks is for these.

        On the same ranks and the direct route the branch is the same bit for bit; elsewhere (another number of ranks,
        or a preconditioner of another age) to the tolerance of the corrector. `repeated` is the last point handed out
        before, solved again, to measure that by; `resumed_at` are unknowns and tangent there. Both live as long as the
        branch does.
        """
        given = cls._told(problem, snapshot)
        with Owned() as own:
            y0 = own(cls._scatter(problem, given["y"]))
            branch = cls(problem, y0, stop, steps, report_at, bool(given.get("upwards", True)))
        branch._go_on(given)
        return branch

    def _go_on(self, snapshot: dict[str, Any]) -> None:
        """Stand where the snapshot was taken. Collective."""
        began = float(snapshot.get("began", np.nan))
        wary, smooth = bool(snapshot.get("wary", False)), bool(snapshot.get("smooth", False))
        step, index, emitted = float(snapshot["step"]), int(snapshot["index"]), int(snapshot["emitted"])
        with Owned() as own:
            found = [name for name in _VECTORS if name in snapshot]
            vectors = {name: own(self._scatter(self.problem, snapshot[name])) for name in found}
            before = [vectors[name] for name in _VECTORS[2:] if name in vectors]
            now = [vectors["y"], vectors["tangent"]]
            point = self._core.restore(now, before, step, index, wary, smooth, emitted, self._upwards, began)
        self.repeated = None if point is None else Point(**point)
        anchor = self._core.anchor()
        self.resumed_at = (point["y"], point["tangent"]) if point is not None else (anchor["y"], anchor["tangent"])
        self._begun = True

    @staticmethod
    def _told(problem: HarmonicProblem, snapshot: dict[str, Any] | None) -> dict[str, Any]:
        """A snapshot on every rank, of vectors what each has of them. Collective."""
        own = snapshot or {}
        told = problem.model.comm.bcast({name: None if name in _VECTORS else value for name, value in own.items()})
        return {name: own.get(name) if name in _VECTORS else value for name, value in told.items()}

    @staticmethod
    def _scatter(problem: HarmonicProblem, whole: Spread | Cuttable | Sequence[float] | None) -> PETSc.Vec:
        v = problem.core.unknowns()
        if isinstance(whole, Sequence):
            whole = np.asarray(whole, dtype=float)
        size = problem.model.comm.bcast(None if whole is None else whole.shape[0])
        if v.getSize() != size:
            raise InputError(
                "the saved state is of another problem", None, size, v.getSize(), "resume with the same case"
            )
        if isinstance(whole, Spread):
            v.setArray(whole.local)
        else:
            fill(v, whole)
        return v

    def destroy(self) -> None:
        """Free the solver. Collective."""
        for vector in (self._y0, *(self.resumed_at or ())):
            vector.destroy()
        self._last, self._over = None, True
        self._core = None  # type: ignore[assignment]
