"""The Jenkins element (elastic Coulomb slider, constant normal load) against closed forms and its own tangent."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from models.core_models import derivative, everywhere, mode_problem, single_dof, solve_at, unknowns, whole
from mpi4py import MPI
from oracle import Jenkins
from oracle.period import hysteresis
from tolerances import LAST_BIT, LAST_DIGITS, ROUNDING, SOLVED, TIGHT

import fretwave as fw

METHODS = ["CNM", "EPMC"]
#: On several ranks each must draw the same examples.
DRAWN = settings(max_examples=25, deadline=None, derandomize=True, database=None)
coefficients = st.lists(st.floats(-3.0, 3.0), min_size=7, max_size=7)
positive = st.floats(0.01, 100.0)


def jenkins(B=((1.0,),), stiffness=1.0, limit=1.0):
    return fw.Contact("jenkins", np.array(B), {"tangential_stiffness": stiffness, "friction_limit": limit})


def complex_stiffness(a, stiffness=1.0, limit=1.0):
    """Complex stiffness of one harmonic in closed form, a > R/kt."""
    th = np.arccos(1 - 2 * limit / (stiffness * a))
    loss = 4 * limit / (np.pi * a) * (1 - limit / (stiffness * a))
    return stiffness / np.pi * (th - np.sin(2 * th) / 2) + 1j * loss


def imposed(contact, q=(0, 1, 0, 0, 0, 0, 0), samples=64, n_dof=1):
    """A problem and its unknowns for x = q0 + q1c cos + ... of every dof, frequency 1, no decay."""
    start = fw.LinearMode(1.0, 0.0, np.ones(n_dof), np.zeros(n_dof))
    model = fw.Model(np.eye(n_dof), np.eye(n_dof), None, [contact], MPI.COMM_WORLD)
    problem = fw.NonlinearMode(model, fw.Harmonics([0, 1, 2, 3], samples), "EPMC", 0, start)
    return problem, unknowns(problem, np.concatenate([np.ravel(q), [0.0, 1.0, 0.0]]))


def period(contact, q=(0, 1, 0, 0, 0, 0, 0), samples=64):
    """u, f (samples, pairs) over one period, on every rank."""
    problem, y = imposed(contact, q, samples)
    found = everywhere(problem, problem.contact_period(y))[0]
    return found["u"][:, 0], found["f"][:, 0]


def force(contact, q, samples=64):
    """Coefficients of f: the residual less (1 - n^2) q."""
    problem, y = imposed(contact, q, samples)
    return whole(problem.residual(y))[:7] - (1 - np.repeat([0, 1, 2, 3], 2)[1:] ** 2) * np.asarray(q)


def measured_stiffness(a, samples=64):
    """f's fundamental over u's."""
    found = force(jenkins(), (0, a, 0, 0, 0, 0, 0), samples)
    return (found[1] - 1j * found[2]) / a


def test_closed_form_gives_the_reference_value():
    """kt = R = 1, a = 2: 0.5 + i / pi."""
    assert complex_stiffness(2.0) == pytest.approx(0.5 + 0.318310j, abs=5e-7)


@pytest.mark.parametrize("samples", [8, 64, 512])
@pytest.mark.parametrize("a", [1.0 + 1e-6, 1.01, 1.3, 2.0, 2.7, 10.0, 300.0])
def test_complex_stiffness_of_one_harmonic(a, samples):
    """Wherever slip begins and ends among the samples, and however few they are."""
    assert abs(measured_stiffness(a, samples) - complex_stiffness(a)) < ROUNDING


@given(st.floats(1.0, 50.0), positive, positive)
@DRAWN
def test_dissipated_work_is_the_closed_form(ratio, stiffness, limit):
    """Work of a period, 4 R (a - R/kt)."""
    a = ratio * limit / stiffness
    problem, y = imposed(jenkins(stiffness=stiffness, limit=limit), (0, a, 0, 0, 0, 0, 0))
    expected = 4 * limit * (a - limit / stiffness)
    assert problem.diagnostics(y)["work"] == pytest.approx(expected, rel=ROUNDING, abs=ROUNDING * limit * a)


def test_loss_is_largest_at_twice_the_slip_amplitude():
    """kt/pi at a = 2 R/kt; flat there, smaller on both sides."""
    loss = {a: measured_stiffness(a).imag for a in (1.999, 2.0, 2.001)}
    assert loss[2.0] == pytest.approx(1 / np.pi, abs=ROUNDING)
    assert loss[1.999] < loss[2.0] > loss[2.001]


def initial_loading(x, stiffness, limit):
    """F(x) of parallel elements, from rest."""
    return np.clip(np.outer(x, stiffness), -limit, limit).sum(axis=1)


@pytest.mark.parametrize("q", [(0, 2.5, 0, 0, 0, 0.2, 0), (0.7, 0, 1.8, 0, 0, 0, -0.1)])
def test_parallel_elements_obey_masing(q):
    """Masing: branches from the extremes are the initial loading curve doubled, about a mean or not."""
    stiffness, limit = np.array([1.0, 0.5, 2.0]), np.array([0.3, 0.8, 1.0])
    u, f = period(jenkins(np.ones((3, 1)), stiffness, limit), q, 256)
    x, f = u[:, 0], f.sum(axis=1)
    top, bottom = np.argmax(x), np.argmin(x)
    rise = np.sort((np.arange(256) - bottom) % 256) <= (top - bottom) % 256
    order = (np.arange(256) + bottom) % 256
    up, down = order[rise], order[~rise]
    swing = 2 * initial_loading([(x[top] - x[bottom]) / 2], stiffness, limit)
    assert f[top] - f[bottom] == pytest.approx(swing[0], rel=ROUNDING)
    loading = f[bottom] + 2 * initial_loading((x[up] - x[bottom]) / 2, stiffness, limit)
    unloading = f[top] - 2 * initial_loading((x[top] - x[down]) / 2, stiffness, limit)
    assert np.allclose(f[up], loading, rtol=0, atol=ROUNDING)
    assert np.allclose(f[down], unloading, rtol=0, atol=ROUNDING)


@given(coefficients, positive, positive)
@DRAWN
def test_force_is_bounded_and_dissipation_not_negative(q, stiffness, limit):
    """|f| <= R at every sample, work >= 0 of any period, whatever the motion."""
    contact = jenkins(stiffness=stiffness, limit=limit)
    problem, y = imposed(contact, q)
    found = problem.diagnostics(y)
    assert (np.abs(period(contact, q)[1]) <= limit).all()
    assert found["work"] >= 0
    assert found["stick"] + found["slip"] == pytest.approx(1, abs=LAST_BIT) and found["open"] == 0


@given(coefficients, positive, positive)
@DRAWN
def test_work_is_the_area_of_the_loop(q, stiffness, limit):
    """The slider's work equals the closed integral of f du, pi sum n (fc us - fs uc): the springs give back what they
    take, and displacements have no other harmonics."""
    contact = jenkins(stiffness=stiffness, limit=limit)
    problem, y = imposed(contact, q)
    f, u, n = force(contact, q), np.asarray(q), np.arange(1, 4)
    area = np.pi * np.sum(n * (f[1::2] * u[2::2] - f[2::2] * u[1::2]))
    size = np.abs(u).max() * (np.abs(f).max() + np.abs(u).max())
    assert problem.diagnostics(y)["work"] == pytest.approx(area, rel=TIGHT, abs=100 * ROUNDING * size)


@given(coefficients, st.integers(1, 63))
@DRAWN
def test_loop_does_not_depend_on_the_first_sample(q, shift):
    """Started from rest and read on the second period: the same loop from any phase of the motion."""
    turned = np.array(q)
    for n in (1, 2, 3):
        c = (q[2 * n - 1] - 1j * q[2 * n]) * np.exp(2j * np.pi * n * shift / 64)
        turned[2 * n - 1 : 2 * n + 1] = c.real, -c.imag
    f, later = period(jenkins(), q)[1], period(jenkins(), turned)[1]
    assert np.allclose(np.roll(later, shift, axis=0), f, rtol=0, atol=1e-13)


@given(coefficients, positive, positive)
@DRAWN
def test_force_at_any_time_is_the_exact_one(q, stiffness, limit):
    """Of the oracle, which knows nothing of samples."""
    u = np.concatenate([[q[0]], np.array(q[1::2]) - 1j * np.array(q[2::2])])
    assume(np.abs(u[1:]).max() > 1e-6)
    exact = hysteresis(Jenkins(np.ones(1), stiffness, limit), u)
    f = period(jenkins(stiffness=stiffness, limit=limit), q)[1][:, 0]
    expected = [exact.at(tau) for tau in 2 * np.pi * np.arange(64) / 64]
    assert np.allclose(f, expected, rtol=0, atol=ROUNDING * (limit + stiffness * np.abs(u).sum()))


@given(coefficients, st.integers(0, 1000))
@DRAWN
def test_tangent_is_the_derivative(q, seed):
    """But at first slip, where the law has a kink."""
    contact = jenkins(stiffness=1.5, limit=0.8)
    swing = np.ptp(period(contact, q, 1024)[0])
    assume(abs(swing - 2 * 0.8 / 1.5) > 0.05 and swing > 0.05)
    problem, y0 = imposed(contact, q)
    dy = np.concatenate([np.random.default_rng(seed).standard_normal(7), [0, 0, 0]])
    expected = derivative(lambda at: whole(problem.residual(unknowns(problem, at))), whole(y0), dy)
    product = whole(problem.jacobian_product(y0, unknowns(problem, dy)))
    assert np.allclose(expected, product, rtol=0, atol=SOLVED * np.abs(product).max())


@pytest.mark.parametrize("limit", [0.0, 1.0])
def test_tangent_of_a_slider_without_friction_is_zero(limit):
    """R = 0 carries nothing, also where the pair does not move; R = 1 at rest is the stuck spring."""
    problem, y = imposed(jenkins(limit=limit), np.zeros(7))
    along_mean = unknowns(problem, np.eye(10)[0])
    found = whole(problem.jacobian_product(y, along_mean))
    assert found[0] == pytest.approx(1.0 + (limit > 0), rel=LAST_DIGITS)  # ground spring 1, and kt = 1 if it sticks


@pytest.mark.parametrize("method", METHODS)
def test_stuck_element_is_a_spring(comm, method):
    """Below R/kt: w = sqrt((k + kt)/m), no damping."""
    problem = mode_problem(single_dof(comm, 2.0, 3.0, law=jenkins(stiffness=5.0)), [1, 3], 64, method, start="free")
    y = solve_at(problem, 0.199)
    state, contact = problem.state(y), problem.diagnostics(y)
    assert state["omega0"] == pytest.approx(2.0, rel=TIGHT)
    assert abs(state["zeta"]) < ROUNDING and contact["work"] == 0 and contact["stick"] == 1


#: m = k = kt = R = 1, a = 2: (w0, zeta).
SINGLE_DOF = {"EPMC": (1.224745, 0.106103), "CNM": (1.238306, 0.104362)}


def single_dof_closed_form(method):
    k = 1 + complex_stiffness(2.0)
    if method == "EPMC":
        return np.sqrt(k.real), k.imag / (2 * k.real)
    lam = 1j * np.sqrt(k)
    return abs(lam), -lam.real / abs(lam)


@pytest.mark.parametrize("method", METHODS)
def test_closed_form_of_a_single_dof_gives_the_reference_values(method):
    assert single_dof_closed_form(method) == pytest.approx(SINGLE_DOF[method], abs=5e-7)


@pytest.mark.parametrize("samples", [4, 64])
@pytest.mark.parametrize("method", METHODS)
def test_single_dof_mode_is_the_closed_form(comm, method, samples):
    """With the least number of samples too."""
    problem = mode_problem(single_dof(comm, law=jenkins()), [1], samples, method, start="stuck")
    state = problem.state(solve_at(problem, 2.0))
    assert (state["omega0"], state["zeta"]) == pytest.approx(single_dof_closed_form(method), rel=TIGHT)


@pytest.mark.parametrize("a", [1.2, 2.0, 5.0])
def test_damping_of_epmc_is_the_work_of_the_element(comm, a):
    """One harmonic: 2 pi zeta w0^2 m a^2 = work."""
    problem = mode_problem(single_dof(comm, law=jenkins()), [1], 64, "EPMC", start="stuck")
    y = solve_at(problem, a)
    state = problem.state(y)
    found = 2 * np.pi * state["zeta"] * state["omega0"] ** 2 * a**2
    assert found == pytest.approx(problem.diagnostics(y)["work"], rel=TIGHT)


def wheel(comm, n, samples):
    """n masses with ground springs, in a ring coupled by Jenkins elements."""
    contact = jenkins(np.roll(np.eye(n), 1, axis=1) - np.eye(n))
    start = fw.LinearMode(1.5, 0.0, np.ones(n), np.zeros(n))
    model = fw.Model(np.eye(n), np.eye(n), None, [contact], comm)
    return fw.NonlinearMode(model, fw.Harmonics([1], samples), "EPMC", 0, start)


def travelling(problem, n, diameters, amplitude, omega0, zeta):
    """Unknowns of x_j = a cos(w t + 2 pi ND j/n)."""
    phase = 2 * np.pi * diameters * np.arange(n) / n
    blocks = np.column_stack([np.cos(phase), -np.sin(phase)])
    return unknowns(problem, np.concatenate([blocks.ravel(), [zeta, omega0 / 1.5, np.log(amplitude)]]))


def wheel_mode(comm, n, diameters, samples):
    """(w0, zeta) found and in closed form, and the found coefficients, at a relative amplitude of 2 R/kt."""
    reach = 2 * np.sin(np.pi * diameters / n)
    k = 1 + reach**2 * complex_stiffness(2.0)
    exact = np.array([np.sqrt(k.real), k.imag / (2 * k.real)])
    problem, amplitude = wheel(comm, n, samples), 2.0 / reach
    y = travelling(problem, n, diameters, amplitude, 0.98 * exact[0], 1.1 * exact[1])
    branch = fw.Continuation(problem, y, (0.5 * amplitude, 2 * amplitude))
    point = next(iter(branch), None)
    assert point is not None, branch.reason
    state, Q = problem.state(point.y), everywhere(problem, problem.coefficients(point.y))
    wave = amplitude * np.exp(2j * np.pi * diameters * np.arange(n) / n)
    assert np.allclose(Q[:, 0] - 1j * Q[:, 1], wave, rtol=0, atol=SOLVED * amplitude)
    return np.array([state["omega0"], state["zeta"]]), exact


@pytest.mark.parametrize("n, diameters", [(5, 1), (5, 2), (24, 1), (24, 5), (24, 11)])
def test_travelling_wave_on_a_full_wheel(comm, n, diameters):
    """k_eff = k + 4 sin^2(pi ND/N) kappa(2 a sin(pi ND/N)), any N, whatever samples a pair meets."""
    found, exact = wheel_mode(comm, n, diameters, 16)
    assert found == pytest.approx(exact, rel=SOLVED)
