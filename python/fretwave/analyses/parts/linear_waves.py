"""Linear modes of a wave with its contacts in every limit, as rows of a table, and what engine orders meet."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Optional

import numpy as np

from ...case.wheel import on_wheel
from ...columns import MODAL_UNIT, Column
from ...errors import NothingMoves
from ...model.sectors import Term, in_wave
from ...post.engine_orders import exciting, margins
from .asymptotes import MORE_MODES, limit_model, most_like, planes_of, sector_phase
from .context import AnalysisContext
from .damped_basis import in_damped_basis

if TYPE_CHECKING:
    from ...case.load import Case
    from ...model.model import Model
    from ...model.modes import LinearMode
    from ..linear import LinearAnalysis

#: A mode below this share of the highest is a rigid motion: no engine order meets it.
RIGID = 1e-6
#: Of the highest omega^2 what solvers leave where there is none: up to 2.4 eps in 254 solutions of loose bodies.
ROUNDING = 4 * float(np.finfo(float).eps)
#: Of a crossing, after what tells its mode.
CROSSING = ("engine_order", "speed_rpm", "frequency_hz", "margin")

COLUMNS = (
    Column("mode", "1", "number of the mode of this contact and wave, 1 is the lowest", "i"),
    Column(
        "amplitude",
        "length",
        f"largest amplitude of a dof where the mode's coordinate is 1 {MODAL_UNIT}; none of a rigid motion",
    ),
    "omega",
    "frequency_hz",
    Column("zeta", "1", "damping ratio by C, to first order: phi* C phi / (2 omega phi* M phi)"),
    Column("other_hz", "Hz", "of a stuck mode: frequency of the mode most like it with contact sliding, else free"),
)


def columns_of(sectors: int, spins: bool) -> list[str | Column]:
    """Columns of the table, of a sector and with stiffness that depends on the speed."""
    first = [Column("point", "1", "number of the row", "i"), Column("contact", "", "stuck, sliding or free", "s")]
    if sectors:
        first.append(Column("nodal_diameter", "1", "nodal diameters of the wave", "i"))
    if spins:
        first.append(Column("speed_rpm", "rev/min", "speed of the wheel"))
    return [*first, *COLUMNS]


def modes_of_wave(
    context: AnalysisContext[LinearAnalysis], diameters: int, speed_rpm: float
) -> Iterator[tuple[dict[str, Any], LinearMode]]:
    """Rows of a wave at a speed and their modes, limit by limit. Collective."""
    case, theta = _spinning(context, speed_rpm), sector_phase(context.case, diameters)
    C = case.damped(context.analysis.dampers).C
    found = {limit: _modes(context, case, limit, diameters, C) for limit in _limits(context)}
    loose = next((found[limit] for limit in ("sliding", "free") if limit in found), [])
    for limit, modes in found.items():
        sought = limit == "stuck" and bool(loose)
        for number, mode in enumerate(modes[: _count(context)], 1):
            yield (
                {
                    "contact": limit,
                    "nodal_diameter": diameters,
                    "speed_rpm": speed_rpm,
                    "mode": number,
                    "amplitude": float(np.hypot(mode.shape, mode.imaginary).max()) if mode.omega else np.nan,
                    "omega": mode.omega,
                    "frequency_hz": mode.frequency_hz,
                    "zeta": damping_ratio(mode, C, theta),
                    "other_hz": most_like(context, loose, mode, diameters).frequency_hz if sought else np.nan,
                },
                mode,
            )


def _count(context: AnalysisContext[LinearAnalysis], more: int = 0) -> int:
    """Modes that are told, or more: of a wheel as many for each of its sectors."""
    return (context.analysis.modes + more) * (context.case.wheel.sectors if context.case.wheel else 1)


def _spinning(context: AnalysisContext[LinearAnalysis], speed_rpm: float) -> Case:
    if context.analysis.speeds_rpm is None:
        return context.case
    case = (context.case.sector or context.case).turning(context.analysis.spin_stiffness, speed_rpm)
    return on_wheel(case, context.analysis)


def _limits(context: AnalysisContext[LinearAnalysis]) -> list[str]:
    contacts = context.case.contacts
    return context.analysis.limits(any(contact.sliding() is not None for contact in contacts), bool(contacts))


def _modes(
    context: AnalysisContext[LinearAnalysis], case: Case, limit: str, diameters: int, C: Optional[Term]
) -> list[LinearMode]:
    """Modes of a wave; where another's likeness is sought among them, more than are told. Maybe none. Collective."""
    with limit_model(case, context.comm, limit, diameters) as model:
        limits = _limits(context)
        sought = "stuck" in limits and limit == next((one for one in ("sliding", "free") if one in limits), "")
        count = _count(context, MORE_MODES if sought else 0)
        try:
            modes = _with_their_planes(model, count)
        except NothingMoves:
            if limit != "stuck" or context.analysis.contact == ["stuck"]:
                raise
            context.console.line(f"{context.name}: contact that sticks leaves nothing to move")
            return []
    modes = without_rounding(modes, case.structure.K, sector_phase(context.case, diameters))
    told = _count(context) if sought else count
    last = int(planes_of(modes)[-1][0]) if len(modes) > count else count  # of which others may be left out
    return in_damped_basis(modes, C, sector_phase(context.case, diameters))[: max(told, last)]


def _with_their_planes(model: Model, count: int) -> list[LinearMode]:
    """So many modes, and the others of the last one's frequency: which of them are damped, all tell. Collective."""
    from ...model.modes import linear_modes

    asked = count
    while True:
        asked = min(model.n_dof, asked + 1)
        modes = linear_modes(model, asked)
        if len(modes) < asked or asked == model.n_dof or planes_of(modes)[-1][0] >= count:
            return modes


def without_rounding(modes: Sequence[LinearMode], K: Optional[Term], theta: float = 0.0) -> list[LinearMode]:
    """The same modes, at zero those whose frequency is what rounding left of the others'; theta of a sector's wave.

    Their omega^2 are below some eps of the highest, and not what K makes of their shape.
    """
    bound = ROUNDING * max((mode.omega**2 for mode in modes), default=0.0)
    return [replace(mode, omega=0.0) if _left_by_rounding(mode, K, theta, bound) else mode for mode in modes]


def _left_by_rounding(mode: LinearMode, K: Optional[Term], theta: float, bound: float) -> bool:
    if K is None or not 0.0 < mode.omega**2 <= bound:
        return False
    phi = mode.shape + 1j * mode.imaginary
    return float((phi.conj() @ in_wave(K, phi, theta)).real) < 0.5 * mode.omega**2


def damping_ratio(mode: LinearMode, C: Optional[Term], theta: float = 0.0) -> float:
    """Modal damping ratio of an undamped mode of unit modal mass, to first order in C; theta of a sector's wave."""
    if C is None or not mode.omega:
        return 0.0
    phi = mode.shape + 1j * mode.imaginary
    return float((phi.conj() @ in_wave(C, phi, theta)).real / (2 * mode.omega))


def crossings_of(
    rows: Sequence[Mapping[str, Any]], orders: Sequence[int], sectors: int, speed_rpm: float
) -> tuple[list[str], list[dict[str, Any]]]:
    """Columns and rows of the table of crossings: every mode with the orders that excite its wave."""
    highest = max((row["frequency_hz"] for row in rows), default=0.0)
    names = ["contact", "nodal_diameter", "mode"] if sectors else ["contact", "mode"]
    modes: dict[tuple[Any, ...], list[Mapping[str, Any]]] = {}
    for row in rows:
        modes.setdefault(tuple(row[name] for name in ("contact", "nodal_diameter", "mode")), []).append(row)
    found = []
    for (_, diameters, _), mode in modes.items():
        hz = np.array([row["frequency_hz"] for row in mode])
        if hz.max() > RIGID * highest:
            speeds, known = np.array([row["speed_rpm"] for row in mode]), {name: mode[0][name] for name in names}
            found += margins(known, speeds, hz, exciting(orders, diameters, sectors), speed_rpm)
    return [*names, *CROSSING], found
