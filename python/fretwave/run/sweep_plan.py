"""Which values of which keys a sweep runs, and in what order; knows neither cases nor solvers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..case.checks_sweep import complaint
from ..case.toml.source import TomlError, nested_leaves, parse_value
from ..errors import InputError
from ..post.grid import Plan, value_text


def plan_of(texts: Sequence[str]) -> Plan:
    """The plan of ``--over KEY=v1,v2,...``.

    Raises
    ------
    InputError
        A text is not of this form, or a key stands twice.
    """
    over: dict[str, list[Any]] = {}
    for text in texts:
        key, equals, values = (part.strip() for part in text.partition("="))
        if not key or not equals:
            raise _wrong(text, "is not KEY=value,value,...", "a key of the case and its values")
        if key in over:
            raise _wrong(text, f"gives values of '{key}' a second time", "every key once")
        over[key] = _listed(values, text)
        problem = complaint(over[key])
        if problem is not None:
            raise _wrong(text, *problem)
    if not over:
        raise InputError("a sweep needs values to go through", "--over", None, "--over KEY=v1,v2,...", _EXAMPLE)
    return Plan(over)


def table_overrides(table: Mapping[str, Any]) -> list[str]:
    """``key=value`` of a table of overrides."""
    return [f"{'.'.join(path)}={value_text(value)}" for path, value in nested_leaves(table)]


_EXAMPLE = "write for example `--over model.options.friction=0.1,0.2,0.5`"


def _wrong(text: str, what: str, expected: str) -> InputError:
    return InputError(f"--over {what}", f"--over {text}", None, expected, _EXAMPLE)


def _listed(text: str, whole: str) -> list[Any]:
    """Values between commas: TOML, or plain words."""
    try:
        return list(parse_value(f"[{text}]"))
    except TomlError:
        try:
            return [parse_value(part) for part in text.split(",")]
        except TomlError as error:
            raise _wrong(whole, f"has a value that is not TOML ({error})", "numbers, words or arrays") from None
