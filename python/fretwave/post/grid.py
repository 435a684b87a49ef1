"""All combinations of the values of some keys, and how they are named."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import product
from math import prod
from typing import Any

from ..texts import toml

#: Longer texts of a value are cut where people read them, never where they are used.
SHOWN = 24


@dataclass(frozen=True)
class Plan:
    """All combinations of the values of some keys, the last key's values changing fastest.

    Attributes
    ----------
    over : dict
        Values by key; keys are addressed as ``--set`` does.
    units : dict
        Symbols by key, of keys that have a quantity.
    """

    over: Mapping[str, Sequence[Any]]
    units: Mapping[str, str] = field(default_factory=dict)

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
        return self._overrides

    def labels(self) -> list[str]:
        """Each combination in a few words, by the last parts of the keys."""
        return self._labels

    def headings(self) -> dict[str, str]:
        """The last parts of the keys with their units, as an axis has them."""
        units = {key: f" [{self.units[key]}]" if self.units.get(key) else "" for key in self.keys}
        return {key: name.replace("_", " ") + units[key] for key, name in short_names(self.keys).items()}

    @cached_property
    def _overrides(self) -> list[list[str]]:
        """Written once: every value of a sweep asks for its own."""
        return [[f"{key}={value_text(value)}" for key, value in values.items()] for values in self.values()]

    def _with_unit(self, key: str, value: object) -> str:
        return f"{toml(value, SHOWN)} {self.units.get(key, '')}".rstrip()

    @cached_property
    def _labels(self) -> list[str]:
        short = short_names(self.keys)
        return [
            ", ".join(f"{short[key]} = {self._with_unit(key, value)}" for key, value in values.items())
            for values in self.values()
        ]


def short_names(keys: Sequence[str]) -> dict[str, str]:
    """Last part of each key, or the whole key where two end alike."""
    last = [key.rpartition(".")[2] for key in keys]
    return {key: name if last.count(name) == 1 else key for key, name in zip(keys, last)}


def value_text(value: object) -> str:
    """As TOML reads it back, whole."""
    return toml(value, longest=1 << 30)
