"""``type = "mode"``: a nonlinear mode over its amplitude, with folds and limit cycles."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, Literal, Optional, cast

from ..case.analysis import register_analysis
from ..case.checks_wheel import check_needs_wheel
from ..case.fields import Positive, Size, key
from ..case.harmonic import HarmonicSection, check_range
from ..case.observed import Observed, check_observed, dof_of, dofs_of, label_of, unit_of
from ..columns import ENERGY, MODE
from ..errors import InputError
from ..model.python_law import PythonLaw
from ..post.limit_cycles import limit_cycles, place, stability
from ..post.mode_curve import most_damped, varies, without_rounding
from ..results.results import AnalysisWriter
from ..results.sweep_summary import MODE_BRANCH
from ..texts import counted
from .parts.asymptotes import asymptote_line
from .parts.at_rest import mode_at_rest
from .parts.branch import (
    closure_note,
    continuation,
    error_text,
    finished_table,
    largest_error,
    mode_problem,
    notable,
    open_branch,
    points_of,
    record,
    suspected,
    tell,
)
from .parts.context import AnalysisContext, Outcome
from .parts.observed import keep_row, named
from .parts.others import fed_beside, in_other_waves, with_others
from .parts.rest import keep_pairs, retained
from .parts.wheel_guess import from_one_sector
from .parts.wheel_shape import WHEEL, WheelShape, finish_wheel, nearly_tuned, one_by_one
from .parts.wheel_start import Start, start_of, uneven_samples

if TYPE_CHECKING:
    from petsc4py import PETSc

    from ..case.facts import Facts
    from ..case.reporter import Reporter
    from ..hb.nonlinear_mode import NonlinearMode
    from ..solve.continuation import Continuation
    from ..solve.point import Point
    from ..units import UnitSystem
    from .parts.branch import Describe


@register_analysis
class ModeAnalysis(HarmonicSection):
    """``type = "mode"``: a nonlinear mode over its amplitude."""

    pictures = ("backbone", "phase_planes", "loops", "faces", "wheel")
    summary = MODE_BRANCH
    shown_where_kept = True

    type: Literal["mode"]
    method: Literal["CNM", "EPMC"] = key(
        "complex nonlinear mode (decaying) or extended periodic motion", example='"CNM"', default="CNM"
    )
    wave: Literal["travelling", "standing"] = key(
        "of a tuned wheel: a wave that runs around, or one that stands with its crest at `sector`",
        example='"standing"',
        default="travelling",
    )
    normalise: Observed = key(
        "dof whose fundamental harmonic is the modal amplitude; or weighted dofs, or a linear mode's coordinate",
        example='"m1"',
    )
    amplitude: list[Size] = key(
        "first and last modal amplitude", "length, or sqrt(mass) length", "[0.02, 3.0]", min_length=2, max_length=2
    )
    report_at: list[Positive] = key(
        "amplitudes at which the motion of a period is kept",
        "length, or sqrt(mass) length",
        "[0.1, 0.5]",
        default_factory=list,
    )

    def kept_dofs(self) -> list[str]:
        return [*super().kept_dofs(), *dofs_of(self.normalise)]

    def observed(self) -> tuple[str, Observed]:
        return "normalise", self.normalise

    def largest_amplitude(self) -> Optional[float]:
        return self.amplitude[1] if unit_of(self.normalise) == "length" else None

    def passes(self, amplitude: float) -> bool:
        return not self.wheel and self.amplitude[0] <= amplitude <= self.amplitude[1]

    def check(self, report: Reporter, facts: Facts) -> None:
        super().check(report, facts)
        check_observed(report, "normalise", self.normalise, self, facts)
        check_range(report, "amplitude", self.amplitude, self.report_at)
        if self.wave == "standing" and facts.model_known:
            check_needs_wheel(report, self, "wave")
            if facts.sectors is not None:
                self._check_standing(report, facts.sectors)

    def _check_standing(self, report: Reporter, sectors: int) -> None:
        diameters = self.nodal_diameter
        if self.mistuning is not None:
            fix = "remove it: the deviations decide how a mode stands"
            report.wrong(("wave",), "is of a tuned wheel", "no `wave` beside `mistuning`", fix)
        elif diameters is not None and not 0 < 2 * diameters < sectors:
            still = 2 * diameters % sectors == 0
            fix = "remove the key: this wave stands still" if still else "give the diameters a plus"
            what, expected = f"cannot be told apart at nodal_diameter = {diameters}", f"1 to {(sectors - 1) // 2}"
            report.wrong(("wave",), what, expected, fix)

    def headline(self) -> str:
        low, high = self.amplitude
        start = f"nonlinear mode ({self.method}) from linear mode {self.linear_mode}"
        return f"{start}, a = {low:g} to {high:g} {self.units(unit_of(self.normalise))} of {label_of(self.normalise)}"

    def wave_word(self) -> str:
        return "standing wave" if self.wave == "standing" else "wave"

    def at_rest(self, context: AnalysisContext[ModeAnalysis]) -> tuple[list[str], list[InputError]]:
        return mode_at_rest(context)

    def run(self, context: AnalysisContext[ModeAnalysis]) -> Outcome:
        """Continue the mode from its first to its last amplitude. Collective."""
        start = start_of(context)
        context.console.line(asymptote_line(context.name, start.mode.omega, start.asymptotes))
        harmonics = retained(context)
        context.leave_out([*harmonics.left_out, *in_other_waves(self, "limit cycles")])
        if start.avoid is not None:
            note = uneven_samples(harmonics.samples, context.wheel.sectors, self.nodal_diameter or 0)
            if note is not None and any(isinstance(contact.law, PythonLaw) for contact in context.model.contacts):
                context.console.line(f"note: {context.name}: {note}")
        problem = mode_problem(context, harmonics, start.mode, start.rest, start.dof, start.avoid)
        writer = context.writer(
            self.columns_of(
                [*named(MODE[:-1], self.normalise), ENERGY, *(WHEEL if context.case.wheel else ()), MODE[-1]]
            ),
            labels=harmonics.labels,
            samples=harmonics.samples,
            stuck_omega=start.mode.omega,
            **start.asymptotes,
            **start.attributes,
        )
        try:
            return _follow(context, problem, writer, start)
        finally:
            writer.abandon()
            problem.destroy()


def _follow(
    context: AnalysisContext[ModeAnalysis], problem: NonlinearMode, writer: AnalysisWriter, start: Start
) -> Outcome:
    analysis = context.analysis
    low, high = analysis.amplitude
    units, unit = context.units, context.units(unit_of(analysis.normalise))
    reduction = context.case.reduction
    estimated = context.case.unreduced is not None and context.case.wheel is None
    error_at = reduction.error_at if reduction is not None and estimated else None
    reports = sorted({*analysis.report_at, *([] if error_at is None else [error_at])})
    snapshot, _, found = open_branch(context.comm, writer, context.resuming)
    guess = None if found else from_one_sector(context, problem, start)
    stiffness = problem.core.stiffness_scale  # of the structure: along the branch its rows may be measured in others
    branch = continuation(context, problem, (low, high), reports, snapshot, found, guess=guess)
    around = None
    if context.case.wheel is not None:
        tuned = start.attributes["tuned_amplitude"]
        around = WheelShape(context, dof_of(analysis.normalise), tuned, start.mode).row
    with context.console.progress(context.name):
        for point in points_of(branch):
            described = partial(_described, around)
            now = cast("NonlinearMode", branch.problem)
            row = record(writer, now, point, branch.snapshot(), {}, described, context.analysis.errors)
            if error_at is not None and math.isclose(row["amplitude"], error_at, rel_tol=1e-9):
                context.console.line(_reduction_error(context, now, point, row))
            share = math.log(row["amplitude"] / low) / math.log(high / low)
            context.console.point(
                point_line(context.name, row, units, unit),
                _short(row, unit),
                share,
                notable(row, units),
            )
    tell(context, branch)
    outcome = _finish(context, writer, branch, start, problem)
    if not branch.converged:
        outcome.reason += suspected(branch, stiffness, units)
    outcome.goal = f"amplitude {high:g} {unit}"
    branch.destroy()
    return outcome


def _described(around: Optional[Describe], problem: NonlinearMode, y: PETSc.Vec) -> dict[str, Any]:
    """Further columns of a point. Collective."""
    from ..hb.observer import mechanical_energy

    more = {} if around is None else around(problem, y)
    return {"energy": mechanical_energy(problem, y), **more}


def _reduction_error(
    context: AnalysisContext[ModeAnalysis], problem: NonlinearMode, point: Point, row: dict[str, Any]
) -> str:
    """What the unreduced model would change at this point, for the log and run.json. Collective."""
    from ..case.reduce import nonlinear_error_at

    error = nonlinear_error_at(context.case, context.analysis, problem, point.y)
    context.entry["reduction_error"] = {"amplitude": row["amplitude"], **dataclasses.asdict(error)}
    place = f"{row['amplitude']:.4g} {context.units(unit_of(context.analysis.normalise))}"
    return (
        f"{context.name}: at {place} the unreduced model would change omega by"
        f" {error.omega / row['omega']:+.1e} of itself and zeta by {100 * error.zeta:+.1e} %"
        f" (estimated, {error.wall_s:.1f} s)"
    )


def _finish(
    context: AnalysisContext[ModeAnalysis],
    writer: AnalysisWriter,
    branch: Continuation,
    start: Start,
    problem: NonlinearMode,
) -> Outcome:
    table = finished_table(writer)
    first = complex(-table["beta"][0], table["omega"][0]) if table else 0j
    cycles, first = context.comm.bcast((limit_cycles(table) if table else [], first))
    cycles = with_others(lambda: fed_beside(context, start, first), cycles)
    unit = context.units(unit_of(context.analysis.normalise))
    summary = summarise(context.name, table, cycles, unit) if table else []
    summary += finish_wheel(context, writer, start) if context.case.wheel is not None else []
    context.console.detail(f"{context.name}: linear systems: {branch.route}")
    if table:
        keep_pairs(context, writer)
        keep_row(context, writer, context.analysis.normalise, problem.row)
    writer.close("done" if branch.converged else "stopped", branch.reason, events=json.dumps(cycles))
    advice = ""
    if context.case.wheel is not None and not branch.converged:
        folded = one_by_one(table, context.units("length")) if table else ""
        advice = folded or nearly_tuned(context.wheel.deviations)
    return Outcome(writer.rows, branch.reason, branch.converged, summary, advice=advice)


def point_line(name: str, row: dict[str, Any], units: UnitSystem, unit: str) -> str:
    """One plain line of progress."""
    return (
        f"{name} {row['point']:4d}  a {row['amplitude']:9.4g} {unit}  f {row['frequency_hz']:9.5g} Hz"
        f"  stick {100 * row['stick']:3.0f} %  zeta {_percent(row['zeta'], 4):>8} %"
        f"{error_text(100 * row['zeta_error'])}  newton {row['newton']:2d}  {row['wall_s']:.3f} s"
        + ("  overdamped" if abs(row["zeta"]) >= 1 else "")
        + (f"  {row['event'].replace('_', ' ')}" if row["event"] else "")
        + closure_note(row, units)
    )


def _short(row: dict[str, Any], unit: str) -> str:
    text = f"point {row['point']}: a {row['amplitude']:.4g} {unit}, {row['frequency_hz']:.5g} Hz"
    return f"{text}, zeta {_percent(row['zeta'], 3)} %"


def _percent(value: float, digits: int) -> str:
    """A share in percent; rounding leaves no negative zero."""
    return f"{round(100 * value, digits) + 0.0:.{digits}f}"


def summarise(name: str, table: Mapping[str, Any], cycles: Sequence[Mapping[str, Any]], unit: str) -> list[str]:
    """The branch in a line, and a line for each limit cycle."""
    amplitude, zeta = table["amplitude"], table["zeta"]
    top, changes = most_damped(zeta), varies(table)
    folds = sum("fold" in event.split() for event in table["event"])
    lines = [
        f"{name}: {len(zeta)} points, a {min(amplitude):.4g} to {max(amplitude):.4g} {unit},"
        f" {'largest ' * changes}damping {100 * without_rounding(zeta[top]):.4g} %"
        f" {f'at a = {amplitude[top]:.4g} {unit}' if changes else 'throughout'},"
        f" {counted(folds, 'fold')},"
        f"{largest_error('zeta', table, 'zeta_error', '%', 100)} {table['wall_s'].sum():.2f} s"
    ]
    return lines + [f"{name}: limit cycle at {place(cycle, unit)}: {stability(cycle)}" for cycle in cycles]
