"""Contact whose changes of state lie between samples: exact force and tangent, smooth along a branch, at any N_t."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from models.core_models import dense, derivative, unknowns, whole
from mpi4py import MPI
from oracle import Jenkins
from oracle.period import hysteresis
from tolerances import LAST_BIT, LAST_DIGITS, ROUNDING

import fretwave as fw

SLIDER = {"tangential_stiffness": 1.5, "friction_limit": 0.6}
PAD = {"normal_stiffness": 8.0, "tangential_stiffness": 5.0, "friction_coefficient": 0.4}
STOP = {"normal_stiffness": 8.0}
#: What differences err by where a higher derivative is large, near the end of a short slip
DIFFERENCES = 1e-7


class Forces:
    """F(Q) and dF/dQ of one pair, whose components (n, m) move as told: frequency 1, unit masses on unit springs."""

    def __init__(self, law: str, parameters: dict[str, Any], orders, samples: int = 0, settled=None) -> None:
        n = fw.laws()[law].components
        start = fw.LinearMode(1.0, 0.0, np.ones(n), np.zeros(n))
        model = fw.Model(np.eye(n), np.eye(n), None, [fw.Contact(law, np.eye(n), parameters)], MPI.COMM_WORLD)
        self.orders = list(orders)
        harmonics = fw.Harmonics(self.orders, samples or 2 * self.orders[-1] + 2)
        self.problem = fw.NonlinearMode(model, harmonics, "EPMC", 0, start)
        k = np.concatenate([[0] if not o else [o, o] for o in self.orders])
        self.linear = np.tile(1 - k**2, n)

    def at(self, Q):
        return unknowns(self.problem, np.concatenate([np.ravel(Q), [0.0, 1.0, 0.0]]))

    def __call__(self, Q):
        q = np.ravel(Q)
        return whole(self.problem.residual(self.at(q)))[: len(q)] - self.linear * q

    def tangent(self, Q):
        n = np.size(Q)
        return dense(self.problem.jacobian(self.at(Q)))[:n, :n] - np.diag(self.linear)

    def told(self, Q):
        return self.problem.diagnostics(self.at(Q))


def motion(seed: int, H: int, components: int = 1, roughness: float = 1.5):
    """Random coefficients (components, 2 H + 1) that fall with the order."""
    n = np.repeat(np.arange(H + 1), 2)[1:].clip(1)
    return np.random.default_rng(seed).standard_normal((components, 2 * H + 1)) / n**roughness


def oracle(q, kt: float, limit: float):
    """F and dF/dQ of the test's own hysteresis in continuous time, and its number of slips."""
    exact = hysteresis(Jenkins(np.ones(1), kt, limit), np.concatenate([q[:1], q[1::2] - 1j * q[2::2]]))
    f, D, H = exact.force(), exact.derivative(range(len(q) // 2 + 1)), len(q) // 2
    out = np.zeros((len(q), H + 1, 2))
    out[0], out[1::2], out[2::2] = D[0].real, D[1:].real, -D[1:].imag
    by = np.column_stack([out[:, 0, 0], out[:, 1:].reshape(len(q), -1)])
    return np.concatenate([[f[0].real], np.column_stack([f[1:].real, -f[1:].imag]).ravel()]), by, len(exact.slips)


@pytest.mark.parametrize("H, roughness", [(1, 1), (3, 1), (3, 2), (7, 1), (7, 2), (15, 1), (15, 0.2), (31, 1), (31, 2)])
def test_force_and_tangent_of_a_slider_are_the_oracle_s(H, roughness):
    """To rounding, with one slip a period and with dozens of them."""
    slider = Forces("jenkins", SLIDER, range(H + 1))
    for seed in range(4):
        q = motion(seed, H, roughness=roughness)[0]
        force, tangent, slips = oracle(q, *SLIDER.values())
        assert np.allclose(slider(q), force, rtol=0, atol=ROUNDING * np.abs(force).max())
        if slips:  # the oracle has no derivative of a slider that was dragged to where it stands
            assert np.allclose(slider.tangent(q), tangent, rtol=0, atol=ROUNDING * np.abs(tangent).max())


@pytest.mark.parametrize("gap", [-2.0, -0.999, -0.3, 0.0, 0.5, 1.0 - 1e-9, 1.2])
def test_force_of_a_stop_under_one_harmonic(gap):
    """Closed for |tau| < c = arccos gap: f_0 = k (sin c - g c) / pi, f_1 = k (c - sin c cos c) / pi, f_2, ... alike."""
    c, k = np.arccos(np.clip(gap, -1, 1)), STOP["normal_stiffness"]
    n = np.arange(2, 6)
    expected = np.zeros(11)
    expected[:2] = (np.sin(c) - gap * c) * k / np.pi, (c + np.sin(c) * (np.cos(c) - 2 * gap)) * k / np.pi
    expected[3::2] = (
        (np.sin((n - 1) * c) / (n - 1) + np.sin((n + 1) * c) / (n + 1) - 2 * gap * np.sin(n * c) / n) * k / np.pi
    )
    found = Forces("unilateral_spring", {**STOP, "gap": gap}, range(6))(np.eye(11)[1])
    assert np.allclose(found, expected, rtol=0, atol=ROUNDING * k)


def sampled(Q, load, gap, samples):
    """The pad's force harmonics again: N and the clipped slider at many samples, two periods."""
    H = len(Q[0]) // 2
    t = 2 * np.pi * np.arange(samples) / samples
    waves = np.array([np.ones(samples)] + [f(n * t) for n in range(1, H + 1) for f in (np.cos, np.sin)])
    un, ut = Q @ waves
    N = np.maximum(0.0, load + PAD["normal_stiffness"] * (un - gap))
    R, w, path = PAD["friction_coefficient"] * N / PAD["tangential_stiffness"], 0.0, np.empty(samples)
    lower, upper = (ut - R).tolist(), (ut + R).tolist()
    for _ in range(2):
        for i in range(samples):
            w = path[i] = min(max(w, lower[i]), upper[i])
    T = PAD["tangential_stiffness"] * (ut - path)
    scale = np.repeat([1.0, 2.0], [1, 2 * H])[:, None] / samples
    return np.concatenate([(scale * waves) @ N, (scale * waves) @ T])


@pytest.mark.parametrize("load, gap", [(0.0, 0.1), (2.0, 0.3), (6.0, -0.2), (20.0, 0.0)])
@pytest.mark.parametrize("H", [1, 3, 9])
def test_force_of_friction_in_a_plane_is_the_limit_of_many_samples(load, gap, H):
    """That opens, closes, slips and sticks: the sampled force comes nearer as samples grow, to what they err by."""
    pad = Forces("coulomb_2d", {**PAD, "normal_load": load, "gap": gap}, range(H + 1))
    for seed in range(2):
        Q = motion(seed, H, 2)
        exact = pad(Q)
        errors = [np.abs(exact - sampled(Q, load, gap, n)).max() for n in (256, 8192)]
        assert errors[1] < 1e-4 * np.abs(exact).max() + ROUNDING
        assert errors[1] < errors[0] / 4 + ROUNDING  # of first order in the sample where it closes


LAWS = {
    "jenkins": SLIDER,
    "coulomb_2d": {**PAD, "normal_load": 2.0, "gap": 0.3},
    "coulomb_3d_uncoupled": {**PAD, "normal_load": 2.0, "gap": 0.3},
    "unilateral_spring": {**STOP, "gap": 0.2},
}


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("H", [1, 3, 9])
def test_tangent_is_the_derivative(law, H):
    forces = Forces(law, LAWS[law], range(H + 1))
    for seed in range(2):
        Q = motion(seed + 10, H, fw.laws()[law].components).ravel()
        D = forces.tangent(Q)
        expected = np.column_stack([derivative(forces, Q, e) for e in np.eye(len(Q))])
        assert np.allclose(D, expected, rtol=0, atol=DIFFERENCES * (1 + np.abs(D).max()))


@pytest.mark.parametrize("law", LAWS)
def test_the_number_of_samples_does_not_matter(law):
    Q = motion(3, 5, fw.laws()[law].components)
    found = [Forces(law, LAWS[law], range(6), n) for n in (12, 64, 1024)]
    assert np.array_equal(found[0](Q), found[1](Q)) and np.array_equal(found[0](Q), found[2](Q))
    assert found[0].told(Q)["work"] == found[2].told(Q)["work"]
    assert found[0].told(Q)["aliasing"] == 0


@pytest.mark.ranks(1)
@pytest.mark.parametrize("law", LAWS)
def test_force_is_smooth_where_samples_change_their_state(law):
    """Along a line of motions the largest second difference falls as the square of the step: no kinks. With 64 samples
    slip and contact begin and end at others a hundred times on the way."""
    d, H, steps = fw.laws()[law].components, 3, 1000
    forces = Forces(law, LAWS[law], range(H + 1), 64)
    # a large fundamental keeps the sequence of states
    base = motion(1, H, d, 2.5)
    base[:, 1] += 3.0
    base[0, 0] += 0.5
    way = 0.4 * motion(2, H, d, 2.5)
    largest = []
    for count in (steps // 4, steps):
        F = np.array([forces(base + s * way) for s in np.linspace(0, 1, count + 1)])
        largest.append(np.abs(np.diff(F, 2, axis=0)).max())
    assert largest[1] < largest[0] / 12


def test_turning_the_motion_turns_the_force():
    """F_n(e^{i k phi} u_k) = e^{i n phi} F_n(u): the period has no first sample."""
    pad, H = Forces("coulomb_2d", LAWS["coulomb_2d"], range(6)), 5
    Q = motion(7, H, 2)
    as_complex = lambda X: np.column_stack([X[:, :1], X[:, 1::2] - 1j * X[:, 2::2]])  # noqa: E731
    F = as_complex(pad(Q).reshape(2, -1))
    for phi in (0.1, 1.0, np.pi / 3, 4.0):
        turn = np.exp(1j * phi * np.arange(H + 1))
        q = as_complex(Q) * turn
        turned = np.column_stack([q[:, :1].real, np.stack([q[:, 1:].real, -q[:, 1:].imag], 2).reshape(2, -1)])
        assert np.allclose(as_complex(pad(turned).reshape(2, -1)), F * turn, rtol=0, atol=ROUNDING * np.abs(F).max())


def test_odd_orders_alone_are_what_all_orders_give():
    """Of a half-wave symmetric motion."""
    odd, every = Forces("jenkins", SLIDER, [1, 3, 5]), Forces("jenkins", SLIDER, range(7))
    q = motion(5, 2)[0, :4]
    q = np.concatenate([q, [0.1, -0.2]])
    full = np.zeros(13)
    full[[1, 2, 5, 6, 9, 10]] = q
    F = every(full)
    assert np.allclose(F[[1, 2, 5, 6, 9, 10]], odd(q), rtol=0, atol=LAST_DIGITS)
    assert np.abs(np.delete(F, [1, 2, 5, 6, 9, 10])).max() < LAST_DIGITS


@pytest.mark.parametrize("excess", [1e-2, 1e-4, 1e-6, 1e-8])
def test_first_slip(excess):
    """a = (1 + excess) R/kt: the loss is that of the closed form, 4 R (a - R/kt) a period, however short the slip."""
    kt, limit = SLIDER.values()
    a = (1 + excess) * limit / kt
    slider = Forces("jenkins", SLIDER, range(4))
    Q = a * np.eye(7)[1]
    assert slider.told(Q)["work"] == pytest.approx(4 * limit * (a - limit / kt), rel=1e-7)
    F, *_ = oracle(Q, kt, limit)
    assert np.allclose(slider(Q), F, rtol=0, atol=ROUNDING)


@pytest.mark.parametrize("offset", [-3.0, 0.7, 5.0])
def test_a_slider_that_was_dragged_shakes_down_to_the_nearest_place(offset):
    """Swing below 2 R/kt about a mean beyond R/kt: no slip is left, f stays within R and touches it once."""
    kt, limit = SLIDER.values()
    slider = Forces("jenkins", SLIDER, range(3))
    a = 0.7 * limit / kt
    Q = np.array([offset, a, 0.0, 0.0, 0.0])
    F, D = slider(Q), slider.tangent(Q)
    inside = abs(offset) + a <= limit / kt
    mean = kt * offset if inside else np.sign(offset) * (limit - kt * a)
    assert pytest.approx([mean, kt * a, 0, 0, 0], abs=ROUNDING * abs(offset)) == F
    assert slider.told(Q)["work"] == 0
    expected = np.column_stack([derivative(slider, Q, e, 1e-5, order=2) for e in np.eye(5)])
    assert np.allclose(D, expected, rtol=0, atol=DIFFERENCES)


@pytest.mark.parametrize("stiffness", [1e4, 1e8, 1e12, 1e14])
def test_a_stiff_slider_in_gross_slip_is_the_rigid_one(stiffness):
    """f = R sgn v to the first order in the time of sticking: |F_1| -> 4 R / pi; with the closed form's loss, which is
    taken from u and f by no difference of large numbers: sticking lasts sqrt(4 R/kt a) and is known to a rounding."""
    limit, a = 5.0, 0.1
    slider = Forces("jenkins", {"tangential_stiffness": stiffness, "friction_limit": limit}, range(8))
    F = slider(a * np.eye(15)[1])
    reach = limit / stiffness
    assert F[2] == pytest.approx(-4 * limit / np.pi * (1 - reach / a), rel=LAST_BIT / np.sqrt(reach / a) + ROUNDING)
    assert abs(F[1]) == pytest.approx(0.0, abs=4 * limit * np.sqrt(reach / a)) and F[1] > 0
    assert np.abs(F[5::4][:2]).max() < limit


@pytest.mark.parametrize("law", ["jenkins", "coulomb_2d"])
def test_without_friction_nothing_is_carried_along_the_tangent(law):
    none = {"friction_limit": 0.0} if law == "jenkins" else {"friction_coefficient": 0.0}
    forces = Forces(law, {**LAWS[law], **none}, range(4))
    Q = motion(4, 3, fw.laws()[law].components)
    assert not forces(Q)[-7:].any() and not forces.tangent(Q)[-7:].any()


@pytest.mark.parametrize("load, gap", [(0.0, 0.2), (2.0, 0.3), (20.0, 0.0), (0.0, 9.0)])
def test_a_pad_without_friction_is_a_stop(load, gap):
    """Open, closed and both in turn: at the least number of samples the stop's exact force, nothing along the plane."""
    free = {**PAD, "friction_coefficient": 0.0, "normal_load": load, "gap": gap}
    pad, stop = (
        Forces("coulomb_3d", free, range(6)),
        Forces("unilateral_spring", {**STOP, "gap": gap - load / 8.0}, range(6)),
    )
    Q = motion(5, 5, 3)
    expected = np.concatenate([stop(Q[0]), np.zeros(22)])
    assert np.allclose(pad(Q), expected, rtol=0, atol=LAST_DIGITS * (1 + np.abs(expected).max()))
    D = pad.tangent(Q)
    assert np.allclose(D[:11, :11], stop.tangent(Q[0]), rtol=0, atol=LAST_DIGITS * 8)
    assert not D[11:].any() and not D[:, 11:].any()


@pytest.mark.ranks(2)
def test_pads_without_friction_beside_others_are_one_law_on_any_number_of_ranks():
    """A rank whose pads have none takes them as the other rank has to take its own."""
    start = fw.LinearMode(1.0, 0.0, np.ones(6), np.zeros(6))
    pads = {**PAD, "friction_coefficient": np.array([0.0, 0.4]), "normal_load": 2.0, "gap": 0.3}
    Q, found = motion(6, 3, 6), []
    for comm in (MPI.COMM_WORLD, MPI.COMM_SELF):
        model = fw.Model(np.eye(6), np.eye(6), None, [fw.Contact("coulomb_3d", np.eye(6), pads)], comm)
        problem = fw.NonlinearMode(model, fw.Harmonics(range(4), 64), "EPMC", 0, start)
        found.append(whole(problem.residual(unknowns(problem, np.concatenate([Q.ravel(), [0.0, 1.0, 0.0]])))))
    assert np.allclose(*found, rtol=0, atol=LAST_DIGITS * np.abs(found[1]).max())


@pytest.mark.parametrize("half", [0.1, 1e-3, 1e-5])
def test_a_short_contact_keeps_its_digits(half):
    """cos tau - cos c on k, k u some c^-3 times the force: rounding of u counts for as long as the contact lasts."""
    k, gap = 1e12, np.cos(half)
    c = 2 * np.arcsin(np.sqrt((1 - gap) / 2))  # of the gap as it is rounded
    node, weight = np.polynomial.legendre.leggauss(20)
    tau, n = c * node, np.arange(8)[:, None]
    F = k * c / np.pi * (np.cos(n * tau) * 2 * np.sin((c + tau) / 2) * np.sin((c - tau) / 2)) @ weight
    expected = np.zeros(15)
    expected[0], expected[1::2] = F[0] / 2, F[1:]
    found = Forces("unilateral_spring", {"normal_stiffness": k, "gap": gap}, range(8))(np.eye(15)[1])
    assert np.allclose(found, expected, rtol=ROUNDING, atol=LAST_BIT * k * c)


def test_a_motion_that_stands_still():
    """Within the limit a spring; beyond it the limit, whatever the mean; nothing turns or divides by zero."""
    kt, limit = SLIDER.values()
    slider = Forces("jenkins", SLIDER, range(3))
    for mean, force, slope in [(0.0, 0.0, kt), (0.1, 0.1 * kt, kt), (2.0, limit, 0.0), (-2.0, -limit, 0.0)]:
        Q = mean * np.eye(5)[0]
        assert slider(Q) == pytest.approx(force * np.eye(5)[0], abs=LAST_DIGITS)
        assert slider.tangent(Q)[0, 0] == pytest.approx(slope, abs=LAST_DIGITS)
