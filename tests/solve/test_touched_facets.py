"""Branches of masses on contacts at random that touch where opposite discs begin to hold a slider, or cease to."""

from __future__ import annotations

import numpy as np
import pytest

import fretwave as fw

COMPONENTS = {
    "coulomb_3d": 3,
    "coulomb_3d_uncoupled": 3,
    "coulomb_2d": 2,
    "jenkins": 1,
    "unilateral_spring": 1,
    "cubic_spring": 1,
}


def parameters(law, draw):
    kn, kt = draw.uniform(2, 20), draw.uniform(1, 10)
    if law == "jenkins":
        return {"tangential_stiffness": kt, "friction_limit": draw.uniform(0.1, 1)}
    if law == "unilateral_spring":
        return {"normal_stiffness": kn, "gap": draw.uniform(0, 0.3)}
    if law == "cubic_spring":
        return {"cubic_stiffness": draw.uniform(0.1, 3)}
    return {
        "normal_stiffness": kn,
        "tangential_stiffness": kt,
        "friction_coefficient": draw.uniform(0.1, 0.9),
        "normal_load": draw.uniform(0.3, 3),
        "gap": 0.0,
    }


def contact(number, draw, n):
    """On some of the n masses, or on a mixture of them."""
    law = list(COMPONENTS)[draw.integers(len(COMPONENTS))]
    d = COMPONENTS[law]
    rows = np.eye(n)[draw.permutation(n)[:d]] if draw.random() < 0.6 else draw.normal(size=(d, n)) * 0.6
    return fw.Contact(law, rows, parameters(law, draw), f"{law}{number}")


def scene(comm, seed):
    """A nonlinear mode, or a response to a static and a harmonic force, and where it begins and ends."""
    draw = np.random.default_rng(seed)
    n = int(draw.integers(4, 8))
    root = draw.normal(size=(n, n))
    K = root @ root.T / n * 3 + np.eye(n)
    contacts = [contact(k, draw, n) for k in range(int(draw.integers(1, 4)))]
    model = fw.Model(np.eye(n), K, 0.02 * K, contacts, comm)
    mean, force = 0.5 * draw.normal(size=n), draw.normal(size=n) + 1j * draw.normal(size=n)
    harmonics = fw.Harmonics(range(int(draw.choice([1, 3, 5, 7])) + 1), int(draw.choice([64, 128, 256])))
    stuck, rest = fw.linear_modes(model, 1)[0], fw.balanced(model)
    if draw.random() < 0.65:
        given = {"force": {0: mean, 1: force}, "level": 1.0, "dof": 0}
        ends = (0.5 * stuck.omega, 1.6 * stuck.omega)
        return fw.ForcedResponse(model, harmonics, **given, reference=stuck, rest=rest), *ends[:: 1 if seed % 2 else -1]
    return fw.NonlinearMode(model, harmonics, dof=int(draw.integers(3)), start=stuck, rest=rest), 0.003, 5.0


def followed(comm, seed, **steps):
    return fw.follow(*scene(comm, seed), errors=False, steps=fw.StepControl(**steps))


def told(branch):
    """Largest amplitude, and the frequency at its end."""
    return branch["amplitude"].max(), branch["omega"][-1]


@pytest.mark.ranks(1, 2)
@pytest.mark.parametrize("seed", [247, 394, 3120])
def test_a_mode_leads_on_behind_a_facet_that_it_touches(comm, seed):
    """Two ended where a slider begins to go round, one turned back onto itself by products along the facet."""
    branch, shortly = followed(comm, seed), followed(comm, seed, initial=0.02, maximum=0.06)
    assert branch.converged, branch.reason
    assert told(branch) == pytest.approx(told(shortly), rel=1e-9)


@pytest.mark.ranks(1, 2)
def test_a_response_turns_right_round_where_a_slider_begins_to_be_held(comm):
    """No step was short enough: its extension does not meet the other piece. It ends as one that begins there."""
    problem, *_ = scene(comm, 166)
    branch = fw.follow(problem, 0.78, 0.72, errors=False)
    assert branch.converged, branch.reason
    end = fw.follow(problem, 0.72, 0.71, errors=False)
    assert branch["amplitude"][-1] == pytest.approx(end["amplitude"][0], rel=1e-9)


@pytest.mark.ranks(1, 2)
def test_a_curve_that_touches_such_facets_closes(comm):
    """It ended at the first one in long steps, with a word of a mean position that is free."""
    branch, shortly = followed(comm, 104), followed(comm, 104, initial=0.02, maximum=0.04)
    assert all("a closed loop" in one.reason for one in (branch, shortly))
    assert branch["amplitude"].max() == pytest.approx(shortly["amplitude"].max(), rel=1e-9)
