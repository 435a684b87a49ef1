"""``fretwave check``: is the case right, and what would run?"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from ..case import checks
from ..case.build import build_model
from ..case.damping import damping_line
from ..case.load import Case, load_case
from ..case.ratios import odd_ratios
from ..case.reduce import reduce_case
from ..errors import EXIT_DONE, CaseErrors, FretwaveError, NotConverged
from ..model.contact import span
from ..mpi.guard import on_first_rank
from ..run.at_rest import at_rest
from ..run.left_out import of_the_flow
from ..run.order import RunOptions, in_order
from ..run.runner import Runner
from ..run.stopped import joined
from ..run.sweep_analysis import checked_sweeps
from ..run.wide import check_in_time, run_wide
from ..texts import counted, display

if TYPE_CHECKING:
    from mpi4py import MPI

    from ..model.model import Model


def check_case(
    path: Path, overrides: Sequence[str], only: Sequence[str], quick: bool, comm: MPI.Comm, solve: bool = True
) -> int:
    """Validate a case, solve its states at rest and print what would run. Collective.

    Raises
    ------
    CaseErrors
        All that is wrong; with the short form of ``[quick]`` too, when the case has one.
    NotConverged
        Once all is printed: an analysis has no state at rest.
    """
    case = on_first_rank(comm, lambda: _load(path, overrides, quick))
    names = in_order(case, checks.choose(list(case.analyses), only))
    on_first_rank(comm, lambda: checks.check_chosen([case.analyses[name] for name in names], case))
    checked_sweeps(Runner, case, names, RunOptions(overrides=list(overrides), quick=quick), comm)
    check_in_time(case, names, run_wide(case, names))
    warnings = odd_ratios(case)
    case = reduce_case(case, comm, only=names)
    with build_model(case, (), comm) as model:
        described = {name: _described(case, name, model) for name in names}
    found = at_rest(case, names if solve else [], comm)
    for name, lines in found.lines.items():
        described[name] += lines
    if comm.rank == 0:
        print(
            "\n".join(
                [*_report(case, described), *(f"\nwarning: {warning}" for warning in [*warnings, *found.warnings])]
            )
        )
    if found.failures:
        raise _one(found.failures, case)
    return EXIT_DONE


def _described(case: Case, name: str, model: Model) -> list[str]:
    """What an analysis would compute. Collective."""
    analysis = case.analyses[name]
    left_out = [f"left out: {reason}" for reason in of_the_flow(case, analysis)]
    return [analysis.headline(), *analysis.details(model, case.preload_of(analysis) is not None), *left_out]


def _one(failures: Sequence[FretwaveError], case: Case) -> FretwaveError:
    """One message for several analyses, with the exit code that `run` has for them."""
    unsolved = [failure for failure in failures if isinstance(failure, NotConverged)]
    if len(failures) == 1:
        return failures[0]
    return joined(unsolved) if len(unsolved) == len(failures) else CaseErrors(failures, display(case.path))


def _load(path: Path, overrides: Sequence[str], quick: bool) -> Case:
    case = load_case(path, overrides, quick)
    if not quick and case.has_quick:
        load_case(path, overrides, True)
    if case.uncertainty is not None and case.uncertainty.seed is None:
        drawn = [draw.key for draw in case.uncertainty.draws]
        kept = [override for override in overrides if override.partition("=")[0].strip() not in drawn]
        load_case(path, [*kept, "uncertainty.seed=1"], quick)  # what would be drawn fits where it is put
    return case


def _report(case: Case, described: dict[str, list[str]]) -> list[str]:
    lines = [f"{display(case.path)}: no errors", case.title]
    shown = ", ".join(case.dofs[:8]) + (", ..." if len(case.dofs) > 8 else "")
    lines.append(f"  {len(case.dofs)} dofs: {shown}")
    lines.append(f"  units: {case.units.described()}")
    for contact in case.contacts:
        values = ", ".join(f"{key} = {span(value)}" for key, value in contact.parameters.items())
        lines.append(f"  contact '{contact.name}': {contact.law}, {counted(contact.n_pairs, 'contact pair')}, {values}")
    lines.extend(f"  {line}" for line in (case.reduced.lines() if case.reduced else ()))
    lines.append(f"  {damping_line(case.tables.damping)}" if case.tables.damping else "")
    lines.extend(f"  {line}" for line in case.tables.gauges.lines())
    lines.extend(f"  {line}" for line in (case.uncertainty.lines() if case.uncertainty else ()))
    lines.extend(f"  note: {note}" for note in case.notes)
    for name, texts in described.items():
        lines.append(f"  {name}: {texts[0]}")
        lines.extend(f"    {text}" for text in texts[1:])
    return [line for line in lines if line]
