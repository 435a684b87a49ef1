"""Errors at a fold: at its frequency, where the branch is a parabola, and not as far as a straight line leads."""

from __future__ import annotations

import numpy as np
import pytest

import fretwave as fw

pytestmark = pytest.mark.ranks(1)


def response(highest: int) -> fw.Branch:
    """x'' + 0.04 x' + x + x^3 = 0.2 cos wt, over both of its folds."""
    spring = fw.Contact("cubic_spring", [[1.0]], {"cubic_stiffness": 1.0})
    model = fw.Model([[1.0]], [[1.0]], [[0.04]], [spring])
    harmonics = fw.Harmonics(range(1, highest + 1, 2), 1024)
    problem = fw.ForcedResponse(model, harmonics, {1: [0.2]}, 1.0, 0, fw.linear_modes(model, 1)[0])
    return fw.follow(problem, 0.5, 3.5, steps=fw.StepControl(maximum=0.1))


@pytest.mark.parametrize("highest", [1, 3, 5])
def test_error_at_a_fold_is_how_far_the_branch_is_at_its_frequency(highest):
    """It was told as 0.67 of an amplitude of 2.2 at the upper fold, whatever the harmonics."""
    branch, exact = response(highest), response(25)
    pairs = list(zip(branch.met("fold"), exact.met("fold")))
    assert len(pairs) == 2
    for (own, true), inward in zip(pairs, (-1, 1)):  # there are solutions below the first fold, above the second
        off = abs(branch["omega"][own] - exact["omega"][true])
        there = exact.at(exact["omega"][true] + inward * off)
        at_fold = exact["amplitude"][true] * np.exp(1j * exact["phase"][true])
        near = np.sort(np.abs(there["amplitude"] * np.exp(1j * there["phase"]) - at_fold))[:2]  # on both sides of it
        told = branch["amplitude_error"][own]
        assert near[0] / 3 < told < 3 * near[1], (told, near)
