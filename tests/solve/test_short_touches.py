"""Motions in time that touch a stop for less than a step: a bounce in closed form."""

from __future__ import annotations

import numpy as np
import pytest

import fretwave as fw

pytestmark = pytest.mark.ranks(1, 2)


def bounced(gap: float, k: float, t: float) -> float:
    """A mass on a spring of 1, at rest at -1, behind its first touch of a stop of stiffness k near its peak.

    It comes to the gap with the speed v and leaves it with -v; in between it swings with w^2 = 1 + k about
    k gap / w^2, from the displacement gap / w^2 and the speed v.
    """
    into = np.pi - np.arccos(gap)
    w = np.sqrt(1 + k)
    inside = 2 * np.arctan2(np.sin(into) / w, gap / w**2) / w
    return float(np.cos(t - into - inside + np.arccos(gap)))


@pytest.mark.parametrize("stiffness", [1e3, 1e6])
@pytest.mark.parametrize("side", [1.0, -1.0], ids=["above", "below"])
def test_a_touch_of_a_stop_within_a_step_is_seen(comm, stiffness, side):
    """However short: 1e-8 to 1e-3 of the amplitude deep; without that up to 4e-3 off. The second mass stays still."""
    for deep in 10.0 ** np.arange(-8, -2.5, 0.5):
        stop = fw.Contact("unilateral_spring", [[side, 0.0]], {"normal_stiffness": stiffness, "gap": 1 - deep}, "stop")
        with fw.Model(np.eye(2), np.eye(2), contacts=[stop], comm=comm) as model:
            out = fw.Transient(model).run([-side, 0.0], [0.0, 0.0], 6.0, 0.5, rtol=1e-10)
        assert out["x"][-1, 0] == pytest.approx(side * bounced(1 - deep, stiffness, 6.0), abs=1e-6)
        assert out["reason"] == "end" and out["steps"] < 300


def test_a_touch_is_seen_by_implicit_steps_too(comm):
    """A second stop, so stiff that explicit steps would be too many, is closed all the time."""
    stops = [
        fw.Contact("unilateral_spring", [[1.0, 0.0]], {"normal_stiffness": 1e4, "gap": 1 - 1e-5}, "stop"),
        fw.Contact("unilateral_spring", [[0.0, 1.0]], {"normal_stiffness": 1e12, "gap": -1.0}, "seat"),
    ]
    with fw.Model(np.eye(2), np.eye(2), contacts=stops, comm=comm) as model:
        out = fw.Transient(model).run([-1.0, -1.0], [0.0, 0.0], 6.0, 0.5, rtol=1e-6, most_steps=20000)
    assert out["implicit"]
    assert out["x"][-1, 0] == pytest.approx(bounced(1 - 1e-5, 1e4, 6.0), abs=1e-3)
