"""Abaqus/Standard matrices of ``*MATRIX GENERATE`` and ``*MATRIX OUTPUT`` (``job_STIF1.mtx``, ``job_MASS1.mtx``).

Layout (SIMULIA, Abaqus Keywords Reference, *MATRIX OUTPUT and *MATRIX INPUT):
FORMAT=MATRIX INPUT (default): "row node, its dof, column node, its dof, entry", the lower or the upper triangle or all;
internal nodes have negative numbers. FORMAT=COORDINATE: "row column entry", indices from 1, all entries.
Held dofs stay in the matrix with 1e36 on the diagonal of K (as files show); they are left out here.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import scipy.sparse as sp

from ..arrays import Array, IntArray
from ..errors import InputError
from ..texts import display, number_in
from .entries import Entries, order_of
from .text import columns_of, doubt_of_end, first_data_line, head_of, triplets

#: A diagonal entry from here on is Abaqus' penalty 1e36 on a held dof.
PENALTY = 1e35


def looks_like(head: bytes) -> bool:
    """The first line of data has three or five numbers."""
    return _width(head) in (3, 5)


def _width(head: bytes) -> int:
    words = re.split(r"[,;\s]+", first_data_line(head).strip())
    try:
        return len([number_in(word) for word in words])
    except ValueError:
        return 0


def read(path: Path) -> Entries:
    """A matrix in either format; MATRIX INPUT gives node and direction of each row."""
    width = _width(head_of(path, 4096))
    table = columns_of(path, width)
    if width == 3:
        entries = triplets(table, display(path), "Abaqus, coordinate")
    else:
        entries = _labelled(table, display(path))
    diagonal = entries.rows == entries.columns
    entries.doubt = doubt_of_end(path)
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
    rows, columns, shape = places[::2], places[1::2], (len(labels),) * 2
    half = _is_half(rows, columns, shape)
    if half:
        rows, columns = np.maximum(rows, columns), np.minimum(rows, columns)
    return Entries(rows, columns, table[:, 4], shape, where, "Abaqus, matrix input", labels, half=half)


def _numbered(ends: IntArray) -> tuple[IntArray, IntArray]:
    """Different (node, dof) by `order_of`, and the number of each end among them."""
    span = int(ends[:, 1].max()) + 1
    keys, inverse = np.unique(ends[:, 0] * span + ends[:, 1], return_inverse=True)
    found = np.column_stack([keys // span, keys % span])
    order = order_of(found)
    number = np.empty(len(order), dtype=np.int64)
    number[order] = np.arange(len(order))
    return found[order], number[inverse]


def _is_half(rows: IntArray, columns: IntArray, shape: tuple[int, int]) -> bool:
    """No entry beside the diagonal has a mirror image: a triangle in Abaqus' order of the dofs, which is not ours."""
    pattern = sp.csr_matrix((np.ones(len(rows)), (rows, columns)), shape=shape)
    pattern.data[:] = 1.0
    mirrored = pattern.multiply(pattern.T).nnz - np.count_nonzero(pattern.diagonal())
    return bool(mirrored == 0 and (rows != columns).any())
