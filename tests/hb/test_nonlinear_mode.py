"""Nonlinear modes against closed forms and the paper's two-dof oscillator."""

from __future__ import annotations

import numpy as np
import pytest
from models.core_models import (
    CubicLaw,
    TanhLaw,
    UnilateralLaw,
    everywhere,
    friction,
    mode_problem,
    options,
    oscillator,
    single_dof,
    solve_at,
    states,
)
from scipy.special import ellipk
from tolerances import LAST_BIT, LAST_DIGITS, ROUNDING, SOLVED, TIGHT

import fretwave as fw

METHODS = ["CNM", "EPMC"]
ODD_21 = range(1, 22, 2)
OMEGA_STUCK = np.sqrt(640.0)
REPORTS = [0.05, 0.1, 0.2, 0.5, 1.0, 2.0]


def paper_branch(two_dof, comm, method, C=None):
    """Branch of the paper's oscillator from a = 0.02 to 3 (H = 21, N_t = 1024): (state, event) per point."""
    problem = mode_problem(oscillator(two_dof, comm, C), ODD_21, 1024, method, two_dof.dof, "stuck")
    branch = fw.Continuation(problem, problem.initial(0.02), (0.02, 3.0), report_at=REPORTS)
    points = [(problem.state(p.y), p.event) for p in branch]
    assert branch.reason == "stop value reached"
    return points


def at_event(points, event):
    return [state for state, name in points if name == event]


def test_paper_s_branch_folds_twice_at_stick_slip_onset(two_dof, comm):
    """Folds in amplitude near 0.1347 and 0.1339, CNM, H = 21, N_t = 1024."""
    folds = at_event(paper_branch(two_dof, comm, "CNM"), "fold")
    assert [state["amplitude"] for state in folds] == pytest.approx([0.1347, 0.1339], abs=5e-5)


@pytest.mark.parametrize("method", METHODS)
def test_paper_s_branch_is_most_damped_between_0_15_and_0_2(two_dof, comm, method):
    """One peak of zeta for an amplitude of m1 between 0.15 and 0.2, above every other point."""
    points = paper_branch(two_dof, comm, method)
    peaks = at_event(points, "peak_damping")
    assert len(peaks) == 1 and 0.15 < peaks[0]["amplitude"] < 0.2
    assert peaks[0]["zeta"] >= max(state["zeta"] for state, _ in points)


@pytest.mark.ranks(1)
def test_damping_that_is_rounding_has_no_peak(comm):
    """A stop on four masses without damping, as a large problem, whose tangents have few digits: zeta is 1e-14."""
    M = np.diag([0.17, 0.96, 0.22, 0.68])
    K = [[28.4, 34.4, 1.73, -24.2], [34.4, 96.5, 8.16, -36.5], [1.73, 8.16, 2.35, -1.05], [-24.2, -36.5, -1.05, 25.3]]
    stop = fw.Contact("unilateral_spring", np.eye(4)[3:], {"normal_stiffness": 1.03, "gap": 1.0})
    model = fw.Model(M, np.array(K), contacts=[stop], comm=comm)
    start = fw.linear_modes(model, 1, contact="free")[0]
    with options(fw_linear_large=1, fw_linear_krylov_limit=1):
        problem = fw.NonlinearMode(model, fw.Harmonics(range(6), 128), "EPMC", 2, start)
        branch = fw.follow(problem, 1.0, 18.0, steps=fw.StepControl(maximum=0.08))
    assert np.abs(branch["zeta"]).max() < ROUNDING
    assert [event.name for event in branch.events] == ["start", "fold", "stop"]


@pytest.mark.ranks(1)
def test_paper_s_branch_goes_from_stuck_to_free(two_dof, comm):
    """Both asymptotes; zeta tends to zero as friction becomes small beside the motion."""
    points = paper_branch(two_dof, comm, "CNM")
    assert points[0][0]["omega"] == pytest.approx(two_dof.omega_stuck, rel=1e-5)
    assert points[-1][0]["omega"] == pytest.approx(two_dof.omega_free, rel=5e-5)
    assert points[-1][0]["zeta"] < 0.1 * max(state["zeta"] for state, _ in points)


@pytest.mark.ranks(1)
def test_columns_of_a_state_belong_together(two_dof, comm):
    """lambda = -beta + i w, w0 = |lambda|, zeta = beta / w0, in both methods."""
    for method in METHODS:
        for s, _ in paper_branch(two_dof, comm, method):
            assert s["omega0"] == pytest.approx(np.hypot(s["beta"], s["omega"]), rel=LAST_DIGITS)
            assert s["beta"] == pytest.approx(s["zeta"] * s["omega0"], rel=LAST_DIGITS)
            assert s["frequency_hz"] == pytest.approx(s["omega"] / (2 * np.pi), rel=LAST_BIT)


def viscous_singularity(two_dof, method, state):
    """Smallest singular value, relative, of the dynamic stiffness with the viscous damper mu N / eps at a mode's s."""
    s = -state["beta"] + 1j * state["omega"] if method == "CNM" else 1j * state["omega0"]
    C = two_dof.B.T @ two_dof.B * 5.0 / 0.05
    C = C if method == "CNM" else C - 2 * state["zeta"] * state["omega0"] * two_dof.M
    values = np.linalg.svd(two_dof.K + s * C + s**2 * two_dof.M, compute_uv=False)
    return values[-1] / values[0]


@pytest.mark.parametrize("method", METHODS)
def test_small_amplitudes_tend_to_a_viscous_damper(two_dof, comm, method):
    """mu N / eps as a -> 0; tanh(x) = x - x^3/3 makes the distance fall as a^2."""
    problem = mode_problem(oscillator(two_dof, comm), [1, 3], 64, method, start="stuck")
    distances = [viscous_singularity(two_dof, method, problem.state(solve_at(problem, a))) for a in (4e-3, 2e-3)]
    assert distances[0] / distances[1] == pytest.approx(4, rel=0.01)
    assert distances[1] < 1e-6


def test_small_amplitudes_of_cnm_tend_to_the_linearised_mode(two_dof, comm):
    """lambda of the quadratic eigenproblem, again as a^2."""
    model = oscillator(two_dof, comm)
    linear = fw.linear_modes(model, 1, "linearised")[0]
    problem = mode_problem(model, [1, 3], 64, start="stuck")
    distances = [problem.state(solve_at(problem, a))["zeta"] / linear.zeta - 1 for a in (4e-3, 2e-3)]
    assert distances[0] / distances[1] == pytest.approx(4, rel=0.01)
    assert distances[1] < 1e-3


@pytest.mark.parametrize("method", METHODS)
def test_coulomb_slider_on_a_single_dof(comm, method):
    """w0 = sqrt(k/m), zeta = 2 R / (pi k a) for one harmonic as eps -> 0; the error falls as eps^2."""
    m, k, limit, a = 2.0, 3.0, 0.3, 2.0
    errors = []
    for eps in (0.1, 0.05, 0.025):
        problem = mode_problem(single_dof(comm, m, k, law=friction([[1.0]], limit, eps)), [1], 4096, method)
        state = problem.state(solve_at(problem, a))
        errors.append(state["zeta"] - 2 * limit / (np.pi * k * a))
        assert state["omega0"] == pytest.approx(np.sqrt(k / m), rel=ROUNDING)
    assert np.log2(np.divide(errors[:-1], errors[1:])) == pytest.approx([2, 2], abs=0.01)
    assert abs(errors[-1]) < 2e-6


def test_one_harmonic_of_a_velocity_law_makes_cnm_and_epmc_equal(comm):
    """One dof, one harmonic, f(v): F is along lambda q, both give w0 = sqrt(k/m), zeta = |F| / (2 k a)."""
    model = single_dof(comm, 2.0, 3.0, law=friction([[1.0]], 0.8, 0.5))
    found = []
    for method in METHODS:
        problem = mode_problem(model, [1], 256, method)
        y = solve_at(problem, 1.5)
        f = everywhere(problem, problem.contact_period(y))[0]["f"][:, 0, 0]
        force = 2 / 256 * abs(np.exp(-2j * np.pi * np.arange(256) / 256) @ f)
        state = problem.state(y)
        assert state["zeta"] == pytest.approx(force / (2 * 3.0 * 1.5), rel=ROUNDING)
        found.append((state["omega0"], state["zeta"]))
    assert found[0] == pytest.approx(found[1], rel=ROUNDING)


def duffing_frequency(a, g=1.0):
    """x'' + x + g x^3 = 0 with peak a: exact, all harmonics."""
    s = g * a**2
    return np.pi * np.sqrt(1 + s) / (2 * ellipk(s / (2 * (1 + s))))


@pytest.mark.ranks(1)
def test_closed_form_of_duffing_gives_the_reference_values():
    """pi sqrt(1 + g a^2) / (2 K(m)), m = g a^2 / (2 (1 + g a^2)), to the digits given."""
    assert [duffing_frequency(a) for a in (0.5, 1, 2)] == pytest.approx([1.08915818, 1.31777606, 1.97601636], abs=5e-9)


def duffing_error(comm, method, highest, amplitude):
    """Relative error of the frequency at the motion's own peak, and the damping found."""
    problem = mode_problem(single_dof(comm, law=CubicLaw()), range(1, highest + 1, 2), 256, method)
    branch = fw.Continuation(problem, problem.initial(0.1), (0.05, amplitude))
    y = [p.y for p in branch if p.event == "stop"][0]
    peak = everywhere(problem, problem.dof_period(y))["x"].max()
    state = problem.state(y)
    return abs(state["omega"] / duffing_frequency(peak) - 1), abs(state["zeta"])


@pytest.mark.parametrize("method", METHODS)
def test_undamped_duffing_converges_spectrally(comm, method):
    """Each further odd harmonic divides the error by more than 20, down to rounding; no damping comes out."""
    errors, damping = zip(*(duffing_error(comm, method, H, 1.0) for H in (1, 3, 5, 7, 9, 11)))
    assert all(later < earlier / 20 for earlier, later in zip(errors, errors[1:]))
    assert errors[-1] < 5e-11 and max(damping) < LAST_DIGITS


@pytest.mark.parametrize("amplitude", [0.5, 2.0, 10.0])
def test_undamped_duffing_at_small_and_large_amplitude(comm, amplitude):
    assert duffing_error(comm, "CNM", 31, amplitude)[0] < ROUNDING


def unilateral(comm, highest, amplitude=1.0):
    problem = mode_problem(single_dof(comm, law=UnilateralLaw(3.0)), range(highest + 1), 4096)
    return problem.state(solve_at(problem, amplitude))["omega"]


@pytest.mark.ranks(1)
def test_unilateral_spring_converges_to_its_closed_form(comm):
    """w = 2 w1 w2 / (w1 + w2) = 4/3. The force has a kink: x_n ~ n^-4, and the frequency's error ~ H^-5."""
    errors = [abs(unilateral(comm, H) / (4 / 3) - 1) for H in (8, 16, 32)]
    assert np.log2(errors[0] / errors[2]) / 2 == pytest.approx(5, abs=0.2)
    assert errors[2] < 2e-9


@pytest.mark.ranks(1)
def test_unilateral_spring_has_one_frequency_at_every_amplitude(comm):
    """The law is homogeneous of degree one."""
    assert [unilateral(comm, 7, a) for a in (1e-3, 1e3)] == pytest.approx([unilateral(comm, 7)] * 2, rel=ROUNDING)


@pytest.mark.ranks(1)
def test_mass_proportional_damping_added_afterwards_is_exact_in_epmc(two_dof, comm):
    """C = alpha M enters EPMC as C - 2 zeta w0 M: same motion and w0, zeta + alpha / (2 w0), at any amplitude."""
    alpha = -2 * 0.02 * OMEGA_STUCK
    without = at_event(paper_branch(two_dof, comm, "EPMC"), "report")
    damped = at_event(paper_branch(two_dof, comm, "EPMC", alpha * two_dof.M), "report")
    for a, b in zip(without, damped):
        assert b["omega0"] == pytest.approx(a["omega0"], rel=TIGHT)
        assert b["zeta"] == pytest.approx(a["zeta"] + alpha / (2 * a["omega0"]), abs=TIGHT)


@pytest.mark.ranks(1)
@pytest.mark.parametrize("method", METHODS)
def test_negative_damping_added_afterwards_shifts_the_curve(two_dof, comm, method):
    """c1 = -2 * 0.02 * sqrt(640) on m1 lowers zeta by 0.02; to 2e-4 away from slip onset, 1e-3 at 0.2."""
    without = at_event(paper_branch(two_dof, comm, method), "report")
    with_c1 = at_event(paper_branch(two_dof, comm, method, two_dof.negative_damping()), "report")
    shifts = np.array([b["zeta"] - a["zeta"] for a, b in zip(without, with_c1)])
    limits = np.where(np.isclose(REPORTS, 0.2), 1e-3, 2e-4)
    assert (np.abs(shifts + 0.02) < limits).all()


@pytest.mark.ranks(1)
def test_zero_damping_is_the_same_limit_cycle_in_both_methods(two_dof, comm):
    """With beta = 0 both describe one periodic motion: two limit cycles of the flutter case, to solver tolerance."""
    cycles = [at_event(paper_branch(two_dof, comm, m, two_dof.negative_damping()), "zero_damping") for m in METHODS]
    assert len(cycles[0]) == len(cycles[1]) == 2
    for cnm, epmc in zip(*cycles):
        for key in ("amplitude", "omega"):
            assert cnm[key] == pytest.approx(epmc[key], rel=SOLVED)


@pytest.mark.parametrize("method", METHODS)
def test_law_copied_in_python_gives_the_same_branch(two_dof, comm, method):
    """The slow path has the same interface and, with enough samples for so wide a tanh, the same numbers."""
    found, eps = [], 0.5
    for model in (
        oscillator(two_dof, comm, regularisation_velocity=eps),
        oscillator(two_dof, comm, law=TanhLaw(5.0, eps)),
    ):
        problem = mode_problem(model, [1, 3, 5], 512, method, start="stuck")
        found.append(states(problem, 0.05, (0.05, 1.0), [0.1, 0.2, 0.6]))
    for compiled, python in zip(*found):
        assert list(python.values()) == pytest.approx(list(compiled.values()), rel=TIGHT)
