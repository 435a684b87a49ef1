"""How near estimated errors come to true ones, of lambda at points of a study."""

from __future__ import annotations

import numpy as np

from ..arrays import AnyArray, Array

#: Of lambda [1/s]: below it a difference of two runs is what their solvers leave.
LEAST_ERROR = 1e-8
#: The finest run judges errors this many times above its own: it knows them to a third.
JUDGED = 3.0
#: Within these factors of the error an estimate is asked to be, the first one above all.
FACTORS = (3, 10)


def can_be_told(error: Array, judge: Array) -> AnyArray:
    """Where a difference from the finest run (n,) is an error, not what that run itself errs by as it says (n,)."""
    return (error > LEAST_ERROR) & (error > JUDGED * judge)


def share_within(estimate: Array, error: Array, factor: float = FACTORS[0]) -> float:
    """Share of the points (n,) at which an estimate is within a factor of the error; nan without any."""
    ratio = estimate / error
    return float(np.mean((ratio <= factor) & (ratio >= 1 / factor))) if len(ratio) else np.nan
