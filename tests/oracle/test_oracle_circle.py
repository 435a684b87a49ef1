"""Friction on a circle: closed form, the exact oracle where the path is straight, Runge-Kutta where it bends."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI
from scipy.integrate import solve_ivp
from tolerances import REPEATED, ROUNDING, SOLVED, TIGHT

import fretwave as fw
from oracle import Flow, System
from oracle.circle import Block, Pair, Passage3d, orbit_3d
from oracle.test_oracle_independent import orbits, rubbing

pytestmark = pytest.mark.ranks(1)


def block(system: System, across: complex = 0.0) -> Block:
    """The rubbing block of three dofs with a fourth along the second tangent, which the others do not feel."""

    def wide(A, last):
        return np.block([[A, np.zeros((3, 1))], [np.zeros((1, 3)), np.full((1, 1), last)]])

    B = np.zeros((3, 4))
    B[0, 0], B[1, :3], B[2, 3] = 1, system.contacts[1].B, 1
    pair = Pair(B, kn=50.0, kt=40.0, mu=0.4, N0=1.0)
    M, C, K = wide(system.M, 1.0), wide(system.C, 0.4), wide(system.K, 5.0)
    return Block(M, C, K, [pair], np.append(system.P, across), np.append(system.p, 0.0), system.omega)


def test_a_straight_path_is_that_of_the_exact_oracle():
    """Sticks, slips both ways, lifts off and lands within the period."""
    orbit = orbits()["rubbing"]
    state = np.insert(orbit.state, [3, 6, 7], 0.0)
    passage = Passage3d(block(orbit.system), state, ("slip",), orbit.period)
    assert passage.y == pytest.approx(state, abs=ROUNDING)
    assert [event.after for event in passage.events] == ["open", "slip", "stick", "slip"]
    times = [event.t for event in orbit.events]
    assert all(min(abs(event.t - t) for t in times) < REPEATED for event in passage.events)


def test_runge_kutta_follows_the_bent_path():
    """A period from the middle of a slip, DOP853 restarted at its events; T' by the law's definition."""
    b, state = block(rubbing(), 1.2 - 0.7j), np.array([0.02, 0.03, 0.05, 0.1, -0.1, 0.4, 0.2, 0.3, 0.3, 0.2])
    passage = Passage3d(b, state, ("stick",), 2 * np.pi / b.omega)
    assert {"slip", "open"} <= {event.after for event in passage.events}
    words, times = ["stick", *(event.after for event in passage.events)], [event.t for event in passage.events]

    def slope(t, z, word):
        x, v, T = z[:4], z[4:8], z[8:]
        N, d, Rrate = (1 + 50 * x[0]) * (word != "open"), 40 * b.pairs[0].B[1:] @ v, 0.4 * 50 * v[0]
        rate = {"open": 0 * T, "stick": d}.get(word)
        if word == "slip":
            n = T / np.linalg.norm(T)
            rate = d - n * (n @ d - Rrate)
        push = np.real(b.P * np.exp(1j * b.omega * t)) + b.p - b.C @ v - b.K @ x
        push = push - b.pairs[0].B[0] * N - b.pairs[0].B[1:].T @ T
        return np.concatenate([v, np.linalg.solve(b.M, push), rate])

    z, begin = passage.steps[0][2][0].copy(), 0.0
    for word, end in zip(words, [*times, 2 * np.pi / b.omega]):
        if word == "open":
            z[8:] = 0.0
        if word == "slip" and not z[8:].any():  # lands, sliding
            d = b.pairs[0].B[1:] @ z[4:8]
            z[8:] = 0.4 * (1 + 50 * z[0]) * d / np.linalg.norm(d)
        z = solve_ivp(slope, (begin, end), z, "DOP853", rtol=1e-12, atol=1e-14, args=(word,)).y[:, -1]
        begin = end
    assert passage.y == pytest.approx(z, abs=SOLVED)
    half = Passage3d(b, state, ("stick",), 2 * np.pi / b.omega, share=0.5)
    assert half.y == pytest.approx(passage.y, abs=1e-11)


def test_a_rotating_load_has_its_circular_path():
    """u = a e^{i w t}, T = R e^{i (w t + psi)} with cos psi = R / (kt a): T' - kt u' is along T on the circle."""
    m, k, c, kt, R, w, a = 1.0, 10.0, 0.3, 4.0, 1.0, 2.5, 0.8
    traction = R * np.exp(1j * np.arccos(R / (kt * a)))
    F = (k + 1j * w * c - w**2 * m) * a + traction
    pair = Pair(np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]), kn=1.0, kt=kt, mu=0.5, N0=2.0)
    eye = np.eye(2)
    orbit = orbit_3d(Block(m * eye, c * eye, k * eye, [pair], np.array([F, -1j * F]), np.zeros(2), w), settle=2)
    q = orbit.harmonics(3)
    assert orbit.defect < 1e-11 and orbit.pattern == ("slip",) and not orbit.events
    assert q[:2, 1] == pytest.approx([a, -1j * a], abs=1e-11)
    assert q[4:, 1] == pytest.approx([traction, -1j * traction], abs=1e-11)
    assert abs(q[:, [0, 2, 3]]).max() < 1e-11


def test_a_motion_that_lifts_off_has_no_step_left_out():
    """The straight case over a period from rest, both ways."""
    system = rubbing()
    b = block(system)
    flow = Flow(system).passage(system.extended(np.zeros(7)), system.start, 2 * np.pi / 3)
    passage = Passage3d(b, np.zeros(10), ("stick",), 2 * np.pi / 3)
    assert np.delete(passage.y, [3, 7, 9]) == pytest.approx(flow.end[:7], abs=TIGHT)


#: Forces along the normal and both tangents. What lifts off takes longer: cases/accuracy/friction_3d.py
BENT = {"constant": (0.0, 1.5j, 1.2 - 0.7j), "varies": (0.9, 1.5j, 1.2 - 0.7j)}


@pytest.mark.parametrize("load", BENT)
def test_friction_on_a_bent_path_converges_as_a_smooth_motion(load):
    """Harmonic balance of a rubbing block that never sticks tends to its exact motion faster than any power of H."""
    K = np.array([[20.0, 2.0, 0.0], [2.0, 15.0, 0.0], [0.0, 0.0, 6.0]])
    if load == "constant":
        K[0, 1] = K[1, 0] = 0.0
    contact = Pair(np.eye(3), kn=50.0, kt=40.0, mu=0.4, N0=1.0)
    b = Block(np.eye(3), 0.4 * np.eye(3), K, [contact], np.array(BENT[load]), np.array([1.0, 0.0, 0.0]), 3.0)
    exact, errors = orbit_3d(b, settle=4).harmonics(1)[:3, 1], []
    law = {"normal_stiffness": 50.0, "tangential_stiffness": 40.0, "friction_coefficient": 0.4, "normal_load": 1.0}
    with fw.Model(b.M, b.K, b.C, [fw.Contact("coulomb_3d", np.eye(3), law)], MPI.COMM_WORLD) as model:
        for H in (5, 9, 21):
            harmonics, mode = fw.choose_harmonics(model, H, 2 * H + 2), fw.linear_modes(model, 1)[0]
            problem = fw.ForcedResponse(model, harmonics, {0: b.p, 1: b.P}, 1.0, 1, mode)
            first = next(iter(fw.Continuation(problem, problem.initial(3.0), (1.5, 6.0))))
            Q = problem.coefficients(first.y)
            errors.append(np.linalg.norm(Q[:, 1] - 1j * Q[:, 2] - exact) / np.linalg.norm(exact))
    assert 1e-6 < errors[0] < 5e-5
    assert errors[1] < errors[0] / 50 and errors[2] < 1e-11
