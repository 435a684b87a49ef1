"""Which values of which keys a sweep runs, and in what order; knows neither cases nor solvers."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from datetime import time
from typing import Any

from ..case.checks_sweep import complaint, given_before
from ..case.toml.source import TomlError, nested_leaves, parse_value
from ..errors import InputError
from ..post.grid import Plan, value_text


def plan_of(texts: Sequence[str]) -> Plan:
    """The plan of ``--over KEY=v1,v2,...``; a value may be a range.

    ``1:200`` are the whole numbers from 1 to 200, ``0.1:0.5:n=5`` five numbers with equal steps between them,
    ``1:100:log=3`` three with equal ratios; first and last are among them. Where all are whole, as in ``1:9:n=5``,
    they are whole numbers.

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
        if given_before(key, over) is not None:
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


_EXAMPLE_OF_RANGE = "write for example `--over model.options.friction=0.1:0.5:n=5`, which are 0.1, 0.2, 0.3, 0.4, 0.5"


def _wrong(text: str, what: str, expected: str) -> InputError:
    fix = _EXAMPLE_OF_RANGE if "has a range" in what else _EXAMPLE
    return InputError(f"--over {what}", f"--over {text}", None, expected, fix)


def _listed(text: str, whole: str) -> list[Any]:
    """Values between commas: TOML, or plain words and ranges."""
    with suppress(*TomlError):
        values = list(parse_value(f"[{text}]"))
        if not any(isinstance(value, time) for value in values):  # 10:20:30 is meant as a range
            return values
    try:
        return [value for part in text.split(",") for value in _one_or_range(part.strip(), whole)]
    except TomlError as error:
        raise _wrong(whole, f"has a value that is not TOML ({error})", "numbers, words or arrays") from None


_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_WHOLE = re.compile(r"[+-]?\d{1,15}")
_RANGE = re.compile(rf"({_NUMBER}):({_NUMBER})(?::(.*))?")
_RANGES = "FIRST:LAST of whole numbers, FIRST:LAST:n=COUNT (equal steps) or FIRST:LAST:log=COUNT (equal ratios)"
#: More values are a slip of the pen.
MOST = 100_000


def _one_or_range(text: str, whole: str) -> list[Any]:
    found = _RANGE.fullmatch(text)
    if found is None:
        return [parse_value(text)]
    first, last, how = found.groups()
    if how is None:
        return _whole_numbers(first, last, whole)
    kind, _, count = how.partition("=")
    if kind not in ("n", "log") or not re.fullmatch(r"\d{1,9}", count) or not 2 <= int(count) <= MOST:
        raise _wrong(whole, f"has a range that ends in ':{how}'", f"{_RANGES}, 2 to {MOST} values")
    if math.isinf(float(first)) or math.isinf(float(last)):
        raise _wrong(whole, "has a range to infinity", "numbers below 1.8e308")
    if kind == "log" and min(float(first), float(last)) <= 0.0:
        raise _wrong(whole, "has equal ratios between numbers that are not positive", "FIRST and LAST above zero")
    values = _between(float(first), float(last), int(count), kind == "log")
    written = all(_WHOLE.fullmatch(text) for text in (first, last))
    return [int(value) for value in values] if written and all(value.is_integer() for value in values) else [*values]


def _whole_numbers(first: str, last: str, whole: str) -> list[Any]:
    """One by one, up or down."""
    if not all(_WHOLE.fullmatch(text) for text in (first, last)):
        raise _wrong(whole, "has a range between numbers that are not whole, without their count", _RANGES)
    low, high = int(first), int(last)
    if abs(high - low) >= MOST:
        raise _wrong(whole, f"has a range of {abs(high - low) + 1} values", f"at most {MOST}")
    step = 1 if high >= low else -1
    return list(range(low, high + step, step))


def _between(first: float, last: float, count: int, ratios: bool) -> list[float]:
    """Rounded where only the last bits say more: 0.1 + 2 * 0.1 is 0.3, and -0.3 + 3 * 0.1 is 0."""
    shares = [k / (count - 1) for k in range(1, count - 1)]
    if ratios:
        steps = [float(f"{first ** (1 - share) * last**share:.14g}") for share in shares]
    else:
        digits = 13 - math.floor(math.log10(max(abs(first), abs(last)) or 1.0))  # of the larger end, for all
        steps = [round(first * (1 - share) + last * share, digits) + 0.0 for share in shares]
    return [first, *steps, last]
