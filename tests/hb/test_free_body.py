"""A body that friction alone holds: once all of its contacts slip through the period nothing holds its mean."""

from __future__ import annotations

import numpy as np
import pytest
from models.core_models import options
from petsc4py import PETSc
from tolerances import TIGHT

import fretwave as fw

pytestmark = pytest.mark.ranks(1)

M = np.diag([1.0, 0.5, 0.05])
K = np.array([[640.0, -40.0, 0.0], [-40.0, 40.0, 0.0], [0.0, 0.0, 0.0]])
SLIDERS = {"tangential_stiffness": [40.0, 15.0], "friction_limit": [2.0, 0.7]}
#: The third mass lies between the second and the ground.
BETWEEN = np.array([[0.0, 1.0, -1.0], [0.0, 0.0, 1.0]])


def mode(orders: list[int], unit: float) -> fw.NonlinearMode:
    """In a unit of force that is another."""
    given = {name: [unit * value for value in values] for name, values in SLIDERS.items()}
    model = fw.Model(unit * M, unit * K, None, [fw.Contact("jenkins", BETWEEN, given)])
    return fw.NonlinearMode(model, fw.Harmonics(orders, 256), "CNM", 0)


def with_even_harmonics(problem: fw.NonlinearMode, odd: PETSc.Vec) -> PETSc.Vec:
    """Unknowns of orders 1, 3, 5 among those of 0 to 5."""
    out, values = problem.initial(0.01), odd.getArray()
    blocks = np.zeros((len(M), 11))
    blocks[:, [1, 2, 5, 6, 9, 10]] = values[: 6 * len(M)].reshape(len(M), 6)
    out.setArray(np.concatenate([blocks.ravel(), values[6 * len(M) :]]))
    return out


@pytest.mark.parametrize("route", ["direct", "krylov"])
@pytest.mark.parametrize("unit", [1.0, 1e9])
def test_holding_the_mean_leaves_errors_as_they_are(route: str, unit: float) -> None:
    """The motion is odd: with the mean, which nothing holds, and even harmonics it has the same errors.

    What a singular system does to them otherwise, cases/robustness/ranks.py sees (lap_joint).
    """
    odd, full = mode([1, 3, 5], unit), mode(list(range(6)), unit)
    with options(mode_error_route=route, mode_error_tangent_ksp_rtol=1e-10):
        for point in fw.Continuation(odd, odd.initial(0.01), (0.01, 3.0)):
            if point.parameter > 0.3:
                break
        y, tangent = (with_even_harmonics(full, v) for v in (point.y, point.tangent))
        assert full.residual(y).norm() < TIGHT
        found, expected = full.errors(y, tangent), odd.errors(point.y, point.tangent)
    assert expected["zeta_error"] > 1e-6
    for name in ("omega_error", "zeta_error"):
        assert found[name] == pytest.approx(expected[name], rel=1e-6), name


#: A friction force along x of two masses s that a stiff spring joins, and nothing else; the normal force swings with z,
#: which follows the first mass out of phase.
N0, MU, KN, KT = 1.0, 0.3, 50.0, 40.0
PLATE = np.array([[1.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])


def plate(rounding: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """M, C, K of x, two masses of the plate, z; its spring is rounded, as printed matrices are."""
    K = np.diag([100.0, 3e3, 3e3 * (1 + rounding), 110.0])
    K[1, 2] = K[2, 1] = -3e3
    K[0, 3] = K[3, 0] = 8.0
    return np.diag([1.0, 0.05, 0.05, 1.0]), np.diag([0.0, 0.0, 0.0, 2.0]), K


def onset() -> float:
    """Amplitude of x at which the pair first slips.

    The slider w stays off the middle of the motion then, and nothing bears the mean force kt w: |u| <= R at all times,
    u = a Re(phi_u e^{i t}), R = R0 + r a Re(phi_n e^{i t}), is a |phi_u +- r phi_n| <= R0 with R0 = mu N/kt of the
    normal force at rest, r = mu kn/kt; phi of the damped mode in stick.
    """
    M, C, K = plate(0.0)
    K = K + PLATE.T @ np.diag([KT, KN]) @ PLATE
    inverse, one = np.linalg.inv(M), np.eye(4)
    values, vectors = np.linalg.eig(np.block([[0 * one, one], [-inverse @ K, -inverse @ C]]))
    phi = vectors[:4, np.argmin(np.where(values.imag > 0, values.imag, np.inf))]
    u, n = PLATE @ (phi / phi[0])
    r = MU * KN / KT
    normal = N0 + KN * np.linalg.solve(K, -N0 * PLATE[1])[3]
    return float(MU * normal / KT / max(abs(u - r * n), abs(u + r * n)))


def test_a_plate_that_creeps_on_ends_the_branch() -> None:
    """Once the pair slips its mean force pushes the plate on, period by period: no motion is periodic.

    Before, the plate moved by 1e8 to where the rounding of its spring bears that force, and the branch went on there.
    """
    M, C, K = plate(1e-13)
    given = {"friction_coefficient": MU, "normal_stiffness": KN, "tangential_stiffness": KT, "normal_load": N0}
    model = fw.Model(M, K, C, [fw.Contact("coulomb_2d", PLATE[::-1], given)])
    branch = fw.follow(fw.NonlinearMode(model, fw.Harmonics(range(6), 256), "CNM", 0), 1e-3, 1.0)
    assert "mean position is free" in branch.reason
    assert branch["amplitude"][-1] == pytest.approx(onset(), rel=2e-4)
    assert all(np.abs(branch.coefficients(k)[..., 0]).max() < 0.01 for k in range(len(branch["amplitude"])))


def test_a_soft_spring_holds_a_plate_that_creeps() -> None:
    """However far: 1e-12 of the plate's own stiffness bears the mean force, which moves the plate by ten motions."""
    M, C, K = plate(0.0)
    stiff, soft = 1e10, 1e-2
    K[1, 1], K[2, 2], K[1, 2], K[2, 1] = stiff, stiff + soft, -stiff, -stiff
    given = {"friction_coefficient": MU, "normal_stiffness": KN, "tangential_stiffness": KT, "normal_load": N0}
    model = fw.Model(M, K, C, [fw.Contact("coulomb_2d", PLATE[::-1], given)])
    problem = fw.NonlinearMode(model, fw.Harmonics(range(6), 256), "CNM", 0)
    branch = fw.follow(problem, 1e-3, 1.0)
    assert branch.converged and branch["amplitude"][-1] == pytest.approx(1.0)
    moved = branch.coefficients(len(branch["amplitude"]) - 1)[:, 0].real
    assert moved[2] > 10.0
    assert 100.0 * moved[0] + 8.0 * moved[3] == pytest.approx(-soft * moved[2], rel=1e-3)  # friction's two ends


def test_closed_contact_holds_a_body_far_from_rest() -> None:
    """A body of which a static load closes a stop, 1e5 motions from where the stop is free: a linear response."""
    M, C, K = np.eye(2), 0.5 * np.eye(2), 3e3 * np.array([[1.0, -1.0], [-1.0, 1.0]]) + np.diag([1e-9, 0.0])
    stop, push = np.diag([50.0, 0.0]), np.array([0.0, 1e-4])
    contact = fw.Contact("unilateral_spring", np.array([[1.0, 0.0]]), {"normal_stiffness": [50.0], "gap": [0.0]})
    model = fw.Model(M, K, C, [contact])
    shape = fw.linear_modes(fw.Model(M, K + stop, C), 1)[0]
    loads = {0: np.array([0.0, 100.0]), 1: push}
    branch = fw.follow(fw.ForcedResponse(model, fw.Harmonics(range(4), 256), loads, 1.0, 1, shape), 3.0, 8.0)
    assert branch.converged
    for k, omega in enumerate(branch["omega"]):
        q = branch.coefficients(k)
        expected = np.linalg.solve(K + stop - omega**2 * M + 1j * omega * C, push)
        assert q[0, 0] == pytest.approx(2.0)
        assert np.hypot(q[1, 1], q[1, 2]) == pytest.approx(abs(expected[1]), rel=1e-8)


@pytest.mark.parametrize("link, share", [(3e3, 1e-9), (30.0, 1e-7), (3e4, 1e-10), (1e5, 3e-11)])
def test_a_spring_bears_what_friction_pushes_by_however_stiff_the_plate(link: float, share: float) -> None:
    """The same spring to the ground, 3e-6: friction's part of the tangent, which is not symmetric, hides none of it."""
    M, C, K = plate(0.0)
    K[1, 1], K[2, 2], K[1, 2], K[2, 1] = link, link * (1 + share), -link, -link
    given = {"friction_coefficient": MU, "normal_stiffness": KN, "tangential_stiffness": KT, "normal_load": N0}
    model = fw.Model(M, K, C, [fw.Contact("coulomb_2d", PLATE[::-1], given)])
    branch = fw.follow(fw.NonlinearMode(model, fw.Harmonics(range(6), 256), "CNM", 0), 1e-3, 1.0)
    assert branch.converged and branch["amplitude"][-1] == pytest.approx(1.0)


@pytest.mark.parametrize("K", [[[1.0, 0.0], [0.0, -1.0]], [[0.0, 1.0], [-1.0, 0.0]]])
def test_a_static_shift_without_strain_energy_is_borne(K: list[list[float]]) -> None:
    """x . K x is zero of what a saddle or circulatory forces hold: a linear response beside a shift 1e5 times it."""
    contact = fw.Contact("unilateral_spring", np.array([[1.0, 0.0]]), {"normal_stiffness": [50.0], "gap": [1e3]})
    model = fw.Model(np.eye(2), np.array(K), 0.5 * np.eye(2), [contact])
    reference = fw.linear_modes(fw.Model(np.eye(2), np.eye(2)), 1)[0]
    static, push = np.array([1.0, 1.0]), np.array([1e-5, 0.0])
    problem = fw.ForcedResponse(model, fw.Harmonics(range(4), 64), {0: static, 1: push}, 1.0, 0, reference)
    branch = fw.follow(problem, 0.5, 2.0)
    assert branch.converged
    for k, omega in enumerate(branch["omega"]):
        q = branch.coefficients(k)
        expected = np.linalg.solve(K - omega**2 * np.eye(2) + 0.5j * omega * np.eye(2), push)
        assert q[:, 0] == pytest.approx(np.linalg.solve(K, static))
        assert np.hypot(q[0, 1], q[0, 2]) == pytest.approx(abs(expected[0]), rel=1e-8)
