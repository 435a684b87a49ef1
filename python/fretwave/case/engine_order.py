"""Engine orders of a case: which wave of the sector each drives, and whether the case says it right."""

from __future__ import annotations

from ..cyclic.engine_order import folded
from .reporter import Found, Reporter
from .schema import AnalysisSection, ForcedAnalysis
from .toml.source import Source


def fold_engine_orders(source: Source, analyses: dict[int, AnalysisSection], sectors: int | None, found: Found) -> None:
    """Give every analysis with an engine order its nodal diameter."""
    for number, analysis in analyses.items():
        if not isinstance(analysis, ForcedAnalysis):
            continue
        report = Reporter(source, ("analysis", number), found)
        order, given = analysis.engine_order, analysis.nodal_diameter
        if order is None:
            _check_wave(report, analysis, sectors)
        elif sectors is None:
            report.wrong(("engine_order",), "is of no sector of a wheel", "a model with sectors", "remove the key")
        elif order == 0:
            report.wrong(("engine_order",), "is steady", "1 or more, or -1 or less", "take a mean load to [preload]")
        elif given is not None and given % sectors != order % sectors:
            expected = f"{folded(order, sectors)}, which engine order {order} drives on {sectors} sectors"
            report.wrong(("nodal_diameter",), "is not that of the engine order", expected, "remove nodal_diameter")
        else:
            analyses[number] = analysis.model_copy(update={"nodal_diameter": folded(order, sectors)})


def _check_wave(report: Reporter, analysis: ForcedAnalysis, sectors: int | None) -> None:
    """A mistuned wheel has no wave of its own, but its excitation has."""
    if sectors is not None and analysis.mistuning is not None and analysis.nodal_diameter is None:
        fix = "add for example `engine_order = 4`"
        report.wrong(("engine_order",), "is missing", "the order of the excitation, or nodal_diameter", fix)
