"""Reports between the points of a long step, over which many contacts change."""

from __future__ import annotations

import numpy as np
import pytest

import fretwave as fw

PAIRS = 8
REPORTS = np.geomspace(2e-3, 2.5, 20)[:2]


def mode(seed: int = 2) -> fw.NonlinearMode:
    """Of nodes in a row, each rubbing in two directions, under loads of their own."""
    draw = np.random.default_rng(seed)
    n = 3 * PAIRS
    K = 5 * np.eye(n)
    for node in range(PAIRS - 1):
        for c in range(3):
            here = [3 * node + c, 3 * node + c + 3]
            K[np.ix_(here, here)] += 10 ** draw.uniform(1, 3) * np.array([[1, -1], [-1, 1]])
    tangle = 0.3 * draw.normal(size=(n, n))
    K += tangle @ tangle.T
    values = {
        "normal_stiffness": 10 ** draw.uniform(2, 4),
        "tangential_stiffness": 10 ** draw.uniform(2, 4),
        "friction_coefficient": 0.4,
        "normal_load": draw.uniform(0.2, 3, size=PAIRS),
    }
    rows = np.eye(n)[np.concatenate([np.arange(n).reshape(PAIRS, 3)[:, c] for c in range(3)])]
    model = fw.Model(np.eye(n), K, 0.001 * K, [fw.Contact("coulomb_3d", rows, values)])
    return fw.NonlinearMode(model, fw.Harmonics(range(4), 64), "EPMC", 0, rest=fw.balanced(model))


@pytest.mark.ranks(1)
def test_a_report_that_newton_does_not_find_from_a_long_step_is_reached_by_shorter_ones():
    """One was missed, DIVERGED_MAX_IT: many contacts change over the step about it, on a branch that turns back."""
    steps = fw.StepControl(maximum=1.0, max_points=200)
    branch = fw.follow(mode(), 1e-3, 3.0, steps=steps, report_at=REPORTS, errors=False)
    assert branch.missed == [], branch.missed
    reported, amplitude = branch.met("report"), branch["amplitude"]
    others = np.delete(amplitude, reported)
    for value in REPORTS:
        met = [row for row in reported if abs(amplitude[row] / value - 1) < 1e-9]
        assert len(met) == np.count_nonzero(np.diff(np.sign(others - value))) > 0
        assert max(branch["residual"][met]) < 1e-9
