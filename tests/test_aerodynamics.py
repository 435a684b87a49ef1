"""Influence coefficients: transform over the sectors, waves and wheel, and limit cycles against the closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from cyclic_models import jenkins_chain
from scipy.optimize import brentq

import fretwave as fw
from fretwave.aerodynamics import Aerodynamics

SECTORS, K, KT, LIMIT = 5, 1.0, 1.0, 1.0


def kappa(a: float) -> complex:
    """REFERENCE: complex stiffness of a Jenkins element (kt = R = 1) at relative amplitude a."""
    if a <= 1:
        return 1.0 + 0j
    th = np.arccos(1 - 2 / a)
    return complex((th - np.sin(2 * th) / 2) / np.pi, 4 / (np.pi * a) * (1 - 1 / a))


def crossings(flow: Aerodynamics, nodal_diameter: int) -> list[tuple[float, float]]:
    """(a, omega) at which a wave of the chain with one harmonic has no damping: both parts of its equation are zero.

    k + 4 s^2 kappa(2 a s) - omega^2 - sum (Re L_k + i omega / omega_ref Im L_k) e^{-i k theta} = 0, s = |sin theta/2|.
    """
    theta = 2 * np.pi * nodal_diameter / SECTORS
    s = abs(np.sin(theta / 2))
    waves = [sum(part(L) * np.exp(-1j * k * theta) for k, L in flow.influence.items()) for part in (np.real, np.imag)]

    def equation(a: float, omega: float) -> complex:
        return K + 4 * s**2 * kappa(2 * a * s) - omega**2 - waves[0] - 1j * omega / flow.omega * waves[1]

    def omega_at(a: float) -> float:
        return brentq(lambda omega: equation(a, omega).real, 1e-3, 10, xtol=1e-15)

    def work(a: float) -> float:
        return equation(a, omega_at(a)).imag

    grid = np.geomspace(0.5 / s * 1.0001, 500 / s, 400)
    changes = np.flatnonzero(np.diff(np.sign([work(a) for a in grid])))
    places = [brentq(work, grid[i], grid[i + 1], xtol=1e-14) for i in changes]
    return [(a, omega_at(a)) for a in places]


def flow_of_chain() -> Aerodynamics:
    """Feeds forward waves; stiffens, and couples neighbours unlike in both directions."""
    return Aerodynamics({0: 0.02 - 0.06j, 1: -0.1 + 0.02j, -1: 0.12 + 0.05j, 2: 0.01 - 0.005j}, 1.7)


def located(model: fw.Model, comm, method: str = "CNM", start=None, avoid=None) -> tuple[list, list]:
    """Zeros of the damping of a branch from stick to slip, and its damping."""
    start = start or fw.linear_modes(jenkins_chain(SECTORS).model(model.nodal_diameter, comm), 1)[0]
    problem = fw.NonlinearMode(model, fw.Harmonics([1], 960), method, 0, start, avoid=avoid)
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
        expected = crossings(flow, diameters)
        found, zeta = located(sector.model(diameters, comm), comm, method)
        assert [(s["amplitude"], s["omega"]) for s in found] == [pytest.approx(pair, rel=1e-5) for pair in expected]
        cycles[diameters] = (len(found), np.sign(zeta[0]))
    assert cycles == {1: (2, -1), -1: (0, 1), 2: (1, 1), -2: (0, 1)}
