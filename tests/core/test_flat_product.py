"""Dense matrices times a few columns, of all numbers of them that fill registers or do not."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from fretwave import _core

pytestmark = pytest.mark.ranks(1)

#: Columns of a product, terms of its sums: about the blocks in which they are taken.
SIZES = ((1, 1), (5, 3), (12, 16), (13, 17), (25, 48), (31, 130), (0, 5), (5, 0))


@pytest.fixture(params=[False, True], ids=["widest", "narrow"], autouse=True)
def registers(request: pytest.FixtureRequest) -> Iterator[None]:
    """Those of AVX-512 where the machine has them, and those of AVX2."""
    _core.keep_registers_narrow(request.param)
    yield
    _core.keep_registers_narrow(False)


@pytest.mark.parametrize("real", [np.float64, np.float32])
@pytest.mark.parametrize("transposed", [False, True])
@pytest.mark.parametrize("rows", [*range(40), 47, 48, 63, 64, 65])
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


@pytest.mark.parametrize("real", [np.float64, np.float32])
@pytest.mark.parametrize("rows", [3, 15, 31])
def test_product_added_to_part_of_a_matrix(rows: int, real: type) -> None:
    """What lies beside its columns stays; times zero even a nan is none."""
    rng = np.random.default_rng(rows)
    A, B = rng.standard_normal((20, rows)).astype(real), rng.standard_normal((13, 20)).astype(real)
    for alpha, beta in ((1.0, 1.0), (-1.0, 1.0), (2.5, -0.5), (1.0, 0.0)):
        C = rng.standard_normal((13, rows + 2)).astype(real)
        if beta == 0:
            C[:, :rows] = np.nan
        before = C.copy()
        _core.flat_product_added(B, A, False, alpha, beta, C)
        expected = alpha * (B @ A) + (beta * before[:, :rows] if beta else 0)
        np.testing.assert_allclose(C[:, :rows], expected, 0, 100 * np.finfo(real).eps)
        assert np.array_equal(C[:, rows:], before[:, rows:])


def test_sizes_that_do_not_fit() -> None:
    with pytest.raises(ValueError, match="do not fit"):
        _core.flat_product(np.ones((3, 4)), np.ones((3, 2)))
    with pytest.raises(ValueError, match="do not fit"):
        _core.flat_product_added(np.ones((3, 4)), np.ones((4, 2)), False, 1.0, 1.0, np.ones((3, 1)))
