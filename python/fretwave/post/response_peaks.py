"""Peaks of frequency responses and their distance from the backbones of modes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..arrays import Array
from .mode_curve import ModeCurve

#: share of the largest amplitude above which a point counts as near the peak; below it a response may not slip at all,
#: and a motion without damping takes thousands of periods to become steady
TOP = 0.9


@dataclass(frozen=True)
class Peak:
    """A place of a response curve: excitation frequency [rad/s] and fundamental amplitude; nan where there is none.

    `error` is what the amplitude may be wrong by, nan where that is not known.
    """

    omega: float
    amplitude: float
    error: float = 0.0


NOWHERE = Peak(np.nan, np.nan, np.nan)


def located_peak(omega: Array, amplitude: Array, event: npt.NDArray[np.str_], error: Array | float = np.nan) -> Peak:
    """Largest amplitude of a response, located on its branch (event ``peak``); none at the ends of the range.

    Parameters
    ----------
    error : stated of each amplitude
    """
    ends = int(np.argmax(amplitude)) in (0, len(amplitude) - 1)
    return NOWHERE if ends else highest_peak(omega, amplitude, event, error)


def highest_peak(omega: Array, amplitude: Array, event: npt.NDArray[np.str_], error: Array | float = np.nan) -> Peak:
    """Largest of the located peaks, also where the response is larger at an end of the range."""
    peaks = np.flatnonzero(["peak" in text.split() for text in event])
    if not len(peaks):
        return NOWHERE
    highest = peaks[np.argmax(amplitude[peaks])]
    return Peak(float(omega[highest]), float(amplitude[highest]), float(np.broadcast_to(error, len(omega))[highest]))


def amplitude_peak(omega: Array, amplitude: Array, event: npt.NDArray[np.str_] | None = None) -> Peak:
    """Largest amplitude of a motion that need not be observed (a blade of many); none at the ends of the range.

    The error is that of reading the amplitude off. Where it lies on a located peak of its own (`event`), it is that
    point. Elsewhere 1/a^2, which is almost a parabola of the frequency at a resonance, is drawn through the three
    points around the largest one. Across the top of a response the frequency never turns round, even where the curve
    folds.
    """
    top = int(np.argmax(amplitude))
    if top in (0, len(amplitude) - 1):
        return NOWHERE
    if event is not None and "peak" in str(event[top]).split():
        return Peak(float(omega[top]), float(amplitude[top]))
    offset = omega - omega[top]
    with np.errstate(all="ignore"):
        inverse = amplitude**-2.0
    around = slice(top - 1, top + 2)
    if not _apart(offset[around]) or not np.all(np.isfinite([*offset[around], *inverse[around]])):
        return NOWHERE
    curve = np.polyfit(offset[around], inverse[around], 2)
    place = -0.5 * curve[1] / curve[0]
    if not np.polyval(curve, place) > 0:
        return NOWHERE
    height = float(np.polyval(curve, place) ** -0.5)
    return Peak(float(omega[top] + place), height, 0.5 * height**3 * _left_out(offset, inverse, top, place))


def _apart(values: Array) -> bool:
    return len(np.unique(values)) == len(values)


def _left_out(x: Array, y: Array, top: int, place: float) -> float:
    """What the next term of Newton's interpolation adds to the parabola through three points about `top`.

    By the point beyond them on either side, the larger; nan where there is none.
    """
    sides = [slice(first, first + 4) for first in (top - 2, top - 1) if 0 <= first <= len(x) - 4]
    known = [side for side in sides if _apart(x[side]) and np.all(np.isfinite(y[side]))]
    third = [np.polyfit(x[side], y[side], 3)[0] for side in known]
    return float(max(np.abs(third), default=np.nan) * np.prod(np.abs(place - x[top - 1 : top + 2])))


def quadrature(omega: Array, amplitude: Array, phase: Array) -> Peak:
    """Where the response stands at a right angle to the force; the place nearest to the largest amplitude."""
    from scipy.interpolate import PchipInterpolator

    length = curve_length(omega, amplitude)
    moves = np.concatenate([[True], np.diff(length) > 0])  # a point so far out may equal the last one to rounding
    length, omega, amplitude, phase = length[moves], omega[moves], amplitude[moves], phase[moves]
    if len(length) < 2 or not np.all(np.isfinite([length, omega, amplitude, phase])):
        return NOWHERE
    cosine = PchipInterpolator(length, np.cos(phase))
    roots = np.unique(cosine.roots(discontinuity=False, extrapolate=False))
    if not len(roots):
        return NOWHERE
    place = roots[np.argmin(np.abs(roots - length[np.argmax(amplitude)]))]
    values = PchipInterpolator(length, np.column_stack([omega, amplitude]))(place)
    return Peak(float(values[0]), float(values[1]))


def distance(peak: Peak, mode: ModeCurve, undamped: bool) -> float:
    """(omega of the peak - omega of the mode at the same amplitude) / omega of the mode; the nearest sheet counts.

    Parameters
    ----------
    undamped : compare with omega0 (meant for quadrature) instead of the damped omega (meant for the largest amplitude)
    """
    if not np.isfinite(peak.amplitude):
        return float("nan")
    values = [v.omega0 if undamped else v.omega for v in mode.all_at(peak.amplitude)]
    differences = [(peak.omega - omega) / omega for omega in values]
    return min(differences, key=abs, default=float("nan"))


def peak_table(forced: Mapping[str, Array], modes: Mapping[str, ModeCurve]) -> dict[str, Array]:
    """Columns of `<forced>_peaks.csv`, one row per level, from the columns of the forced analysis.

    `distance_<mode>` is at the largest amplitude against omega, `quadrature_distance_<mode>` at phase quadrature
    against omega0, both relative and at the same amplitude (:func:`distance`).
    """
    levels = np.unique(forced["level"])
    rows = [{key: value[forced["level"] == level] for key, value in forced.items()} for level in levels]
    stated = [row.get("amplitude_error", np.nan) for row in rows]
    peaks = [located_peak(row["omega"], row["amplitude"], row["event"], error) for row, error in zip(rows, stated)]
    turns = [quadrature(row["omega"], row["amplitude"], row["phase"]) for row in rows]
    error = {"amplitude_error": np.array([peak.error for peak in peaks])}
    table = {"level": levels, **_columns("", peaks), **error, **_columns("quadrature_", turns)}
    for name, mode in modes.items():
        table[f"distance_{name}"] = np.array([distance(peak, mode, False) for peak in peaks])
        table[f"quadrature_distance_{name}"] = np.array([distance(turn, mode, True) for turn in turns])
    return table


def points_around_peak(amplitude: Array, omega: Array, count: int) -> list[int]:
    """`count` points of a response between the frequencies of `TOP` times its peak, the peak among them."""
    top = int(np.argmax(amplitude))
    high = np.flatnonzero(amplitude >= TOP * amplitude[top])
    wanted = np.linspace(omega[high].min(), omega[high].max(), min(count, 10 * len(omega)))
    chosen = {int(high[np.argmin(np.abs(omega[high] - value))]) for value in wanted}
    nearest = min(chosen, key=lambda i: abs(float(omega[i] - omega[top])))
    return sorted(chosen - {nearest} | {top})


def _columns(prefix: str, peaks: list[Peak]) -> dict[str, Array]:
    return {
        f"{prefix}frequency_hz": np.array([peak.omega for peak in peaks]) / (2.0 * np.pi),
        f"{prefix}amplitude": np.array([peak.amplitude for peak in peaks]),
    }


def curve_length(omega: Array, amplitude: Array) -> Array:
    """Length along a response up to each point, both axes scaled by their range."""
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):  # of one point, or of a level line
        steps = np.hypot(np.diff(omega) / np.ptp(omega), np.diff(amplitude) / np.ptp(amplitude))
    return np.concatenate([[0.0], np.cumsum(steps)])
