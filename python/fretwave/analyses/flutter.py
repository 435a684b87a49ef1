"""``type = "flutter"``: the damping of each nodal diameter, friction and flow together, and its limit cycles.

The forces of the flow are terms of the equations, not a damping added to a finished branch: they bring stiffness too,
couple neighbours unlike in both directions, and act on the shape that the motion has while the contact slips. On one
sector that costs nothing.

A branch says how a motion of its own family and nodal diameter grows or decays. Other families of the same wave that
the flow feeds are named; whether a limit cycle withstands them, and waves of other nodal diameters on the same wheel,
is another question, which is not answered here.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal, Optional

from ..case.analysis import register_analysis
from ..case.checks_common import about
from ..case.fields import Positive, Size, Whole, key
from ..case.flow import check_damped
from ..case.harmonic import HarmonicSection, check_range
from ..case.observed import Observed, check_observed, dofs_of, label_of
from ..columns import FLUTTER
from ..cyclic.engine_order import folded, waves_of
from ..errors import InputError
from ..post.flutter_waves import DECAYS, STABLE, describe_waves, with_sign, words
from ..results.results import AnalysisWriter
from ..results.sweep_summary import FLUTTER_WAVES
from ..texts import counted
from .mode import point_line
from .parts.at_rest import flutter_at_rest
from .parts.branch import (
    continuation,
    finished_table,
    largest_error,
    mode_problem,
    notable,
    open_branch,
    points_of,
    record,
    tell,
)
from .parts.context import AnalysisContext, Outcome
from .parts.fed_modes import fed_modes
from .parts.flutter_wave import in_wave_of, raise_if_all, what_to_do, why_not
from .parts.observed import named
from .parts.others import found_of, with_others
from .parts.rest import keep_pairs, rest_state, retained, start_mode, stuck_or_free
from .parts.several import ending_of, refused_before, stopped_before, with_refused, with_stopped

if TYPE_CHECKING:
    from ..case.facts import Facts
    from ..case.reporter import Reporter
    from ..hb.harmonics import Harmonics
    from ..hb.nonlinear_mode import NonlinearMode
    from ..solve.continuation import Continuation

NOT_ANSWERED = "stability of the limit cycles against waves of other nodal diameters and of other families"


@register_analysis
class FlutterAnalysis(HarmonicSection):
    """``type = "flutter"``: modes of several nodal diameters with [aerodynamics], and their limit cycles."""

    pictures = ("flutter",)
    summary = FLUTTER_WAVES

    type: Literal["flutter"]
    method: Literal["CNM", "EPMC"] = key(
        "complex nonlinear mode (decaying) or extended periodic motion", example='"CNM"', default="CNM"
    )
    normalise: Observed = key("dof whose fundamental harmonic is the modal amplitude; or weighted dofs", example='"m1"')
    amplitude: list[Size] = key("first and last modal amplitude", "length", "[1e-5, 1e-2]", min_length=2, max_length=2)
    nodal_diameters: Optional[list[Whole]] = key(
        "waves looked at, negative for backward ones; all unless told", example="[-4, 3, 4]", default=None, min_length=1
    )
    report_at: list[Positive] = key(
        "amplitudes at which the motion of a period is kept", "length", "[1e-4]", default_factory=list
    )

    def waves(self, sectors: int) -> list[int]:
        """Nodal diameters that it looks at: those it names, or all forward and backward waves."""
        if self.nodal_diameters is not None:
            return list(self.nodal_diameters)
        return waves_of(sectors)

    def kept_dofs(self) -> list[str]:
        return [*super().kept_dofs(), *dofs_of(self.normalise)]

    def observed(self) -> tuple[str, Observed]:
        return "normalise", self.normalise

    def follows_waves(self) -> bool:
        return True

    def largest_amplitude(self) -> Optional[float]:
        return self.amplitude[1]

    def check(self, report: Reporter, facts: Facts) -> None:
        super().check(report, facts)
        check_observed(report, "normalise", self.normalise, self, facts)
        check_range(report, "amplitude", self.amplitude, self.report_at)
        if facts.model_known and facts.neighbours is None:
            about(report, "type", "is of a wheel", "a model with sectors", "give [model] its sectors")
        if facts.model_known and not facts.has_flow:
            report.wrong(("type",), "needs forces of the flow", "a table [aerodynamics]", "add [aerodynamics]")
        if facts.sectors is not None:
            self._check_waves(report, facts, facts.sectors)

    def _check_waves(self, report: Reporter, facts: Facts, sectors: int) -> None:
        if self.nodal_diameter is not None:
            number = self.nodal_diameter
            fix = f"write `nodal_diameters = [{number}]`"
            report.wrong(("nodal_diameter",), "is one wave; flutter looks at several", "nodal_diameters", fix)
        if self.wheel:
            report.wrong(
                ("wheel",), "is for modes; flutter follows waves on one sector", "one sector", "remove the key"
            )
        if "aerodynamics" in self.model_fields_set and not self.aerodynamics:
            fix = 'remove the key, or take `type = "mode"`'
            report.wrong(("aerodynamics",), "is off, and flutter is of the flow", "the forces of the flow", fix)
        half = sectors // 2
        for index, diameters in enumerate(self.nodal_diameters or []):
            if abs(diameters) > half:
                expected = f"-{half} .. {half}, negative for backward waves"
                fix = f"write {folded(diameters, sectors)}, the same wave, or take it out"
                report.wrong(("nodal_diameters", index), "is no wave of this wheel", expected, fix)
        key = "type" if self.nodal_diameters is None else "nodal_diameters"
        check_damped(report, key, self.waves(sectors), facts)

    def headline(self) -> str:
        low, high = self.amplitude
        named = ", ".join(map(str, self.nodal_diameters or [])) or "all"
        start = f"flutter ({self.method}), nodal diameters {named}, linear mode {self.linear_mode}"
        return f"{start}, a = {low:g} to {high:g} {self.units('length')} of {label_of(self.normalise)}"

    def at_rest(self, context: AnalysisContext[FlutterAnalysis]) -> tuple[list[str], list[InputError]]:
        assert context.case.neighbours is not None
        return flutter_at_rest(context, self.waves(context.case.neighbours.sectors))

    def run(self, context: AnalysisContext[FlutterAnalysis]) -> Outcome:
        """Follow the mode of every nodal diameter over its amplitude. Collective."""
        assert context.case.neighbours is not None
        harmonics = retained(context)
        context.leave_out([*harmonics.left_out, NOT_ANSWERED])
        columns = self.columns_of(named(FLUTTER, self.normalise))
        writer = context.writer(columns, labels=harmonics.labels, samples=harmonics.samples)
        try:
            return _all_waves(context, self.waves(context.case.neighbours.sectors), harmonics, writer)
        finally:
            writer.abandon()


def _all_waves(
    context: AnalysisContext[FlutterAnalysis], diameters: Sequence[int], harmonics: Harmonics, writer: AnalysisWriter
) -> Outcome:
    snapshot, own, found = open_branch(context.comm, writer, context.resuming)
    first, followed = int(own.get("wave_number", 0)), _Waves(context, diameters, harmonics, writer, own)
    with context.console.progress(context.name):
        for number in range(first, len(diameters)):
            followed.follow(number, snapshot, found and number == first)
    raise_if_all(followed.refused, diameters)
    status, reason, ended = ending_of(followed.stopped, diameters)
    table = finished_table(writer)
    waves = context.comm.bcast(describe_waves(table, diameters) if table else [])
    for wave in waves:
        wave.update(_beside_other_families(context, wave))
    cycles = [cycle for wave in waves for cycle in wave["limit_cycles"]]
    if waves:  # before the first point there is no folder to write to
        _write(context, waves, cycles)
    if table:
        keep_pairs(context, writer)
    writer.close(status, reason, events=json.dumps(cycles), waves=json.dumps(waves), **ended)
    context.entry["waves"] = waves
    unit = context.units("length")
    early = {diameters[number] for number in followed.stopped}
    told = context.comm.bcast(_in_numbers(table))
    summary = [f"{context.name}: {words(wave, unit, wave['nodal_diameter'] in early)}" for wave in waves]
    summary += [f"{context.name}: {told}"] if told else []
    goal = f"amplitude {context.analysis.amplitude[1]:g} {unit} in every wave"
    advice = what_to_do(context.name, followed.refused, diameters)
    return Outcome(writer.rows, reason, not followed.stopped, summary, goal, advice)


def _in_numbers(table: Mapping[str, Any]) -> str:
    """Of all waves together: points, the largest error and time; nothing before the first point."""
    if not table:
        return ""
    error = largest_error("zeta", table, "zeta_error", "%", 100)
    return f"{counted(len(table['zeta']), 'point')},{error} {table['wall_s'].sum():.2f} s"


def _beside_other_families(context: AnalysisContext[FlutterAnalysis], wave: Mapping[str, Any]) -> dict[str, Any]:
    """Its limit cycles with the families that grow beside a stable one; without those of a wave that decays `fed`.

    Collective.
    """
    cycles = wave["limit_cycles"]
    stable = any(cycle["stable"] for cycle in cycles)
    if not stable and wave["verdict"] not in DECAYS:
        return {}
    with in_wave_of(context, wave["nodal_diameter"]) as own_context:

        def fed() -> list[dict[str, Any]]:
            rest_state(own_context)
            return fed_modes(own_context, stuck_or_free(own_context, context.analysis.linear_mode))

        return {"limit_cycles": with_others(fed, cycles)} if stable else found_of(fed)


class _Waves:
    """The branches of all nodal diameters, which are followed one after the other.

    Attributes
    ----------
    stopped : dict
        Why branches stopped early or could not begin, by the number of the wave.
    refused : dict
        Errors of those that could not begin, by nodal diameter.
    """

    def __init__(
        self,
        context: AnalysisContext[FlutterAnalysis],
        diameters: Sequence[int],
        harmonics: Harmonics,
        writer: AnalysisWriter,
        own: Mapping[str, Any],
    ) -> None:
        self.context, self.diameters, self.harmonics, self.writer = context, diameters, harmonics, writer
        self.analysis = context.analysis
        self.stopped, self.refused = stopped_before(own), refused_before(own)

    def follow(self, number: int, snapshot: Optional[dict[str, Any]], go_on: bool) -> None:
        """Write the points of a wave, from the snapshot on if it is to go on. Collective."""
        diameter = self.diameters[number]
        with in_wave_of(self.context, diameter) as own_context:
            try:
                problem = self._problem(own_context)
            except InputError as error:  # on all ranks; other waves may begin
                self.refused[diameter], self.stopped[number] = error, why_not(diameter, error)
                return
            name = f"{self.context.name}: nodal diameter {diameter}"
            low, high = self.analysis.amplitude
            branch = continuation(own_context, problem, (low, high), self.analysis.report_at, snapshot, go_on, name)
            self._points(branch, number)
            tell(self.context, branch, name)
            if not branch.converged:
                self.stopped[number] = f"nodal diameter {diameter}: {branch.reason}"
            branch.destroy()
            problem.destroy()

    def _points(self, branch: Continuation, number: int) -> None:
        """Write each, with what a run that goes on from there must know of the waves before. Collective."""
        column, errors = {"nodal_diameter": self.diameters[number]}, self.analysis.errors
        own = {**with_stopped(self.stopped, wave_number=number), **with_refused(self.refused)}
        for point in points_of(branch):
            row = record(self.writer, branch.problem, point, branch.snapshot(), own, lambda *_: column, errors)
            self._say(number, row)

    def _problem(self, context: AnalysisContext[FlutterAnalysis]) -> NonlinearMode:
        """Started from the mode of the structure alone; the flow bends it little."""
        start, rest = start_mode(context, self.analysis.linear_mode)
        return mode_problem(context, self.harmonics, start, rest)

    def _say(self, number: int, row: Mapping[str, Any]) -> None:
        low, high = self.analysis.amplitude
        share = (number + math.log(row["amplitude"] / low) / math.log(high / low)) / len(self.diameters)
        units, diameter = self.context.units, self.diameters[number]
        line = point_line(f"{self.context.name} ND {with_sign(diameter):>3}", dict(row), units, units("length"))
        self.context.console.point(line, line, share, notable(row, units))


def _write(
    context: AnalysisContext[FlutterAnalysis], waves: Sequence[Mapping[str, Any]], cycles: Sequence[Mapping[str, Any]]
) -> None:
    """``<name>_waves.csv``, a line for each nodal diameter, and ``<name>_crossings.csv``, one for each limit cycle."""
    names = [name for name in waves[0] if name not in ("limit_cycles", "fed", "not_looked_at")]
    context.write_table("waves", {name: [wave[name] for wave in waves] for name in names})
    plain = [{**cycle, "stable": STABLE[cycle["stable"]]} for cycle in cycles]
    for cycle in plain:
        cycle["amplitude_error"] = math.nan if cycle["amplitude_error"] is None else cycle["amplitude_error"]
    names = ["nodal_diameter", "amplitude", "amplitude_error", "frequency_hz", "stable", "point"]
    context.write_table("crossings", {name: [cycle[name] for cycle in plain] for name in names})
