"""Dense matrices times a few columns, of all numbers of them that fill registers or do not."""

from __future__ import annotations

import numpy as np
import pytest

from fretwave import _core

#: Columns of a product, terms of its sums: about the blocks in which they are taken.
SIZES = ((1, 1), (5, 3), (12, 16), (13, 17), (25, 48), (31, 130))


@pytest.mark.parametrize("real", [np.float64, np.float32])
@pytest.mark.parametrize("transposed", [False, True])
@pytest.mark.parametrize("rows", [*range(1, 40), 47, 48, 63, 64, 65])
def test_product(rows: int, transposed: bool, real: type) -> None:
    rng = np.random.default_rng(rows)
    for columns, terms in SIZES:
        A = rng.standard_normal((terms, rows)).astype(real)
        B = rng.standard_normal((terms, columns) if transposed else (columns, terms)).astype(real)
        C = _core.flat_product(B, A, transposed)
        exact = (B.T if transposed else B).astype(np.float64) @ A
        assert C.dtype == real and C.shape == exact.shape
        sizes = np.abs(B.T if transposed else B).astype(np.float64) @ np.abs(A)
        assert np.all(np.abs(C - exact) <= terms * np.finfo(real).eps * sizes)


def test_sizes_that_do_not_fit() -> None:
    with pytest.raises(ValueError, match="do not fit"):
        _core.flat_product(np.ones((3, 4)), np.ones((3, 2)))
