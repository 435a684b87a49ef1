"""Time integration of the unreduced equations against closed forms, and against harmonic balance."""

from __future__ import annotations

import numpy as np
import pytest
from models.core_models import (
    CoupledLaw,
    CubicLaw,
    chain,
    everywhere,
    friction,
    mode_problem,
    oscillator,
    single_dof,
    solve_at,
)
from scipy.integrate import quad
from tolerances import REPEATED, ROUNDING, SOLVED

import fretwave as fw

M, C, K = 2.0, 0.3, 50.0
OMEGA0 = np.sqrt(K / M)
PERIOD = 2 * np.pi / OMEGA0

#: On several ranks each stage of the integrator communicates: what has no business there runs on one.
SERIAL = pytest.mark.ranks(1)


def decay(t, x0=1.0, v0=0.0):
    """x'' + 2 b x' + w0^2 x = 0 from (x0, v0): displacement and velocity."""
    s = complex(-C / (2 * M), np.sqrt(K / M - (C / (2 * M)) ** 2))
    q = complex(x0, -(v0 - s.real * x0) / s.imag)
    return (q * np.exp(s * t)).real, (q * s * np.exp(s * t)).real


def free_decay(comm, rtol):
    return fw.Transient(single_dof(comm, M, K, C)).run([1.0], [0.5], 5 * PERIOD, PERIOD / 16, rtol)


def errors(run):
    x, v = decay(run["t"], 1.0, 0.5)
    return np.abs(run["x"][:, 0] - x).max(), np.abs(run["v"][:, 0] - v).max() / OMEGA0


def test_decaying_oscillator_has_its_closed_form(comm):
    run = free_decay(comm, 1e-10)
    assert max(errors(run)) < SOLVED
    assert run["finished"] and run["steps"] > 100


def test_samples_lie_on_multiples_of_the_interval_up_to_the_end(comm):
    run = free_decay(comm, 1e-8)
    assert run["t"] == pytest.approx(np.arange(81) * PERIOD / 16, rel=1e-13)
    assert run["x"].shape == run["v"].shape == (81, 1)
    assert (run["x"][0, 0], run["v"][0, 0]) == (1.0, 0.5)


@SERIAL
def test_error_falls_with_the_tolerance(comm):
    """Step control: a hundredth of the tolerance gives less than a twentieth of the error."""
    found = [max(errors(free_decay(comm, rtol))) for rtol in (1e-5, 1e-7, 1e-9)]
    assert found[1] < found[0] / 20 and found[2] < found[1] / 20


@SERIAL
def test_energy_of_an_undamped_model_is_kept(comm):
    """Three masses, no damping: (v M v + x K x) / 2 stays to the tolerance."""
    stiffness, mass = chain(3, 10.0, 1.0), np.diag([1.0, 0.5, 2.0])
    run = fw.Transient(fw.Model(mass, stiffness, comm=comm)).run([1.0, 0, 0], [0, 0, -1.0], 20.0, 0.1, 1e-10)
    parts = ((mass, run["v"]), (stiffness, run["x"]))
    energy = sum(0.5 * np.einsum("ti,ij,tj->t", z, A, z) for A, z in parts)
    assert energy == pytest.approx(np.full(len(energy), energy[0]), rel=1e-7)


def test_forced_steady_state_is_the_frequency_response(two_dof, comm):
    """Started on x = Re sum q_n e^{i n w t}, q_n = (K + s C + s^2 M)^-1 P_n: it stays there, phase included."""
    damping, omega, level = np.array([[0.5, -0.1], [-0.1, 0.1]]), 11.0, 0.5
    force = {1: np.array([1.0, 0.3j]), 3: np.array([0.2 - 0.4j, 0.0])}
    s = {n: 1j * n * omega for n in force}
    q = {n: np.linalg.solve(two_dof.K + s[n] * damping + s[n] ** 2 * two_dof.M, level * P) for n, P in force.items()}
    x0, v0 = sum(q.values()).real, sum(s[n] * q[n] for n in q).real
    model = fw.Model(two_dof.M, two_dof.K, damping, comm=comm)
    run = fw.Transient(model, force, level, omega).run(x0, v0, 1.0, 0.05, 1e-10)
    exact = sum((np.exp(s[n] * run["t"])[:, None] * q[n]).real for n in q)
    assert np.allclose(run["x"], exact, rtol=0, atol=REPEATED * np.abs(exact).max())


def test_mean_force_gives_the_static_displacement(comm):
    run = fw.Transient(single_dof(comm, M, K, C), {0: np.array([3.0])}, 2.0, 1.0).run([6.0 / K], [0.0], 2.0, 0.1)
    assert run["x"][:, 0] == pytest.approx(np.full(len(run["t"]), 6.0 / K), rel=ROUNDING)


@pytest.mark.parametrize("rtol", [1e-4, 1e-8])
def test_no_sample_lies_beyond_the_end(comm, rtol):
    """Also when the integrator's own steps are much longer than the sampling interval."""
    run = fw.Transient(single_dof(comm)).run([1.0], [0.0], 1.0, 0.01, rtol)
    assert run["t"] == pytest.approx(np.arange(101) * 0.01, rel=ROUNDING)


def amplitude_losses(comm, eps, limit=0.05, periods=3):
    """Loss of peak displacement in each period of a Coulomb slider, k = m = 1, from a = 1."""
    model = single_dof(comm, law=friction([[1.0]], limit, eps))
    run = fw.Transient(model).run([1.0], [0.0], 2 * np.pi * periods, 2 * np.pi, 1e-10)
    return -np.diff(run["x"][:, 0])


@SERIAL
def test_coulomb_slider_loses_4_r_over_k_per_period(comm):
    """4 R / k exactly, for any amplitude, as eps -> 0; the difference falls as eps^2."""
    coarse, fine = (amplitude_losses(comm, eps) - 0.2 for eps in (1e-2, 1e-3))
    assert np.abs(fine).max() < 1e-6
    assert coarse / fine == pytest.approx([100] * 3, rel=0.02)


@SERIAL
def test_periodic_motion_of_harmonic_balance_is_periodic_in_time(comm):
    """Undamped Duffing, H = 21: the motion passes through the samples of the nonlinear mode and comes back."""
    model = single_dof(comm, law=CubicLaw())
    problem = mode_problem(model, range(1, 22, 2), 256)
    y = solve_at(problem, 1.0)
    motion = everywhere(problem, problem.dof_period(y, 8))
    period = 2 * np.pi / problem.state(y)["omega"]
    run = fw.Transient(model).run(motion["x"][0], motion["v"][0], period * (1 + 1e-9), period / 8, 1e-11)
    assert np.allclose(run["x"], np.vstack([motion["x"], motion["x"][:1]]), rtol=0, atol=REPEATED)


def return_distance(two_dof, comm, highest, omega=24.5, level=8.0):
    """Relative distance after one period from the start on a slipping forced response."""
    model, force = oscillator(two_dof, comm), {1: np.array([1.0, 0.0])}
    reference = fw.linear_modes(model, 1)[0]
    problem = fw.ForcedResponse(model, fw.Harmonics(range(1, highest + 1, 2), 1024), force, level, 0, reference)
    branch = fw.Continuation(problem, problem.initial(23.0), (22.0, omega))
    y = [p.y for p in branch if p.event == "stop"][0]
    assert problem.diagnostics(y)["slip"] > 0.5
    motion, period = everywhere(problem, problem.dof_period(y)), 2 * np.pi / omega
    run = fw.Transient(model, force, level, omega).run(motion["x"][0], motion["v"][0], period * (1 + 1e-9), period)
    return np.abs(run["x"][-1] - motion["x"][0]).max() / np.abs(motion["x"]).max()


@SERIAL
def test_forced_friction_motion_is_periodic_in_time(two_dof, comm):
    """Started on the forced response, one period later it is there again, within a truncation that falls with H."""
    coarse, fine = (return_distance(two_dof, comm, H) for H in (21, 61))
    assert fine < coarse / 2 and fine < 1e-4


class StiffnessLaw(CoupledLaw):
    """f = G u."""

    c = 0.0


@pytest.mark.ranks(1, 2, 3)
def test_law_of_three_components_acts_on_its_own_pairs(comm):
    """f = G u with a full G and two pairs: the same motion as with K + B^T G B."""
    B = 0.5 * np.random.default_rng(2).standard_normal((6, 4))
    added = B.T @ np.kron(np.eye(2), StiffnessLaw.G) @ B
    start = [1.0, 0.0, -0.5, 0.2], [0.0] * 4
    law = fw.Model(np.eye(4), chain(4), None, [fw.Contact(StiffnessLaw(), B)], comm)
    matrices = fw.Model(np.eye(4), chain(4) + added, comm=comm)
    runs = [fw.Transient(model).run(*start, 2.0, 0.5, 1e-8)["x"] for model in (law, matrices)]
    assert np.allclose(*runs, rtol=0, atol=ROUNDING)


@SERIAL
def test_limit_stops_a_growing_motion(comm):
    """zeta = -0.05: a = e^{0.05 w0 t} passes 10 at t = ln 10 / 0.05; stopped there, and said."""
    run = fw.Transient(single_dof(comm, 1.0, 1.0, -0.1)).run([1.0], [0.0], 200.0, 0.1, limit=10.0)
    assert not run["finished"]
    assert np.abs(run["x"][-1]).max() > 10.0 >= np.abs(run["x"][:-1]).max()
    assert run["t"][-1] == pytest.approx(np.log(10) / 0.05, abs=2 * np.pi)


@SERIAL
@pytest.mark.parametrize("limit", [10.0, 1e4, 1e12, np.inf])
@pytest.mark.parametrize("dt_out", [0.1, 1e-3])
def test_a_motion_to_infinity_in_finite_time_ends_there(comm, limit, dt_out):
    """x'' + x - x^3 = 0 from x = 1, v0 = 0.05: v^2 = v0^2 + (x^2 - 1)^2 / 2, so that t is the integral of dx / v."""
    v0 = 0.05
    law = fw.Contact(CubicLaw(-1.0), [[1.0]])
    run = fw.Transient(fw.Model([[1.0]], [[1.0]], None, [law], comm)).run([1.0], [v0], 20.0, dt_out, 1e-9, limit)
    inverse = lambda s: 1 / np.sqrt(v0**2 * s**4 + (1 - s**2) ** 2 / 2)  # noqa: E731
    reached = np.abs(run["x"]).max()
    way = quad(inverse, 1 / reached, 1.0, points=[0.9], limit=200)[0]
    assert not run["finished"] and np.all(np.isfinite(run["x"]))
    assert run["t"][np.argmax(np.abs(run["x"]))] == pytest.approx(way, rel=1e-6)
    if np.isfinite(limit):
        assert run["reason"] == "limit" and reached > limit


class BrokenLaw(CubicLaw):
    """No number beyond u = 5."""

    def force(self, u, v):
        return np.where(np.abs(u) < 5.0, super().force(u, v), np.nan)


@pytest.mark.ranks(1, 2)
@pytest.mark.parametrize("dof", [0, 1])
def test_steps_to_where_a_law_has_no_numbers_are_refused_on_every_rank(comm, dof):
    """A maximum over ranks loses those that are none."""
    law = fw.Contact(BrokenLaw(-1.0), np.eye(2)[[dof]])
    run = fw.Transient(fw.Model(np.eye(2), np.eye(2), None, [law], comm)).run([1.5, 1.5], [0.0, 0.0], 20.0, 0.01, 1e-6)
    assert not run["finished"] and np.all(np.isfinite(run["x"])) and 2.0 < run["x"][-1, dof] <= 6.0


@SERIAL
def test_same_integrator_serves_two_runs(comm):
    """Nothing of the first run is left in the second."""
    integrator = fw.Transient(single_dof(comm, M, K, C))
    first, second = (integrator.run([1.0], [0.0], 2.0, 0.1) for _ in range(2))
    assert np.array_equal(first["x"], second["x"]) and np.array_equal(first["t"], second["t"])


def test_bad_inputs_are_refused(comm):
    model = single_dof(comm, M, K, C)
    with pytest.raises(fw.InputError, match="frequency"):
        fw.Transient(model, {1: np.array([1.0])})
    for t_end, dt_out in ((0.0, 0.1), (1.0, 0.0), (-1.0, 0.1)):
        with pytest.raises(fw.InputError, match="positive duration"):
            fw.Transient(model).run([1.0], [0.0], t_end, dt_out)


#: Regularisation velocities that no explicit step follows while the mass sticks: R / (eps m) is up to 1e12 / s.
STIFF = [1e-7, 5e-11]


@SERIAL
@pytest.mark.parametrize("eps", STIFF)
def test_slider_sticks_where_friction_holds_the_spring(comm, eps):
    """k = m = 1, R = 0.05 from 0.12: turns at 0.12 - 2 R = 0.02, where k x < R, and stays (eps creeps: eps t x / R)."""
    model = single_dof(comm, law=friction([[1.0]], 0.05, eps))
    run = fw.Transient(model).run([0.12], [0.0], 12 * np.pi, np.pi / 8, 1e-8)
    stuck = run["t"] > 1.01 * np.pi
    assert run["finished"] and run["implicit"] and run["steps"] < 20000
    assert run["x"][stuck, 0] == pytest.approx(np.full(stuck.sum(), -0.02), abs=2e-6 + 20 * eps)


@SERIAL
@pytest.mark.parametrize("eps", STIFF)
def test_stuck_damper_of_two_masses_is_a_spring(two_dof, comm, eps):
    """Below slip m2 stands still and m1 swings with sqrt(640) undamped: a cos(w t), and eps of creep."""
    law = fw.Contact("regularised_coulomb", two_dof.B, {**two_dof.parameters, "regularisation_velocity": eps})
    period = 2 * np.pi / two_dof.omega_stuck
    run = fw.Transient(fw.Model(two_dof.M, two_dof.K, None, [law], comm)).run(
        [0.1, 0.0], [0.0, 0.0], 4 * period, period / 32, 1e-8
    )
    assert run["finished"] and run["implicit"]
    exact = 0.1 * np.cos(two_dof.omega_stuck * run["t"])
    assert run["x"][:, 0] == pytest.approx(exact, abs=0.1 * (1e-6 + 3 * eps))
    assert np.abs(run["x"][:, 1]).max() < eps


@pytest.mark.ranks(1, 2)
def test_implicit_steps_have_the_frequency_response_of_a_stiff_damper(comm):
    """A linear damper of 1e9 on the second mass: q = (K + s C + s^2 M)^-1 P, phase included, on any ranks."""
    mass, stiffness, damping = np.diag([1.0, 0.5]), chain(2, 10.0, 1.0), np.diag([0.1, 1e9])
    omega, force = 2.0, np.array([1.0, 0.5j])
    s = 1j * omega
    q = np.linalg.solve(stiffness + s * damping + s**2 * mass, force)
    model = fw.Model(mass, stiffness, damping, comm=comm)
    run = fw.Transient(model, {1: force}, 1.0, omega).run(q.real, (s * q).real, 1.0, 0.05, 1e-7)
    assert run["finished"] and run["implicit"]
    exact = (np.exp(s * run["t"])[:, None] * q).real
    assert np.allclose(run["x"], exact, rtol=0, atol=1e-5 * np.abs(exact).max())


@SERIAL
def test_integration_that_would_not_end_says_so(comm):
    """More steps than allowed, explicit and implicit: what was found until then, and the reason."""
    model = single_dof(comm, law=friction([[1.0]], 0.05, 1e-9))
    run = fw.Transient(model).run([0.12], [0.0], 1e4, 0.1, 1e-12, most_steps=100)
    assert (run["finished"], run["implicit"], run["reason"]) == (False, True, "steps")
    assert 0 <= run["t"][-1] < 1e4 and run["steps"] <= 100


@SERIAL
def test_law_with_a_memory_is_refused(comm):
    """The place of a slider is no part of (x, v): a Jenkins element integrated without it would never dissipate."""
    slider = fw.Contact("jenkins", [[1.0]], {"tangential_stiffness": 1.0, "friction_limit": 1.0}, name="ring")
    with pytest.raises(fw.InputError, match="memory"):
        fw.Transient(fw.Model([[1.0]], [[1.0]], None, [slider], comm))
