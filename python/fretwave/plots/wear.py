"""Wear as a modal parameter: frequency, damping and worn volume over amplitude and wear cycles (the paper's figures 13
and 14): maps and cuts through them for a grid of amplitudes, curves over the cycles for fewer."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import ListedColormap, LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator

from ..arrays import Array
from ..results.analysis import Analysis
from ..results.reader import Run
from . import marks, style
from .faces import STATUS
from .wear_lines import WearLine, amplitude_label, amplitude_text, amplitudes, cycle_label, power, wears

#: fewer amplitudes than this make no map
GRID = 3
#: cycles at which a map is cut, as shares of all
CUTS = (0.0, 1 / 16, 1 / 8, 1 / 4, 1 / 2, 1.0)
#: columns and levels of a map
COLUMNS, LEVELS = 240, 14
#: volumes that differ by more than this go on logarithmic scales, of this range
WIDE, DECADES = 100.0, 1e3
JUMP = "the mode jumps to another sheet"
MODAL = {"frequency_hz": ("Frequency", "Hz", 1.0), "zeta": ("Damping ratio", "%", 100.0)}


def figures(run: Run) -> Iterator[tuple[str, Figure]]:
    """Modal values and worn volumes of each wear analysis."""
    for wear, lines in wears(run):
        many = len(lines) >= GRID
        yield f"{wear.name}_modal", (draw_modal_map if many else draw_modal)(wear, lines)
        yield f"{wear.name}_volume", (draw_volume_map if many else draw_volume)(wear, lines)


def draw_modal_map(wear: Analysis, lines: Sequence[WearLine]) -> Figure:
    """Frequency above damping: maps on the left, cuts at some cycles on the right."""
    figure, axes = style.new_figure(7.4, rows=2, columns=2, sharex="col")
    cycles, label = np.linspace(0.0, _last(lines), COLUMNS), amplitude_label(wear, amplitudes(lines)[1])
    for (left, right), (column, (name, unit, factor)) in zip(axes, MODAL.items()):
        values = np.stack([line.at(factor * line.columns[column], cycles) for line in lines])
        figure.colorbar(_map(left, cycles, lines, values, _levels(values)), ax=left, pad=0.02)
        _cuts(right, lines, column, factor)
        left.set(title=style.label(name, unit), ylabel=label)
        right.set_title(style.label(name, unit))
    axes[1, 0].set_xlabel(cycle_label(wear))
    axes[1, 1].set_xlabel(label)
    axes[0, 1].legend(title="wear cycles", ncols=2, fontsize=9, loc="best")
    _heading(figure, wear, lines)
    return figure


def draw_modal(wear: Analysis, lines: Sequence[WearLine]) -> Figure:
    """Frequency, damping and, for one amplitude, the shares of stick, slip and open over the cycles."""
    shares = len(lines) == 1
    figure, axes = style.new_figure(7.6 if shares else 6.0, rows=2 + shares, sharex=True)
    for plane, (column, (name, unit, factor)) in zip(axes, MODAL.items()):
        for line, colour in zip(lines, style.PALETTE):
            values = factor * line.columns[column]
            plane.plot(line.cycles, values, color=colour, label=amplitude_text(line))
            computed = slice(len(values) - line.held)
            marks.points(plane, line.cycles[computed], values[computed], colour)
            top = int(np.argmax(values))
            if column == "zeta" and 0 < top < len(values) - 1:
                plane.plot(line.cycles[top], values[top], "o", color=colour)
                text = f"largest: {values[top]:.3g} % after {line.cycles[top]:.3g}"
                plane.annotate(text, (line.cycles[top], values[top]), (0, 8), textcoords="offset points", fontsize=10)
                plane.margins(y=0.18)
        ends: dict[str, tuple[float, float] | None] = {line.called: _last_of(line, column, factor) for line in lines}
        marks.stops(plane, ends, marks.why_stopped(wear, list(ends)))
        for cycle in lines[0].jumps if shares else ():
            plane.axvline(cycle, color=style.RED, linewidth=1.0, linestyle=":", label=JUMP)
        plane.set_ylabel(style.label(name, unit))
    if shares:
        _shares(axes[2], lines[0])
    style.legend(axes[0], loc="best")
    axes[-1].set_xlabel(cycle_label(wear))
    axes[-1].set_xlim(0.0, _last(lines))
    _heading(figure, wear, lines)
    return figure


def draw_volume_map(wear: Analysis, lines: Sequence[WearLine]) -> Figure:
    """Worn volume of every face: maps above, curves over the cycles below, on the same scales."""
    faces, (factor, cubic) = _faces(wear), wear.unit_system.of_volumes
    figure, axes = style.new_figure(7.2, rows=2, columns=len(faces), sharex=True, sharey="row", squeeze=False)
    cycles = np.linspace(0.0, _last(lines), COLUMNS)
    values = {face: np.stack([line.at(factor * line.columns[face], cycles) for line in lines]) for face in faces}
    levels, norm = volume_levels(np.stack(list(values.values())))
    amplitude, unit = amplitudes(lines)
    scale = ScalarMappable(Normalize(amplitude[0], amplitude[-1]), ListedColormap(style.shades(256)))
    for (upper, lower), (face, name) in zip(axes.T, faces.items()):
        filled = _map(upper, cycles, lines, values[face], levels, norm)
        upper.set_title(name)
        for line, colour in zip(lines, scale.to_rgba(amplitude)):
            lower.plot(line.cycles, factor * line.columns[face], color=colour)
    look = {"format": FuncFormatter(lambda x, _: f"{x:g}"), "label": style.label("Worn volume", cubic), "pad": 0.02}
    figure.colorbar(filled, ax=axes[0, :], ticks=None if norm is None else levels, **look)
    if norm is not None:
        axes[1, 0].set(yscale="log", ylim=(levels[0], 1.3 * max(volumes.max() for volumes in values.values())))
        axes[1, 0].yaxis.set_major_formatter(look["format"])
    bar = figure.colorbar(scale, ax=axes[1, :], label=style.label("Modal amplitude", unit), pad=0.02)
    bar.ax.hlines(amplitude, 0, 1, transform=bar.ax.get_yaxis_transform(), color="white")
    axes[0, 0].set_ylabel(amplitude_label(wear, unit))
    axes[1, 0].set_ylabel(style.label("Worn volume", cubic))
    figure.supxlabel(cycle_label(wear), fontsize=11)
    _heading(figure, wear, lines)
    return figure


def draw_volume(wear: Analysis, lines: Sequence[WearLine]) -> Figure:
    """Worn volume of every face, and how fast it grows."""
    faces, (factor, cubic) = _faces(wear), wear.unit_system.of_volumes
    figure, (upper, lower) = style.new_figure(6.0, rows=2, sharex=True)
    for line, dash in zip(lines, ("-", "--")):
        for (face, name), colour in zip(faces.items(), style.PALETTE):
            volume = factor * line.columns[face]
            text = name if len(lines) == 1 else f"{name}, {amplitude_text(line)}"
            upper.plot(line.cycles, volume, dash, color=colour, label=text)
            lower.stairs(
                np.diff(volume) / np.diff(line.cycles), line.cycles, baseline=None, linestyle=dash, color=colour
            )
    upper.set_ylabel(style.label("Worn volume", cubic))
    lower.set_ylabel(style.label("Growth", f"{cubic} per wear cycle"))
    lower.set_xlabel(cycle_label(wear))
    lower.set(xlim=(0.0, _last(lines)))
    lower.set_ylim(bottom=0.0)
    style.legend(upper, loc="best")
    _heading(figure, wear, lines)
    return figure


def _map(
    axes: Axes, cycles: Array, lines: Sequence[WearLine], values: Array, levels: Array, norm: LogNorm | None = None
) -> Any:
    """Filled contours over cycles and amplitude; thin lines where the amplitudes lie."""
    amplitude = amplitudes(lines)[0]
    low = np.maximum(values, 0.5 * levels[0]) if norm is not None else values  # no logarithm of zero
    look = {"cmap": "viridis", "norm": norm, "extend": "neither" if norm is None else "min"}
    filled = axes.contourf(cycles, amplitude, low, levels, **look)
    mark = {"color": style.RED, "markersize": 9, "markeredgewidth": 1.6}
    for value, line in zip(amplitude, lines):
        if len(line.jumps):
            axes.plot(line.jumps, np.full(len(line.jumps), value), "|", **mark)
    axes.hlines(amplitude, cycles[0], cycles[-1], color="white", linewidth=0.6, alpha=0.7)
    axes.set_facecolor("#e8e8e8")
    axes.grid(False)
    return filled


def _cuts(axes: Axes, lines: Sequence[WearLine], column: str, factor: float) -> None:
    """A curve over the amplitudes for each of some cycles."""
    cycles = _last(lines) * np.array(CUTS)
    amplitude = amplitudes(lines)[0]
    values = np.stack([line.at(factor * line.columns[column], cycles) for line in lines])
    for cycle, curve, colour in zip(cycles, values.T, style.shades(len(cycles))):
        axes.plot(amplitude, curve, ".-", color=colour, label=f"{cycle:.3g}")


def _shares(axes: Axes, line: WearLine) -> None:
    shares = (100 * line.columns[word] for word in STATUS)
    axes.stackplot(line.cycles, *shares, colors=STATUS.values(), labels=STATUS, alpha=0.85)
    axes.set(ylim=(0, 100), ylabel="Share of time [%]")
    axes.legend(loc="upper right", ncols=3)
    axes.grid(False)


def _levels(values: Array) -> Array:
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    return np.asarray(MaxNLocator(LEVELS).tick_values(low, high if high > low else low + 1.0))


def volume_levels(values: Array) -> tuple[Array, LogNorm | None]:
    """Levels of a map of volumes (..., n_lines, n_cycles); logarithmic where the last of the lines differ widely."""
    last = np.nanmax(values, axis=-1)
    high = float(last.max())
    if high <= WIDE * float(last[last > 0].min(initial=high)):
        return _levels(values), None
    steps = np.outer(10.0 ** np.arange(np.floor(np.log10(high / DECADES)), 20), (1.0, 2.0, 5.0)).ravel()
    levels = steps[: int(np.argmax(steps >= high)) + 1]
    return levels, LogNorm(levels[0], levels[-1])


def _last(lines: Sequence[WearLine]) -> float:
    return max(float(line.cycles[-1]) for line in lines)


def _last_of(line: WearLine, column: str, factor: float) -> tuple[float, float]:
    return float(line.cycles[-1]), factor * float(line.columns[column][-1])


def _faces(wear: Analysis) -> dict[str, str]:
    """Column of the worn volume of each face, and the face's name."""
    columns = [name for name in wear.columns if name.startswith("worn_")]
    return {column: wear.long_name(column).replace("worn volume of ", "") for column in columns}


def _heading(figure: Figure, wear: Analysis, lines: Sequence[WearLine]) -> None:
    coefficient = float(wear.attributes.get("wear_coefficient", np.nan))
    many = len(lines) >= GRID
    note = "\nwhite lines: the amplitudes computed" if many else ""
    note += f"; red marks: {JUMP}" if many and any(len(line.jumps) for line in lines) else ""
    stopped = marks.why_stopped(wear, [line.called for line in lines]) if many else {}
    note += "".join(f"\n{marks.words(name, reason)}" for name, reason in stopped.items())
    figure.suptitle(
        f"Fretting wear ({wear.name}), $k_w$ = {power(coefficient)} {wear.unit_system('1/pressure')}{note}",
        fontsize=11.0,
    )
    figure.align_ylabels()
