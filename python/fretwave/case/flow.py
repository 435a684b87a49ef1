"""``[aerodynamics]`` of a case: its checks, and the terms it adds to a sector's model."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from .reporter import Found, Reporter
from .schema import AerodynamicsSection
from .toml.source import Source

#: A number of sectors as a key.
WHOLE = re.compile("-?[0-9]{1,9}")

if TYPE_CHECKING:
    from ..cyclic.aerodynamics import Aerodynamics
    from ..model.sectors import Term
    from .facts import Facts
    from .load import Case


def with_flow(case: Case, K: Term, C: Term | None, nodal_diameter: int) -> tuple[Term, Term | None]:
    """K and C of a sector in a wave, or of the wheel that a case was put on, with what the flow adds to them."""
    from ..cyclic.aerodynamics import period_of, with_terms
    from ..model.wheel_matrix import WheelMatrix

    sector = case.sector or case
    assert sector.neighbours is not None
    number = sector.neighbours.sectors
    period = period_of(nodal_diameter, number) if case.wheel is None else None
    added = flow_of(sector).terms(sector.structure.M, period)
    if case.wheel is not None:
        added = {letter: {0: WheelMatrix(with_terms(None, parts), number)} for letter, parts in added.items() if parts}
    return with_terms(K, added.get("K", {})), with_terms(C, added.get("C", {}))


def flow_of(case: Case) -> Aerodynamics:
    """Of a sector's case with ``[aerodynamics]``."""
    from ..cyclic.aerodynamics import Aerodynamics

    section, neighbours = case.aerodynamics, case.neighbours
    assert section is not None and neighbours is not None
    omega = 2 * np.pi * section.frequency
    if section.damping is not None:
        ratios = {int(d): ratio for d, ratio in section.damping.items()}
        return Aerodynamics.from_damping(ratios, neighbours.sectors, omega)
    coefficients = {int(k): complex(*L) for k, L in (section.influence or {}).items()}
    return Aerodynamics(coefficients, omega, None if section.dof is None else case.dof(section.dof))


def check_aerodynamics(
    source: Source, section: AerodynamicsSection | None, sectors: int | None, dofs: Sequence[str], found: Found
) -> None:
    """Coefficients of blades that the wheel has, given in one way."""
    if section is not None:
        _check_section(Reporter(source, ("aerodynamics",), found), section, sectors, dofs)


def check_damped(report: Reporter, key: str, waves: Iterable[int], facts: Facts) -> None:
    """Waves that an analysis looks at are among those whose damping by the flow is given."""
    section, sectors = facts.flow, facts.sectors
    if section is None or section.damping is None or sectors is None:
        return
    named = {int(text) % sectors for text in section.damping if WHOLE.fullmatch(text)}
    missing = [d for d in waves if d % sectors not in named]
    if missing:
        expected = f"damping of nodal diameters {', '.join(map(str, missing))} in [aerodynamics]"
        fix = "add it (0.0 where there is none)" + (", or name nodal_diameters" if key != "aerodynamics" else "")
        report.wrong((key,), "looks at waves without a damping", expected, fix)


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
        if not WHOLE.fullmatch(text) or abs(int(text)) > sectors // 2:
            report.wrong((key, text), "is not of this wheel", expected, f"write for example `{key} = {{ 1 = ... }}`")
        elif int(text) % sectors in seen:
            first = seen[int(text) % sectors]
            report.wrong((key, text), f"is the same as '{first}' on {sectors} sectors", "each once", "remove one")
        else:
            seen[int(text) % sectors] = text
