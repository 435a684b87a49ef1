"""Arrays that every row of a table has, besides its columns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Field:
    """An array that every row of a table has.

    Attributes
    ----------
    axes : dict
        Names along its axes, by the name of each; without, they are numbered.
    attributes : dict
        Further ones of the dataset.
    """

    shape: tuple[int, ...]
    unit: str
    long_name: str
    axes: Mapping[str, Sequence[str]] = field(default_factory=dict)
    attributes: Mapping[str, Any] = field(default_factory=dict)

    def described(self) -> dict[str, Any]:
        """As the journal keeps it."""
        told_of = {"units": self.unit, "long_name": self.long_name, **self.attributes}
        return {"shape": list(self.shape), "axes": {k: list(v) for k, v in self.axes.items()}, "attributes": told_of}

    @classmethod
    def of(cls, described: list[Any] | Mapping[str, Any]) -> Field:
        """The inverse; journals of earlier versions have a list."""
        if isinstance(described, list):
            shape, unit, long_name = described
            return cls(tuple(shape), unit, long_name)
        attributes = dict(described["attributes"])
        unit, long_name = attributes.pop("units"), attributes.pop("long_name")
        return cls(tuple(described["shape"]), unit, long_name, described["axes"], attributes)
