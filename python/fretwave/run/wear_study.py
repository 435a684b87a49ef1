"""``fretwave study`` of wear: error against run time over the tolerance of a step, its bound on pressure, harmonics."""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..analyses.mode import ModeAnalysis
from ..analyses.parts.branch import mode_problem
from ..analyses.parts.context import AnalysisContext
from ..analyses.parts.rest import retained, start_mode
from ..analyses.parts.wear_line import wear_areas
from ..analyses.parts.wear_start import unworn_starts
from ..analyses.wear import WearAnalysis, march_advice
from ..arrays import Array
from ..case.build import model_of
from ..case.load import Case
from ..case.reduce import reduce_case
from ..console import Console
from ..errors import EXIT_DONE, FretwaveError, NotConverged, PetscError
from ..mpi.guard import caught_by_all
from ..mpi.petsc_options import AnalysisOptions
from ..results.study_report import LEGEND_OF_WEAR, PRINTED_OF_WEAR, markdown
from ..units import SI, UnitSystem
from .study_folder import StudyFolder, publish, say_unread
from .unread import UnreadInStudy

if TYPE_CHECKING:
    from mpi4py import MPI

    from ..hb.nonlinear_mode import NonlinearMode
    from ..solve.wear import Wear

#: Swept where neither the command line nor the case says anything.
TOLERANCES = (1e-1, 1e-2, 1e-3, 1e-4)
#: Of the two bounds on a step the other one.
OTHER_BOUND = {"tolerance": "pressure_change", "pressure_change": "tolerance"}


@dataclass(frozen=True)
class CycleUnit:
    """How many vibrations a normalised cycle has."""

    vibrations: float


@dataclass(frozen=True)
class WearSettings:
    """Numerical settings of one run."""

    harmonics: int
    tolerance: float
    pressure_change: float


@dataclass(frozen=True)
class WearOutcome:
    """What one run found after the last cycle: omega [rad/s], zeta and the worn volume [length^3]; and its cost."""

    omega: float
    zeta: float
    worn: float
    steps: int
    newton: int
    wall_s: float


@dataclass
class WearPlan:
    """Sweeps of one setting at a time, the others as in the analysis; each has its own reference, its finest."""

    base: WearSettings
    harmonics: Sequence[int] = ()
    tolerance: Sequence[float] = ()
    pressure_change: Sequence[float] = ()
    outcomes: dict[WearSettings, WearOutcome] = field(default_factory=dict)
    failures: dict[WearSettings, str] = field(default_factory=dict)
    units: UnitSystem = SI

    def sweeps(self) -> Iterator[tuple[str, list[WearSettings]]]:
        """(swept setting, all settings of the sweep), coarse to fine."""
        for name, coarse_to_fine in (("tolerance", -1), ("pressure_change", -1), ("harmonics", 1)):
            values = sorted(getattr(self, name))[::coarse_to_fine]
            if values:
                yield name, [replace(self.base, **{name: value}) for value in values]

    def runs(self) -> list[WearSettings]:
        """All settings, those of several sweeps once."""
        return list(dict.fromkeys(settings for _, swept in self.sweeps() for settings in swept))

    def table(self) -> list[dict[str, float | int | str]]:
        """One row per run and sweep; sweeps without their reference are left out."""
        volume = self.units.cubic_millimetres
        return [
            _row(name, settings, self.outcomes[settings], self.outcomes[swept[-1]], settings == swept[-1], volume)
            for name, swept in self.sweeps()
            for settings in swept
            if settings in self.outcomes and swept[-1] in self.outcomes
        ]

    def without_effect(self) -> Iterator[str]:
        """Sweeps in which runs take the finest one's steps to the last digit: their errors are zero, and none at all.

        A step is as long as both the tolerance and the bound on pressure let it.
        """
        for name, swept in self.sweeps():
            finest, other = self.outcomes.get(swept[-1]), OTHER_BOUND.get(name)
            if finest is None or other is None:
                continue
            alike = [f"{getattr(one, name):g}" for one in swept[:-1] if _same(self.outcomes.get(one), finest)]
            if alike:
                ruling = f"{other} = {getattr(self.base, other):g}"
                yield (
                    f"With {name} = {', '.join(alike)} all steps are those of the finest run, as {ruling} rules them:"
                    f" the errors are zero there because nothing changes. Sweep {other} too"
                    f" (--{other.replace('_', '-')})."
                )


def _same(run: WearOutcome | None, finest: WearOutcome) -> bool:
    """Whether a run differs in nothing but its time."""
    return run is not None and replace(run, wall_s=finest.wall_s) == finest


def _row(
    sweep: str,
    settings: WearSettings,
    run: WearOutcome,
    finest: WearOutcome,
    is_finest: bool,
    cubic_millimetres: float,
) -> dict[str, float | int | str]:
    errors = {
        f"{name}_error": abs(getattr(run, name) - getattr(finest, name)) / (abs(getattr(finest, name)) or 1.0)
        for name in ("omega", "zeta", "worn")
    }
    return {
        "sweep": sweep,
        "harmonics": settings.harmonics,
        "tolerance": settings.tolerance,
        "pressure_change": settings.pressure_change,
        "steps": run.steps,
        "newton": run.newton,
        "wall_s": run.wall_s,
        "frequency_hz": run.omega / (2 * np.pi),
        "zeta_percent": 100 * run.zeta,
        "worn_mm3": cubic_millimetres * run.worn,
        **errors,
        "reference": int(is_finest),
    }


def study_wear(case: Case, options: argparse.Namespace, comm: MPI.Comm, console: Console, folder: StudyFolder) -> int:
    """Run the study; returns the exit code. Collective."""
    analysis = case.analyses.of(WearAnalysis)[options.analysis]
    plan = wear_plan(case, analysis, options)
    amplitude = max(analysis.amplitude)
    console.line(f"study of '{analysis.name}' at a = {amplitude:g} {case.units('length')}: {len(plan.runs())} runs")
    solver = _Solver(case, analysis, comm, console, options.repeats)
    unit = folder.solved(len(plan.runs()), CycleUnit, lambda: solver.cycle_unit(plan.runs()[0]))
    solver.unit = 0.0 if isinstance(unit, str) else unit.vibrations
    for number, settings in enumerate(plan.runs()):
        found = folder.solved(number, WearOutcome, lambda settings=settings: solver.solve(settings))  # type: ignore[misc]
        if isinstance(found, str):
            plan.failures[settings] = found
        else:
            plan.outcomes[settings] = found
        console.line(_progress(settings, found, case.units))
    solver.destroy()
    if not plan.table():
        reasons = "; ".join(dict.fromkeys(plan.failures.values()))
        fix = f"milder finest settings, or {march_advice(analysis.name, reasons)}"
        raise NotConverged("no sweep has its finest run", None, reasons, "a finished march", fix)
    say_unread(solver.unread, case, analysis.name, folder, console)
    folder.finish(lambda path: _write(plan, amplitude, analysis, path, console))
    return EXIT_DONE


def wear_plan(case: Case, analysis: WearAnalysis, options: argparse.Namespace) -> WearPlan:
    """Sweeps of the command line, else of the case's table [study], else of the tolerance alone."""
    mode = analysis.settings(case)
    base = WearSettings(mode.harmonics, analysis.tolerance, analysis.pressure_change)
    given = {name: getattr(options, name) for name in ("harmonics", "tolerance", "pressure_change")}
    if not any(given.values()):
        section = case.study
        given = dict(
            harmonics=section.harmonics, tolerance=section.wear_tolerance, pressure_change=section.pressure_change
        )
    chosen = {name: tuple(dict.fromkeys(values or ())) for name, values in given.items()}
    if not any(chosen.values()):
        chosen["tolerance"] = TOLERANCES
    swept = chosen["harmonics"], chosen["tolerance"], chosen["pressure_change"]
    return WearPlan(base, *swept, units=case.units)


class _Solver:
    """Marches wear at the largest amplitude of an analysis with any settings. Collective, as all methods."""

    def __init__(self, case: Case, analysis: WearAnalysis, comm: MPI.Comm, console: Console, repeats: int) -> None:
        self.case = reduce_case(case, comm, only=[analysis.name])
        self.analysis = analysis.model_copy(update={"amplitude": [max(analysis.amplitude)]})
        self.comm, self.console, self.repeats = comm, console, repeats
        self.model = model_of(self.case, self.analysis, comm)
        self._starts: dict[int, dict[str, Any]] = {}
        self.unread = UnreadInStudy()
        self.unit = 0.0  # of the first run, so that all compare at the same cycles

    def _mode(self, harmonics: int | None) -> ModeAnalysis:
        given = self.analysis.harmonics if harmonics is None else harmonics
        return self.analysis.model_copy(update={"harmonics": given}).settings(self.case)

    def destroy(self) -> None:
        """Free the model."""
        self.model.destroy()

    def _context(self, mode: ModeAnalysis) -> AnalysisContext[ModeAnalysis]:
        return AnalysisContext(self.model, self.case, mode, self.comm, Path(), Console(False))

    @contextmanager
    def _steering(self, context: AnalysisContext[ModeAnalysis]) -> Iterator[None]:
        """The PETSc options of the analysis, as a run has them, are in the database inside."""
        options = AnalysisOptions(context.prefix, [self.analysis.petsc])
        with options.inserted():
            yield
            self.unread.after_run(options)

    def cycle_unit(self, settings: WearSettings) -> CycleUnit | str:
        """Vibrations in a normalised cycle, or why they are not known."""
        if self.analysis.cycle_unit:
            return CycleUnit(self.analysis.cycle_unit)
        mode = self._mode(settings.harmonics)
        context = self._context(mode)
        with self._steering(context):
            try:
                self._starts[settings.harmonics] = unworn_starts(context, self.analysis)
            except (NotConverged, PetscError) as error:
                return _reason(error)
        return CycleUnit(float(self._starts[settings.harmonics]["cycle_unit"]))

    def solve(self, settings: WearSettings) -> WearOutcome | str:
        """Values at the compared cycles, or why there are none; its time is that of the fastest march."""
        mode = self._mode(settings.harmonics)
        context = self._context(mode)
        with self._steering(context):
            try:
                if settings.harmonics not in self._starts:
                    self._starts[settings.harmonics] = unworn_starts(context, self.analysis)
                    self.unit = self.unit or float(self._starts[settings.harmonics]["cycle_unit"])
                tried = [self._march(context, settings) for _ in range(self.repeats)]
            except (NotConverged, PetscError) as error:
                caught_by_all(self.comm, error)
                return _reason(error)
        runs = [run for run in tried if isinstance(run, WearOutcome)]
        return replace(runs[0], wall_s=min(run.wall_s for run in runs)) if runs else str(tried[0])

    def _march(self, context: AnalysisContext[ModeAnalysis], settings: WearSettings) -> WearOutcome | str:
        from ..solve.steps import WearControl
        from ..solve.wear import Wear
        from ..solve.worn_mode import WornMode

        mode, a, unit = context.analysis, self.analysis, self.unit
        start, rest = start_mode(context, mode.linear_mode)
        problem = mode_problem(context, retained(context), start, rest)
        areas = wear_areas(self.case)
        with problem, WornMode(problem, a.coefficient, areas) as worn:
            y = problem.core.unknowns()
            begin, end = y.getOwnershipRange()
            y.setArray(np.asarray(self._starts[settings.harmonics]["y_0"])[begin:end])
            control = WearControl(a.stepper, settings.tolerance, settings.pressure_change, max_points=a.max_points)
            march = Wear(worn, y, unit * a.cycles, control)
            y.destroy()
            return _follow(march, problem, np.concatenate(list(areas.values())))


def _follow(march: Wear, problem: NonlinearMode, areas: Array) -> WearOutcome | str:
    """The end of a march; where wear has stopped before the last cycle, the values stay."""
    began = time.perf_counter()
    newton = [point.newton for point in march]
    wall = time.perf_counter() - began
    if not march.converged:
        return str(march.reason)
    state = problem.state(march.state.y)
    return WearOutcome(
        state["omega"], state["zeta"], float(areas @ march.state.depth), len(newton) - 1, sum(newton), wall
    )


def _write(plan: WearPlan, amplitude: float, analysis: WearAnalysis, folder: Path, console: Console) -> None:
    rows = plan.table()
    notes = [
        f"{analysis.name}, a = {amplitude:g} {analysis.units('length')}, {analysis.stepper},"
        f" after {analysis.cycles:g} cycles."
    ]
    notes += [f"No whole march with {_text(settings)}: {reason}." for settings, reason in plan.failures.items()]
    notes += list(plan.without_effect())
    publish(folder, {"study": rows}, markdown(rows, notes, PRINTED_OF_WEAR, LEGEND_OF_WEAR), console)


def _progress(settings: WearSettings, found: WearOutcome | str, units: UnitSystem) -> str:
    if isinstance(found, str):
        return f"{_text(settings)}: {found}"
    cost = f"{found.steps} steps, {found.newton} Newton iterations, {found.wall_s:.3f} s"
    return f"{_text(settings)}: {cost}, worn {units.cubic_millimetres * found.worn:.5g} mm^3"


def _reason(error: FretwaveError) -> str:
    """In one line; bad input is no reason why one run of a study fails, but why all do."""
    return error.what if error.measured is None else f"{error.what}: {error.measured}"


def _text(settings: WearSettings) -> str:
    return f"H = {settings.harmonics}, tolerance {settings.tolerance:.0e}, pressure {settings.pressure_change:g}"
