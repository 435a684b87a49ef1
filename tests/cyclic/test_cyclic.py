"""Travelling waves on one sector: direction, linear modes, contact that reaches the next sector, the full wheel."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse as sp
from models.core_models import filled, friction, solve_at, unknowns, whole
from models.cyclic_models import MASSES, SECTORS, blisk_stiffness, jenkins_chain, lumped_blisk, rich_sector
from petsc4py import PETSc
from tolerances import REPEATED, ROUNDING, SOLVED, TIGHT

import fretwave as fw

#: Frequencies [Hz] of the lumped blisk (Laxalde et al. 2007), by its 3 x 3 problems.
REFERENCE_HZ = {0: [88.26374399, 249.31165161, 619.34330474], 12: [195.67605066, 617.32579659, 2062.97568]}
#: The slider's two kinks fall between samples: relative error of kappa about 1 / samples^2.
SAMPLES, SAMPLED = 4096, 1e-6


def gyroscopic_chain(sectors: int, k=2.0, g=0.3) -> fw.Sector:
    """x_j'' + k x_j + g (x_{j+1}' - x_{j-1}') = 0: the two directions have different speeds."""
    return fw.Sector([[1.0]], [[k]], sectors, {0: [[0.0]], 1: [[g]], -1: [[-g]]})


def gyroscopic_omega(theta: float, k=2.0, g=0.3) -> float:
    """x_j = cos(w t - j theta): w^2 - 2 g sin(theta) w - k = 0, the forward wave (theta > 0) being the faster one."""
    return float(g * np.sin(theta) + np.sqrt((g * np.sin(theta)) ** 2 + k))


@pytest.mark.parametrize("nodal_diameter", [-3, 0, 1, 2, 4, 6])
def test_positive_nodal_diameters_are_forward_waves(comm, nodal_diameter):
    """Analytic wave: a system that tells the directions apart, x_j(t) = x_0(t - j theta / omega)."""
    with gyroscopic_chain(7).model(nodal_diameter, comm) as model:
        mode = fw.linear_modes(model, 1, "linearised")[0]
    assert mode.omega == pytest.approx(gyroscopic_omega(2 * np.pi * nodal_diameter / 7), rel=ROUNDING)
    assert mode.beta == pytest.approx(0, abs=ROUNDING)


@pytest.mark.parametrize("method", ["CNM", "EPMC"])
def test_nonlinear_modes_run_the_same_way(comm, method):
    """Without contact a branch stays on its linear wave, whose cosine and sine parts the sector delays by theta."""
    sector = gyroscopic_chain(5)
    with sector.model(2, comm) as model:
        mode = fw.linear_modes(model, 1, "linearised")[0]
        problem = fw.NonlinearMode(model, fw.Harmonics([1], 4), method, 0, mode)
        y = solve_at(problem, 1.0)
        assert problem.state(y)["omega"] == pytest.approx(gyroscopic_omega(0.8 * np.pi), rel=ROUNDING)
    t = np.linspace(0, 5, 40)
    wave = sector.wave([1.0], 2)[:, 0, None] * np.exp(1j * mode.omega * t)
    assert np.allclose(wave.real, np.cos(mode.omega * t - 0.8 * np.pi * np.arange(5)[:, None]), atol=1e-13)


def test_waves_of_the_sector_satisfy_the_wheel(comm):
    """Matrices of the wheel times the wave are the wave of the sector's forces, for a system without symmetry."""
    sector = rich_sector()
    with sector.wheel(comm) as wheel, sector.model(2, comm) as model:
        for order in (0, 1, 2, 5):
            q = np.random.default_rng(order).standard_normal((model.n_dof, 2)) @ [1, 1j]
            for name, position in (("K", 0), ("M", 2)):
                parts = getattr(sector, name).items()
                force = sum(np.exp(-2j * np.pi * 2 * order * k / 7) * (A @ q) for k, A in parts)
                around = sector.wave(q, 2, order).ravel()
                A = wheel._matrices[position]
                product = sum(
                    unit * whole(A * wheel.vector(part)) for part, unit in ((around.real, 1), (around.imag, 1j))
                )
                assert np.allclose(product, sector.wave(force, 2, order).ravel(), atol=1e-13)


@pytest.mark.parametrize("nodal_diameter", range(SECTORS))
def test_lumped_blisk_has_its_closed_form_frequencies(comm, nodal_diameter):
    """Every nodal diameter from its 3 x 3 problem (Laxalde et al. 2007); no mode twice, none missing."""
    with lumped_blisk().model(nodal_diameter, comm) as model:
        modes = fw.linear_modes(model, 5)
    expected = np.sqrt(scipy.linalg.eigvalsh(blisk_stiffness(nodal_diameter), np.diag(MASSES)))
    assert [mode.omega for mode in modes] == pytest.approx(expected, rel=SOLVED)
    if nodal_diameter in REFERENCE_HZ:
        assert [mode.frequency_hz for mode in modes] == pytest.approx(REFERENCE_HZ[nodal_diameter], rel=REPEATED)


@pytest.mark.parametrize("state", ["free", "stuck"])
def test_modes_of_all_nodal_diameters_are_those_of_the_wheel(comm, state):
    """Contact ahead, elastic (Jenkins) and rigid (regularised Coulomb) while stuck."""
    ahead = {0: [[0, -1.0, 0]], 1: [[0, 1.0, 0]]}
    jenkins = fw.Contact("jenkins", ahead, {"tangential_stiffness": 3e6, "friction_limit": 1.0})
    sector = lumped_blisk(6, [jenkins, friction({0: [[0, 0, -1.0]], 1: [[0, 0, 0.5]]})])
    found = []
    for nodal_diameter in range(6):
        with sector.model(nodal_diameter, comm) as model:
            found += [mode.omega for mode in fw.linear_modes(model, 3, state)]
    with sector.wheel(comm) as wheel:
        expected = [mode.omega for mode in fw.linear_modes(wheel, 18, state)]
    assert len(found) == len(expected) == (18 if state == "free" else 12)
    assert sorted(found) == pytest.approx(expected, rel=SOLVED)


def test_shapes_of_a_travelling_wave_are_modes_of_the_wheel(comm):
    """K phi = w^2 M phi around the wheel, unit modal mass on the sector, modes of one nodal diameter orthogonal."""
    sector = rich_sector()
    with sector.wheel(comm) as wheel, sector.model(3, comm) as model:
        modes = fw.linear_modes(model, 3, "free")
        phi = np.array([sector.wave(mode.shape + 1j * mode.imaginary, 3).ravel() for mode in modes]).T
        K, M = (np.column_stack([whole(A * wheel.vector(e)) for e in np.eye(21)]) for A in wheel._matrices[::2])
    assert np.allclose(K @ phi, M @ phi * [mode.omega**2 for mode in modes], atol=SOLVED)
    assert np.allclose(phi.conj().T @ M @ phi / 7, np.eye(3), atol=TIGHT)


@pytest.mark.parametrize("nodal_diameter", [0, 2, 5])
def test_damped_waves_with_contact_tangents(comm, nodal_diameter):
    """lambda^2 M + lambda C + K with the tangents at rest, against a dense complex eigenproblem; ND 2 and 5 differ."""
    sector = rich_sector()
    theta = 2 * np.pi * nodal_diameter / 7

    def around(parts):
        return sum(np.exp(-1j * k * theta) * np.asarray(A) for k, A in parts.items())

    K, C, M = (around(getattr(sector, name)) for name in "KCM")
    for contact in sector.contacts:
        zero = np.zeros((1, contact.components, 1))
        by_u, by_v = (np.reshape(t, (contact.components,) * 2) for t in contact.law.tangent(zero, zero))
        pairs = np.eye(len(contact.B[0]) // contact.components)
        B = around(contact.B)
        K = K + B.conj().T @ np.kron(pairs, np.diag(np.diag(by_u))) @ B  # modes take a law's diagonal
        C = C + B.conj().T @ np.kron(pairs, np.diag(np.diag(by_v))) @ B
    zero, one = np.zeros((3, 3)), np.eye(3)
    found = scipy.linalg.eigvals(np.block([[zero, one], [-K, -C]]), scipy.linalg.block_diag(one, M))
    expected = sorted((v for v in found if v.imag > 0), key=lambda v: v.imag)
    with sector.model(nodal_diameter, comm) as model:
        modes = fw.linear_modes(model, 3, "linearised")
    assert np.allclose([complex(-m.beta, m.omega) for m in modes], expected, rtol=TIGHT)
    for mode in modes:
        value, phi = complex(-mode.beta, mode.omega), mode.shape + 1j * mode.imaginary
        assert np.linalg.norm((value**2 * M + value * C + K) @ phi) < SOLVED * np.linalg.norm(phi)


def kappa(a: float) -> complex:
    """Complex stiffness of a Jenkins element (kt = R = 1) at relative amplitude a > 1."""
    th = np.arccos(1 - 2 / a)
    return complex((th - np.sin(2 * th) / 2) / np.pi, 4 / (np.pi * a) * (1 - 1 / a))


@pytest.mark.parametrize(("sectors", "nodal_diameter"), [(5, 1), (5, 2), (5, 4), (24, 4), (24, 12), (24, 20)])
@pytest.mark.parametrize("method", ["CNM", "EPMC"])
def test_travelling_wave_on_a_chain_has_its_closed_form(comm, sectors, nodal_diameter, method):
    """k_eff = k + 4 sin^2(pi ND / N) kappa(2 a sin(pi ND / N)), then its single-dof formulas."""
    sine = np.sin(np.pi * nodal_diameter / sectors)
    amplitude = 1.2 / sine
    stiffness = 1 + 4 * sine**2 * kappa(2 * amplitude * sine)
    with jenkins_chain(sectors).model(nodal_diameter, comm) as model:
        stuck = fw.linear_modes(model, 1, "stuck")[0]
        problem = fw.NonlinearMode(model, fw.Harmonics([1], SAMPLES), method, 0, stuck)
        state = problem.state(solve_at(problem, amplitude))
    assert stuck.omega == pytest.approx(np.sqrt(1 + 4 * sine**2), rel=ROUNDING)
    if method == "EPMC":
        omega0, zeta = np.sqrt(stiffness.real), stiffness.imag / (2 * stiffness.real)
    else:
        omega0, zeta = np.sqrt(abs(stiffness)), np.sin(np.angle(stiffness) / 2)
    assert state["omega0"] == pytest.approx(omega0, rel=SAMPLED)
    assert state["zeta"] == pytest.approx(zeta, rel=SAMPLED)


def on_the_wheel(sector, nodal_diameter, problem, y, orders) -> np.ndarray | None:
    """Scaled unknowns of the wheel from those of a sector's wave, on every rank. Collective."""
    values, blocks = whole(y), problem.harmonics.block_size
    n = problem.model.n_dof
    Q = values[: n * blocks].reshape(n, blocks)
    around, column = np.zeros((sector.sectors * n, blocks)), 0
    for order in orders:
        wave = sector.wave(Q[:, column] - (1j * Q[:, column + 1] if order else 0), nodal_diameter, order).ravel()
        around[:, column] = wave.real
        if order:
            around[:, column + 1] = -wave.imag
        column += 2 if order else 1
    return np.concatenate([around.ravel(), values[n * blocks :]])


def branch(problem, start, stop, report_at):
    """Reported points of a branch. Collective."""
    followed = fw.Continuation(problem, problem.initial(start), stop, report_at=report_at)
    points = [p for p in followed if p.event == "report"]
    assert followed.converged, followed.reason
    return points


def shroud() -> fw.Contact:
    """Tips that rub on those of the next blades."""
    ahead = {0: [[0, 0, -1.0]], 1: [[0, 0, 1.0]]}
    return fw.Contact("jenkins", ahead, {"tangential_stiffness": 1e5, "friction_limit": 10.0}, "shroud")


@pytest.mark.parametrize("method", ["CNM", "EPMC"])
def test_a_sectors_solution_solves_the_full_wheel(comm, method):
    """A branch from stick to slip, odd harmonics to 5 of which the third stands still (3 x 2 mod 6 = 0)."""
    orders = [1, 3, 5]
    rim = fw.Contact("jenkins", [[1.0, 0, 0]], {"tangential_stiffness": 5e5, "friction_limit": 2.0}, "rim")
    sector = lumped_blisk(6, [shroud(), rim])
    with sector.wheel(comm) as wheel, sector.model(2, comm) as model:
        stuck = fw.linear_modes(model, 1)[0]
        h = fw.Harmonics(orders, 240)  # a multiple of the sectors: all see the slider's kinks between the same samples
        problem = fw.NonlinearMode(model, h, method, 2, stuck)
        shape = sector.wave(stuck.shape + 1j * stuck.imaginary, 2).ravel()
        around = fw.NonlinearMode(wheel, h, method, 2, fw.LinearMode(stuck.omega, 0, shape.real, shape.imag))
        points = branch(problem, 1e-5, (1e-5, 1e-2), [2e-5, 1e-4, 1.3e-4, 1e-3])
        zeta = [problem.state(p.y)["zeta"] for p in points]
        assert abs(zeta[0]) < SOLVED and max(zeta) > 0.01
        for point in points:
            r = whole(around.residual(unknowns(around, on_the_wheel(sector, 2, problem, point.y, orders))))
            assert np.abs(r).max() < SOLVED


@pytest.mark.parametrize("nodal_diameter", [1, 3, -2])
def test_residual_of_a_sector_is_that_of_the_wheel(comm, nodal_diameter):
    """Any motion, mean and even harmonics, contacts of one and three components that reach both sides."""
    sector, orders = rich_sector(), [0, 1, 2, 3]
    n = 3
    with sector.wheel(comm) as wheel, sector.model(nodal_diameter, comm) as model:
        h = fw.Harmonics(orders, 32)
        start = fw.LinearMode(1.3, 0.0, np.ones(n), np.zeros(n))
        problem = fw.NonlinearMode(model, h, "CNM", 1, start)
        around = fw.NonlinearMode(wheel, h, "CNM", 1, fw.LinearMode(1.3, 0.0, np.ones(7 * n), np.zeros(7 * n)))
        values = np.random.default_rng(3).standard_normal(n * h.block_size + 3)
        y = unknowns(problem, 0.3 * values)
        r = problem.core.equations()
        problem.core.residual(y, r)
        force = filled(problem.core.unknowns(), np.concatenate([whole(r)[: n * h.block_size], np.zeros(3)]))
        expected = on_the_wheel(sector, nodal_diameter, problem, force, orders)[: 7 * n * h.block_size]
        wheel_y = unknowns(around, on_the_wheel(sector, nodal_diameter, problem, y, orders))
        found = whole(around.residual(wheel_y))[: 7 * n * h.block_size]
        assert np.allclose(found * wheel_scale(sector, n), expected, rtol=0, atol=ROUNDING * np.abs(expected).max())


def wheel_scale(sector, n) -> float:
    """Residuals are measured in w^2 phi^T M phi / phi^T phi of each model (the sector's mass: its own part alone)."""
    one, own = np.ones(n), sp.csr_matrix(sector.M[0])
    total = sum(one @ (np.asarray(A) @ one) for A in sector.M.values())
    return float(total / (one @ (own @ one)))


@pytest.mark.ranks(1, 2, 3)
@pytest.mark.parametrize("method", ["CNM", "EPMC"])
def test_both_routes_find_the_same_wave(comm, method):
    """Direct and Krylov with phases in the linear terms and in the contact, of which two pairs feel each other."""
    rim = fw.Contact("jenkins", [[1.0, 0, 0]], {"tangential_stiffness": 5e5, "friction_limit": 20.0}, "rim")
    sector = lumped_blisk(24, [shroud(), rim])
    found = {}
    for route in ("direct", "krylov"):
        PETSc.Options()[f"{route}_route"] = route
        with sector.model(4, comm) as model:
            problem = fw.NonlinearMode(
                model, fw.Harmonics([1, 3, 5], 128), method, 2, fw.linear_modes(model, 1)[0], f"{route}_"
            )
            found[route] = [problem.state(p.y) for p in branch(problem, 5e-5, (5e-5, 1e-2), [1e-4, 2e-4, 1e-3])]
    assert found["direct"][1]["zeta"] > 0.01
    for direct, krylov in zip(found["direct"], found["krylov"]):
        assert krylov["omega"] == pytest.approx(direct["omega"], rel=SOLVED)
        assert krylov["beta"] == pytest.approx(direct["beta"], rel=SOLVED, abs=SOLVED * direct["omega"])
