"""``type = "limit_cycle"``: where motions of a mode end up; direct integration of the unreduced equations."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from ..case.analysis import register_analysis
from ..post.decays import DIVERGES, LEAVES, NOT_SETTLED, Ending, compare, cycle_rows, ending
from ..post.mode_curve import Crossing, ModeCurve
from ..post.settling import LAST_CYCLES
from ..results.summaries import CYCLES_IN_TIME
from ..texts import without_nan
from .free_decay import TransientSection
from .mode import ModeAnalysis
from .parts.context import AnalysisContext, Outcome
from .parts.shifted import shifted_damping, twins_of

if TYPE_CHECKING:
    from ..case.case import Case
    from ..case.facts import Facts
    from ..case.reporter import Reporter

#: The first and the last one are not full.
LEAST_PERIODS = LAST_CYCLES + 2
COLUMNS = ("start", "cycle", "time", "amplitude", "frequency_hz")


@register_analysis
class LimitCycleAnalysis(TransientSection):
    """``type = "limit_cycle"``: where starts at several amplitudes end up."""

    pictures = ("trajectories", "limit_cycles")
    summary = CYCLES_IN_TIME

    type: Literal["limit_cycle"]

    def beside(self, case: Case) -> list[str]:
        """Modes that its own is compared with, without their dampers."""
        return [twin.name for twin in twins_of(self.mode_of(case), case.analyses.of(ModeAnalysis).values())]

    def check(self, report: Reporter, facts: Facts) -> None:
        super().check(report, facts)
        if self.periods < LEAST_PERIODS:
            expected = f"at least {LEAST_PERIODS}: the last {LAST_CYCLES} full cycles decide"
            report.wrong(("periods",), "is too few for a verdict", expected, "write for example `periods = 100`")

    def run(self, context: AnalysisContext[LimitCycleAnalysis]) -> Outcome:
        """Follow each start until it has settled or diverges, and compare with the zeros of the damping. Collective."""
        from .parts.starts import Starts

        table = context.table(self.mode)
        crossings, reach = ModeCurve.from_table(table).crossings(), float(np.max(table["amplitude"]))
        endings: list[dict[str, Any]] = []
        lines: list[str] = []
        with Starts(context, COLUMNS) as starts:
            for number, amplitude in enumerate(self.amplitude):
                start = starts.follow(number, amplitude)
                starts.write(number, start.motion, cycle_rows(number, start.cycles))
                stopped, faded = start.motion.diverged, bool(start.floor)
                found = ending(start.cycles, stopped, crossings, reach, self.tolerance, faded)
                endings.append({"start": amplitude, **vars(found), **compare(found, crossings)})
                line = _ending_line(amplitude, found, crossings, context.units("length"))
                lines.append(f"{context.name}: " + "; ".join([line, *start.end(context.units("length"))]))
            done = starts.finish(lines, endings=json.dumps(without_nan(endings)))
        # only now: results.h5 can be read again when the writer has closed it
        done.summary += shifted_damping(
            context, self.mode_of(context.case), context.case.analyses.of(ModeAnalysis).values()
        )
        return done


def _ending_line(start: float, found: Ending, crossings: Sequence[Crossing], unit: str) -> str:
    line = f"from a = {start:g} {unit}: {found.text}"
    if not np.isfinite(found.amplitude):
        return line
    if found.text in (NOT_SETTLED, LEAVES, DIVERGES):
        line += f", {_still(found)}"
    line += f", a = {found.amplitude:.5g} {unit}, {found.omega / (2.0 * np.pi):.5g} Hz"
    differences = compare(found, crossings)
    if not np.isfinite(differences["predicted"]):
        return line
    known = {crossing.amplitude: crossing.stable for crossing in crossings}
    doubt = " (stability unknown)" if known[differences["predicted"]] is None else ""
    return line + (
        f"; predicted {differences['predicted']:.5g} {unit}{doubt}: amplitude"
        f" {differences['amplitude_difference']:+.1e}, frequency {differences['frequency_difference']:+.1e} (relative)"
    )


def _still(found: Ending) -> str:
    """In words, how the amplitude of the last cycles goes on."""
    if not np.isfinite(found.zeta):
        return f"varies by {100.0 * found.spread:.3g} % over the last cycles"
    return f"{'falls' if found.zeta > 0.0 else 'grows'} with zeta = {100.0 * found.zeta:.2g} %"
