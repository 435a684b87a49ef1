"""Stops and cubic springs: closed forms, derivatives against differences, what they say of a pair, and cases."""

from __future__ import annotations

import numpy as np
import pytest
from models.core_models import UnilateralLaw, chain, dense, everywhere, single_dof, solve_at, unknowns, whole
from scipy.special import ellipk
from tolerances import LAST_DIGITS, REPEATED, ROUNDING, SOLVED

import fretwave as fw

M, K, K3, KN = 2.0, 3.0, 5.0, 40.0
STEP = 1e-3


def duffing(comm, k3=K3):
    return single_dof(comm, M, K, law=fw.Contact("cubic_spring", [[1.0]], {"cubic_stiffness": k3}))


def stop(comm, gap=0.0, k=K):
    return single_dof(comm, M, k, law=fw.Contact("unilateral_spring", [[1.0]], {"normal_stiffness": KN, "gap": gap}))


@pytest.mark.parametrize("k3", [K3, -1.0])
def test_duffing_with_one_harmonic(comm, k3):
    """omega^2 = omega0^2 + 3/4 k3 a^2 / m."""
    with duffing(comm, k3) as model:
        branch = fw.follow(fw.NonlinearMode(model, fw.Harmonics([1], 32)), 1e-3, 0.9, report_at=[0.3, 0.6])
    np.testing.assert_allclose(branch["omega"] ** 2, K / M + 0.75 * k3 * branch["amplitude"] ** 2 / M, rtol=SOLVED)
    assert np.abs(branch["zeta"]).max() < ROUNDING and (branch["stick"] == 1).all()


@pytest.mark.ranks(1)
def test_duffing_with_many_harmonics_is_the_elliptic_integral(comm):
    """omega = pi sqrt(omega0^2 + k3 A^2 / m) / (2 K(mu)), mu = k3 A^2 / (2 (k + k3 A^2)), A the largest x."""
    with duffing(comm) as model:
        problem = fw.NonlinearMode(model, fw.Harmonics(range(1, 16, 2), 128))
        y = solve_at(problem, 1.0)
        A, omega = np.abs(problem.dof_period(y, 4096)["x"]).max(), problem.state(y)["omega"]
    mu = K3 * A**2 / (2 * (K + K3 * A**2))
    assert omega == pytest.approx(np.pi * np.sqrt((K + K3 * A**2) / M) / (2 * ellipk(mu)), rel=SOLVED)


@pytest.mark.ranks(1)
def test_stop_without_gap_is_bilinear(comm):
    """Half a period each way, at any amplitude: 2 / omega = 1 / omega_open + 1 / omega_closed."""
    with stop(comm) as model:
        start = fw.linear_modes(model, 1, "free")[0]
        problem = fw.NonlinearMode(model, fw.Harmonics(range(32), 1024), "EPMC", 0, start)
        branch = fw.follow(problem, 0.1, 1.0)
    slow, fast = np.sqrt(K / M), np.sqrt((K + KN) / M)
    assert branch.converged, branch.reason
    np.testing.assert_allclose(branch["omega"], 2 * slow * fast / (slow + fast), rtol=2e-5)


@pytest.mark.parametrize("load", [-2.0, 1.1, 1.3, 50.0])
def test_static_load_on_a_stop(comm, load):
    """K x + KN max(0, x - gap) = P, gap 0.4."""
    with stop(comm, 0.4) as model:
        rest = fw.static_preload(model, [load], fw.linear_modes(model, 1, "free")[0])
    closed = load > K * 0.4
    assert rest.displacement == pytest.approx((load + KN * 0.4) / (K + KN) if closed else load / K, rel=ROUNDING)
    assert (rest.stick, rest.open) == (closed, not closed)


def test_linear_modes_have_the_stop_as_it_is_at_rest(comm):
    """Open with a gap, closed by an interference, closed by a load."""
    with stop(comm, 0.1) as model:
        assert fw.linear_modes(model, 1)[0].omega == pytest.approx(np.sqrt(K / M), rel=SOLVED)
        fw.static_preload(model, [3.0])
        assert fw.linear_modes(model, 1)[0].omega == pytest.approx(np.sqrt((K + KN) / M), rel=SOLVED)
    with stop(comm, -0.1) as model:
        assert fw.linear_modes(model, 1)[0].omega == pytest.approx(np.sqrt((K + KN) / M), rel=SOLVED)


def test_a_cubic_spring_under_load_is_stiff_by_its_tangent(comm):
    """K x + k3 x^3 = P; omega^2 = (K + 3 k3 x^2) / M."""
    with duffing(comm) as model:
        x = fw.static_preload(model, [8.0]).displacement[0]
        assert K * x + K3 * x**3 == pytest.approx(8.0, rel=ROUNDING)
        assert fw.linear_modes(model, 1)[0].omega == pytest.approx(np.sqrt((K + 3 * K3 * x**2) / M), rel=SOLVED)


def test_a_stop_says_where_it_is_open_and_how_far(comm):
    with stop(comm, 0.3) as model:
        problem = fw.NonlinearMode(model, fw.Harmonics([0, 1], 64))
        y = unknowns(problem, np.array([0.0, 1.0, 0.0, 0.0, 1.0, 0.0]))
        told = everywhere(problem, problem.contact_history(y))[0]
    u = np.cos(2 * np.pi * np.arange(64) / 64)
    np.testing.assert_array_equal(told["status"][:, 0], np.where(u > 0.3, 0, 2))
    np.testing.assert_allclose(told["gap"][:, 0], np.maximum(0.3 - u, 0.0), atol=LAST_DIGITS)
    np.testing.assert_allclose(told["f"][:, 0, 0], KN * np.maximum(u - 0.3, 0.0), atol=ROUNDING)


def test_a_stop_is_the_law_written_in_python(comm):
    """Which is sampled: their distance falls as N_t^-2."""

    def residual(contact, samples):
        with single_dof(comm, M, K, law=contact) as model:
            start = fw.linear_modes(model, 1, "free")[0]
            problem = fw.NonlinearMode(model, fw.Harmonics([0, 1, 2], samples), start=start)
            return whole(problem.residual(unknowns(problem, np.array([0.1, 1, 0, 0.2, -0.1, 0, 1.1, -0.3]))))

    exact = residual(fw.Contact("unilateral_spring", [[1.0]], {"normal_stiffness": KN}), 6)
    for samples in (64, 1024, 16384):
        sampled = residual(fw.Contact(UnilateralLaw(KN), [[1.0]]), samples)
        np.testing.assert_allclose(exact, sampled, rtol=0, atol=KN / samples**2)


@pytest.mark.ranks(1, 2, 3)
@pytest.mark.parametrize(
    "law, parameters",
    [
        ("cubic_spring", {"cubic_stiffness": 0.7}),
        ("unilateral_spring", {"normal_stiffness": 2.0, "gap": [0.05, -0.2, 0.3]}),
    ],
)
def test_derivatives(comm, law, parameters):
    with fw.Model(np.eye(3), chain(3), None, [fw.Contact(law, np.eye(3), parameters)], comm) as model:
        problem = fw.NonlinearMode(model, fw.Harmonics([0, 1, 2], 32), start=fw.linear_modes(model, 1, "free")[0])
        rng = np.random.default_rng(1)
        y = np.concatenate([0.5 * rng.standard_normal(15), [0.06, 1.1, -0.4]])

        def residual(at):
            return whole(problem.residual(unknowns(problem, at)))

        weights = {-2: 1 / 12, -1: -2 / 3, 1: 2 / 3, 2: -1 / 12}
        expected = np.column_stack(
            [sum(w * residual(y + k * STEP * e) for k, w in weights.items()) / STEP for e in np.eye(len(y))]
        )
        J = dense(problem.jacobian(unknowns(problem, y)))
        assert np.allclose(J, expected, rtol=0, atol=REPEATED * np.abs(expected).max())


@pytest.mark.parametrize(
    "law, parameters, words",
    [
        ("unilateral_spring", {"normal_stiffness": 0.0}, "out of bounds"),
        ("unilateral_spring", {}, "missing"),
        ("cubic_spring", {"cubic_stiffness": np.inf}, "out of bounds"),
        ("cubic_spring", {"stiffness": 1.0}, "unknown law parameter"),
    ],
)
def test_wrong_parameters_are_refused(comm, law, parameters, words):
    with pytest.raises(fw.InputError, match=words):
        single_dof(comm, law=fw.Contact(law, [[1.0]], parameters))
