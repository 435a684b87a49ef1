"""y' = A y with guards, from event to event to rounding, and none missed.

A step is so short that ||A|| h <= 1 (balanced A): the Taylor polynomial of degree 20 is then exact to 1 / 21! = 2e-20.
A guard is a polynomial of that degree too; where none of its Bernstein coefficients is negative it has no zero in the
step, otherwise the step is halved until its first zero stands alone. No sampling rate enters.
"""

from __future__ import annotations

from math import comb
from typing import Optional

import numpy as np
from scipy.linalg import matrix_balance

from .laws import Array
from .system import Linear

DEGREE = 20
#: Coefficients of a guard below this share of the terms they are made of are zero.
ROUNDING = 1e-11

#: Power basis on [0, 1] to Bernstein basis.
TO_BERNSTEIN = np.array([[comb(i, j) / comb(DEGREE, j) if j <= i else 0.0 for j in range(DEGREE + 1)]
                         for i in range(DEGREE + 1)])  # fmt: skip


class Piece:
    """One pattern of states, ready to be marched.

    Attributes
    ----------
    step : longest step h [s]
    taylor : (degree + 1, n, n), y(sigma h) = sum_j sigma^j taylor[j] y
    """

    def __init__(self, linear: Linear, share: float = 1.0) -> None:
        self.linear, self.A = linear, linear.A
        balanced, _ = matrix_balance(linear.A, permute=False)
        self.step = share / max(float(np.linalg.norm(balanced, 2)), 1e-300)
        powers = [np.eye(len(linear.A))]
        for j in range(1, DEGREE + 1):
            powers.append(powers[-1] @ linear.A * (self.step / j))
        self.taylor = np.array(powers)
        self.whole = self.taylor[::-1].sum(axis=0)
        self.owners = [(contact, follows) for contact, _, follows in linear.guards]
        self.rows = np.array([row for _, row, _ in linear.guards]).reshape(-1, len(linear.A))
        #: (n_guards, degree + 1, n): coefficients of the guards in sigma
        self.guards = np.einsum("gi,jik->gjk", self.rows, self.taylor)

    def after(self, y: Array, sigma: float) -> Array:
        """y, or columns of them, sigma steps later."""
        if sigma == 1.0:
            return self.whole @ y
        return np.tensordot(sigma ** np.arange(DEGREE + 1), self.taylor, 1) @ y

    def beginning(self, y: Array, big: Array) -> tuple[Array, Array]:
        """Coefficients of the guards with rounding left out, and the sign each begins with (0: it is nothing)."""
        a = self.guards @ y
        a[abs(a) <= ROUNDING * (abs(self.guards) @ big)] = 0.0
        sign = np.zeros(len(a))
        for g, row in enumerate(a):
            found = np.flatnonzero(row)
            sign[g] = np.sign(row[found[0]]) if len(found) else 0.0
        return a, sign

    def first_zero(self, y: Array, begun: Optional[Array] = None) -> tuple[float, int]:
        """First sigma in (0, 1] at which a guard falls below zero, and its number (2, -1: none does).

        `begun`: coefficients from `beginning`, whose zeros at sigma = 0 are left out.
        """
        best, which = 2.0, -1
        a = self.guards @ y if begun is None else begun
        for g in np.flatnonzero(((a @ TO_BERNSTEIN.T) < 0).any(axis=1)):
            c = a[g]
            if begun is not None:
                first = int(np.flatnonzero(c)[0])
                c = np.concatenate([c[first:], np.zeros(first)])  # divided by sigma^first
            sigma = falls_below_zero(c)
            if sigma < best:
                best, which = sigma, int(g)
        return best, which


def falls_below_zero(c: Array) -> float:
    """First zero in (0, 1] of a polynomial (power basis) that begins above zero; 2 without one."""
    stack = [(0.0, 1.0, TO_BERNSTEIN @ c)]
    while stack:
        low, high, b = stack.pop()
        if b.min() >= 0:
            continue
        if b[0] > 0 and b[-1] < 0 and np.count_nonzero(np.diff(np.sign(b))) == 1:
            return polished(c, low, high)
        if high - low < 1e-15:
            return low
        left, right = halved(b)
        middle = (low + high) / 2
        stack += [(middle, high, right), (low, middle, left)]
    return 2.0


def halved(b: Array) -> tuple[Array, Array]:
    """Bernstein coefficients on both halves (de Casteljau)."""
    left, right = np.empty_like(b), np.empty_like(b)
    for k in range(len(b)):
        left[k], right[-1 - k] = b[0], b[-1]
        b = (b[:-1] + b[1:]) / 2
    return left, right


def polished(c: Array, low: float, high: float) -> float:
    """The one zero in [low, high]: Newton, kept inside by bisection."""
    value, slope = c[::-1], (c[1:] * np.arange(1, len(c)))[::-1]
    at = (low + high) / 2
    for _ in range(60):
        f = np.polyval(value, at)
        low, high = (at, high) if f > 0 else (low, at)
        d = np.polyval(slope, at)
        new = at - f / d if d else low
        if not low <= new <= high:
            new = (low + high) / 2
        if abs(new - at) <= 2e-16:
            return float(new)
        at = new
    return float(at)
