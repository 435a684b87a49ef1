"""Runs of a study: the whole branch of a mode or of a forced response at any settings."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar, Union

import numpy as np

from ..analyses.forced import ForcedAnalysis
from ..analyses.mode import ModeAnalysis
from ..analyses.parts.branch import step_control
from ..analyses.parts.context import AnalysisContext
from ..analyses.parts.excitation import Excitation, excitation_of
from ..analyses.parts.rest import retained
from ..analyses.parts.wheel_start import Start, start_of
from ..arrays import Array
from ..case.build import build_model
from ..case.harmonic import LEAST_HARMONICS, LEAST_SAMPLES, nodal_diameter
from ..case.load import Case
from ..case.reduce import reduce_case
from ..case.wheel import on_wheel, solver_room
from ..columns import SOURCES
from ..console import Console
from ..mpi.destroyable import Owned
from ..mpi.petsc_options import AnalysisOptions
from ..mpi.petsc_share import prefix_of
from .study_outcomes import AnyOutcome, Outcome, ResponseOutcome
from .study_plan import Settings, common_amplitudes
from .unread import UnreadInStudy

if TYPE_CHECKING:
    from mpi4py import MPI

    from ..hb.harmonic_problem import HarmonicProblem
    from ..hb.harmonics import Harmonics
    from ..solve.point import Point

Studied = Union[ModeAnalysis, ForcedAnalysis]

#: What all runs on a model begin with
Begun = TypeVar("Begun")


class Solver(ABC, Generic[Begun]):
    """Solves the whole branch of one analysis at any settings."""

    #: What runs are compared over
    over = "amplitude"
    outcome: type[AnyOutcome]
    analysis: Studied

    def __init__(
        self, case: Case, analysis: Studied, comm: MPI.Comm, console: Console, repeats: int, places: int
    ) -> None:
        self.case, self.analysis, self.comm, self.console, self.repeats = case, analysis, comm, console, repeats
        self.prefix, self.unread = prefix_of(analysis.name), UnreadInStudy()
        self.places = self._places(places)
        self._parts: tuple[int | None, AnalysisContext[Any]] | None = None
        self._begun: Begun | None = None

    @abstractmethod
    def _ends(self) -> tuple[float, float]:
        """First and last value of what the branch is over."""

    @abstractmethod
    def _places(self, count: int) -> Array:
        """At which runs are compared, ascending."""

    @abstractmethod
    def _started(self, context: AnalysisContext[Any]) -> Begun:
        """What all runs on a model begin with. Collective."""

    @abstractmethod
    def _problem(self, context: AnalysisContext[Any], started: Begun, harmonics: Harmonics) -> HarmonicProblem:
        """Collective."""

    @abstractmethod
    def _outcome(self, rows: Sequence[Mapping[str, Any]], newton: int, wall: float) -> AnyOutcome:
        """Of the points' rows (`_row`)."""

    def _model(self, component_modes: int | None) -> AnalysisContext[Any]:
        """Context with this many component modes; the last one is kept. Collective."""
        if self._parts is None or self._parts[0] != component_modes:
            if self._parts is not None:
                self._parts[1].model.destroy()
            analysis = self.analysis
            reduced = reduce_case(self.case, self.comm, component_modes, only=[analysis.name])
            case = on_wheel(reduced, analysis)
            preload, diameters = case.preload_of(analysis), nodal_diameter(analysis)
            model = build_model(case, analysis.dampers, self.comm, preload, diameters, analysis.aerodynamics)
            context = AnalysisContext(model, case, analysis, self.comm, Path(), self.console)
            self._parts, self._begun = (component_modes, context), None
        return self._parts[1]

    def solve(self, settings: Settings) -> AnyOutcome | str:
        """The branch's values where runs are compared, or why it has none. Collective."""
        tried = [self._once(settings)]
        while len(tried) < self.repeats and not isinstance(tried[0], str):
            tried.append(self._once(settings))
        first = tried[0]
        if isinstance(first, str):
            return first
        runs = [run for run in tried if not isinstance(run, str)]
        return replace(first, wall_s=min(run.wall_s for run in runs), cpu_s=min(run.cpu_s for run in runs))

    def _once(self, settings: Settings) -> AnyOutcome | str:
        context = self._model(settings.component_modes)
        asked = settings.accuracy is not None
        least = (LEAST_HARMONICS, LEAST_SAMPLES) if asked else (settings.harmonics, settings.samples)
        harmonics = retained(context, *least)
        options = AnalysisOptions(self.prefix, [self.analysis.petsc, f"-snes_atol {settings.tolerance!r}"])
        with options.inserted(), solver_room(context.case, self.analysis, self.prefix):
            self._begun = self._begun or self._started(context)
            problem = self._problem(context, self._begun, harmonics)
            try:
                return self._follow(problem, settings.accuracy)
            finally:
                problem.destroy()
                self.unread.after_run(options)

    def _follow(self, problem: HarmonicProblem, accuracy: float | None) -> AnyOutcome | str:
        """Only the time spent between points counts: diagnostics are not part of the solution.

        Estimates of errors are, where harmonics and samples follow from them.
        """
        from ..solve.point import points_of
        from ..solve.refining import keeping

        low, high = self._ends()
        rows, newton, spent = [], 0, np.zeros(2)
        began = _clocks()
        settings: dict[str, Any] = {"stop": (low, high), "steps": step_control(self.analysis.step)}
        settings["report_at"] = [float(a) for a in self.places]
        kind, asked = keeping(accuracy)
        with Owned() as own:
            branch = kind(problem, own(problem.initial(low)), **settings, **asked)
        for point in points_of(branch):
            spent += _clocks() - began
            newton += point.newton
            rows.append(_row(branch.problem, point))
            began = _clocks()
        converged, reason = branch.converged, branch.reason
        branch.destroy()
        wall, cpu = spent.tolist()
        return replace(self._outcome(rows, newton, wall), cpu_s=cpu) if converged else str(reason)


class ModeSolver(Solver[Start]):
    """Of a nonlinear mode, over its amplitude."""

    analysis: ModeAnalysis
    outcome = Outcome

    def _ends(self) -> tuple[float, float]:
        return self.analysis.amplitude[0], self.analysis.amplitude[1]

    def _places(self, count: int) -> Array:
        low, high = sorted(self._ends())
        return common_amplitudes(low, high, count)

    def _started(self, context: AnalysisContext[Any]) -> Start:
        return start_of(context)

    def _problem(self, context: AnalysisContext[Any], started: Start, harmonics: Harmonics) -> HarmonicProblem:
        from ..hb.nonlinear_mode import NonlinearMode

        return NonlinearMode(
            context.model,
            harmonics,
            method=self.analysis.method,
            dof=started.dof,
            start=started.mode,
            prefix=self.prefix,
            avoid=started.avoid,
            rest=started.rest,
        )

    def _outcome(self, rows: Sequence[Mapping[str, Any]], newton: int, wall: float) -> Outcome:
        top = max(rows, key=lambda row: float(row["zeta"]))
        amplitude, omega, zeta, estimate = _columns(rows, "amplitude", "omega", "zeta", "estimate")
        peak, at, sizes = top["zeta"], top["amplitude"], (_most(rows, "harmonics"), _most(rows, "samples"))
        return Outcome(amplitude, omega, zeta, estimate, peak, at, len(rows), newton, wall, *sizes)


class ResponseSolver(Solver[Excitation]):
    """Of a forced response at its largest level, over the frequency."""

    analysis: ForcedAnalysis
    outcome = ResponseOutcome
    over = "omega"

    def _ends(self) -> tuple[float, float]:
        first, last = (2 * np.pi * hertz for hertz in self.analysis.frequency)
        return first, last

    def _places(self, count: int) -> Array:
        low, high = sorted(self._ends())
        return np.linspace(low, high, count + 2)[1:-1]

    def _started(self, context: AnalysisContext[Any]) -> Excitation:
        return excitation_of(context, retained(context))

    def _problem(self, context: AnalysisContext[Any], started: Excitation, harmonics: Harmonics) -> HarmonicProblem:
        return replace(started, harmonics=harmonics).problem(max(self.analysis.levels))

    def _outcome(self, rows: Sequence[Mapping[str, Any]], newton: int, wall: float) -> ResponseOutcome:
        top = max(rows, key=lambda row: float(row["amplitude"]))
        omega, amplitude, phase, estimate = _columns(rows, "omega", "amplitude", "phase", "estimate")
        cosine, sine = amplitude * np.cos(phase), -amplitude * np.sin(phase)
        peak, at, sizes = top["amplitude"], top["omega"], (_most(rows, "harmonics"), _most(rows, "samples"))
        return ResponseOutcome(omega, cosine, sine, estimate, peak, at, len(rows), newton, wall, *sizes)


def _clocks() -> Array:
    """Of the wall and of the processor [s]."""
    return np.array([time.perf_counter(), time.process_time()])


def _row(problem: HarmonicProblem, point: Point) -> dict[str, Any]:
    assert problem.meaning is not None
    reported = "report" in point.event
    found = point.errors or problem.errors(point.y, point.tangent if reported else None)
    estimate = [found[problem.meaning.error_by.format(source)] for source in SOURCES]
    sizes = {"harmonics": problem.harmonics.orders[-1], "samples": problem.harmonics.samples}
    return {**problem.state(point.y), **sizes, "estimate": estimate, "reported": reported}


def _columns(rows: Sequence[Mapping[str, Any]], *names: str) -> list[Array]:
    """Of the points that are compared."""
    return [np.array([row[name] for row in rows if row["reported"]]) for name in names]


def _most(rows: Sequence[Mapping[str, Any]], name: str) -> int:
    """Of the largest set."""
    return max(int(row[name]) for row in rows)
