"""Shares of estimates near their errors: counted by hand, whatever the unit, and without what cannot be told."""

from __future__ import annotations

import numpy as np
import pytest

from fretwave.post.calibration import FACTORS, LEAST_ERROR, share_within

pytestmark = pytest.mark.ranks(1)

ERROR = np.full(6, 2e-3)
RATIO = np.array([1 / 20, 1 / 5, 0.5, 1.0, 2.9, 8.0])


@pytest.mark.parametrize(("factor", "share"), [(3, 3 / 6), (10, 5 / 6), (30, 1.0), (1.5, 1 / 6)])
def test_estimates_count_on_both_sides_of_the_error(factor: float, share: float) -> None:
    assert share_within(RATIO * ERROR, ERROR, factor) == share
    assert share_within(ERROR / RATIO, ERROR, factor) == share


def test_the_first_factor_is_asked_for_by_itself() -> None:
    assert share_within(RATIO * ERROR, ERROR) == share_within(RATIO * ERROR, ERROR, FACTORS[0])


def test_errors_that_solvers_leave_and_estimates_that_are_missing() -> None:
    """The first are no errors at all; a point without an estimate, or with one of zero, is not near its error."""
    left = np.array([LEAST_ERROR, 0.5 * LEAST_ERROR, 0.0])
    assert share_within(np.append(ERROR, left), np.append(ERROR, left)) == 1.0
    assert share_within(np.array([np.nan, 0.0, 2e-3, 2e-3]), ERROR[:4]) == 0.5
    assert np.isnan(share_within(left, left)) and np.isnan(share_within(np.empty(0), np.empty(0)))
