"""Checks of the tables [reduction] and [preload], and of what analyses make of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from .built import BuiltContact
from .contacts import ContactSpec, wear_areas
from .errors import InputError
from .reporter import Found, Reporter
from .schema import AnalysisSection, PreloadSection, ReductionSection, StaticAnalysis, TransientSection, WearAnalysis
from .source import Source, nearest

Analyses = Mapping[int, AnalysisSection]


def check_reduction(source: Source, section: ReductionSection | None, found: Found) -> None:
    """Component modes are chosen in one way."""
    if section is not None and section.modes is not None and section.up_to_hz is not None:
        report = Reporter(source, ("reduction",), found)
        report.wrong(("up_to_hz",), "is given beside modes", "a number of modes, or a frequency", "remove one of them")


def check_wear(
    source: Source,
    analyses: Analyses,
    contacts: Sequence[ContactSpec],
    built: Mapping[str, BuiltContact],
    found: Found,
) -> None:
    """Wear needs a contact with a normal direction, and the areas of its pairs."""
    for number, analysis in analyses.items():
        if isinstance(analysis, WearAnalysis):
            try:
                wear_areas(contacts, built)
            except InputError as error:
                where = source.where(("analysis", number, "type"))
                found.append(InputError(error.what, where, error.where or error.measured, error.expected, error.fix))


def check_preloads(
    source: Source, section: PreloadSection | None, analyses: Analyses, loads: Iterable[str] | None, found: Found
) -> None:
    """Loads come with the model (None: it is not known), factors need loads, time integration knows no preload."""
    if loads is not None:
        _check_loads(Reporter(source, ("preload",), found), section, list(loads))
    for number, analysis in analyses.items():
        own = getattr(analysis, "preload", None)
        report = Reporter(source, ("analysis", number), found)
        if loads is not None:
            _check_loads(Reporter(source, ("analysis", number, "preload"), found), own, list(loads))
        if isinstance(analysis, StaticAnalysis):
            _check_factors(report, analysis, own or section)
        elif section is not None:
            _check_time_integration(report, analysis)


def _check_loads(report: Reporter, section: PreloadSection | None, known: list[str]) -> None:
    for index, name in enumerate(section.loads if section else []):
        if name not in known:
            fix = nearest(name, known) or "static loads come with a model that is built"
            named = ", ".join(known) or "(there is none)"
            report.wrong(("loads", index), "is no load of the model", f"one of {named}", fix)


def _check_factors(report: Reporter, analysis: StaticAnalysis, section: PreloadSection | None) -> None:
    if analysis.factors != [1.0] and not (section and section.loads):
        fix = 'remove the key, or name loads: `preload = { loads = ["centrifugal"] }`'
        report.wrong(("factors",), "has no load to act on", "static loads in [preload]", fix)


def _check_time_integration(report: Reporter, analysis: AnalysisSection) -> None:
    transient = isinstance(analysis, TransientSection)
    if transient or getattr(analysis, "time_points", False):
        what, expected = "needs time integration, which does not know a preload", "analyses of harmonic balance"
        fix = "remove the analysis, or [preload]" if transient else "write `time_points = 0`"
        report.wrong(("type" if transient else "time_points",), what, expected, fix)
