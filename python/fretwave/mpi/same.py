"""What scripts give on every rank for a branch or its wear and must be the same there, or ranks wait for each other."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError

if TYPE_CHECKING:
    from mpi4py import MPI

#: Relative: processors of several kinds may round what each rank has computed for itself.
ROUNDING = 1e-9


def expect_same(comm: MPI.Comm, what: str, given: Sequence[float]) -> None:
    """Collective.

    Raises
    ------
    InputError
        On every rank: the numbers of some rank are others than those of the first.
    """
    ranks = comm.allgather(np.asarray(given, dtype=float))
    for rank, other in enumerate(ranks):
        if len(other) != len(ranks[0]):
            measured = f"{len(ranks[0])} numbers on rank 0, {len(other)} on rank {rank}"
        elif not np.allclose(other, ranks[0], ROUNDING, 0.0, equal_nan=True):
            place = int(np.argmin(np.isclose(other, ranks[0], ROUNDING, 0.0, equal_nan=True)))
            measured = f"{ranks[0][place]:g} on rank 0, {other[place]:g} on rank {rank}"
        else:
            continue
        fix = "find them on one rank, and give all of them comm.bcast(...)"
        raise InputError(f"{what} are others on other ranks", None, measured, "the same on every rank", fix)
