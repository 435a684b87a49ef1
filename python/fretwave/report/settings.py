"""Settings of an analysis, as they decided its results: what the case gives, and defaults."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from ..case.toml.validation import unit_of
from ..registry import kind_named
from ..texts import toml
from . import page
from .model import LONGEST


def settings_part(
    name: str, resolved: Mapping[str, Any], overrides: str, units: Callable[[str], str], amplitude: str
) -> str:
    """Table of the keys given, and the others with their defaults in a line.

    Parameters
    ----------
    resolved : what decided its results, by address
    overrides : of the command line, as they were typed
    amplitude : unit of the analysis' amplitudes, of those that a key may have
    """
    own = {key.partition(".")[2]: value for key, value in resolved.items() if key.startswith(f"{name}.")}
    fields = _fields(str(own.get("type", "")))
    given = {key: value for key, value in own.items() if not _is_default(fields.get(key), value)}
    rows: list[tuple[str, object]] = [
        (key, _said(value, fields.get(key), units, amplitude)) for key, value in given.items()
    ]
    if overrides:
        rows.append(("command line", overrides))
    rest = ", ".join(
        f"{key} = {toml(value, LONGEST)}" for key, value in own.items() if key not in given and _tells(value)
    )
    rows.append(("by default", rest))
    return page.facts(rows)


def _fields(kind: str) -> Mapping[str, FieldInfo]:
    """Keys of a kind of analysis; none where it is not known here."""
    known = kind_named(kind)
    return {} if known is None else known.model_fields


def _is_default(field: FieldInfo | None, value: object) -> bool:
    if field is None or field.is_required():
        return False
    default = field.get_default(call_default_factory=True)
    return bool((default.model_dump(mode="json") if isinstance(default, BaseModel) else default) == value)


def _tells(value: object) -> bool:
    return value not in (None, "", [], {})


def _said(value: object, field: FieldInfo | None, units: Callable[[str], str], amplitude: str) -> str:
    if isinstance(value, str):
        return value
    choices = ("" if field is None else unit_of(field, units)).split(", or ")
    unit = amplitude if amplitude in choices else choices[0]
    return f"{toml(value, LONGEST)} {unit}".rstrip()
