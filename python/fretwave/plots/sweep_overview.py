"""Landmarks of a sweep's branches over its values, in panels side by side."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Tuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from ..arrays import Array
from ..post.grid import Plan
from ..post.limit_cycles import SHORT
from ..results.analysis import Table
from ..results.sweep_summary import CYCLES
from . import scales, style
from .scales import Scale
from .swept import LINES, Swept, legend, tick

#: characters that fit side by side below a panel
WIDTH = 40
#: of a branch, in this order: colour and name of their line
AMPLITUDES = {
    "slip_threshold": (style.INK, "first slip"),
    "onset_amplitude": (style.BLUE, "damping sets in"),
    "amplitude_of_lowest_frequency": (style.GREEN, "lowest frequency"),
    "amplitude_of_largest_zeta": (style.RED, "largest damping"),
}


def _amplitudes(axes: Axes, x: Array, table: Table, number: int) -> None:
    """Where slip begins, where damping sets in and where it is largest."""
    line = LINES[number % len(LINES)]
    name = (lambda text: None) if number else (lambda text: text)
    look = {"linestyle": line, "marker": "o", "markersize": 5}
    for column, (colour, text) in AMPLITUDES.items():
        if np.isfinite(table[column]).any():
            axes.plot(x, table[column], color=colour, label=name(text), **look)
    for (word, stable), face in zip(CYCLES.items(), (style.PURPLE, "white", style.GREY)):
        cycle = table.get(f"{word}_limit_cycle", np.full(len(x), np.nan))  # not all are in older results
        if np.isfinite(cycle).any():
            more = {"color": style.PURPLE, "markerfacecolor": face, "label": name(f"limit cycle, {SHORT[stable]}")}
            axes.plot(x, cycle, **more, **look)


def _has_amplitudes(summary: Table) -> bool:
    """Any branch has any: none of branches that neither slip nor end in slip, nor cross zero damping."""
    columns = [*AMPLITUDES, *(f"{word}_limit_cycle" for word in CYCLES)]
    return any(np.isfinite(summary[column]).any() for column in columns if column in summary)


def _one(axes: Axes, x: Array, table: Table, number: int, column: str, coloured: bool = False) -> None:
    """One quantity; beside amplitudes in the colour that the largest damping has there."""
    factor = 100.0 if column == "largest_zeta" else 1.0
    colour = style.PALETTE[number % len(style.PALETTE)] if coloured else style.RED
    axes.plot(x, factor * table[column], linestyle=LINES[number % len(LINES)], color=colour, marker="o", markersize=5)


#: label and unit of an axis, whether it starts at 0, and what draws a line on it
Panel = Tuple[str, str, bool, Callable[[Axes, Array, Table, int], None]]
MODE_PANELS = (
    ("Modal amplitude", "length", False, _amplitudes),
    ("Largest damping ratio ζ", "%", True, partial(_one, column="largest_zeta")),
)
FORCED_PANELS = (
    ("Largest amplitude", "length", True, partial(_one, column="largest_amplitude", coloured=True)),
    ("Frequency there", "Hz", False, partial(_one, column="frequency_of_largest_amplitude", coloured=True)),
)
#: Of a wheel, whatever the sector.
BLADE_PANELS = (
    (
        "Largest of all sectors",
        "length",
        True,
        partial(_one, column="largest_blade_amplitude", coloured=True),
    ),
    ("Frequency there", "Hz", False, partial(_one, column="largest_blade_frequency_hz", coloured=True)),
)


def panels_of(kind: str, summary: Table) -> Sequence[Panel]:
    """What is drawn over the values of a sweep."""
    if kind == "forced":
        return BLADE_PANELS if "largest_blade" in summary else FORCED_PANELS
    return MODE_PANELS[0 if _has_amplitudes(summary) else 1 :]


def overview(swept: Swept, panels: Sequence[Panel]) -> Figure:
    """Quantities over the key with most values, a line for each combination of the others (and each level)."""
    figure, planes = style.new_figure(4.4, columns=len(panels), squeeze=False)
    axes = planes[0]
    key = swept.plan.keys[swept.main]
    values, others = swept.plan.over[key], _others(swept)
    numeric = all(type(value) in (int, float) for value in values)
    x = np.array(values, dtype=float) if numeric else np.arange(len(values), dtype=float)
    order = np.argsort(x)
    lines = {
        name: np.moveaxis(data, swept.main, 0).reshape(len(values), -1)[order] for name, data in swept.summary.items()
    }
    for plane, (text, unit, from_zero, draw) in zip(axes, panels):
        for number in range(len(others)):
            draw(plane, x[order], {name: data[:, number] for name, data in lines.items()}, number)
        scale = _rescaled(plane, swept, unit) if unit == "length" else Scale(1.0, unit)
        plane.set_ylabel(scale.label(text))
        plane.set_xlabel(swept.plan.headings()[key])
        _scales(plane, x[order], [] if numeric else [tick(values[k]) for k in order], from_zero)
    for number, name in enumerate(others if len(others) > 1 else ()):
        colour = style.GREY if panels[-1] is MODE_PANELS[-1] else style.PALETTE[number % len(style.PALETTE)]
        axes[0].plot([], [], color=colour, linestyle=LINES[number % len(LINES)], label=name)
    legend(figure, axes[0])
    return figure


def _rescaled(axes: Axes, swept: Swept, unit: str) -> Scale:
    """The unit of an axis by what is drawn there, and its lines in it."""
    drawn = [np.asarray(line.get_ydata(), dtype=float) for line in axes.get_lines()]
    scale = scales.logarithmic(swept.analysis.unit_system, swept.unit(unit), *drawn)
    for line, values in zip(axes.get_lines(), drawn):
        line.set_ydata(scale(values))
    axes.relim()
    return scale


def _others(swept: Swept) -> list[str]:
    """Names of the lines: the other keys' values, and the levels."""
    over = {key: values for key, values in swept.plan.over.items() if key != swept.plan.keys[swept.main]}
    if swept.parts:
        over[swept.split] = swept.parts
    return Plan(over, swept.plan.units).labels() if over else [""]


def _scales(axes: Axes, x: Array, texts: list[str], from_zero: bool) -> None:
    if texts:
        long = sum(map(len, texts)) > WIDTH
        axes.set_xticks(x, texts, rotation=20.0 if long else 0.0, ha="right" if long else "center")
    elif x.min() > 0 and x.max() > style.LINEAR_UP_TO * x.min():
        axes.set_xscale("log")
        style.plain_numbers(axes.xaxis, x)
    elif (x == np.rint(x)).all() and np.ptp(x) > 1.0:
        axes.xaxis.set_major_locator(MaxNLocator("auto", integer=True))
    shown = np.concatenate([line.get_ydata() for line in axes.get_lines()])
    shown = shown[np.isfinite(shown)]
    if from_zero:
        low, high = min(0.0, *shown), max(0.0, *shown)
        margin = 0.08 * (high - low)
        axes.set_ylim(low - margin * (low < 0), high + margin)
    elif len(shown) and shown.min() > 0 and shown.max() > style.LINEAR_UP_TO * shown.min():
        axes.set_yscale("log")
        style.plain_numbers(axes.yaxis, shown)
