"""Newton's steps from a nearly singular Jacobian do not reach where numbers overflow."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import fretwave as fw

pytestmark = pytest.mark.ranks(1)


class Cubic(fw.PythonLaw):
    """Of a user who has told NumPy to raise."""

    odd, stuck_stiffness = True, 0.0

    def force(self, u: Any, v: Any) -> Any:
        with np.errstate(all="raise"):
            assert np.isfinite(u).all()
            return 0.5 * u**3

    def tangent(self, u: Any, v: Any) -> Any:
        with np.errstate(over="raise"):
            return 1.5 * u[:, :, None] ** 2, 0 * u[:, :, None]


@pytest.mark.parametrize(("n", "k"), [(2, 1.0), (3, 30.0), (5, 30.0)])
def test_a_law_is_asked_for_forces_that_there_are(n: int, k: float) -> None:
    """Chains with internal resonances: amplitudes of 1e150 to 1e305 were tried, and then NaN."""
    K = k * (2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))
    model = fw.Model(np.eye(n), K, 0.01 * K, [fw.Contact(Cubic(), np.eye(n)[:1])])
    branch = fw.follow(fw.NonlinearMode(model, fw.choose_harmonics(model, 7), dof=0), 0.01, 30.0, errors=False)
    assert branch.converged
