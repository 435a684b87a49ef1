"""``[material]`` and ``[[gauge]]``: what `fretwave stress` makes of the motion of a run; no result depends on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Array
from ..errors import CaseErrors, FretwaveError
from ..model.structure import Structure
from .odd_material import odd_material
from .reporter import Reporter
from .schema import GaugeSection, MaterialSection
from .toml.source import Source
from .toml.validation import validate

#: Keys of [material] that are given together.
_TOGETHER = (("youngs_modulus", "poisson_ratio"), ("endurance_limit", "ultimate_strength"))


@dataclass(frozen=True)
class Gauges:
    """The tables of a case.

    Attributes
    ----------
    material : empty where the case has none
    gauges : in the order of the case
    """

    material: MaterialSection
    gauges: Sequence[GaugeSection] = ()

    @property
    def elastic(self) -> tuple[float, float] | None:
        """Young's modulus [pressure] and Poisson's ratio; None where they are not known."""
        E, nu = self.material.youngs_modulus, self.material.poisson_ratio
        return None if E is None or nu is None else (E, nu)

    @property
    def limits(self) -> tuple[float, float] | None:
        """Endurance limit and ultimate strength [pressure]; None where they are not known."""
        endurance, ultimate = self.material.endurance_limit, self.material.ultimate_strength
        return None if endurance is None or ultimate is None else (endurance, ultimate)

    @property
    def directions(self) -> Array:
        """(n_gauges, 3) unit vectors."""
        given = np.array([gauge.direction for gauge in self.gauges]).reshape(-1, 3)
        return np.asarray(given / np.linalg.norm(given, axis=1, keepdims=True))

    def lines(self) -> list[str]:
        """For `fretwave check`."""
        return [f"gauge '{gauge.name}': {_place(gauge)} along {_vector(gauge.direction)}" for gauge in self.gauges]


def gauges_now(source: Source, structure: Structure) -> Gauges:
    """Of a case file as it is now, on the model of a run.

    Raises
    ------
    CaseErrors
        The tables are wrong, or the material is no solid's.
    """
    found: list[FretwaveError] = []
    gauges = read_gauges(source, structure, found)
    found += odd_material(gauges.material, source, structure)
    if found:
        raise CaseErrors(found, source.label)
    return gauges


def read_gauges(source: Source, structure: Structure | None, found: list[FretwaveError]) -> Gauges:
    """Both tables, checked; what is wrong is appended.

    Parameters
    ----------
    structure : of a sector as it was before its faces were tied; None where it could not be read
    """
    material = validate(MaterialSection, source, ("material",), found) if "material" in source.data else None
    sections = [validate(GaugeSection, source, ("gauge", k), found) for k in range(len(source.entries("gauge")))]
    if material is not None:
        _check_material(Reporter(source, ("material",), found), material)
    for k, gauge in enumerate(sections):
        if gauge is not None:
            _check_gauge(Reporter(source, ("gauge", k), found), gauge, structure)
    return Gauges(material or MaterialSection(), [gauge for gauge in sections if gauge is not None])


def _check_material(report: Reporter, material: MaterialSection) -> None:
    for pair in _TOGETHER:
        for one, other in (pair, pair[::-1]):
            if getattr(material, one) is not None and getattr(material, other) is None:
                report.wrong((one,), f"is given without {other}", "both or none", f"add `{other}`, or remove {one}")
    if material.endurance_limit is not None and material.youngs_modulus is None:
        fix = "add `youngs_modulus` and `poisson_ratio`"
        report.wrong(("endurance_limit",), "is a limit of a stress that is not known", "the elastic constants", fix)


def _check_gauge(report: Reporter, gauge: GaugeSection, structure: Structure | None) -> None:
    if (gauge.node is None) == (gauge.point is None):
        report.wrong((), "has no place, or two", "`node` or `point`", "give one of them")
    elif structure is not None:
        from .gauge_places import check_place

        check_place(report, gauge, structure)
    if not np.linalg.norm(gauge.direction) > 0 or not np.isfinite(gauge.direction).all():
        report.wrong(("direction",), "is none", "a vector of some length", "write for example `[1.0, 0.0, 0.0]`")
    sectors = max(structure.sectors, 1) if structure is not None else gauge.sector + 1
    if gauge.sector >= sectors:
        report.wrong(("sector",), "is none of the model", f"0 to {sectors - 1}", "correct the key, or remove it")


def _place(gauge: GaugeSection) -> str:
    where = f"node {gauge.node}" if gauge.point is None else f"point {_vector(gauge.point)}"
    return where + (f" of sector {gauge.sector}" if gauge.sector else "")


def _vector(values: Sequence[float]) -> str:
    return "(" + ", ".join(f"{x:g}" for x in values) + ")"
