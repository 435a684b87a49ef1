"""Fretting wear: closed forms, orders of the steppers, exact derivatives, energy and invariances of the march."""

from __future__ import annotations

import numpy as np
import pytest
from models.core_models import chain, solve_at, unknowns, whole
from models.coulomb_pair import KN, KT, LAWS, MU, STEADY, imposed, motion, pair, random_mode
from test_krylov import ROOT, blade, mode, preloaded
from tolerances import REPEATED, ROUNDING, SOLVED

import fretwave as fw
from fretwave.solve.steppers import STEPPERS

pytestmark = pytest.mark.ranks(1)

#: REFERENCE: one Jenkins node at imposed amplitude, the normal load constant over a period.
A, B, C, P0 = 1.0, 0.5, 4e-3, 1.5


def worn_load(eta, amplitude=A):
    return 1 / (B / amplitude + (1 / P0 - B / amplitude) * np.exp(C * amplitude * eta))


def node(comm, samples=64, amplitude=A):
    """A mass whose only motion is tangential: P = P0 - kn depth, and one harmonic keeps the motion a cosine."""
    contact = fw.Contact(
        "coulomb_3d",
        np.array([[0.0], [1.0], [0.0]]),
        {"normal_stiffness": 1.0, "tangential_stiffness": 1.0, "friction_coefficient": B, "normal_load": P0},
    )
    model = fw.Model([[1.0]], [[1.0]], None, [contact], comm)
    problem = fw.NonlinearMode(model, fw.Harmonics([0, 1], samples), "CNM", 0, fw.linear_modes(model, 1, "stuck")[0])
    y = solve_at(problem, amplitude)
    return fw.WornMode(problem, C / 4, {"contact": np.ones(1)}), y


def marched(mode, y, cycles, control, **options):
    """(cycles, load, depth, work, event) of all points."""
    march = fw.Wear(mode, y, cycles, control, **options)
    found = [
        (p.cycles, p.state.load.copy(), p.state.depth.copy(), mode.problem.diagnostics(p.state.y)["work"], p.event)
        for p in march
    ]
    assert march.converged, march.reason
    return found


@pytest.mark.parametrize("stepper, tolerance", [("bogacki_shampine", 1e-8), ("tr_bdf2", 3e-9)])
def test_closed_form_of_one_node(comm, stepper, tolerance):
    """REFERENCE: P(100) = 1.33576005, P(1000) = 0.10417001; the work 4 mu P (a - bP) has its peak kt a^2 at 274.653."""
    mode, y = node(comm)
    control = fw.WearControl(stepper, tolerance)
    found = {p[0]: p for p in marched(mode, y, 1000.0, control, report_at=[100.0, 274.653])}
    assert found[100.0][1][0] == pytest.approx(1.33576005, abs=1e-6)
    assert found[1000.0][1][0] == pytest.approx(0.10417001, abs=1e-6)
    assert found[274.653][1][0] == pytest.approx(A / (2 * B), abs=2e-6)
    assert found[274.653][3] == pytest.approx(1.0, abs=SOLVED)
    assert max(p[3] for p in found.values()) <= 1 + 1e-12
    for eta, load, depth, work, _ in found.values():
        assert load[0] == pytest.approx(worn_load(eta), abs=1e-6)
        assert depth[0] == pytest.approx(P0 - load[0], abs=ROUNDING)
        assert work == pytest.approx(4 * B * load[0] * (A - B * load[0]), abs=1e-11)


@pytest.mark.parametrize("stepper", list(STEPPERS))
def test_order_of_the_steppers(comm, stepper):
    """Errors at eta = 100 on halved steps."""
    mode, y = node(comm)
    errors = []
    for step in (20.0, 10.0, 5.0, 2.5):
        end = marched(mode, y, 100.0, fw.WearControl(stepper, 1e-9, first=step, fixed=True))[-1]
        errors.append(abs(end[1][0] - worn_load(100.0)))
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert np.allclose(orders, STEPPERS[stepper].order, atol=0.04)


@pytest.mark.parametrize("stepper", list(STEPPERS))
def test_tableaux_are_consistent(stepper):
    """Order conditions of the method and of its companion, and no negative coefficient: depths cannot fall."""
    t = STEPPERS[stepper]
    companion = t.A[-1] - t.error
    assert (t.A >= 0).all() and t.c[-1] == pytest.approx(1)
    for weights, order in ((t.A[-1], t.order), (companion, t.error_order - 1 if t.order != 2 else None)):
        assert weights.sum() == pytest.approx(1)
        if order is not None and order >= 2:
            assert weights @ t.c == pytest.approx(1 / 2)
        if order is not None and order >= 3:
            assert weights @ t.c**2 == pytest.approx(1 / 3)
            assert weights @ t.A @ t.c == pytest.approx(1 / 6)


def test_the_error_control_keeps_its_tolerance(comm):
    """The global error falls with a step's tolerance to the power 2/3; no pressure changes by more than it may."""
    mode, y = node(comm)
    errors = []
    for tolerance in (1e-3, 1e-5, 1e-7):
        control = fw.WearControl("bogacki_shampine", tolerance, pressure_change=1.0)
        errors.append(abs(marched(mode, y, 400.0, control)[-1][1][0] - worn_load(400.0)))
    assert errors[0] < 1e-2 and errors[2] < errors[0] / 200
    loads = np.array([p[1][0] for p in marched(mode, y, 400.0, fw.WearControl("heun", 1e-2, pressure_change=0.05))])
    assert 0.03 * P0 < np.abs(np.diff(loads)).max() <= 0.05 * P0


def test_last_digits_change_no_step(comm):
    """Rates that differ as they do between numbers of ranks: the same points, not points that drift apart."""
    marches, control = [], fw.WearControl(tolerance=1e-4)
    for factor in (1.0, 1.0 + 1e-10, 1.0 - 1e-10):
        mode, y = node(comm)
        mode.coefficient *= factor
        marches.append([point.cycles for point in fw.Wear(mode, y, 400.0, control)])
    assert len(marches[0]) == 8 and marches[0] == marches[1] == marches[2]


def test_stop_rules(comm):
    """A load that has gone, a rate that will change nothing any more, a node that sticks from the start."""
    mode, y = node(comm)
    for tolerance, cycles, why in ((1e-2, 1e5, "contact lost"), (1e-3, 2.1e3, "wear has stopped")):
        march = fw.Wear(mode, y, cycles, fw.WearControl(tolerance=tolerance))
        assert [point.event for point in march][-1] == "stop"
        assert march.converged and 1e3 < march.eta < cycles and why in march.reason
    small = solve_at(mode.problem, 0.5)  # 0.5 < b P0: stuck
    march = fw.Wear(mode, small, 1e9)
    assert len(list(march)) == 1 and march.eta == 0 and "stopped" in march.reason


def test_a_march_that_has_stopped_goes_no_further_when_it_is_gone_on_with(comm):
    mode, y = node(comm)
    march = fw.Wear(mode, y, 2.1e3, fw.WearControl(tolerance=1e-3))
    points = [(point.state.y.copy(), point.state.depth, point.cycles, march.step, march.growth) for point in march]
    assert "wear has stopped" in march.reason
    again = {"load_scale": march.load_scale, "step": points[-1][3], "growth": points[-1][4]}
    more = fw.Wear(mode, points[-1][0], 2.1e3, march.control, (), points[-1][1], points[-1][2], **again)
    assert list(more.go_on()) == [] and more.reason == march.reason


def test_a_slow_pair_that_grows_stops_no_march(comm):
    """A rate's growth over the last step goes on: e^40 of what is far below the tolerance."""
    mode, y = node(comm)
    march = fw.Wear(mode, y, 100.0)
    march.growth, march.state.rate = np.array([-1.0]), np.array([1e-12])
    assert march._finished() and "stopped" in march.reason
    march.reason, march.growth = "", np.array([0.4])
    assert not march._finished()


@pytest.mark.parametrize("cycles", [1e9, 1e18])
def test_a_march_is_as_long_as_it_is_wanted(comm, cycles):
    """Steps are short beside what wears, not beside all cycles: these ended before the first one."""
    mode, y = node(comm)
    march = fw.Wear(mode, y, cycles, fw.WearControl(tolerance=1e-2))
    assert [point.event for point in march][-1] == "stop"
    assert march.converged and "contact lost" in march.reason and march.eta < 1e5


@pytest.mark.parametrize("stepper", list(STEPPERS))
@pytest.mark.parametrize("above", [1e-4, 1e-6])
def test_wear_that_accelerates_from_nothing_has_not_stopped(comm, stepper, above):
    """Just above the onset of slip less than the tolerance is lost at first, and all of it in the end."""
    amplitude = B * P0 * (1 + above)
    mode, y = node(comm, amplitude=amplitude)
    cycles = 40 / (C * amplitude)
    off = []
    for tolerance in (1e-3, 1e-4):
        found = marched(mode, y, cycles, fw.WearControl(stepper, tolerance))
        assert found[-1][1][0] < 1e-2 * P0
        off.append(max(abs(load[0] - worn_load(eta, amplitude)) for eta, load, *_ in found) / P0)
    assert off[0] < 0.1 and off[1] < 0.4 * off[0] + 1e-4


# ---- Archard's integral


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


# ---- derivative by the gap


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


# ---- a blade on two flanks


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


def test_errors(comm):
    mode, y = node(comm)
    with pytest.raises(fw.InputError, match="unknown stepper"):
        fw.Wear(mode, y, 1.0, fw.WearControl("euler"))
    with pytest.raises(fw.InputError, match="no such contact"):
        fw.WornMode(mode.problem, 1.0, {"root": np.ones(1)})
    jenkins = fw.Contact("jenkins", [[1.0]], {"tangential_stiffness": 1.0, "friction_limit": 1.0})
    model = fw.Model([[1.0]], [[1.0]], None, [jenkins], comm)
    problem = fw.NonlinearMode(model, fw.Harmonics([1], 16))
    with pytest.raises(fw.InputError, match="cannot wear"):
        fw.WornMode(problem, 1.0, {"contact": np.ones(1)})
