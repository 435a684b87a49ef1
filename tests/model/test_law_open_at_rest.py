"""A law in Python of which some pairs are open at rest is the compiled one there."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import fretwave as fw

pytestmark = pytest.mark.ranks(1, 2)


class Stop(fw.PythonLaw):
    """As ``unilateral_spring``."""

    normal, stuck_stiffness = 0, 60.0

    def __init__(self, gap: float) -> None:
        self.given = gap

    def force(self, u: Any, v: Any) -> Any:
        return np.maximum(0.0, 60.0 * (u - self.given))

    def status(self, u: Any, v: Any, f: Any) -> Any:
        return np.where(f[:, 0] > 0, 0, 2)

    def gap(self, u: Any, v: Any, f: Any) -> Any:
        return np.maximum(self.given - u[:, 0], 0.0)


@pytest.mark.parametrize("gap", [0.5, -0.5])
def test_pairs_that_are_open_at_rest_do_not_stick(gap: float) -> None:
    """They counted as closed in linear modes: a branch began on the second mode, exit 0."""
    K = [[80.0, -20.0], [-20.0, 60.0]]
    compiled = fw.Contact("unilateral_spring", [[0.0, 1.0]], {"normal_stiffness": 60.0, "gap": gap})
    found = []
    for contact in (compiled, fw.Contact(Stop(gap), [[0.0, 1.0]])):
        with fw.Model(np.eye(2), K, contacts=[contact]) as model:
            found.append([mode.omega for mode in fw.linear_modes(model, 2, "stuck")])
    exact = np.linalg.eigvalsh(np.array(K) + np.diag([0.0, 60.0 * (gap < 0)])) ** 0.5
    np.testing.assert_allclose(found, [exact, exact], rtol=1e-10)
