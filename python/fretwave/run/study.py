"""Error against run time of a mode or a forced response over harmonics, samples, tolerance, modes."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from ..analyses.forced import ForcedAnalysis
from ..analyses.mode import ModeAnalysis
from ..analyses.wear import WearAnalysis
from ..case.load import Case, load_case
from ..console import Console
from ..errors import EXIT_DONE, InputError, NotConverged
from ..mpi.guard import on_first_rank
from ..results.runfolder import read_copy
from ..results.study_report import LEGEND, LEGEND_OF_RESPONSE, PRINTED, PRINTED_OF_RESPONSE, markdown
from .stopped import advice
from .study_folder import StudyFolder, publish, say_unread
from .study_input import check_options, plan_of
from .study_plan import Settings, Study
from .study_solver import ModeSolver, ResponseSolver, Solver, Studied

if TYPE_CHECKING:
    from mpi4py import MPI


#: each branch is solved this often; its time is that of the fastest, which other work on the machine disturbs least
REPEATS = 3
#: Amplitudes or frequencies at which runs are compared, unless told otherwise.
COMPARED = 24
#: what runs are compared at
PLACES = {"amplitude": "amplitudes", "omega": "frequencies"}
PRINTED_AS = {"amplitude": (PRINTED, LEGEND), "omega": (PRINTED_OF_RESPONSE, LEGEND_OF_RESPONSE)}


def run_study(
    options: argparse.Namespace, arguments: Sequence[str], comm: MPI.Comm, record: dict[str, Any] | None = None
) -> int:
    """Run a study, or go on with it; returns the exit code. Collective."""
    case = on_first_rank(comm, lambda: _load(options, record))
    worn = options.analysis in case.analyses.of(WearAnalysis)
    check_options(options, worn)
    chosen = None if worn else _analysis(case, options.analysis)
    with StudyFolder(case, options, arguments, comm, record) as folder:
        console = Console(comm.rank == 0, folder.log, shown=options.shown)
        if chosen is not None:
            return _study_branch(case, *chosen, options, comm, console, folder)
        from .wear_study import study_wear

        return study_wear(case, options, comm, console, folder)


def _load(options: argparse.Namespace, record: dict[str, Any] | None) -> Case:
    """The case; one that is gone from its copy, as a run does."""
    gone = record is not None and not options.case.exists()
    text = read_copy(options.out, record) if gone and record is not None else None
    return load_case(options.case, options.overrides, options.quick, text=text)


def _study_branch(
    case: Case,
    kind: type[Solver[Any]],
    analysis: Studied,
    options: argparse.Namespace,
    comm: MPI.Comm,
    console: Console,
    folder: StudyFolder,
) -> int:
    plan = plan_of(case, options)
    solver = kind(case, analysis, comm, console, options.repeats, options.places)
    study = Study(plan, solver.places, solver.over)
    console.line(f"study of '{analysis.name}': {len(plan.sweeps())} runs, the finest is {_text(plan.reference)}")
    numbers = {settings: k for k, settings in enumerate(dict.fromkeys(settings for _, settings in plan.sweeps()))}
    study.run(
        lambda settings: folder.solved(numbers[settings], solver.outcome, lambda: solver.solve(settings)),
        lambda sweep, settings: console.line(_progress(study, sweep, settings)),
    )
    _check_reference(study, analysis)
    say_unread(solver.unread, case, analysis.name, folder, console)
    tables = {"study": study.table(), "calibration": study.calibration()}
    text = markdown(tables["study"], _notes(study), *PRINTED_AS[study.over])
    folder.finish(lambda path: publish(path, tables, text, console))
    return EXIT_DONE


def _notes(study: Study) -> list[str]:
    notes = [f"Compared at {len(study.compared)} of {len(study.places)} {PLACES[study.over]}."]
    if len(study.left_out):
        places = ", ".join(f"{a:.4g}" for a in study.left_out)
        notes.append(f"Left out, because some run has no or several solutions there: {places}.")
    if study.plan.impossible:
        left = ", ".join(_text(settings) for settings in study.plan.impossible)
        notes.append(f"Not run, with fewer than two samples per period of the highest harmonic: {left}.")
    notes += [f"No whole branch with {_text(settings)}: {reason}." for settings, reason in study.failures.items()]
    return notes


def _progress(study: Study, sweep: str, settings: Settings) -> str:
    run = study.outcomes.get(settings)
    if run is None:
        return f"{sweep}: {_text(settings)}: {study.failures[settings]}"
    cost = f"{run.points} points, {run.newton} Newton iterations, {run.cpu_s:.3f} s"
    return f"{sweep}: {_text(settings)}: {cost}, {run.summary}"


def _text(settings: Settings) -> str:
    modes = "" if settings.component_modes is None else f", {settings.component_modes} component modes"
    if settings.accuracy is not None:
        return f"accuracy {settings.accuracy:.0e}, tolerance {settings.tolerance:.0e}{modes}"
    return f"H = {settings.harmonics}, N_t = {settings.samples}, tolerance {settings.tolerance:.0e}{modes}"


def _check_reference(study: Study, analysis: Studied) -> None:
    """There is something to measure errors against, and it moves."""
    finest = study.plan.reference
    if finest in study.failures:
        raise NotConverged(
            "the finest run of the study found no whole branch, so there is nothing to measure errors against",
            where=_text(finest),
            measured=study.failures[finest],
            fix=what_helps(study, analysis.name),
        )
    if study.outcomes[finest].unit == 0:
        what, fix = "what is observed does not move: no error can be measured in its amplitude", "observe another dof"
        raise InputError(what, f"{analysis.name}.observe", 0.0, "an amplitude above 0", fix)


def what_helps(study: Study, name: str) -> str:
    """Against what the finest run says of itself, or a setting of it that others do without."""
    milder = [sweep.replace("_", " ") for sweep, settings in study.plan.sweeps() if settings in study.outcomes]
    told = advice(name, study.failures[study.plan.reference]).replace("--petsc ", f"--set {name}.petsc=")
    if not milder:
        return told
    return f"a milder finest {' or '.join(dict.fromkeys(milder))}, with which other runs finish; or {told}"


def _analysis(case: Case, name: str | None) -> tuple[type[Solver[Any]], Studied]:
    found: dict[str, tuple[type[Solver[Any]], Studied]] = {}
    found |= {one: (ModeSolver, mode) for one, mode in case.analyses.of(ModeAnalysis).items()}
    found |= {one: (ResponseSolver, response) for one, response in case.analyses.of(ForcedAnalysis).items()}
    chosen = name or next(iter(found), None)
    if chosen not in found:
        names = [*found, *case.analyses.of(WearAnalysis)]
        fix = f"--analysis {names[0]}" if names else "add an [[analysis]] of type mode to the case"
        what, expected = "a study needs a mode, a forced response or wear", ", ".join(names) or None
        raise InputError(what, "--analysis", name, expected, fix)
    return found[str(chosen)]
