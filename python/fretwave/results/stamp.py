"""The values of a case that decided an analysis' results, kept with them as their stamp.

A folder keeps what earlier runs of its case found. When the case has changed meanwhile, these results are of another
model than those beside them: they are told apart, and not drawn into one picture.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from ..texts import toml

if TYPE_CHECKING:
    from .analysis import Analysis

#: Tables of the case that decide the results of every analysis.
COMMON = ("model", "contact", "reduction", "preload", "damping", "aerodynamics", "plugins")
#: Keys of an analysis that decide how well, how far and by which method its motion is found, not which motion it is.
OF_METHOD = (
    *("method", "harmonics", "accuracy", "retain", "samples", "errors", "step", "petsc", "amplitude", "report_at"),
)
#: Changed keys are named up to so many.
NAMED = 3


def stamp_of(attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Values by address; empty of results that have none (of sweeps, whose values have their own)."""
    kept = attributes.get("case", {})
    try:
        read = json.loads(kept) if isinstance(kept, (str, bytes)) else kept
    except ValueError:
        return {}
    return dict(read) if isinstance(read, Mapping) else {}


def of_one_model(one: Analysis, other: Analysis) -> bool:
    """Whether two analyses stand side by side: of the same model, and by the same keys where both have them."""
    first, second = stamp_of(one.attributes), stamp_of(other.attributes)
    if not first or not second:
        return True
    shared = {*COMMON, *({*map(_table, first)} & {*map(_table, second)})}
    return not [key for key in _changed(first, second) if _table(key) in shared and not _of_method(key)]


def changed_since(stamp: Mapping[str, Any], resolved: Mapping[str, Any]) -> str:
    """What the case of the last run has in another way, in words; empty where nothing is."""
    tables = {*COMMON, *map(_table, stamp)}
    now = {key: value for key, value in resolved.items() if _table(key) in tables}
    keys = _changed(stamp, now) if stamp and resolved else []
    told = [f"{key} = {_text(stamp, key)} (now {_text(now, key)})" for key in keys[:NAMED]]
    return ", ".join([*told, *([f"and {len(keys) - NAMED} more"] if len(keys) > NAMED else [])])


def _changed(one: Mapping[str, Any], other: Mapping[str, Any]) -> list[str]:
    return [key for key in dict.fromkeys((*one, *other)) if one.get(key) != other.get(key)]


def _table(key: str) -> str:
    return key.split(".")[0]


def _of_method(key: str) -> bool:
    return _table(key) not in COMMON and key.split(".")[1:2] != [] and key.split(".")[1] in OF_METHOD


def _text(values: Mapping[str, Any], key: str) -> str:
    value = values.get(key)
    return "absent" if value is None else toml(value)
