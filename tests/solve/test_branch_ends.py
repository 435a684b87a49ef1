"""What a branch says of its end, what it meets on its way, and how it begins where Newton alone does not."""

from __future__ import annotations

from types import MappingProxyType

import numpy as np
import pytest
from models.core_models import block_on_pads, friction, mode_problem, options, oscillator, single_dof, whole
from oracle import Jenkins, SeriesMotion, System, series_motion
from tolerances import REPEATED, ROUNDING, SOLVED, TIGHT

import fretwave as fw
from fretwave import _core
from fretwave.run.stopped import _advice
from fretwave.solve.starting import Way, mode_start, starts

LOW, HIGH = 0.02, 3.0
#: Of the oscillator's EPMC branch with H = 21 between its two folds: three solutions.
THREE = 0.1350472602799


def epmc(two_dof, comm):
    return mode_problem(oscillator(two_dof, comm), range(1, 22, 2), 1024, "EPMC", start="stuck")


def follow(problem, low, high, report_at=(), **steps):
    branch = fw.Continuation(problem, problem.initial(low), (low, high), fw.StepControl(**steps), report_at)
    return branch, list(branch)


def named(points, event):
    return [p.parameter for p in points if event in p.event.split()]


@pytest.mark.ranks(1)
@pytest.mark.parametrize("maximum", [0.3, 0.1, 0.03])
def test_every_crossing_of_a_reported_value_is_found(two_dof, comm, maximum):
    """One step of 0.3 passes the value three times."""
    branch, points = follow(epmc(two_dof, comm), 0.13, 0.15, [THREE], maximum=maximum)
    assert branch.converged and branch.missed == []
    assert named(points, "report") == pytest.approx([THREE] * 3, rel=ROUNDING)


@pytest.mark.ranks(1)
def test_two_folds_in_a_step_are_found_at_the_same_places_as_by_short_steps(two_dof, comm):
    long, short = (named(follow(epmc(two_dof, comm), LOW, 0.2, maximum=m)[1], "fold") for m in (0.3, 0.02))
    assert len(long) == 2 and long == pytest.approx(short, rel=SOLVED)


@pytest.mark.ranks(1)
def test_a_branch_that_comes_back_has_not_arrived_until_it_turns_again(two_dof, comm):
    """With 50 % damping and H = 21 the complex mode goes over to that of the second mass: the first one's amplitude
    falls to 0.0078 m before it grows again. From 0.05 m that is too far outside, from 0.02 m it is passed."""
    problem = mode_problem(oscillator(two_dof, comm, np.diag([25.3, 0.0])), range(1, 22, 2), 1024, start="stuck")
    branch, points = follow(problem, 0.05, HIGH)
    assert not branch.converged
    assert points[-1].parameter == pytest.approx(0.05 * (0.05 / HIGH) ** (1 / 3), rel=SOLVED)
    assert branch.reason.startswith("the branch comes back to amplitude 0.05, where it began, without reaching")
    branch, points = follow(problem, LOW, HIGH)
    assert branch.converged and points[-1].parameter == pytest.approx(HIGH, rel=SOLVED)
    least = min(p.parameter for p in points)
    assert least == pytest.approx(0.0078, abs=1e-4)
    free = problem.state(points[-1].y)["omega"]
    assert free == pytest.approx(np.sqrt(40.0 / 0.02), rel=0.02)  # of the second mass on its spring


def response(model, level, omega, orders=(1, 3, 5), samples=128):
    reference = fw.linear_modes(model, 1, "free")[0]
    force = np.zeros(model.n_dof)
    force[0] = 1.0
    problem = fw.ForcedResponse(model, fw.Harmonics(list(orders), samples), {1: force}, level, 0, reference)
    return problem, fw.Continuation(problem, problem.initial(omega[0]), omega)


def test_a_response_without_bound_is_no_arrival(two_dof, comm):
    """Friction takes at most 4 R |phi_2| per period and amplitude, a force F does pi F |phi_1|: F = 8.99 is lost."""
    omega = two_dof.omega_free
    most = 4 * 5.0 * 40.0 / (40.0 - 0.02 * omega**2) / np.pi
    for level, bounded in ((0.98 * most, True), (1.02 * most, False)):
        _, branch = response(oscillator(two_dof, comm), level, (22.0, 27.0))
        for point in branch:
            last = point
        assert branch.converged is bounded
        assert last.parameter == pytest.approx(27.0) if bounded else branch.reason == "the response grows without bound"


@pytest.mark.ranks(1)
def test_the_peak_of_a_response_does_not_depend_on_the_step(two_dof, comm):
    found = []
    for maximum in (0.3, 0.03):
        problem, _ = response(oscillator(two_dof, comm), 8.0, (22.0, 27.0), samples=1024)
        branch, points = follow(problem, 22.0, 27.0, maximum=maximum)
        assert branch.converged
        found.append([(p.parameter, problem.state(p.y)["amplitude"]) for p in points if p.event == "peak"])
    assert len(found[0]) == 1 and np.allclose(found[0], found[1], rtol=REPEATED, atol=0)


# Den Hartog's oscillator with a limit of 0.3: most frequencies start in a motion that Newton does not find from zero.
SLIDERS = [("jenkins", 1e2), ("jenkins", 1e3), ("jenkins", 1e4), ("regularised_coulomb", 1e-3)]


@pytest.mark.ranks(1)
@pytest.mark.parametrize("omega", [0.3, 0.5, 0.7, 0.8])
@pytest.mark.parametrize("law, stiffness", SLIDERS)
def test_a_textbook_response_starts(comm, law, stiffness, omega):
    keys = {"jenkins": "tangential_stiffness", "regularised_coulomb": "regularisation_velocity"}
    model = single_dof(comm, law=fw.Contact(law, [[1.0]], {"friction_limit": 0.3, keys[law]: stiffness}))
    problem, branch = response(model, 1.0, (omega, 1.001 * omega), (1, 3, 5, 7), 256)
    first = next(iter(branch))
    assert problem.state(first.y)["amplitude"] > 0.9  # it slides: 1 / (1 - omega^2) less what friction takes
    assert first.residual < TIGHT


def test_raising_the_excitation_leads_to_the_response(comm):
    """The way's end solves the equations of the response, in slip, and is the point that Newton finds from there."""
    model = single_dof(comm, law=friction([[1.0]], 0.3, 1e-3))
    problem, branch = response(model, 1.0, (0.7, 0.71), (1, 3, 5, 7), 256)
    reasons: list[str] = []
    ((how, y),) = starts(fw.Continuation, problem, problem.initial(0.7), reasons)
    assert how.startswith("by raising the excitation from zero in ") and reasons == []
    assert np.linalg.norm(whole(problem.residual(y))) < SOLVED
    first = next(iter(branch))
    assert problem.state(first.y)["amplitude"] == pytest.approx(problem.state(y)["amplitude"], rel=REPEATED)


@pytest.mark.ranks(1)
def test_steps_follow_from_the_branch_not_from_iterations(two_dof, comm):
    """A looser corrector leaves as many points, and each within a thousandth of where it was."""
    found = []
    for tolerance in (1e-10, 1e-8):
        problem = mode_problem(oscillator(two_dof, comm), [1, 3, 5], 1024, start="stuck", prefix="loose_")
        branch = fw.Continuation(problem, problem.initial(LOW), (LOW, 0.5))
        branch.snes.setTolerances(atol=tolerance)
        found.append([p.parameter for p in branch])
    assert len(found[0]) == len(found[1]) and np.allclose(found[0], found[1], rtol=1e-3, atol=0)


def elastic_slider(comm, two_dof, stiffness):
    """The oscillator with an elastic slider in place of the smooth damper."""
    law = fw.Contact("jenkins", two_dof.B, {"tangential_stiffness": stiffness, "friction_limit": 5.0})
    return fw.Model(two_dof.M, two_dof.K, None, [law], comm)


@pytest.mark.ranks(1)
@pytest.mark.parametrize("stiffness", [1e6, 1e8, 1e10, 1e12])
def test_stiff_sliders_are_followed(two_dof, comm, stiffness):
    """From stuck to free, by a first slip over 5 N / kt. Zeta at the peak is that of the oracle."""
    problem = mode_problem(elastic_slider(comm, two_dof, stiffness), [1, 3, 5, 7], 16, start="stuck")
    branch, points = follow(problem, LOW, HIGH)
    assert branch.converged, branch.reason
    states = [problem.state(p.y) for p in points]
    assert states[0]["omega0"] == pytest.approx(two_dof.omega_stuck, rel=1e-4)
    assert states[-1]["omega0"] == pytest.approx(two_dof.omega_free, rel=1e-3)
    peak = max(range(len(states)), key=lambda k: states[k]["zeta"])
    rounding = 3e-10 + 3e-20 * stiffness  # the oracle's own, of forces kt u
    exact = in_continuous_time(two_dof, stiffness, problem, points[peak].y, rounding)
    for name in ("omega0", "zeta"):
        assert states[peak][name] == pytest.approx(getattr(exact, name), rel=SOLVED + 10 * rounding)
    # rounding of forces kt u against inertia k a
    assert max(p.residual for p in points) < SOLVED + 8 * np.finfo(float).eps * stiffness / 640


def in_continuous_time(two_dof, stiffness, problem, y, tolerance):
    """The oracle's complex mode at a point's amplitude, in the same harmonics."""
    state, Q, orders = problem.state(y), problem.coefficients(y), problem.harmonics.orders
    q = np.zeros((2, orders[-1] + 1), complex)
    q[:, orders] = Q[:, ::2] - 1j * Q[:, 1::2]
    damper = Jenkins(two_dof.B[0], stiffness, 5.0)
    system = System(two_dof.M, np.zeros((2, 2)), two_dof.K, [damper], np.zeros(2), omega=1)
    exponent = state["omega0"] * complex(-state["zeta"], np.sqrt(1 - state["zeta"] ** 2))
    guess = SeriesMotion(system, "CNM", q, exponent, 2 * state["zeta"] * state["omega0"], 0.0, [])
    return series_motion(system, "CNM", orders[-1], amplitude=state["amplitude"], guess=guess, tolerance=tolerance)


def stop(comm, stiffness, gap=0.0):
    """One mass on a spring beside a one-sided stop, with 5 % damping."""
    B = np.array([[1.0], [0.0], [0.0]])
    values = {
        "normal_stiffness": stiffness,
        "tangential_stiffness": 1.0,
        "friction_coefficient": 0.0,
        "normal_load": 0.0,
        "gap": gap,
    }
    return fw.Model(np.eye(1), np.eye(1), 0.1 * np.eye(1), [fw.Contact("coulomb_3d", B, values)], comm)


@pytest.mark.ranks(1)
def test_a_response_at_a_stiff_stop_starts_by_closing_its_gap(comm):
    """Its equations are the same at every level: raising the excitation leads nowhere."""
    problem, branch = response(stop(comm, 1e4), 1.0, (0.9, 0.91), range(8), 128)
    first = next(iter(branch))
    assert branch.started.startswith("by closing the gaps from where nothing touches in ")
    assert np.linalg.norm(whole(problem.residual(first.y))) < REPEATED


@pytest.mark.ranks(1)
def test_a_mode_at_a_stiff_stop_is_the_bilinear_oscillator(comm):
    """Half a period on each spring, w = 2 / (1 + 1/sqrt(1 + kn)), at every amplitude; 5e-3 for harmonics left out."""
    model = fw.Model(np.eye(1), np.eye(1), None, stop(comm, 100.0).contacts, comm)
    problem = mode_problem(model, range(16), 512, "EPMC", start="free")
    branch, points = follow(problem, 0.1, 0.2)
    assert branch.converged and branch.started.startswith("by closing the gaps")
    found = [problem.state(p.y)["omega0"] for p in points]
    assert np.allclose(found, 2 / (1 + 1 / np.sqrt(101.0)), rtol=5e-3, atol=0)


CIRCLING = "the branch turns in circles between corners at amplitude "
ROUND = np.array([[4.48768243, -2.13970772], [-2.13970772, 3.19642204]])
ZIGZAG = np.array(
    [
        [3.15184523, -9.39151427, -7.30865892, -8.22659686],
        [-9.39151427, 44.18339542, 30.93515169, 30.78620325],
        [-7.30865892, 30.93515169, 33.68747622, 21.1675458],
        [-8.22659686, 30.78620325, 21.1675458, 28.74715786],
    ]
)


def beside_a_stop(comm, mass, K, kn, gap, highest):
    """A mode of masses of which the last one meets a stop without friction."""
    B = np.zeros((3, len(K)))
    B[0, -1] = 1.0
    contact = fw.Contact("coulomb_3d", B, stop(comm, kn, gap).contacts[0].parameters)
    model = fw.Model(np.diag(mass), K, None, [contact], comm)
    fw.balanced(model)
    return mode_problem(model, range(highest + 1), 64, "EPMC", start="stuck")


def round_trip(comm, low):
    problem, step = beside_a_stop(comm, [0.75266934, 0.12267505], ROUND, 432405.979, 149.501534, 15), 0.0200976
    return follow(problem, low, 3485.7, initial=step, maximum=step, max_angle=0.437)


def zigzag(comm, maximum):
    mass = [0.13192189, 0.19541109, 0.29966274, 0.11449335]
    problem = beside_a_stop(comm, mass, ZIGZAG, 14445.0631, 20.9304189, 5)
    return follow(problem, 4.0140814, 244.771, initial=0.05, maximum=maximum, max_angle=0.776)


@pytest.mark.ranks(1)
@pytest.mark.parametrize("low", [14.0, 20.0, 30.0])
def test_a_corner_beside_a_fold_does_not_lead_round(comm, low):
    """By determinants alone it circled beside its third fold; it turns there and comes back to where it began.

    The fold is at 245.2836, in short steps; a corner may be cut by 1e-4.
    """
    branch, points = round_trip(comm, low)
    assert branch.reason.startswith(f"the branch comes back to amplitude {low:g}, where it began")
    assert max(p.parameter for p in points) == pytest.approx(245.2836, rel=1e-4)


@pytest.mark.ranks(1)
@pytest.mark.parametrize("maximum", [0.0657, 0.0807, 0.0957])
def test_a_branch_point_beside_a_corner_is_passed(comm, maximum):
    """By determinants alone there were up to 132 folds within 1e-4 of an amplitude."""
    branch, points = zigzag(comm, maximum)
    assert branch.converged and len(points) < 200
    assert len(named(points, "fold")) == 2


def on_block(block, highest):
    start = fw.linear_modes(block, 1)[0]
    rest = fw.balanced(block, start)
    return fw.NonlinearMode(block, fw.Harmonics(range(highest + 1), 128), "CNM", 0, start, rest=rest)


def along_block(block, highest, high, tuned=MappingProxyType({}), **steps):
    problem = on_block(block, highest)
    with options(**tuned):
        branch, points = follow(problem, 0.01, high, **steps)
    return branch, len(points), problem.state(points[-1].y)["zeta"]


@pytest.mark.ranks(1)
def test_what_opens_softly_is_no_corner():
    """The Jacobian hardly changes where one of eight pads first opens: walked to as corners, 13 more points."""
    block = block_on_pads(100.0, np.linspace(0.2, 1.0, 8) / 8)
    branch, points, damping = along_block(block, 7, 2.0)
    walked, more, same = along_block(block, 7, 2.0, {"fw_branch_seen_jump": 1e-12})
    assert branch.converged and walked.converged
    assert points <= more - 5 and damping == pytest.approx(same, rel=SOLVED)


@pytest.mark.ranks(1)
@pytest.mark.parametrize("highest", [13, 21])
def test_no_step_leads_onto_a_loop_that_lies_beside(highest):
    """At 0.0195 the branch bends sharply, and a step across leads onto a loop 1e-3 beside it: it ended there."""
    block = block_on_pads(5.0)
    short, most, exactly = along_block(block, highest, 5.0, maximum=0.03)
    branch, points, damping = along_block(block, highest, 5.0)
    assert short.converged and branch.converged and points < most / 2
    assert damping == pytest.approx(exactly, rel=SOLVED)


@pytest.mark.ranks(1)
@pytest.mark.parametrize(("stiffness", "friction", "folds"), [(4.0, 0.1, 2), (8.0, 0.3, 12)])
def test_no_step_passes_over_a_loop(stiffness, friction, folds):
    """Motions and folds are those of short steps. Steps as they come passed over two folds, at 1.3 and at 0.03."""
    seen = []
    for steps in ({}, {"maximum": 0.05}):
        problem = on_block(block_on_pads(stiffness, friction=friction), 5)
        branch, points = follow(problem, 0.01, 2.0, report_at=[0.02, 1.0], **steps)
        assert branch.converged
        seen.append([problem.state(p.y)["zeta"] for p in points if p.event == "report"])
        assert len(named(points, "fold")) == folds
    assert len(seen[0]) > 2 and seen[0] == pytest.approx(seen[1], rel=SOLVED)


def pad_and_sliders(comm):
    """A pad and three sliders between four masses."""
    mass = [0.323236788, 0.494478107, 0.235764124, 0.108855614]
    K = [
        [13.354076038, 3.774346065, -1.274953862, -1.588611333],
        [3.774346065, 2.693935833, -0.421162817, -0.388004946],
        [-1.274953862, -0.421162817, 0.73172425, -0.025338659],
        [-1.588611333, -0.388004946, -0.025338659, 0.40220166],
    ]
    pad = {"normal_stiffness": 6515.451, "tangential_stiffness": 4270.2004, "friction_coefficient": 0.174800164}
    sliders = {"tangential_stiffness": 33612.511, "friction_limit": 0.010319993}
    between = [[0.0, 0.0, 1.0, -1.0], [-1.0, 0.0, 0.0, 1.0], [1.0, -1.0, 0.0, 0.0]]
    contacts = [
        fw.Contact("coulomb_3d", np.eye(4)[1:], {**pad, "normal_load": 0.610001397, "gap": 0.0}, "pad"),
        fw.Contact("jenkins", between, sliders, "sliders"),
    ]
    model = fw.Model(np.diag(mass), np.array(K), None, contacts, comm)
    rest, stuck = fw.balanced(model), fw.linear_modes(model, 1)[0]
    return fw.NonlinearMode(model, fw.Harmonics(range(8), 256), "CNM", 3, stuck, rest=rest)


@pytest.mark.ranks(1)
@pytest.mark.parametrize("maximum", [0.04, 0.05, 0.1])
def test_a_branch_point_where_nothing_changes_its_state_is_passed(comm, maximum):
    """A determinant changes its sign at 2.7706e-6 m within a piece, in steps of 1e-4: the branch turned back there.

    At 2.4456e-6 two samples change their states at once by symmetry. In a solution's last digits one is first: the
    branch left for one of two asymmetric motions, by steps of 0.04 and not by others, and came back at 2.5027e-6.
    """
    branch, points = follow(pad_and_sliders(comm), 2e-6, 2.9e-6, initial=0.01, maximum=maximum, max_angle=0.5485)
    assert branch.converged, branch.reason
    assert len(named(points, "fold")) == 18 and len(points) < 400


@pytest.mark.ranks(1)
def test_a_branch_that_goes_round_in_circles_ends(comm):
    """Without what shows which way it goes on: by the same points in each round, and where these are not looked at."""
    with options(fw_branch_meets=1e-300, fw_branch_surely_in=1e300, fw_branch_certain=1e9):
        branches = [zigzag(comm, maximum) for maximum in (0.0657, 0.0957)]
        with options(fw_branch_again=1e-300):
            branches.append(zigzag(comm, 0.0657))
    for branch, points in branches:
        assert branch.reason.startswith(CIRCLING) and len(points) < 500
        assert "shorter steps" in _advice("mode", branch.reason)


def ways(comm):
    """Problems on the way to a response and to a mode whose stop is in touch."""
    problem, _ = response(stop(comm, 3.0), 1.0, (0.9, 0.91), range(4), 64)
    yield Way(problem, _core.ForcedStart(problem.core, problem.initial(0.9), True)), problem
    yield Way(problem, _core.ForcedStart(problem.core, problem.initial(0.9), False)), problem
    mode = mode_problem(stop(comm, 3.0), range(4), 64, "EPMC", start="free")
    yield Way(mode, mode_start(mode, mode.initial(0.7))), mode


@pytest.mark.ranks(1)
def test_ways_to_a_start_have_exact_derivatives(comm):
    for way, problem in ways(comm):
        y = way.core.initial()
        values, rng = y.getArray().copy(), np.random.default_rng(3)
        values[: 2 * 4 - 1] = 0.4 * rng.standard_normal(7)
        values[-1] = 0.1

        def residual(x, way=way, y=y):
            at = y.copy()
            at.setArray(x)
            return whole(way.residual(at)).copy()

        step = rng.standard_normal(len(values))
        there, direction = y.copy(), y.copy()
        there.setArray(values), direction.setArray(step)
        exact = whole(way.jacobian_product(there, direction))
        assembled = way.jacobian(there).convert("dense").getDenseArray() @ step
        differences = (residual(values + 1e-7 * step) - residual(values - 1e-7 * step)) / 2e-7
        assert np.allclose(exact, differences, rtol=0, atol=1e-5 * abs(exact).max())
        assert np.allclose(exact, assembled, rtol=0, atol=ROUNDING * abs(exact).max())
        # the law they share stands where it stood once the problem itself is evaluated
        problem.residual(y)


def test_a_piece_is_told_by_its_number(two_dof, comm):
    """Same number while the sequence of states is the same: another one beyond first slip, and on every rank."""
    problem = mode_problem(elastic_slider(comm, two_dof, 1e4), [1, 3, 5], 128, start="stuck")
    first = 5.0 / 1e4 / abs(problem.start.shape[1] / problem.start.shape[0])  # amplitude at which it slips
    numbers = [problem.core.piece(problem.initial(a * first)) for a in (0.1, 0.5, 0.999, 1.001, 1.5, 7.0)]
    assert len(set(numbers[:3])) == 1 and len(set(numbers[3:])) == 1 and len(set(numbers)) == 2
    assert comm.allgather(numbers) == [numbers] * comm.size


@pytest.mark.ranks(1)
def test_a_response_may_leave_the_range_where_it_began_and_come_in_again(comm):
    """A stop of ten times the spring: the branch from 0.4 rad/s folds back below it first, and arrives all the same."""
    problem, branch = response(stop(comm, 10.0), 1.0, (0.4, 0.6), range(8), 256)
    omega = [p.parameter for p in branch]
    assert branch.converged and omega[-1] == pytest.approx(0.6)
    assert 0.39 < min(omega) < 0.4


@pytest.mark.ranks(1)
def test_a_stop_value_within_a_corner_is_an_end(comm):
    """The pad's mean shakes down there, by 1.6 amplitudes while the amplitude grows by 2e-5 of itself. Where rounding
    lets the corrector fail at the stop value, a step that turns the corner is as long the next time: it was tried again
    for ever."""
    M = np.diag([0.5353060186860404, 0.20151676673666646, 0.1989192380091729])
    K = np.array(
        [
            [3233.247173327989, -362.9078630299418, 1248.1192452434084],
            [-362.9078630299418, 98.82698582487347, -59.625855581585256],
            [1248.1192452434084, -59.625855581585256, 617.1231145510654],
        ]
    )
    stiff = {"normal_stiffness": 1377977.5851226435, "tangential_stiffness": 492149.9308281881}
    pad = {**stiff, "friction_coefficient": 0.013638073087847874, "normal_load": 58.46723536602342, "gap": 0.0}
    rub = {"friction_limit": 293.60260822536407, "regularisation_velocity": 0.04479277398266465}
    contacts = [
        fw.Contact("coulomb_3d", np.eye(3), pad),
        fw.Contact("regularised_coulomb", np.array([[0.0, 1.0, -1.0]]), rub),
    ]
    with fw.Model(M, K, None, contacts, comm) as model:
        first = fw.linear_modes(model, 1, "stuck")[0]
        rest = fw.balanced(model, first)
        stop = 1.145656533236825e-06
        problem = fw.NonlinearMode(model, fw.Harmonics(range(4), 8), "CNM", 1, first)
        problem.preload(rest.displacement, rest.load)
        branch = fw.Continuation(problem, problem.initial(stop / 100), (stop / 200, stop), upwards=True)
        points = list(branch)
    assert branch.converged or "stop value" in branch.reason or "step too small" in branch.reason
    assert points[-1].parameter == pytest.approx(stop, rel=1e-6)
