"""Parts on the ranks and the whole that they make."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc

from fretwave.mpi.gather import on_all_ranks, on_rank_0

pytestmark = pytest.mark.ranks(1, 2, 3)


def test_a_vector_is_whole_on_every_rank_or_on_the_first(comm: MPI.Comm) -> None:
    vector = PETSc.Vec().createMPI((comm.rank + 1, None), comm=comm)
    vector.setArray(10.0 * comm.rank + np.arange(comm.rank + 1))
    expected = [10.0 * rank + k for rank in range(comm.size) for k in range(rank + 1)]
    assert on_all_ranks(comm, vector).tolist() == expected
    first = on_rank_0(comm, vector)
    assert (first is None) if comm.rank else (first.tolist() == expected)
    vector.destroy()


@pytest.mark.parametrize("axis", [0, 1])
def test_an_array_is_put_together_along_the_axis_that_is_cut(comm: MPI.Comm, axis: int) -> None:
    """The last rank has nothing of it."""
    whole = np.arange(12.0).reshape(4, 3)
    parts = np.array_split(whole, max(comm.size - 1, 1), axis=axis)
    local = parts[comm.rank] if comm.rank < len(parts) else whole[:0] if axis == 0 else whole[:, :0]
    assert np.array_equal(on_all_ranks(comm, local, axis), whole)
