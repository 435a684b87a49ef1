"""What parts of a wheel exchange between ranks that stand in rows and columns."""

from __future__ import annotations

import numpy as np
import pytest
from models.core_models import options

from fretwave import _core


def numbers(source: int, destination: int, turn: int) -> np.ndarray:
    """What one rank has for another: often nothing, else told apart from all else."""
    count = (3 * source + 5 * destination + turn) % 7 if (source + destination + turn) % 3 else 0
    return source + 1e3 * destination + 1e6 * turn + np.arange(count) / 8


@pytest.mark.ranks(1, 2, 3, 4)
@pytest.mark.parametrize("direct", [1, 5])
@pytest.mark.parametrize("members", [1, 2, 3, 4])
def test_all_arrives_in_the_order_of_its_ranks(comm, members, direct):
    """In two stages and straight; also in rows that the number of ranks does not fill, several times in a row and on
    part of the ranks."""
    part = comm.Split(comm.rank // members, comm.rank)
    for turn in range(4):
        expected = np.concatenate([numbers(source, part.rank, turn) for source in range(part.size)])
        to = [numbers(part.rank, r, turn) for r in range(part.size)]
        with options(fw_exchange_direct=direct):
            found = _core.exchange(part.py2f(), to, len(expected))
        np.testing.assert_array_equal(found, expected)
    part.Free()
