"""``fretwave sweep``: a case for every value of some keys, in one folder with one result."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..case.load import changed_keys
from ..console import Console, Shown
from ..errors import EXIT_DONE, FretwaveError, InputError, NotConverged
from ..files.csv_table import write_rows
from ..mpi import groups
from ..mpi.guard import on_first_rank
from ..mpi.interrupt import say_how_to_go_on
from ..post.grid import Plan
from ..results.file import OVERRIDES
from ..results.runfolder import CASE_COPY, RunFolder, new_record, peak_memory_mb, read_copy, results_folder
from ..results.sweeps import key_headings, summary_columns, summary_lines, system_of, write_sweep
from ..run.order import RunOptions
from ..run.pictures import plot
from ..run.runner import Runner
from ..run.sweep import NAMED, Checked, Sweep, reasons_text, why_branches_stopped, why_stopped
from ..texts import counted, display

if TYPE_CHECKING:
    from mpi4py import MPI


def sweep_case(path: Path, options: RunOptions, plan: Plan, n_groups: int | None, comm: MPI.Comm) -> int:
    """``fretwave sweep``: run a case for every value from the start; returns the exit code. Collective.

    Raises
    ------
    CaseErrors
        A value does not fit the case; nothing has run then.
    NotConverged
        Not all values came to their end; the others are kept.
    """
    sweep = Sweep(Runner, path, plan, options, Path(), n_groups)
    checked = sweep.check(comm)
    first = checked[0]
    folder = results_folder(options.out, f"{first.name}_sweep", comm)
    sweep.folder = folder / "values"
    told = {key: getattr(options, key) for key in ("overrides", "quick", "only", "petsc")}
    given = {"path": str(path.resolve()), **told, "digest": first.digest, "resolved": first.resolved}
    if first.plugins:
        given["plugins"] = [plugin.plain() for plugin in first.plugins]
    record = comm.bcast(new_record(given, comm.size) if comm.rank == 0 else None)
    digests = [one.digest for one in checked]
    record["sweep"] = {"over": dict(plan.over), "groups": n_groups, "digests": digests}
    return _run_sweep(sweep, first, RunFolder(folder, record, first.text, comm.rank == 0, force=options.force), comm)


def resume_sweep(
    folder: Path, record: dict[str, Any], comm: MPI.Comm, plots: bool = True, shown: Shown = Shown.SHORT
) -> int:
    """Go on with the values of a sweep that are not done; returns the exit code. Collective.

    Raises
    ------
    InputError
        The case has changed since.
    """
    given, asked = record["case"], record["sweep"]
    options = RunOptions.of_record(folder, record, plots, shown)
    path = Path(given["path"])
    text = on_first_rank(comm, lambda: None if path.exists() else read_copy(folder, record))
    sweep = Sweep(Runner, path, Plan(asked["over"]), options, folder / "values", asked["groups"], text)
    if asked["groups"] is not None:
        sweep.n_groups = min(asked["groups"], comm.size)
    checked = sweep.check(comm)
    if [one.digest for one in checked] != asked["digests"]:
        changed = changed_keys(given["resolved"], checked[0].resolved)
        raise InputError(
            "the case has changed since this sweep",
            where=display(path),
            measured="; ".join(changed[:5]) or "values after the first",
            expected=f"the case as kept in {display(folder / CASE_COPY)}",
            fix=f"change it back, or start anew with `fretwave sweep {display(path)} --out {display(folder)}`",
        )
    record["ranks"], record["status"] = comm.size, "running"
    return _run_sweep(sweep, checked[0], RunFolder(folder, record, checked[0].text, comm.rank == 0, True), comm)


def _run_sweep(sweep: Sweep, first: Checked, folder: RunFolder, comm: MPI.Comm) -> int:
    """Run, put together, draw, and say what did not come to its end."""
    console = Console(comm.rank == 0, folder.log, shown=sweep.options.shown)
    on_first_rank(comm, folder.check_free)
    folder.record["selected"] = first.analyses
    console.line(f"{first.name}{': ' * bool(first.title)}{first.title}")
    try:
        return _do_sweep(sweep, first, folder, console, comm)
    finally:
        folder.leave()


def _do_sweep(sweep: Sweep, first: Checked, folder: RunFolder, console: Console, comm: MPI.Comm) -> int:
    began = time.perf_counter()
    count = groups.group_count(comm.size, len(sweep.plan), sweep.n_groups)
    ranks = f"{counted(comm.size, 'rank')} in {counted(count, 'group')}"
    over = f"{counted(len(sweep.plan), 'value')} of {' x '.join(sweep.plan.keys)}"
    console.line(f"sweep of {', '.join(first.analyses)}, {over}, {ranks}, results in {display(folder.path)}")
    on_first_rank(comm, folder.start)
    say_how_to_go_on(comm, folder.path)
    errors = sweep.run(comm, folder.record["run_id"])
    memory = peak_memory_mb(comm)
    outcomes, lines = on_first_rank(comm, lambda: _write(sweep, first, folder, errors))
    _, of_options = on_first_rank(comm, lambda: sweep.unread(folder.record["run_id"], lead="note: "))
    for line in [*lines, *of_options]:
        console.line(line)
    bad = why_stopped(outcomes)
    status = {"status": "stopped" if bad else "done", "wall_s": round(time.perf_counter() - began, 3)}
    folder.record.update({**status, "peak_memory_mb": memory, "values": outcomes})
    if sweep.options.plots:
        on_first_rank(comm, lambda: plot(folder.path, console))
    on_first_rank(comm, folder.close)
    if bad:
        raise _incomplete(sweep, outcomes, bad, errors)
    return EXIT_DONE


def _write(
    sweep: Sweep, first: Checked, folder: RunFolder, errors: Sequence[FretwaveError | None]
) -> tuple[list[dict[str, Any]], list[str]]:
    """One group, one table for each analysis, one summary of all; lines to print. One rank only."""
    run_id = folder.record["run_id"]
    outcomes, summary, lines, keys = sweep.outcomes(run_id, errors), [], list[str](), dict[str, str]()
    for name in first.analyses:
        branches, rows = sweep.branches(name, run_id), list[dict[str, Any]]()
        if branches:
            reason = reasons_text(sweep.plan, why_branches_stopped(outcomes, branches))
            attributes = {"run_id": run_id, "status": "stopped" if reason else "done", "reason": reason}
            attributes[OVERRIDES] = sweep.options.changing(name, first.analyses)
            rows = write_sweep(folder.path, name, name, sweep.plan, branches, attributes, first.title)
            columns = summary_columns(str(branches[0].attributes["type"]), branches, rows)
            headings = {column.name: column.heading for column in columns}  # their units may differ by analysis
            keys = key_headings(sweep.plan, system_of(branches))
            headings |= keys
            summary += [{"analysis": name, **{headings.get(key, key): row[key] for key in row}} for row in rows]
        lines += summary_lines(name, sweep.plan, branches, rows)
    if summary:
        lead = [*keys.values(), "value", "analysis"]
        ordered = [{key: row[key] for key in (*lead, *(k for k in row if k not in lead))} for row in summary]
        write_rows(folder.path / "summary.csv", ordered)
    sweep.forget_others()
    return outcomes, [*lines, *sweep.grew(run_id)]


def _incomplete(
    sweep: Sweep, outcomes: Sequence[dict[str, Any]], why: Mapping[int, str], errors: Sequence[FretwaveError | None]
) -> FretwaveError:
    """Which values did not come to their end; bad input when that is what stopped all of them."""
    reasons, bad = reasons_text(sweep.plan, why), [*why]
    given = [errors[number] for number in bad if errors[number] is not None]
    fix = next((error.fix for error in given if error is not None and error.fix), None)
    kind = InputError if given and all(isinstance(error, InputError) for error in given) else NotConverged
    where = ", ".join([*(outcomes[number]["folder"] for number in bad[:NAMED]), *(["..."] if bad[NAMED:] else [])])
    return kind(
        f"{len(bad)} of {len(outcomes)} values did not come to their end; what was found is kept",
        where,
        reasons,
        None,
        fix,
    )
