"""Forced response against closed-form frequency responses, and the balance of energy with friction."""

from __future__ import annotations

import numpy as np
import pytest
from models.core_models import CubicLaw, LinearLaw, everywhere, oscillator, single_dof
from tolerances import LAST_DIGITS, REPEATED, ROUNDING, SOLVED

import fretwave as fw

M, C, K = 2.0, 0.3, 50.0
RESONANCE = np.sqrt(K / M)


def forced(model, orders, force, level, dof=0, samples=64, start="free"):
    reference = fw.linear_modes(model, 1, start)[0]
    return fw.ForcedResponse(model, fw.Harmonics(orders, samples), force, level, dof, reference)


def follow(problem, low, high, **arguments):
    branch = fw.Continuation(problem, problem.initial(low), (low, high), **arguments)
    points = list(branch)
    assert branch.converged, branch.reason
    return points


def wrapped(angle):
    """Angle in (-pi, pi]."""
    return np.angle(np.exp(1j * angle))


@pytest.mark.parametrize("force", [1.0, 0.6 - 0.8j])
def test_linear_single_dof_has_its_frequency_response(comm, force):
    """x = A cos(w t + phase), A e^{i phase} = F / (k - m w^2 + i c w), at every point through resonance."""
    problem = forced(single_dof(comm, M, K, C), [1], {1: np.array([force])}, 3.0)
    points = follow(problem, 0.5 * RESONANCE, 2 * RESONANCE)
    assert len(points) > 20
    for p in points:
        s = problem.state(p.y)
        exact = 3.0 * force / (K - M * s["omega"] ** 2 + 1j * C * s["omega"])
        assert s["amplitude"] == pytest.approx(abs(exact), rel=SOLVED)
        assert wrapped(s["phase"] - np.angle(exact)) == pytest.approx(0, abs=SOLVED)


def test_parameter_is_the_angular_frequency(comm):
    wanted = [0.7 * RESONANCE, RESONANCE, 1.4 * RESONANCE]
    problem = forced(single_dof(comm, M, K, C), [1], {1: np.array([1.0])}, 1.0)
    points = follow(problem, 0.5 * RESONANCE, 2 * RESONANCE, report_at=wanted)
    states = [problem.state(p.y) for p in points if p.event == "report"]
    assert [s["omega"] for s in states] == pytest.approx(wanted, rel=LAST_DIGITS)
    assert states[1]["phase"] == pytest.approx(-np.pi / 2, abs=SOLVED)
    assert states[1]["frequency_hz"] == pytest.approx(RESONANCE / (2 * np.pi), rel=LAST_DIGITS)


def test_several_harmonics_of_a_linear_model(two_dof, comm):
    """Q_n = (K + s C + s^2 M)^-1 P_n for each order of the force by itself, the mean among them."""
    damping = np.array([[0.5, -0.1], [-0.1, 0.1]])
    model = fw.Model(two_dof.M, two_dof.K, damping, comm=comm)
    rng = np.random.default_rng(8)
    force = {0: rng.standard_normal(2), **{n: rng.standard_normal(2) + 1j * rng.standard_normal(2) for n in (1, 2, 3)}}
    problem = forced(model, [0, 1, 2, 3], force, 0.5, samples=16)
    y = next(iter(fw.Continuation(problem, problem.initial(11.0), (10.0, 20.0)))).y
    Q = everywhere(problem, problem.coefficients(y))
    for n, P in force.items():
        found = Q[:, 0] if n == 0 else Q[:, 2 * n - 1] - 1j * Q[:, 2 * n]
        s = 11.0j * n
        expected = np.linalg.solve(two_dof.K + s * damping + s**2 * two_dof.M, 0.5 * P)
        assert np.allclose(found, expected, rtol=0, atol=ROUNDING * np.abs(expected).max())


def test_linear_law_adds_to_the_frequency_response(comm):
    """f = k u + c v in the contact: the closed form with K + k, C + c."""
    law = LinearLaw(10.0, 0.2)
    problem = forced(single_dof(comm, M, K, C, law), [1, 3], {1: np.array([1.0])}, 1.0)
    for p in follow(problem, 3.0, 8.0):
        s = problem.state(p.y)
        exact = 1 / (K + 10.0 - M * s["omega"] ** 2 + 1j * (C + 0.2) * s["omega"])
        assert s["amplitude"] == pytest.approx(abs(exact), rel=SOLVED)


def friction_points(two_dof, comm, level, damping=None):
    model = oscillator(two_dof, comm, damping)
    problem = forced(model, range(1, 22, 2), {1: np.array([1.0, 0.0])}, level, samples=512, start="stuck")
    return problem, follow(problem, 20.0, 30.0)


def work_of_the_force(Q, labels, force):
    """Energy fed in per period: sum over n of pi n Im(P_n conj(q_n)), from the integral of p(t) v(t)."""
    column = labels.index("1c")
    q = Q[:, column] - 1j * Q[:, column + 1]
    return np.pi * np.imag(force @ np.conj(q))


@pytest.mark.parametrize("level", [0.5, 4.0, 8.0])
def test_work_of_the_force_is_what_friction_dissipates(two_dof, comm, level):
    """Energy balance to the solver's tolerance, from stuck to 84 % slip; no matter how many harmonics."""
    problem, points = friction_points(two_dof, comm, level)
    for p in points[::3]:
        Q = everywhere(problem, problem.coefficients(p.y))
        fed = work_of_the_force(Q, problem.harmonics.labels, np.array([level, 0.0]))
        assert problem.diagnostics(p.y)["work"] == pytest.approx(fed, rel=REPEATED)


def test_work_is_shared_by_friction_and_viscous_damping(two_dof, comm):
    """A damping matrix takes pi n^2 w q_n^H C q_n per harmonic and period."""
    damping, level = np.diag([0.4, 0.05]), 8.0
    problem, points = friction_points(two_dof, comm, level, damping)
    for p in points[::5]:
        Q = everywhere(problem, problem.coefficients(p.y))
        q = Q[:, 0::2] - 1j * Q[:, 1::2]
        orders = np.array(problem.harmonics.orders)
        viscous = np.pi * p.parameter * np.einsum("in,ij,jn,n->", q.conj(), damping, q, orders**2).real
        fed = work_of_the_force(Q, problem.harmonics.labels, np.array([level, 0.0]))
        assert problem.diagnostics(p.y)["work"] + viscous == pytest.approx(fed, rel=REPEATED)


@pytest.mark.ranks(1)
def test_resonance_moves_from_stuck_to_free_with_the_level(two_dof, comm):
    """Asymptotes: small forces resonate at the stuck frequency, large ones near the free one."""
    peaks = []
    for level in (0.5, 30.0):
        # friction alone bounds the resonance up to about 9 N only (Den Hartog 1931), hence the viscous damper
        problem, points = friction_points(two_dof, comm, level, np.diag([0.5, 0.0]))
        peaks.append(max((problem.state(p.y) for p in points), key=lambda s: s["amplitude"])["omega"])
    assert peaks == pytest.approx([two_dof.omega_stuck, two_dof.omega_free], abs=0.05)


@pytest.mark.ranks(1)
def test_forced_duffing_resonates_on_the_undamped_backbone(comm):
    """Phase -pi/2 at an amplitude a: for one harmonic w^2 = k + 3/4 g a^2 and c w a = F exactly."""
    model = single_dof(comm, 1.0, 1.0, 0.05, CubicLaw())
    problem = forced(model, [1], {1: np.array([1.0])}, 0.1)
    states = [problem.state(p.y) for p in follow(problem, 0.5, 3.0, steps=fw.StepControl(maximum=0.05))]
    for before, after in zip(states, states[1:]):
        assert abs(after["omega"] - before["omega"]) < 0.1
    for s in states:
        a, w = s["amplitude"], s["omega"]
        stiffness = 1 - w**2 + 0.75 * a**2 + 0.05j * w
        assert a * abs(stiffness) == pytest.approx(0.1, rel=REPEATED)
        assert s["phase"] == pytest.approx(-np.angle(stiffness), abs=REPEATED)
    assert max(s["amplitude"] for s in states) > 1.0


def test_forced_duffing_folds_twice(comm):
    """A hardening resonance bends over: the frequency turns back at the tip and again below."""
    problem = forced(single_dof(comm, 1.0, 1.0, 0.05, CubicLaw()), [1, 3], {1: np.array([1.0])}, 0.1)
    folds = [p.parameter for p in follow(problem, 0.5, 3.0) if p.event == "fold"]
    assert len(folds) == 2 and folds[0] > folds[1] > 1


def test_bad_inputs_are_refused(comm):
    model = single_dof(comm, M, K, C)
    reference = fw.linear_modes(model, 1, "free")[0]
    h = fw.Harmonics([1], 8)
    for force, level in (({1: np.array([0.0])}, 1.0), ({1: np.array([1.0])}, 0.0), ({2: np.array([1.0])}, 1.0)):
        with pytest.raises(fw.InputError):
            fw.ForcedResponse(model, h, force, level, 0, reference)
    problem = fw.ForcedResponse(model, h, {1: np.array([1.0])}, 1.0, 0, reference)
    for omega in (0.0, -1.0):
        with pytest.raises(fw.InputError, match="frequency"):
            problem.initial(omega)
