"""The Jenkins element (elastic Coulomb slider, constant normal load) against closed forms and its own tangent."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from models.core_models import everywhere, mode_problem, single_dof, solve_at, unknowns, whole
from mpi4py import MPI
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
    """REFERENCE: one harmonic, a > R/kt."""
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


def measured_stiffness(a, samples):
    """f's fundamental over u's."""
    u, f = period(jenkins(), (0, a, 0, 0, 0, 0, 0), samples)
    return np.fft.fft(f[:, 0])[1] / np.fft.fft(u[:, 0])[1]


def test_closed_form_gives_the_reference_value():
    """REFERENCE: kt = R = 1, a = 2."""
    assert complex_stiffness(2.0) == pytest.approx(0.5 + 0.318310j, abs=5e-7)


def test_complex_stiffness_of_one_harmonic_converges_as_the_square_of_the_samples():
    """At a = 2 R/kt both kinks fall on samples: the order shows without scatter."""
    errors = [abs(measured_stiffness(2.0, n) - complex_stiffness(2.0)) for n in (32, 64, 128, 256)]
    assert np.log2(np.divide(errors[:-1], errors[1:])) == pytest.approx([2, 2, 2], abs=0.01)
    assert errors[-1] < 4e-5


@pytest.mark.parametrize("a", [1.01, 1.3, 2.7, 10.0, 300.0])
def test_complex_stiffness_at_other_amplitudes(a):
    """Kinks between samples: the trapezoidal rule's error stays below the jump of slope times h^2 / 8 each."""
    n = 512
    h = 2 * np.pi / n
    assert abs(measured_stiffness(a, n) - complex_stiffness(a)) < 4 / np.pi * h**2


@given(st.floats(1.0, 50.0), positive, positive)
@DRAWN
def test_dissipated_work_is_the_closed_form(ratio, stiffness, limit):
    """REFERENCE: 4 R (a - R/kt), exact for sampled extremes."""
    a = ratio * limit / stiffness
    problem, y = imposed(jenkins(stiffness=stiffness, limit=limit), (0, a, 0, 0, 0, 0, 0))
    expected = 4 * limit * (a - limit / stiffness)
    assert problem.diagnostics(y)["work"] == pytest.approx(expected, rel=ROUNDING, abs=ROUNDING * limit * a)


def test_loss_is_largest_at_twice_the_slip_amplitude():
    """REFERENCE: kt/pi at a = 2 R/kt; flat there, smaller on both sides."""
    loss = {a: measured_stiffness(a, 4096).imag for a in (1.9, 2.0, 2.1)}
    assert loss[2.0] == pytest.approx(1 / np.pi, abs=1e-6)
    assert loss[1.9] < loss[2.0] > loss[2.1]
    for a in (1.9, 2.1):
        assert loss[a] == pytest.approx(complex_stiffness(a).imag, abs=2e-6)


def initial_loading(x, stiffness, limit):
    """F(x) of parallel elements, from rest."""
    return np.clip(np.outer(x, stiffness), -limit, limit).sum(axis=1)


@pytest.mark.parametrize("q", [(0, 2.5, 0, 0, 0, 0.2, 0), (0.7, 0, 1.8, 0, 0, 0, -0.1)])
def test_parallel_elements_obey_masing(q):
    """REFERENCE: branches from the extremes are the initial loading curve doubled, about a mean or not."""
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
    """The slider's work equals the closed integral of f du: the springs give back what they take (trapezoids in f and
    the elastic part are exact; the slip part differs by (df)(dw)/2 in the samples where slip starts)."""
    problem, y = imposed(jenkins(stiffness=stiffness, limit=limit), q)
    u, f = (s[:, 0] for s in period(jenkins(stiffness=stiffness, limit=limit), q))
    w = u - f / stiffness
    after, dw = np.roll(f, -1), np.roll(w, -1) - w
    area = np.sum(after * dw)
    assert problem.diagnostics(y)["work"] == pytest.approx(
        area, rel=TIGHT, abs=ROUNDING * limit * (1 + np.abs(u).max())
    )


@given(coefficients, st.integers(1, 63))
@DRAWN
def test_loop_does_not_depend_on_the_first_sample(q, shift):
    """Started from rest and read on the second period (DESIGN fact 3): the same loop from any phase of the motion."""
    turned = np.array(q)
    for n in (1, 2, 3):
        c = (q[2 * n - 1] - 1j * q[2 * n]) * np.exp(2j * np.pi * n * shift / 64)
        turned[2 * n - 1 : 2 * n + 1] = c.real, -c.imag
    f, later = period(jenkins(), q)[1], period(jenkins(), turned)[1]
    assert np.allclose(np.roll(later, shift, axis=0), f, rtol=0, atol=1e-13)


def march(u, stiffness, limit):
    """The recursion written again: forces of the second period, and the smallest distance of a trial force from R."""
    w, trials, f = 0.0, [], []
    for x in np.tile(u, 2):
        trials.append(stiffness * (x - w))
        f.append(np.clip(trials[-1], -limit, limit))
        if abs(trials[-1]) > limit:
            w = x - f[-1] / stiffness
    return np.array(f[len(u) :]), np.abs(np.abs(trials) - limit).min()


@given(coefficients, positive, positive)
@DRAWN
def test_force_is_the_slider_s_recursion(q, stiffness, limit):
    u, f = period(jenkins(stiffness=stiffness, limit=limit), q)
    assert np.allclose(f[:, 0], march(u[:, 0], stiffness, limit)[0], rtol=0, atol=ROUNDING * limit + 1e-14 * stiffness)


@given(coefficients, st.integers(0, 1000))
@DRAWN
def test_tangent_is_the_derivative_away_from_kinks(q, seed):
    """Piecewise linear: where no sample changes state the difference is exact to rounding."""
    contact = jenkins(stiffness=1.5, limit=0.8)
    assume(march(period(contact, q)[0][:, 0], 1.5, 0.8)[1] > 1e-4)
    problem, y0 = imposed(contact, q)
    y, step = whole(y0), 2e-6
    dy = np.concatenate([np.random.default_rng(seed).standard_normal(7), [0, 0, 0]])
    plus, minus = (whole(problem.residual(unknowns(problem, y + s * step * dy))) for s in (1, -1))
    product = whole(problem.jacobian_product(y0, unknowns(problem, dy)))
    assert np.allclose((plus - minus) / (2 * step), product, rtol=0, atol=SOLVED * np.abs(product).max())


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


#: REFERENCE: m = k = kt = R = 1, a = 2: (w0, zeta).
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


@pytest.mark.parametrize("method", METHODS)
def test_single_dof_mode_converges_to_the_closed_form(comm, method):
    """Error falls as 1/N_t^2 (kinks on samples)."""
    w0, zeta = single_dof_closed_form(method)
    errors = []
    for samples in (64, 256, 1024, 4096):
        problem = mode_problem(single_dof(comm, law=jenkins()), [1], samples, method, start="stuck")
        state = problem.state(solve_at(problem, 2.0))
        errors.append([state["omega0"] - w0, state["zeta"] - zeta])
    errors = np.abs(errors)
    assert np.log2(errors[:-1, 1] / errors[1:, 1]) == pytest.approx([4, 4, 4], abs=0.02)
    assert (errors[-1] < 5e-8).all()


@pytest.mark.parametrize("a", [1.2, 2.0, 5.0])
def test_damping_of_epmc_is_the_work_of_the_element(comm, a):
    """One harmonic: 2 pi zeta w0^2 m a^2 = work, to what sampling the loop leaves."""
    problem = mode_problem(single_dof(comm, law=jenkins()), [1], 2048, "EPMC", start="stuck")
    y = solve_at(problem, a)
    state = problem.state(y)
    found = 2 * np.pi * state["zeta"] * state["omega0"] ** 2 * a**2
    assert found == pytest.approx(problem.diagnostics(y)["work"], rel=2e-5)


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
    """REFERENCE: k_eff = k + 4 sin^2(pi ND/N) kappa(2 a sin(pi ND/N)), any N; every pair meets the same samples."""
    errors = []
    for samples in (8 * n, 16 * n, 32 * n):
        found, exact = wheel_mode(comm, n, diameters, samples)
        errors.append(np.abs(found - exact))
    zeta = np.array(errors)[:, 1]
    orders = np.log2(zeta[:-1] / zeta[1:])
    assert orders == pytest.approx([2, 2], abs=0.15)
    assert errors[-1][0] < 1e-3 and errors[-1][1] < 5e-4
