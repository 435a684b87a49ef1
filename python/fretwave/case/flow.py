"""``[aerodynamics]`` of a case: its checks, and the terms it adds to a sector's model."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from .reporter import Found, Reporter
from .schema import AerodynamicsSection, AnalysisSection, FlutterAnalysis
from .toml.source import Source

#: A number of sectors as a key.
_WHOLE = re.compile("-?[0-9]{1,9}")

if TYPE_CHECKING:
    from ..cyclic.aerodynamics import Aerodynamics
    from .load import Case


def with_flow(case: Case, K: Any, C: Any, nodal_diameter: int) -> tuple[Any, Any]:
    """K and C of a sector in a wave, or of the wheel that a case was put on, with what the flow adds to them."""
    from ..cyclic.aerodynamics import period_of, with_terms
    from ..model.sectors import around

    sector = case.sector or case
    assert sector.aerodynamics is not None and sector.neighbours is not None
    number = sector.neighbours.sectors
    period = period_of(nodal_diameter, number) if case.wheel is None else None
    added = _flow(sector, sector.aerodynamics, number).terms(sector.structure.M, period)
    if case.wheel is not None:
        added = {letter: {0: around(with_terms(None, parts), number)} for letter, parts in added.items() if parts}
    return with_terms(K, added.get("K", {})), with_terms(C, added.get("C", {}))


def _flow(case: Case, section: AerodynamicsSection, sectors: int) -> Aerodynamics:
    from ..cyclic.aerodynamics import Aerodynamics

    omega = 2 * np.pi * section.frequency
    if section.damping is not None:
        return Aerodynamics.from_damping({int(d): ratio for d, ratio in section.damping.items()}, sectors, omega)
    coefficients = {int(k): complex(*L) for k, L in (section.influence or {}).items()}
    return Aerodynamics(coefficients, omega, None if section.dof is None else case.dof(section.dof))


def diameters_of(analysis: FlutterAnalysis, sectors: int) -> list[int]:
    """Nodal diameters of a flutter analysis: those it names, or all forward and backward waves."""
    if analysis.nodal_diameters is not None:
        return list(analysis.nodal_diameters)
    return list(range(-((sectors - 1) // 2), sectors // 2 + 1))


def check_aerodynamics(
    source: Source,
    section: AerodynamicsSection | None,
    analyses: Mapping[int, AnalysisSection],
    sectors: int | None,
    dofs: Sequence[str],
    found: Found,
) -> None:
    """Coefficients of blades that the wheel has, given in one way; analyses that use them have them."""
    given = "aerodynamics" in source.data
    if section is not None:
        _check_section(Reporter(source, ("aerodynamics",), found), section, sectors, dofs)
    for number, analysis in analyses.items():
        report = Reporter(source, ("analysis", number), found)
        flutter = isinstance(analysis, FlutterAnalysis)
        if (flutter or getattr(analysis, "aerodynamics", False)) and not given:
            key = "type" if flutter else "aerodynamics"
            report.wrong((key,), "needs forces of the flow", "a table [aerodynamics]", "add [aerodynamics]")
        if isinstance(analysis, FlutterAnalysis) and sectors is not None:
            _check_flutter(report, analysis, section, sectors)


def _check_section(report: Reporter, section: AerodynamicsSection, sectors: int | None, dofs: Sequence[str]) -> None:
    if sectors is None:
        report.wrong((), "is of no sector of a wheel", "a model with sectors", "remove it, or give [model] its sectors")
        return
    if (section.influence is None) == (section.damping is None):
        what = "are given beside each other" if section.influence is not None else "are both missing"
        report.wrong(("damping",), f"and influence {what}", "one of the two", "give influence, or damping")
    for key in ("influence", "damping"):
        _check_places(report, key, getattr(section, key) or {}, sectors)
    for k, value in (section.influence or {}).items():
        if len(value) != 2:
            report.wrong(("influence", k), "is no complex number", "[real, imaginary]", f"write `{k} = [0.0, -1.0]`")
    if section.dof is not None:
        report.dof(("dof",), section.dof, dofs)
        if section.influence is None:
            report.wrong(("dof",), "is not for damping", "modal damping ratios", "remove it, or give influence")


def _check_places(report: Reporter, key: str, given: Mapping[str, Any], sectors: int) -> None:
    """Whole numbers of sectors, each place (or wave) once."""
    seen: dict[int, str] = {}
    for text in given:
        expected = f"-{sectors // 2} .. {sectors // 2}"
        if not _WHOLE.fullmatch(text) or abs(int(text)) > sectors // 2:
            report.wrong((key, text), "is not of this wheel", expected, f"write for example `{key} = {{ 1 = ... }}`")
        elif int(text) % sectors in seen:
            first = seen[int(text) % sectors]
            report.wrong((key, text), f"is the same as '{first}' on {sectors} sectors", "each once", "remove one")
        else:
            seen[int(text) % sectors] = text


def _check_flutter(
    report: Reporter, analysis: FlutterAnalysis, section: AerodynamicsSection | None, sectors: int
) -> None:
    if analysis.nodal_diameter is not None:
        number = analysis.nodal_diameter
        fix = f"write `nodal_diameters = [{number}]`"
        report.wrong(("nodal_diameter",), "is one wave; flutter looks at several", "nodal_diameters", fix)
    if analysis.wheel:
        report.wrong(("wheel",), "is for modes; flutter follows waves on one sector", "one sector", "remove the key")
    half = sectors // 2
    for index, diameters in enumerate(analysis.nodal_diameters or []):
        if abs(diameters) > half:
            expected = f"-{half} .. {half}, negative for backward waves"
            report.wrong(("nodal_diameters", index), "is no wave of this wheel", expected, "take it out")
    if section is None or section.damping is None:
        return
    named = {int(text) % sectors for text in section.damping if _WHOLE.fullmatch(text)}
    missing = [d for d in diameters_of(analysis, sectors) if d % sectors not in named]
    if missing:
        key = "type" if analysis.nodal_diameters is None else "nodal_diameters"
        expected = f"damping of nodal diameters {', '.join(map(str, missing))} in [aerodynamics]"
        report.wrong((key,), "looks at waves without a damping", expected, "add it, or name nodal_diameters")
