"""The matrix of a whole wheel by the terms of its sectors: each rank makes its own rows, products need none of them."""

from __future__ import annotations

from operator import index
from typing import Any, Optional, Union, cast

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from ..arrays import Array
from .sectors import Given, Parts, Sparse, Term, around, by_sector, real_csr

#: Terms of a sector and, where the sectors are not alike, the factors (N,) of their rows in each.
Ring = tuple[Parts, Optional[Array]]


class WheelMatrix:
    """A sum of block-circulant matrices, the rows of each sector with a factor, and of further entries.

    Parameters
    ----------
    term : matrix or {k: matrix}
        On the sector k places ahead.
    sectors : int
        N.
    factors : (N,), optional
        Of the rows of each sector; 1 without it.

    Attributes
    ----------
    shape : (N rows, N columns of a sector)

    It has sums, multiples and products with arrays, like a matrix; `tocsr` makes all of its entries for anything else.

    Examples
    --------
    >>> import numpy as np, scipy.sparse as sp
    >>> ring = WheelMatrix({0: sp.eye(1) * 2.0, 1: -sp.eye(1)}, 3)
    >>> ring.rows(1, 3).toarray()
    array([[ 0.,  2., -1.],
           [-1.,  0.,  2.]])
    >>> ring @ np.array([1.0, 2.0, 4.0])
    array([0., 0., 7.])
    """

    __array_ufunc__ = None  # arrays leave sums and products to it

    def __init__(self, term: Term, sectors: int, factors: npt.ArrayLike | None = None) -> None:
        parts = {k: real_csr(A) for k, A in by_sector(term).items()}
        self.sectors, (rows, columns) = index(sectors), parts[0].shape
        self.shape = (self.sectors * rows, self.sectors * columns)
        self._rings: list[Ring] = [(parts, None if factors is None else np.asarray(factors, dtype=float))]
        self._added: list[Sparse] = []

    @property
    def height(self) -> int:
        """Rows of a sector."""
        return int(self.shape[0] // self.sectors)

    def __repr__(self) -> str:
        return f"WheelMatrix({self.shape[0]} x {self.shape[1]}, {self.sectors} sectors)"

    def rows(self, begin: int, end: int) -> Sparse:
        """Those from `begin` to `end` - 1; nothing but their sectors' is made."""
        first, last = begin // self.height, -(-end // self.height)
        parts = [self._of_ring(ring, first, last) for ring in self._rings]
        parts += [A[first * self.height : last * self.height] for A in self._added]
        made = sp.csr_matrix(sum(parts[1:], parts[0]))
        whole = (begin, end) == (first * self.height, last * self.height)
        return made if whole else made[begin - first * self.height : end - first * self.height]

    def _of_ring(self, ring: Ring, first: int, end: int) -> Sparse:
        parts, factors = ring
        rows = around(parts, self.sectors, first, end)
        if factors is not None:
            entries = np.diff(rows.indptr[:: self.height])
            rows.data *= np.repeat(factors[first:end], entries)
        return rows

    def tocsr(self) -> Sparse:
        """All of it."""
        return self.rows(0, self.shape[0])

    def toarray(self) -> Array:
        """All of it, dense."""
        return np.asarray(self.tocsr().toarray())

    def diagonal(self) -> Array:
        """(N rows,) of a square one."""
        n, all_of_them = self.height, range(self.sectors)
        return np.concatenate([self.rows(j * n, (j + 1) * n).diagonal(j * n) for j in all_of_them])

    def __matmul__(self, x: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """The product with a vector (N columns,) or columns of them (N columns, m)."""
        given = x.reshape(self.sectors, -1, *x.shape[1:])
        total: Any = np.zeros((self.sectors, self.height, *x.shape[1:]), np.result_type(x, float))
        for parts, factors in self._rings:
            for j in range(self.sectors):
                row = sum(A @ given[(j + k) % self.sectors] for k, A in parts.items())
                total[j] += row if factors is None else factors[j] * row
        product = total.reshape(self.shape[0], *x.shape[1:])
        return np.asarray(sum((A @ x for A in self._added), product))

    def __rmul__(self, factor: float) -> WheelMatrix:
        rings: list[Ring] = [({k: factor * A for k, A in parts.items()}, factors) for parts, factors in self._rings]
        return self._made_of(rings, [factor * A for A in self._added])

    def __add__(self, other: WheelMatrix | Given) -> WheelMatrix:
        if isinstance(other, WheelMatrix):
            return self._made_of(self._rings + other._rings, self._added + other._added)
        return self._made_of(self._rings, [*self._added, real_csr(other)])

    __radd__ = __add__

    def _made_of(self, rings: list[Ring], added: list[Sparse]) -> WheelMatrix:
        made = WheelMatrix.__new__(WheelMatrix)
        made.sectors, made.shape, made._rings, made._added = self.sectors, self.shape, rings, added
        return made


#: A sparse matrix, or that of a whole wheel by its terms.
Matrix = Union[Sparse, WheelMatrix]


def as_matrix(given: Given | WheelMatrix) -> Matrix:
    """In CSR form of float, but for that of a wheel, which stays as it is."""
    return given if isinstance(given, WheelMatrix) else real_csr(given)


def entries_of(given: Given | WheelMatrix) -> Sparse:
    """In CSR form of float, all of it."""
    return cast(Sparse, given.tocsr() if isinstance(given, WheelMatrix) else real_csr(given))
