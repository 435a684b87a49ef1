"""Branches of masses on contacts at random that touch where opposite discs begin to hold a slider, or cease to."""

from __future__ import annotations

import pytest
from models.drawn_structures import followed, scene, told

import fretwave as fw


@pytest.mark.ranks(1, 2)
@pytest.mark.parametrize("seed", [247, 394, 3120])
def test_a_mode_leads_on_behind_a_facet_that_it_touches(comm, seed):
    """Two ended where a slider begins to go round, one turned back onto itself by products along the facet."""
    branch, shortly = followed(comm, seed), followed(comm, seed, initial=0.02, maximum=0.06)
    assert branch.converged, branch.reason
    assert told(branch) == pytest.approx(told(shortly), rel=1e-9)


@pytest.mark.ranks(1, 2)
def test_a_response_turns_right_round_where_a_slider_begins_to_be_held(comm):
    """No step was short enough: its extension does not meet the other piece. It ends as one that begins there."""
    problem, *_ = scene(comm, 166)
    branch = fw.follow(problem, 0.78, 0.72, errors=False)
    assert branch.converged, branch.reason
    end = fw.follow(problem, 0.72, 0.71, errors=False)
    assert branch["amplitude"][-1] == pytest.approx(end["amplitude"][0], rel=1e-9)


@pytest.mark.ranks(1, 2)
def test_a_curve_that_touches_such_facets_closes(comm):
    """It ended at the first one in long steps, with a word of a mean position that is free."""
    branch, shortly = followed(comm, 104), followed(comm, 104, initial=0.02, maximum=0.04)
    assert all("a closed loop" in one.reason for one in (branch, shortly))
    assert branch["amplitude"].max() == pytest.approx(shortly["amplitude"].max(), rel=1e-9)
