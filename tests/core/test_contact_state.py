"""What the contact laws remember between problems, and how their sliders start: derivative, preload, settling, wear."""

from __future__ import annotations

import numpy as np
import pytest
from models.core_models import chain, derivative, everywhere, unknowns, whole
from tolerances import LAST_BIT, LAST_DIGITS, REPEATED, ROUNDING, SOLVED

import fretwave as fw

LAWS = ["coulomb_3d", "coulomb_3d_uncoupled"]
STIFFNESS = {"normal_stiffness": 2.0, "tangential_stiffness": 1.5, "friction_coefficient": 0.4}


def pair(law="coulomb_3d", **changes):
    return fw.Contact(law, np.eye(3), {**STIFFNESS, "normal_load": 1.0, **changes})


def problem_of(model, samples=64):
    start = fw.LinearMode(1.0, 0.0, np.ones(3), np.zeros(3))
    return fw.NonlinearMode(model, fw.Harmonics([0, 1, 2, 3], samples), "EPMC", 0, start)


def one_pair(comm, contact, samples=64):
    return problem_of(fw.Model(np.eye(3), chain(3), None, [contact], comm), samples)


def point(problem, *entries):
    """Unknowns with these (dof, column, value), frequency 1, no decay."""
    q = np.zeros((3, problem.harmonics.block_size))
    for dof, column, value in entries:
        q[dof, column] = value
    return np.concatenate([q.ravel(), [0.0, 1.0, 0.0]])


def residual(problem, y):
    return whole(problem.residual(unknowns(problem, y)))


def product(problem, y, dy):
    return whole(problem.jacobian_product(unknowns(problem, y), unknowns(problem, dy)))


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("phase", [0.0, 0.7, 2.0, 3.1, 4.4, 5.9])
@pytest.mark.parametrize("tangent", [0.0, 0.3])
def test_derivative_where_a_slider_comes_back_to_its_rest_after_lift_off(comm, law, phase, tangent):
    """A purely normal motion that opens: each period the slider starts where the pair closed the last time, so it
    follows a tangential perturbation though it stands at its rest; a mean tangential displacement changes nothing."""
    problem = one_pair(comm, pair(law, normal_load=0.5))
    y = point(problem, (0, 1, np.cos(phase)), (0, 2, -np.sin(phase)), (1, 0, tangent))
    dy = np.random.default_rng(1).standard_normal(len(y))
    expected = derivative(lambda at: residual(problem, at), y, dy, 4e-6, order=2)
    assert problem.diagnostics(unknowns(problem, y))["open"] > 0.1
    assert np.allclose(product(problem, y, dy), expected, rtol=0, atol=SOLVED * np.abs(expected).max())


@pytest.mark.parametrize("law", LAWS)
def test_derivative_where_a_slider_slips_and_comes_back(comm, law):
    """Slip that ends the period where it began: one slow orbit about the rest position."""
    problem = one_pair(comm, pair(law))
    y = point(problem, (1, 1, 0.8), (2, 2, 0.8), (1, 4, 0.1))
    dy = np.random.default_rng(2).standard_normal(len(y))
    expected = derivative(lambda at: residual(problem, at), y, dy, 1e-6)
    assert problem.diagnostics(unknowns(problem, y))["slip"] > 0.1
    assert np.allclose(product(problem, y, dy), expected, rtol=0, atol=REPEATED * np.abs(expected).max())


@pytest.mark.ranks(1)
@pytest.mark.parametrize("law", [*LAWS, "coulomb_2d"])
def test_one_step_to_rest(law):
    """From sliders at zero to u: those within R = mu N / kt of it stay, others are dragged there, in a circle or
    tangent by tangent; to u itself where the pair is open."""
    n, d = 300, fw.laws()[law].components
    u = np.random.default_rng(5).standard_normal((d, n))
    at_rest = fw.Contact(law, np.eye(d), {**STIFFNESS, "normal_load": 1.0, "gap": 0.2}).core_law(np.arange(n), n)
    at_rest.rest(u.ravel().tolist())
    w, normal = np.reshape(at_rest.sliders, (d - 1, n)), np.maximum(0, 1 + 2.0 * (u[0] - 0.2))
    R, size = 0.4 * normal / 1.5, np.linalg.norm(u[1:], axis=0) if law == "coulomb_3d" else np.abs(u[1:])
    assert np.allclose(w, u[1:] * (1 - np.minimum(1, R / size)), rtol=0, atol=LAST_DIGITS)
    within = np.broadcast_to(size <= R, w.shape)
    assert within.any() and (w[within] == 0).all() and (normal == 0).any()


def test_preload_is_set_not_added(comm):
    """The same state given twice, or another one after it: what was given last is the static state."""
    problem = one_pair(comm, pair())
    y = unknowns(problem, point(problem, (0, 1, 0.3), (1, 2, 0.5)))
    state, load = np.array([0.1, 0.2, 0.3]), np.array([1.0, -2.0, 0.5])
    problem.preload(state, load)
    once, r = problem.coefficients(y), residual(problem, whole(y))
    problem.preload(7 * state, 3 * load)
    problem.preload(state, load)
    assert np.array_equal(residual(problem, whole(y)), r)
    if once is not None:
        assert np.array_equal(problem.coefficients(y), once)
        assert once[:, 0] == pytest.approx(state, abs=LAST_BIT)
    else:
        problem.coefficients(y)


def pairs_on_some_ranks(comm):
    """One pair, on the rank of its dofs: the others have none."""
    contact = fw.Contact("coulomb_3d", np.eye(3, 9, 6), {**STIFFNESS, "normal_load": 1.0}, "late")
    return fw.Model(np.eye(9), chain(9), None, [contact], comm)


#: Dof of the pair's first tangent.
TANGENT = 7


def two_problems(comm):
    model = pairs_on_some_ranks(comm)
    start = fw.LinearMode(1.0, 0.0, np.ones(9), np.zeros(9))
    make = [fw.NonlinearMode(model, fw.Harmonics([0, 1, 2, 3], 64), "EPMC", 0, start) for _ in range(2)]
    q = np.zeros((9, make[0].harmonics.block_size))
    q[TANGENT, :2] = 1.0, 0.1  # shakes down from rest at zero
    return (*make, np.concatenate([q.ravel(), [0.0, 1.0, 0.0]]))


@pytest.mark.ranks(1, 2, 3)
@pytest.mark.parametrize("change", ["settle", "wear"])
def test_what_one_problem_does_to_a_law_reaches_the_linearisation_of_another(comm, change):
    """Laws belong to the model. Before: the product at the same y gave the derivative of the law as it was."""
    one, other, y = two_problems(comm)
    dy = np.random.default_rng(4).standard_normal(len(y))
    residual(one, y)
    before = product(one, y, dy)
    if change == "settle":
        moved = y.copy()
        moved[TANGENT * one.harmonics.block_size] = 1.267  # where the motion sticks about its mean
        other.core.settle(unknowns(other, moved))
    else:
        mine = len(one.model.pairs_of(0))
        other.core.wear([[0.4] * mine])
    after = product(one, y, dy)
    residual(one, y)
    assert np.array_equal(product(one, y, dy), after), "as if the residual had been evaluated again"
    assert np.abs(after - before).max() > 1e-3


@pytest.mark.parametrize("law", LAWS)
def test_sliders_close_their_period(comm, law):
    """`unclosed` is rounding against the slip path, which is that of the longest pair."""
    problem = one_pair(comm, pair(law))
    y = unknowns(problem, point(problem, (0, 1, 0.2), (1, 2, 0.9), (2, 1, 0.7), (2, 4, 0.3)))
    found = problem.diagnostics(y)
    assert found["slip_path"] > 0.5
    assert 0 <= found["unclosed"] < ROUNDING * found["slip_path"]


@pytest.mark.parametrize("law", ["jenkins", "coulomb_2d", "coulomb_3d", "coulomb_3d_uncoupled"])
def test_samples_at_which_a_slip_ends_have_their_force(comm, law):
    """Each sample in turn is the first, a turning point of the motion, where slip ends: the loop is the same."""
    n, samples = fw.laws()[law].components, 64
    slider = {"tangential_stiffness": 1.5, "friction_limit": 1.0}
    contact = fw.Contact(law, np.eye(3)[3 - n :], slider if n == 1 else {**STIFFNESS, "normal_load": 2.5})
    problem = one_pair(comm, contact, samples)
    loops = []
    for first in range(samples):
        c, s = np.cos(2 * np.pi * first / samples), -np.sin(2 * np.pi * first / samples)
        y = unknowns(problem, point(problem, *((2, k, 2.3 * a) for k, a in ((1, c), (2, s)))))
        for told in everywhere(problem, problem.contact_period(y)):
            loops.append(np.roll(told["f"], first, axis=0))
    assert np.abs(loops[0]).max() >= 1 - ROUNDING
    assert np.allclose(loops, np.median(loops, axis=0), rtol=0, atol=ROUNDING)


@pytest.mark.ranks(1)
@pytest.mark.parametrize("swing", [0.6, 1.5])
def test_a_slider_far_from_its_rest_closes_its_period(comm, swing):
    """A stiff pad that has walked 1e9 times the reach of its friction, mu N / kt: in shakedown and in slip."""
    reach = 0.5 / 8e9
    problem = one_pair(comm, pair("coulomb_3d", tangential_stiffness=8e9, friction_coefficient=0.5, normal_load=1.0))
    y = unknowns(problem, point(problem, (1, 0, 0.06), (2, 0, -0.03), (1, 1, swing * reach), (2, 1, 0.3 * reach)))
    assert 0 <= problem.diagnostics(y)["unclosed"] < 1e-4 * reach


def test_an_unclosed_period_is_said(comm):
    """The words a point's line gets, and none where the distance is rounding."""
    from fretwave.analyses.parts.branch import closure_note
    from fretwave.units import MM_T_S

    row = {"amplitude": 1e-3, "unclosed": 2e-6, "slip_path": 1e-4}
    assert "2.0e-06 mm from where it began (2 % of the longest slip path" in closure_note(row, MM_T_S)
    assert closure_note({**row, "unclosed": 1e-11}, MM_T_S) == ""
    assert closure_note({**row, "unclosed": 1e-18, "slip_path": 0.0}, MM_T_S) == ""
    assert "no slip" in closure_note({**row, "slip_path": 0.0}, MM_T_S)
