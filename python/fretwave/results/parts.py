"""The branches of one table, where it has several."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from ..arrays import Array, Indices

#: Columns that tell the branches of one table apart.
PARTS = ("value", "level", "nodal_diameter", "line", "start")


def rows_of_branches(columns: Mapping[str, Array]) -> Iterator[Indices]:
    """Rows of each branch of a table, in the order of the table."""
    parts = [columns[name] for name in PARTS if name in columns]
    if not parts:
        yield np.arange(len(next(iter(columns.values()), ())))
        return
    keys = np.column_stack(parts)
    firsts = np.sort(np.unique(keys, axis=0, return_index=True)[1])
    for first in firsts:
        yield np.flatnonzero((keys == keys[first]).all(axis=1))
