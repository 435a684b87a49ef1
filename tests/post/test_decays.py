"""Starts, verdicts and steady states of the time integrations, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from tolerances import ROUNDING

import fretwave as fw
from fretwave.analyses.parts.shifted import added_ratio
from fretwave.errors import InputError
from fretwave.post.cycles import Cycles, above_noise, extract, noise_floor
from fretwave.post.decays import (
    compare,
    cycle_rows,
    decay_rows,
    ending,
    largest_differences,
    mode_state,
)
from fretwave.post.mode_curve import Crossing, ModeCurve
from fretwave.post.motion import motion
from fretwave.solve.steady import free_motion, start_state, steady_motion

LABELS = ["1c", "1s", "3c", "3s"]
CROSSINGS = [Crossing(0.14, 25.3, True), Crossing(0.36, 24.2, False)]


def branch():
    amplitude = np.geomspace(0.1, 1.0, 30)
    columns = {"amplitude": amplitude, "omega": 25.0 - amplitude, "omega0": 25.1 - amplitude}
    columns |= {"beta": 0.02 * columns["omega0"], "zeta": np.full(30, 0.02)}
    return columns, amplitude[:, None, None] * np.array([[[1.0, 0.0, 0.1, 0.0], [0.5, 0.2, 0.0, 0.1]]])


@pytest.mark.ranks(1)
def test_state_between_points_has_the_wanted_fundamental():
    columns, coefficients = branch()
    q, beta, omega = mode_state(columns, coefficients, 0.3, "CNM")
    assert q == pytest.approx(0.3 * coefficients[0] / 0.1, rel=ROUNDING)
    assert omega == pytest.approx(24.7, rel=1e-4)
    assert beta == pytest.approx(0.02 * 24.8, rel=1e-4)
    _, beta, omega = mode_state(columns, coefficients, 0.3, "EPMC")
    assert (beta, omega) == (0.0, pytest.approx(24.8, rel=1e-4))


@pytest.mark.ranks(1)
@pytest.mark.parametrize("end", [0.1, 1.0])
def test_a_branch_reaches_where_it_stops_whatever_its_last_digits(end):
    """A branch that is to stop at 0.3 may end at 0.29999999999999993."""
    columns, coefficients = branch()
    wanted = end * (1 + 1e-15 if end == 1.0 else 1 - 1e-15)
    q, *_ = mode_state(columns, coefficients, wanted, "CNM")
    assert q == pytest.approx(wanted * coefficients[0] / 0.1, rel=ROUNDING)
    with pytest.raises(InputError, match="outside the mode's branch"):
        mode_state(columns, coefficients, end * (1 + 1e-6 if end == 1.0 else 1 - 1e-6), "CNM")


@pytest.mark.ranks(1)
def test_start_outside_the_branch_is_refused_with_its_range():
    with pytest.raises(InputError, match="outside the mode's branch") as error:
        mode_state(*branch(), 2.0, "CNM")
    assert "between 0.1 and 1" in error.value.body()


@pytest.mark.ranks(1)
def test_start_is_the_motion_at_time_zero():
    _, coefficients = branch()
    x, v = motion(LABELS, coefficients[3], 0.4, 25.0)
    x0, v0 = start_state(LABELS, coefficients[3], 0.4, 25.0)
    assert x0 == pytest.approx(x[0]) and v0 == pytest.approx(v[0])


@pytest.mark.ranks(1)
def test_velocity_of_a_motion_follows_from_its_decay_and_frequency():
    """d/dt of e^{-n beta t} (Qc cos + Qs sin) at t = 0 is n (-beta Qc + omega Qs)."""
    _, v = motion(LABELS, np.array([[1.0, 2.0, 0.5, 0.25]]), 0.4, 25.0)
    assert v[0, 0] == pytest.approx((-0.4 + 2.0 * 25.0) + 3.0 * (-0.4 * 0.5 + 25.0 * 0.25))


def cycles_of(amplitude):
    n = len(amplitude)
    return Cycles(0.25 * np.arange(n), np.asarray(amplitude), np.full(n, 25.0), np.full(n, 0.02))


@pytest.mark.ranks(1)
def test_verdicts_of_starts():
    settled = ending(cycles_of(np.full(30, 0.141)), False, CROSSINGS)
    assert settled.text == "limit cycle"
    assert compare(settled, CROSSINGS)["amplitude_difference"] == pytest.approx(0.141 / 0.14 - 1.0)
    assert ending(cycles_of(0.2 * 0.97 ** np.arange(30)), False, CROSSINGS).text == "not settled"
    gone = ending(cycles_of(2.5 * 1.1 ** np.arange(8)), True, CROSSINGS)
    assert gone.text == "diverges" and gone.amplitude == pytest.approx(2.5 * 1.1**7)
    assert np.isnan(compare(gone, CROSSINGS)["predicted"])


@pytest.mark.ranks(1)
def test_a_motion_may_end_on_a_cycle_of_unknown_stability():
    """Where the branch runs back and at its end there are cycles that motions settle on."""
    settled = ending(cycles_of(np.full(30, 0.141)), False, CROSSINGS)
    crossings = [Crossing(0.14, 25.3, None), Crossing(0.141, 25.3, False), Crossing(0.5, 24.2, True)]
    assert compare(settled, crossings)["predicted"] == 0.14


@pytest.mark.ranks(1)
def test_too_few_cycles_have_no_verdict():
    assert ending(cycles_of([]), False).text == "not settled"


@pytest.mark.ranks(1)
def test_slow_cycles_alone_are_compared_with_the_mode():
    columns, _ = branch()
    mode = ModeCurve.from_table(columns)
    rows = decay_rows(0, cycles_of(0.9 * 0.9 ** np.arange(20)), mode)
    omega, zeta = largest_differences(rows)
    assert omega == pytest.approx(max(abs(25.0 / (25.0 - row["amplitude"]) - 1.0) for row in rows[1:-1]), rel=1e-3)
    assert zeta == pytest.approx(0.0, abs=ROUNDING)
    rows[10]["zeta"] = 0.03  # one that jumps takes its neighbours out as well
    assert largest_differences(rows)[1] == pytest.approx(0.0, abs=ROUNDING)
    assert [row["cycle"] for row in cycle_rows(0, cycles_of([1.0, 1.0]))] == [1, 2]


@pytest.mark.ranks(1)
def test_damping_added_afterwards_is_exact_for_a_linear_mode():
    M, C = np.diag([2.0, 1.0]), np.diag([0.3, 0.0])
    phi = np.array([1.0, 0.5 + 0.2j])
    assert added_ratio(phi, 10.0, M, C) == pytest.approx(0.3 / (2.0 * 10.0 * (2.0 + 0.29)))


def oscillator(damping):
    """A single dof of 25 rad/s without contact."""
    return fw.Model(np.array([[1.0]]), np.array([[625.0]]), C=np.array([[2.0 * damping * 25.0]]), contacts=[])


@pytest.mark.ranks(1)
def test_integrated_free_motion_has_the_oscillators_damping():
    with oscillator(0.02) as model:
        state = np.array([1.0]), np.array([0.0])
        found = free_motion(fw.Transient(model), state, 0, 2.0 * np.pi / 25.0 / 64, 640, 1e-9)
    cycles = extract(found.t, found.x, found.v)
    assert not found.diverged
    assert np.allclose(cycles.zeta, 0.02, atol=1e-6)
    assert np.allclose(cycles.omega, 25.0 * np.sqrt(1.0 - 0.02**2), rtol=1e-6)


@pytest.mark.ranks(1)
@pytest.mark.parametrize("omega", [0.005, 25.0, 1e4])
@pytest.mark.parametrize("tolerance", [1e-10, 1e-6, 1e-3])
def test_no_cycle_is_noise_of_the_integration(omega, tolerance):
    """Every cycle that is kept is that of a e^{-beta t} cos; of those that follow most are nothing."""
    damping = 0.1
    with fw.Model(np.eye(1), np.array([[omega**2]]), C=np.array([[2.0 * damping * omega]]), contacts=[]) as model:
        state = np.array([1.0]), np.array([-damping * omega])  # of e^{-beta t} cos(omega_d t)
        found = free_motion(fw.Transient(model), state, 0, 2.0 * np.pi / omega / 64, 64 * 80, tolerance)
    cycles = extract(found.t, found.x, found.v)
    kept = above_noise(cycles, noise_floor(cycles, tolerance, 1.0))
    exact = np.exp(-damping * omega * cycles.time)
    assert kept.amplitude == pytest.approx(exact[: len(kept)], rel=0.05)
    assert kept.zeta == pytest.approx(np.full(len(kept), damping), abs=0.01)
    left = -np.log(100.0 * tolerance) / (2.0 * np.pi * damping)
    assert left - 3 <= len(kept) <= left + 1 and len(kept) < len(cycles) - 10


@pytest.mark.ranks(1)
def test_noise_is_that_of_the_largest_motion_so_far():
    cycles = cycles_of([1.0, 1e-3, 1e-5, 1e-7, 1e-9])
    assert len(above_noise(cycles, noise_floor(cycles, 1e-10, 0.0))) == 3
    assert len(above_noise(cycles, noise_floor(cycles, 1e-10, 1e4))) == 1
    assert len(above_noise(cycles, noise_floor(cycles, 1e-12, 0.0))) == 5


@pytest.mark.ranks(1)
def test_diverging_motion_is_stopped_at_its_limit():
    with oscillator(-0.02) as model:
        state = np.array([1.0]), np.array([0.0])
        found = free_motion(fw.Transient(model), state, 0, 2.0 * np.pi / 25.0 / 64, 6400, 1e-9, limit=3.0)
    assert found.diverged
    assert 3.0 < np.abs(found.x).max() < 3.5


class Exact:
    """x'' + 2 zeta x' + x = cos(omega t) in closed form, as the integrator that is used of `fw.Transient`."""

    def __init__(self, zeta, omega):
        self.omega, self.own = omega, complex(-zeta, np.sqrt(1 - zeta**2))
        self.forced = 1 / (1 - omega**2 + 2j * zeta * omega)

    def run(self, x0, v0, t_end, dt_out, **_):
        t = np.arange(round(t_end / dt_out) + 1) * dt_out
        x, v = x0[0] - self.forced.real, v0[0] - (1j * self.omega * self.forced).real
        free = complex(x, (self.own.real * x - v) / self.own.imag) * np.exp(self.own * t)
        steady = self.forced * np.exp(1j * self.omega * t)
        both = {"x": free + steady, "v": self.own * free + 1j * self.omega * steady}
        return {"t": t, **{key: z.real[:, None] for key, z in both.items()}, "reason": "end", "implicit": False}


@pytest.mark.ranks(1)
@pytest.mark.parametrize("zeta", [2e-3, 1e-2])
def test_a_beat_that_dies_away_is_not_steady_where_its_amplitude_turns(zeta):
    """Beside resonance it turns once a beat: points were up to 0.8 % off, and said to be steady."""
    for beside in np.linspace(-3.0, 3.0, 13):
        exact = Exact(zeta, 1.0 + beside * zeta)
        found = steady_motion(exact, (np.zeros(1), np.zeros(1)), 0, exact.omega, 64, 1e-9)
        assert found.steady
        assert found.amplitude == pytest.approx(abs(exact.forced), rel=2e-5)


@pytest.mark.ranks(1, 2)
def test_forced_motion_reaches_the_linear_response():
    omega = 24.0
    with oscillator(0.02) as model:
        integrator = fw.Transient(model, force={1: np.array([3.0 + 0.0j])}, level=2.0, omega=omega)
        found = steady_motion(integrator, (np.zeros(1), np.zeros(1)), 0, omega, 64, 1e-9)
    exact = 6.0 / abs(625.0 - omega**2 + 2j * 0.02 * 25.0 * omega)
    assert found.steady
    assert found.amplitude == pytest.approx(exact, rel=2e-5)
