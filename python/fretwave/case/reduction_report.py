"""What a reduction of a case did, for the log and the results."""

from __future__ import annotations

import itertools
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, Any, Dict, List, Tuple, cast

import numpy as np

from ..model.compared import off_by
from ..model.contact import Contact, in_limit
from ..model.structure import SPIN

if TYPE_CHECKING:
    from mpi4py import MPI

    from ..cyclic.reduction import SectorReduction
    from ..cyclic.waves import WaveError
    from ..model.reduction import Reduction
    from .load import Case

#: Lowest frequencies [Hz] of an unreduced model by the part of its stiffness that grows with the speed squared, the
#: speed [rev/min], the nodal diameter and the limit of its contact.
FullHz = Dict[Tuple[str, float, int, str], List[float]]


@dataclass(frozen=True)
class ReductionReport:
    """What a reduction did.

    Attributes
    ----------
    unreduced, kept, component_modes : int
        Dofs before, kept among them, and modes added.
    highest_component_hz : float
        Frequency of the last component mode.
    full_hz, reduced_hz : list of float
        Lowest linear frequencies with stuck contact, without and with reduction.
    relative : list of float or None
        reduced / full - 1, None at 0 Hz: of a rigid or unstable motion.
    wall_s : float
        Of the reduction; `compare_wall_s` that of the comparison.
    interface : int
        Coordinates of one face of a sector.
    waves : list of dict
        Of a sector: the comparison for each nodal diameter, contact stuck and sliding (`fretwave.WaveError`); that of
        the first stands above.
    wave_lines : list of str
        The same for the log.
    speeds : list of dict
        The comparison at the lowest and the highest speed of analyses, contact stuck and sliding, for each nodal
        diameter.
    chosen : str
        How its component modes were, for the log; empty where they were told.
    sliding : dict
        Of a structure: the same comparison with every pair closed and sliding without friction (of a law without a
        normal direction: with no contact); empty where that is not another limit.
    faces : int
        Dofs of a sector's faces, which no component mode moves.
    """

    unreduced: int
    kept: int
    component_modes: int
    highest_component_hz: float
    full_hz: list[float]
    reduced_hz: list[float]
    relative: list[float | None]
    wall_s: float
    compare_wall_s: float
    interface: int = 0
    waves: list[dict[str, Any]] = field(default_factory=list)
    wave_lines: list[str] = field(default_factory=list)
    speeds: list[dict[str, Any]] = field(default_factory=list)
    chosen: str = ""
    sliding: dict[str, Any] = field(default_factory=dict)
    faces: int = 0

    @property
    def inner(self) -> int:
        """Dofs that component modes move: no more of these than that."""
        return self.unreduced - self.kept - self.faces

    def every_comparison(self) -> list[tuple[list[float], list[float | None]]]:
        """Full frequencies [Hz] and their relative errors, limit by limit, wave by wave and speed by speed."""
        further = [*([self.sliding] if self.sliding else []), *self.waves, *self.speeds]
        return [(self.full_hz, self.relative), *((found["full_hz"], found["relative"]) for found in further)]

    def plain(self) -> dict[str, Any]:
        """For run.json and results.h5."""
        return {key: value for key, value in asdict(self).items() if key not in ("wave_lines", "chosen")}

    def lines(self) -> list[str]:
        """For the log: one line, and one for each wave of a sector and each speed that was compared."""
        speeds = [f"reduction: {_line_at_speed(found)}" for found in self.speeds]
        if self.interface:
            text = (
                f"reduction: {self.unreduced} dofs to {self.kept} kept, {self.interface} of each face and"
                f" {self.component_modes} component modes (up to {self.highest_component_hz:.4g} Hz),"
                f" {self.wall_s:.1f} s"
            )
            return [*self._chosen(), text, *(f"reduction: {line}" for line in self.wave_lines), *speeds]
        sliding = [f"reduction: with sliding contact: {_off(self.sliding)}"] if self.sliding else []
        return [*self._chosen(), self._line(), *sliding, *speeds]

    def _chosen(self) -> list[str]:
        return [self.chosen] if self.chosen else []

    def _line(self) -> str:
        text = (
            f"reduction: {self.unreduced} dofs to {self.kept} kept and {self.component_modes} component modes"
            f" (up to {self.highest_component_hz:.4g} Hz), {self.wall_s:.1f} s"
        )
        if self.relative:
            off = off_by(self.full_hz, self.relative)
            text += f"; the lowest {len(self.relative)} frequencies with stuck contact: {off}"
        return text


def report_of(
    case: Case,
    reduced: Case,
    reduction: Reduction | SectorReduction,
    wall: float,
    comm: MPI.Comm,
    full_hz: FullHz,
    names: Sequence[str],
    compare: int,
) -> ReductionReport:
    """What was reduced, with the lowest frequencies before and after. Collective.

    Parameters
    ----------
    full_hz : those before as far as they are known; others are added
    names : analyses at whose speeds they are compared
    compare : how many
    """
    began = time.perf_counter()
    common: dict[str, Any] = {
        "component_modes": len(reduction.component_hz),
        "highest_component_hz": reduction.highest_component_hz,
        "wall_s": round(wall, 3),
    }
    if case.structure.cut is not None:
        found = _of_sector(case, cast("SectorReduction", reduction), compare)
    else:
        found = _of_structure(case, reduced, comm, full_hz, compare)
    found["speeds"] = _at_speeds(case, reduced, comm, full_hz, names, compare)
    return ReductionReport(**common, **found, compare_wall_s=round(time.perf_counter() - began, 3))


def _of_structure(case: Case, reduced: Case, comm: MPI.Comm, full_hz: FullHz, compare: int) -> dict[str, Any]:
    count = min(compare, reduced.structure.n_dof)
    limits = _limits(case.contacts) if count else []
    found = [_comparison((SPIN, case.speed_rpm, 0, limit), case, reduced, count, comm, full_hz) for limit in limits]
    sliding = {"sliding": found[1]} if len(found) > 1 else {}
    return {"unreduced": case.structure.n_dof, "kept": len(case.keep), **_first(found), **sliding}


def _first(found: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Frequencies of the first comparison, none where nothing is compared."""
    return {key: found[0][key] if found else [] for key in ("full_hz", "reduced_hz", "relative")}


def _limits(contacts: Sequence[Contact]) -> list[str]:
    """Limits of the contact whose linear modes differ: between them lies what a mode does in slip."""
    slides = any(contact.components > (contact.info.normal is not None) for contact in contacts)
    return ["stuck", "sliding"] if slides else ["stuck"]


def _comparison(
    key: tuple[str, float, int, str], case: Case, reduced: Case, count: int, comm: MPI.Comm, full_hz: FullHz
) -> dict[str, Any]:
    """Lowest frequencies of the unreduced and of the reduced case, as it turns there. Collective."""
    *_, diameter, limit = key
    full, small = _known_hz(full_hz, key, case, count, comm), _lowest_hz(reduced, count, comm, limit, diameter)
    full = full[: len(small)]  # rigid contact leaves the reduced model fewer modes than dofs
    return {"contact": limit, "full_hz": full, "reduced_hz": small, "relative": _relative(full, small)}


def _relative(full: list[float], small: list[float]) -> list[float | None]:
    """None at 0 Hz, which is no exact frequency but a motion that no stiffness holds."""
    return [r / f - 1 if f else None for f, r in zip(full, small)]


def _known_hz(known: FullHz, key: tuple[str, float, int, str], case: Case, count: int, comm: MPI.Comm) -> list[float]:
    """Lowest frequencies of the unreduced model, solved for once. Collective."""
    if len(known.get(key, ())) < count:
        part, speed, diameter, limit = key
        at_speed = case if speed == case.turns_at(part) else case.turning(part, speed)
        known[key] = _lowest_hz(at_speed, count, comm, limit, diameter)
    return known[key][:count]


def _at_speeds(
    case: Case, reduced: Case, comm: MPI.Comm, full_hz: FullHz, names: Sequence[str], compare: int
) -> list[dict[str, Any]]:
    """The comparison where another share of the stiffness acts than that which was reduced. Collective."""
    asked = [case.analyses[name].spins() for name in names]
    ends = dict.fromkeys((part, speed) for part, speeds in asked for speed in (*speeds[:1], *speeds[-1:]))
    count = min(compare, reduced.structure.n_dof)
    sector, found = case.structure.cut is not None, []
    for part, speed in ends if count else ():
        if speed == case.turns_at(part):
            continue  # as it was reduced
        there = reduced.turning(part, speed)
        diameters = _compared(case) if sector else [0]
        for diameter, limit in itertools.product(diameters, _limits(case.contacts)):
            values = _comparison((part, speed, diameter, limit), case, there, count, comm, full_hz)
            wave = {"nodal_diameter": diameter} if sector else {}
            found.append({"speed_rpm": speed, **wave, **values})
    return found


def _off(found: Mapping[str, Any]) -> str:
    """How far a comparison's frequencies are off."""
    return off_by(found["full_hz"], found["relative"])


def _line_at_speed(found: Mapping[str, Any]) -> str:
    """For the log."""
    wave = f"{found['nodal_diameter']} nodal diameters, " if "nodal_diameter" in found else ""
    return f"at {found['speed_rpm']:g} rev/min, {wave}{found['contact']}: {_off(found)}"


def _lowest_hz(case: Case, count: int, comm: MPI.Comm, limit: str, nodal_diameter: int = 0) -> list[float]:
    """Lowest frequencies [Hz] without damping, every pair closed and stuck or sliding."""
    from ..model.modes import linear_modes

    plain = replace(case.structure, C=None, stiffness_damping=0.0, mass_damping=0.0)
    with plain.model(in_limit(case.contacts, limit), comm, nodal_diameter) as model:
        return [float(mode.frequency_hz) for mode in linear_modes(model, count, "stuck")]


def _of_sector(case: Case, reduction: SectorReduction, compare: int) -> dict[str, Any]:
    cut = case.structure.cut
    assert cut is not None and cut.low is not None and cut.high is not None
    errors = reduction.error(_compared(case), compare) if compare else []
    waves = [_wave(error) for error in errors]
    return {
        "unreduced": cut.n_dof,
        "kept": int(reduction.low[0]),
        **_first(waves),
        "interface": reduction.n_interface,
        "faces": len(cut.low) + len(cut.high),
        "waves": waves,
        "wave_lines": [error.line() for error in errors],
    }


def _compared(case: Case) -> list[int]:
    """Nodal diameters whose error is stated: unless told, those of the analyses and of the interface modes.

    Of an analysis of many waves the least and the most.
    """
    section, cut = case.reduction, case.structure.cut
    assert section is not None and cut is not None and cut.sectors is not None
    if section.compare_diameters is not None:
        return section.compare_diameters
    waves = [[abs(d) for d in analysis.waves(cut.sectors)] for analysis in case.analyses.values()]
    found = [end for several in waves if several for end in (min(several), max(several))]
    return list(dict.fromkeys([*found, *(section.interface_diameters or ())])) or [0]


def _wave(error: WaveError) -> dict[str, Any]:
    """For run.json; rigid motions have no relative error (None)."""
    return {
        "nodal_diameter": error.nodal_diameter,
        "contact": error.state,
        "gave_interface_modes": error.gave_interface_modes,
        "full_hz": error.full_hz.tolist(),
        "reduced_hz": error.reduced_hz.tolist(),
        "relative": [float(e) if np.isfinite(e) else None for e in error.relative],
    }
