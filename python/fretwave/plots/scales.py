"""In which unit an axis is shown: the model's own with the prefix that suits the values; tables stay as they are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from ..arrays import AnyArray
from ..results.analysis import Analysis
from ..units import UnitSystem
from . import style

Values = TypeVar("Values", float, AnyArray)


@dataclass(frozen=True)
class Scale:
    """Factor from the numbers of a table to those on an axis, whose symbol is `unit`."""

    factor: float
    unit: str

    def __call__(self, values: Values) -> Values:
        return self.factor * values

    def label(self, text: str) -> str:
        """Of an axis."""
        return style.label(text, self.unit)

    def text(self, value: float, digits: int = 3) -> str:
        """A value of the table with its unit: "20 µm"."""
        return style.with_unit(style.number(self.factor * value, digits), self.unit)


def linear(units: UnitSystem, symbol: str, *values: AnyArray | float) -> Scale:
    """Of an axis from or about zero: the largest value tells."""
    known = _known(values)
    return Scale(*units.shown(symbol, float(known.max(initial=0.0))))


def logarithmic(units: UnitSystem, symbol: str, *values: AnyArray | float) -> Scale:
    """Of a logarithmic axis: the value in its middle tells."""
    known = _known(values)
    middle = np.sqrt(known.min() * known.max()) if len(known) else 0.0
    return Scale(*units.shown(symbol, float(middle)))


def _known(values: Sequence[AnyArray | float]) -> AnyArray:
    """Sizes of all that are finite and not zero."""
    sizes = np.abs(np.concatenate([np.ravel(np.asarray(value, dtype=float)) for value in values]))
    return np.asarray(sizes[np.isfinite(sizes) & (sizes > 0.0)])


def linear_amplitudes(mode: Analysis) -> Scale:
    """Of an axis of its amplitudes that is not logarithmic."""
    return linear(mode.unit_system, mode.unit("amplitude"), mode.columns["amplitude"])


def amplitudes(*modes: Analysis) -> Scale:
    """Of the amplitudes of modes, which go over decades: the same in all pictures of them."""
    return logarithmic(modes[0].unit_system, modes[0].unit("amplitude"), *(mode.columns["amplitude"] for mode in modes))
