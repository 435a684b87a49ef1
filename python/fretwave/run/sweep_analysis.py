"""``type = "sweep"``: another analysis for every value of some keys, on groups of ranks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..analyses.parts.context import Outcome
from ..analyses.sweep import SweepAnalysis
from ..case.load import Case
from ..case.toml.source import Source
from ..console import Console
from ..mpi.guard import on_first_rank
from ..results.file import OVERRIDES
from ..results.runfolder import RunFolder
from ..results.sweeps import summary_lines, write_sweep
from ..texts import counted
from .order import RunOptions, reads
from .sweep import Sweep, reasons_text, why_stopped
from .sweep_plan import table_overrides

if TYPE_CHECKING:
    from mpi4py import MPI


def analysis_sweep(
    runner: Callable[..., Any], case: Case, analysis: SweepAnalysis, options: RunOptions, ranks: int = 1
) -> Sweep:
    """The sweep that an analysis of a case asks for, each value run by `runner`.

    On fewer ranks than groups each rank is a group.
    """
    wanted: list[str] = []

    def want(name: str) -> None:
        for needed in reads(case.analyses[name]):
            want(needed)
        wanted.append(name)

    want(analysis.of)
    petsc = f"{options.petsc} {analysis.petsc}".strip()
    own = table_overrides(analysis.overrides)
    chosen = replace(options, only=list(dict.fromkeys(wanted)), petsc=petsc, overrides=[*options.overrides, *own])
    over, overrides = (place_of(case, analysis.name, key) for key in ("over", "overrides"))
    plan, places = analysis.plan(), dict.fromkeys(own, overrides)
    count = None if analysis.groups is None else min(analysis.groups, ranks)
    return Sweep(runner, case.path, plan, chosen, Path(), count, case.text, over, places)


def checked_sweeps(
    runner: Callable[..., Any], case: Case, names: Sequence[str], options: RunOptions, comm: MPI.Comm
) -> dict[str, Sweep]:
    """The sweeps among some analyses, after the case was loaded with each of their values. Collective."""
    sweeps: dict[str, Sweep] = {}
    for name, analysis in case.analyses.of(SweepAnalysis).items():
        if name in names:
            sweeps[name] = analysis_sweep(runner, case, analysis, options, comm.size)
            sweeps[name].check(comm)
    return sweeps


def place_of(case: Case, name: str, key: str) -> str:
    """``file:line`` of a key of an analysis."""
    return Source(case.path, case.text).where(("analysis", list(case.analyses).index(name), key))


def run_sweep(sweep: Sweep, name: str, comm: MPI.Comm, console: Console, folder: RunFolder, title: str = "") -> Outcome:
    """Run every value and write the results of all in one group and two tables. Collective."""
    run_id, of = folder.record["run_id"], sweep.options.only[-1]
    sweep.folder = folder.path / name
    console.line(f"{name}: '{of}' with {counted(len(sweep.plan), 'value')} of {', '.join(sweep.plan.keys)}")
    errors = sweep.run(comm, run_id)

    def finish() -> Outcome:
        outcomes, branches = sweep.outcomes(run_id, errors), sweep.branches(of, run_id)
        bad, rows = why_stopped(outcomes), list[dict[str, Any]]()
        reason = reasons_text(sweep.plan, bad) or "all values done"
        if branches:
            attributes = {"run_id": run_id, "status": "stopped" if bad else "done", "reason": reason}
            typed = replace(sweep.options, overrides=[o for o in sweep.options.overrides if o not in sweep.places])
            attributes[OVERRIDES] = typed.changing(of, typed.only)
            summary = folder.path / f"{name}_summary.csv"
            rows = write_sweep(folder.path, name, of, sweep.plan, branches, attributes, title, summary)
        sweep.forget_others()
        lines = [*summary_lines(name, sweep.plan, branches, rows), *(f"{name}: {one}" for one in sweep.grew(run_id))]
        points = sum(branch.points for branch in branches)
        advice = next((error.fix for error in errors if error is not None and error.fix), "")
        return Outcome(points, reason, not bad, lines, f"{len(sweep.plan)} whole branches", advice)

    return on_first_rank(comm, finish)
