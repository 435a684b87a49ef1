"""Arrays that lie in parts on the ranks and pass rank 0 piece by piece: none has to hold the whole."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from ..arrays import AnyArray, Array
from .gather import part_of

if TYPE_CHECKING:
    from mpi4py import MPI
    from petsc4py import PETSc

#: Entries of a message, 32 MB.
PIECE = 1 << 22
#: Of these messages: what a rank that fails has to say is none of them (`mpi.guard`).
TAG = 32002


class Cuttable(Protocol):
    """An array, or what rows of one can be taken of."""

    @property
    def shape(self) -> tuple[int, ...]: ...

    def __getitem__(self, rows: slice, /) -> AnyArray: ...


class Spread:
    """An array cut along its first axis over the ranks, in their order. Collective.

    Parameters
    ----------
    local : (n_local, ...) or PETSc.Vec
        This rank's part; of a vector a copy.

    Attributes
    ----------
    shape : (n, ...) of the whole
    """

    def __init__(self, comm: MPI.Comm, local: Array | PETSc.Vec) -> None:
        part = part_of(local)
        self.comm, self.local = comm, np.ascontiguousarray(part, dtype=float)
        self.shape = (comm.allreduce(len(part)), *part.shape[1:])
        self.dtype = self.local.dtype

    def pieces(self) -> Iterator[Array]:
        """All entries in their order on rank 0, some at a time; the others send theirs and get none. Collective."""
        flat = self.local.reshape(-1)
        if self.comm.rank:
            self.comm.send(len(flat), 0, TAG)
            for first in range(0, len(flat), PIECE):
                self.comm.Send(flat[first : first + PIECE], 0, TAG)
            return
        if len(flat):
            yield flat
        buffer = np.empty(PIECE if self.comm.size > 1 else 0)
        for rank in range(1, self.comm.size):
            left = self.comm.recv(source=rank, tag=TAG)
            while left:
                piece = buffer[: min(left, PIECE)]
                self.comm.Recv(piece, rank, TAG)
                yield piece
                left -= len(piece)


def send_parts(arrays: Mapping[str, Any]) -> None:
    """What ranks other than 0 do while it goes through the pieces of all that is spread, in this order. Collective."""
    for values in arrays.values():
        if isinstance(values, Spread):
            for _ in values.pieces():
                pass


def fill(vector: PETSc.Vec, whole: Cuttable | None) -> None:
    """Set a vector to what rank 0 has as a whole. Collective."""
    comm = vector.comm.tompi4py()
    begin, end = vector.getOwnershipRange()
    ranges = comm.gather((begin, end))
    if comm.rank:
        local = np.empty(end - begin)
        for first in range(0, len(local), PIECE):
            comm.Recv(local[first : first + PIECE], 0, TAG)
        vector.setArray(local)
        return
    assert whole is not None
    vector.setArray(np.asarray(whole[begin:end], dtype=float))
    for rank, (begin, end) in enumerate(ranges[1:], 1):
        for first in range(begin, end, PIECE):
            comm.Send(np.ascontiguousarray(whole[first : min(first + PIECE, end)], dtype=float), rank, TAG)
