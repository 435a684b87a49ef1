"""``type = "forced"``: frequency responses at several excitation levels, and their peaks against backbones."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..case.schema import ForcedAnalysis
from ..columns import FORCED
from ..hb.suspects import suspects
from ..post.mode_curve import ModeCurve
from ..post.motion import complex_amplitudes
from ..post.response_peaks import peak_table
from .forced_time import time_points
from .parts.branch import closure_note, finished_table, open_branch, points_of, record, tell
from .parts.context import AnalysisContext, Outcome
from .parts.excitation import Excitation, excitation_of
from .parts.rest import retained
from .parts.wheel_peaks import blade_amplitudes, blade_by_blade


def run_forced(context: AnalysisContext) -> Outcome:
    """Follow the response of every level over the frequency range. Collective."""
    analysis = context.analysis
    assert isinstance(analysis, ForcedAnalysis)
    harmonics = retained(context)
    excitation = excitation_of(context, harmonics)
    left_out = [] if analysis.time_points else ["check by time integration (time_points = 0)"]
    context.leave_out([*harmonics.left_out, *_missing_backbones(context), *left_out])
    writer = context.writer(
        [*FORCED[:-1], *excitation.columns(), FORCED[-1]],
        labels=harmonics.labels,
        samples=harmonics.samples,
        stuck_omega=excitation.reference.omega,
        **_attributes(context),
    )
    try:
        return _all_levels(context, analysis, excitation, writer)
    finally:
        writer.abandon()


def _attributes(context: AnalysisContext) -> dict[str, Any]:
    """Of the results of a wheel."""
    analysis, wheel = context.analysis, context.case.wheel
    assert isinstance(analysis, ForcedAnalysis)
    if wheel is None:
        return {}
    observed = f"{analysis.observe}@{analysis.sector or 0}"
    return {"observe": observed, "sectors": wheel.sectors, "sector_dofs": wheel.unit}


def _all_levels(context: AnalysisContext, analysis: ForcedAnalysis, excitation: Excitation, writer: Any) -> Outcome:
    snapshot, own, found = open_branch(context.comm, writer, context.resuming)
    first = int(own.get("level_number", 0))
    reasons = []
    with context.console.progress(context.name):
        for number in range(first, len(analysis.levels)):
            go_on = found and number == first
            reasons.append(_one_level(excitation, writer, number, snapshot, go_on, own.get("phase")))
    stopped = [reason for reason in reasons if reason]
    reason = "; ".join(stopped) or "stop value reached"
    table = finished_table(writer)
    wheel = context.case.wheel is not None and writer.rows > 0
    blades = blade_amplitudes(excitation, writer) if wheel and writer.active else None
    writer.close("stopped" if stopped else "done", reason, events="[]")
    curves = _curves(context, analysis)
    summary = blade_by_blade(excitation, table, blades, curves) if wheel else _peaks(context, table, curves)
    if analysis.time_points and writer.rows:
        lines, given_up = time_points(context, table, analysis.time_points)
        summary += lines
        if given_up and not stopped:
            fix = f"--set {context.name}.time_points=0, or a smoother contact law"
            return Outcome(writer.rows, given_up, False, summary, "a steady motion in time", fix)
    goal = f"{analysis.frequency[1]:g} Hz at every level"
    advice = "lower levels, or damping that takes their work" if "without bound" in reason else ""
    return Outcome(writer.rows, reason, not stopped, summary, goal, advice)


def _one_level(
    excitation: Excitation, writer: Any, number: int, snapshot: Any, go_on: bool, phase: float | None
) -> str:
    """Follow one response, on from a phase if it was begun; returns why it stopped early, or nothing. Collective."""
    context, analysis = excitation.context, excitation.analysis
    low, high = (2.0 * math.pi * hertz for hertz in analysis.frequency)
    problem = excitation.problem(analysis.levels[number])
    branch = excitation.branch(problem, snapshot, go_on)
    excitation.phase = phase if go_on else None
    for point in points_of(branch):
        own = {"level_number": number, **({} if excitation.phase is None else {"phase": excitation.phase})}
        row = record(writer, problem, point, branch.snapshot(), own, excitation.row)
        share = (number + (row["omega"] - low) / (high - low)) / len(analysis.levels)
        context.console.point(
            point_line(context.name, row), _short(row), share, _notable(row["event"]) or bool(closure_note(row))
        )
    tell(context, branch, f"{context.name}: level {analysis.levels[number]:g}")
    stopped = "" if branch.converged else f"level {analysis.levels[number]:g}: {branch.reason}"
    if "without bound" in stopped:
        most = _bounded(excitation, problem, branch.anchor)
        stopped += f": damping and friction take at most the work of level {most:.4g}"
    elif stopped:
        stopped += suspects(context.model.contacts, problem.core.stiffness_scale)
    branch.destroy()
    problem.destroy()
    return stopped


def _bounded(excitation: Excitation, problem: Any, y: Any) -> float:
    """Level whose work damping and friction still take in the shape of the motion at y. Collective.

    The work that a force at level 1 does at most, at a right angle to the motion, is pi |q_1^H P| per period.
    """
    taken = problem.energy(y)
    coefficients = problem.coefficients(y)
    work = None
    if coefficients is not None:
        q = complex_amplitudes(excitation.harmonics.labels, coefficients)[1]
        work = math.pi * abs(np.vdot(q, excitation.force()))
    return float((taken["contact"] + taken["damping"]) / excitation.context.comm.bcast(work))


def _notable(event: str) -> bool:
    return bool(event) and event not in ("start", "stop")


def point_line(name: str, row: dict[str, Any]) -> str:
    """One plain line of progress."""
    return (
        f"{name} {row['point']:4d}  level {row['level']:6.4g}  f {row['frequency_hz']:9.5g} Hz"
        f"  a {row['amplitude']:9.4g} m  phase {math.degrees(row['phase']):7.2f} deg"
        f"  stick {100 * row['stick']:3.0f} %  error {row['error_estimate']:.1e}"
        f"  newton {row['newton']:2d}  {row['wall_s']:.3f} s"
        + (f"  {row['event'].replace('_', ' ')}" if row["event"] else "")
        + closure_note(row)
    )


def _short(row: dict[str, Any]) -> str:
    return f"point {row['point']}: level {row['level']:g}, {row['frequency_hz']:.5g} Hz, a {row['amplitude']:.4g} m"


def _backbones(analysis: ForcedAnalysis) -> list[str]:
    return [analysis.backbone] if isinstance(analysis.backbone, str) else list(analysis.backbone)


def _missing_backbones(context: AnalysisContext) -> list[str]:
    """Backbones that have no results to compare with (another selection by --only)."""
    analysis = context.analysis
    assert isinstance(analysis, ForcedAnalysis)
    missing = [name for name in _backbones(analysis) if not context.has_results(name)]
    return [f"distance of the peaks from '{name}' (no results of it in this folder)" for name in missing]


def _curves(context: AnalysisContext, analysis: ForcedAnalysis) -> dict[str, ModeCurve]:
    """Backbones that have results. Collective."""
    names = [name for name in _backbones(analysis) if context.has_results(name)]
    return {name: ModeCurve.from_table(context.table(name)) for name in names}


def _peaks(context: AnalysisContext, table: dict[str, Any], curves: dict[str, ModeCurve]) -> list[str]:
    """Write the peaks of all levels with their distance from the backbones; a line for each level."""
    if not table:
        return []
    peaks = peak_table({key: table[key] for key in ("level", "omega", "amplitude", "phase", "event")}, curves)
    context.write_table("peaks", peaks)
    lines = [
        f"{context.name}: {len(table['level'])} points, {len(peaks['level'])} levels,"
        f" error estimate up to {table['error_estimate'].max():.1e}, {table['wall_s'].sum():.2f} s"
    ]
    for row in range(len(peaks["level"])):
        lines.append(_peak_line(context.name, {key: float(value[row]) for key, value in peaks.items()}, list(curves)))
    return lines


def _peak_line(name: str, peak: dict[str, float], curves: list[str]) -> str:
    text = f"{name}: level {peak['level']:g}: "
    if not math.isfinite(peak["amplitude"]):
        return text + "no peak within the frequency range"
    text += f"peak a = {peak['amplitude']:.4g} m at {peak['frequency_hz']:.5g} Hz"
    distances = [f"{100 * peak[f'distance_{curve}']:+.3f} % from {curve}" for curve in curves]
    return text + (", frequency " + ", ".join(distances) if distances else "")
