"""The oracle against Runge-Kutta integration of laws written a second time, shorter steps, and differences."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from tolerances import REPEATED, ROUNDING, SOLVED

from oracle import Coulomb, Flow, Jenkins, LoadedJenkins, System, Unilateral, forced_orbit
from oracle.orbit import nodes

pytestmark = pytest.mark.ranks(1)

PAPER = np.diag([1.0, 0.02]), np.zeros((2, 2)), np.array([[640.0, -40.0], [-40.0, 40.0]])
DAMPER = Jenkins(np.array([0.0, 1.0]), 400.0, 5.0)


def paper(level, omega):
    """The paper's oscillator (GT2008-50860, section 2) with an elastic slider of 400 N/m."""
    return System(*PAPER, [DAMPER], np.array([level, 0.0]), omega=omega)


def lightly():
    """The paper's oscillator in partial slip."""
    return paper(7.0, 24.5)


def rubbing():
    """A block on a one-sided spring under a swinging load: sticks, slips, lifts off and lands again."""
    normal = Unilateral(np.array([1.0, 0.0, 0.0]), 50.0, -0.02)
    friction = LoadedJenkins(np.array([0.0, 1.0, 0.3]), 40.0, 0.4, normal)
    M, K = np.diag([1.0, 1.0, 0.5]), np.array([[20.0, 2.0, 0.0], [2.0, 15.0, -5.0], [0.0, -5.0, 12.0]])
    P, p = np.array([1.6, 1.5j, 0.4]), np.array([0.1, 0.0, 0.0])
    return System(M, 0.4 * np.eye(3), K, [normal, friction], P, p, omega=3.0)


def rigid(omega=0.25, second=0.7):
    """Three masses, two of them on rigid friction that holds them for a while."""
    K, along = np.array([[3.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 2.0]]), np.eye(3)
    contacts = [Coulomb(along[0], 1.0), Coulomb(along[2], second)]
    return System(np.eye(3), 0.05 * np.eye(3), K, contacts, np.array([2.0, 0, 1j]), omega=omega)


def turning():
    """The same, but friction only turns them."""
    return rigid(0.9, 0.2)


@cache
def orbits():
    """One of each, to be looked at by several tests."""
    return {made.__name__: forced_orbit(made()) for made in (lightly, rubbing, rigid, turning)}


def runge_kutta(system, orbit, force, rate):
    """(x, x', T) after a period by DOP853, restarted at the oracle's events; T' = rate of stick, slip and open."""
    n, w = system.n_dof, system.omega

    def slope(t, z):
        x, v, s = z[:n], z[n : 2 * n], z[2 * n :]
        load = np.real(system.P * np.exp(1j * w * t)) + system.p - system.C @ v - system.K @ x
        return np.concatenate([v, np.linalg.solve(system.M, load - force(x, s)), rate(x, v, s)])

    z, times = orbit.state, sorted({0.0, orbit.period, *(event.t for event in orbit.events)})
    for begin, end in zip(times, times[1:]):
        z = solve_ivp(slope, (begin, end), z, "DOP853", rtol=1e-13, atol=1e-15).y[:, -1]
    return z


@pytest.mark.parametrize("level, omega", [(5.0, 24.5), (8.5, 25.2)])
def test_runge_kutta_closes_the_period_of_the_paper_s_oscillator(level, omega):
    """T' = kt v, but for a slider at its limit that is pushed on."""
    orbit = forced_orbit(paper(level, omega))

    def rate(x, v, s):
        limit = abs(s[0]) >= 5 - 1e-9 and s[0] * v[1] > 0
        return np.array([0.0 if limit else 400.0 * v[1]])

    end = runge_kutta(orbit.system, orbit, lambda x, s: np.array([0.0, s[0]]), rate)
    assert orbit.defect < ROUNDING and len(orbit.events) >= 4
    assert end == pytest.approx(orbit.state, rel=REPEATED, abs=SOLVED)


def test_runge_kutta_closes_a_period_with_lift_off():
    """|T| <= mu N, N = max(0, 1 + 50 u), by the definition of the law."""
    orbit = orbits()["rubbing"]
    B = np.array([0.0, 1.0, 0.3])

    def load(x):
        return max(0.0, 1 + 50 * x[0])

    def rate(x, v, s):
        N = load(x)
        if N == 0:
            return np.zeros(1)
        trial, grows = 40 * B @ v, 0.4 * 50 * v[0]
        for sign in (1, -1):
            if sign * s[0] >= 0.4 * N - 1e-9 and sign * trial >= grows:
                return np.array([sign * grows])
        return np.array([trial])

    end = runge_kutta(orbit.system, orbit, lambda x, s: np.array([load(x), 0, 0]) + B * s, rate)
    assert {event.after for event in orbit.events} == {"open", "closed", "stick", "+", "-"}
    assert orbit.defect < ROUNDING
    assert end == pytest.approx(orbit.state, rel=1e-7, abs=1e-7)


@pytest.mark.parametrize("name", ["lightly", "rubbing", "rigid", "turning"])
def test_nothing_depends_on_the_steps_and_no_event_is_missed(name):
    orbit = orbits()[name]
    for share in (0.5, 0.21):
        finer = forced_orbit(orbit.system, orbit.state, orbit.pattern, share=share)
        assert finer.state == pytest.approx(orbit.state, rel=1e-11, abs=ROUNDING)
        assert [(e.contact, e.after) for e in finer.events] == [(e.contact, e.after) for e in orbit.events]
        assert [e.t for e in finer.events] == pytest.approx([e.t for e in orbit.events], abs=1e-11)


@pytest.mark.parametrize("name", ["lightly", "rubbing", "rigid", "turning"])
def test_the_monodromy_is_the_derivative_of_the_period(name):
    """Central differences over a period and a quarter, through every kind of event."""
    orbit = orbits()[name]
    system = orbit.system
    flow, m, duration = Flow(system), system.n_state, 1.25 * orbit.period
    exact = flow.passage(system.extended(orbit.state), orbit.pattern, duration, tangent=True).monodromy[:m, :m]
    for k in range(m):
        ends = [
            flow.passage(system.extended(orbit.state + h * np.eye(m)[k]), orbit.pattern, duration).end[:m]
            for h in (1e-6, -1e-6)
        ]
        assert (ends[0] - ends[1]) / 2e-6 == pytest.approx(exact[:, k], rel=1e-5, abs=1e-5 * abs(exact).max())


def test_a_chain_of_twenty_with_every_law_closes_and_balances_its_energy():
    """Work of the force over a period, pi Im(conj(q) . P), is what C and the contacts take."""
    n, along = 20, np.eye(20)
    stop = Unilateral(along[4], 200.0, -0.01)
    contacts = [
        Jenkins(along[3] - along[2], 80.0, 0.8),
        Jenkins(along[15], 50.0, 0.5),
        Unilateral(along[10] - along[9], 300.0, 0.05),
        stop,
        LoadedJenkins(along[6] - along[5], 60.0, 0.5, stop),
        Coulomb(along[12], 0.3),
    ]
    K = 100 * (2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))
    system = System(np.eye(n), 0.02 * np.eye(n) + 1e-3 * K, K, contacts, 6 * along[0] + 2j * along[7], omega=4.4)
    orbit = forced_orbit(system)
    assert orbit.defect < ROUNDING and {event.contact for event in orbit.events} == set(range(6))
    q = orbit.harmonics([system.displacement(k) for k in range(n)], 1)[:, 1]
    _, weight, y = nodes(orbit.passage, 22)
    v = y[:, n : 2 * n]
    damped = weight @ ((v @ system.C) * v).sum(axis=1)
    assert damped + orbit.work().sum() == pytest.approx(np.pi * (q.conj() @ system.P).imag, rel=ROUNDING)
    assert orbit.work()[[2, 3]] == pytest.approx(0, abs=ROUNDING * damped)
