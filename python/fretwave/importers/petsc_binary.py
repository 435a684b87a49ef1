"""PETSc binary files of one matrix (``MatView`` to a binary viewer).

Layout (PETSc manual pages MatLoad and PetscBinaryRead): big-endian; integers 1211216, rows, columns, entries; the
number of entries of each row; their columns, row by row; their values. "Entries" -1 means a dense matrix, row by row.
Integers have 4 bytes, or 8 when PETSc was configured with 64-bit indices; values are double, or complex double. Read
here without PETSc, so that a file of any configuration is read.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import scipy.sparse as sp

from ..texts import display
from .entries import Entries

#: MAT_FILE_CLASSID of petscmat.h.
MATRIX = 1211216


def integer_type(head: bytes) -> str:
    """Type of the integers, "" when this is no PETSc matrix."""
    for kind in (">i4", ">i8"):
        size = np.dtype(kind).itemsize
        if len(head) >= 4 * size and np.frombuffer(head[:size], kind)[0] == MATRIX:
            return kind
    return ""


def read(path: Path) -> Entries:
    """A sparse or dense matrix."""
    content = np.fromfile(path, dtype=np.uint8)
    kind = integer_type(content[:64].tobytes())
    size = np.dtype(kind).itemsize
    rows, columns, entries = (int(n) for n in content[size : 4 * size].view(kind))
    integers = 4 + (0 if entries < 0 else rows + entries)
    count = rows * columns if entries < 0 else entries
    values = content[size * integers :]
    scalar = {8 * count: ">f8", 16 * count: ">c16"}.get(len(values))
    if scalar is None or min(rows, columns) < 0 or integers * size > len(content):
        raise ValueError(
            f"{len(values)} bytes of values; {count} entries are {8 * count} bytes (real) or {16 * count} (complex)"
        )
    numbers = values.view(scalar).astype(scalar[1:])
    if entries < 0:
        return Entries.of(numbers.reshape(rows, columns), display(path), "PETSc binary, dense")
    lengths, places = np.split(content[4 * size : size * integers].view(kind).astype(np.int64), [rows])
    starts = np.concatenate([[0], np.cumsum(lengths)])
    matrix = sp.csr_matrix((numbers, places, starts), shape=(rows, columns))
    return Entries.of(matrix, display(path), "PETSc binary")
