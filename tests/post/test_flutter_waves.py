"""What is said of a wave from its table: verdicts by the signs of the damping, cycles where the branch runs back."""

from __future__ import annotations

import numpy as np
import pytest

from fretwave.post.flutter_waves import describe_waves, verdict, words


@pytest.mark.ranks(1)
def test_verdicts_follow_the_signs_of_the_damping():
    cases = {
        "stable": [0.1, 0.3, 0.1],
        "unbounded": [-0.1, -0.01, -0.1],
        "bounded": [-0.1, 0.2, 0.1],
        "bounded below": [-0.1, 0.2, -0.1],
        "stable below": [0.1, 0.2, -0.1],
        "neutral": [0.0, 1e-13, 0.0],
    }
    for expected, zeta in cases.items():
        assert verdict(np.array(zeta)) == expected


@pytest.mark.ranks(1)
@pytest.mark.parametrize("rounding", [-2e-18, 6e-18])
def test_no_damping_is_told_as_none(rounding):
    """Of a flow that does nothing "-2.15e-16 %" was said."""
    columns = {"nodal_diameter": np.zeros(2), "amplitude": np.array([1.0, 2.0]), "zeta": np.full(2, rounding)}
    (wave,) = describe_waves({**columns, "frequency_hz": np.full(2, 10.0), "event": np.array(["", ""])}, [0])
    assert words(wave, "m") == "ND 0, 10 Hz, +0 % at the smallest amplitude: neither damped nor fed"


@pytest.mark.ranks(1)
def test_a_limit_cycle_on_a_branch_that_runs_back_names_its_folds():
    """Damping rises along the branch while the amplitude falls: that says nothing of its stability."""
    rows = [
        (1.0, -0.02, ""),
        (1.2, -0.01, "fold"),
        (1.1, 0.0, "zero_damping"),
        (1.0, 0.01, "fold"),
        (1.5, 0.02, ""),
    ]
    amplitude, zeta, events = (np.array(column) for column in zip(*rows))
    columns = {"nodal_diameter": np.full(5, 3), "amplitude": amplitude, "zeta": zeta, "frequency_hz": 10 + 0 * zeta}
    (wave,) = describe_waves({**columns, "event": events}, [3, 4])
    (cycle,) = wave["limit_cycles"]
    assert cycle["folds"] == [1.0, 1.2] and cycle["stable"] is None and wave["verdict"] == "bounded"
    assert "runs back between 1 and 1.2 mm" in words(wave, "mm")


@pytest.mark.ranks(1)
@pytest.mark.parametrize(
    ("zeta", "said"),
    [
        ([0.01, 0.03, 0.02, 0.01], "stable at every amplitude up to 3 m"),
        ([-0.01, -0.03, -0.02, -0.01], "grows at every amplitude up to 3 m"),
        ([-0.01, 0.02, -0.01, 0.01], "growth without bound beyond"),
    ],
)
def test_a_branch_that_comes_back_is_judged_where_its_amplitude_is_largest(zeta, said):
    columns = {"nodal_diameter": np.ones(4), "amplitude": np.array([1.0, 2.0, 3.0, 0.25]), "zeta": np.array(zeta)}
    event = np.array(["", "zero_damping" if min(zeta) < 0 < max(zeta) else "", "fold", ""])
    (wave,) = describe_waves({**columns, "frequency_hz": np.full(4, 10.0), "event": event}, [1])
    assert wave["last_amplitude"] == 3.0 and said in words(wave, "m")


@pytest.mark.ranks(1)
@pytest.mark.parametrize(
    ("zeta", "said"),
    [
        ([-0.01, -0.001, 0.001], "limit cycle not located; largest"),
        ([-0.01, 0.001, -0.01], "limit cycle not located, growth without bound beyond; largest"),
        ([0.01, 0.001, -0.01], "decays below, limit cycle not located; largest"),
    ],
)
def test_a_change_of_sign_without_a_point_at_zero_leaves_no_hole_in_the_words(zeta, said):
    """They were ": , growth without bound beyond"."""
    columns = {"nodal_diameter": np.ones(3), "amplitude": np.array([1.0, 2.0, 3.0]), "zeta": np.array(zeta)}
    (wave,) = describe_waves({**columns, "frequency_hz": np.full(3, 10.0), "event": np.full(3, "")}, [1])
    assert said in words(wave, "m")


@pytest.mark.ranks(1)
def test_a_branch_that_stopped_early_says_nothing_of_what_is_beyond():
    """A limit cycle may be there: friction was called never to make up for the flow."""
    columns = {"nodal_diameter": np.ones(2), "amplitude": np.array([1.0, 2.0]), "zeta": np.array([-0.01, -0.01])}
    (wave,) = describe_waves({**columns, "frequency_hz": np.full(2, 10.0), "event": np.full(2, "")}, [1])
    said, to_the_end = words(wave, "m", stopped=True), words(wave, "m")
    assert said.startswith(to_the_end) and "never" not in said
    assert "stopped early, at most 2 m: what is beyond is not known" in said and "stopped" not in to_the_end
