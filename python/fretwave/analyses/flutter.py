"""``type = "flutter"``: the damping of each nodal diameter, friction and flow together, and its limit cycles.

The forces of the flow are terms of the equations, not a damping added to a finished branch: they bring stiffness too,
couple neighbours unlike in both directions, and act on the shape that the motion has while the contact slips. On one
sector that costs nothing.

A branch says how a motion of its own nodal diameter grows or decays. Whether its limit cycle withstands waves of other
nodal diameters on the same wheel is another question, which is not answered here.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from ..case.flow import diameters_of
from ..case.schema import FlutterAnalysis
from ..columns import FLUTTER
from ..post.flutter_waves import STABLE, describe_waves, with_sign, words
from .mode import point_line
from .parts.branch import closure_note, finished_table, mode_problem, open_branch, points_of, record, step_control, tell
from .parts.context import AnalysisContext, Outcome
from .parts.rest import retained, start_mode


def run_flutter(context: AnalysisContext) -> Outcome:
    """Follow the mode of every nodal diameter over its amplitude. Collective."""
    analysis = context.analysis
    assert isinstance(analysis, FlutterAnalysis) and context.case.neighbours is not None
    harmonics = retained(context)
    context.leave_out([*harmonics.left_out, "stability of the limit cycles against waves of other nodal diameters"])
    writer = context.writer(FLUTTER, labels=harmonics.labels, samples=harmonics.samples)
    try:
        return _all_waves(context, diameters_of(analysis, context.case.neighbours.sectors), harmonics, writer)
    finally:
        writer.abandon()


def _all_waves(context: AnalysisContext, diameters: Sequence[int], harmonics: Any, writer: Any) -> Outcome:
    snapshot, own, found = open_branch(context.comm, writer, context.resuming)
    first = int(own.get("wave_number", 0))
    reasons = []
    with context.console.progress(context.name):
        for number in range(first, len(diameters)):
            wave = _Wave(context, diameters, number, harmonics)
            reasons.append(wave.follow(writer, snapshot, found and number == first))
    stopped = [reason for reason in reasons if reason]
    reason = "; ".join(stopped) or "stop value reached"
    table = finished_table(writer)
    waves = context.comm.bcast(describe_waves(table, diameters) if table else [])
    cycles = [cycle for wave in waves for cycle in wave["limit_cycles"]]
    _write(context, waves, cycles)
    writer.close("stopped" if stopped else "done", reason, events=json.dumps(cycles), waves=json.dumps(waves))
    context.entry["waves"] = waves
    summary = [f"{context.name}: {words(wave)}" for wave in waves]
    goal = f"amplitude {context.analysis.amplitude[1]:g} m in every wave"  # type: ignore[attr-defined]
    return Outcome(writer.rows, reason, not stopped, summary, goal)


class _Wave:
    """The branch of one nodal diameter."""

    def __init__(self, context: AnalysisContext, diameters: Sequence[int], number: int, harmonics: Any) -> None:
        assert isinstance(context.analysis, FlutterAnalysis)
        self.context, self.number, self.count, self.harmonics = context, number, len(diameters), harmonics
        self.diameter = diameters[number]
        self.analysis = context.analysis.model_copy(update={"nodal_diameter": self.diameter, "aerodynamics": True})

    def follow(self, writer: Any, snapshot: Any, go_on: bool) -> str:
        """Write its points; returns why it stopped early, or nothing. Collective."""
        from ..case.build import build_model

        case, analysis = self.context.case, self.analysis
        preload, comm = case.preload_of(analysis), self.context.comm
        with build_model(case, analysis.dampers, comm, preload, self.diameter, aerodynamics=True) as model:
            problem = self._problem(replace(self.context, model=model, analysis=analysis))
            branch = self._branch(problem, snapshot, go_on)
            for point in points_of(branch):
                own = {"wave_number": self.number}
                self._say(record(writer, problem, point, branch.snapshot(), own, self._column))
            tell(self.context, branch, f"{self.context.name}: nodal diameter {self.diameter}")
            stopped = "" if branch.converged else f"nodal diameter {self.diameter}: {branch.reason}"
            branch.destroy()
            problem.destroy()
        return stopped

    def _column(self, *_: Any) -> dict[str, int]:
        return {"nodal_diameter": self.diameter}

    def _problem(self, context: AnalysisContext) -> Any:
        """Started from the mode of the structure alone; the flow bends it little."""
        start, rest = start_mode(context, self.analysis.linear_mode)
        return mode_problem(context, self.harmonics, start, rest)

    def _branch(self, problem: Any, snapshot: Any, go_on: bool) -> Any:
        from ..solve.continuation import Continuation

        low, high = self.analysis.amplitude
        steps, report_at = step_control(self.analysis.step), list(self.analysis.report_at)
        if go_on:
            return Continuation.restore(problem, snapshot, (low, high), steps, report_at)
        return Continuation(problem, problem.initial(low), (low, high), steps, report_at)

    def _say(self, row: Mapping[str, Any]) -> None:
        low, high = self.analysis.amplitude
        share = (self.number + math.log(row["amplitude"] / low) / math.log(high / low)) / self.count
        line = point_line(f"{self.context.name} ND {with_sign(self.diameter):>3}", dict(row))
        notable = row["event"] not in ("", "start", "stop") or bool(closure_note(row))
        self.context.console.point(line, line, share, notable)


def _write(context: AnalysisContext, waves: Sequence[Mapping[str, Any]], cycles: Sequence[Mapping[str, Any]]) -> None:
    """``<name>_waves.csv``, a line for each nodal diameter, and ``<name>_crossings.csv``, one for each limit cycle."""
    names = [name for name in waves[0] if name != "limit_cycles"] if waves else []
    context.write_table("waves", {name: [wave[name] for wave in waves] for name in names})
    plain = [{**cycle, "stable": STABLE[cycle["stable"]]} for cycle in cycles]
    names = ["nodal_diameter", "amplitude", "frequency_hz", "stable", "point"]
    context.write_table("crossings", {name: [cycle[name] for cycle in plain] for name in names})
