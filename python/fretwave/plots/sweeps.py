"""A sweep's branches in one picture, coloured by value (the paper's figure 10), and their landmarks over the value."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import h5py
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure

from ..analyses.mode_curve import ModeCurve
from ..sweep_plan import Plan, short_names
from . import style
from .data import Analysis, Run, Table
from .forced import smooth

#: more branches than these are told apart by a colour bar
NAMED = 10
#: values that differ by more than this factor stand on a logarithmic axis
LINEAR_UP_TO = 8.0
#: asymptotes are common to all branches when they agree to this relative difference
SAME = 1e-6
LINES = ("-", (0, (5, 1.5)), (0, (1, 1)), "-.")


@dataclass
class Swept:
    """A sweep as its pictures see it.

    Attributes
    ----------
    branches : number of the value -> columns of its branch
    summary : quantity -> (n_1, n_2, ..., [n_levels])
    levels : of a forced response
    """

    analysis: Analysis
    plan: Plan
    branches: dict[int, Table]
    summary: Table
    levels: list[float]

    @classmethod
    def of(cls, analysis: Analysis) -> Swept:
        value = analysis.columns["value"]
        branches = {int(k): {n: c[value == k] for n, c in analysis.columns.items()} for k in np.unique(value)}
        with h5py.File(analysis.path, "r") as file:
            summary = {key: np.asarray(data[()], dtype=float) for key, data in file[analysis.name]["summary"].items()}
        levels = [float(level) for level in summary.pop("level", ())]
        return cls(analysis, Plan(analysis.attributes["over"]), branches, summary, levels)

    @property
    def main(self) -> int:
        """The key with most values: shown by colour, or on an axis."""
        return int(np.argmax(self.plan.shape))

    def look(self, number: int) -> dict[str, Any]:
        """Colour and line of a branch; with two keys a colour for each value of one, a line for each of the other."""
        if not self.crossed():
            return {"color": style.shades(len(self.plan))[number], "linestyle": "-"}
        place = np.unravel_index(number, self.plan.shape)
        colours = style.shades(self.plan.shape[self.main])
        return {"color": colours[place[self.main]], "linestyle": LINES[place[1 - self.main]]}

    def crossed(self) -> bool:
        """Two keys, few enough of one's values for as many lines."""
        return len(self.plan.keys) == 2 and min(self.plan.shape) <= len(LINES) and not self.levels

    def names(self) -> list[tuple[str, dict[str, Any]]]:
        """Entries of the legend with their looks."""
        if not self.crossed():
            return [(label, self.look(number)) for number, label in enumerate(self.plan.labels())]
        entries = []
        for key in (self.main, 1 - self.main):
            name = self.plan.keys[key]
            for k, label in enumerate(Plan({name: self.plan.over[name]}).labels()):
                place = [k if other == key else 0 for other in (0, 1)]
                look = self.look(int(np.ravel_multi_index(place, self.plan.shape)))
                changed = {"linestyle": "-"} if key == self.main else {"color": style.GREY}
                entries.append((label, {**look, **changed}))
        return entries


def figures(run: Run) -> Iterator[tuple[str, Figure]]:
    """All branches, and quantities over the value, of every sweep of modes or forced responses."""
    for analysis in run.of_kind("sweep"):
        swept, kind = Swept.of(analysis), analysis.attributes["of_type"]
        if kind == "mode":
            yield f"{analysis.name}_backbones", backbones(swept)
            yield f"{analysis.name}_summary", overview(swept, MODE_PANELS)
        elif kind == "forced":
            yield f"{analysis.name}_responses", responses(swept)
            yield f"{analysis.name}_summary", overview(swept, FORCED_PANELS)


def backbones(swept: Swept) -> Figure:
    """Frequency above damping, over a common logarithmic amplitude axis."""
    figure, (upper, lower) = style.new_figure(6.6, rows=2, sharex=True)
    for number, table in swept.branches.items():
        curve = ModeCurve.from_table(table).sampled()
        upper.plot(curve["amplitude"], curve["frequency_hz"], **swept.look(number))
        lower.plot(curve["amplitude"], 100.0 * curve["zeta"], **swept.look(number))
    _asymptotes(upper, swept)
    style.log_amplitude(lower, swept.analysis.columns["amplitude"])
    upper.set_ylabel(style.label("Frequency ω/2π", "Hz"))
    lower.set_ylabel(style.label("Damping ratio ζ", "%"))
    dof = swept.analysis.attributes.get("normalise", "")
    lower.set_xlabel(style.label(f"Modal amplitude of {dof}".rstrip(" of"), "m"))
    _name(figure, [upper, lower], swept)
    return figure


def responses(swept: Swept) -> Figure:
    """Amplitude over frequency, a line style for each level."""
    figure, axes = style.new_figure(5.0)
    for number, table in swept.branches.items():
        for level, line in zip(swept.levels, LINES):
            rows = table["level"] == level
            curve = smooth(table["frequency_hz"][rows], table["amplitude"][rows])
            axes.plot(*curve, **{**swept.look(number), "linestyle": line})
    for level, line in zip(swept.levels, LINES) if len(swept.levels) > 1 else ():
        axes.plot([], [], color=style.GREY, linestyle=line, label=f"level {level:g}")
    peaks = swept.summary["largest_amplitude"]
    if np.nanmax(peaks) > LINEAR_UP_TO * np.nanmin(peaks):
        axes.set_yscale("log")
    axes.set_xlabel(style.label("Excitation frequency", "Hz"))
    dof = swept.analysis.attributes.get("observe", "")
    axes.set_ylabel(style.label(f"Amplitude of {dof}".rstrip(" of"), "m"))
    _name(figure, [axes], swept)
    return figure


def _asymptotes(axes: Axes, swept: Swept) -> None:
    """Linear frequencies, where all branches have the same."""
    amplitude = swept.analysis.columns["amplitude"]
    ends = {word: swept.summary[f"{word}_hz"] for word in ("stuck", "free")}
    known = {word: values[np.isfinite(values)] for word, values in ends.items()}
    common = {word: float(v.flat[0]) for word, v in known.items() if v.size and np.ptp(v) <= SAME * abs(v.flat[0])}
    for word, frequency in common.items():
        stuck, above = word == "stuck", frequency >= max(common.values())
        axes.axhline(frequency, color=style.GREY, linestyle="--" if stuck else "-.", linewidth=1.2, zorder=1)
        axes.annotate(
            f"{word} {frequency:.6g} Hz",
            # curves meet the stuck line at small amplitudes and the free one at large: each is named at its other end
            (amplitude.max() if stuck else amplitude.min(), frequency),
            (-4 if stuck else 4, 4 if above else -4),
            textcoords="offset points",
            ha="right" if stuck else "left",
            va="bottom" if above else "top",
            color=style.GREY,
            fontsize=10,
        )
    low, high = axes.get_ylim()
    axes.set_ylim(low - 0.08 * (high - low), high + 0.08 * (high - low))


def _name(figure: Figure, axes: list[Axes], swept: Swept) -> None:
    """A legend of the values; of many, a colour bar."""
    names = swept.names()
    if len(names) <= NAMED:
        for label, look in names:
            axes[0].plot([], [], label=label, **look)
        _legend(figure, axes[0])
        return
    norm = BoundaryNorm(np.arange(len(names) + 1) - 0.5, len(names))
    colours = ListedColormap([look["color"] for _, look in names])
    bar = figure.colorbar(ScalarMappable(norm, colours), ax=axes)
    shown = np.unique(np.linspace(0, len(names) - 1, NAMED).astype(int))
    values = [", ".join(f"{value}" for value in combination.values()) for combination in swept.plan.values()]
    bar.set_ticks(shown, labels=[values[number] for number in shown])
    bar.set_label(", ".join(short_names(swept.plan.keys).values()).replace("_", " "))


def _legend(figure: Figure, axes: Axes) -> None:
    """Above the axes, in as many columns as its longest name allows."""
    names = axes.get_legend_handles_labels()[1]
    if names:
        style.legend_outside(figure, axes, columns=max(1, min(5, len(names), 125 // (max(map(len, names)) + 9))))


def _amplitudes(axes: Axes, x: Any, table: Table, number: int) -> None:
    """Where slip begins, where damping sets in and where it is largest."""
    line = LINES[number % len(LINES)]
    name = (lambda text: None) if number else (lambda text: text)
    look = {"linestyle": line, "marker": "o", "markersize": 5}
    axes.plot(x, table["slip_threshold"], color=style.INK, label=name("first slip"), **look)
    axes.plot(x, table["onset_amplitude"], color=style.BLUE, label=name("damping sets in"), **look)
    axes.plot(x, table["amplitude_of_lowest_frequency"], color=style.GREEN, label=name("lowest frequency"), **look)
    axes.plot(x, table["amplitude_of_largest_zeta"], color=style.RED, label=name("largest damping"), **look)


def _one(axes: Axes, x: Any, table: Table, number: int, column: str, coloured: bool = False) -> None:
    """One quantity; beside amplitudes in the colour that the largest damping has there."""
    factor = 100.0 if column == "largest_zeta" else 1.0
    colour = style.PALETTE[number % len(style.PALETTE)] if coloured else style.RED
    axes.plot(x, factor * table[column], linestyle=LINES[number % len(LINES)], color=colour, marker="o", markersize=5)


#: label and unit of an axis, whether it starts at 0, and what draws a line on it
MODE_PANELS = (
    ("Modal amplitude", "m", False, _amplitudes),
    ("Largest damping ratio ζ", "%", True, partial(_one, column="largest_zeta")),
)
FORCED_PANELS = (
    ("Largest amplitude", "m", True, partial(_one, column="largest_amplitude", coloured=True)),
    ("Frequency there", "Hz", False, partial(_one, column="frequency_of_largest_amplitude", coloured=True)),
)


def overview(swept: Swept, panels: Any) -> Figure:
    """Quantities over the key with most values, a line for each combination of the others (and each level)."""
    figure, axes = style.new_figure(4.4, columns=len(panels))
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
        plane.set_ylabel(style.label(text, unit))
        plane.set_xlabel(short_names(swept.plan.keys)[key].replace("_", " "))
        _scales(plane, x[order], [] if numeric else [str(values[k]) for k in order], from_zero)
    for number, name in enumerate(others if len(others) > 1 else ()):
        colour = style.GREY if panels is MODE_PANELS else style.PALETTE[number % len(style.PALETTE)]
        axes[0].plot([], [], color=colour, linestyle=LINES[number % len(LINES)], label=name)
    _legend(figure, axes[0])
    return figure


def _others(swept: Swept) -> list[str]:
    """Names of the lines: the other keys' values, and the levels."""
    over = {key: values for key, values in swept.plan.over.items() if key != swept.plan.keys[swept.main]}
    if swept.levels:
        over["level"] = swept.levels
    return Plan(over).labels() if over else [""]


def _scales(axes: Axes, x: Any, texts: list[str], from_zero: bool) -> None:
    if texts:
        axes.set_xticks(x, texts)
    elif x.min() > 0 and x.max() > LINEAR_UP_TO * x.min():
        axes.set_xscale("log")
        style.plain_numbers(axes.xaxis, x)
    shown = np.concatenate([line.get_ydata() for line in axes.get_lines()])
    shown = shown[np.isfinite(shown)]
    if from_zero:
        low, high = min(0.0, *shown), max(0.0, *shown)
        margin = 0.08 * (high - low)
        axes.set_ylim(low - margin * (low < 0), high + margin)
    elif len(shown) and shown.min() > 0 and shown.max() > LINEAR_UP_TO * shown.min():
        axes.set_yscale("log")
        style.plain_numbers(axes.yaxis, shown)
