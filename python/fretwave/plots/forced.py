"""Response curves for all levels, the modes' backbones over them and time-integrated points (paper's figure 7)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.interpolate import PchipInterpolator

from ..arrays import AnyArray
from ..post.response_peaks import curve_length
from ..results.reader import Analysis, Run, Table
from . import style

BACKBONES = (("--", style.INK), (":", style.RED))


def figures(run: Run) -> Iterator[tuple[str, Figure]]:
    """One picture per forced analysis."""
    for forced in run.of_kind("forced"):
        modes = [run.analyses[name] for name in forced.backbones() if name in run.analyses]
        tables = (run.table(f"{forced.name}_{suffix}") for suffix in ("time", "peaks"))
        yield f"{forced.name}_response", draw(forced, modes, *tables)


def draw(forced: Analysis, modes: Sequence[Analysis], times: Table | None, peaks: Table | None = None) -> Figure:
    """Amplitude as it is (left) and divided by the level (right)."""
    figure, (left, right) = style.new_figure(5.0, columns=2)
    levels = np.unique(forced.columns["level"])
    for level, colour in zip(levels, style.shades(len(levels))):
        _level(left, forced, times, level, colour, 1.0)
        _level(right, forced, times, level, colour, level)
    for mode, (line, colour) in zip(modes, BACKBONES):
        curve = mode.curve()
        name = f"backbone, {mode.method()}"
        left.plot(curve["frequency_hz"], curve["amplitude"], color=colour, linestyle=line, label=name, zorder=5)
    if peaks is not None:
        left.plot(peaks["frequency_hz"], peaks["amplitude"], "+", color=style.INK, label="peak", zorder=6)
    if times is not None:
        left.plot([], [], "o", markerfacecolor="white", markeredgecolor=style.INK, label="time integration")
    _finish(figure, left, right, forced)
    return figure


def _level(axes: Axes, forced: Analysis, times: Table | None, level: float, colour: object, scale: float) -> None:
    frequency, amplitude = response(forced, level)
    axes.plot(frequency, amplitude / scale, color=colour, label=f"level {level:g}")
    if times is not None:
        rows = times["level"] == level
        frequency, amplitude = times["frequency_hz"][rows], times["amplitude"][rows]
        look = {"markerfacecolor": "white", "markeredgecolor": colour, "markersize": 6}
        axes.plot(frequency, amplitude / scale, "o", zorder=4, **look)


def response(forced: Analysis, level: float) -> tuple[AnyArray, AnyArray]:
    """Frequency [Hz] and amplitude [length] along the branch of a level.

    The observed dof's amplitude lies on the branch's cubic. The largest one of a wheel's blades is no function of the
    scalar unknowns and is drawn through its points.
    """
    if "largest_amplitude" not in forced.columns:
        curve = forced.curve()
        rows = curve["level"] == level
        return curve["frequency_hz"][rows], curve["amplitude"][rows]
    rows = forced.columns["level"] == level
    return smooth(forced.columns["frequency_hz"][rows], forced.columns["largest_amplitude"][rows])


def smooth(frequency: AnyArray, amplitude: AnyArray) -> tuple[AnyArray, AnyArray]:
    """Monotone piecewise cubics through the points of a response, over the length along it (it may fold)."""
    length = curve_length(frequency, amplitude)
    keep = np.concatenate([[True], np.diff(length) > 1e-9 * length[-1]])
    if keep.sum() < 3:
        return frequency, amplitude
    points = np.column_stack([frequency, amplitude])[keep]
    fine = np.unique(np.concatenate([np.linspace(0.0, length[-1], 1500), length[keep]]))
    return tuple(PchipInterpolator(length[keep], points)(fine).T)


def _amplitude(forced: Analysis) -> AnyArray:
    """Of the observed dof; of a wheel in the sector where it is largest."""
    return forced.columns.get("largest_amplitude", forced.columns["amplitude"])


def _dof(forced: Analysis) -> str:
    name = forced.observed()
    return f"{name.split('@')[0]}, largest of all sectors" if "largest_amplitude" in forced.columns else name


def _finish(figure: Figure, left: Axes, right: Axes, forced: Analysis) -> None:
    frequency, amplitude = forced.columns["frequency_hz"], _amplitude(forced)
    unit, dof = forced.unit("amplitude"), _dof(forced)
    for axes in (left, right):
        if np.ptp(frequency) > 0:  # a response of one point has no range
            axes.set_xlim(frequency.min(), frequency.max())
        axes.set_xlabel(style.label("Excitation frequency", "Hz"))
    peaks = [amplitude[forced.columns["level"] == level].max() for level in np.unique(forced.columns["level"])]
    if max(peaks) > style.LINEAR_UP_TO * min(peaks):
        left.set(yscale="log", ylim=(0.7 * amplitude.min(), 1.5 * amplitude.max()))
        right.set(yscale="log")
    else:
        left.set_ylim(0.0, 1.05 * amplitude.max())
        right.set_ylim(bottom=0.0)
    left.set_ylabel(style.label(f"Amplitude of {dof}", unit))
    right.set_ylabel(style.label("Amplitude / level", unit))
    style.legend_outside(figure, left, columns=4)
