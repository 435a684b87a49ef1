"""A law in Python that gives no number is named where a solver stops for it, and there alone."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

import fretwave as fw
from fretwave.analyses.parts.branch import suspected
from fretwave.run.stopped import advice
from fretwave.units import SI

pytestmark = pytest.mark.ranks(1, 2)


class Cubic(fw.PythonLaw):
    """Numbers for all motions."""

    odd, stuck_stiffness, components, normal = True, 0.0, 2, None

    def force(self, u: Any, v: Any) -> Any:
        return 0.5 * u**3


class Edge(fw.PythonLaw):
    """A stop that is hard before it is reached; nothing is said of motions beyond."""

    def force(self, u: Any, v: Any) -> Any:
        with np.errstate(divide="ignore", invalid="ignore"):
            return u * np.sqrt(0.5 - u)


def test_a_law_that_gave_no_number_is_named_where_a_branch_stops() -> None:
    """All that was told was that a line search had diverged. Steps that go there and are shortened are no error."""
    model = fw.Model(np.eye(2), np.diag([1.0, 5.0]) + 0.1, contacts=[fw.Contact(Edge(), np.eye(2)[:1], name="edge")])
    assert model.without_numbers() == {}
    mode = fw.NonlinearMode(model, fw.Harmonics(range(4), 64), "CNM", 0, fw.linear_modes(model, 1, "free")[0])
    branch = fw.Continuation(mode, mode.initial(0.01), (0.01, 1.0))
    points = [point.parameter for point in branch]
    told = suspected(branch, 1.0, SI)
    assert not branch.converged and max(points) < 0.7
    u, v = map(float, re.fullmatch("; the law of contact 'edge' gave no number at u = (.*), v = (.*)", told).groups())
    assert u >= 0.5 and abs(v) < 1.0
    assert "gives a number at any motion" in advice("mode", branch.reason + told)
    branch.destroy()


def test_no_other_law_and_no_other_branch_is_blamed_for_it() -> None:
    """One that was given a motion that another had spoiled, or a later branch on the same model."""
    contacts = [fw.Contact(Cubic(), np.eye(4)[2:], name="fine"), fw.Contact(Edge(), np.eye(4)[:1], name="edge")]
    K = np.diag([1.0, 5.0, 7.0, 9.0]) + 0.1
    model = fw.Model(np.eye(4), K, 0.05 * K, contacts)
    mode = fw.NonlinearMode(model, fw.Harmonics(range(4), 64), "CNM", 0, fw.linear_modes(model, 1, "free")[0])
    for stop in (1.0, 0.05):
        branch = fw.Continuation(mode, mode.initial(0.01), (0.01, stop))
        for point in branch:
            point.destroy()
        told = suspected(branch, 1.0, SI)
        assert ("'edge' gave no number" in told) == (stop == 1.0) and "'fine'" not in told
        branch.destroy()
