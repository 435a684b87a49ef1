"""Forces and derivatives where a motion has fewer harmonics than a set retains, and that is said: the same ones."""

from __future__ import annotations

import numpy as np
import pytest
from models.core_models import dense, unknowns, whole

import fretwave as fw
from fretwave import _core

pytestmark = pytest.mark.ranks(1)

MOVES, RETAINED, SEEDS = 3, 7, 8
SLIDER = {"tangential_stiffness": 5.0, "friction_coefficient": 0.4, "normal_stiffness": 8.0}
#: Parameters and components.
LAWS = {
    "jenkins": ({"tangential_stiffness": 5.0, "friction_limit": 2.0}, 1),
    "unilateral_spring": ({"normal_stiffness": 5.0, "gap": 0.2}, 1),
    "regularised_coulomb": ({"friction_limit": 2.0, "regularisation_velocity": 0.3}, 1),
    "cubic_spring": ({"cubic_stiffness": 0.7}, 1),
    "coulomb_2d": ({**SLIDER, "normal_load": 3.0}, 2),
    "coulomb_3d": ({**SLIDER, "normal_load": 3.0}, 3),
    "coulomb_3d_uncoupled": ({**SLIDER, "normal_load": 3.0}, 3),
}


def problem(law, moving):
    """One pair on unit masses and springs."""
    parameters, size = LAWS[law]
    model = fw.Model(np.eye(size), np.eye(size), None, [fw.Contact(law, np.eye(size), parameters)])
    harmonics = fw.Harmonics(range(RETAINED + 1), 4 * RETAINED)
    harmonics.core = _core.Harmonics(list(harmonics.orders), harmonics.samples, moving)
    start = fw.LinearMode(1.0, 0.0, np.ones(size), np.zeros(size))
    return fw.NonlinearMode(model, harmonics, "EPMC", 0, start)


def point(law, seed):
    """A motion of MOVES harmonics that slips and opens."""
    q = np.random.default_rng(seed).standard_normal((LAWS[law][1], 2 * RETAINED + 1))
    q[:, 2 * MOVES + 1 :] = 0
    return np.concatenate([np.ravel(q / np.repeat(np.arange(RETAINED + 1), 2)[1:].clip(1) ** 1.5), [0.1, 1.0, 0.0]])


@pytest.mark.parametrize("law", LAWS)
def test_forces_and_derivatives_are_those_of_the_whole_set(law):
    known, other = problem(law, MOVES), problem(law, 0)
    for seed in range(SEEDS):
        y = point(law, seed)
        r, J = whole(other.residual(unknowns(other, y))), dense(other.jacobian(unknowns(other, y)))
        assert whole(known.residual(unknowns(known, y))) == pytest.approx(r, abs=1e-10 * np.abs(r).max())
        assert dense(known.jacobian(unknowns(known, y))) == pytest.approx(J, abs=1e-8 * np.abs(J).max())
