"""A compressed sparse matrix from a file: its indices are looked at before SciPy's loops trust them."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp


def check_compressed(matrix: sp.spmatrix) -> None:
    """Of any kind of matrix; only compressed ones (rows, columns, blocks) have something to check.

    Raises
    ------
    ValueError
        An index is out of range, or the starts of rows are not those of its entries.
    """
    if not hasattr(matrix, "indptr"):
        return
    starts = matrix.indptr  # SciPy's check skips a matrix whose last start, its number of entries, is negative
    if starts[0] != 0 or (np.diff(starts) < 0).any() or starts[-1] != len(matrix.indices):
        raise ValueError("the numbers of entries of its rows are wrong")
    matrix.check_format(full_check=True)
