"""Quantiles of a sample with distribution-free confidence intervals between order statistics.

Of n independent values the number below the q-quantile is binomial (n, q), whatever the distribution (David and
Nagaraja, Order Statistics, 3rd ed., section 7.1).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Array

#: Probability with which an interval holds the quantile, at the least.
CONFIDENCE = 0.95
PROBABILITIES = (0.01, 0.05, 0.5, 0.95, 0.99)


@dataclass(frozen=True)
class Quantile:
    """A quantile of a sample of n values and its interval; nan where the sample is too small for an end of it."""

    probability: float
    value: float
    low: float
    high: float


def interval_ranks(n: int, probability: float) -> tuple[int, int]:
    """Ranks (from 1) of the order statistics that hold a quantile between them, half the risk on either side.

    0 and n + 1 stand for the ends that n values do not give.
    """
    from scipy.stats import binom

    tail = (1.0 - CONFIDENCE) / 2.0
    return int(binom.ppf(tail, n, probability)), int(binom.ppf(1.0 - tail, n, probability)) + 1


def least_count(probability: float) -> int:
    """Values that an interval with two ends takes: all lie on one side of the quantile in half the risk."""
    far = max(probability, 1.0 - probability)
    return math.ceil(math.log((1.0 - CONFIDENCE) / 2.0) / math.log(far))


def quantiles(values: Array, probabilities: Sequence[float] = PROBABILITIES) -> list[Quantile]:
    """Those that the sample permits: at least one value is expected beyond each.

    The estimate is Hyndman and Fan's eighth (The American Statistician 50, 1996): median-unbiased, whatever the
    distribution.
    """
    ordered, found = np.sort(np.asarray(values, dtype=float)), []
    ends = np.concatenate([[np.nan], ordered, [np.nan]])
    for p in probabilities:
        if len(ordered) * min(p, 1.0 - p) >= 1.0 - 1e-12:
            low, high = interval_ranks(len(ordered), p)
            value = float(np.quantile(ordered, p, method="median_unbiased"))
            found.append(Quantile(p, value, float(ends[low]), float(ends[high])))
    return found


def distribution(values: Array) -> tuple[Array, Array, Array, Array]:
    """Sorted values (n,), the share of the sample up to each, and the ends of the share's own interval at each.

    Clopper and Pearson's interval (Biometrika 26, 1934), which is that of the quantiles read the other way; it holds
    at one value at a time, not for the whole curve at once.
    """
    from scipy.stats import beta

    ordered = np.sort(np.asarray(values, dtype=float))
    n, tail = len(ordered), (1.0 - CONFIDENCE) / 2.0
    below = np.arange(1, n + 1)
    low = beta.ppf(tail, below, n - below + 1)
    high = np.where(below < n, beta.ppf(1.0 - tail, below + 1, np.maximum(n - below, 1)), 1.0)
    return ordered, below / n, low, high
