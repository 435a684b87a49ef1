"""Checks of the tables [reduction] and [preload], and of what analyses make of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from ..errors import InputError
from ..model.contact import Contact
from ..model.laws import law_like
from ..texts import nearest
from .contacts import wear_areas
from .reporter import Found, Reporter
from .schema import AnalysisSection, PreloadSection, ReductionSection, StaticAnalysis, TransientSection, WearAnalysis
from .toml.source import Source

Analyses = Mapping[int, AnalysisSection]


def check_reduction(
    source: Source, section: ReductionSection | None, analyses: Analyses, sectors: int | None, found: Found
) -> None:
    """Component modes are chosen in one way; faces are those of a sector, and their waves exist."""
    if section is None:
        return
    report = Reporter(source, ("reduction",), found)
    if section.modes is not None and section.up_to_hz is not None:
        report.wrong(("up_to_hz",), "is given beside modes", "a number of modes, or a frequency", "remove one of them")
    if sectors is None:
        for key in ("interface", "interface_diameters", "compare_diameters"):
            if key in section.model_fields_set:
                report.wrong((key,), "is of no sector of a wheel", "a model with sectors", "remove the key")
        return
    for key in ("interface_diameters", "compare_diameters"):
        for index, given in enumerate(getattr(section, key) or ()):
            if given > sectors // 2:
                report.wrong((key, index), "is no nodal diameter of the wheel", f"0 to {sectors // 2}", "remove it")
    if section.interface == "modes" and section.interface_diameters is None:
        shown = sorted(_spatial_indices(analyses, sectors)) or [1]
        fix = f"interface_diameters = {shown}, those of the first and third harmonic of the analyses"
        report.wrong(("interface",), "has no waves to come from", "their nodal diameters", fix)
    if section.interface == "whole" and section.interface_diameters is not None:
        report.wrong(("interface_diameters",), "has no effect", "interface modes", 'add `interface = "modes"`')


def _spatial_indices(analyses: Analyses, sectors: int) -> set[int]:
    """Nodal diameters of the first and third harmonic of the analyses' waves."""
    given = [getattr(analysis, "nodal_diameter", None) for analysis in analyses.values()]
    indices = {n * d % sectors for d in given if d is not None for n in (1, 3)}
    return {min(index, sectors - index) for index in indices}


def check_wear(
    source: Source,
    analyses: Analyses,
    contacts: Sequence[Contact],
    found: Found,
) -> None:
    """Wear needs a contact with a normal direction, and the areas of its pairs."""
    for number, analysis in analyses.items():
        if isinstance(analysis, WearAnalysis):
            try:
                wear_areas(contacts)
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


def check_memory(
    source: Source, analyses: Analyses, contacts: Sequence[Contact], laws: Mapping[str, Any], found: Found
) -> None:
    """Time integration sees the present motion alone: a slider's place is no part of its state."""
    named = next((contact for contact in contacts if getattr(laws.get(str(contact.law)), "memory", False)), None)
    for number, analysis in analyses.items():
        transient = isinstance(analysis, TransientSection)
        if named is not None and (transient or getattr(analysis, "time_points", False)):
            Reporter(source, ("analysis", number), found).wrong(
                ("type" if transient else "time_points",),
                f"needs time integration, which does not know the law '{named.law}' of contact '{named.name}'",
                f"a law of the present motion, such as {law_like(lambda law: not law.memory)}",
                "remove the analysis, or take such a law" if transient else "write `time_points = 0`",
            )


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
