"""What the continuation analyses share: rows of their tables, state, and lines of progress."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Optional, Union

import numpy as np

from ...arrays import Complex
from ...case.analysis import AnalysisSection
from ...case.analysis_tables import StepSection
from ...case.harmonic import HarmonicSection
from ...case.observed import label_of
from ...errors import InputError
from ...hb.suspects import FREE, RETURNS, TOO_SMALL, hidden, lossless, numberless, suspects, vanishing
from ...mpi.destroyable import Owned
from ...mpi.log import event
from ...mpi.spread import Spread
from ...post.contact_history import MEASURED
from ...results.results import AnalysisWriter
from ...results.slopes import slope_fields, slopes_of
from ...texts import plus_minus, times
from .observed import observed_by

if TYPE_CHECKING:
    from mpi4py import MPI
    from petsc4py import PETSc

    from ...hb.harmonic_problem import HarmonicProblem
    from ...hb.harmonics import Harmonics
    from ...hb.nonlinear_mode import NonlinearMode
    from ...hb.observed import Observed
    from ...model.modes import LinearMode
    from ...model.rest import Rest
    from ...solve.continuation import Continuation
    from ...solve.point import Point
    from ...solve.steps import StepControl
    from ...units import UnitSystem
    from ..flutter import FlutterAnalysis
    from ..mode import ModeAnalysis
    from .context import AnalysisContext

    ModeLike = Union[ModeAnalysis, FlutterAnalysis]
    #: Further columns of a point, from problem and y. Collective.
    Describe = Callable[[Any, PETSc.Vec], Mapping[str, Any]]

#: Events at which the contact's motion over a period is kept.
PLAIN_EVENTS = ("", "step")
#: A slider's distance from where it began its period is rounding below these shares of slip path and amplitude.
UNCLOSED_OF_PATH, UNCLOSED_OF_AMPLITUDE = 1e-6, 1e-12


def closure_note(row: Mapping[str, Any], units: UnitSystem) -> str:
    """What a point's line says of sliders that do not close their period; empty where they do."""
    unclosed, path = row["unclosed"], row["slip_path"]
    if not unclosed > max(UNCLOSED_OF_PATH * path, UNCLOSED_OF_AMPLITUDE * abs(row["amplitude"])):
        return ""
    share = f"{100 * unclosed / path:.2g} % of the longest slip path" if path > 0 else "no slip in the period"
    return f"  note: a slider ends {unclosed:.1e} {units('length')} from where it began ({share})"


def notable(row: Mapping[str, Any], units: UnitSystem) -> bool:
    """Whether a point's line is printed, not only kept in run.log: its ends are in the summary."""
    return row["event"] not in ("", "start", "stop") or bool(closure_note(row, units))


def error_text(error: float) -> str:
    """What a point's line says of an estimated error, in a column of its own; empty where there is none."""
    told = plus_minus(error)
    return f"{told:<11}" if told else ""


def largest_error(what: str, table: Mapping[str, Any], column: str, unit: str, scale: float = 1.0) -> str:
    """The same of a branch, and whether its reduction's share, nan where it is not known, is not in it."""
    errors = scale * table[column]
    known = np.isfinite(errors)
    if not known.any():
        return ""
    shares = [values[known] for name, values in table.items() if name.endswith("_error_reduction")]
    missing = " without the reduction's, which is not known," if np.isnan(shares).any() else ""
    return f" error of {what} up to {errors[known].max():.2g} {unit}{missing or ','}"


def suspected(branch: Continuation, stiffness: float, units: UnitSystem) -> str:
    """What may be why a branch ended before its goal, for its reason, or nothing. Collective.

    Parameters
    ----------
    stiffness : of the structure [force/length]
    """
    if FREE in branch.reason:
        return ""
    returned = RETURNS.search(branch.reason) is not None
    ask = [vanishing, hidden] if branch.reason.startswith(TOO_SMALL) else [lossless] if returned else []
    anchor = branch.anchor
    seen = "".join(one(branch.problem, anchor) for one in ask) if anchor is not None else ""
    seen += numberless(branch.problem.model)
    return seen + suspects(branch.problem.model.contacts, stiffness, units)


#: What was done when GMRES failed.
FALLBACKS = {
    "rebuilt": "preconditioner rebuilt",
    "condensed": "condensed contact system factorised",
    "whole": "whole system factorised",
}


def step_control(step: StepSection) -> StepControl:
    """The case's step control for the continuation."""
    from ...solve.steps import StepControl

    return StepControl(**step.model_dump())


@event("FwRecord")
def record(
    writer: AnalysisWriter,
    problem: HarmonicProblem,
    point: Point,
    snapshot: Mapping[str, Any] | None,
    extra: Mapping[str, Any],
    describe: Describe | None = None,
    errors: bool = True,
) -> dict[str, Any]:
    """Write one continuation point. Collective.

    Parameters
    ----------
    extra : the analysis' own part of the state to go on from
    describe : further columns from problem and y
    errors : estimate them

    Returns
    -------
    dict
        The row as written.
    """
    from ... import _core
    from ...solve.follow import row_of

    _core.fault_point("record")
    row = row_of(problem, point, writer.rows, errors)
    motions = None
    if point.event not in PLAIN_EVENTS:
        every = problem.harmonics.samples // int(writer.attributes.get("samples", problem.harmonics.samples))
        periods = [_thinned(period, every) for period in problem.contact_history(point.y)]
        names = [contact.name for contact in problem.model.contacts]
        motions = dict(zip(names, periods)) if writer.active else None
    kept = None if snapshot is None else {**snapshot, **{f"own_{key}": value for key, value in extra.items()}}
    if describe is not None:
        row.update(describe(problem, point.y))
    slopes = {}
    if point.knot is not None and problem.meaning is not None:
        writer.keep(slope_fields(problem.meaning))
        slopes = slopes_of(problem.meaning, point.knot)
    coefficients = Spread(problem.model.comm, problem.local_coefficients(point.y))
    writer.append(row, coefficients, motions, kept, slopes, problem.harmonics.labels)
    return row


def _thinned(period: Mapping[str, Any], every: int) -> dict[str, Any]:
    """Every so manieth sample alone: where a table has more samples at some points than at others."""
    return {name: values if values is None or name in MEASURED else values[::every] for name, values in period.items()}


def continuation(
    context: AnalysisContext[HarmonicSection],
    problem: HarmonicProblem,
    ends: tuple[float, float],
    report_at: Sequence[float],
    snapshot: Mapping[str, Any] | None,
    go_on: bool,
    name: str = "",
    guess: Optional[PETSc.Vec] = None,
) -> Continuation:
    """The branch of an analysis from its first end, or on from a snapshot. Collective.

    Parameters
    ----------
    name : of the branch, in the log, where an analysis has several
    guess : of its first point, if it is not the problem's own; freed
    """
    from ...solve.refining import keeping

    analysis, name = context.analysis, name or context.name
    settings: dict[str, Any] = {"stop": ends, "steps": step_control(analysis.step), "report_at": list(report_at)}
    kind, asked = keeping(analysis.accuracy)
    if go_on:
        branch = kind.restore(problem, None if snapshot is None else dict(snapshot), **settings)
    else:
        with Owned() as own:
            y0 = own(problem.initial(ends[0]) if guess is None else guess)
            branch = kind(problem, y0, **settings, **asked)
    branch.tell = lambda text: context.console.detail(f"{name}: {text}")
    return branch


def mode_problem(
    context: AnalysisContext[ModeLike],
    harmonics: Harmonics,
    mode: LinearMode,
    rest: Optional[Rest],
    dof: Optional[Observed] = None,
    avoid: Optional[Complex] = None,
) -> NonlinearMode:
    """The nonlinear mode of an analysis about its static state. Collective.

    Parameters
    ----------
    mode, rest : linear mode to start from, and static state (or None)
    dof : normalised; by default what the analysis names
    avoid : as in `fretwave.NonlinearMode`
    """
    from ...hb.nonlinear_mode import NonlinearMode

    analysis = context.analysis
    observed = observed_by(context, analysis.normalise, mode) if dof is None else dof
    try:
        return NonlinearMode(context.model, harmonics, analysis.method, observed, mode, context.prefix, avoid, rest)
    except InputError as error:  # on all ranks
        where = error.where or f"analysis '{context.name}', normalised by {label_of(analysis.normalise)}"
        raise InputError(error.what, where, error.measured, error.expected, error.fix) from None


def tell(context: AnalysisContext[HarmonicSection], branch: Continuation, name: str = "") -> None:
    """Say how a branch began, how well a resumed one meets its last point, and what it could not have. Collective.

    Kept in run.json too, under `branches`.
    """
    name = name or context.name
    lines, took = [f"started: {branch.started}"] if branch.started else [], ""
    if branch.repeated is not None:
        last = branch.repeated
        lines.append(
            f"resumed at {last.parameter:.6g}; its last point is solved again to a residual of {last.residual:.1e}"
        )
    lines += [f"missed: {text}" for text in branch.missed]
    if branch.accuracy_text:
        lines.append(branch.accuracy_text)
    if not context.analysis.errors:
        lines.append("errors are not estimated (errors = false)")
    elif branch.problem.errors_left_out:
        lines.append(f"errors are not estimated: {branch.problem.errors_left_out}")
    elif branch.problem.errors_wall_s:
        took = f"error estimates took {branch.problem.errors_wall_s:.2g} s"
        context.console.detail(f"{name}: {took}")
    for line in lines:
        context.console.line(f"{name}: {line}")
    if lines or took:
        context.entry.setdefault("branches", {})[name] = [*lines, *([took] if took else [])]
    tell_fallbacks(context, branch)


def tell_fallbacks(context: AnalysisContext[AnalysisSection], branch: Continuation) -> None:
    """One line of the log on linear solves that failed and how they were solved; counts add up in run.json."""
    found = branch.fallbacks
    counts = {key: found[key] for key in ("rebuilt", "condensed", "whole")}
    if not any(counts.values()):
        return
    kept = context.entry.setdefault("linear_fallbacks", dict.fromkeys(counts, 0))
    for key, count in counts.items():
        kept[key] += count
    text = ", ".join(f"{what} {times(counts[key])}" for key, what in FALLBACKS.items() if counts[key])
    context.console.line(f"{context.name}: GMRES failed and was helped: {text}")
    if found["said"]:
        context.console.line(f"{context.name}: {found['said']}")


def points_of(branch: Continuation) -> Iterator[Point]:
    """Points of a branch with their knots. Collective.

    Their vectors are freed a point later, for the branch may look back at its last one.
    """
    from ...solve.point import points_of
    from ...solve.trace import Trace

    trace = Trace(branch.problem)
    try:
        if branch.resumed_at is not None:
            trace.add(*branch.resumed_at)
        for point in points_of(branch):
            point.knot = trace.add(point.y, point.tangent, branch.problem)
            yield point
    finally:
        trace.close(branch.problem)


def split_state(state: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """The solver's snapshot and the analysis' own entries of a kept state."""
    plain = {key: value.item() if np.ndim(value) == 0 else value for key, value in state.items()}
    own = {key[len("own_") :]: value for key, value in plain.items() if key.startswith("own_")}
    return {key: value for key, value in plain.items() if not key.startswith("own_")}, own


def open_branch(
    comm: MPI.Comm, writer: AnalysisWriter, resuming: bool
) -> tuple[dict[str, Any] | None, dict[str, Any], bool]:
    """Snapshot (rank 0), own entries (every rank) and whether there is a state to go on from. Collective."""
    state = writer.go_on() if resuming and writer.active else None
    snapshot, own = split_state(state) if state is not None else (None, {})
    found, writer.rows, writer.reported, own = comm.bcast((state is not None, writer.rows, writer.reported, own))
    return snapshot, own, found


def finished_table(writer: AnalysisWriter) -> dict[str, Any]:
    """Columns written so far (writing rank; empty elsewhere or without rows)."""
    if not writer.active or not writer.rows:
        return {}
    with event("FwTable"):
        points = writer.group["points"]
        table = {column.name: points[column.name][()] for column in writer.columns}
    table["event"] = np.array([text.decode() for text in table["event"]])
    return table
