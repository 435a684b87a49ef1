"""Run the analyses of a case: order, models, run folder, exit code."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..analyses.parts.context import AnalysisContext, Outcome, outcome_of
from ..case import checks
from ..case.analysis import AnalysisSection
from ..case.build import model_of
from ..case.kept import described, reload_case, stands_beside
from ..case.load import Case, load_case
from ..case.reduce import reduce_case
from ..case.wheel import on_wheel, solver_room
from ..console import Console, Estimate, Shown, duration
from ..errors import EXIT_DONE, NotConverged
from ..mpi.guard import on_first_rank
from ..mpi.interrupt import say_how_to_go_on
from ..mpi.log import event
from ..mpi.petsc_options import AnalysisOptions
from ..mpi.petsc_share import TIME, UNREAD, RunWide, prefix_of
from ..results.basis_file import LARGEST, NAME, basis_of
from ..results.file import OVERRIDES
from ..results.further import remove_further
from ..results.journal import Journal
from ..results.results import has_results, open_results
from ..results.runfolder import RunFolder, new_record, peak_memory_mb, results_folder
from ..texts import counted, display
from . import more_modes
from .already import check_needed, status_of, take_modes_of_others
from .left_out import left_out_lines
from .order import RunOptions, in_order
from .pictures import plot
from .stopped import joined, not_converged, without
from .unread import UnreadOptions
from .wide import check_in_time, run_wide

if TYPE_CHECKING:
    from mpi4py import MPI

    from ..cyclic.reduction import SectorReduction
    from ..model.reduction import Reduction
    from .sweep import Sweep


#: What is said of an analysis that is complete.
ENDED = ("done", "stopped")


def run_case(path: Path, options: RunOptions, comm: MPI.Comm) -> int:
    """Run a case from its start; returns the exit code. Collective."""
    from .. import _core  # noqa: F401  # PETSc starts on all ranks at once, not with what one of them does alone

    clock = Estimate()
    case = on_first_rank(comm, lambda: load_case(path, options.overrides, options.quick))
    folder = results_folder(options.out, case.name, comm)
    record = comm.bcast(new_record(options.given(path, case), comm.size) if comm.rank == 0 else None)
    return Runner(case, options, folder, record, comm, clock=clock).run()


def resume_run(folder: Path, comm: MPI.Comm, plots: bool = True, shown: Shown = Shown.SHORT) -> int:
    """Go on with a run that was cut off; returns the exit code. Collective.

    Raises
    ------
    InputError
        The folder holds no run, or its case has changed since.
    """
    from .. import _core  # noqa: F401

    clock = Estimate()
    case, record = on_first_rank(comm, lambda: reload_case(folder))
    options = RunOptions.of_record(folder, record, plots, shown)
    record["ranks"], record["status"] = comm.size, "running"
    return Runner(case, options, folder, record, comm, resuming=True, clock=clock).run()


def _nothing() -> None:
    """Nothing is to be written."""


class Runner:
    """One run of some analyses of a case; `part` when it is one of a sweep, which speaks for it.

    `clock` runs from before the case was read: builders and reductions may take most of it.
    """

    def __init__(
        self,
        case: Case,
        options: RunOptions,
        folder: Path,
        record: dict[str, Any],
        comm: MPI.Comm,
        resuming: bool = False,
        part: bool = False,
        clock: Estimate | None = None,
    ) -> None:
        self.case, self.options, self.comm, self.resuming = case, options, comm, resuming
        active = comm.rank == 0
        self.folder = RunFolder(folder, record, case.text, active, resuming, options.force)
        self.console = Console(active, self.folder.log, shown=Shown.NOTHING if part else options.shown)
        self.part, self.clock, self.wide = part, clock or Estimate(), RunWide()
        self.failures: list[NotConverged] = []
        self.unread = UnreadOptions()
        self._basis: Callable[[], None] = _nothing
        if resuming:
            on_first_rank(comm, self._check_readable)
            self._start()

    def _check_readable(self) -> None:
        """Refuse damaged results before anything in the folder is changed."""
        if has_results(self.folder.path):
            open_results(self.folder.path / "results.h5").close()

    def _start(self) -> None:
        """Collective."""
        on_first_rank(self.comm, self.folder.start)
        self.folder.started = True
        self._write_basis()
        if not self.part:
            say_how_to_go_on(self.comm, self.folder.path)

    def run(self) -> int:
        """Do all analyses, keep what was found; returns the exit code. Collective."""
        try:
            return self._run()
        finally:
            self.folder.leave()

    def _run(self) -> int:
        if not self.folder.started:
            on_first_rank(self.comm, self.folder.check_free)
        names = in_order(self.case, checks.choose(list(self.case.analyses), self.options.only))
        on_first_rank(self.comm, lambda: check_needed(self.case, names, self.folder.path, None))
        on_first_rank(self.comm, lambda: checks.check_chosen([self.case.analyses[name] for name in names], self.case))
        sweeps = self._sweeps(names)
        self.folder.record["selected"] = names
        self.wide = run_wide(self.case, names, self.options.petsc, self.unread.read)
        check_in_time(self.case, names, self.wide)
        self._greet(names)
        self._solve(names, sweeps)
        self._say_left_out(names)
        self._say_unread()
        self._finish()
        if self.failures:
            raise self.failures[0] if len(self.failures) == 1 else joined(self.failures)
        return EXIT_DONE

    def _sweeps(self, names: Sequence[str]) -> dict[str, Sweep]:
        """The sweeps among some analyses, checked with each of their values. Collective."""
        if not any(self.case.analyses[name].sweeps for name in names):
            return {}
        from .sweep_analysis import checked_sweeps

        return checked_sweeps(Runner, self.case, names, self.options, self.comm)

    def _solve(self, names: Sequence[str], sweeps: Mapping[str, Sweep]) -> None:
        """All analyses; anew, all on one basis, where one of them finds the component modes too few."""
        given, reduced, again = self.case, [name for name in names if name not in sweeps], self.resuming
        if not self.resuming:
            take_modes_of_others(given, reduced, self.folder.path, self.folder.record, self.comm)
        while True:
            try:
                self._reduce(reduced)
                return self._run_all(names, sweeps, again)
            except more_modes.TooFewModes as error:
                few = error.entry
            finally:
                if self.case.basis is not None:
                    self.case.basis.destroy()
            self.case, again = given, True
            self._forget(reduced, few)

    def _forget(self, names: Sequence[str], few: Mapping[str, Any]) -> None:
        """What was found on too few component modes is not of this run any more. Collective."""
        record = self.folder.record
        more_modes.begin_anew(record, names, few)
        self.failures.clear()
        self.unread.lines.clear()
        on_first_rank(self.comm, lambda: (self.folder.path / NAME).unlink(missing_ok=True))
        on_first_rank(self.comm, self.folder.save)
        self.console.line(f"{more_modes.line(record)}; begun anew")

    def _run_all(self, names: Sequence[str], sweeps: Mapping[str, Sweep], again: bool) -> None:
        for number, name in enumerate(names, 1):
            if again and self._is_done(name):
                continue
            if len(names) > 1:
                self.console.line(f"{name}: {number} of {len(names)} analyses")
            if name in sweeps:
                self._sweep(name, sweeps[name])
            elif (needed := self._found_nothing(self.case.analyses[name].needs())) is not None:
                self._note(name, without(name, needed), 0.0)
            else:
                self._run_one(self.case.analyses[name])

    def _found_nothing(self, names: Sequence[str]) -> str | None:
        """The first of these that this run has done and that stopped before its first point."""
        done = self.folder.record["analyses"]
        return next((name for name in names if name in done and not done[name]["points"]), None)

    def _greet(self, names: Sequence[str]) -> None:
        ranks = counted(self.comm.size, "rank")
        verb = "resumed" if self.resuming else "run"
        title = f": {self.case.title}" if self.case.title else ""
        self.console.line(f"{self.case.name}{title}")
        self.console.line(
            f"{verb} on {ranks}, {len(self.case.dofs)} dofs, results in {display(self.folder.path)}: {', '.join(names)}"
        )
        if self.case.neighbours is not None:
            self.console.line(f"one of {self.case.neighbours.sectors} sectors of a wheel")
        for note in self.case.notes:
            self.console.line(f"note: {note}")
        others = [name for name in self.case.analyses if name not in names]
        if others:
            self.console.line(f"left out by --only: {', '.join(others)}")

    def _reduce(self, names: Sequence[str]) -> None:
        """Solve on the reduced model from here on, when the case asks for one; its error is kept."""
        at = None if self.case.reduction is None else self.case.reduction.error_at
        asked = at is not None and any(self.case.analyses[name].passes(at) for name in names)
        with self.unread.steering_reduction(self.wide, self.case.reduction is not None):
            modes = more_modes.grown(self.folder.record)
            self.case = reduce_case(self.case, self.comm, modes, look=self._keep_basis, keep=asked, only=names)
        if self.case.reduced is not None:
            for line in self.case.reduced.lines():
                self.console.line(line)
            self.folder.record["reduction"] = self.case.reduced.plain()
            modes, folder = self.case.reduced.component_modes, self.folder.path
            on_first_rank(self.comm, lambda: check_needed(self.case, names, folder, modes))

    def _keep_basis(self, reduction: Reduction | SectorReduction) -> None:
        """For `fretwave view`: of a model with nodes, and not of the runs of a sweep. Collective."""
        full = self.case.structure.cut or self.case.structure
        path, size = self.folder.path / NAME, 8 * full.n_dof * reduction.size
        if self.part or full.coordinates is None or (self.resuming and on_first_rank(self.comm, path.exists)):
            return
        if size > LARGEST:
            text = f"{size / 1e6:.0f} MB, more than {LARGEST / 1e6:.0f}"
            self.console.line(f"the basis of the reduction is not kept ({text}): `fretwave view` will make it again")
            self._basis = lambda: path.unlink(missing_ok=True)  # of another run
            return
        basis = basis_of(reduction, full, self.comm, self.case.acting_loads)
        self._basis = lambda: None if basis is None else basis.write(path)
        self.console.line(f"the basis of the reduction is kept for `fretwave view` ({size / 1e6:.1f} MB)")
        if self.folder.started:
            self._write_basis()

    def _write_basis(self) -> None:
        """Collective."""
        write, self._basis = self._basis, _nothing
        on_first_rank(self.comm, write)

    def _is_done(self, name: str) -> bool:
        def look() -> str | None:
            status = status_of(name, self.folder.path, self.folder.record)
            if status in ENDED:
                Journal(self.folder.path, name).remove()  # killed when all was in results.h5 but this was left
            return status

        status, entry = on_first_rank(self.comm, look), self.folder.record["analyses"].get(name)
        if status not in ENDED or entry is None:
            return False
        status = str(entry["status"])  # that of the results says nothing of what came after the branches
        self.console.line(f"{name}: already {status}")
        if status == "stopped":
            goal, advice = (str(entry.get(key, "")) for key in ("goal", "advice"))
            outcome = Outcome(int(entry["points"]), str(entry["reason"]), False, goal=goal, advice=advice)
            self.failures.append(not_converged(name, outcome, self._has_steps(name)))
        return True

    def _has_steps(self, name: str) -> bool:
        return self.case.analyses[name].harmonic() is not None

    def _is_begun(self, name: str) -> bool:
        look = partial(status_of, name, self.folder.path, self.folder.record)
        return self.resuming and on_first_rank(self.comm, look) is not None

    def _run_one(self, analysis: AnalysisSection) -> None:
        from .. import _core

        began = time.perf_counter()
        prefix = prefix_of(analysis.name)
        options = AnalysisOptions(prefix, [analysis.petsc], self.wide)
        later = TIME if analysis.integrates() == "time_points" else ""

        def before_first() -> None:
            options.check_used(_core.unused_options, f"analysis '{analysis.name}'", later)
            self._start()
            on_first_rank(self.comm, lambda: remove_further(self.folder.path, analysis.name, self.case.analyses))

        case = on_wheel(self.case, analysis)
        beside = on_first_rank(self.comm, lambda: stands_beside(self.folder.path, self.case, analysis.name))
        built = model_of(case, analysis, self.comm)
        with built as model, options.inserted(), solver_room(case, analysis, prefix):
            context = AnalysisContext(
                model,
                case,
                analysis,
                self.comm,
                self.folder.path,
                self.console,
                resuming=self._is_begun(analysis.name),
                before_first=before_first,
                attributes={
                    **described(analysis, self.case, self.folder.record["run_id"], beside),
                    OVERRIDES: self.options.changing(analysis.name, self.case.analyses),
                },
            )
            try:
                outcome = outcome_of(analysis, analysis.run(context))
            except NotConverged as error:  # of a static state to start from, or of another analysis' branch
                reason, points = f"{error.what}: {error.measured}", context.rows
                outcome = Outcome(points, reason, False, goal=str(error.expected), advice=error.fix or "")
            unread = self.unread.of_analysis(options)
        self._enough_modes(context, outcome)
        entry = {"left_out": context.left_out, **context.entry}
        self._note(analysis.name, outcome, time.perf_counter() - began, entry)
        if unread and outcome.points:
            self.console.line(self.unread.line(analysis.name, unread))
        if outcome.points and not self.part:
            with event("FwCurve"):
                context.write_curves()
        context.publish(outcome)  # last of all: from here on a resumed run leaves the analysis as it is

    def _enough_modes(self, context: AnalysisContext[Any], outcome: Outcome) -> None:
        """Where component modes limit an analysis: begin anew on more, else say why there are no more. Collective."""
        try:
            why = more_modes.expect_enough(self.case, context.name, outcome.reason, self.folder.record)
        except more_modes.TooFewModes:
            context.forget()
            raise
        if why:
            outcome.summary.append(f"{context.name}: no more component modes are taken: {why}")
            context.entry[more_modes.KEPT] = why

    def _sweep(self, name: str, sweep: Sweep) -> None:
        """Run another analysis for every value, on groups of ranks."""
        from .sweep_analysis import run_sweep

        began = time.perf_counter()
        self._start()
        outcome = run_sweep(sweep, name, self.comm, self.console, self.folder, self.case.title)
        self._note(name, outcome, time.perf_counter() - began)
        run_id, elsewhere = self.folder.record["run_id"], dict(self.wide.pairs)
        names, lines = on_first_rank(self.comm, lambda: sweep.unread(run_id, elsewhere))
        self.unread.in_sweeps.append(names)
        for line in lines:
            self.console.line(f"{name}: {line}")

    def _note(self, name: str, outcome: Outcome, seconds: float, entry: Mapping[str, Any] | None = None) -> None:
        """Print the outcome and keep it in run.json, with what else `entry` says."""
        for line in outcome.summary:
            self.console.line(line)
        memory = peak_memory_mb(self.comm)
        of_failure = {} if outcome.converged else {"goal": outcome.goal, "advice": outcome.advice}
        self.folder.record["analyses"][name] = {
            "status": "done" if outcome.converged else "stopped",
            "reason": outcome.reason,
            "points": outcome.points,
            "wall_s": round(seconds, 3),
            "peak_memory_mb": memory,
            **of_failure,
            **(entry or {}),
        }
        on_first_rank(self.comm, self.folder.save)
        if not outcome.converged:
            self.failures.append(not_converged(name, outcome, self._has_steps(name)))

    def _say_left_out(self, names: Sequence[str]) -> None:
        if self.part:
            return
        told = left_out_lines(self.case, names, self.folder.record["analyses"], self.options.plots)
        self.folder.record["left_out"] = told
        for line in told:
            self.console.line(line)

    def _say_unread(self) -> None:
        if self.part and not self.resuming:
            self.folder.record[UNREAD] = self.unread.plain(self.wide)
        for note in self.unread.notes(self.wide, of_run=not self.part and not self.resuming):
            self.console.line(note)

    def _finish(self) -> None:
        self.folder.record["status"] = "stopped" if self.failures else "done"
        self.folder.record["peak_memory_mb"] = peak_memory_mb(self.comm)
        if self.options.plots and self.folder.started:
            on_first_rank(self.comm, lambda: plot(self.folder.path, self.console))
        if grew := more_modes.line(self.folder.record):
            self.console.line(grew)
        word, seconds = self.folder.record["status"], self.clock.passed()
        self.console.line(
            f"{word} after {duration(seconds)}; `fretwave show {display(self.folder.path)}` lists the results"
        )
        on_first_rank(self.comm, self.folder.close)
