"""Corners, loops and branch points on a branch's way: none leads it round, onto what lies beside, or past a fold."""

from __future__ import annotations

from types import MappingProxyType

import numpy as np
import pytest
from models.core_models import block_on_pads, mode_problem, options
from models.followed import follow, named, stop
from tolerances import SOLVED

import fretwave as fw
from fretwave.run.stopped import advice

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
    away = {"fw_branch_meets": 1e-300, "fw_branch_surely_in": 1e300, "fw_branch_certain": 1e9}
    with options(**away, fw_branch_walk=0.1, fw_branch_lies_back=1e300):
        branches = [zigzag(comm, maximum) for maximum in (0.0657, 0.0957)]
        with options(fw_branch_again=1e-300):
            branches.append(zigzag(comm, 0.0657))
    for branch, points in branches:
        assert branch.reason.startswith(CIRCLING) and len(points) < 500
        assert "shorter steps" in advice("mode", branch.reason)
