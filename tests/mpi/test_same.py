"""Numbers that must be the same on every rank: else ranks follow a branch to different ends, and wait for ever."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import fretwave as fw
from fretwave.errors import InputError
from fretwave.mpi.guard import describe
from fretwave.mpi.same import expect_same

RANKS = pytest.mark.ranks(2, 3)


@pytest.mark.ranks(1)
def test_a_script_is_not_told_to_resume_a_run() -> None:
    """It has no run folder, and keeps what it keeps."""
    assert describe(KeyboardInterrupt(), traced=True) == "interrupted"
    assert "fretwave resume RUNDIR" in describe(KeyboardInterrupt())


@RANKS
@pytest.mark.parametrize(
    "given, measured",
    [
        (lambda rank: [1.0, 2.0 + (rank == 1)], "2 on rank 0, 3 on rank 1"),
        (lambda rank: [1.0] * (1 + (rank == 1)), "1 numbers on rank 0, 2 on rank 1"),
        (lambda rank: [0.0, np.nan if rank == 1 else 0.0], "0 on rank 0, nan on rank 1"),
    ],
    ids=["value", "count", "nan"],
)
def test_other_numbers_on_a_rank_are_refused_on_all(comm: MPI.Comm, given, measured: str) -> None:
    with pytest.raises(InputError, match="are others on other ranks") as found:
        expect_same(comm, "numbers", given(comm.rank))
    assert found.value.measured == measured


@RANKS
def test_rounding_is_none(comm: MPI.Comm) -> None:
    expect_same(comm, "numbers", [1.0 + 1e-14 * comm.rank, np.nan, np.inf, 0.0])


@RANKS
def test_ranks_that_go_to_different_ends_do_not_wait_for_each_other(comm: MPI.Comm) -> None:
    """Both hung: one rank stood in a collective call of the next point, the other had come to its end."""
    slider = fw.Contact("jenkins", [[1.0]], {"tangential_stiffness": 5.0, "friction_limit": 1.0})
    model = fw.Model([[1.0]], [[4.0]], contacts=[slider])
    mode, first = fw.NonlinearMode(model, fw.choose_harmonics(model, 1)), comm.rank == 0
    with pytest.raises(InputError, match="ends, reports and steps of a branch"):
        fw.follow(mode, 0.1, 4.0 if first else 1.0)
    with pytest.raises(InputError, match="numbers on rank 0"):
        fw.follow(mode, 0.1, 4.0, report_at=[0.5] if first else [])
    with pytest.raises(InputError, match=r"0\.1 on rank 0, 0\.2 on rank 1"):
        fw.follow(mode, 0.1, 4.0, steps=fw.StepControl(maximum=0.1 if first else 0.2))
    with pytest.raises(InputError, match="4 on rank 0, 1 on rank 1"):
        fw.Continuation(mode, mode.initial(0.1), (0.1, 4.0 if first else 1.0))
    branch = fw.follow(mode, 0.1, 4.0)
    with pytest.raises(InputError, match="cycles and reports of wear"):
        fw.wear(branch, 2.0, 1e-3, {}, 10.0 if first else 20.0)
