"""A sweep's branches in one picture, coloured by value (the paper's figure 10)."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure

from ..arrays import Array
from ..results.analysis import Table
from ..results.reader import Run
from ..results.sweep_quantiles import is_seed
from . import labels, marks, scales, style
from .backbone import error_entry, error_of
from .sweep_overview import overview, panels_of
from .swept import Swept, legend, tick

#: more branches than these are told apart by a colour bar
NAMED = 10
#: damping below zero by more than rounding
TINY = 1e-9
#: asymptotes are common to all branches when they agree to this relative difference
SAME = 1e-6


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
            yield f"{analysis.name}_summary", overview(swept, panels_of(kind, swept.summary))


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
    legend(figure, axes[0])
    if len(swept.plan) <= NAMED or swept.crossed():
        return
    norm = BoundaryNorm(np.arange(len(swept.plan) + 1) - 0.5, len(swept.plan))
    colours = ListedColormap(style.shades(len(swept.plan)))
    bar = figure.colorbar(ScalarMappable(norm, colours), ax=axes)
    shown = np.unique(np.linspace(0, len(swept.plan) - 1, NAMED).astype(int))
    values = [", ".join(map(tick, combination.values())) for combination in swept.plan.values()]
    bar.set_ticks(shown, labels=[values[number] for number in shown])
    bar.set_label(", ".join(swept.plan.headings().values()))
