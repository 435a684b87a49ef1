"""Modes that regularised friction overdamps: viscous at small amplitudes, it is bounded at large ones.

One harmonic of a mass on a spring with f = F tanh(v / eps): the force along the velocity is c(V) V of the describing
function, V = a w0 the amplitude of the velocity in the complex nonlinear mode, so that w0^2 = k / m, beta = c / (2 m).
With F = eps k m = 1/10 of each other the motion at rest has zeta = 5, and oscillates from a = 0.62986 on.
"""

import numpy as np
import pytest
from models.core_models import friction, single_dof
from scipy.integrate import quad
from scipy.optimize import brentq
from tolerances import TIGHT

import fretwave as fw
from fretwave.analyses.parts.branch import suspected
from fretwave.run.stopped import advice
from fretwave.units import SI

LIMIT, EPS = 1.0, 0.1


def zeta(amplitude):
    """Closed form of one harmonic."""
    along = quad(lambda t: np.tanh(amplitude * np.cos(t) / EPS) * np.cos(t), 0, np.pi / 2, epsabs=1e-13)[0]
    return LIMIT * along * 4 / np.pi / amplitude / 2


FIRST = brentq(lambda amplitude: zeta(amplitude) - 1, 0.1, 2.0, xtol=1e-12)


def branch(comm, first, last):
    model = single_dof(comm, law=friction([[1.0]], LIMIT, EPS))
    free = fw.linear_modes(model, count=1, contact="free")[0]
    mode = fw.NonlinearMode(model, fw.choose_harmonics(model, 1, samples=256), "CNM", 0, free)
    low, high = sorted((first, last))
    return mode, fw.Continuation(mode, mode.initial(first), (low, high))


@pytest.mark.parametrize("times", [1.0005, 1.03, 1.1, 1.5])
def test_mode_near_its_least_amplitude_is_found(comm, times):
    mode, found = branch(comm, times * FIRST, 2 * times * FIRST)
    told = [mode.state(point.y) for point in found]
    assert found.converged, found.reason
    for state in told:
        assert state["zeta"] == pytest.approx(zeta(state["amplitude"]), rel=TIGHT)
        assert state["omega0"] == pytest.approx(1.0, rel=TIGHT)


@pytest.mark.parametrize("times", [1e-3, 0.1, 0.5, 0.95])
def test_where_no_mode_oscillates_it_is_said_and_from_where_one_does(comm, times):
    _, found = branch(comm, times * FIRST, 4 * FIRST)
    assert not list(found) and not found.converged
    assert found.anchor is None
    assert f"to {FIRST:.3g}: step too small" in found.reason
    assert "damped less" in advice("mode", found.reason)


def test_branch_ends_where_its_motion_stops_to_oscillate(comm):
    mode, found = branch(comm, 5 * FIRST, 0.1 * FIRST)
    *_, last = found
    assert mode.state(last.y)["amplitude"] == pytest.approx(FIRST, rel=1e-4)
    assert 0 < mode.state(last.y)["zeta"] < 1
    assert "overdamped" in found.reason or "another branch" in found.reason


def test_branch_without_any_point_is_not_asked_what_happened_at_its_last(comm, monkeypatch):
    """Its reason may be that of a way to its start, which came back to where it began."""
    mode, found = branch(comm, 0.5 * FIRST, FIRST)
    assert not list(found)
    monkeypatch.setattr(found, "_advice", "; following the mode: it comes back to where it began")
    assert suspected(found, mode.core.stiffness_scale, SI) == ""
