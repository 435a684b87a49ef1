"""Vectors and arrays that lie in parts on the ranks, as a whole."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..arrays import AnyArray

if TYPE_CHECKING:
    from mpi4py import MPI
    from petsc4py import PETSc


def on_all_ranks(comm: MPI.Comm, local: PETSc.Vec | AnyArray, axis: int = 0) -> AnyArray:
    """The parts of all ranks in their order, on every rank. Collective.

    Parameters
    ----------
    local : PETSc.Vec or array
        A vector gives its local part.
    axis : int
        Along which an array is cut.
    """
    part = part_of(local)  # alone it is the whole: a message has 2 GB at most
    return part if comm.size == 1 else np.concatenate(comm.allgather(part), axis=axis)


def on_rank_0(comm: MPI.Comm, local: PETSc.Vec | AnyArray) -> AnyArray | None:
    """The parts of all ranks in their order, on rank 0; None on the others. Collective."""
    part = part_of(local)
    if comm.size == 1:
        return part
    parts = comm.gather(part)
    return None if parts is None else np.concatenate(parts)


def part_of(local: PETSc.Vec | AnyArray) -> AnyArray:
    """This rank's part: of a vector a copy, an array itself."""
    part: AnyArray = local if isinstance(local, np.ndarray) else local.getArray(readonly=True).copy()
    return part
