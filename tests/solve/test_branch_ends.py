"""What a branch says of its end, and what it meets on its way: reported values, folds, peaks, a first slip."""

from __future__ import annotations

import numpy as np
import pytest
from models.core_models import mode_problem, oscillator
from models.followed import follow, named, response, stop
from oracle import Jenkins, SeriesMotion, System, series_motion
from tolerances import REPEATED, ROUNDING, SOLVED

import fretwave as fw

LOW, HIGH = 0.02, 3.0
#: Of the oscillator's EPMC branch with H = 21 between its two folds: three solutions.
THREE = 0.1350472602799


def epmc(two_dof, comm):
    return mode_problem(oscillator(two_dof, comm), range(1, 22, 2), 1024, "EPMC", start="stuck")


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
        fw.Contact("coulomb_3d", np.eye(3), pad, "pad"),
        fw.Contact("regularised_coulomb", np.array([[0.0, 1.0, -1.0]]), rub, "rub"),
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
