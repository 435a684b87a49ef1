"""Friction on a circle under given motion: closed forms, the exact oracle, and its definition by small steps."""

from __future__ import annotations

import numpy as np
import pytest
from tolerances import ROUNDING, TIGHT

from oracle import Jenkins, hysteresis
from oracle.circle import Block, Pair, orbit_3d
from oracle.friction_3d import Pad, Series, coefficients, common_point, forces, waves

pytestmark = pytest.mark.ranks(1)

BENT = np.array([[0.2, 1.0, 0.3, 0.2, -0.3], [0.0, 1.0, 0.5, -0.4, 0.3], [0.1, -0.4, 1.2, 0.3, 0.2]])


def test_a_straight_path_is_the_elastic_slider():
    Q = np.zeros((3, 7))
    Q[1:, 1:] = np.outer([0.6, 0.8], [3.0, 0.5, 0.0, 0.7, -0.4, 0.0])
    F = forces(Q, kn=2.0, kt=1.5, mu=0.5, N0=2.0, harmonics=6)
    u = np.zeros(7, complex)
    u[:4] = 0.0, 3.0 - 0.5j, -0.7j, -0.4
    f = hysteresis(Jenkins(np.array([1.0]), 1.5, 1.0), u).force()
    assert F[1, 1::2] - 1j * F[1, 2::2] == pytest.approx(0.6 * f[1:], abs=ROUNDING)
    assert F[2, 1::2] - 1j * F[2, 2::2] == pytest.approx(0.8 * f[1:], abs=ROUNDING)
    assert F[1:, 0] == pytest.approx(f[0].real * np.array([0.6, 0.8]), abs=ROUNDING)
    assert F[0] == pytest.approx([2.0, *np.zeros(12)], abs=ROUNDING)


@pytest.mark.parametrize("kt", [0.6, 2.0, 20.0])
def test_a_circle_lags_by_its_closed_form(kt):
    """T = R e^{i (tau + psi)}, cos psi = R / (kt a): R phi' = u' . e_phi with phi' = 1; R, kt a: limit and arm."""
    a, R = 2.0, 1.0
    F = forces(lambda t: (0.0, a * np.cos(t), a * np.sin(t)), kn=1.0, kt=kt, mu=0.5, N0=2.0, harmonics=3)
    T = R * np.exp(1j * np.arccos(R / (kt * a)))
    assert F[1, 1] - 1j * F[1, 2] == pytest.approx(T, abs=ROUNDING)
    assert F[2, 1] - 1j * F[2, 2] == pytest.approx(-1j * T, abs=ROUNDING)
    assert abs(F[1:, [0, 3, 4, 5, 6]]).max() < (ROUNDING)


def by_steps(Q, kn, kt, mu, N0, harmonics, count, periods):
    """The sweeping process by its definition: at each time the slider goes to the nearest point of the disc."""
    tau = 2 * np.pi * np.arange(count) / count
    u = Q @ waves(Q.shape[1] // 2, tau)
    N = np.maximum(0.0, N0 + kn * u[0])
    z, R, w, d = u[1] + 1j * u[2], mu * N / kt, 0j, np.empty(count, complex)
    for k in np.tile(np.arange(count), periods):
        arm = z[k] - w
        if abs(arm) > R[k]:
            w = z[k] - arm * (R[k] / abs(arm))
        d[k] = z[k] - w
    W = waves(harmonics, tau) * 2 / count
    W[0] /= 2
    return np.array([W @ N, kt * W @ d.real, kt * W @ d.imag])


@pytest.mark.parametrize("N0", [0.0, 0.9, 6.0])
def test_it_is_what_small_steps_tend_to(N0):
    """Lifts off, lands and sticks or lands in slip, and never lifts off; steps are of first order."""
    law = {"kn": 2.0, "kt": 3.0, "mu": 0.5, "N0": N0}
    exact = forces(BENT, **law, harmonics=4)
    errors = [abs(by_steps(BENT, **law, harmonics=4, count=n, periods=3) - exact).max() for n in (3000, 30000)]
    assert errors[1] < 1e-4 * abs(exact).max()
    assert errors[0] > 7 * errors[1]


#: Nearly straight, kt 8e5 N/m: a drag of 0.016 on a shrinking circle, so that what its direction is off by grows.
NEARLY_STRAIGHT = np.array(
    [
        [-2.56043e-10, -1.684725e-08, -5.055485e-09, 0, 0, 5.0753e-10, 3.6233e-10, 0, 0, -1.1688e-10, -4.0261e-11],
        [
            *(-6.118616393704122e-03, 1.651893927687593e-02, -2.869601431742364e-02, 5.59577656306384e-06),
            *(-3.554722119083375e-05, 3.139307351293408e-03, 1.031553373868571e-03, -3.44580258157938e-06),
            *(1.011967836743308e-05, -6.964763610412225e-04, -2.698171057398385e-04),
        ],
        [
            *(1.594986250114293e-02, -5.209705514991e-02, 8.80451139492159e-02, -1.93822853184317e-05),
            *(1.066489591913011e-04, -9.57051979969449e-03, -3.775040787516634e-03, 1.097973989317325e-05),
            *(-3.290930299877986e-05, 2.265116142684762e-03, 8.487653310911455e-04),
        ],
    ]
)


def test_a_short_drag_before_a_reversal_is_there():
    law = {"kn": 1e6, "kt": 8e5, "mu": 0.5, "N0": 1.0}
    steps = by_steps(NEARLY_STRAIGHT, **law, harmonics=5, count=1 << 16, periods=2)
    assert forces(NEARLY_STRAIGHT, **law, harmonics=5) == pytest.approx(steps, abs=1e-4)


def test_it_is_the_force_of_an_exact_orbit():
    """A block that sticks and slips under a changing load: its displacement's harmonics give its traction's."""
    K = np.array([[20.0, 2.0, 0.0], [2.0, 15.0, 0.0], [0.0, 0.0, 6.0]])
    pair = Pair(np.eye(3), kn=50.0, kt=40.0, mu=0.4, N0=1.0)
    P = np.array([0.9, 0.8j, 0.1])
    orbit = orbit_3d(Block(np.eye(3), 0.4 * np.eye(3), K, [pair], P, np.array([1.0, 0.0, 0.0]), 3.0), settle=4)
    assert {event.after for event in orbit.events} == {"stick", "slip"}
    q = orbit.harmonics(60)
    Q = np.zeros((3, 121))
    Q[:, 0], Q[:, 1::2], Q[:, 2::2] = q[:3, 0].real, q[:3, 1:].real, -q[:3, 1:].imag
    F = forces(Q, kn=50.0, kt=40.0, mu=0.4, N0=1.0, harmonics=10)
    assert F[1:, 1::2] - 1j * F[1:, 2::2] == pytest.approx(q[6:, 1:11], abs=1e-5)


def test_nothing_slips_from_the_common_point_and_none_is_nearer():
    for size in (0.5, 1.0, 1.2):
        c = np.array([[0, 0.5, 0.3 - 0.1j], [0.2, -0.5j, 0.2j], [1.0, 0.2, 0.1j]]) * [[size], [size], [1.0]]
        pad, rest = Pad(Series(c), 1), np.array([0.7, 0.6])
        w = common_point(pad, rest)
        x, R = pad.path(np.linspace(0, 2 * np.pi, 4001))[:2], pad.path(np.linspace(0, 2 * np.pi, 4001))[2]

        def out(w, x=x, R=R):
            return (np.linalg.norm(x - np.reshape(w, (2, 1)), axis=0) - R).max()

        assert w is not None and abs(out(w)) < 1e-6 and out(w) < ROUNDING
        near = w + 0.05 * np.random.default_rng(0).standard_normal((500, 2))
        better = [p for p in near if np.linalg.norm(p - rest) < np.linalg.norm(w - rest) - 1e-6]
        assert better and min(out(p) for p in better) > 0
        load = c[2] * 2.0
        Q = np.zeros((3, 5))
        for row, q in enumerate((load, c[0], c[1])):
            Q[row, 0], Q[row, 1::2], Q[row, 2::2] = q[0].real, q[1:].real, -q[1:].imag
        F = forces(Q, kn=1.0, kt=1.0, mu=0.5, N0=0.0, rest=rest, harmonics=2)
        assert F[1:, 1:] == pytest.approx(Q[1:, 1:], abs=ROUNDING)
        assert F[1:, 0] == pytest.approx(Q[1:, 0] - w, abs=ROUNDING)


def test_what_never_touches_has_no_force_and_a_callable_is_its_coefficients():
    assert not forces(BENT, kn=1.0, kt=1.0, mu=0.5, N0=-10.0).any()
    assert coefficients(lambda t: BENT @ waves(2, t)) == pytest.approx(BENT, abs=TIGHT)
