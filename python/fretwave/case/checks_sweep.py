"""Values that a sweep can go through."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

from ..post.grid import value_text

_ANALYSIS = "analysis."


def complaint(values: object) -> tuple[str, str] | None:
    """What is wrong with the values of a key, and what was expected; None when they are fine."""
    expected = "at least one value, each once: numbers, texts or arrays"
    if not isinstance(values, list) or not values:
        return "gives no array of values", expected
    if any(isinstance(value, dict) for value in values):
        return "has a table among the values", expected
    counts = Counter(map(_compared, values))
    twice = [value for value in values if counts[_compared(value)] > 1]
    return (f"has the value {value_text(twice[-1])} twice", expected) if twice else None


def given_before(key: str, keys: Iterable[str]) -> str | None:
    """The one of some keys that addresses the same, with ``analysis.`` before it or without."""
    return next((other for other in keys if other.removeprefix(_ANALYSIS) == key.removeprefix(_ANALYSIS)), None)


def _compared(value: object) -> object:
    """What is the same of the same values: 1 is 1.0, but neither is true."""
    if isinstance(value, list):
        return tuple(_compared(one) for one in value)
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    return value if number else value_text(value)
