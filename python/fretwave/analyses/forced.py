"""``type = "forced"``: frequency responses at several excitation levels, and their peaks against backbones."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Literal, Optional, Union

import numpy as np

from ..case.analysis import register_analysis
from ..case.fields import Dof, Frequency, Positive, Size, Speed, Whole, key
from ..case.harmonic import HarmonicSection, check_range
from ..case.observed import Observed, check_observed, dofs_of, given_to, label_of, unit_of
from ..case.toml.validation import at
from ..columns import FORCED
from ..cyclic.engine_order import folded
from ..errors import InputError
from ..post.motion import complex_amplitudes
from ..results.results import AnalysisWriter
from ..results.sweep_summary import FORCED_LEVELS
from ..texts import toml
from .parts.branch import (
    closure_note,
    error_text,
    finished_table,
    notable,
    open_branch,
    points_of,
    record,
    suspected,
    tell,
)
from .parts.context import AnalysisContext, Outcome
from .parts.excitation import Excitation, excitation_of, wave_of_forces
from .parts.forced_peaks import curves_of, write_peaks
from .parts.observed import keep_row, named
from .parts.others import fed_under_force, in_other_waves
from .parts.rest import keep_pairs, retained
from .parts.several import ending_of, stopped_before, with_stopped
from .parts.wheel_peaks import blade_amplitudes, blade_by_blade

if TYPE_CHECKING:
    from petsc4py import PETSc

    from ..case.facts import Facts
    from ..case.reporter import Reporter
    from ..hb.harmonic_problem import HarmonicProblem
    from ..units import UnitSystem


@register_analysis
class ForcedAnalysis(HarmonicSection):
    """``type = "forced"``: frequency responses at several excitation levels."""

    pictures = ("forced", "forced_blades")
    summary = FORCED_LEVELS

    type: Literal["forced"]
    backbone: Union[str, list[str]] = key(
        "mode analyses whose backbones the peaks are compared with",
        example='["mode"]',
        default_factory=list,
    )
    force: dict[Dof, float] = key(
        "force amplitude of each excited dof, cosine at harmonic 1, delayed from sector to sector of a wheel",
        "force",
        "{ m1 = 1.0 }",
        min_length=1,
    )
    force_rpm: Optional[Speed] = key(
        "speed at which `force` is as given: it grows with the square of [model] speed_rpm",
        "rev/min",
        "3000.0",
        default=None,
    )
    engine_order: Optional[Whole] = key(
        "order of the excitation of a wheel, in place of nodal_diameter; negative where the rotor turns with the "
        "sectors' numbers",
        example="4",
        default=None,
    )
    levels: list[Size] = key("factors on the force", "-", "[1.0, 2.0]", min_length=1)
    frequency: list[Frequency] = key(
        "first and last excitation frequency", "Hz", "[3.0, 5.0]", min_length=2, max_length=2
    )
    observe: Observed = key(
        "dof whose fundamental harmonic is reported; or weighted dofs, or a linear mode's coordinate", example='"m1"'
    )
    report_at: list[Positive] = key(
        "frequencies at which the motion of a period is kept", "Hz", "[3.9]", default_factory=list
    )
    time_points: Whole = key(
        "points of each response that are checked by time integration", example="4", default=0, ge=0
    )

    def backbones(self) -> list[str]:
        """Names of the modes that its peaks are compared with."""
        return [self.backbone] if isinstance(self.backbone, str) else list(self.backbone)

    def compares_with(self) -> list[str]:
        return self.backbones()

    def kept_dofs(self) -> list[str]:
        return [*super().kept_dofs(), *dofs_of(self.observe), *self.force]

    def up_to_hz(self) -> float:
        return self.frequency[1]

    def observed(self) -> tuple[str, Observed]:
        return "observe", self.observe

    def integrates(self) -> str:
        return "time_points" if self.time_points > 0 else ""

    def completed(self, report: Reporter, facts: Facts) -> ForcedAnalysis:
        """With the nodal diameter of the wave that an engine order drives on so many sectors."""
        order, given, sectors = self.engine_order, self.nodal_diameter, facts.sectors
        if not facts.model_known:
            return self
        if order is None:
            if sectors is not None and self.mistuning is not None and given is None:  # it has no wave of its own
                fix = "add for example `engine_order = 4`"
                report.wrong(("engine_order",), "is missing", "the order of the excitation, or nodal_diameter", fix)
            return self
        if sectors is None:
            report.wrong(("engine_order",), "is of no sector of a wheel", "a model with sectors", "remove the key")
        elif order == 0:
            report.wrong(("engine_order",), "is steady", "1 or more, or -1 or less", "take a mean load to [preload]")
        elif given is not None and given % sectors != order % sectors:
            expected = f"{folded(order, sectors)}, which engine order {order} drives on {sectors} sectors"
            report.wrong(("nodal_diameter",), "is not that of the engine order", expected, "remove nodal_diameter")
        else:
            return self.model_copy(update={"nodal_diameter": folded(order, sectors)})
        # what is wrong with the order is said: nothing of its wave beside that
        return self if sectors is None or given is not None else self.model_copy(update={"nodal_diameter": 0})

    def check(self, report: Reporter, facts: Facts) -> None:
        super().check(report, facts)
        check_range(report, "frequency", self.frequency, self.report_at)
        check_observed(report, "observe", self.observe, self, facts)
        for dof in self.force:
            report.dof(("force", dof), dof, facts.named)
        if self.force_rpm is not None and at(facts.source.data, ("model", "speed_rpm")) is None:
            fix = f"add `speed_rpm = {self.force_rpm:g}` to [model]"
            report.wrong(("force_rpm",), "is of a speed that is not given", "[model] speed_rpm", fix)
        if not any(self.force.values()):
            report.wrong(
                ("force",), "is zero", "a force amplitude other than 0", "write for example `force = { m1 = 1.0 }`"
            )
        listed, modes = isinstance(self.backbone, list), facts.analyses_of("mode")
        for index, name in enumerate(self.backbones()):
            place: tuple[Any, ...] = ("backbone", index) if listed else ("backbone",)
            report.mode(place, name, modes)
            over, own = (given_to(facts, one, key) for one, key in ((name, "normalise"), (self.name, "observe")))
            known = isinstance(over, dict) or over in (facts.named or ())
            if name in modes and known and over != own:
                what = "is over another amplitude than the peaks"
                report.wrong(place, what, f"a mode with `normalise = {toml(own)}`", f"`observe = {toml(over)}`")
            if name in modes and facts.sectors is not None and self.engine_order != 0:
                self._check_wave_of(report, place, name, facts, facts.sectors)

    def _check_wave_of(self, report: Reporter, place: tuple[Any, ...], name: str, facts: Facts, sectors: int) -> None:
        """A backbone is of the wave that the force drives; without forces of the flow it may run the other way."""
        given, mistuning, flow = (given_to(facts, name, key) for key in ("nodal_diameter", "mistuning", "aerodynamics"))
        own = self.nodal_diameter
        if own is None or mistuning or self.mistuning or not isinstance(given, str) or not given.lstrip("-").isdigit():
            return
        wave, driven = folded(int(given), sectors), folded(own, sectors)
        if wave == driven or (wave == -driven and not flow and not self.aerodynamics):
            return
        by = f", which engine order {self.engine_order} drives on {sectors} sectors" if self.engine_order else ""
        what, expected = f"is of a wave of {wave} nodal diameters", f"a mode with nodal_diameter = {driven}{by}"
        report.wrong(place, what, expected, f"write `nodal_diameter = {driven}` in '{name}', or name another mode")

    def headline(self) -> str:
        low, high = self.frequency
        levels = ", ".join(f"{level:g}" for level in self.levels)
        order = f" to engine order {self.engine_order}" if self.engine_order else ""
        return f"forced response of {label_of(self.observe)}{order}, {low:g} to {high:g} Hz, levels {levels}"

    def at_rest(self, context: AnalysisContext[ForcedAnalysis]) -> tuple[list[str], list[InputError]]:
        from .parts.response_at_rest import response_at_rest

        return response_at_rest(context)

    def run(self, context: AnalysisContext[ForcedAnalysis]) -> Outcome:
        """Follow the response of every level over the frequency range. Collective."""
        harmonics = retained(context)
        excitation = excitation_of(context, harmonics)
        left_out = [] if self.time_points else ["check by time integration (time_points = 0)"]
        context.leave_out(
            [*harmonics.left_out, *_missing_backbones(context), *left_out, *in_other_waves(self, "the responses")]
        )
        writer = context.writer(
            self.columns_of([*named(FORCED[:-1], self.observe), *excitation.columns(), FORCED[-1]]),
            labels=harmonics.labels,
            samples=harmonics.samples,
            stuck_omega=excitation.reference.omega,
            **_attributes(context),
        )
        try:
            return _all_levels(context, excitation, writer)
        finally:
            writer.abandon()


def _attributes(context: AnalysisContext[ForcedAnalysis]) -> dict[str, Any]:
    """Of the results of a wheel."""
    analysis, wheel = context.analysis, context.case.wheel
    if wheel is None:
        return {}
    observed = f"{label_of(analysis.observe)}@{analysis.sector or 0}"
    return {"observe": observed, "sectors": wheel.sectors, "sector_dofs": wheel.unit}


def _all_levels(context: AnalysisContext[ForcedAnalysis], excitation: Excitation, writer: AnalysisWriter) -> Outcome:
    from ..hb.observed import row_of

    analysis = context.analysis
    snapshot, own, found = open_branch(context.comm, writer, context.resuming)
    first = int(own.get("level_number", 0))
    stopped = stopped_before(own)
    with context.console.progress(context.name):
        for number in range(first, len(analysis.levels)):
            go_on = found and number == first
            why = _one_level(excitation, writer, number, snapshot, go_on, own.get("phase"), stopped)
            stopped.update({number: why} if why else {})
    status, reason, ended = ending_of(stopped, analysis.levels)
    table = finished_table(writer)
    wheel = context.case.wheel is not None and writer.rows > 0
    blades = blade_amplitudes(excitation, writer) if wheel and writer.active else None
    row = row_of(context.model, excitation.observed)
    if table:
        keep_pairs(context, writer)
        keep_row(context, writer, analysis.observe, row)
    writer.close(status, reason, events="[]", **ended)
    curves = curves_of(context, analysis.backbones())
    summary = (
        blade_by_blade(excitation, table, blades, curves)
        if wheel
        else write_peaks(context, table, curves, unit_of(analysis.observe))
    )
    if writer.rows:
        summary += [f"{context.name}: {text}" for text in fed_under_force(context)]
    if analysis.time_points and writer.rows:
        from .parts.forced_time import time_points

        lines, given_up = time_points(context, table, analysis.time_points, excitation.observed)
        summary += lines
        if given_up and not stopped:
            fix = f"--set {context.name}.time_points=0, or a smoother contact law"
            return Outcome(writer.rows, given_up, False, summary, "a steady motion in time", fix)
    goal = f"{analysis.frequency[1]:g} Hz at every level"
    advice = "lower levels, or damping that takes their work" if "without bound" in reason else ""
    return Outcome(writer.rows, reason, not stopped, summary, goal, advice)


def _one_level(
    excitation: Excitation,
    writer: AnalysisWriter,
    number: int,
    snapshot: Optional[dict[str, Any]],
    go_on: bool,
    phase: Optional[float],
    earlier: Mapping[int, str],
) -> str:
    """Follow one response, on from a phase if it was begun; returns why it stopped early, or nothing. Collective.

    What earlier levels stopped for is kept with its points.
    """
    context, analysis = excitation.context, excitation.analysis
    low, high = (2.0 * math.pi * hertz for hertz in analysis.frequency)
    problem, units = excitation.problem(analysis.levels[number]), context.units
    unit = units(unit_of(analysis.observe))
    branch = excitation.branch(problem, snapshot, go_on)
    excitation.phase = phase if go_on else None
    for point in points_of(branch):
        phases = {} if excitation.phase is None else {"phase": excitation.phase}
        own = with_stopped(earlier, level_number=number, **phases)
        now = branch.problem
        row = record(writer, now, point, branch.snapshot(), own, excitation.row, analysis.errors)
        share = (number + (row["omega"] - low) / (high - low)) / len(analysis.levels)
        context.console.point(
            point_line(context.name, row, units, unit),
            _short(row, unit),
            share,
            notable(row, units),
        )
    tell(context, branch, f"{context.name}: level {analysis.levels[number]:g}")
    stopped = "" if branch.converged else f"level {analysis.levels[number]:g}: {branch.reason}"
    if "without bound" in stopped:
        most = _bounded(excitation, branch.problem, branch.anchor)
        stopped += f": damping and friction take at most the work of level {most:.4g}"
    elif stopped:
        stopped += suspected(branch, problem.core.stiffness_scale, units)
    branch.destroy()
    problem.destroy()
    return stopped


def _bounded(excitation: Excitation, problem: HarmonicProblem, y: PETSc.Vec) -> float:
    """Level whose work damping and friction still take in the shape of the motion at y. Collective.

    The work that a force at level 1 does at most, at a right angle to the motion, is pi |q_1^H P| per period.
    """
    taken = problem.energy(y)
    coefficients = problem.coefficients(y)
    work = None
    if coefficients is not None:
        q = complex_amplitudes(problem.harmonics.labels, coefficients)[1]
        work = math.pi * abs(np.vdot(q, wave_of_forces(excitation.context)))
    return float((taken["contact"] + taken["damping"]) / excitation.context.comm.bcast(work))


def point_line(name: str, row: dict[str, Any], units: UnitSystem, unit: str) -> str:
    """One plain line of progress."""
    return (
        f"{name} {row['point']:4d}  level {row['level']:6.4g}  f {row['frequency_hz']:9.5g} Hz"
        f"  a {row['amplitude']:9.4g}{error_text(row['amplitude_error'])} {unit}"
        f"  phase {math.degrees(row['phase']):7.2f} deg  stick {100 * row['stick']:3.0f} %"
        f"  newton {row['newton']:2d}  {row['wall_s']:.3f} s"
        + (f"  {row['event'].replace('_', ' ')}" if row["event"] else "")
        + closure_note(row, units)
    )


def _short(row: dict[str, Any], unit: str) -> str:
    return (
        f"point {row['point']}: level {row['level']:g}, {row['frequency_hz']:.5g} Hz, a {row['amplitude']:.4g} {unit}"
    )


def _missing_backbones(context: AnalysisContext[ForcedAnalysis]) -> list[str]:
    """Backbones that have no results to compare with (another selection by --only)."""
    missing = [name for name in context.analysis.backbones() if not context.has_results(name)]
    return [f"distance of the peaks from '{name}' (no results of it on this model in this folder)" for name in missing]
