"""Wear of a blade on two flanks: predictor, energy, course of damping, invariances of the march."""

from __future__ import annotations

import numpy as np
import pytest
from models.core_models import chain, whole
from models.coulomb_pair import pair
from test_krylov import ROOT, blade, mode, preloaded
from tolerances import REPEATED, ROUNDING, SOLVED

import fretwave as fw

pytestmark = pytest.mark.ranks(1)

AREAS = {"root": np.full(6, 2e-5)}
K_W, CYCLES = 1e-9, 9.0  #: wear coefficient [1/Pa] under which damping rises and falls within these vibrations


def worn_blade(comm, method="CNM", route="direct", amplitude=3.5e-3, highest=3, coefficient=K_W):
    model = blade(comm)
    first, rest = preloaded(model)
    problem = mode(model, first, rest, route, method, highest)
    start = fw.Continuation(problem, problem.initial(1e-3), (9e-4, 1.2 * amplitude), report_at=[amplitude])
    y = next(point.y for point in start if point.event == "report")
    return fw.WornMode(problem, coefficient, AREAS), y


@pytest.mark.ranks(1, 2, 3)
@pytest.mark.parametrize("route", ["direct", "krylov"])
def test_predictor_is_the_tangent(comm, route):
    """dy/dw by one linear solve, against the modes at two depths beside."""
    mode, y = worn_blade(comm, route=route)
    state = mode.solve(1e-5 * np.arange(6.0), y)
    change = np.array([3.0, -1.0, 2.0, 0.5, 1.0, 2.0])
    tangent = whole(mode.tangent(state, change))
    step = 1e-8
    sides = [whole(mode.solve(state.depth + sign * step * change, state.y).y) for sign in (1, -1)]
    assert np.allclose((sides[0] - sides[1]) / (2 * step), tangent, rtol=0, atol=2e-4 * np.abs(tangent).max())


@pytest.mark.ranks(1, 2)
@pytest.mark.parametrize("method", ["CNM", "EPMC"])
def test_energy_of_a_period_is_in_balance(comm, method):
    """Contact takes 2 pi beta w sum n^3 q^H M q (CNM) or 2 pi zeta w0^2 sum n^2 q^H M q (EPMC) less what C takes,
    with dense matrices from the coefficients alone; new and worn."""
    n, orders = 5, [0, 1, 2, 3]
    M, K, damping = np.eye(n), chain(n), 0.01 * chain(n)
    contact = pair(B=np.random.default_rng(3).standard_normal((6, n)) / 2, normal_load=1.0)
    model = fw.Model(M, K, damping, [contact], comm)
    start = fw.linear_modes(model, 1, "stuck")[0]
    problem = fw.NonlinearMode(model, fw.Harmonics(orders, 64), method, 0, start)
    problem.preload(np.zeros(n), np.asarray(contact.B)[::3].sum(axis=0))
    branch = fw.Continuation(problem, problem.initial(0.05), (0.04, 1.2), report_at=[0.3])
    y = next(point.y for point in branch if point.event == "report")
    worn_mode = fw.WornMode(problem, 1e-2, {"contact": np.ones(2)})
    dissipated = []
    for state in (worn_mode.solve(np.zeros(2), y), worn_mode.solve(np.array([0.1, 0.02]), y)):
        worn_mode.wear(state.depth)
        Q, found, modal = problem.coefficients(state.y), problem.energy(state.y), problem.state(state.y)
        assert abs(found["error"]) < SOLVED and found["contact"] > 0
        if Q is None:
            continue
        q = {k: Q[:, 2 * k - 1] - 1j * Q[:, 2 * k] for k in orders[1:]}
        square = {k: np.vdot(q[k], M @ q[k]).real for k in q}
        if method == "CNM":
            release = 2 * np.pi * modal["beta"] * modal["omega"] * sum(k**3 * square[k] for k in q)
            frequency = modal["omega"]
        else:
            release = 2 * np.pi * modal["zeta"] * modal["omega0"] ** 2 * sum(k**2 * square[k] for k in q)
            frequency = modal["omega0"]
        taken = np.pi * frequency * sum(k**2 * np.vdot(q[k], damping @ q[k]).real for k in q)
        assert found["modal"] == pytest.approx(release, rel=ROUNDING)
        assert found["damping"] == pytest.approx(taken, rel=ROUNDING)
        dissipated.append((found["contact"], release - taken))
    for contact_work, balance in dissipated:
        assert contact_work == pytest.approx(balance, rel=REPEATED)


@pytest.mark.ranks(1, 2)
@pytest.mark.parametrize("stepper", ["heun", "tr_bdf2"])
def test_wear_of_a_blade(comm, stepper):
    """Depths never fall, pairs that always stick do not wear, work and release of energy balance all along."""
    mode, y = worn_blade(comm)
    march = fw.Wear(mode, y, CYCLES, fw.WearControl(stepper, 1e-2, pressure_change=0.3))
    depths, stuck = [], np.ones(6, dtype=bool)
    for point in march:
        depths.append(point.state.depth.copy())
        stuck &= point.state.rate == 0
        assert abs(mode.problem.energy(point.state.y)["error"]) < REPEATED
    assert march.converged and len(depths) > 5
    steps = np.diff(depths, axis=0)
    assert (steps >= 0).all() and depths[-1].max() > 0.1 * ROOT["normal_load"] / ROOT["normal_stiffness"]
    assert (depths[-1][stuck] == 0).all()


def test_damping_rises_and_falls(comm):
    """The paper's figure 13: less load lets more pairs slip, until there is little left to slip under."""
    mode, y = worn_blade(comm)
    states = [mode.problem.state(point.state.y) for point in fw.Wear(mode, y, CYCLES)]
    zeta, omega = (np.array([state[key] for state in states]) for key in ("zeta", "omega"))
    top = int(np.argmax(zeta))
    assert zeta[0] * 1.1 < zeta[top] and zeta[-1] < 0.5 * zeta[top]
    assert (np.diff(zeta[: top + 1]) > 0).all() and (np.diff(zeta[top:]) < 0).all()
    assert (np.diff(omega) < 0).all()


def test_a_mode_that_ends_says_so(comm):
    """Towards 10.4 vibrations the branch folds below this amplitude: steps shrink, what was found is kept."""
    mode, y = worn_blade(comm)
    march = fw.Wear(mode, y, 20.0, fw.WearControl(tolerance=1e-2, pressure_change=0.5))
    ends = [point.cycles for point in march]
    assert not march.converged and "the mode ends here" in march.reason
    assert 10.0 < ends[-1] < 11.0


def test_detours_come_back_to_the_amplitude(comm):
    """By arclength from an amplitude beside: where the branch does not fold, to the very solution."""
    mode, y = worn_blade(comm)
    depth = 2e-5 * np.ones(6)
    direct, around = mode.solve(depth, y), mode.elsewhere(depth, y)
    assert np.allclose(whole(around.y), whole(direct.y), rtol=0, atol=SOLVED)


def test_steppers_agree(comm):
    """Explicit and implicit steps to the same depths."""
    ends = []
    for stepper in ("bogacki_shampine", "tr_bdf2"):
        mode, y = worn_blade(comm)
        march = fw.Wear(mode, y, CYCLES, fw.WearControl(stepper, 1e-5))
        *_, last = (point.state.depth.copy() for point in march)
        ends.append(last)
    assert np.allclose(*ends, rtol=0, atol=3e-4 * ends[0].max())


def test_without_wear_the_mode_stays(comm):
    """k_w = 0: one point, the given one, and no solve; afterwards the contacts are as new."""
    mode, y = worn_blade(comm, coefficient=0.0)
    before = whole(mode.problem.residual(y))
    points = list(fw.Wear(mode, y, 1e6, outcome=(3, 7, 1e-12)))
    assert [(p.event, p.newton, p.linear, p.cycles) for p in points] == [("start", 3, 7, 0.0)]
    assert np.array_equal(whole(mode.problem.residual(y)), before)
    mode.wear(np.full(6, 1e-5))
    mode.destroy()
    assert np.array_equal(whole(mode.problem.residual(y)), before)


def test_marching_on_gives_the_same(comm):
    """From an intermediate point as from a kill: the same steps to the last bit."""
    mode, y = worn_blade(comm)
    first = fw.Wear(mode, y, CYCLES)
    kept, points = None, []
    for point in first:
        points.append((point.cycles, point.state.depth.copy()))
        if len(points) == 3:
            kept = (point.state.y.copy(), point.state.depth.copy(), point.cycles, first.step, first.load_scale)
    again, z = worn_blade(comm)
    assert kept is not None
    y, depth, at, step, scale = kept
    z.setArray(y.getArray(readonly=True))
    second = fw.Wear(again, z, CYCLES, depth=depth, at=at, step=step, load_scale=scale)
    found = [(point.cycles, point.state.depth.copy()) for point in second.go_on()]
    assert [p[0] for p in found] == [p[0] for p in points[3:]]
    assert all(np.array_equal(one[1], two[1]) for one, two in zip(found, points[3:]))
