"""Arrays in parts on the ranks: the whole passes rank 0 in order, a piece at a time."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc

from fretwave.mpi import spread
from fretwave.mpi.spread import Spread, fill, send_parts

pytestmark = [pytest.mark.ranks(1, 2, 3, 4), pytest.mark.parametrize("piece", [1, 7, 1 << 22])]


def test_pieces_are_the_whole_in_order(comm: MPI.Comm, monkeypatch: pytest.MonkeyPatch, piece: int) -> None:
    """The last rank has nothing of it."""
    monkeypatch.setattr(spread, "PIECE", piece)
    whole = np.arange(33.0).reshape(11, 3)
    parts = np.array_split(whole, max(comm.size - 1, 1))
    given = Spread(comm, parts[comm.rank] if comm.rank < len(parts) else whole[:0])
    assert given.shape == whole.shape
    if comm.rank:
        send_parts({"plain": 1.0, "given": given})
        return
    found = [one.copy() for one in given.pieces()]
    assert np.array_equal(np.concatenate(found), whole.ravel())
    assert all(len(one) <= piece for one in found[1:])


def test_what_a_failing_rank_says_is_no_piece(comm: MPI.Comm, monkeypatch: pytest.MonkeyPatch, piece: int) -> None:
    """It was taken for the number of entries to come: none."""
    monkeypatch.setattr(spread, "PIECE", piece)
    given, said = Spread(comm, np.arange(3.0)), None
    if comm.rank:
        said = comm.isend(None, 0, tag=32001)
        send_parts({"given": given})
        said.wait()
        return
    assert np.array_equal(np.concatenate([one.copy() for one in given.pieces()]), np.tile(np.arange(3.0), comm.size))
    for _ in range(1, comm.size):
        assert comm.recv(tag=32001) is None


def test_a_vector_is_filled_from_rank_0(comm: MPI.Comm, monkeypatch: pytest.MonkeyPatch, piece: int) -> None:
    monkeypatch.setattr(spread, "PIECE", piece)
    vector = PETSc.Vec().createMPI(23, comm=comm)
    whole = np.arange(23.0) ** 2
    fill(vector, whole if comm.rank == 0 else None)
    begin, end = vector.getOwnershipRange()
    assert np.array_equal(vector.getArray(), whole[begin:end])
    kept = Spread(comm, vector)
    vector.set(0.0)
    assert np.array_equal(kept.local, whole[begin:end])
    vector.destroy()
