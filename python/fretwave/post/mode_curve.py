"""A mode's frequency and damping as functions of amplitude, read off a branch that may fold."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Optional

import numpy as np

from ..arrays import Array, Indices
from ..errors import InputError
from .largest import largest

if TYPE_CHECKING:
    from scipy.interpolate import PchipInterpolator

#: weights of (log amplitude, relative frequency, damping ratio) in the length along the curve: all of order one
LENGTH_WEIGHTS = (1.0, 10.0, 20.0)
#: Damping ratios closer to zero than this have no sign: the rounding of a branch.
NO_DAMPING = 1e-10
#: A value this close to that of an end of a branch, relative, is met there.
AT_THE_END = 1e-10
#: Relative steps of the amplitude below this have no direction: a point that is there twice.
NO_STEP = 1e-9
#: Damping ratios that differ by less are alike to rounding.
LEAST_DAMPING = 1e-13


def most_damped(zeta: Array) -> int:
    """Point of the largest damping; the first of a branch that does not slip, where all differ by rounding alone."""
    return largest(zeta, least=LEAST_DAMPING)


def varies(table: Mapping[str, Any], rows: Indices | slice = slice(None)) -> bool:
    """Damping changes along some rows of a branch by more than rounding, and than its solver left at each of them."""
    zeta = np.asarray(table["zeta"])[rows]
    left = np.zeros(len(zeta))
    if "lambda_error_solver" in table and "omega0" in table:
        left = (np.asarray(table["lambda_error_solver"]) / np.asarray(table["omega0"]))[rows]
    known, left = np.isfinite(zeta), np.where(np.isnan(left), 0.0, left)
    least = (zeta - left).max(where=known, initial=-np.inf)
    most = (zeta + left).min(where=known, initial=np.inf)
    return most_damped(zeta) != most_damped(-zeta) and bool(least > most)


def without_rounding(zeta: float) -> float:
    """A damping ratio as it is told: zero where it has no sign."""
    return zeta if abs(zeta) > NO_DAMPING else 0.0


def lowest(frequency: Array) -> int:
    """Point of the lowest frequency; of those that are alike to rounding the first."""
    return largest(-frequency)


def at_the_end(values: Array, asked: float) -> float:
    """The end of a branch's values at which one that is asked for is met; else that value as it is."""
    end = float(np.clip(asked, values.min(), values.max()))
    return end if np.isfinite(asked) and abs(asked - end) <= AT_THE_END * abs(asked) else asked


def forward(amplitude: Array, point: int) -> Optional[bool]:
    """Whether a branch goes its own way at a point, the one in which it starts; False where it runs back.

    None of a branch without steps. Next to a fold that was not located: False.
    """
    steps = np.diff(amplitude)
    moves = np.flatnonzero(np.abs(steps) > NO_STEP * amplitude[1:])
    around = np.concatenate([moves[moves < point][-1:], moves[moves >= point][:1]])
    return bool((steps[around] * steps[moves[0]] > 0).all()) if len(moves) else None


#: A value this close to a point's own, relative or from zero, is met there.
AT_A_POINT = 1e-13
#: Places of a curve this close to each other are one, in its length.
ONE_PLACE = 1e-7

#: Relative length of the curve of a branch of one point.
SHORTEST = 1e-12


@dataclass(frozen=True)
class ModeValue:
    """Modal values at one amplitude; `sheets` counts the solutions there: 3 between two folds, 0 off the branch."""

    amplitude: float
    omega: float
    omega0: float
    zeta: float
    sheets: int


@dataclass(frozen=True)
class Crossing:
    """Zero of the damping: a limit cycle, stable where damping grows with amplitude.

    `stable` is of its own amplitude alone; None at an end of the branch and where it runs back between two folds.
    """

    amplitude: float
    omega: float
    stable: Optional[bool]


class ModeCurve:
    """Log a, omega, omega0, zeta as piecewise cubics of the length along the branch.

    A fold is an ordinary place of such a curve, so no sheet has to be cut out beforehand. The cubics keep the
    monotonicity of the points: a smooth spline rings at the abrupt onset of slip and invents solutions there.
    """

    def __init__(
        self, amplitude: Array, omega: Array, omega0: Array, zeta: Array, stick: Optional[Array] = None
    ) -> None:
        from scipy.interpolate import PchipInterpolator  # 0.1 s, for who looks at curves

        with np.errstate(divide="ignore", invalid="ignore"):
            level = np.log(amplitude)
        values = np.column_stack([level, omega, omega0, np.where(np.abs(zeta) > NO_DAMPING, zeta, 0.0)])
        values = values[np.isfinite(values).all(axis=1)]
        if not len(values):
            raise InputError("the branch has no point with finite values", None, f"{len(amplitude)} points")
        length = _length(values)
        keep = np.concatenate([[True], np.diff(length) > 1e-12 * length[-1]])
        if keep.sum() < 2:  # one point is a curve too short to see
            values = values[[0, 0]] * [[1.0], [1.0 + SHORTEST]]
            length, keep = np.array([0.0, 1.0]), np.array([True, True])
        #: Where the branch begins and ends all pairs stick: motions without damping are neither fed nor damped there.
        self._still = (False, False) if stick is None else (bool(stick[0] >= 1.0), bool(stick[-1] >= 1.0))
        self._curve = PchipInterpolator(length[keep], values[keep], axis=0)
        self._log_amplitude = PchipInterpolator(length[keep], values[keep, 0])
        self._zeta = PchipInterpolator(length[keep], values[keep, 3])

    @classmethod
    def from_table(cls, table: Mapping[str, Array]) -> ModeCurve:
        """From the columns of a mode's branch table."""
        names = ("amplitude", "omega", "omega0", "zeta")
        amplitude, omega, omega0, zeta = (np.asarray(table[name], dtype=float) for name in names)
        return cls(amplitude, omega, omega0, zeta, np.asarray(table["stick"], float) if "stick" in table else None)

    def sampled(self, count: int = 2000) -> dict[str, Array]:
        """Columns amplitude, omega, omega0, zeta, frequency_hz at even lengths along the curve, for drawing."""
        x = self._curve.x
        fine = np.unique(np.concatenate([np.linspace(x[0], x[-1], count), x]))
        values = self._curve(fine)
        names = ("amplitude", "omega", "omega0", "zeta")
        columns = dict(zip(names, (np.exp(values[:, 0]), *values[:, 1:].T)))
        return {**columns, "frequency_hz": columns["omega"] / (2.0 * np.pi)}

    def all_at(self, amplitude: float) -> list[ModeValue]:
        """Every solution at an amplitude, in the order of the branch."""
        points = self._curve(_places(self._log_amplitude, np.log(amplitude)))
        return [ModeValue(amplitude, float(p[1]), float(p[2]), float(p[3]), len(points)) for p in points]

    def at(self, amplitude: float, falling: bool = True) -> ModeValue:
        """The solution that a slowly falling (or growing) amplitude follows: the last (first) sheet it meets."""
        values = self.all_at(amplitude)
        if not values:
            return ModeValue(amplitude, np.nan, np.nan, np.nan, 0)
        return values[-1 if falling else 0]

    def amplitudes_at(self, zeta: float) -> list[float]:
        """Amplitudes at which the mode has a damping ratio."""
        return [float(a) for a in np.exp(self._log_amplitude(_places(self._zeta, zeta)))]

    def crossings(self) -> list[Crossing]:
        """Zeros of the damping ratio in the order of the branch, not where it stays zero."""
        return [self._crossing(s) for s in _places(self._zeta, 0.0) if self._changes_sign(s)]

    def _changes_sign(self, length: float) -> bool:
        """Damped on one side and fed on the other; at an end of the branch, one of both."""
        values = self._beside(length)
        if len(values) < 2 and self._still[0 if length < 0.5 * float(self._zeta.x[-1]) else 1]:
            return False
        return all(values) and (len(values) < 2 or values[0] * values[1] < 0)

    def _beside(self, length: float) -> list[float]:
        """Damping at the nearest knots before and behind a place of the curve; at an end of it, of one of both."""
        x = self._zeta.x
        near = 1e-9 * x[-1]
        sides = [x[x < length - near][-1:], x[x > length + near][:1]]
        return [float(self._zeta(side[0])) for side in sides if len(side)]

    def _crossing(self, length: float) -> Crossing:
        log_amplitude, omega = self._curve(length)[:2]
        stable = self._rises(length) if len(self._beside(length)) == 2 and self._goes_on(length) else None
        return Crossing(float(np.exp(log_amplitude)), float(omega), stable)

    def _rises(self, length: float) -> bool:
        return bool(self._zeta(length, 1) / self._log_amplitude(length, 1) > 0.0)

    def _goes_on(self, length: float) -> bool:
        """Not where the curve runs back, or turns."""
        steps = np.diff(self._log_amplitude(self._log_amplitude.x))
        moves = steps[np.abs(steps) > NO_STEP]
        return len(moves) > 0 and bool(self._log_amplitude(length, 1) * moves[0] > 0.0)


def _places(curve: PchipInterpolator, value: float) -> Array:
    """Lengths at which a curve has a value, in order and each once.

    At one of its points the pieces on both sides have a root, or by rounding neither has.
    """
    roots = np.unique(curve.solve(value, discontinuity=False, extrapolate=False))
    met = curve.x[np.abs(curve(curve.x) - value) <= AT_A_POINT * max(1.0, abs(value))]
    apart = np.abs(np.subtract.outer(roots, met)).min(axis=1, initial=np.inf) > ONE_PLACE * curve.x[-1]
    return np.sort(np.concatenate([roots[np.isfinite(roots) & apart], met]))


def _length(values: Array) -> Array:
    scaled = np.column_stack([values[:, 0], values[:, 1] / np.abs(values[:, 1]).max(), values[:, 3]])
    steps = np.linalg.norm(np.diff(scaled, axis=0) * LENGTH_WEIGHTS, axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)])
