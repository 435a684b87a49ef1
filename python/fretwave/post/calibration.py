"""How near estimated errors come to true ones, of lambda at points of a study."""

from __future__ import annotations

import numpy as np

from ..arrays import AnyArray, Array

#: Of lambda [1/s]: below it a difference of two runs is what their solvers leave.
LEAST_ERROR = 1e-8
#: Within these factors of the error an estimate is asked to be, the first one above all.
FACTORS = (3, 10)


def can_be_told(error: Array) -> AnyArray:
    """Where a difference from the finest run (n,) is an error."""
    return error > LEAST_ERROR


def share_within(estimate: Array, error: Array, factor: float = FACTORS[0]) -> float:
    """Share of the points (n,) at which an estimate is within a factor of the error, of those where that can be told.

    nan without any.
    """
    told = can_be_told(error)
    ratio = estimate[told] / error[told]
    return float(np.mean((ratio <= factor) & (ratio >= 1 / factor))) if len(ratio) else np.nan
