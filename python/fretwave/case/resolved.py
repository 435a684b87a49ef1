"""All values of a case that decide the results, flat, under the addresses that ``--set`` uses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..model.contact import Contact
from ..model.structure import Structure
from .analysis import AnalysisSection
from .case import Tables
from .schema import ModelSection
from .toml.source import Source

#: Those of which results depend, beside [model].
TABLES = ("reduction", "preload", "damping", "aerodynamics")


def resolved_values(
    identity: Mapping[str, Any],
    source: Source,
    section: ModelSection,
    contacts: Sequence[Contact],
    analyses: Mapping[int, AnalysisSection],
    tables: Tables,
) -> dict[str, Any]:
    """All values that decide the results, flat, under the addresses that ``--set`` uses."""
    resolved = dict(identity)
    damping = {key: getattr(section, key) for key in ("stiffness_damping", "mass_damping")}
    resolved.update({f"model.{key}": value for key, value in damping.items() if value})
    for name in TABLES:
        table = getattr(tables, name)
        given = table.model_dump(mode="json") if table else {}
        resolved.update({f"{name}.{key}": value for key, value in given.items()})
    for entry, contact in zip(source.entries("contact"), contacts):
        pairs = [[pair] if isinstance(pair, str) else pair for pair in entry.get("pairs", [])]
        values: dict[str, Any] = {"law": contact.law, "pairs": pairs}
        if entry.get("tangents") is not None:
            values["tangents"] = [[end] if isinstance(end, str) else end for end in entry["tangents"]]
        values.update({key: _plain(value) for key, value in contact.parameters.items()})
        resolved.update({f"contact.{contact.name}.{key}": value for key, value in values.items()})
    for analysis in analyses.values():
        dumped = analysis.model_dump(mode="json", exclude={"name"})
        resolved.update({f"{analysis.name}.{key}": value for key, value in dumped.items()})
    return resolved


def _plain(value: object) -> object:
    return value.tolist() if hasattr(value, "tolist") else value


def faces_by_address(section: ModelSection, structure: Structure) -> dict[str, Any]:
    """What says that the model is a sector, by address."""
    cut = structure.cut
    if cut is None or cut.low is None or cut.high is None:
        return {}
    names = cut.dof_names
    faces = {f"model.{name}": [names[k] for k in face] for name, face in (("low", cut.low), ("high", cut.high))}
    return {"model.sectors": cut.sectors, **faces, **({"model.axis": cut.axis} if section.axis else {})}
