"""Shares of estimates near their errors: counted by hand, whatever the unit, and without what cannot be told."""

from __future__ import annotations

import numpy as np
import pytest

from fretwave.post.calibration import FACTORS, JUDGED, LEAST_ERROR, can_be_told, share_within

pytestmark = pytest.mark.ranks(1)

ERROR = np.full(6, 2e-3)
RATIO = np.array([1 / 20, 1 / 5, 0.5, 1.0, 2.9, 8.0])


@pytest.mark.parametrize(("factor", "share"), [(3, 3 / 6), (10, 5 / 6), (30, 1.0), (1.5, 1 / 6)])
def test_estimates_count_on_both_sides_of_the_error(factor: float, share: float) -> None:
    assert share_within(RATIO * ERROR, ERROR, factor) == share
    assert share_within(ERROR / RATIO, ERROR, factor) == share


def test_the_first_factor_is_asked_for_by_itself() -> None:
    assert share_within(RATIO * ERROR, ERROR) == share_within(RATIO * ERROR, ERROR, FACTORS[0])


def test_estimates_that_are_missing() -> None:
    """A point without an estimate, or with one of zero, is not near its error."""
    assert share_within(np.array([np.nan, 0.0, 2e-3, 2e-3]), ERROR[:4]) == 0.5
    assert np.isnan(share_within(np.empty(0), np.empty(0)))


def test_errors_that_cannot_be_told() -> None:
    """What solvers leave is no error at all, nor what the finest run, from which it is measured, errs by itself."""
    left = np.array([LEAST_ERROR, 0.5 * LEAST_ERROR, 0.0])
    assert not can_be_told(left, np.zeros(3)).any()
    assert can_be_told(ERROR, 0.9 * ERROR / JUDGED).all() and not can_be_told(ERROR, 1.1 * ERROR / JUDGED).any()
    assert not can_be_told(ERROR, np.full(6, np.nan)).any()
