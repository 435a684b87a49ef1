"""The oracle against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import newton
from tolerances import LAST_DIGITS, ROUNDING

from oracle import Coulomb, Flow, Jenkins, ModeOrbit, System, Unilateral, forced_orbit, mode_orbit

pytestmark = pytest.mark.ranks(1)

ONE, ZERO, X = np.array([[1.0]]), np.array([[0.0]]), np.array([1.0])


def test_den_hartog_has_his_amplitude_and_its_multipliers():
    """Den Hartog 1931: x'' + x + 0.3 sgn x' = cos 0.8 t; multipliers from accelerations at the turning points."""
    orbit = forced_orbit(System(ONE, ZERO, ONE, [Coulomb(X, 0.3)], np.array([1.0]), omega=0.8))
    assert orbit.defect < ROUNDING
    assert orbit.peak(orbit.system.displacement(0)) == pytest.approx(2.626104875723477, rel=LAST_DIGITS)
    assert orbit.multipliers == pytest.approx([0.0229404 + 0.6967003j, 0.0229404 - 0.6967003j], abs=1e-7)
    assert abs(orbit.multipliers[0]) == pytest.approx(1.3807071 / 1.9807071, abs=2e-8)
    assert orbit.work()[0] == pytest.approx(4 * 0.3 * 2.626104875723477, rel=1e-13)


@pytest.mark.parametrize("friction, stiffness", [(1e3, 60.0), (0.0, 20.0)])
def test_a_slider_without_slip_or_friction_leaves_the_linear_response(friction, stiffness):
    K = np.array([[30.0, -10.0], [-10.0, 20.0]])
    M, C, P, w = np.diag([2.0, 1.0]), 0.1 * np.eye(2), np.array([1.0 - 2j, 0.5]), 3.7
    orbit = forced_orbit(System(M, C, K, [Jenkins(np.array([0.0, 1.0]), 40.0, friction)], P, omega=w))
    K = K + np.diag([0, stiffness - 20.0])
    exact = np.linalg.solve(K + 1j * w * C - w**2 * M, P)
    q = orbit.harmonics([orbit.system.displacement(k) for k in range(2)], 5)
    assert q[:, 1] == pytest.approx(exact, rel=ROUNDING)
    assert abs(q[:, [0, 2, 3, 4, 5]]).max() < 1e-13
    free = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]])
    exact = np.exp(2 * np.pi / w * np.linalg.eigvals(free))
    kept = [1.0] if friction else [0.0]  # the slider's place
    assert np.sort(abs(orbit.multipliers)) == pytest.approx(np.sort([*kept, *abs(exact)]), rel=ROUNDING)


def test_a_jenkins_loop_dissipates_its_closed_form():
    """4 R (a - R / kt) between two turning points +- a, whatever the harmonics of the motion are."""
    R, kt = 1.0, 5.0
    orbit = forced_orbit(System(ONE, 0.05 * ONE, ONE, [Jenkins(X, kt, R)], np.array([2.0]), omega=1.3))
    assert [event.after for event in orbit.events].count("stick") == 2
    a = orbit.peak(orbit.system.displacement(0))
    assert a > 1.1 * R / kt
    assert orbit.work()[0] == pytest.approx(4 * R * (a - R / kt), rel=ROUNDING)


@pytest.mark.parametrize("kn", [3.0, 1e6])
def test_a_bilinear_oscillator_has_its_frequency_at_any_amplitude(kn):
    """w = 2 w1 w2 / (w1 + w2); kn = 3: 4 / 3. Half sines of the two frequencies to begin with."""
    system = System(ONE, ZERO, ONE, [Unilateral(X, kn, 0.0)])
    w1, w2 = 1.0, np.sqrt(1 + kn)
    exact = 2 * w1 * w2 / (w1 + w2)
    for a in (0.01, 7.0):
        mode = mode_orbit(system, 0, a, 1.02 * exact, 0.01, np.array([-a, 0.3 * a]), phase=2.8)
        assert mode.omega0 == pytest.approx(exact, rel=ROUNDING)
        assert mode.zeta == pytest.approx(0, abs=ROUNDING)
        assert abs(mode.multipliers) == pytest.approx([1, 1], abs=1e-6)


def test_a_one_sided_stop_has_its_frequency():
    """Code_Aster sdnd122a: m = 1, k = 10, stop of 50 N/m at 0.01 m, energy 0.00650108331626 J: 0.646631... Hz."""
    stop = System(ONE, ZERO, 10 * ONE, [Unilateral(X, 50.0, 0.01)])

    def motion(a: float) -> ModeOrbit:
        return mode_orbit(stop, 0, a, 4.06, 0.0, np.array([-1.2 * a, 0.0]), phase=np.pi)

    def energy(a: float) -> float:
        x, v = motion(a).state
        return v**2 / 2 + 5 * x**2 + 25 * max(0.0, x - 0.01) ** 2

    a = newton(lambda a: energy(a) / 0.00650108331626 - 1, 0.03, x1=0.0301, tol=1e-16, rtol=1e-14)
    assert motion(a).omega0 / (2 * np.pi) == pytest.approx(0.6466310406398371, rel=ROUNDING)


def test_free_coulomb_friction_loses_its_steps_and_stops():
    """Code_Aster sdnd100a: turning points lose 2 mu m g / k each, until k x < mu m g holds for good."""
    system = System(ONE, ZERO, 1e4 * ONE, [Coulomb(X, 1.0)])
    half = np.pi / 100
    flow, y = Flow(system), system.extended(np.array([8.5e-4, 0.0]))
    for turning in (-6.5e-4, 4.5e-4, -2.5e-4, 5e-5, 5e-5):
        passage = flow.passage(y, ("stick",), half)
        y = passage.end
        assert y[0] == pytest.approx(turning, rel=ROUNDING)
    assert passage.pattern == ("stick",) and not passage.events
