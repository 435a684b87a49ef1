"""``type = "free_decay"``: the motion of a mode decays by itself; direct integration of the unreduced equations."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from ..case.analysis import AnalysisSection, register_analysis
from ..case.analysis_tables import Damper
from ..case.checks_common import check_once
from ..case.fields import Positive, Size, Whole, key
from ..case.observed import check_displaced
from ..columns import Column
from ..errors import InputError
from ..post.decays import decay_rows, largest_differences
from ..post.mode_curve import at_the_end
from ..results.summaries import DECAYS
from ..solve.steps import COARSEST_TOLERANCE, TIME_TOLERANCE
from ..texts import counted, toml
from .mode import ModeAnalysis
from .parts.context import AnalysisContext, Outcome

if TYPE_CHECKING:
    from ..case.facts import Facts
    from ..case.load import Case
    from ..case.reporter import Reporter

#: bytes
NUMBER = 8
SHEETS = Column("sheets", "1", "solutions of the mode at this amplitude", "i")
COLUMNS = ("start", "cycle", "time", "amplitude", "omega", "zeta", "omega_mode", "zeta_mode", SHEETS)


class TransientSection(AnalysisSection):
    """Keys of the analyses by direct time integration."""

    mode: str = key("mode analysis to start from and compare with", example='"mode"')
    amplitude: list[Size] = key("start amplitudes", "length", "[0.05, 0.3, 2.5]", min_length=1)
    periods: Whole = key("vibration periods to integrate", example="30", ge=1)
    samples_per_period: Whole = key("output samples of a period", example="64", default=64, ge=8)
    tolerance: Positive = key(
        "relative tolerance of the time integration", "-", "1e-10", default=TIME_TOLERANCE, le=COARSEST_TOLERANCE
    )

    def needs(self) -> list[str]:
        return [self.mode]

    def decided_by(self) -> list[str]:
        return [self.mode]

    def mode_of(self, case: Case) -> ModeAnalysis:
        """The mode that it starts from."""
        return case.analyses.of(ModeAnalysis)[self.mode]

    def acting_dampers(self, case: Case) -> list[Damper]:
        """Without any of its own those of its mode."""
        return list(self.dampers or self.mode_of(case).dampers)

    def integrates(self) -> str:
        return "type"

    def check(self, report: Reporter, facts: Facts) -> None:
        super().check(report, facts)
        report.mode(("mode",), self.mode, facts.analyses_of("mode"))
        check_displaced(report, "mode", self.mode, facts)
        check_once(report, "amplitude", self.amplitude)

    def check_chosen(self, case: Case) -> list[InputError]:
        """Each start lies where its mode is asked for."""
        given = self.mode_of(case).amplitude
        ends = np.array(given)
        return [
            InputError(
                f"{self.name}.amplitude[{index}] is outside the mode's branch",
                f"analysis '{self.name}'",
                toml(start),
                f"a value within {self.mode}.amplitude = {toml(given)}",
                f"change it, or widen the range of '{self.mode}'",
            )
            for index, start in enumerate(self.amplitude)
            if not ends.min() <= at_the_end(ends, start) <= ends.max()
        ]

    def least_memory(self, facts: Facts) -> Mapping[str, float]:
        count = self.periods * self.samples_per_period
        return {f"periods: {count} samples of {facts.least_dofs} dofs": 2.0 * NUMBER * facts.least_dofs * count}

    def headline(self) -> str:
        starts = ", ".join(f"{amplitude:g}" for amplitude in self.amplitude) + f" {self.units('length')}"
        kind = super().headline()
        return f"{kind} by time integration from '{self.mode}', starts a = {starts}, {self.periods} periods"


@register_analysis
class FreeDecayAnalysis(TransientSection):
    """``type = "free_decay"``: decay and frequency of each cycle against the mode."""

    pictures = ("trajectories", "free_decay")
    summary = DECAYS

    type: Literal["free_decay"]

    def run(self, context: AnalysisContext[FreeDecayAnalysis]) -> Outcome:
        """Let the motion of the mode decay from each start; every cycle is compared with the mode. Collective."""
        from .parts.starts import FAR, Starts

        mode = context.curve(self.mode)
        rows: list[dict[str, Any]] = []
        lines: list[str] = []
        with Starts(context, COLUMNS) as starts:
            for number, amplitude in enumerate(self.amplitude):
                start = starts.follow(number, amplitude, (FAR,))
                rows += starts.write(number, start.motion, decay_rows(number, start.cycles, mode))
                lines += [f"{context.name}: start {number}: {text}" for text in start.end(context.units("length"))]
            omega, zeta = largest_differences(rows)
            lines.insert(0, f"{context.name}: {_comparison(len(rows), omega, zeta)}")
            return starts.finish(lines, omega_difference=omega, zeta_difference=zeta)


def _comparison(count: int, omega: float, zeta: float) -> str:
    """In words: how many cycles, and how far they are from the mode where it describes them."""
    if not np.isfinite(omega):
        return f"{counted(count, 'full cycle')}, none that changes slowly where the mode is unique: nothing to compare"
    return (
        f"{counted(count, 'cycle')}; where the damping changes slowly the frequency differs "
        f"from the mode's by up to {omega:.1e} (relative), the damping ratio by up to {zeta:.1e} (absolute)"
    )
