"""The quantity of a key of a case, by its address."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from pydantic import BaseModel

from ..registry import kinds
from ..units import UnitSystem
from .contact_parameters import PER_AREA, has_per_area, unit_of_key
from .json_schema import SECTIONS
from .schema import ContactSection, GaugeSection
from .toml.locate import Path as KeyPath
from .toml.source import Source
from .toml.validation import field_of, unit_of

if TYPE_CHECKING:
    from ..model.law_info import LawInfo


def key_units(source: Source, keys: Iterable[str], laws: Mapping[str, LawInfo], units: UnitSystem) -> dict[str, str]:
    """Symbols of the units of keys, addressed as ``--set`` does; keys without a quantity are not there."""
    found = {key: units(_quantity(source, key, laws)) for key in keys}
    return {key: unit for key, unit in found.items() if unit}


def _quantity(source: Source, key: str, laws: Mapping[str, LawInfo]) -> str:
    """Empty where it has none, or where the value says of which quantity it is."""
    path = source.path_of(key.split("."), key)
    if path is None or len(path) < 2:
        return ""
    holder, inside = (path[:2], path[2:]) if isinstance(path[1], int) else (path[:1], path[1:])
    entry = _entry(source, holder)
    section = _section(str(path[0]), entry)
    if section is ContactSection and inside[0] not in section.model_fields:
        return _of_parameter(str(inside[0]), laws.get(str(entry.get("law"))))
    field = None if section is None else field_of(section, inside)[1]
    unit = "" if field is None else unit_of(field)
    return "" if "," in unit else unit


def _entry(source: Source, holder: KeyPath) -> Mapping[str, Any]:
    """Of an array of tables."""
    return source.entries(str(holder[0]))[int(holder[1])] if len(holder) > 1 else {}


def _section(kind: str, entry: Mapping[str, Any]) -> type[BaseModel] | None:
    if kind == "analysis":
        return kinds().get(str(entry.get("type")))
    sections: dict[str, type[BaseModel]] = {**SECTIONS, "contact": ContactSection, "gauge": GaugeSection}
    return sections.get(kind)


def _of_parameter(key: str, law: LawInfo | None) -> str:
    """Of a law's parameter, as it is or per area."""
    name = key.removesuffix(PER_AREA)
    known = {parameter.name: parameter for parameter in (() if law is None else law.parameters)}
    if key in known:
        return "" if known[key].unit == "-" else known[key].unit
    if name not in known or not has_per_area(known[name]):
        return ""
    return unit_of_key(key, known[name])
