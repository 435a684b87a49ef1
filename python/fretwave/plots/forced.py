"""Response curves for all levels, the modes' backbones over them and time-integrated points (paper's figure 7)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.interpolate import PchipInterpolator

from ..arrays import AnyArray
from ..post.response_peaks import curve_length
from ..results.analysis import Analysis, Table
from ..results.overview import amplitude_column
from ..results.reader import Run
from ..results.stamp import of_one_model
from . import marks, scales, style
from .scales import Scale

BACKBONES = (("--", style.INK), (":", style.RED))


def figures(run: Run) -> Iterator[tuple[str, Figure]]:
    """One picture per forced analysis."""
    for forced in run.of_kind("forced"):
        modes = [run.analyses[name] for name in forced.backbones() if name in run.analyses]
        modes = [mode for mode in modes if of_one_model(forced, mode)]
        tables = (run.table(f"{forced.name}_{suffix}") for suffix in ("time", "peaks"))
        yield f"{forced.name}_response", draw(forced, modes, *tables)


def draw(forced: Analysis, modes: Sequence[Analysis], times: Table | None, peaks: Table | None = None) -> Figure:
    """Amplitude as it is (left) and divided by the level (right)."""
    figure, (left, right) = style.new_figure(5.0, columns=2)
    levels = np.unique(forced.columns["level"])
    shown = scales.linear(forced.unit_system, forced.unit("amplitude"), *_amplitudes(forced))
    for level, colour in zip(levels, style.shades(len(levels))):
        _level(left, forced, times, level, colour, shown)
        _level(right, forced, times, level, colour, Scale(shown.factor / level, shown.unit))
    for mode, (line, colour) in zip(modes, BACKBONES):
        curve = mode.curve()
        look = {"color": colour, "linestyle": line, "label": f"backbone, {mode.method()}", "zorder": 5}
        left.plot(curve["frequency_hz"], shown(curve["amplitude"]), **look)
    if peaks is not None:
        left.plot(peaks["frequency_hz"], shown(peaks["amplitude"]), "+", color=style.INK, label="peak", zorder=6)
    if times is not None:
        left.plot([], [], "o", markerfacecolor="white", markeredgecolor=style.INK, label="time integration")
    _stops(left, forced, levels, shown)
    _finish(figure, left, right, forced, shown)
    return figure


def _level(axes: Axes, forced: Analysis, times: Table | None, level: float, colour: style.Colour, scale: Scale) -> None:
    """Curve, points, error and integrated motions of a level."""
    frequency, amplitude = response(forced, level)
    axes.plot(frequency, scale(amplitude), color=colour, label=_called(level))
    rows = forced.columns["level"] == level
    frequency, amplitude = forced.columns["frequency_hz"][rows], scale(_amplitude(forced)[rows])
    if "amplitude_error" in forced.columns:
        style.error_band(axes, frequency, amplitude, scale(forced.columns["amplitude_error"][rows]), colour)
    marks.points(axes, frequency, amplitude, colour, len(forced) > marks.MANY)
    if times is not None:
        rows = times["level"] == level
        look = {"markerfacecolor": "white", "markeredgecolor": colour, "markersize": 6}
        axes.plot(times["frequency_hz"][rows], scale(times["amplitude"][rows]), "o", zorder=4, **look)


def _called(level: float) -> str:
    """As the legend and the results name it."""
    return f"level {level:g}"


def _stops(axes: Axes, forced: Analysis, levels: AnyArray, scale: Scale) -> None:
    """Levels that stopped short, among them those that were asked for and have no point."""
    ends: dict[str, tuple[float, float] | None] = {}
    for level in levels:
        last = np.flatnonzero(forced.columns["level"] == level)[-1]
        ends[_called(level)] = forced.columns["frequency_hz"][last], scale(_amplitude(forced)[last])
    asked = forced.attributes.get("levels", [])
    names = dict.fromkeys([*(_called(level) for level in asked if isinstance(level, (int, float))), *ends])
    marks.stops(axes, ends, marks.why_stopped(forced, list(names)))


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


def _amplitudes(forced: Analysis) -> tuple[AnyArray, AnyArray]:
    """As they are, and divided by the level."""
    return _amplitude(forced), _amplitude(forced) / forced.columns["level"]


def _amplitude(forced: Analysis) -> AnyArray:
    """Of the observed dof; of a wheel in the sector where it is largest."""
    return forced.columns[amplitude_column(forced.columns)]


def _dof(forced: Analysis) -> str:
    name = forced.observed()
    return f"{name.split('@')[0]}, largest of all sectors" if "largest_amplitude" in forced.columns else name


def _finish(figure: Figure, left: Axes, right: Axes, forced: Analysis, shown: Scale) -> None:
    frequency, amplitude = forced.columns["frequency_hz"], shown(_amplitude(forced))
    for axes in (left, right):
        if np.ptp(frequency) > 0:  # a response of one point has no range
            axes.set_xlim(frequency.min(), frequency.max())
        axes.set_xlabel(style.label("Excitation frequency", "Hz"))
    peaks = [amplitude[forced.columns["level"] == level].max() for level in np.unique(forced.columns["level"])]
    if max(peaks) > style.LINEAR_UP_TO * min(peaks):
        left.set(yscale="log", ylim=(0.7 * amplitude.min(), 1.5 * amplitude.max()))
        right.set(yscale="log")
    else:
        errors = np.nan_to_num(shown(forced.columns.get("amplitude_error", np.zeros(1))))
        left.set_ylim(0.0, 1.05 * min(np.max(amplitude + errors), (1.0 + style.BEYOND) * amplitude.max()))
        right.set_ylim(bottom=0.0)
    left.set_ylabel(shown.label(f"Amplitude of {_dof(forced)}"))
    right.set_ylabel(shown.label("Amplitude / level"))
    marks.point_entry(left, len(forced) > marks.MANY)
    known = forced.columns.get("amplitude_error")
    marks.error_entry(left, {shown.unit: [None if known is None else shown(known)]})
    style.legend_outside(figure, left, columns=4, title="Level: factor on the force")
