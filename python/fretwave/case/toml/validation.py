"""From pydantic's errors to messages a user can act on: line, value, what was expected, a fix."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Optional, TypeVar, cast

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from ...errors import FretwaveError, InputError
from ...texts import nearest, toml
from .locate import Path as KeyPath
from .source import Source

Model = TypeVar("Model", bound=BaseModel)

_KINDS = {
    "int_type": "an integer",
    "int_from_float": "an integer",
    "float_type": "a number",
    "string_type": "a string",
    "list_type": "an array",
    "dict_type": "a table",
    "model_type": "a table",
    "bool_type": "true or false",
    "finite_number": "a finite number",
}


def validate(kind: type[Model], source: Source, path: KeyPath, found: list[FretwaveError]) -> Model | None:
    """The validated section at `path`; its errors are appended to `found`, and None is returned then."""
    data = at(source.data, path)
    try:
        return kind.model_validate(data)
    except ValidationError as error:
        grouped: dict[KeyPath, list[ErrorDetails]] = {}
        for item in error.errors(include_url=False):
            inside = _inside(data, item["loc"], item["type"])
            grouped.setdefault(inside, []).append(item)
        misspelt = _misspelt(kind, grouped)
        for inside in _deepest(grouped):
            if inside not in misspelt:
                found.append(_problem(kind, source, path, inside, grouped[inside]))
        return None


def _misspelt(kind: type[BaseModel], grouped: Mapping[KeyPath, Any]) -> set[KeyPath]:
    """Missing keys that an unknown key beside them stands for: one message is enough."""
    meant = set()
    for inside, items in grouped.items():
        if items[0]["type"] == "extra_forbidden":
            known = list(field_of(kind, inside[:-1])[2].model_fields)
            meant.add((*inside[:-1], nearest(str(inside[-1]), known, str)))
    return {inside for inside, items in grouped.items() if items[0]["type"] == "missing" and inside in meant}


def at(data: Any, path: KeyPath) -> Any:
    """The value at a path, None where the path ends early."""
    for part in path:
        try:
            data = data[part]
        except (KeyError, IndexError, TypeError):
            return None
    return data


def _inside(data: Any, location: tuple[Any, ...], error_type: str) -> KeyPath:
    """The part of pydantic's location that exists in the data (it adds names of union members)."""
    path: KeyPath = ()
    for part in location:
        holder = at(data, path)
        in_table = isinstance(holder, Mapping) and (part in holder or error_type == "missing")
        if in_table or (isinstance(holder, list) and isinstance(part, int) and part < len(holder)):
            path = (*path, part)
    return path


def _deepest(grouped: Mapping[KeyPath, Any]) -> list[KeyPath]:
    """Where a union failed in several ways, keep the innermost places."""
    return [path for path in grouped if not any(other != path and other[: len(path)] == path for other in grouped)]


def field_of(kind: type[BaseModel], inside: KeyPath) -> tuple[str, Optional[FieldInfo], type[BaseModel]]:
    """Name and pydantic field that hold a place, and the section they are in."""
    name, field = "", None
    for part in inside:
        if not isinstance(part, str) or part not in kind.model_fields:
            continue
        name, field = part, kind.model_fields[part]
        nested = _section_in(field.annotation)
        if nested is None:
            break
        kind = nested
    return name, field, kind


def _section_in(annotation: object) -> type[BaseModel] | None:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    inner = [_section_in(argument) for argument in getattr(annotation, "__args__", ())]
    return next((section for section in inner if section), None)


def _problem(
    kind: type[BaseModel], source: Source, path: KeyPath, inside: KeyPath, items: list[ErrorDetails]
) -> InputError:
    whole = (*path, *inside)
    first = items[0]
    key = str(inside[-1]) if inside else source.name(path)
    if first["type"] == "missing":
        return _missing(kind, source, path, inside, key)
    if first["type"] == "extra_forbidden":
        return unknown_key(source, whole, list(field_of(kind, inside[:-1])[2].model_fields))
    name, field, _ = field_of(kind, inside)
    rules = sorted({_rule(item) for item in items})
    return InputError(
        f"{source.name(whole)} has a wrong value",
        where=source.where(whole),
        measured=toml(at(source.data, whole)),
        expected=" or ".join(rules) + (f": {describe(field, source.units)}" if field else ""),
        fix=_example(name, field),
    )


def missing_key(kind: type[BaseModel], source: Source, path: KeyPath, key: str) -> InputError:
    """The problem of a key that this section needs in the present case."""
    return _missing(kind, source, path, (key,), key)


def _missing(kind: type[BaseModel], source: Source, path: KeyPath, inside: KeyPath, key: str) -> InputError:
    name, field, _ = field_of(kind, inside)
    holder = (*path, *inside[:-1])
    return InputError(
        f"the key '{key}' is missing in {source.name(holder)}",
        where=source.where(holder),
        expected=describe(field, source.units) if field else None,
        fix=_example(name, field, "add"),
    )


def unknown_key(source: Source, path: KeyPath, known: list[str]) -> InputError:
    """The problem of a key that nothing reads."""
    key = str(path[-1])
    holder = source.name(path[:-1]) if path[:-1] else "a case file"
    return InputError(
        f"unknown key '{key}' in {holder}",
        where=source.where(path),
        measured=f"{key} = {toml(at(source.data, path))}",
        expected=f"one of {', '.join(known)}",
        fix=nearest(key, known, "did you mean `{}`?".format) or "remove the key",
    )


def describe(field: FieldInfo, units: Callable[[str], str] = str) -> str:
    """A field's doc with its unit: of the quantity, or in symbols of a system."""
    unit = unit_of(field, units)
    return f"{field.description} [{unit}]" if unit else str(field.description)


def unit_of(field: FieldInfo, units: Callable[[str], str] = str) -> str:
    """A field's unit; empty for a pure number and for what is none."""
    unit = units(_extra(field, "unit") or "")
    return "" if unit == "-" else unit


def _example(name: str, field: Optional[FieldInfo], verb: str = "write") -> str | None:
    example = _extra(field, "example") if field else None
    return f"{verb} for example `{name} = {example}`" if example else None


def _extra(field: FieldInfo, name: str) -> Optional[str]:
    """What :func:`fretwave.case.fields.key` keeps with a field."""
    given = field.json_schema_extra
    return cast("Optional[str]", given.get(name)) if isinstance(given, dict) else None


def _rule(item: ErrorDetails) -> str:
    """What pydantic wanted, in a few words."""
    context = item.get("ctx", {})
    kind = item["type"]
    if kind in _KINDS:
        return _KINDS[kind]
    if kind == "literal_error":
        return f"one of {context['expected']}"
    if kind in ("too_short", "too_long"):
        count = context.get("min_length", context.get("max_length"))
        word = "at least" if kind == "too_short" else "at most"
        return f"{word} {count} {'entry' if count == 1 else 'entries'}"
    for name, sign in (("gt", ">"), ("ge", ">="), ("lt", "<"), ("le", "<=")):
        if name in context:
            bound = context[name]
            return f"a value {sign} {bound if isinstance(bound, int) else format(bound, 'g')}"
    if kind == "string_pattern_mismatch":
        named = context["pattern"].startswith("^[A-Za-z]")
        return "a name of letters, digits, '_' and '-', a letter first" if named else "1 to 100 printable characters"
    if kind == "string_too_long":
        return f"at most {context['max_length']} characters"
    return str(item["msg"])
