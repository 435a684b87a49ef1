"""The maps of contact pairs, and which rank has a pair."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from ..errors import InputError
from .checks import checked_csr
from .contact import Contact
from .sectors import by_sector

Maps = Mapping[int, sp.csr_matrix]  #: B of a contact, by the sector ahead that its dofs are of
Numbers = npt.NDArray[np.intp]


def maps_of(contact: Contact, n_dof: int) -> Maps:
    """B of a contact.

    Raises
    ------
    InputError
        It does not fit a model of so many dofs, or an entry is no number.
    """
    where = f"B of contact '{contact.name}'"
    maps = {k: checked_csr(B, "B", where) for k, B in by_sector(contact.B).items()}
    n_rows, d = maps[0].shape[0], contact.components
    for B in maps.values():
        if B.shape != (n_rows, n_dof) or n_rows % d:
            raise InputError(
                "B does not fit the model",
                f"contact '{contact.name}'",
                f"{B.shape}",
                f"(n_pairs * {d}, {n_dof})",
                "give B as u = B x",
            )
    return maps


def first_dofs(maps: Maps, components: int) -> Numbers:
    """The first dof that each pair's first row touches, in its own sector if it does."""
    first = np.zeros(maps[0].shape[0] // components, dtype=np.intp)
    for B in reversed(list(maps.values())):
        filled = np.diff(B.indptr)[::components] > 0
        first[filled] = B.indices[B.indptr[:-1][::components][filled]]
    return first


def pairs_with_dofs(first: Sequence[Numbers], begin: int, end: int) -> list[Numbers]:
    """Pairs of each contact whose first dofs are these: a wheel's pairs are where their sectors are."""
    return [np.nonzero((dofs >= begin) & (dofs < end))[0] for dofs in first]


def pairs_in_equal_shares(first: Sequence[Numbers], rank: int, size: int) -> list[Numbers]:
    """A rank's pairs of each contact: of all contacts together as many as other ranks have, or one more, by their first
    dofs."""
    order = np.argsort(np.concatenate([np.zeros(0, np.intp), *first]), kind="stable")
    mine = np.zeros(len(order), bool)
    begin, end = (-(-len(order) * r // size) for r in (rank, rank + 1))
    mine[order[begin:end]] = True
    return [np.nonzero(part)[0] for part in np.split(mine, np.cumsum([len(dofs) for dofs in first])[:-1])]
