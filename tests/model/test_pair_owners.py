"""Contact pairs are dealt out to the ranks whatever dofs they are on."""

from __future__ import annotations

import numpy as np
import pytest
from models.core_models import chain, unknowns
from mpi4py import MPI
from tolerances import REPEATED

import fretwave as fw

N = 40
PAD = {"normal_stiffness": 3.0, "tangential_stiffness": 2.0, "friction_coefficient": 0.4, "normal_load": 0.3}


def contacts():
    """A slider and four pads on the first of 40 dofs, which are those of the first rank."""
    slider = fw.Contact("jenkins", np.eye(1, N, 2), {"tangential_stiffness": 2.0, "friction_limit": 0.05}, "slider")
    B = np.zeros((12, N))
    B[np.arange(12), np.arange(12) % 9] = 1.0
    return [slider, fw.Contact("coulomb_3d", B, PAD, "pads")]


@pytest.mark.ranks(1, 2, 3, 4)
def test_each_rank_has_as_many_as_others(comm):
    with fw.Model(np.eye(N), chain(N), None, contacts(), comm) as model:
        counts = comm.allgather(len(model.pairs_of(0)) + len(model.pairs_of(1)))
        pads = np.concatenate(comm.allgather(model.pairs_of(1)))
    assert sum(counts) == 5 and max(counts) - min(counts) <= 1
    assert np.array_equal(np.sort(pads), np.arange(4))


def rounding(comm):
    """Of residuals at a motion of the first nine dofs alone, mostly that of the pads' stiff springs. Collective."""
    slider, pads = contacts()
    stiff = fw.Contact("coulomb_3d", pads.B, {**PAD, "normal_stiffness": 1e6, "tangential_stiffness": 1e6}, "pads")
    with fw.Model(np.eye(N), chain(N), None, [slider, stiff], comm) as model:
        start = fw.LinearMode(1.0, 0.0, np.ones(N), np.zeros(N))
        problem = fw.NonlinearMode(model, fw.Harmonics([0, 1], 64), "EPMC", 0, start)
        q = np.zeros((N, 3))
        q[:9, 1] = 1.0
        return problem.core.rounding(unknowns(problem, np.concatenate([q.ravel(), [0.0, 1.0, 0.0]])))


@pytest.mark.ranks(2, 3, 4)
def test_rounding_is_of_dofs_on_all_ranks(comm):
    """It was told too small where a pair's dofs are another rank's."""
    assert rounding(comm) == pytest.approx(rounding(MPI.COMM_SELF), rel=REPEATED)
