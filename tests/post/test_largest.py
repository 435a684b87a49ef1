"""Which of some values is the largest, where rounding tells them apart and where some are not known."""

from __future__ import annotations

import numpy as np
import pytest

from fretwave.post.fatigue import EQUAL
from fretwave.post.largest import as_large, largest
from fretwave.post.mode_curve import lowest, most_damped, varies

pytestmark = pytest.mark.ranks(1)


@pytest.mark.parametrize("scatter", [1e-16, 1e-11, 2e-10])
@pytest.mark.parametrize("value", [3.0, -3.0, 1e-9])
def test_of_values_that_are_alike_to_rounding_the_first_is_the_largest(scatter: float, value: float) -> None:
    random = np.random.default_rng(1)
    for _ in range(20):
        values = value * (1 + scatter * random.uniform(-1, 1, 24))
        assert largest(values) == most_damped(values) == lowest(values) == 0
        assert as_large(values).all()


def test_places_of_stress_are_alike_within_what_a_parabola_errs() -> None:
    random = np.random.default_rng(1)
    assert largest(3.0 * (1 + 1e-6 * random.uniform(-1, 1, 24)), EQUAL) == 0
    assert largest(np.array([1.0, 2.0, 2.001]), EQUAL) == 2 and largest(np.zeros(3), EQUAL) == 0


def test_what_differs_by_more_is_the_largest() -> None:
    values = np.array([1.0, 1.0 + 3e-9, 1.0])
    assert largest(values) == most_damped(values) == 1 and lowest(-values) == 1
    assert as_large(np.array([1.0, 2.0, 0.5, 2.0])).tolist() == [False, True, False, True]


@pytest.mark.parametrize("unknown", [np.nan, np.inf, -np.inf])
def test_values_that_are_not_known_are_left_out(unknown: float) -> None:
    values = np.array([unknown, 0.1, 0.3, unknown, 0.2])
    assert largest(values) == most_damped(values) == 2 and lowest(values) == 1
    assert not as_large(values)[[0, 3]].any()
    assert largest(values[[0, 3]]) == most_damped(values[[0, 3]]) == lowest(values[[0, 3]]) == 0


@pytest.mark.parametrize(("left", "expected"), [(0.0, True), (1e-12, True), (1e-10, False), (np.nan, True)])
def test_damping_that_the_solver_left_to_itself_does_not_vary(left: float, expected: bool) -> None:
    """A place of the largest was named where a looser solver had scattered it by more than rounding."""
    zeta = 0.01 + 1e-10 * np.sin(np.arange(20.0))
    assert varies({"zeta": zeta})
    table = {"zeta": zeta, "omega0": np.full(20, 50.0), "lambda_error_solver": np.full(20, 50.0 * left)}
    assert varies(table) is expected
    assert not varies(table, slice(3, 4)) and varies({**table, "zeta": zeta + 1e-9 * np.arange(20)})


@pytest.mark.parametrize(("well_known", "expected"), [(3, True), (1, False)], ids=["mixed", "one"])
def test_a_point_that_is_badly_known_says_nothing_of_the_others(well_known: int, expected: bool) -> None:
    """Damping varies where two points differ by more than the solver left of these two."""
    left = np.where(np.arange(5) < well_known, 1e-8, 1.0)
    table = {"zeta": 0.01 * np.arange(1, 6), "omega0": np.full(5, 50.0), "lambda_error_solver": 50.0 * left}
    assert varies(table) is expected
    table["zeta"][0] = np.nan
    assert varies(table) is expected
