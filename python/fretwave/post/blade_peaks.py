"""Largest responses of the blades of a wheel, against those of the tuned wheel."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..arrays import Array
from .largest import ALIKE, largest
from .response_peaks import NOWHERE, Peak, amplitude_peak


def blade_tables(
    table: Mapping[str, Array], blades: Array, tuned: Mapping[str, Array]
) -> tuple[dict[str, Array], dict[str, Array]]:
    """``<name>_peaks.csv``, a row for each level, and ``<name>_blades.csv``, one for each level and sector.

    Where no blade has a peak within the frequency range the sector is -1. The error of an amplitude is that of reading
    it off between points, and the share of the observed sector's at its largest response, as if all moved as one mode.

    Parameters
    ----------
    table : columns level, omega and amplitude, amplitude_error if it has one, (points,)
    blades : (points, N)
    """
    levels = np.unique(table["level"])
    before = [_peak(tuned, level, 2 * np.pi * tuned["frequency_hz"], tuned["amplitude"]) for level in levels]
    each = [[_peak(table, level, table["omega"], blade) for blade in blades.T] for level in levels]
    amplitude = np.array([[peak.amplitude for peak in row] for row in each])
    share = np.array([_share_of_error(table, level) for level in levels])
    error = np.array([[peak.error for peak in row] for row in each]) + share[:, None] * amplitude
    frequency = np.array([[peak.omega for peak in row] for row in each]) / (2 * np.pi)
    tuned_amplitude = np.array([peak.amplitude for peak in before])
    most = np.array([largest(np.nan_to_num(row)) for row in amplitude])
    rows = np.arange(len(levels))
    peaks = {
        "level": levels,
        "frequency_hz": frequency[rows, most],
        "amplitude": amplitude[rows, most],
        "amplitude_error": error[rows, most],
        "sector": np.where(np.isnan(amplitude).all(axis=1), -1, most),
        "tuned_frequency_hz": np.array([peak.omega for peak in before]) / (2 * np.pi),
        "tuned_amplitude": tuned_amplitude,
        "amplification": amplitude[rows, most] / tuned_amplitude,
    }
    sectors = blades.shape[1]
    return peaks, {
        "level": np.repeat(levels, sectors),
        "sector": np.tile(np.arange(sectors), len(levels)),
        "frequency_hz": frequency.ravel(),
        "amplitude": amplitude.ravel(),
        "amplitude_error": error.ravel(),
        "amplification": (amplitude / tuned_amplitude[:, None]).ravel(),
    }


def beyond(table: Mapping[str, Array], blades: Array, each: Mapping[str, Array]) -> dict[float, tuple[int, float]]:
    """Levels at which a blade without a peak moves more at an end of the range than all peaks: it and how far.

    Parameters
    ----------
    each : the second table of `blade_tables`
    """
    found = {}
    for level in np.unique(table["level"]):
        peaks, moved = each["amplitude"][each["level"] == level], blades[table["level"] == level].max(axis=0)
        at_ends = np.where(np.isnan(peaks), moved, -np.inf)
        if at_ends.max() > np.nanmax(peaks, initial=0.0):
            found[float(level)] = (largest(at_ends), float(at_ends.max()))
    return found


def _peak(table: Mapping[str, Array], level: float, omega: Array, amplitude: Array) -> Peak:
    rows = table["level"] == level
    if not rows.any():
        return NOWHERE
    own = "event" in table and _alike(amplitude[rows], table["amplitude"][rows])
    return amplitude_peak(omega[rows], amplitude[rows], table["event"][rows] if own else None)


def _share_of_error(table: Mapping[str, Array], level: float) -> float:
    """The stated error of the observed amplitude where that is largest, over it; 0 where none is stated."""
    rows = table["level"] == level
    if "amplitude_error" not in table:
        return 0.0
    top = int(np.argmax(table["amplitude"][rows]))
    amplitude = float(table["amplitude"][rows][top])
    return float(table["amplitude_error"][rows][top]) / amplitude if amplitude else np.nan


def _alike(amplitude: Array, observed: Array) -> bool:
    """A blade's curve is that of the observed dof, to a factor: its peak is where that one's was located."""
    return bool(np.allclose(amplitude * observed.max(), observed * amplitude.max(), rtol=ALIKE, atol=0.0))


def whitehead(sectors: int) -> float:
    """Largest amplification of a linear wheel with one degree of freedom per blade."""
    return float(1 + np.sqrt(sectors)) / 2
