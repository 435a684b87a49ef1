"""Which values of which keys a sweep runs, and in what order; knows neither cases nor solvers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from math import prod
from typing import Any

from .errors import InputError
from .source import TomlError, nested_leaves, parse_value
from .validation import toml

#: Longer texts of a value are cut where people read them, never where they are used.
SHOWN = 24


@dataclass(frozen=True)
class Plan:
    """All combinations of the values of some keys, the last key's values changing fastest.

    Attributes
    ----------
    over : dict
        Values by key; keys are addressed as ``--set`` does.
    """

    over: Mapping[str, Sequence[Any]]

    def __len__(self) -> int:
        return prod(self.shape)

    @property
    def keys(self) -> list[str]:
        return list(self.over)

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values of each key."""
        return tuple(len(values) for values in self.over.values())

    def values(self) -> Iterator[dict[str, Any]]:
        """Value of each key, one combination after the other."""
        for combination in product(*self.over.values()):
            yield dict(zip(self.over, combination))

    def overrides(self) -> list[list[str]]:
        """``key=value`` of each combination, as ``--set`` takes it."""
        return [[f"{key}={_text(value)}" for key, value in values.items()] for values in self.values()]

    def labels(self) -> list[str]:
        """Each combination in a few words, by the last parts of the keys."""
        short = short_names(self.keys)
        return [
            ", ".join(f"{short[key]} = {toml(value, SHOWN)}" for key, value in values.items())
            for values in self.values()
        ]


def short_names(keys: Sequence[str]) -> dict[str, str]:
    """Last part of each key, or the whole key where two end alike."""
    last = [key.rpartition(".")[2] for key in keys]
    return {key: name if last.count(name) == 1 else key for key, name in zip(keys, last)}


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
    return [f"{'.'.join(path)}={_text(value)}" for path, value in nested_leaves(table)]


def table_plan(table: Mapping[str, Any]) -> Plan:
    """The plan of a case's ``over``: ``{ "model.options.friction" = [0.1, 0.5] }``, or with nested tables."""
    return Plan({".".join(path): value for path, value in nested_leaves(table)})


def complaint(values: Any) -> tuple[str, str] | None:
    """What is wrong with the values of a key, and what was expected; None when they are fine."""
    expected = "at least one value, each once: numbers, texts or arrays"
    if not isinstance(values, list) or not values:
        return "gives no array of values", expected
    texts = [_text(value) for value in values]
    if any(isinstance(value, dict) for value in values):
        return "has a table among the values", expected
    twice = [text for text in texts if texts.count(text) > 1]
    return (f"has the value {twice[0]} twice", expected) if twice else None


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


def _text(value: Any) -> str:
    """As TOML reads it back, whole."""
    return toml(value, longest=1 << 30)
