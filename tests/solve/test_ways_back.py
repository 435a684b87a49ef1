"""A corrector that lands on the piece just left: behind a corner its tangent fits a turn, and it is no way on."""

from __future__ import annotations

import pytest
from models.drawn_structures import followed, told


@pytest.mark.ranks(1, 2)
@pytest.mark.parametrize("seed", [629, 673])
def test_a_mode_goes_on_behind_turns_that_no_step_sees(seed, comm):
    """Of one, two corners and a fold of 1e-11 of its amplitude lie within 1e-6 of each other where a pair opens: the
    step behind them came back to the piece before, the turn between the two was taken for a corner ahead. Of the other
    the mean alone turns where a slider begins to slip. Both "turned back onto themselves".
    """
    branch, shortly = followed(comm, seed), followed(comm, seed, initial=0.02, maximum=0.06)
    assert branch.converged, branch.reason
    assert told(branch) == pytest.approx(told(shortly), rel=1e-9)


@pytest.mark.ranks(1, 2)
def test_a_corner_does_not_lead_to_another_place_of_the_mean(comm):
    """A pad's mean alone moves between two sheets that lie 3e-2 from each other and nothing in what steps are measured
    by: a turn led from one to the other, and the branch was "a closed loop" of 1e-7 of its amplitude.
    """
    branch, shortly = followed(comm, 871), followed(comm, 871, initial=0.02, maximum=0.06)
    assert all("where it began, without reaching" in one.reason for one in (branch, shortly))
    assert branch["amplitude"].max() == pytest.approx(shortly["amplitude"].max(), rel=1e-9)
