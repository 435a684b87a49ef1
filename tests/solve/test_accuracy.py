"""Harmonics and samples that an accuracy chooses along a branch: kept against the exact oracle, and said where not."""

from __future__ import annotations

import numpy as np
import pytest
from models.core_models import TanhLaw
from mpi4py import MPI
from oracle import Jenkins, SeriesMotion, System, series_motion
from tolerances import REPEATED, ROUNDING, SOLVED

import fretwave as fw
from fretwave.solve import accuracy as rules
from fretwave.solve.refining import RefiningContinuation

M, K = np.diag([1.0, 0.02]), np.array([[640.0, -40.0], [-40.0, 40.0]])
KT, LIMIT = 400.0, 5.0
AMPLITUDES = [0.137, 0.155, 0.5, 2.0]
PAPER = System(M, np.zeros((2, 2)), K, [Jenkins(np.array([0.0, 1.0]), KT, LIMIT)])
SERIAL = pytest.mark.ranks(1)


def jenkins(comm=MPI.COMM_SELF):
    slider = fw.Contact("jenkins", [[0.0, 1.0]], {"tangential_stiffness": KT, "friction_limit": LIMIT})
    return fw.Model(M, K, None, [slider], comm)


def tanh(velocity=0.2):
    given = {"friction_limit": LIMIT, "regularisation_velocity": velocity}
    return fw.Model(M, K, None, [fw.Contact("regularised_coulomb", [[0.0, 1.0]], given)])


def mode(model, harmonics=5, samples=128):
    return fw.NonlinearMode(model, fw.choose_harmonics(model, harmonics, samples), "CNM", 0)


def exact(branch, row, factor=1.0):
    """lambda with 401 harmonics in continuous time at the amplitude of a row, times a factor."""
    orders, Q = branch.problem.harmonics.orders, branch.coefficients(row)
    q = np.zeros((2, orders[-1] + 1), complex)
    for k, n in enumerate(orders):
        q[:, n] = Q[:, 2 * k] - 1j * Q[:, 2 * k + 1]
    given = branch[row]
    guess = SeriesMotion(PAPER, "CNM", q, complex(-given["beta"], given["omega"]), 0.0, 0.0, [])
    return series_motion(PAPER, "CNM", 401, amplitude=factor * given["amplitude"], guess=guess).lambda_


def once(values):
    """Of a report that the branch passes several times, the first."""
    return [next(k for k, v in enumerate(values) if v == pytest.approx(a, rel=REPEATED)) for a in AMPLITUDES]


@SERIAL
@pytest.mark.parametrize("accuracy", [1e-2, 1e-3, 1e-4])
def test_an_accuracy_is_kept_against_the_exact_oracle(accuracy):
    branch = fw.follow(mode(jenkins()), 0.1, 3.0, report_at=AMPLITUDES, accuracy=accuracy)
    assert branch.converged, branch.reason
    for row in once(branch["amplitude"]):
        true, beside = (exact(branch, row, factor) for factor in (1.0, 1 + accuracy / 10))
        off = complex(-branch["beta"][row], branch["omega"][row]) - true
        slope = beside - true  # damping is steep at the onset of slip, where a shift by a tenth counts as the whole
        shift = np.clip((off * slope.conjugate()).real / abs(slope) ** 2, -1, 1)
        assert abs(off - shift * slope) < accuracy * -true.real, (branch[row], off, slope)
        assert abs(off) < 2.5 * accuracy * -true.real


@SERIAL
def test_more_is_taken_only_where_it_is_needed():
    """Stuck motion is one harmonic; the corners of friction need more, and more for more digits."""
    coarse, fine = (fw.follow(mode(jenkins()), 0.05, 3.0, accuracy=share) for share in (1e-2, 1e-4))
    for branch in (coarse, fine):
        stuck = branch["zeta"] == 0
        assert stuck.any() and (branch["harmonics"][stuck] == 5).all()
        assert branch["harmonics"].max() > 5
        assert set(branch["samples"]) == {128}  # changes of state are found between samples
    assert fine["harmonics"].max() > 1.5 * coarse["harmonics"].max()
    assert fine["harmonics"][-1] < fine["harmonics"].max()  # in full slip fewer will do


@SERIAL
def test_samples_follow_too_where_a_law_is_sampled():
    """In Python, beside the same law in continuous time."""
    sampled = fw.Model(M, K, None, [fw.Contact(TanhLaw(LIMIT, 0.2), [[0.0, 1.0]])])
    branch = fw.follow(mode(sampled), 0.05, 3.0, accuracy=1e-4)
    fine = fw.follow(mode(tanh(), 81, 2048), 0.15, 3.0, errors=False)
    assert branch.converged and branch["samples"].max() > branch["samples"].min() == 128
    for a in (0.2, 0.5, 1.5, 2.9):
        found, true = (one.at(a)[0] for one in (branch, fine))
        assert found["zeta"] == pytest.approx(true["zeta"], rel=3e-4)  # also between points, by the cubic


@SERIAL
@pytest.mark.parametrize("accuracy", [5e-3, 3e-3])
def test_events_and_reports_come_once(accuracy):
    """Also where the set changes next to them, and three times between two folds."""
    reports = [0.13, 0.1345, 0.14, 0.2, *np.geomspace(0.3, 2.8, 12)]
    branch = fw.follow(mode(tanh(0.05)), 0.05, 3.0, report_at=reports, accuracy=accuracy)
    fine = fw.follow(mode(tanh(0.05), 61, 1024), 0.05, 3.0, report_at=reports, errors=False)
    assert len(set(branch["harmonics"])) > 3
    assert [name for name, _ in branch.events] == [name for name, _ in fine.events]
    once = reports[:1] + 3 * reports[1:2] + reports[2:]
    np.testing.assert_allclose(branch["amplitude"][branch.met("report")], once, rtol=ROUNDING)
    np.testing.assert_allclose(branch["amplitude"][branch.met("fold")], fine["amplitude"][fine.met("fold")], rtol=5e-3)
    assert branch["point"].tolist() == list(range(len(branch)))


@SERIAL
def test_a_response_keeps_its_amplitude():
    """To the accuracy of a branch with twelve times the harmonics, at the same frequencies, its peak among them."""

    def response(harmonics, **more):
        model = jenkins()
        known = fw.choose_harmonics(model, harmonics, 128 if harmonics < 9 else 1024)
        problem = fw.ForcedResponse(model, known, {1: [1.0, 0.0]}, 6.0, 0, fw.linear_modes(model, 1)[0])
        return fw.follow(problem, 22.0, 28.0, report_at=[24.0, 24.3, 24.6, 25.0, 26.0], **more)

    branch, fine = response(5, accuracy=1e-3), response(61, errors=False)
    assert branch.converged and len(set(branch["harmonics"])) > 1
    for one, other in zip(branch.met("report"), fine.met("report")):
        assert branch["omega"][one] == pytest.approx(fine["omega"][other], rel=ROUNDING)
        assert branch["amplitude"][one] == pytest.approx(fine["amplitude"][other], rel=1e-3)
    assert branch["amplitude"].max() == pytest.approx(fine["amplitude"].max(), rel=1e-3)


@SERIAL
def test_unknowns_of_all_points_are_those_of_the_largest_set():
    branch = fw.follow(mode(jenkins()), 0.1, 3.0, accuracy=1e-3)
    problem = branch.problem
    assert problem.harmonics.orders[-1] == branch["harmonics"].max()
    for row in (0, len(branch) // 2, len(branch) - 1):
        y = branch.unknowns(row)
        assert problem.state(y)["zeta"] == pytest.approx(branch["zeta"][row], abs=SOLVED)
        Q = branch.coefficients(row)
        assert np.hypot(*Q[0, :2]) == pytest.approx(branch["amplitude"][row], rel=SOLVED)
        beyond = [k for k, label in enumerate(problem.harmonics.labels) if int(label[:-1]) > branch["harmonics"][row]]
        assert not Q[:, beyond].any()


@SERIAL
@pytest.mark.parametrize("places", [48, 96, 128])
def test_another_set_stays_on_the_branch(places):
    """Beside a fold Newton at the amplitude led from a smaller set's point to the second mode, at 45 rad/s."""
    wanted = list(np.geomspace(0.02, 3.0, places + 2)[1:-1])
    branch = fw.follow(mode(tanh(0.05), 5, 64), 0.02, 3.0, report_at=wanted, accuracy=0.1)
    assert branch.converged, branch.reason
    assert branch["omega"].max() < 25.6


@SERIAL
def test_a_branch_that_cannot_be_had_so_accurately_says_what_limits_it(monkeypatch):
    monkeypatch.setattr(rules, "MOST_HARMONICS", 9)
    branch = fw.follow(mode(jenkins()), 0.1, 3.0, accuracy=1e-4)
    assert not branch.converged and branch["amplitude"][-1] == pytest.approx(3.0)
    assert "accuracy 0.0001 kept at" in branch.reason and "limited by harmonics" in branch.reason
    assert branch["harmonics"].max() == 9


@SERIAL
def test_few_dofs_may_take_more_harmonics():
    assert [rules.most_harmonics(dofs) for dofs in (2, 20, 39, 40, 10**6)] == [1023, 500, 256, 255, 255]


@SERIAL
def test_a_set_above_the_most_harmonics_is_made_no_smaller():
    aim, missed = rules.Aim(most_harmonics=255), {"all": 5.0, "harmonics": 4.0, "samples": 1.0}
    found = aim.finer(fw.choose_harmonics(jenkins(), 401, 1024), missed)
    assert found is not None and found.orders[-1] == 401 and found.samples > 1024


@SERIAL
def test_every_resonance_of_a_long_branch_gives_back_what_it_took():
    """Behind the twentieth one the largest set stayed to the end, at up to fifty times the cost of a point."""
    aim, little = rules.Aim(), {"all": 1e-3, "harmonics": 1e-3, "samples": 0.0}
    least, large = (fw.choose_harmonics(jenkins(), highest, 512) for highest in (5, 205))
    for _ in range(60):
        for _ in range(rules.AGAIN):
            aim.see(little)
        found = aim.next(large, least)
        assert found is not None and found.orders[-1] < 0.5 * large.orders[-1]


@SERIAL
def test_a_branch_goes_on_from_a_snapshot_with_the_set_it_had():
    def points(branch, most=None):
        return [(p.parameter, branch.problem.harmonics.orders[-1], p.event) for _, p in zip(range(most or 999), branch)]

    problem, settings = mode(jenkins()), {"stop": (0.1, 3.0), "report_at": [0.2]}
    first = RefiningContinuation(problem, problem.initial(0.1), **settings, accuracy=1e-3)
    begun = points(first, 14)
    state = first.snapshot()
    rest = points(first)
    assert len({highest for _, highest, _ in begun}) > 1
    other = mode(jenkins())
    again = RefiningContinuation.restore(other, state, **settings)
    assert again.problem.harmonics.orders[-1] == begun[-1][1]
    for now, before in zip(points(again), rest, strict=True):
        assert now[0] == pytest.approx(before[0], rel=REPEATED) and now[1:] == before[1:]
    assert again.converged and again.points == first.points


@pytest.mark.ranks(1, 2, 3)
def test_ranks_choose_the_same(comm):
    alone, all_ranks = (fw.follow(mode(jenkins(c)), 0.1, 3.0, accuracy=1e-3) for c in (MPI.COMM_SELF, comm))
    assert alone["harmonics"].tolist() == all_ranks["harmonics"].tolist()
    np.testing.assert_allclose(all_ranks["zeta"], alone["zeta"], rtol=REPEATED, atol=SOLVED)
    assert alone["event"].tolist() == all_ranks["event"].tolist()
