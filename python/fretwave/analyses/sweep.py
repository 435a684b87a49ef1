"""``type = "sweep"``: another analysis for every value of some keys of the case, on groups of ranks.

The runs of the values are those of whole cases: `fretwave.run.sweep_analysis` does them in its place.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, Optional

from ..case.analysis import AnalysisSection, register_analysis
from ..case.checks_sweep import complaint, given_before
from ..case.fields import Whole, key
from ..case.toml.source import nested_leaves
from ..errors import FretwaveError
from ..post.grid import Plan
from ..registry import kinds
from ..texts import nearest
from .parts.context import AnalysisContext, Outcome

if TYPE_CHECKING:
    from ..case.facts import Facts
    from ..case.reporter import Reporter


@register_analysis
class SweepAnalysis(AnalysisSection):
    """``type = "sweep"``: another analysis for every value of some keys of the case."""

    pictures = ("sweeps", "quantiles")
    sweeps = True

    type: Literal["sweep"]
    of: str = key("analysis to run for every value", example='"mode"')
    over: dict[str, Any] = key(
        "values of keys, addressed as --set does; of several keys all combinations",
        example='{ "model.options.friction" = [0.1, 0.2, 0.5] }',
        min_length=1,
    )
    overrides: dict[str, Any] = key(
        "other values of keys for these runs", example="{ mode.amplitude = [1e-6, 1e-2] }", default_factory=dict
    )
    groups: Optional[Whole] = key(
        "most groups of ranks, each with a value at a time (as many as there are ranks and values unless told)",
        example="2",
        default=None,
        ge=1,
    )

    def plan(self) -> Plan:
        """Its values: ``{ "model.options.friction" = [0.1, 0.5] }``, or with nested tables."""
        return Plan({".".join(path): values for path, values in nested_leaves(self.over)})

    def check(self, report: Reporter, facts: Facts) -> None:
        """The values themselves are checked by loading the case with each, before anything runs."""
        super().check(report, facts)
        sweeps = [name for name, kind in kinds().items() if kind.sweeps]
        entries = report.source.entries("analysis")
        swept = [str(entry.get("name")) for entry in entries if entry.get("type") not in sweeps]
        if self.of not in swept:
            expected = f"one of {', '.join(swept) or '(there is none)'}"
            report.wrong(("of",), "is no analysis to sweep", expected, nearest(self.of, swept) or "choose another")
        for number, (path, values) in enumerate(leaves := [*nested_leaves(self.over)]):
            if given_before(".".join(path), [".".join(other) for other, _ in leaves[:number]]) is not None:
                report.wrong(("over", *path), "gives values a second time", "every key once", "leave one of both out")
            problem = complaint(values)
            if problem is not None:
                report.wrong(("over", *path), *problem, "write for example `over = { mode.harmonics = [3, 5, 7] }`")
        if self.dampers:
            report.wrong(("dampers",), "are not those of the analysis swept", "none", f"give them to '{self.of}'")

    def headline(self) -> str:
        plan = self.plan()
        over = " x ".join(f"{key} = {', '.join(map(str, values))}" for key, values in plan.over.items())
        return f"'{self.of}' for every value of {over}: {len(plan)} branches"

    def run(self, context: AnalysisContext[SweepAnalysis]) -> Outcome:
        raise FretwaveError(
            "a sweep has no model of its own", f"analysis '{self.name}'", fix="run it as part of a case"
        )
