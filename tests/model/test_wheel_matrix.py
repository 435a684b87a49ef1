"""A wheel's matrix by the terms of its sectors, against the one assembled entry by entry."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
from tolerances import LAST_BIT

import fretwave as fw
from fretwave.model import wheel_matrix
from fretwave.model.wheel_matrix import WheelMatrix


def assembled(parts: dict, sectors: int, factors: np.ndarray) -> np.ndarray:
    rows, columns = parts[0].shape
    out = np.zeros((sectors * rows, sectors * columns))
    for j in range(sectors):
        for k, A in parts.items():
            at = (j + k) % sectors
            out[j * rows : (j + 1) * rows, at * columns : (at + 1) * columns] += factors[j] * A.toarray()
    return out


@pytest.mark.ranks(1)
@pytest.mark.parametrize("sectors", [2, 3, 7])
def test_rows_products_and_sums(sectors: int) -> None:
    rng = np.random.default_rng(7)
    parts = {k: sp.random(4, 4, 0.5, "csr", random_state=rng) for k in (0, 1, -1)}
    factors, n = rng.standard_normal(sectors), 4 * sectors
    other = sp.random(n, n, 0.2, "csr", random_state=rng)
    ring = other + 2.0 * (WheelMatrix(parts, sectors) + WheelMatrix(parts, sectors, factors))
    expected = other.toarray() + 2.0 * assembled(parts, sectors, 1.0 + factors)
    np.testing.assert_allclose(ring.toarray(), expected, rtol=0, atol=LAST_BIT)
    for begin, end in [(0, n), (4, 8), (3, 6), (n - 1, n), (2, 2), (4, 4), (n, n)]:
        np.testing.assert_allclose(ring.rows(begin, end).toarray(), expected[begin:end], rtol=0, atol=LAST_BIT)
    np.testing.assert_allclose(ring.diagonal(), np.diagonal(expected), rtol=0, atol=LAST_BIT)
    dense = rng.standard_normal((n, n))
    np.testing.assert_allclose((ring + dense).toarray(), expected + dense, rtol=0, atol=LAST_BIT)
    x = rng.standard_normal((n, 3)) + 1j * rng.standard_normal((n, 3))
    np.testing.assert_allclose(ring @ x, expected @ x, rtol=0, atol=10 * LAST_BIT)
    np.testing.assert_allclose(ring @ x[:, 0].real, expected @ x[:, 0].real, rtol=0, atol=10 * LAST_BIT)


@pytest.mark.ranks(2)
def test_each_rank_makes_the_rows_of_its_sectors(comm, monkeypatch: pytest.MonkeyPatch) -> None:
    made, around = [], wheel_matrix.around

    def counted(given: dict, sectors: int, first: int, end: int) -> sp.csr_matrix:
        made.append(end - first)
        return around(given, sectors, first, end)

    monkeypatch.setattr(wheel_matrix, "around", counted)
    one = fw.Sector({0: np.eye(3)}, {0: 4 * np.eye(3), 1: -np.eye(3), -1: -np.eye(3)}, 7)
    with one.wheel(comm) as model:
        begin, end = model.ownership
    assert made == [(end - begin) // 3] * 2 and 3 <= made[0] <= 4
