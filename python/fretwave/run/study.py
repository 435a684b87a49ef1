"""Error against run time of a mode analysis over harmonics, samples, tolerance, modes."""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..analyses.mode import ModeAnalysis
from ..analyses.parts.branch import step_control
from ..analyses.parts.context import AnalysisContext
from ..analyses.parts.rest import retained
from ..analyses.parts.wheel_start import Start, start_of
from ..analyses.wear import WearAnalysis
from ..case.build import build_model
from ..case.harmonic import LEAST_HARMONICS, LEAST_SAMPLES, nodal_diameter
from ..case.load import Case, load_case
from ..case.reduce import reduce_case
from ..case.wheel import on_wheel, solver_room
from ..columns import SOURCES
from ..console import Console
from ..errors import EXIT_DONE, InputError, NotConverged
from ..mpi.guard import on_first_rank
from ..mpi.petsc_options import AnalysisOptions
from ..results.runfolder import read_copy
from ..results.study_report import markdown
from .study_folder import StudyFolder, publish
from .study_plan import Outcome, Plan, Settings, Study, common_amplitudes

if TYPE_CHECKING:
    from mpi4py import MPI

    from ..hb.problems import HarmonicProblem, NonlinearMode
    from ..solve.continuation import Point


#: each branch is solved this often; its time is that of the fastest, which other work on the machine disturbs least
REPEATS = 3
#: amplitudes at which runs are compared
COUNT = 24


def run_study(
    options: argparse.Namespace, arguments: Sequence[str], comm: MPI.Comm, record: dict[str, Any] | None = None
) -> int:
    """Run a study, or go on with it; returns the exit code. Collective."""
    case = on_first_rank(comm, lambda: _load(options, record))
    worn = options.analysis in case.analyses.of(WearAnalysis)
    chosen = None if worn else _analysis(case, options.analysis)
    with StudyFolder(case, options, arguments, comm, record) as folder:
        console = Console(comm.rank == 0, folder.log, shown=options.shown)
        if chosen is not None:
            return _study_mode(case, chosen, options, comm, console, folder)
        from .wear_study import study_wear

        return study_wear(case, options, comm, console, folder)


def _load(options: argparse.Namespace, record: dict[str, Any] | None) -> Case:
    """The case; one that is gone from its copy, as a run does."""
    gone = record is not None and not options.case.exists()
    text = read_copy(options.out, record) if gone and record is not None else None
    return load_case(options.case, options.overrides, options.quick, text=text)


def _study_mode(
    case: Case,
    analysis: ModeAnalysis,
    options: argparse.Namespace,
    comm: MPI.Comm,
    console: Console,
    folder: StudyFolder,
) -> int:
    plan = _plan(case, options)
    study = Study(plan, common_amplitudes(min(analysis.amplitude), max(analysis.amplitude), COUNT))
    console.line(f"study of '{analysis.name}': {len(plan.sweeps())} runs, the finest is {_text(plan.reference)}")
    solver = _Solver(case, analysis, comm, console, study, options.repeats)
    numbers = {settings: k for k, settings in enumerate(dict.fromkeys(settings for _, settings in plan.sweeps()))}
    study.run(
        lambda settings: folder.solved(numbers[settings], Outcome, lambda: solver.solve(settings)),
        lambda sweep, settings: console.line(_progress(study, sweep, settings)),
    )
    tables = {"study": study.table(), "calibration": study.calibration()}
    if not tables["study"]:
        raise _no_reference(study)
    folder.finish(lambda path: publish(path, tables, markdown(tables["study"], _notes(study)), console))
    return EXIT_DONE


class _Solver:
    """Solves the whole branch of one analysis at any settings."""

    def __init__(
        self, case: Case, analysis: ModeAnalysis, comm: MPI.Comm, console: Console, study: Study, repeats: int
    ):
        self.case, self.analysis, self.comm, self.console = case, analysis, comm, console
        self.study, self.repeats = study, repeats
        self._parts: tuple[int | None, AnalysisContext[ModeAnalysis], Start] | None = None

    def _model(self, component_modes: int | None) -> tuple[AnalysisContext[ModeAnalysis], Start]:
        """Context and start with this many component modes; the last one is kept. Collective."""
        if self._parts is None or self._parts[0] != component_modes:
            if self._parts is not None:
                self._parts[1].model.destroy()
            case = on_wheel(reduce_case(self.case, self.comm, component_modes), self.analysis)
            preload, diameters = case.preload_of(self.analysis), nodal_diameter(self.analysis)
            model = build_model(case, self.analysis.dampers, self.comm, preload, diameters, self.analysis.aerodynamics)
            context = AnalysisContext(model, case, self.analysis, self.comm, Path(), self.console)
            self._parts = (component_modes, context, start_of(context))
        return self._parts[1:]

    def solve(self, settings: Settings) -> Outcome | str:
        """The branch's values at the study's amplitudes, or why it has none. Collective."""
        tried = [self._once(settings)]
        while len(tried) < self.repeats and not isinstance(tried[0], str):
            tried.append(self._once(settings))
        first = tried[0]
        if isinstance(first, str):
            return first
        return replace(first, wall_s=min(run.wall_s for run in tried if isinstance(run, Outcome)))

    def _once(self, settings: Settings) -> Outcome | str:
        from ..hb.problems import NonlinearMode

        analysis = self.analysis
        context, start = self._model(settings.component_modes)
        asked = settings.accuracy is not None
        least = (LEAST_HARMONICS, LEAST_SAMPLES) if asked else (settings.harmonics, settings.samples)
        harmonics = retained(context, *least)
        options = AnalysisOptions("study_", [analysis.petsc, f"-snes_atol {settings.tolerance!r}"])
        with options.inserted(), solver_room(context.case, analysis, "study_"):
            problem = NonlinearMode(
                context.model,
                harmonics,
                method=analysis.method,
                dof=start.dof,
                start=start.mode,
                prefix="study_",
                avoid=start.avoid,
                rest=start.rest,
            )
            try:
                return self._follow(problem, settings.accuracy)
            finally:
                problem.destroy()

    def _follow(self, problem: NonlinearMode, accuracy: float | None) -> Outcome | str:
        """Only the time spent between points counts: diagnostics are not part of the solution.

        Estimates of errors are, where harmonics and samples follow from them.
        """
        from ..solve.continuation import Continuation
        from ..solve.refining import RefiningContinuation

        low, high = self.analysis.amplitude
        rows, newton, wall = [], 0, 0.0
        began = time.perf_counter()
        settings: dict[str, Any] = {"stop": (low, high), "steps": step_control(self.analysis.step)}
        settings["report_at"] = [float(a) for a in self.study.amplitudes]
        if accuracy is None:
            branch = Continuation(problem, problem.initial(low), **settings)
        else:
            branch = RefiningContinuation(problem, problem.initial(low), **settings, accuracy=accuracy)
        for point in branch:
            wall += time.perf_counter() - began
            newton += point.newton
            rows.append(_row(branch.problem, point))
            began = time.perf_counter()
        converged, reason = branch.converged, branch.reason
        branch.destroy()
        return _outcome(rows, newton, wall) if converged else str(reason)


def _row(problem: HarmonicProblem, point: Point) -> dict[str, Any]:
    state = problem.state(point.y)
    reported = "report" in point.event
    found = point.errors or problem.errors(point.y, point.tangent if reported else None)
    estimate = [found[f"lambda_error_{source}"] for source in SOURCES]
    sizes = {"harmonics": problem.harmonics.orders[-1], "samples": problem.harmonics.samples}
    own = {"estimate": estimate, "reported": reported}
    return {**{key: state[key] for key in ("amplitude", "omega", "zeta")}, **sizes, **own}


def _outcome(rows: list[dict[str, Any]], newton: int, wall: float) -> Outcome:
    reported = [row for row in rows if row["reported"]]
    top = max(rows, key=lambda row: float(row["zeta"]))
    amplitude, omega, zeta, estimate = (
        np.array([row[key] for row in reported]) for key in ("amplitude", "omega", "zeta", "estimate")
    )
    most = {key: int(max(row[key] for row in rows)) for key in ("harmonics", "samples")}
    return Outcome(amplitude, omega, zeta, estimate, top["zeta"], top["amplitude"], len(rows), newton, wall, **most)


def _notes(study: Study) -> list[str]:
    notes = [f"Compared at {len(study.compared)} of {len(study.amplitudes)} amplitudes."]
    if len(study.left_out):
        places = ", ".join(f"{a:.4g}" for a in study.left_out)
        notes.append(f"Left out, because some run has no or several solutions there: {places}.")
    notes += [f"No whole branch with {_text(settings)}: {reason}." for settings, reason in study.failures.items()]
    return notes


def _progress(study: Study, sweep: str, settings: Settings) -> str:
    run = study.outcomes.get(settings)
    if run is None:
        return f"{sweep}: {_text(settings)}: {study.failures[settings]}"
    cost = f"{run.points} points, {run.newton} Newton iterations, {run.wall_s:.3f} s"
    return f"{sweep}: {_text(settings)}: {cost}, peak zeta {100 * run.peak_zeta:.4f} % at {run.peak_amplitude:.4g}"


def _text(settings: Settings) -> str:
    modes = "" if settings.component_modes is None else f", {settings.component_modes} component modes"
    if settings.accuracy is not None:
        return f"accuracy {settings.accuracy:.0e}, tolerance {settings.tolerance:.0e}{modes}"
    return f"H = {settings.harmonics}, N_t = {settings.samples}, tolerance {settings.tolerance:.0e}{modes}"


def _no_reference(study: Study) -> NotConverged:
    finest = study.plan.reference
    return NotConverged(
        "the finest run of the study found no whole branch, so there is nothing to measure errors against",
        where=_text(finest),
        measured=study.failures.get(finest, "not run: fewer than two samples per period of the highest harmonic"),
        fix="choose a less strict finest setting, for example --tolerance 1e-4,1e-8",
    )


def _analysis(case: Case, name: str | None) -> ModeAnalysis:
    modes = case.analyses.of(ModeAnalysis)
    chosen = name or next(iter(modes), None)
    if chosen not in modes:
        fix = f"--analysis {next(iter(modes))}" if modes else "add an [[analysis]] of type mode to the case"
        raise InputError("a study needs a mode analysis", "--analysis", name, ", ".join(modes) or None, fix)
    return modes[str(chosen)]


def _plan(case: Case, options: argparse.Namespace) -> Plan:
    """Sweeps of the command line, else of the case's table [study], else the defaults."""
    plan = Plan()
    for name in ("harmonics", "samples", "tolerance", "component_modes", "accuracy"):
        values = getattr(options, name) or getattr(case.study, name)
        if name == "component_modes" and values and case.reduction is None:
            raise InputError(
                "the case is not reduced: there are no component modes to sweep",
                "study.component_modes",
                expected="a table [reduction]",
                fix="add [reduction], or leave component_modes out",
            )
        plan = replace(plan, **{name: tuple(values)}) if values else plan
    return plan
