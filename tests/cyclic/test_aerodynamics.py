"""Influence coefficients: transform over the sectors, waves and wheel, and limit cycles against the closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg
from models.cyclic_models import chain_crossings, jenkins_chain, rich_sector
from tolerances import LAST_BIT, REPEATED

import fretwave as fw
from fretwave.cyclic.aerodynamics import Aerodynamics, period_of

SECTORS = 5


def flow_of_chain() -> Aerodynamics:
    """Feeds forward waves; stiffens, and couples neighbours unlike in both directions."""
    return Aerodynamics({0: 0.02 - 0.06j, 1: -0.1 + 0.02j, -1: 0.12 + 0.05j, 2: 0.01 - 0.005j}, 1.7)


def located(model: fw.Model, comm, method: str = "CNM", start=None, avoid=None, orders=(1,)) -> tuple[list, list]:
    """Zeros of the damping of a branch from stick to slip, and its damping."""
    start = start or fw.linear_modes(jenkins_chain(SECTORS).model(model.nodal_diameter, comm), 1)[0]
    problem = fw.NonlinearMode(model, fw.Harmonics(orders, 960), method, 0, start, avoid=avoid)
    branch = fw.Continuation(problem, problem.initial(0.05), (0.05, 100.0), fw.StepControl(maximum=0.1))
    found, damping = [], []
    for point in branch:
        state = problem.state(point.y)
        damping.append(state["zeta"])
        if point.event == "zero_damping":
            found.append(state)
    assert branch.converged, branch.reason
    return found, damping


@pytest.mark.parametrize("method", ["CNM", "EPMC"])
def test_limit_cycles_of_the_chain_are_those_of_the_closed_form(method, comm):
    """Where the damping is zero, CNM and EPMC are the same motion."""
    flow, cycles = flow_of_chain(), {}
    sector = replace(jenkins_chain(SECTORS), aerodynamics=flow)
    for diameters in (1, -1, 2, -2):
        expected = chain_crossings(flow, diameters, SECTORS)
        found, zeta = located(sector.model(diameters, comm), comm, method)
        assert [(s["amplitude"], s["omega"]) for s in found] == [pytest.approx(pair, rel=1e-5) for pair in expected]
        cycles[diameters] = (len(found), np.sign(zeta[0]))
    assert cycles == {1: (2, -1), -1: (0, 1), 2: (1, 1), -2: (0, 1)}


def test_limit_cycle_of_one_sector_is_that_of_the_whole_wheel(comm):
    """Unfolded from the wave that runs the other way, which the flow damps."""
    sector = replace(jenkins_chain(SECTORS), aerodynamics=flow_of_chain())
    alone, _ = located(sector.model(1, comm), comm)
    start = fw.linear_modes(jenkins_chain(SECTORS).model(1, comm), 1)[0]
    around = sector.around(start, 1)
    whole, _ = located(sector.wheel(comm), comm, start=around, avoid=around.shape - 1j * around.imaginary)
    assert len(alone) == len(whole) == 2
    for one, all_sectors in zip(alone, whole):
        for key in ("amplitude", "omega"):
            # samples are a multiple of the sectors: all see the slider's kinks between the same ones
            assert all_sectors[key] == pytest.approx(one[key], rel=REPEATED), key


def eigenvalues(M: np.ndarray, K: np.ndarray, C: np.ndarray) -> np.ndarray:
    """s of (K + s C + s^2 M) q = 0."""
    zero, one = np.zeros_like(M), np.eye(len(M))
    return np.linalg.eigvals(np.block([[zero, one], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]]))


@pytest.mark.parametrize("dof", [None, 1])
def test_flow_on_a_wheel_is_the_sum_over_its_blades(dof, comm):
    """Damped modes of a mistuned wheel against a dense eigenproblem with the force on each blade written out."""
    sectors, omega, rng = 5, 1.3, np.random.default_rng(5)
    flow = Aerodynamics({0: -0.02 - 0.09j, 1: 0.05 + 0.02j, -1: 0.01 - 0.03j, 2: 0.004 + 0.01j}, omega, dof)
    plain = replace(rich_sector(sectors), contacts=())
    changes = {"K": [np.diag(0.2 * rng.standard_normal(3)) for _ in range(sectors)]}
    whole = plain.structure.around()
    M, K, C = (whole.own(letter).toarray() for letter in "MKC")
    K = K + scipy.linalg.block_diag(*changes["K"])
    force = np.zeros_like(M, dtype=complex)
    for j in range(sectors):
        for k, L in flow.influence.items():
            rows, there = slice(3 * j, 3 * j + 3), (j + k) % sectors
            if dof is None:
                force[rows] += L * M[3 * there : 3 * there + 3]
            else:
                force[3 * j + dof, 3 * there + dof] += L
    expected = eigenvalues(M, K - force.real, C - force.imag / omega)
    with replace(plain, aerodynamics=flow).wheel(comm, changes) as model:
        for mode in fw.linear_modes(model, 4, "linearised"):
            assert abs(expected - complex(-mode.beta, mode.omega)).min() < REPEATED * mode.omega


@pytest.mark.parametrize("sectors", [5, 6])
def test_damping_by_nodal_diameter_comes_back_from_its_influence_coefficients(sectors, comm):
    ratios = {d: 1e-4 * d - 2e-4 for d in range(-((sectors - 1) // 2), sectors // 2 + 1)}
    for d, ratio in ratios.items():
        assert Aerodynamics.from_damping(ratios, sectors, 1.9).wave(d, sectors) == pytest.approx(-2j * ratio * 1.9**2)
    plain = fw.Sector([[2.0]], {0: [[3.0]], 1: [[-1.0]], -1: [[-1.0]]}, sectors)
    for d in (0, 1, -2):
        omega = np.sqrt((1 + 4 * np.sin(np.pi * d / sectors) ** 2) / 2)
        flow = Aerodynamics.from_damping(ratios, sectors, omega)
        with replace(plain, aerodynamics=flow).model(d, comm) as model:
            mode = fw.linear_modes(model, 1, "linearised")[0]
        assert mode.zeta == pytest.approx(ratios[d], rel=1e-3)  # to second order in the ratio
        assert mode.omega == pytest.approx(omega, rel=1e-6)


@pytest.mark.ranks(1)
def test_terms_of_blades_that_move_alike_are_one():
    """All harmonics of a wave of 2 nodal diameters on 6 sectors repeat after 3 of them: exact, with fewer terms."""
    flow = Aerodynamics.from_damping({d: 0.01 * d + 0.003 * d**2 for d in range(-2, 4)}, 6, 1.3)
    assert period_of(2, 6) == 3 and period_of(0, 6) == 1 and period_of(5, 6) == 6 and period_of(-4, 36) == 9
    whole, fewer = flow.terms(np.eye(2)), flow.terms(np.eye(2), 3)
    assert {len(parts) for parts in fewer.values()} <= {2, 3} and len(whole["C"]) > 3
    for letter in "KC":
        for n in range(7):
            factors = [
                sum(np.exp(-2j * np.pi * k * n * 2 / 6) * A.toarray() for k, A in terms[letter].items())
                for terms in (whole, fewer)
            ]
            assert np.allclose(*factors, atol=LAST_BIT)


@pytest.mark.ranks(1)
def test_what_is_wrong_with_influence_coefficients_is_said():
    with pytest.raises(fw.InputError, match="need a frequency"):
        Aerodynamics({0: 1j}, 0.0)
    with pytest.raises(fw.InputError, match="no such dof"):
        Aerodynamics({0: 1j}, 1.0, dof=1).terms(np.eye(1))


def integrated(flow: Aerodynamics, start: float, omega: float, periods: int, steps: int = 400) -> np.ndarray:
    """Fundamental amplitude of mass 0 in each period of the wheel of 5 masses, by central differences (kt = R = 1).

    Started as the wave of 1 nodal diameter; sliders between the masses slip where their force reaches the limit.
    """
    step, j = 2 * np.pi / omega / steps, np.arange(SECTORS)
    K, C = np.eye(SECTORS), np.zeros((SECTORS, SECTORS))
    for k, L in flow.influence.items():
        K[j, (j + k) % SECTORS] -= L.real
        C[j, (j + k) % SECTORS] -= L.imag / flow.omega
    phase = -2 * np.pi * j / SECTORS
    x, v, slider = start * np.cos(phase), -start * omega * np.sin(phase), np.zeros(SECTORS)
    motion = np.empty((periods, steps))
    for n in range(periods * steps):
        motion[n // steps, n % steps] = x[0]
        reach = np.roll(x, -1) - x
        force = np.clip(reach - slider, -1, 1)
        slider = reach - force
        v = v + step * (force - np.roll(force, 1) - K @ x - C @ v)
        x = x + step * v
    return np.abs(2 / steps * motion @ np.exp(-2j * np.pi * np.arange(steps) / steps))


@pytest.mark.ranks(1)
def test_motions_of_the_wheel_in_time_go_to_the_stable_limit_cycle(comm):
    """From both sides to the first one, away from the second, the wave running as the convention says."""
    flow = flow_of_chain()
    sector = replace(jenkins_chain(SECTORS), aerodynamics=flow)
    (stable, unstable), _ = located(sector.model(1, comm), comm, orders=(1, 3, 5, 7, 9))
    for factor in (0.8, 1.5):
        amplitude = integrated(flow, factor * stable["amplitude"], stable["omega"], 16)
        assert amplitude[-1] == pytest.approx(stable["amplitude"], rel=1e-3)
    for factor, sign in ((0.9, -1), (1.1, +1)):
        amplitude = integrated(flow, factor * unstable["amplitude"], unstable["omega"], 3)
        assert (sign * np.diff(amplitude) > 0).all()
