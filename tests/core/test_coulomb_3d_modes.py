"""Modes that 3-D Coulomb contact carries: exact Jacobians, closed forms of stuck, open and frictionless pairs."""

from __future__ import annotations

import numpy as np
import pytest
from models.core_models import chain, dense, derivative, mode_problem, solve_at, unknowns, whole
from models.coulomb_pair import KN, KT, LAWS, pair, random_map, random_mode
from mpi4py import MPI
from tolerances import LAST_DIGITS, REPEATED, ROUNDING, SOLVED, TIGHT

import fretwave as fw


def residual_of(problem):
    return lambda y: whole(problem.residual(unknowns(problem, y)))


@pytest.mark.ranks(1, 2, 3)
@pytest.mark.parametrize("method", ["CNM", "EPMC"])
@pytest.mark.parametrize("law", LAWS)
def test_jacobian_of_a_mode_is_exact(law, method):
    """Assembled against the product to rounding, and both against central differences, in stick, slip and lift-off."""
    for seed in range(3):
        problem, y = random_mode(law, method, seed)
        point = unknowns(problem, y)
        contact = problem.diagnostics(point)
        assert min(contact["stick"], contact["slip"], contact["open"]) > 0.01
        J, identity = dense(problem.jacobian(point)), np.eye(len(y))
        product = np.column_stack([whole(problem.jacobian_product(point, unknowns(problem, e))) for e in identity])
        step = 1e-6 if law == "coulomb_3d" else 3e-5  # the former has kinks where a sample changes its state
        difference = np.column_stack([derivative(residual_of(problem), y, e, step) for e in identity])
        assert np.allclose(product, J, rtol=0, atol=LAST_DIGITS * np.abs(J).max())
        assert np.allclose(difference, J, rtol=0, atol=SOLVED * np.abs(J).max())


@pytest.mark.parametrize("law", LAWS)
def test_mean_block_is_regular_when_stuck_under_preload(law):
    """A body held by contact alone. The mean's block is the stuck stiffness, kn and kt, not singular."""
    contact = pair(law, np.vstack([np.eye(3), np.diag([-1.0, 1.0, 1.0])]))
    model = fw.Model(np.eye(3), np.zeros((3, 3)), None, [contact], MPI.COMM_WORLD)
    start = fw.linear_modes(model, 1, "stuck")[0]
    problem = fw.NonlinearMode(model, fw.Harmonics([0, 1], 32), "EPMC", 1, start)
    y = np.zeros(12)
    y[3 + 1], y[-2:] = 1.0, [1.0, np.log(0.1)]
    J = dense(problem.jacobian(unknowns(problem, y)))[0:9:3, 0:9:3]
    k_ref = start.omega**2 / np.sum(start.shape**2)
    assert np.allclose(J * k_ref, 2 * np.diag([KN, KT, KT]), rtol=0, atol=ROUNDING)


def unilateral(comm, highest, samples=1024):
    """k = 1, kn = 3, m = 1, zero gap, no friction."""
    contact = pair(B=((1.0,), (0.0,), (0.0,)), normal_stiffness=3.0, friction_coefficient=0.0, normal_load=0.0)
    model = fw.Model([[1.0]], [[1.0]], None, [contact], comm)
    return mode_problem(model, range(highest + 1), samples, "EPMC", start="free")


@pytest.mark.parametrize("amplitude", [1e-3, 1.0, 1e3])
def test_unilateral_spring(comm, amplitude):
    """w = 2 w1 w2/(w1 + w2) = 4/3 at any amplitude, no damping."""
    problem = unilateral(comm, 15)
    state = problem.state(solve_at(problem, amplitude))
    assert state["omega0"] == pytest.approx(4 / 3, abs=1e-7)
    assert abs(state["zeta"]) < ROUNDING


def test_unilateral_spring_converges_with_the_harmonics(comm):
    """Acceleration is continuous, its slope is not: the error of the frequency falls as H^-4 and faster."""
    errors = []
    for highest in (3, 7, 15, 31):
        problem = unilateral(comm, highest, 4096)
        errors.append(abs(problem.state(solve_at(problem, 1.0))["omega0"] - 4 / 3))
    assert (np.log2(np.divide(errors[:-1], errors[1:])) > 4.5).all()
    assert errors[-1] < 3e-9


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("method", ["CNM", "EPMC"])
def test_stuck_mode_is_linear(comm, law, method):
    """No slip, no lift-off: the linear stuck mode, undamped, at every amplitude below the threshold."""
    contact = pair(law, np.random.default_rng(0).standard_normal((3, 4)), normal_load=50.0)
    model = fw.Model(np.eye(4), chain(4), None, [contact], comm)
    start = fw.linear_modes(model, 1, "stuck")[0]
    problem = fw.NonlinearMode(model, fw.Harmonics([0, 1, 2], 64), method, 0, start)
    problem.preload(np.zeros(4), np.asarray(contact.B)[0] * 50.0)
    for amplitude in (1e-3, 0.1, 1.0):
        y = solve_at(problem, amplitude)
        state = problem.state(y)
        assert problem.diagnostics(y)["stick"] == 1
        assert state["omega0"] == pytest.approx(start.omega, rel=TIGHT) and abs(state["zeta"]) < 1e-11


#: Parameters at their ends, and which stiffness then holds: shares of (kn, kt).
EXTREMES = {
    "open everywhere": ({"normal_load": 0.0, "gap": 1e3}, (0, 0)),
    "no friction": ({"friction_coefficient": 0.0}, (1, 0)),
    "rough": ({"friction_coefficient": 1e3}, (1, 1)),
    "soft": ({"normal_stiffness": 1e-6, "tangential_stiffness": 1e-6}, (1, 1)),
    "stiff": ({"normal_stiffness": 1e5, "tangential_stiffness": 1e5, "normal_load": 1e6}, (1, 1)),
}


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("which", list(EXTREMES))
def test_extremes_of_the_parameters(comm, law, which):
    """Each keeps one state of contact, so the mode is that linear structure's, undamped."""
    changes, (normal, tangential) = EXTREMES[which]
    contact = pair(law, random_map(1, 4), **changes)
    kn, kt = (normal * contact.parameters["normal_stiffness"], tangential * contact.parameters["tangential_stiffness"])
    stiffness = chain(4, ground=0.1)
    expected = np.sqrt(np.linalg.eigvalsh(stiffness + (contact.B.T * [kn, kt, kt]) @ contact.B)[0])
    model = fw.Model(np.eye(4), stiffness, None, [contact], comm)
    start = fw.linear_modes(model, 1, "stuck")[0]
    problem = fw.NonlinearMode(model, fw.Harmonics([0, 1, 2, 3], 64), "EPMC", 0, start)
    problem.preload(np.zeros(4), contact.B[0] * contact.parameters["normal_load"])
    y = solve_at(problem, 0.2)
    assert problem.state(y)["omega0"] == pytest.approx(expected, rel=REPEATED)
    assert abs(problem.state(y)["zeta"]) < TIGHT and problem.diagnostics(y)["work"] < ROUNDING


@pytest.mark.parametrize("law", LAWS)
def test_contact_without_load_or_gap(comm, law):
    """N0 = 0: scale-free, like the unilateral spring: frequency and damping do not depend on the amplitude."""
    model = fw.Model(np.eye(4), chain(4, ground=0.1), None, [pair(law, random_map(1, 4), normal_load=0.0)], comm)
    problem = mode_problem(model, range(4), 64, "EPMC")
    found = [problem.state(solve_at(problem, a)) for a in (1e-3, 1.0, 1e3)]
    assert found[0]["zeta"] > 0.01
    for state in found[1:]:
        assert state["omega0"] == pytest.approx(found[0]["omega0"], rel=SOLVED)
        assert state["zeta"] == pytest.approx(found[0]["zeta"], rel=REPEATED)
