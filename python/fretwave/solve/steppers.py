"""Embedded Runge-Kutta steps, explicit and implicit, for a right side that costs a solve of the whole structure.

Why not a library's: PETSc's TS (3.18, from Python) takes no rule of ours for the length of a step, which the contact
pressure bounds here, and keeps its history to itself, which a killed run needs back to the last bit; SciPy's implicit
solvers ask for a Jacobian, as many solves as there are contact pairs. What remains are tableaux and a loop over stages.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Protocol

import numpy as np

from ..arrays import Array

#: Past differences that Anderson's acceleration keeps, and the iterations after which a stage is given up.
WINDOW, MOST = 8, 40


class Rate(Protocol):
    """The rate at state x; `stage` is its place c in the step (0 begin, 1 end), for a first guess."""

    def __call__(self, x: Array, stage: float) -> Array: ...


@dataclass(frozen=True)
class Tableau:
    """A method whose last stage is the step's end, so that its rate is the first of the next step.

    All coefficients are >= 0: where no rate is negative, no stage goes back.

    Attributes
    ----------
    A : (s, s) lower triangular, the last row the weights b; a diagonal entry other than 0 makes a stage implicit
    error : (s,) b less the embedded weights
    order : of the method
    error_order : power of the step by which the estimate falls
    """

    A: Array
    error: Array
    order: int
    error_order: int

    @property
    def c(self) -> Array:
        """Places of the stages in the step."""
        return np.asarray(self.A.sum(axis=1))


def _tableau(rows: list[list[float]], error: list[float], order: int, error_order: int) -> Tableau:
    size = len(rows)
    A = np.array([row + [0.0] * (size - len(row)) for row in rows])
    return Tableau(A, np.array(error), order, error_order)


_W, _D = np.sqrt(2) / 4, 1 - np.sqrt(2) / 2

STEPPERS = {
    # Heun with Euler inside
    "heun": _tableau([[0], [1], [1 / 2, 1 / 2]], [-1 / 2, 1 / 2, 0], 2, 2),
    # Bogacki and Shampine, Appl. Math. Lett. 2 (1989)
    "bogacki_shampine": _tableau(
        [[0], [1 / 2], [0, 3 / 4], [2 / 9, 1 / 3, 4 / 9]],
        [2 / 9 - 7 / 24, 1 / 3 - 1 / 4, 4 / 9 - 1 / 3, -1 / 8],
        3,
        3,
    ),
    # trapezoidal rule with Euler inside: A-stable
    "trapezoidal": _tableau([[0], [1 / 2, 1 / 2]], [-1 / 2, 1 / 2], 2, 2),
    # TR-BDF2 with its third-order companion, Hosea and Shampine, Appl. Numer. Math. 20 (1996): L-stable
    "tr_bdf2": _tableau(
        [[0], [_D, _D], [_W, _W, _D]],
        [_W - (1 - _W) / 3, _W - (3 * _W + 1) / 3, _D - _D / 3],
        2,
        3,
    ),
}


class StageFailed(ArithmeticError):
    """A stage has no rate: the step must be shorter."""


class StageDiverged(StageFailed):
    """An implicit stage is not found, though the rate is known wherever it was looked for."""


@dataclass(frozen=True)
class Step:
    """One step: state and rate at its end, and the estimate of its error."""

    x: Array
    rate: Array
    error: Array


def take(tableau: Tableau, f: Rate, x: Array, rate: Array, h: float, tolerance: Array) -> Step:
    """One step of length h from x, where the rate is known.

    Parameters
    ----------
    tolerance : (n,)
        To which implicit stages are solved.

    Raises
    ------
    StageFailed
        An implicit stage does not converge, or `f` has no value somewhere.
    """
    rates = [rate]
    for row, c in zip(tableau.A[1:], tableau.c[1:]):
        known = x + h * sum(a * k for a, k in zip(row, rates))
        own = row[len(rates)]
        if own:
            x_stage, now = _implicit(partial(f, stage=c), known, h * own, rates[-1], tolerance)
        else:
            x_stage, now = known, f(known, c)
        rates.append(now)
    return Step(x_stage, now, h * sum(e * k for e, k in zip(tableau.error, rates)))


def _implicit(
    f: Callable[[Array], Array], known: Array, h: float, guess: Array, tolerance: Array
) -> tuple[Array, Array]:
    """x = known + h f(x) by Anderson's acceleration (Walker and Ni, SIAM J. Numer. Anal. 49, 2011) and f(x).

    It ends with a plain iteration: where f is 0, x is `known` to the last bit.
    """
    x = known + h * guess
    points: list[Array] = []
    defects: list[Array] = []
    for _ in range(MOST):
        image = known + h * f(x)
        defect = image - x
        if (np.abs(defect) <= tolerance).all():
            return image, f(image)
        points, defects = [*points[-WINDOW:], image], [*defects[-WINDOW:], defect]
        if len(points) == 1:
            x = image
            continue
        steps = np.diff(defects, axis=0).T / tolerance[:, None]
        weights = np.linalg.lstsq(steps, defect / tolerance, rcond=1e-10)[0]
        x = np.maximum(image - np.diff(points, axis=0).T @ weights, known)
    raise StageDiverged("an implicit stage does not converge")
