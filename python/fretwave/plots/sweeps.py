"""A sweep's branches in one picture, coloured by value (the paper's figure 10), and their landmarks over the value."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product
from typing import Any, Tuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from ..arrays import Array
from ..files.dimensions import names_of_data
from ..post.grid import SHOWN, Plan, short_names
from ..post.limit_cycles import SHORT
from ..results.analysis import Analysis, Table
from ..results.file import open_results
from ..results.reader import Run
from ..results.sweep_quantiles import is_seed
from ..results.sweep_summary import CYCLES, split_of
from ..texts import shortened, toml
from . import labels, marks, scales, style
from .backbone import error_entry, error_of
from .scales import Scale

#: more branches than these are told apart by a colour bar
NAMED = 10
#: damping below zero by more than rounding
TINY = 1e-9
#: asymptotes are common to all branches when they agree to this relative difference
SAME = 1e-6
#: characters that fit side by side below a panel
WIDTH = 40
LINES = ("-", (0, (5, 1.5)), (0, (1, 1)), "-.")


@dataclass
class Swept:
    """A sweep as its pictures see it.

    Attributes
    ----------
    branches : (number of the value, place in `parts`, columns along the branch)
    summary : quantity -> (n_1, n_2, ..., [n_parts])
    split, parts : what tells the branches of one value apart, and its values: levels, nodal diameters
    """

    analysis: Analysis
    plan: Plan
    branches: list[tuple[int, int, Table]]
    summary: Table
    split: str
    parts: list[float]

    @classmethod
    def of(cls, analysis: Analysis) -> Swept:
        with open_results(analysis.path) as file:
            group, split = file[analysis.name]["summary"], split_of(str(analysis.attributes["of_type"]))
            names = [*names_of_data(group), *([split] if split in group else [])]
            summary = {key: np.asarray(group[key][()], dtype=float) for key in names}
        parts = [float(part) for part in summary.pop(split, ())]
        plan, branches, curve = Plan(analysis.attributes["over"]), [], analysis.curve()
        for number, (place, part) in product(range(len(plan)), enumerate(parts or [np.nan])):
            rows = (curve["value"] == number) & (curve[split] == part if parts else True)
            if rows.any():
                branches.append((number, place, {name: curve[name][rows] for name in curve.names}))
        return cls(analysis, plan, branches, summary, split, parts)

    def unit(self, unit: str) -> str:
        """Of a panel; that of an amplitude where it is a length."""
        return self.analysis.unit("amplitude") or self.analysis.unit_system(unit) if unit == "length" else unit

    def amplitudes(self) -> Scale:
        """Of an axis with the amplitudes of all branches."""
        return scales.logarithmic(self.analysis.unit_system, self.unit("length"), self.analysis.columns["amplitude"])

    @property
    def main(self) -> int:
        """The key with most values: shown by colour, or on an axis."""
        return int(np.argmax(self.plan.shape))

    def look(self, number: int, part: int = 0) -> dict[str, Any]:
        """Colour and line of a branch; with two keys a colour for each value of one, a line for each of the other."""
        if not self.crossed():
            return {"color": style.shades(len(self.plan))[number], "linestyle": LINES[part % len(LINES)]}
        place = np.unravel_index(number, self.plan.shape)
        colours = style.shades(self.plan.shape[self.main])
        return {"color": colours[place[self.main]], "linestyle": LINES[place[1 - self.main]]}

    def crossed(self) -> bool:
        """Two keys, few enough of one's values for as many lines."""
        return len(self.plan.keys) == 2 and min(self.plan.shape) <= len(LINES) and not self.parts

    def names(self) -> list[tuple[str, dict[str, Any]]]:
        """Entries of the legend with their looks."""
        if not self.crossed():
            entries = [(label, self.look(number)) for number, label in enumerate(self.plan.labels())]
            names = [f"{self.split.replace('_', ' ')} {part:g}" for part in self.parts]
            lines = [{"color": style.GREY, "linestyle": LINES[part % len(LINES)]} for part in range(len(names))]
            return [*entries, *zip(names, lines)] if len(names) > 1 else entries
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
        kind = analysis.attributes["of_type"]
        if kind not in ("mode", "flutter", "forced"):
            continue
        swept = Swept.of(analysis)
        if kind != "forced":
            yield f"{analysis.name}_backbones", backbones(swept)
        else:
            yield f"{analysis.name}_responses", responses(swept)
        if not is_seed(swept.plan.keys[swept.main]):  # nothing depends on the number of a draw
            yield f"{analysis.name}_summary", overview(swept, _panels(kind, swept.summary))


def backbones(swept: Swept) -> Figure:
    """Frequency above damping, over a common logarithmic amplitude axis."""
    figure, (upper, lower) = style.new_figure(6.6, rows=2, sharex=True)
    scale = swept.amplitudes()
    for number, part, table in swept.branches:
        look = swept.look(number, part)
        for axes, column, factor in ((upper, "frequency_hz", 1.0), (lower, "zeta", 100.0)):
            axes.plot(scale(table["amplitude"]), factor * table[column], **look)
            error = error_of(table, column)
            if error is not None:
                drawn = scale(table["amplitude"]), factor * table[column], factor * error
                style.error_band(axes, *drawn, look["color"])
    if (swept.analysis.columns["zeta"] < -TINY).any():
        lower.axhline(0.0, color=style.INK, linewidth=1.0, zorder=1)
    _points(upper, swept, lambda table: (scale(table["amplitude"]), table["frequency_hz"]))
    _points(lower, swept, lambda table: (scale(table["amplitude"]), 100.0 * table["zeta"]))
    named = _asymptotes(upper, swept)
    style.log_amplitude(lower, scale(swept.analysis.columns["amplitude"]))
    upper.set_ylabel(style.label("Frequency ω/2π", "Hz"))
    lower.set_ylabel(style.label("Damping ratio ζ", "%"))
    dof = swept.analysis.attributes.get("normalise", "")
    lower.set_xlabel(scale.label(f"Modal amplitude of {dof}".rstrip(" of")))
    _name(figure, [upper, lower], swept, lambda axes: error_entry(axes, [table for *_, table in swept.branches]))
    labels.along(upper, named, fontsize=10)
    return figure


def responses(swept: Swept) -> Figure:
    """Amplitude over frequency, a line style for each level."""
    figure, axes = style.new_figure(5.0)
    scale = scales.linear(swept.analysis.unit_system, swept.unit("length"), swept.analysis.columns["amplitude"])
    errors = [scale(t["amplitude_error"]) if "amplitude_error" in t else None for _, _, t in swept.branches]
    for (number, part, table), error in zip(swept.branches, errors):
        look = swept.look(number, part)
        axes.plot(table["frequency_hz"], scale(table["amplitude"]), **look)
        if error is not None:
            style.error_band(axes, table["frequency_hz"], scale(table["amplitude"]), error, look["color"])
    _points(axes, swept, lambda table: (table["frequency_hz"], scale(table["amplitude"])))
    peaks = swept.summary["largest_amplitude"]
    if np.nanmax(peaks) > style.LINEAR_UP_TO * np.nanmin(peaks):
        axes.set_yscale("log")
    axes.set_xlabel(style.label("Excitation frequency", "Hz"))
    dof = swept.analysis.attributes.get("observe", "")
    axes.set_ylabel(scale.label(f"Amplitude of {dof}".rstrip(" of")))
    _name(figure, [axes], swept, lambda axes: marks.error_entry(axes, {scale.unit: errors}))
    return figure


def _points(axes: Axes, swept: Swept, drawn: Callable[[Table], tuple[Array, Array]]) -> None:
    """Computed points of all branches, and those at which one stopped short."""
    ends: dict[str, tuple[float, float] | None] = {}
    many, parts = len(swept.analysis) > marks.MANY, max(len(swept.parts), 1)
    done = np.reshape(swept.summary.get("done", np.ones((len(swept.plan), parts))), (len(swept.plan), parts))
    for number, part, table in swept.branches:
        x, y = drawn({name: values[table["place"] % 1 == 0] for name, values in table.items()})
        marks.points(axes, x, y, swept.look(number, part)["color"], many)
        if not done[number, part]:
            ends[swept.plan.labels()[number]] = float(x[-1]), float(y[-1])
    marks.stops(axes, ends, marks.why_stopped(swept.analysis, swept.plan.labels()))


def _asymptotes(axes: Axes, swept: Swept) -> list[tuple[str, float]]:
    """Lines at linear frequencies, where all branches have the same; their names and heights."""
    ends = {word: swept.summary[f"{word}_hz"] for word in ("stuck", "free")}
    known = {word: values[np.isfinite(values)] for word, values in ends.items()}
    common = {word: float(v.flat[0]) for word, v in known.items() if v.size and np.ptp(v) <= SAME * abs(v.flat[0])}
    for word, frequency in common.items():
        axes.axhline(frequency, color=style.GREY, linestyle="--" if word == "stuck" else "-.", linewidth=1.2, zorder=1)
    low, high = axes.get_ylim()
    axes.set_ylim(low - 0.08 * (high - low), high + 0.08 * (high - low))
    words = {"stuck": "stuck", "free": "without friction"}  # free, or closed and sliding
    return [(f"{words[word]} {frequency:.6g} Hz", frequency) for word, frequency in common.items()]


def _name(figure: Figure, axes: list[Axes], swept: Swept, name_error: Callable[[Axes], None]) -> None:
    """A legend of the values; of many, a colour bar."""
    names = swept.names()
    if len(swept.plan) <= NAMED or swept.crossed():
        for label, look in names:
            axes[0].plot([], [], label=label, **look)
    marks.point_entry(axes[0], len(swept.analysis) > marks.MANY)
    name_error(axes[0])
    _legend(figure, axes[0])
    if len(swept.plan) <= NAMED or swept.crossed():
        return
    norm = BoundaryNorm(np.arange(len(swept.plan) + 1) - 0.5, len(swept.plan))
    colours = ListedColormap(style.shades(len(swept.plan)))
    bar = figure.colorbar(ScalarMappable(norm, colours), ax=axes)
    shown = np.unique(np.linspace(0, len(swept.plan) - 1, NAMED).astype(int))
    values = [", ".join(map(_tick, combination.values())) for combination in swept.plan.values()]
    bar.set_ticks(shown, labels=[values[number] for number in shown])
    bar.set_label(", ".join(short_names(swept.plan.keys).values()).replace("_", " "))


def _tick(value: object) -> str:
    """A value in a few characters."""
    if isinstance(value, str) and value:
        return shortened(value, SHOWN)
    return f"{value:.6g}" if isinstance(value, float) else toml(value, SHOWN)


def _legend(figure: Figure, axes: Axes) -> None:
    """Above the axes, if there is anything to name."""
    names = axes.get_legend_handles_labels()[1]
    if names:
        style.legend_outside(figure, axes, columns=min(5, len(names)))


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


def _panels(kind: str, summary: Table) -> Sequence[Panel]:
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
        plane.set_xlabel(short_names(swept.plan.keys)[key].replace("_", " "))
        _scales(plane, x[order], [] if numeric else [_tick(values[k]) for k in order], from_zero)
    for number, name in enumerate(others if len(others) > 1 else ()):
        colour = style.GREY if panels[-1] is MODE_PANELS[-1] else style.PALETTE[number % len(style.PALETTE)]
        axes[0].plot([], [], color=colour, linestyle=LINES[number % len(LINES)], label=name)
    _legend(figure, axes[0])
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
    return Plan(over).labels() if over else [""]


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
