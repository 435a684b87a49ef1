"""The cubic through two points of a branch with their tangents, piece by piece (src/solve/hermite.h)."""

from __future__ import annotations

import numpy as np

from ..arrays import Array

#: Cosine of the turn within a step past which it is a corner, and its cubic a straight line.
CORNER = 0.2


def between(x: float | Array, y0: Array, begin: Array, y1: Array, end: Array) -> Array:
    """The cubic from y0 to y1 at x in [0, 1], with its derivatives by x at both ends."""
    a, b, c, d = (1 + 2 * x) * (1 - x) ** 2, x * (1 - x) ** 2, x * x * (3 - 2 * x), x * x * (x - 1)
    return np.asarray(a * y0 + b * begin + c * y1 + d * end)


def slopes(length: float, along: float) -> tuple[float, float] | None:
    """Factors on the unit tangents t0, t1 that make them dy/dx over a step, or None for a straight line.

    Parameters
    ----------
    length : row . (y1 - y0), row = W t0: the step's arclength
    along : row . t1, for dy/ds = t / (row . t)
    """
    return (length, length / along) if along > CORNER and length > 0 else None


def derivatives(factors: tuple[float, float] | None, y0: Array, t0: Array, y1: Array, t1: Array) -> tuple[Array, Array]:
    """Derivatives by x at both ends of a step: of the tangents by their factors (`slopes`), or of a straight line."""
    return (y1 - y0, y1 - y0) if factors is None else (factors[0] * t0, factors[1] * t1)


class Cubic:
    """A curve through rows of values.

    Parameters
    ----------
    values : (n, k)
    begin, end : (n - 1, k)
        Derivatives by x in [0, 1] at the begin and the end of each step between two rows.
    """

    def __init__(self, values: Array, begin: Array, end: Array) -> None:
        self.values, self.begin, self.end = values, begin, end

    def __len__(self) -> int:
        return len(self.values)

    def at(self, places: Array) -> Array:
        """Values (m, k) at places (m,): 3.25 is a quarter of the step from row 3 to row 4."""
        places = np.clip(places, 0, len(self) - 1)
        rows = places.astype(int)
        values = np.array(self.values[rows], dtype=float)
        inside = np.flatnonzero(places > rows)
        i, x = rows[inside], (places - rows)[inside, np.newaxis]
        values[inside] = between(x, self.values[i], self.begin[i], self.values[i + 1], self.end[i])
        return values

    def places(self, n: int) -> Array:
        """Places of all rows, and of n - 1 more in each step."""
        return np.asarray(np.arange(n * (len(self) - 1) + 1 if len(self) else 0) / n)


def piece(place: float, rows: int) -> tuple[int, float]:
    """Row before a place, and share of the step to the next one."""
    place = max(place, 0.0)
    i = min(int(place), rows - 1)
    return (i - 1, 1.0) if i == rows - 1 and rows > 1 and place > i else (i, place - i if rows > 1 else 0.0)
