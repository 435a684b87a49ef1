"""Quantiles between order statistics: the binomial law written out, coverage on drawn samples, what n permits."""

from __future__ import annotations

from math import comb

import numpy as np
import pytest
from scipy.stats import norm
from tolerances import SOLVED

from fretwave.post.quantiles import CONFIDENCE, PROBABILITIES, distribution, interval_ranks, least_count, quantiles

pytestmark = pytest.mark.ranks(1)

TAIL = (1 - CONFIDENCE) / 2


def at_most(k: int, n: int, q: float) -> float:
    """Probability that at most k of n values lie below the quantile."""
    return sum(comb(n, j) * q**j * (1 - q) ** (n - j) for j in range(k + 1))


@pytest.mark.parametrize("n", [5, 6, 20, 73, 100, 200, 368])
@pytest.mark.parametrize("q", PROBABILITIES)
def test_ranks_are_the_closest_with_half_the_risk_on_either_side(n: int, q: float) -> None:
    low, high = interval_ranks(n, q)
    assert at_most(low - 1, n, q) <= TAIL < at_most(low, n, q)
    assert 1 - at_most(high - 1, n, q) <= TAIL < 1 - at_most(high - 2, n, q)


@pytest.mark.parametrize("q", PROBABILITIES)
def test_the_least_number_of_values_with_two_ends(q: float) -> None:
    least = least_count(q)
    for n, both in ((least - 1, False), (least, True)):
        low, high = interval_ranks(n, q)
        assert (low > 0 and high <= n) == both


def test_known_ranks() -> None:
    """The median of 100 values lies between the 40th and the 61st with 96.48 % (binomial tables)."""
    assert interval_ranks(100, 0.5) == (40, 61)
    assert at_most(60, 100, 0.5) - at_most(39, 100, 0.5) == pytest.approx(0.9648, abs=5e-5)
    assert [least_count(q) for q in (0.5, 0.95, 0.99)] == [6, 72, 368]


@pytest.mark.parametrize("q", [0.05, 0.5, 0.95])
def test_coverage_on_normal_samples(q: float) -> None:
    """It is the binomial probability, within four standard errors of the number of samples."""
    n, count, random = 100, 4000, np.random.Generator(np.random.PCG64(7))
    low, high = interval_ranks(n, q)
    expected = at_most(high - 1, n, q) - at_most(low - 1, n, q)
    assert expected >= CONFIDENCE
    held = 0
    for sample in random.standard_normal((count, n)):
        (found,) = quantiles(sample, [q])
        held += found.low <= norm.ppf(q) <= found.high
    assert abs(held / count - expected) < 4 * np.sqrt(expected * (1 - expected) / count)


def test_what_is_too_small_is_not_given() -> None:
    values = np.arange(1.0, 61.0)
    found = {one.probability: one for one in quantiles(values)}
    assert list(found) == [0.05, 0.5, 0.95], "no value is expected beyond the others"
    assert np.isnan(found[0.05].low) and found[0.05].high == interval_ranks(60, 0.05)[1]
    assert np.isnan(found[0.95].high) and np.isfinite(found[0.95].low)
    assert found[0.5].value == pytest.approx(30.5)
    assert (found[0.5].low, found[0.5].high) == interval_ranks(60, 0.5)
    assert quantiles(np.empty(0)) == []


def test_band_of_a_distribution_is_the_quantiles_read_the_other_way() -> None:
    """k of 50 values lie at or below one: as few has half the risk at the band's upper end, as many at its lower."""
    values = np.random.Generator(np.random.PCG64(3)).permutation(np.linspace(0.0, 1.0, 50))
    ordered, share, low, high = distribution(values)
    assert np.array_equal(ordered, np.sort(values)) and share[-1] == 1.0 == high[-1]
    for k in range(1, 50):
        assert at_most(k, 50, high[k - 1]) == pytest.approx(TAIL, rel=SOLVED)
        assert 1 - at_most(k - 1, 50, low[k - 1]) == pytest.approx(TAIL, rel=SOLVED)
