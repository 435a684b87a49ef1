"""Abaqus/Standard matrices of ``*MATRIX GENERATE`` and ``*MATRIX OUTPUT`` (``job_STIF1.mtx``, ``job_MASS1.mtx``).

Layout (SIMULIA, Abaqus Keywords Reference, *MATRIX OUTPUT and *MATRIX INPUT):
FORMAT=MATRIX INPUT (default): "row node, its dof, column node, its dof, entry", the lower or the upper triangle or all;
internal nodes have negative numbers. FORMAT=COORDINATE: "row column entry", indices from 1, all entries.
Held dofs stay in the matrix with 1e36 on the diagonal of K (as files show); they are left out here.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import scipy.sparse as sp

from ..errors import InputError
from ..source import display
from .entries import Array, Entries, IntArray, order_of
from .text import columns_of, first_data_line, triplets

#: A diagonal entry from here on is Abaqus' penalty 1e36 on a held dof.
PENALTY = 1e35


def looks_like(head: bytes) -> bool:
    """The first line of data has three or five numbers."""
    return _width(head) in (3, 5)


def _width(head: bytes) -> int:
    words = first_data_line(head).replace(",", " ").split()
    try:
        return len([float(word) for word in words])
    except ValueError:
        return 0


def read(path: Path) -> Entries:
    """A matrix in either format; MATRIX INPUT gives node and direction of each row."""
    with path.open("rb") as file:
        width = _width(file.read(4096))
    table = columns_of(path, width)
    if width == 3:
        entries = triplets(table, display(path), "Abaqus, coordinate")
    else:
        entries = _labelled(table, display(path))
    diagonal = entries.rows == entries.columns
    held = entries.rows[diagonal & (entries.values >= PENALTY)]
    entries.held = np.isin(np.arange(entries.shape[0]), held)
    return entries


def _labelled(table: Array, where: str) -> Entries:
    numbers = table[:, :4].astype(np.int64)
    if (numbers != table[:, :4]).any() or (numbers == 0).any():
        row = int(np.flatnonzero((numbers != table[:, :4]).any(axis=1) | (numbers == 0).any(axis=1))[0])
        raise InputError(
            "a node or dof number is not a whole number",
            where,
            f"entry {row + 1}: {', '.join(f'{value:g}' for value in table[row, :4])}",
            "node, dof, node, dof, entry",
            "export with *MATRIX OUTPUT, FORMAT=MATRIX INPUT",
        )
    labels, places = _numbered(numbers.reshape(-1, 2))
    rows, columns = _one_triangle(places[::2], places[1::2], len(labels))
    return Entries(rows, columns, table[:, 4], (len(labels),) * 2, where, "Abaqus, matrix input", labels)


def _numbered(ends: IntArray) -> tuple[IntArray, IntArray]:
    """Different (node, dof) by `order_of`, and the number of each end among them."""
    span = int(ends[:, 1].max()) + 1
    keys, inverse = np.unique(ends[:, 0] * span + ends[:, 1], return_inverse=True)
    found = np.column_stack([keys // span, keys % span])
    order = order_of(found)
    number = np.empty(len(order), dtype=np.int64)
    number[order] = np.arange(len(order))
    return found[order], number[inverse]


def _one_triangle(rows: IntArray, columns: IntArray, size: int) -> tuple[IntArray, IntArray]:
    """A triangle in Abaqus' order of the dofs is none in ours: an entry without mirror image goes to the lower one."""
    ones = np.ones(len(rows), dtype=np.int8)
    pattern = sp.csr_matrix((ones, (rows, columns)), shape=(size, size))
    pattern.data[:] = 1
    off = rows != columns
    both = pattern.multiply(pattern.T).nnz > np.count_nonzero(pattern.diagonal())
    if both or not off.any():
        return rows, columns
    return np.maximum(rows, columns), np.minimum(rows, columns)
