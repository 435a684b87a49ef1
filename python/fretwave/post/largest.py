"""The largest of some values, and the first of those that only rounding tells from it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ..arrays import Array

#: Values whose difference is a smaller share of the largest are alike to rounding.
ALIKE = 1e-9


def as_large(values: Array, alike: float = ALIKE, least: float = 0.0) -> npt.NDArray[np.bool_]:
    """Which of (n,) are the largest, or alike to it; of values that are not finite none is.

    Parameters
    ----------
    alike : share of the largest magnitude by which values may differ that are alike
    least : values that differ by no more are alike too, in their own unit
    """
    known = np.isfinite(values)
    size, top = np.abs(values).max(where=known, initial=0.0), values.max(where=known, initial=-np.inf)
    return np.asarray(known & (values >= top - max(alike * size, least)))


def largest(values: Array, alike: float = ALIKE, least: float = 0.0) -> int:
    """Index of the largest of (n,), of those that are alike to it the first; 0 where no value is finite."""
    return int(np.argmax(as_large(values, alike, least)))
