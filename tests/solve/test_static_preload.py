"""Static equilibrium under load: closed forms, what it says without one, and how it enters modes and dynamics."""

from __future__ import annotations

import numpy as np
import pytest
from models.core_models import chain, everywhere, solve_at, unknowns, whole
from tolerances import LAST_BIT, LAST_DIGITS, ROUNDING, SOLVED, TIGHT

import fretwave as fw
from fretwave.solve.preload import balanced, static_preload

K, KN, KT, MU, N0 = 2.0, 3.0, 1.5, 0.5, 2.0


def contact(B, law="coulomb_3d", **changes):
    """Pairs of the module's constants; each entry of `changes` a number or one per pair."""
    if law == "jenkins":
        return fw.Contact(law, B, {"tangential_stiffness": KT, "friction_limit": MU * N0, **changes})
    parameters = {"normal_stiffness": KN, "tangential_stiffness": KT, "friction_coefficient": MU}
    return fw.Contact(law, B, {**parameters, **changes})


def normal_support(comm, k=K, **changes):
    """One mass on a spring, met by a pair along its normal."""
    return fw.Model([[1.0]], [[k]], None, [contact([[1.0], [0.0], [0.0]], **changes)], comm)


def tangential_support(comm, law="coulomb_3d", k=K):
    """One mass on a spring, held along a tangent by a pair pressed with N0."""
    if law == "jenkins":
        return fw.Model([[1.0]], [[k]], None, [contact([[1.0]], law)], comm)
    return fw.Model([[1.0]], [[k]], None, [contact([[0.0], [1.0], [0.0]], law, normal_load=N0)], comm)


def first(model):
    return fw.linear_modes(model, 1, "stuck")[0]


def at_rest(model, load):
    return static_preload(model, np.atleast_1d(np.asarray(load, dtype=float)), first(model))


@pytest.mark.parametrize("load", [-2.0, 0.3, 0.79, 0.81, 3.0, 500.0])
def test_spring_with_a_gap(comm, load):
    """k x + kn max(0, x - gap) = P, gap 0.4: open below P = 0.8."""
    rest = at_rest(normal_support(comm, gap=0.4), load)
    expected = load / K if load < 0.8 else (load + KN * 0.4) / (K + KN)
    assert rest.displacement == pytest.approx(expected, rel=ROUNDING)
    assert rest.load == pytest.approx(load, rel=LAST_DIGITS)
    assert (rest.stick, rest.slip, rest.open) == ((0, 0, 1) if load < 0.8 else (1, 0, 0))


def test_interference_is_a_normal_load(comm):
    """A negative gap g presses with kn |g| at zero displacement, as N0 = kn |g| does."""
    by_gap = at_rest(normal_support(comm, gap=-0.5), 1.0)
    by_load = at_rest(normal_support(comm, normal_load=0.5 * KN), 1.0)
    assert by_gap.displacement == pytest.approx(1.0 / (K + KN), rel=ROUNDING)
    assert by_gap.displacement == pytest.approx(by_load.displacement, rel=LAST_DIGITS)
    assert by_gap.load == pytest.approx(by_load.load, rel=LAST_DIGITS)


@pytest.mark.parametrize("law", ["coulomb_3d", "coulomb_3d_uncoupled", "jenkins"])
@pytest.mark.parametrize("load", [-5.0, 1.0, 2.3, 2.4, 5.0])
def test_spring_held_by_friction(comm, law, load):
    """Sticks while kt P / (k + kt) <= mu N0 = 1, then carries mu N0."""
    rest = at_rest(tangential_support(comm, law), load)
    sticks = KT * abs(load) / (K + KT) <= MU * N0
    expected = load / (K + KT) if sticks else (load - np.sign(load) * MU * N0) / K
    assert rest.displacement == pytest.approx(expected, rel=ROUNDING)
    assert (rest.stick, rest.slip, rest.open) == ((1, 0, 0) if sticks else (0, 1, 0))


@pytest.mark.parametrize("load", [1e-3, 1.0, 50.0])
@pytest.mark.parametrize("gap", [None, 0.4])
def test_the_lowest_mode_may_be_one_that_the_load_does_not_move(comm, load, gap):
    """A component mode in sqrt(mass) length beside a dof in lengths, 1e5 times softer: no measure of its motion."""
    row = [[0.0, 1.0]] if gap is None else [[0.0, 1.0], [0.0, 0.0], [0.0, 0.0]]
    met = contact(row, "jenkins") if gap is None else contact(row, gap=gap)
    model = fw.Model(np.diag([1.0, 1e-6]), np.diag([1e5, K]), None, [met], comm)
    rest = at_rest(model, [0.0, load])
    friction = min(KT * load / (K + KT), MU * N0)
    by_stop = max(0.0, KN * (load / K - (gap or 0.0)) / (1 + KN / K))
    expected = (load - (friction if gap is None else by_stop)) / K
    assert rest.displacement == pytest.approx([0.0, expected], rel=ROUNDING, abs=ROUNDING * expected)


def test_slip_under_two_tangential_loads_is_along_their_resultant(comm):
    """Coupled limit: T opposes the slip, |T| = mu N, k x + T = P with x along P."""
    model = fw.Model(np.eye(2), K * np.eye(2), None, [contact([[0, 0], [1, 0], [0, 1]], normal_load=N0)], comm)
    load = 5.0 * np.array([0.6, -0.8])
    rest = static_preload(model, load, first(model))
    assert rest.displacement == pytest.approx(load * (5.0 - MU * N0) / 5.0 / K, rel=ROUNDING)
    assert rest.slip == 1


def clamped(comm, n=5):
    """A chain whose masses 1 and 3 meet pairs pressed with their own normal loads, along the chain as a tangent."""
    B = np.zeros((6, n))
    B[1, 1] = B[4, 3] = 1.0
    pairs = contact(B, normal_load=np.array([N0, 3 * N0]))
    return fw.Model(np.eye(n), chain(n), None, [pairs], comm)


def test_given_normal_loads_are_balanced_as_they_are(comm):
    """No displacement; the load is B^T f(0): here the normal forces of pairs that push on one dof."""
    model = normal_support(comm, normal_load=N0)
    rest = balanced(model, first(model))
    assert rest.displacement == 0
    assert rest.load == pytest.approx(N0, rel=LAST_DIGITS)
    assert (rest.stick, rest.slip, rest.open) == (1, 0, 0)


@pytest.mark.parametrize("load", [0.0, 0.7, -1.0])
def test_normal_loads_that_are_not_balanced_move_the_structure(comm, load):
    """k x + N0 + kn x = P while closed: the pair is relieved, and the whole load is P; else x = P / k, open."""
    model = normal_support(comm, normal_load=N0)
    rest = static_preload(model, np.array([load]), first(model), balance=False)
    expected = (load - N0) / (K + KN)
    assert N0 + KN * expected > 0
    assert rest.displacement == pytest.approx(expected, rel=ROUNDING)
    assert rest.load == pytest.approx(load, abs=ROUNDING)
    assert (rest.stick, rest.open) == (1, 0)


def test_balance_of_a_structure(comm):
    """K x + B^T f = load, with f from the state's own slip pattern: pair 0 slips, pair 1 sticks."""
    model = clamped(comm)
    load = np.array([0.0, 4.0, 0.0, 1.0, 0.0])
    rest = static_preload(model, load, first(model))
    stiffness, force = chain(5), load.copy()
    force[1] -= MU * N0
    stiffness[3, 3] += KT
    assert (rest.stick, rest.slip) == (0.5, 0.5)
    assert np.allclose(rest.displacement, np.linalg.solve(stiffness, force), rtol=0, atol=1e-11)


@pytest.mark.parametrize("law", ["coulomb_3d", "jenkins"])
def test_solving_again_gives_the_same_state(comm, law):
    """The contact starts untouched, whatever was solved on the model before."""
    model = tangential_support(comm, law)
    before, again = at_rest(model, 5.0), at_rest(model, 5.0)
    assert again.displacement == pytest.approx(before.displacement, rel=ROUNDING)
    assert again.load == pytest.approx(before.load, rel=LAST_DIGITS)


@pytest.mark.parametrize("load, carried", [([0.0, 4.0], 0.25), ([0.0, -2.0], 0.5)])
def test_body_that_contact_cannot_hold(comm, load, carried):
    """A mass held by friction alone: mu N0 = 1 is all it carries; the load factor reached is told."""
    model = fw.Model(np.eye(2), np.diag([1.0, 0.0]), None, [contact([[1, 0], [0, 1], [0, 0]], normal_load=N0)], comm)
    with pytest.raises(fw.NotConverged, match="load factor") as error:
        static_preload(model, np.array(load), first(model))
    told = float(str(error.value).split("load factor ")[1].split(":")[0])
    assert told == pytest.approx(carried, rel=1e-3)


def test_the_body_that_is_free_is_named(comm):
    """The second of three masses, alone without a spring, under a load that leaves it alone; then with one on it."""
    stiffness = np.diag([1.0, 0.0, 2.0])
    pads = contact([[1, 0, 0], [0, 1, 0], [0, 0, 1]], normal_load=0.0)
    model = fw.Model(np.eye(3), stiffness, None, [pads], comm)
    reference = first(fw.Model(np.eye(3), K * np.eye(3), None, [], comm))
    for load in ([0.0, 0.0, 0.5], [0.0, 0.3, 0.5]):
        with pytest.raises(fw.NotConverged, match="dof blade_2 most"):
            static_preload(model, np.array(load), reference, names=["blade_1", "blade_2", "blade_3"])
    with pytest.raises(fw.NotConverged, match="dof 1 most"):
        static_preload(model, np.array([0.0, 0.0, 0.5]), reference)


def test_body_pulled_off_its_contact(comm):
    """No spring: the contact lets go at the normal load."""
    model = normal_support(comm, k=0.0, normal_load=N0)
    with pytest.raises(fw.NotConverged, match="load factor 0.5"):
        at_rest(model, -2 * N0)
    assert at_rest(model, -0.5 * N0).displacement == pytest.approx(-0.5 * N0 / KN, rel=ROUNDING)


def test_a_short_branch_is_told_too(comm):
    model = tangential_support(comm)
    with pytest.raises(fw.NotConverged, match="largest number of points"):
        static_preload(model, np.array([5.0]), first(model), fw.StepControl(initial=1e-3, maximum=1e-3, max_points=3))


def test_rest_decides_what_stuck_modes_hold(comm):
    """A gap closed by the load holds, a pair pulled open does not."""
    model = normal_support(comm, gap=0.4)
    assert first(model).omega == pytest.approx(np.sqrt(K), rel=ROUNDING)
    at_rest(model, 3.0)
    assert first(model).omega == pytest.approx(np.sqrt(K + KN), rel=ROUNDING)
    pressed = normal_support(comm, normal_load=N0)
    assert first(pressed).omega == pytest.approx(np.sqrt(K + KN), rel=ROUNDING)
    at_rest(pressed, -2 * N0)
    assert first(pressed).omega == pytest.approx(np.sqrt(K), rel=ROUNDING)


def mode_about(model, rest, orders=(0, 1), samples=64, method="EPMC", dof=0):
    start = first(model)
    problem = fw.NonlinearMode(model, fw.Harmonics(orders, samples), method, dof, start)
    problem.preload(rest.displacement, rest.load)
    return problem


@pytest.mark.parametrize("law", ["coulomb_3d", "coulomb_3d_uncoupled", "jenkins"])
def test_stuck_motion_keeps_the_mean_tangential_force(comm, law):
    """The slider starts from the static state, so the mean force is static, 0.6 of mu N0."""
    model = tangential_support(comm, law)
    static = 0.6 * MU * N0
    rest = at_rest(model, static * (K + KT) / KT)
    problem = mode_about(model, rest)
    y = solve_at(problem, 0.2)
    state, found = problem.state(y), everywhere(problem, problem.contact_period(y))[0]["f"]
    force = found[:, 0 if law == "jenkins" else 1, 0]
    assert problem.diagnostics(y)["stick"] == 1
    assert force.mean() == pytest.approx(static, rel=TIGHT)
    assert np.ptp(force) == pytest.approx(2 * KT * 0.2, rel=TIGHT)
    assert state["omega"] == pytest.approx(np.sqrt(K + KT), rel=TIGHT) and abs(state["zeta"]) < ROUNDING


@pytest.mark.parametrize("amplitude, slips", [(0.26, False), (0.28, True)])
def test_static_force_brings_slip_forward(comm, amplitude, slips):
    """Slip starts where kt a + static = mu N0: a = 0.4 mu N0 / kt = 0.2667."""
    model = tangential_support(comm)
    rest = at_rest(model, 0.6 * MU * N0 * (K + KT) / KT)
    problem = mode_about(model, rest)
    y = solve_at(problem, amplitude)
    force = everywhere(problem, problem.contact_period(y))[0]["f"][:, 1, 0]
    # the slider has gone to where the motion's end is at the limit, and stands there all the period
    mean = MU * N0 - KT * amplitude if slips else 0.6 * MU * N0
    assert force.mean() == pytest.approx(mean, rel=TIGHT)
    assert problem.diagnostics(y)["slip"] == 0


def test_slip_settles_the_slider_once(comm):
    """Play: one-sided slip moves the slider until both turning forces fit; then no work is done."""
    model = tangential_support(comm)
    rest = at_rest(model, 0.6 * MU * N0 * (K + KT) / KT)
    problem = mode_about(model, rest)
    y = solve_at(problem, 0.4)
    found = everywhere(problem, problem.contact_period(y))[0]["f"][:, 1, 0]
    assert found.max() == pytest.approx(MU * N0, rel=TIGHT)
    assert found.min() == pytest.approx(MU * N0 - 2 * KT * 0.4, rel=SOLVED)
    assert problem.diagnostics(y)["work"] == pytest.approx(0, abs=ROUNDING)
    assert abs(problem.state(y)["zeta"]) < ROUNDING


def test_motion_about_a_rest_is_measured_from_it(comm):
    """At a -> 0 the coefficients' mean is the static displacement."""
    model = clamped(comm)
    rest = static_preload(model, np.array([0.3, 0.4, 0.0, 1.0, -0.2]), first(model))
    assert rest.stick == 1
    problem = mode_about(model, rest, (0, 1, 2))
    Q = everywhere(problem, problem.coefficients(problem.initial(1e-6)))
    assert np.allclose(Q[:, 0], rest.displacement, rtol=0, atol=LAST_BIT)
    assert np.abs(whole(problem.residual(problem.initial(1e-2)))).max() < TIGHT


def test_error_of_the_static_part_does_not_hide_a_small_motion(comm):
    """A stiff link carried along by the static displacement, as in any finite-element mesh: neither the static state's
    own residual nor the rounding of K x_static may swamp the stuck mode, which solves its equations without preload.
    """
    stiff = 1e4 * np.array([[1.0, -1.0], [-1.0, 1.0]]) + np.diag([0.0, K])
    model = fw.Model(np.eye(2), stiff, None, [contact([[0, 0], [1, 0], [0, 0]], normal_load=N0)], comm)
    rest = static_preload(model, np.array([0.0, 1.0]), first(model))
    problem = mode_about(model, rest)
    assert rest.stick == 1
    assert np.linalg.norm(whole(problem.residual(problem.initial(1e-4)))) < TIGHT


def test_forced_response_moves_about_the_rest(comm):
    """Stuck: x = x_static + P / (k + kt - w^2 m) cos."""
    model = tangential_support(comm)
    rest = at_rest(model, 1.0)
    start = first(model)
    problem = fw.ForcedResponse(model, fw.Harmonics([0, 1], 32), {1: np.array([0.1])}, 1.0, 0, start)
    problem.preload(rest.displacement, rest.load)
    point = next(iter(fw.Continuation(problem, problem.initial(1.0), (0.9, 1.1))))
    Q = everywhere(problem, problem.coefficients(point.y))
    assert Q[0] == pytest.approx([1.0 / (K + KT), 0.1 / (K + KT - 1.0), 0.0], abs=TIGHT)


@pytest.mark.ranks(1)
def test_a_preload_needs_the_mean(comm):
    model = tangential_support(comm)
    rest = at_rest(model, 1.0)
    with pytest.raises(fw.InputError, match="mean that is not retained"):
        mode_about(model, rest, (1, 3))


def test_a_loaded_jenkins_element_keeps_even_harmonics(comm):
    """Its slider's rest makes the law uneven: odd harmonics are no longer enough, and `choose_harmonics` knows."""
    model = tangential_support(comm, "jenkins")
    assert fw.choose_harmonics(model, 3).orders == (1, 3)
    at_rest(model, 5.0)
    assert fw.choose_harmonics(model, 3).orders == (0, 1, 2, 3)


def test_residual_of_the_static_problem_is_the_balance(comm):
    """y = (x / size, p): the row is (k x + f(x) - p P) / (k_ref size)."""
    from fretwave.solve.preload import StaticPreload

    model = normal_support(comm, gap=0.4)
    problem = StaticPreload(model, np.array([2.0]), first(model))
    size = problem.force_scale / first(model).omega ** 2
    for x in (0.2, 1.0):
        r = whole(problem.residual(unknowns(problem, np.array([x / size, 0.5]))))
        balance = K * x + KN * max(0.0, x - 0.4) - 0.5 * 2.0
        assert r == pytest.approx(balance / problem.force_scale, rel=ROUNDING)


@pytest.mark.parametrize("seed", [8, 42, 108])
def test_a_history_far_from_its_equilibrium(comm, seed):
    """Sliders that stand elsewhere move the structure before any load: Newton finds that as they go there in steps."""
    rng, n, pairs = np.random.default_rng(seed), 4, 3
    A = rng.normal(size=(n, n))
    stiffness, B = A @ A.T + 0.1 * np.eye(n), rng.normal(size=(2 * pairs, n))
    kn = 10 ** rng.uniform(-1, 2, pairs)
    N0 = rng.uniform(0.5, 3, pairs)
    given = {"normal_stiffness": kn, "tangential_stiffness": 0.7 * kn, "friction_coefficient": 0.4, "normal_load": N0}
    model = fw.Model(np.eye(n), stiffness, None, [fw.Contact("coulomb_2d", B, given, "pads")], comm)
    load, history = rng.normal(size=n), rng.normal(size=(pairs, 1))
    rest = static_preload(model, load, sliders={"pads": history})
    u, v = (B @ rest.displacement).reshape(-1, 2).T
    N = np.maximum(N0 + kn * u, 0.0)
    T = np.clip(0.7 * kn * (v - history[:, 0]), -0.4 * N, 0.4 * N)
    left = stiffness @ rest.displacement + B.T @ np.column_stack([N, T]).ravel() - load - B[::2].T @ N0
    assert np.linalg.norm(left) < SOLVED * np.linalg.norm(load)
    assert 0.7 * kn * (v - rest.sliders["pads"][:, 0]) == pytest.approx(T, abs=SOLVED)
