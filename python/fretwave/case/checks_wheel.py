"""Checks of the keys that put an analysis on a sector or the whole wheel: `nodal_diameter`, `wheel`, `mistuning`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..cyclic.engine_order import folded
from ..errors import InputError
from ..model.structure import Structure
from ..texts import nearest
from .analysis_tables import MistuningSection
from .checks_common import about
from .pair_values import ValueTable
from .reporter import Reporter
from .wheel import deviations_of

if TYPE_CHECKING:
    from .analysis import AnalysisSection
    from .facts import Facts
    from .harmonic import HarmonicSection


def check_wave(report: Reporter, analysis: HarmonicSection, facts: Facts) -> None:
    """Analyses of a sector say their nodal diameter; no others do."""
    given = analysis.nodal_diameter
    if facts.neighbours is None:
        if given is not None:
            fix = "remove the key, or give [model] its sectors"
            about(report, "nodal_diameter", "is of no sector of a wheel", "a model with sectors", fix)
        return
    sectors = facts.neighbours.sectors
    half = sectors // 2
    if analysis.integrates() or (abs(given) <= half if given is not None else analysis.mistuning is not None):
        return
    what, fix = "says no nodal diameter", "add for example `nodal_diameter = 1`"
    if given is not None:
        what, fix = "has no such nodal diameter", f"write `nodal_diameter = {folded(given, sectors)}`, the same wave"
    about(report, "nodal_diameter", what, f"-{half} .. {half}, negative for backward waves", fix)


def with_measured(report: Reporter, analysis: AnalysisSection, facts: Facts) -> AnalysisSection:
    """The analysis with the deviations of its sectors that a table gives."""
    mistuning = analysis.whole_wheel()[1]
    if mistuning is None or not isinstance(mistuning.deviations, str) or not facts.sectors:
        return analysis
    source, path = report.source, (*report.path, "mistuning", "deviations")
    file = source.path.parent / mistuning.deviations
    try:
        values = ValueTable(file, "deviation", "", source.where(path), -1.0, True, "sector").values(facts.sectors)
    except InputError as error:
        report.found.append(error)
        return analysis
    return analysis.model_copy(update={"mistuning": mistuning.model_copy(update={"deviations": values})})


def check_wheel(report: Reporter, analysis: HarmonicSection, facts: Facts) -> None:
    """All that is wrong with the keys of the whole wheel."""
    neighbours = facts.neighbours
    if analysis.wheel and neighbours is None:
        report.wrong(("wheel",), "is of no sector of a wheel", "a model with sectors", "remove the key, or add sectors")
    for key in ("mistuning", "sector"):
        if getattr(analysis, key) is not None:
            check_needs_wheel(report, analysis, key)
    if neighbours is not None:
        _check_on_wheel(report, analysis, neighbours, len(facts.dofs or ()))


def check_needs_wheel(report: Reporter, analysis: AnalysisSection, key: str) -> None:
    """A key that means something on a whole wheel alone."""
    if not analysis.whole_wheel()[0]:
        report.wrong((key,), "needs the whole wheel", "beside `wheel = true`", "add `wheel = true`, or remove the key")


def _check_on_wheel(report: Reporter, analysis: HarmonicSection, neighbours: Structure, n_dof: int) -> None:
    n = neighbours.sectors
    if analysis.sector is not None and analysis.sector >= n:
        report.wrong(("sector",), "does not exist", f"0 to {n - 1}", "write `sector = 0`, or leave the key out")
    if analysis.mistuning is not None:
        check_mistuning(report, analysis.mistuning, neighbours)
        if analysis.nodal_diameter is None and n_dof and analysis.linear_mode > n * n_dof:
            expected = f"1 to {n * n_dof}, the number of the wheel's dofs"
            report.wrong(("linear_mode",), "does not exist", expected, "write `linear_mode = 1`")


def check_mistuning(given_to: Reporter, mistuning: MistuningSection, neighbours: Structure) -> None:
    """All that is wrong with the deviations of an analysis."""
    report = Reporter(given_to.source, (*given_to.path, "mistuning"), given_to.found)
    if mistuning.of not in neighbours.parts:
        known = list(neighbours.parts)
        fix = nearest(mistuning.of, known) or "name a part that the builder gives (Structure.parts)"
        report.wrong(("of",), "is no part of the stiffness", f"one of {', '.join(known)}", fix)
    given, drawn = mistuning.deviations, mistuning.standard_deviation
    if given is None and drawn is None:
        fix = "add for example `standard_deviation = 0.02`"
        report.wrong((), "says no deviations", "standard_deviation, or deviations", fix)
    if given is None and drawn is not None and deviations_of(mistuning, neighbours.sectors).min() <= -1.0:
        fix = "take a smaller standard_deviation, or another seed"
        report.wrong((), "draws a stiffness that is not positive", "deviations above -1", fix)
    if given is not None:
        for key in ("standard_deviation", "seed"):
            if key in mistuning.model_fields_set:
                report.wrong((key,), "is given beside deviations", "deviations drawn, or given", "remove one of them")
        if not isinstance(given, str) and len(given) != neighbours.sectors:
            expected = f"{neighbours.sectors} numbers, one for each sector"
            report.wrong(("deviations",), f"has {len(given)} numbers", expected, "give one for each sector")
