"""Checks of the tables [reduction] and [preload] of a case."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..model.law_info import Role
from .checks_common import check_loads
from .reporter import Found, Reporter
from .schema import PreloadSection, ReductionSection
from .toml.source import Source

if TYPE_CHECKING:
    from ..model.contact import Contact
    from .analysis import AnalysisSection
    from .facts import Facts

#: Keys of [reduction] that say which interface modes there are.
_OF_MODES = ("interface_diameters", "interface_waves", "interface_tolerance")
Analyses = Mapping[int, "AnalysisSection"]


def check_reduction(
    source: Source,
    section: ReductionSection | None,
    analyses: Analyses,
    facts: Facts,
    notes: list[str],
    found: Found,
) -> None:
    """Component modes are chosen in one way; faces are those of a sector, and their waves exist."""
    if section is None:
        return
    report = Reporter(source, ("reduction",), found)
    given = [name for name in ("modes", "up_to_hz", "accuracy") if getattr(section, name) is not None]
    for name in given[1:]:
        expected = "one of modes, up_to_hz and accuracy"
        report.wrong((name,), f"is given beside {given[0]}", expected, "remove one of them")
    if section.accuracy is not None and section.compare == 0:
        report.wrong(("accuracy",), "is of no frequency", "frequencies to compare", "give `compare` 1 or more")
    if section.error_at is not None and not any(analysis.passes(section.error_at) for analysis in analyses.values()):
        notes.append(f"reduction.error_at = {section.error_at:g} is on no mode's branch: no error is estimated there")
    sectors = facts.sectors
    if sectors is None:
        for key in ("interface", *_OF_MODES, "compare_diameters") if facts.model_known else ():
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
    for key in _OF_MODES if section.interface == "whole" else ():
        if key in section.model_fields_set:
            report.wrong((key,), "has no effect", "interface modes", 'add `interface = "modes"`')
    if section.compare == 0 and section.compare_diameters is not None:
        report.wrong(("compare_diameters",), "has no effect", "frequencies to compare", "give `compare` 1 or more")


def _spatial_indices(analyses: Analyses, sectors: int) -> set[int]:
    """Nodal diameters of the first and third harmonic of the analyses' waves."""
    indices = {n * d % sectors for d in waves_of(analyses.values()) for n in (1, 3)}
    return {min(index, sectors - index) for index in indices}


def waves_of(analyses: Iterable[AnalysisSection]) -> list[int]:
    """Nodal diameters that analyses name."""
    sections = [analysis.harmonic() for analysis in analyses]
    return [s.nodal_diameter for s in sections if s is not None and s.nodal_diameter is not None]


def check_preload(source: Source, section: PreloadSection | None, loads: Sequence[str] | None, found: Found) -> None:
    """Loads come with the model (None: it is not known)."""
    if loads is not None:
        check_loads(Reporter(source, ("preload",), found), section, loads)


def implied_preload(source: Source, contacts: Sequence[Contact], notes: list[str]) -> PreloadSection | None:
    """Of a case without [preload]: pairs that press by themselves are in balance as they are, which is noted.

    Where a law with a memory presses, then of all contacts; others alone may be integrated in time, which knows no
    preload: they move the structure.
    """
    pressing = {} if "preload" in source.data else {c.name: told for c in contacts if (told := _pressing(c))}
    kept = [c.name for c in contacts if c.info.memory and c.name in pressing]
    for name, (role, what) in pressing.items():
        said = f"contact '{name}': its {what}"
        if kept:
            said += " is taken as balanced, for there is no [preload]; `[preload] balanced = false` lets it move the"
            notes.append(f"{said} structure")
        elif role is Role.GAP:
            notes.append(f"{said} moves the structure, for there is no [preload]")
    return PreloadSection() if kept else None


def _pressing(contact: Contact) -> tuple[Role, str] | None:
    """What presses a contact's pairs without displacement, also in words."""
    load, gap = contact.value(Role.LOAD), contact.value(Role.GAP)
    if load is not None and np.any(load):
        return Role.LOAD, str(contact.info.named(Role.LOAD))
    if gap is None or np.min(gap, initial=0.0) >= 0:
        return None
    return Role.GAP, f"{contact.info.named(Role.GAP)} (an interference)"
