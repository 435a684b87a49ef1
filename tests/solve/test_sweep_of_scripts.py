"""Sweeps from a script: the grid's order, groups of ranks, errors in their place; what a branch carries along."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest
from tolerances import REPEATED, ROUNDING, SOLVED

import fretwave as fw

KT, K = 5.0, 40.0
COPIES = {"copy": copy.copy, "deepcopy": copy.deepcopy, "of a list": lambda one: copy.deepcopy([one, one])[1]}


def backbone(limit, mass=1.0, comm=None):
    slider = fw.Contact("jenkins", [[1.0]], {"tangential_stiffness": KT, "friction_limit": limit})
    model = fw.Model([[mass]], [[K]], contacts=[slider], comm=comm)
    return fw.follow(fw.NonlinearMode(model, fw.choose_harmonics(model, 1)), 0.1 * limit, 2.0 * limit)


def test_the_grid_runs_its_last_parameter_fastest(comm):
    """Stuck frequency sqrt((k + kt) / m), whatever the limit."""
    found = fw.sweep(lambda **values: backbone(comm=comm, **values), limit=[1.0, 2.0], mass=[1.0, 4.0, 9.0])
    assert found.shape == (2, 3) and len(found) == 6
    omega = found.each(lambda branch: branch["omega"][0])
    np.testing.assert_allclose(omega, np.tile(np.sqrt((K + KT) / np.array([1.0, 4.0, 9.0])), (2, 1)), rtol=SOLVED)
    assert [values["mass"] for values, _ in found] == [1.0, 4.0, 9.0] * 2


@pytest.mark.ranks(1, 2, 3)
def test_groups_of_ranks_find_the_same(comm):
    limits = [1.0, 2.0, 3.0]
    groups = fw.sweep(backbone, comm=comm, limit=limits)
    damping = groups.each(lambda branch: branch["zeta"].max())
    np.testing.assert_allclose(damping, damping[0], rtol=SOLVED)
    alone = backbone(3.0, comm=comm)
    np.testing.assert_allclose(groups[2].at([1.0, 2.0])["zeta"], alone.at([1.0, 2.0])["zeta"], rtol=REPEATED)


def test_a_value_that_fails_leaves_the_others(comm):
    found = fw.sweep(lambda **values: backbone(comm=comm, **values), limit=[-1.0, 2.0])
    assert np.isnan(found.each(len)[0]) and found.each(len)[1] > 2 and "1 failed" in repr(found)
    with pytest.raises(fw.InputError, match="friction_limit"):
        found[0]


@pytest.mark.parametrize("over", [{}, {"limit": []}])
def test_nothing_to_go_through_is_said(over):
    with pytest.raises(fw.InputError, match="nothing to go through"):
        fw.sweep(backbone, **over)


def test_a_branch_travels_without_its_unknowns(comm):
    branch = backbone(1.0, comm=comm)
    there = pickle.loads(pickle.dumps(branch))
    np.testing.assert_array_equal(there.at(0.7)["zeta"], branch.at(0.7)["zeta"])
    with pytest.raises(fw.InputError, match="no unknowns"):
        there.unknowns(0)


@pytest.mark.parametrize("made", COPIES.values(), ids=COPIES)
def test_a_copy_of_a_branch_has_its_unknowns(comm, made):
    """Those of `pickle`, which has no ranks, were lost without a word."""
    branch = backbone(1.0, comm=comm)
    place = float(branch.at(0.7)["place"][0])
    other = made(branch)
    np.testing.assert_array_equal(other.at(0.7)["zeta"], branch.at(0.7)["zeta"])
    assert other is not branch and other.problem is branch.problem and other.events == branch.events
    np.testing.assert_array_equal(other.shape(place), branch.shape(place))
    other.reason = "another"
    assert branch.reason != "another"


def test_shape_is_the_complex_fundamental(comm):
    branch = backbone(1.0, comm=comm)
    place = float(branch.at(0.9)["place"][0])
    assert branch.shape(place) == pytest.approx(0.9, rel=SOLVED)
    with pytest.raises(fw.InputError, match="not retained"):
        branch.shape(0, order=2)


def test_rows_of_a_reduction_leave_the_motion_as_it_is(comm):
    K = np.diag([3.0, 4.0, 5.0]) - np.eye(3, k=1) - np.eye(3, k=-1)
    B = np.array([[1.0, 0.0, -1.0]])
    with fw.reduce(np.eye(3), K, keep=[0, 2], modes=1, comm=comm) as reduction:
        x = np.array([0.3, -0.2, 0.7])
        assert reduction.rows(B) @ x == pytest.approx(B @ reduction.expand(x), rel=ROUNDING)
        with pytest.raises(fw.InputError, match="not kept"):
            reduction.rows([[0.0, 1.0, 0.0]])
