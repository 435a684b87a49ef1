"""Peaks of a frequency response at every level, and how far they are from backbones."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from ...case.analysis import AnalysisSection
from ...post.mode_curve import ModeCurve
from ...post.response_peaks import highest_peak, peak_table
from ...texts import plus_minus
from .branch import largest_error
from .context import AnalysisContext


def curves_of(context: AnalysisContext[AnalysisSection], backbones: Sequence[str]) -> dict[str, ModeCurve]:
    """Backbones that have results. Collective."""
    names = [name for name in backbones if context.has_results(name)]
    return {name: context.curve(name) for name in names}


def write_peaks(
    context: AnalysisContext[AnalysisSection], table: dict[str, Any], curves: dict[str, ModeCurve], lengths: str
) -> list[str]:
    """Write the peaks of all levels with their distance from the backbones; a line for each level.

    Parameters
    ----------
    lengths : unit of the amplitudes, as a quantity
    """
    unit = context.units(lengths)
    if not table:
        return []
    used = ("level", "omega", "amplitude", "phase", "event", "amplitude_error")
    peaks = peak_table({key: table[key] for key in used}, curves)
    context.write_table("peaks", peaks, lengths)
    lines = [
        f"{context.name}: {len(table['level'])} points, {len(peaks['level'])} levels,"
        f"{largest_error('the amplitude', table, 'amplitude_error', unit)} {table['wall_s'].sum():.2f} s"
    ]
    for row, level in enumerate(peaks["level"]):
        peak = {key: float(value[row]) for key, value in peaks.items()}
        found = math.isfinite(peak["amplitude"])
        said = _peak(peak, list(curves), unit) if found else _no_peak(table, level, unit)
        lines.append(f"{context.name}: level {level:g}: {said}")
    return lines


def _no_peak(table: Mapping[str, Any], level: float, unit: str) -> str:
    """Of a level that moves most at an end of the range, whose own peak is beyond: smaller peaks may lie within."""
    omega, amplitude, event = (table[name][table["level"] == level] for name in ("omega", "amplitude", "event"))
    within = highest_peak(omega, amplitude, event)
    if not math.isfinite(within.amplitude):
        return "no peak within the frequency range"
    top = int(amplitude.argmax())
    most, inner = f"{amplitude[top]:.4g} {unit}", f"{within.amplitude:.4g} {unit}"
    hertz, own = omega[top] / (2 * math.pi), within.omega / (2 * math.pi)
    return (
        f"most at an end of the frequency range, a = {most} at {hertz:.5g} Hz: the peak is beyond"
        f" (largest within it {inner} at {own:.5g} Hz)"
    )


def _peak(peak: dict[str, float], curves: list[str], unit: str) -> str:
    amplitude = f"{peak['amplitude']:.4g}{plus_minus(peak['amplitude_error'])}"
    text = f"peak a = {amplitude} {unit} at {peak['frequency_hz']:.5g} Hz"
    return "".join([text, *(_distance(peak[f"distance_{curve}"], curve) for curve in curves)])


def _distance(share: float, curve: str) -> str:
    """How far a peak's frequency is from a backbone's, which may have no point of its amplitude."""
    if not math.isfinite(share):
        return f", beyond the amplitudes of {curve}"
    return f", frequency {100 * share:+.3f} % from {curve}"
