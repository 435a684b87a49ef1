"""Responses of masses on pads and stops at random: no corner turns one round, none is too sharp to be passed."""

from __future__ import annotations

import numpy as np
import pytest

import fretwave as fw

SLIDER = ("jenkins", {"tangential_stiffness": (1, 10), "friction_limit": (0.1, 1)})
STOP = ("unilateral_spring", {"normal_stiffness": (2, 20), "gap": (0, 0.3)})
#: Laws, and how large the static forces are.
CURVED, LENSES = ("coulomb_3d_uncoupled", SLIDER, 1.0), ("coulomb_3d", STOP, 2.0)


def response(comm, seed, pads, beside, static):
    """Of four masses between springs, and the frequency [rad/s] of their first mode with the pad stuck."""
    draw = np.random.default_rng(seed)
    root = draw.normal(size=(4, 4))
    K, rows = root @ root.T + np.eye(4), np.eye(4)
    pad = {
        "normal_stiffness": draw.uniform(2, 20),
        "tangential_stiffness": draw.uniform(1, 10),
        "friction_coefficient": draw.uniform(0.2, 0.9),
        "normal_load": draw.uniform(0.5, 3),
        "gap": 0.0,
    }
    contacts = [fw.Contact(pads, rows[draw.permutation(4)[:3]], pad, "pad")]
    law, bounds = beside
    place = rows[draw.permutation(4)[:1]]
    contacts.append(fw.Contact(law, place, {name: draw.uniform(*ends) for name, ends in bounds.items()}, law))
    model = fw.Model(np.eye(4), K, 0.02 * K, contacts, comm)
    mean, harmonic = static * draw.normal(size=4), draw.normal(size=4) + 1j * draw.normal(size=4)
    stuck, rest = fw.linear_modes(model, 1)[0], fw.balanced(model)
    force = {0: mean, 1: (2 if law == "jenkins" else 1) * harmonic}
    harmonics = fw.Harmonics(range(6), 128)
    return fw.ForcedResponse(model, harmonics, force=force, level=1.0, dof=0, reference=stuck, rest=rest), stuck.omega


def followed(comm, seed, pads, beside, static, **steps):
    problem, omega = response(comm, seed, pads, beside, static)
    ends = (0.5 * omega, 1.6 * omega)
    first, last = ends if seed % 2 else ends[::-1]
    return fw.follow(problem, first, last, errors=False, steps=fw.StepControl(**steps))


def told(branch):
    """Largest amplitude, and how many folds."""
    assert branch.converged, branch.reason
    return branch["amplitude"].max(), sum(event == "fold" for event, _ in branch.events)


@pytest.mark.ranks(1)
@pytest.mark.parametrize(
    ("seed", "scene"), [(9, CURVED), (44, CURVED), (106, CURVED), (213, CURVED), (41, LENSES), (82, LENSES)]
)
def test_no_corner_turns_a_branch_round_or_ends_it(comm, seed, scene):
    """Told by how far a piece reaches, 13 of 400 turned back onto themselves between curved facets side by side.

    Where opposite discs begin to hold a slider, the lens they have in common opens as the root of the distance:
    Newton's method went to and fro across that.
    """
    amplitude, folds = told(followed(comm, seed, *scene))
    finely, same = told(followed(comm, seed, *scene, initial=0.02, maximum=0.04))
    assert amplitude == pytest.approx(finely, rel=1e-9) and folds == same


@pytest.mark.ranks(1)
@pytest.mark.parametrize("pads", ["coulomb_3d", "coulomb_3d_uncoupled"])
def test_a_piece_has_one_number_with_a_force_and_without(comm, pads):
    """Where a residual was asked for it is read from that; elsewhere no slider is marched. The residual stays right."""
    problem, omega = response(comm, 9, pads, STOP, 1.0)
    branch = fw.follow(problem, 0.5 * omega, 1.6 * omega, errors=False)
    rows = [branch.unknowns(row) for row in range(0, len(branch), 20)]
    alone = [problem.core.piece(y) for y in rows]
    r = problem.core.unknowns()
    for y, number in zip(rows, alone):
        problem.core.residual(y, r)
        assert r.norm() < 1e-8 and problem.core.piece(y) == number
    assert len(set(alone)) > 2
