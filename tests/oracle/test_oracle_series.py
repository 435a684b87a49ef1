"""Harmonic balance in continuous time against orbits, sampling and closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from tolerances import LAST_DIGITS, ROUNDING, SOLVED

from oracle import Jenkins, System, hysteresis, mode_orbit, series_motion

pytestmark = pytest.mark.ranks(1)

ONE = np.array([[1.0]])
PAPER = System(
    np.diag([1.0, 0.02]),
    np.zeros((2, 2)),
    np.array([[640.0, -40.0], [-40.0, 40.0]]),
    [Jenkins(np.array([0.0, 1.0]), 400.0, 5.0)],
)


def wild(seed):
    """Eight harmonics and a mean, in room for forces of 40."""
    rng = np.random.default_rng(seed)
    u = np.zeros(41, complex)
    u[:9] = rng.standard_normal(9) + 1j * rng.standard_normal(9)
    u[0] = u[0].real
    return u


def test_forces_are_what_ever_more_samples_tend_to():
    """The sampled slider (f = clip(f + kt du) from sample to sample) meets them as N_t^-2, on the mean of motions."""
    law, off = Jenkins(np.array([1.0]), 1.0, 1.0), []
    periods = [hysteresis(law, wild(seed)) for seed in range(12)]
    exact = np.array([period.force() for period in periods])
    for count in (500, 2000):
        motion = np.array([period.series.grid(count) for period in periods])
        f, slider = np.empty_like(motion), np.zeros(len(motion))
        for k in [*range(count), *range(count)]:
            f[:, k] = np.clip(motion[:, k] - slider, -1, 1)
            slider = motion[:, k] - f[:, k]
        F = np.fft.fft(f)[:, :41] * 2 / count
        F[:, 0] /= 2
        off.append(abs(F - exact).max(axis=1).mean())
    assert off[1] < 1e-3 and 1.6 < np.log(off[0] / off[1]) / np.log(4) < 2.4


def test_forces_have_their_derivative():
    law, u, h = Jenkins(np.array([1.0]), 1.0, 1.0), wild(7), 1e-6
    exact = hysteresis(law, u).derivative(range(9))
    for m, part in [(0, 0), (1, 0), (1, 1), (6, 0), (6, 1)]:
        du = np.zeros(41, complex)
        du[m] = h * (-1j if part else 1)
        ends = [hysteresis(law, u + sign * du).force()[:9] for sign in (1, -1)]
        assert (ends[0] - ends[1]) / (2 * h) == pytest.approx(exact[:, m, part], abs=1e-6)


def test_one_harmonic_has_its_closed_form():
    """m = k = kt = R = 1, a = 2, both methods; complex stiffness of a Jenkins element."""
    system = System(ONE, 0 * ONE, ONE, [Jenkins(np.array([1.0]), 1.0, 1.0)])
    th = np.arccos(1 - 2 * 0.5)
    kappa = (th - np.sin(2 * th) / 2) / np.pi + 2j / np.pi * 0.5
    epmc = series_motion(system, "EPMC", 1, amplitude=2.0)
    assert epmc.omega0 == pytest.approx(np.sqrt(1 + kappa.real), rel=LAST_DIGITS)
    assert epmc.zeta == pytest.approx(kappa.imag / (2 * (1 + kappa.real)), rel=LAST_DIGITS)
    cnm = series_motion(system, "CNM", 1, amplitude=2.0)
    assert cnm.lambda_ == pytest.approx(1j * np.sqrt(1 + kappa), rel=LAST_DIGITS)
    assert (cnm.omega0, cnm.zeta) == pytest.approx((1.238306, 0.104362), abs=1e-6)


@pytest.mark.parametrize("a", [0.15, 0.5])
def test_the_series_tends_to_the_orbit(a):
    """EPMC with 201 harmonics and by shooting: two programs that share the law's two numbers only."""
    coarse = series_motion(PAPER, "EPMC", 21, amplitude=a)
    fine = series_motion(PAPER, "EPMC", 201, amplitude=a, guess=coarse)
    orbit = mode_orbit(PAPER, 0, a, coarse.omega0, coarse.zeta, coarse.state(0.3), phase=0.3)
    assert orbit.defect < ROUNDING
    assert fine.omega0 == pytest.approx(orbit.omega0, rel=SOLVED)
    assert fine.zeta == pytest.approx(orbit.zeta, abs=SOLVED)
    turned = np.exp(-0.3j * np.arange(10))
    q = orbit.harmonics([orbit.system.displacement(k) for k in range(2)], 9) * turned
    off = [abs(motion.q[:, :10] - q).max() for motion in (coarse, fine)]
    assert off[1] < (21 / 201) ** 3 * off[0]


def test_the_complex_mode_has_a_limit_that_it_meets_with_the_third_power_and_better():
    """H^-4 in lambda on the mean, with a factor that comes and goes between H and 2 H."""
    motion, found = series_motion(PAPER, "EPMC", 21, amplitude=2.0), []
    for H in (21, 201, 601):
        motion = series_motion(PAPER, "CNM", H, amplitude=2.0, guess=motion)
        found.append(motion.lambda_)
    off = [abs(value - found[-1]) / abs(found[-1]) for value in found[:-1]]
    assert off[0] < 1e-5 and off[1] < (21 / 201) ** 3 * off[0]
