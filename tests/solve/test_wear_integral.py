"""What wears: Archard's integral in closed form, its derivative by the gap, and worn depth as gap."""

from __future__ import annotations

import numpy as np
import pytest
from models.core_models import solve_at, unknowns, whole
from models.coulomb_pair import KN, KT, LAWS, MU, STEADY, imposed, motion, pair, random_mode
from tolerances import ROUNDING, SOLVED

import fretwave as fw

pytestmark = pytest.mark.ranks(1)


def worn(contact, q, samples):
    """Integral of N |d slider| of one pair."""
    problem, y = imposed(contact, q, samples=samples)
    archard, load, _, _ = problem.core.wearing(y)[0]
    return sum(problem.model.comm.allgather(archard.sum())), sum(problem.model.comm.allgather(load.sum()))


@pytest.mark.parametrize("law", LAWS)
def test_integral_under_varying_normal_load(law):
    """u_n = c cos, u_t = a cos: N = N0 + nu u with nu = kn c / a, the slider is u - R and u + R with R = mu N / kt, and
    slip begins where it leaves its place at the last turn."""
    a, c, load = 2.0, 0.2, 1.0
    nu, reach = KN * c / a, MU / KT
    R0, rho = reach * load, reach * nu
    up, down = (2 * R0 - (1 + rho) * a) / (1 - rho), ((1 - rho) * a - 2 * R0) / (1 + rho)
    exact = (1 - rho) * (load * (a - up) + nu * (a**2 - up**2) / 2)
    exact += (1 + rho) * (load * (down + a) + nu * (down**2 - a**2) / 2)
    contact, q = pair(law, normal_load=load), motion((0, c), (0, a))
    for samples in (8, 64, 256):
        assert worn(contact, q, samples)[0] == pytest.approx(exact, rel=ROUNDING)
    assert worn(contact, q, 64)[1] == pytest.approx(load, rel=1e-13)


def test_what_does_not_slip_does_not_wear():
    """Stuck under a large motion of the pair; open; in shakedown, where the slider only touches its limit. Without
    friction it slides all the way, 4 a under N0."""
    q = motion((0, 0.1), (0, 1.0), (0, 0, 0.5))
    assert worn(pair(normal_load=10.0), q, 64)[0] == 0
    assert worn(pair(normal_load=0.0, gap=2.0), q, 64)[0] == 0
    for which in ("shakedown on one disc", "shakedown on two discs"):
        assert worn(pair(), STEADY[which], 64)[0] == 0
    assert worn(pair(friction_coefficient=0.0, normal_load=2.0), motion((0,), (0, 1.0)), 64)[0] == pytest.approx(8.0)


@pytest.mark.ranks(1, 2, 3)
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("method", ["CNM", "EPMC"])
def test_derivative_by_the_gap_is_exact(law, method):
    """Against central differences in worn depth, in stick, slip and lift-off."""
    for seed in range(3):
        problem, values = random_mode(law, method, seed)
        point, pairs = unknowns(problem, values), problem.model.pairs_of(0)
        contact = problem.diagnostics(point)
        assert min(contact["stick"], contact["slip"], contact["open"]) > 0.01
        change, depth = np.random.default_rng(seed).uniform(0.2, 1.0, (2, 3))

        def at(depth, problem=problem, point=point, pairs=pairs):
            problem.core.wear([depth[pairs].tolist()])
            return whole(problem.residual(point))

        step = 1e-7
        difference = (at(0.1 * depth + step * change) - at(0.1 * depth - step * change)) / (2 * step)
        at(0.1 * depth)
        found = whole(problem.core.gap_product(point, [change[pairs].tolist()]))
        assert np.allclose(found, difference, rtol=0, atol=1e-7 * np.abs(found).max())


@pytest.mark.ranks(1, 2)
def test_worn_depth_is_gap(comm):
    """The residual of worn pairs is that of pairs with the gap, and new depths take the place of old ones."""
    q = np.random.default_rng(0).uniform(-1, 1, (3, 7))
    worn_problem, y = imposed(pair(gap=0.1), q)
    mine = worn_problem.model.pairs_of(0)
    worn_problem.core.wear([np.array([0.7])[mine].tolist()])
    worn_problem.core.wear([np.array([0.2])[mine].tolist()])
    expected, z = imposed(pair(gap=0.1 + 0.2), q)
    assert np.array_equal(whole(worn_problem.residual(y)), whole(expected.residual(z)))


@pytest.mark.ranks(1, 2)
def test_wear_of_a_travelling_wave(comm):
    """Pairs between sectors: the gap's derivative carries their phase, and the energy of the wave is in balance."""
    parameters = {"normal_stiffness": KN, "tangential_stiffness": KT, "friction_coefficient": MU, "normal_load": 1.0}
    between = fw.Contact("coulomb_3d", {0: -np.eye(3), 1: np.eye(3)}, parameters)
    sector = fw.Sector(np.eye(3), {0: np.diag([1.0, 1.3, 1.6])}, 5, None, [between])
    model = sector.model(1, comm)
    start = fw.linear_modes(model, 3, "stuck")[1]
    dof = int(np.argmax(np.abs(start.shape)))
    problem = fw.NonlinearMode(model, fw.Harmonics([0, 1, 2, 3], 64), "CNM", dof, start)
    y = solve_at(problem, 1.0)
    assert problem.diagnostics(y)["slip"] > 0.05
    assert abs(problem.energy(y)["error"]) < SOLVED and problem.energy(y)["contact"] > 0
    pairs, step = model.pairs_of(0), 1e-7

    def at(depth):
        problem.core.wear([np.array([depth])[pairs].tolist()])
        return whole(problem.residual(y))

    difference = (at(step) - at(-step)) / (2 * step)
    at(0.0)
    found = whole(problem.core.gap_product(y, [np.ones(1)[pairs].tolist()]))
    assert np.allclose(found, difference, rtol=0, atol=1e-7 * np.abs(found).max())
