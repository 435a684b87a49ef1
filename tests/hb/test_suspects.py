"""Causes that look alike from inside a solver are named by the parameters that differ."""

from __future__ import annotations

import re

import numpy as np
import pytest
from models.core_models import options
from test_krylov import ROOT, TIP, beam, root_map

import fretwave as fw
from fretwave.hb.suspects import lossless, suspects, vanishing
from fretwave.run.stopped import advice
from fretwave.solve.preload import static_preload
from fretwave.units import MM_T_S

LOAD = np.tile([100.0, 1.0, 0, 0, 0, 0], 5)  #: a pull along the blade, a push across [N]


def free_blade(comm, **changes):
    """The blade of test_krylov held by its contact alone."""
    M, K = beam()
    B = root_map(len(K))
    return fw.Model(M, K, None, [fw.Contact("coulomb_3d", B, {**ROOT, **changes}, "root")], comm)


@pytest.mark.parametrize(
    "changes, words",
    [
        ({"friction_coefficient": 0.0}, "contact 'root' has no friction"),
        ({"normal_stiffness": 1e12}, "normal_stiffness 1e.12 N/mm"),
        ({"tangential_stiffness": 1e-3}, "tangential_stiffness 0.001 N/mm, .*holds nothing"),
        ({"normal_load": 0.0}, "has no normal_load"),
        ({"normal_load": np.array([4000.0] * 3 + [1000.0] * 3)}, "normal loads from 1e.03 to 4e.03 N"),
    ],
    ids=["no friction", "stiff", "soft", "no load", "unbalanced"],
)
def test_each_extreme_parameter_has_its_own_words(comm, changes, words):
    model = free_blade(comm, **changes)
    found = suspects(model.contacts, 1e6, MM_T_S)
    assert found.count("contact 'root'") == 1
    assert re.search(words, found), found
    assert suspects(free_blade(comm).contacts, 1e6, MM_T_S) == ""


def test_no_friction_is_named_where_the_preload_fails(comm):
    model = free_blade(comm, friction_coefficient=0.0)
    with pytest.raises(fw.NotConverged, match="has no friction"):
        static_preload(model, LOAD, fw.linear_modes(free_blade(comm), 1, "stuck")[0])


def test_a_reference_without_frequency_is_refused_in_words(comm):
    """It was a division by zero."""
    model = free_blade(comm, normal_load=0.0)
    with pytest.raises(fw.InputError, match="(?s)rigid motion.*no normal_load"):
        static_preload(model, LOAD, fw.linear_modes(model, 1, "stuck")[0])


def stopped(comm, zeta):
    """A branch of two masses, one in front of a stop."""
    K, B = np.array([[11.4, 2.3], [2.3, 16.2]]), np.array([[0.0, 1.0], [0.0, 0.0], [0.0, 0.0]])
    frictionless = {"tangential_stiffness": 1.0, "friction_coefficient": 0.0, "normal_load": 0.0}
    contact = fw.Contact("coulomb_3d", B, {"normal_stiffness": 1e4, "gap": 0.13, **frictionless}, "stop")
    model = fw.Model(np.diag([0.46, 0.21]), K, 2 * zeta / 4.87 * K, [contact], comm)
    first = fw.linear_modes(model, 1, "free")[0]
    problem = fw.NonlinearMode(model, fw.Harmonics(range(6), 32), "EPMC", 0, first, "stopped_")
    branch = fw.Continuation(problem, problem.initial(0.2), (0.2, 2.0))
    assert [point.index for point in branch]
    return branch


@pytest.mark.ranks(1)
def test_a_mode_that_leads_over_into_another_one_is_advised_to_be_damped(comm):
    """Without damping it leaves along an internal resonance; with 1 % it passes that, as it is told."""
    branch = stopped(comm, 0.0)
    said = lossless(branch.problem, branch.anchor)
    assert "comes back to" in branch.reason and "loses no energy" in said
    assert "damping.zeta=1e-2" in advice("mode", branch.reason + said)
    damped = stopped(comm, 1e-2)
    assert damped.converged, damped.reason
    assert lossless(damped.problem, damped.anchor) == ""


def drifting(comm):
    """A mode of the free blade."""
    model = free_blade(comm)
    first = fw.linear_modes(model, 1, "stuck")[0]
    rest = static_preload(model, LOAD, first)
    problem = fw.NonlinearMode(model, fw.Harmonics(range(4), 64), "CNM", TIP, first, "drift_")
    problem.preload(rest.displacement, rest.load)
    return problem


@pytest.mark.ranks(1)
def test_a_branch_whose_mean_nothing_holds_says_so(comm):
    """Once every pair slips in a period the blade may drift; Newton's step is then all mean.

    Not by steps that look into a loop at 1.8354e-3: the branch ends within that, for another reason.
    """
    problem = drifting(comm)
    branch = fw.Continuation(problem, problem.initial(1e-4), (1e-4, 3e-3), fw.StepControl(max_points=120))
    with options(fw_branch_other=1e300):
        assert [point.index for point in branch]
    assert vanishing(problem, branch.anchor) == ""
    assert not branch.converged and "mean position is free" in branch.reason


@pytest.mark.ranks(1, 2)
def test_where_a_pair_stops_slipping_is_passed_and_said(comm):
    """Work of the others stays; that of one falls from 1e-7 to 1e-9 while the amplitude changes by 4e-7 of itself."""
    problem = drifting(comm)
    branch = fw.Continuation(problem, problem.initial(1e-4), (1e-4, 3e-3), fw.StepControl(max_points=120))
    points = list(branch)
    assert "mean position is free" in branch.reason and max(p.parameter for p in points) > 1.96e-3
    peak = next(p for p in points if "peak_damping" in p.event)
    before = next(p for p in points if p.index > peak.index and p.parameter < 1.831e-3)
    steps = fw.StepControl(initial=5e-6, maximum=5e-6, max_points=60)
    way = fw.Continuation(problem, before.y, (1e-4, 3e-3), steps, upwards=False)
    here = min(way, key=lambda p: p.parameter)
    assert "slip of a pair of contact 'root' vanishes here" in vanishing(problem, here.y)
    assert vanishing(problem, before.y) == vanishing(problem, peak.y) == ""


def test_pairs_without_friction_have_no_slip_that_tells(comm):
    """They slide all the time, and dissipate nothing."""
    mode = fw.linear_modes(free_blade(comm), 1, "stuck")[0]
    for friction, said in ((0.0, False), (1e-15, True)):
        model = free_blade(comm, friction_coefficient=friction)
        problem = fw.NonlinearMode(model, fw.Harmonics(range(4), 64), "CNM", TIP, mode, "slides_")
        assert ("slip of a pair" in vanishing(problem, problem.initial(1e-4))) == said
