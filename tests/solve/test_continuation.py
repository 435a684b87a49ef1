"""Pseudo-arclength continuation: folds, located events, stop rules, restart, failures that are reported."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from models.core_models import TanhLaw, counting, dense, mode_problem, options, oscillator, single_dof, whole
from tolerances import LAST_BIT, LAST_DIGITS, REPEATED, ROUNDING, TIGHT

import fretwave as fw

LOW, HIGH = 0.02, 3.0


def problem_of(two_dof, comm, C=None, prefix="mode_"):
    """CNM of the paper's oscillator, H = 21: two folds between 0.133 and 0.135."""
    return mode_problem(oscillator(two_dof, comm, C), range(1, 22, 2), 512, start="stuck", prefix=prefix)


def follow(problem, start=LOW, stop=(LOW, HIGH), report_at=(), upwards=None, **steps):
    branch = fw.Continuation(problem, problem.initial(start), stop, fw.StepControl(**steps), report_at, upwards)
    return branch, list(branch)


def named(points, event):
    return [p for p in points if p.event == event]


def test_branch_goes_through_both_folds_without_a_gap(two_dof, comm):
    """The amplitude goes back between the folds; no step is longer than allowed."""
    branch, points = follow(problem_of(two_dof, comm), maximum=0.2)
    assert branch.converged and branch.reason == "stop value reached"
    first, second = (p.index for p in named(points, "fold"))
    a = np.array([p.parameter for p in points])
    assert (np.diff(a[: first + 1]) > 0).all() and (np.diff(a[second:]) > 0).all()
    assert (np.diff(a[first : second + 1]) < 0).all()
    assert max(p.step for p in points) <= 0.2
    assert [p.index for p in points] == list(range(len(points)))
    assert (points[0].event, points[-1].event) == ("start", "stop")


def test_last_digits_change_no_step(two_dof, comm):
    """A damping ratio of 2e-11 changes the motion as another order of additions does."""
    runs = [follow(problem_of(two_dof, comm, C))[1] for C in (None, 1e-9 * np.eye(2))]
    steps, changed = ([p.step for p in points if not p.event] for points in runs)
    assert len(steps) > 20 and steps == changed
    assert not np.array_equal(*(whole(points[-2].y) for points in runs))


def test_every_point_solves_the_equations_to_the_tolerance(two_dof, comm):
    """Newton's absolute tolerance on the dimensionless residual: 1e-10."""
    problem = problem_of(two_dof, comm)
    _, points = follow(problem)
    for p in points:
        assert np.linalg.norm(whole(problem.residual(p.y))) <= TIGHT
        assert p.residual <= TIGHT


def test_tangent_lies_in_the_null_space_of_the_jacobian(two_dof, comm):
    """J t = 0, t of unit length in the weighted norm, hence no entry above the motion's own size."""
    problem = problem_of(two_dof, comm)
    _, points = follow(problem)
    for p in points[::7]:
        J, t = dense(problem.jacobian(p.y)), whole(p.tangent)
        assert np.abs(J @ t).max() < ROUNDING * np.abs(J).max()


def test_amplitude_is_stationary_at_a_fold(two_dof, comm):
    """d log a / ds = 0, the last entry of the unit tangent; elsewhere it is not."""
    _, points = follow(problem_of(two_dof, comm))
    folds = named(points, "fold")
    assert len(folds) == 2
    assert max(abs(whole(p.tangent)[-1]) for p in folds) < REPEATED
    assert abs(whole(points[0].tangent)[-1]) > 0.1


@pytest.mark.ranks(1)
def test_fold_is_an_extremum_of_the_amplitude(two_dof, comm):
    _, points = follow(problem_of(two_dof, comm))
    highest, lowest = named(points, "fold")
    around = [points[p.index + k].parameter for p in (highest,) for k in (-1, 1)]
    assert highest.parameter > max(around)
    assert lowest.parameter < min(points[lowest.index + k].parameter for k in (-1, 1))


def test_same_folds_from_above(two_dof, comm):
    """The branch does not know its direction."""
    up = named(follow(problem_of(two_dof, comm))[1], "fold")
    branch, points = follow(problem_of(two_dof, comm), start=HIGH)
    assert branch.converged and points[-1].parameter == pytest.approx(LOW, rel=LAST_DIGITS)
    down = [p.parameter for p in named(points, "fold")]
    assert down[::-1] == pytest.approx([p.parameter for p in up], rel=TIGHT)


@pytest.mark.ranks(1)
@pytest.mark.parametrize("event", ["fold", "peak_damping"])
def test_events_do_not_depend_on_the_step(two_dof, comm, event):
    """Located on the branch, not interpolated between points."""
    found = []
    for maximum in (0.3, 0.02):
        found.append([p.parameter for p in named(follow(problem_of(two_dof, comm), maximum=maximum)[1], event)])
    assert found[0] == pytest.approx(found[1], rel=REPEATED)


@pytest.mark.ranks(1)
def test_peak_damping_is_a_maximum(two_dof, comm):
    problem = problem_of(two_dof, comm)
    _, points = follow(problem, maximum=0.05)
    zeta = [problem.state(p.y)["zeta"] for p in points]
    (peak,) = named(points, "peak_damping")
    assert zeta[peak.index] == max(zeta)


def test_zero_damping_is_located(two_dof, comm):
    """Flutter case: both crossings, |zeta| below 1e-10, damping falls through zero at one and rises at the other."""
    problem = problem_of(two_dof, comm, two_dof.negative_damping())
    _, points = follow(problem)
    crossings = named(points, "zero_damping")
    assert len(crossings) == 2
    assert max(abs(problem.state(p.y)["zeta"]) for p in crossings) < TIGHT
    signs = [[np.sign(problem.state(points[p.index + k].y)["zeta"]) for k in (-1, 1)] for p in crossings]
    assert signs == [[-1, 1], [1, -1]]


def test_reported_and_stop_values_are_met_exactly(two_dof, comm):
    """Newton runs at the parameter itself; exp(log a) is all the rounding there is."""
    wanted = [0.05, 0.1, 0.5, 2.5]
    _, points = follow(problem_of(two_dof, comm), report_at=wanted)
    assert [p.parameter for p in named(points, "report")] == pytest.approx(wanted, rel=LAST_BIT)
    assert points[-1].parameter == pytest.approx(HIGH, rel=LAST_BIT)


@pytest.mark.parametrize("upwards", [True, False])
def test_ends_that_are_reported_as_well_are_one_point_each(two_dof, comm, upwards):
    """The branch starts at one of them, and stops at the other."""
    given = {"start": LOW if upwards else 0.1, "stop": (LOW, 0.1), "upwards": upwards}
    _, plain = follow(problem_of(two_dof, comm), **given)
    branch, points = follow(problem_of(two_dof, comm), report_at=[LOW, 0.1], **given)
    assert [p.parameter for p in points] == [p.parameter for p in plain]
    assert branch.converged and branch.reason == "stop value reached"
    assert [p.event for p in points] == [*(p.event for p in plain[:-1]), "report"]


@pytest.mark.parametrize("maximum", [0.3, pytest.param(0.02, marks=pytest.mark.ranks(1))])
def test_amplitude_between_the_folds_is_reported_on_each_of_the_three_sheets(two_dof, comm, maximum):
    """a = 0.1343 is passed upwards, back, and upwards again; zeta grows all along."""
    problem = problem_of(two_dof, comm)
    _, points = follow(problem, report_at=[0.1343], maximum=maximum)
    assert [p.parameter for p in named(points, "report")] == pytest.approx([0.1343] * 3, rel=LAST_DIGITS)
    zeta = [problem.state(p.y)["zeta"] for p in points if 0.1 < p.parameter < 0.15]
    assert (np.diff(zeta) > 0).all()


# The folds lie between points 17 and 24; one cut is enough on several ranks
CUTS = [19, *(pytest.param(cut, marks=pytest.mark.ranks(1)) for cut in (0, 1, 7, 17, 18, 30))]


@pytest.mark.parametrize("cut", CUTS)
def test_restored_branch_is_the_same_bit_for_bit(two_dof, comm, cut):
    """Same ranks: the joined branch equals the uninterrupted one, also when cut between the events of one step."""
    arguments = {"stop": (LOW, 0.5), "report_at": [0.1, 0.1343, 0.2]}
    problem = problem_of(two_dof, comm)
    _, uninterrupted = follow(problem, **arguments)
    branch = fw.Continuation(problem, problem.initial(LOW), **arguments)
    for point in branch:
        if point.index == cut:
            break
    snapshot = branch.snapshot()
    if comm.size == 1:  # to be kept by whatever keeps arrays
        snapshot = pickle.loads(pickle.dumps(snapshot))
        snapshot["y"] = list(snapshot["y"])
    branch.destroy()
    joined = list(fw.Continuation.restore(problem_of(two_dof, comm), snapshot, **arguments))
    rest = uninterrupted[cut + 1 :]
    assert [(p.index, p.event, p.newton) for p in joined] == [(p.index, p.event, p.newton) for p in rest]
    for p, q in zip(joined, rest):
        assert p.parameter == q.parameter and np.array_equal(whole(p.y), whole(q.y))


def test_state_of_another_problem_is_refused(two_dof, comm):
    branch = fw.Continuation(problem_of(two_dof, comm), problem_of(two_dof, comm).initial(LOW), (LOW, HIGH))
    next(iter(branch))
    snapshot = branch.snapshot()
    other = mode_problem(oscillator(two_dof, comm), [1, 3], 64, start="stuck")
    with pytest.raises(fw.InputError, match="another problem"):
        fw.Continuation.restore(other, snapshot, (LOW, HIGH))


def test_largest_number_of_points_ends_the_branch(two_dof, comm):
    branch, points = follow(problem_of(two_dof, comm), max_points=10)
    assert branch.reason == "largest number of points" and len(points) == 10


def test_failure_at_the_start_is_reported(two_dof, comm):
    """Non-convergence is a return value (STYLE): no point, a reason, no exception.

    With one step of Newton's the mode without contact would do for a start.
    """
    with options(fails_snes_max_it=0):
        branch, points = follow(problem_of(two_dof, comm, prefix="fails_"), start=0.2)
    assert points == [] and not branch.converged
    assert branch.reason.startswith("no solution at the start: ") and "MAX_IT" in branch.reason


def test_law_that_returns_nan_is_a_failure_at_the_start(comm):
    class NotANumber(TanhLaw):
        def force(self, u, v):
            return np.full_like(v, np.nan)

    problem = mode_problem(single_dof(comm, law=NotANumber(1.0, 1.0)), [1], 16)
    branch, points = follow(problem, start=1.0, stop=(0.5, 2.0))
    assert points == [] and branch.reason.startswith("no solution at the start: ")


class EndsAbove(TanhLaw):
    """No force above a displacement: the branch has no further points there."""

    def force(self, u, v):
        return np.where(np.abs(u).max() > 1.0, np.nan, super().force(u, v))


def test_step_too_small_tells_why(comm):
    """A law without a value beyond 1 m: the points found stay, the reason is Newton's."""
    problem = mode_problem(single_dof(comm, law=EndsAbove(0.1, 1.0)), [1], 16)
    branch, points = follow(problem, start=0.1, stop=(0.1, 5.0))
    assert not branch.converged and len(points) > 3
    assert branch.reason.startswith("step too small: ")
    assert 0.9 < points[-1].parameter <= 1.0


def test_nothing_is_asked_for_beyond_the_end(comm):
    """Where the next step would pass the end of the range, it ends there: what lies behind may be far harder."""
    asked = []

    class Listens(TanhLaw):
        def force(self, u, v):
            if len(u) > 5:  # else samples of it, by themselves
                asked.append(np.abs(u).max(initial=0.0))
            return super().force(u, v)

    for start, upwards in ((0.1, True), (1.0, False)):
        asked.clear()
        problem = mode_problem(single_dof(comm, law=Listens(0.1, 1.0)), [1], 16)
        branch, points = follow(problem, start=start, stop=(0.1, 1.0), upwards=upwards, initial=0.3)
        assert branch.converged and points[-1].parameter == pytest.approx(1.0 if upwards else 0.1, rel=LAST_DIGITS)
        assert points[-1].event == "stop" and points[-1].newton > 1
        if comm.rank == 0:  # the only dof's
            assert max(asked) < 1.05 and min(u for u in asked if u > 0) > 0.095


def test_linear_problem_takes_one_newton_iteration(two_dof, comm):
    """At a fixed frequency a linear response is one linear solve."""
    model = fw.Model(two_dof.M, two_dof.K, np.diag([0.5, 0.01]), comm=comm)
    reference = fw.linear_modes(model, 1, "free")[0]
    forced = fw.ForcedResponse(model, fw.Harmonics([1], 8), {1: np.array([1.0, 0.0])}, 1.0, 0, reference)
    branch = fw.Continuation(forced, forced.initial(20.0), (15.0, 30.0))
    assert next(iter(branch)).newton == 1


def test_linear_mode_takes_at_most_two_newton_iterations(comm):
    """Without contact the mode is linear: the first guess solves it, and steps in log a change nothing else."""
    problem = mode_problem(single_dof(comm, 2.0, 3.0), [1, 3], 16)
    branch, points = follow(problem, start=0.1, stop=(0.1, 10.0))
    assert branch.converged and max(p.newton for p in points) <= 2
    for p in points:
        state = problem.state(p.y)
        assert (state["omega"], state["zeta"]) == (
            pytest.approx(np.sqrt(1.5), rel=ROUNDING),
            pytest.approx(0, abs=ROUNDING),
        )


def test_bad_inputs_are_refused(two_dof, comm):
    problem = problem_of(two_dof, comm)
    model, linear, h = problem.model, problem.start, problem.harmonics
    attempts = [
        lambda: fw.Continuation(problem, problem.initial(LOW), (HIGH, LOW)),
        lambda: problem.initial(0.0),
        lambda: problem.initial(-1.0),
        lambda: fw.NonlinearMode(model, h, "cnm", 0, linear),
        lambda: fw.NonlinearMode(model, h, "CNM", 2, linear),
        lambda: fw.NonlinearMode(model, h, "CNM", -1, linear),
        lambda: fw.NonlinearMode(model, h, "CNM", 1, linear),  # m2 does not move when stuck
    ]
    for attempt in attempts:
        with pytest.raises(fw.InputError):
            attempt()


@pytest.mark.ranks(1, 2)
def test_a_singular_start_is_a_failed_step_not_a_failed_run(comm):
    """The second mass is free: harmonic 0 of its motion is undetermined."""
    spring = fw.Contact(SmallCubic(), [[1.0, 0.0]])
    model = fw.Model(np.eye(2), np.diag([1.0, 0.0]), contacts=[spring], comm=comm)
    start = fw.LinearMode(1.0, 0.0, np.array([1.0, 0.0]), np.zeros(2))
    problem = fw.NonlinearMode(model, fw.Harmonics([0, 1], 16), "CNM", 0, start)
    branch = fw.Continuation(problem, problem.initial(0.1), (0.1, 1.0))
    assert list(branch) == []
    assert not branch.converged and "no solution at the start" in branch.reason


class SmallCubic(fw.PythonLaw):
    odd, stuck_stiffness = True, 0.0

    def force(self, u, v):
        return 1e-3 * u**3

    def tangent(self, u, v):
        return (3e-3 * u**2)[:, None], np.zeros_like(v)[:, None]


@pytest.mark.ranks(1)
def test_an_event_takes_two_correctors(two_dof, comm):
    """Newton's solves over points, in steps so short that none is tried twice; the stop is solved for again once."""
    with counting("SNESSolve") as solves:
        _, points = follow(problem_of(two_dof, comm), maximum=0.025)
        beyond = solves() - len(points) - 1
    assert len(named(points, "fold")) == 2 and len(named(points, "peak_damping")) == 1
    assert beyond + 3 == 2 * 3  # a corrector each is a point's own


@pytest.mark.ranks(1)
def test_a_way_has_the_points_of_the_branch_but_its_peaks(two_dof, comm):
    """Nor the solves for them. Of steps of full length, correctors close in on a fold to the end: 47 solves where they
    fell back on regula falsi.
    """
    found, solved = [], []
    for way in (False, True):
        problem = problem_of(two_dof, comm)
        control = fw.StepControl(initial=0.3, maximum=1.0, max_error=1e-2)
        with counting("SNESSolve") as solves:
            branch = fw.Continuation(problem, problem.initial(0.1), (0.05, HIGH), control, way=way)
            found.append(list(branch))
            solved.append(solves())
        assert branch.converged
    branch, way = found
    peaks = named(branch, "peak_damping")
    kept = [p for p in branch if p not in peaks]
    assert len(peaks) == 1 and 3 <= solved[0] - solved[1] <= 4
    assert len(named(way, "fold")) == 2 and solved[1] <= 46
    assert [p.event for p in kept] == [p.event for p in way]
    np.testing.assert_allclose([p.parameter for p in kept], [p.parameter for p in way], ROUNDING)
