"""Distributions over the draws of a sweep: the share of the draws up to each value, with its confidence interval."""

from __future__ import annotations

from collections.abc import Iterator
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from ..arrays import Array
from ..columns import PURE, Column
from ..post.grid import Plan
from ..post.quantiles import CONFIDENCE, distribution, quantiles
from ..results.reader import Run
from ..results.sweep_quantiles import AMPLITUDE_AT, crossed, groups_of, over_seeds, range_text
from ..results.sweep_summary import COUNTS, columns_in, spread_of, summary_of
from . import style
from .swept import Swept, plan_in

#: Panels of a picture.
MOST = 6
#: Draws that a picture takes.
LEAST = 5
#: Values that differ by less, relatively, are alike.
SAME = 1e-9


def figures(run: Run) -> Iterator[tuple[str, Figure]]:
    """One picture per sweep over seeds."""
    for analysis in run.of_kind("sweep"):
        plan, kind = plan_in(analysis), str(analysis.attributes["of_type"])
        if over_seeds(plan) and len(plan) >= LEAST and summary_of(kind) is not COUNTS:
            swept = Swept.of(analysis)
            shown = columns_of(swept)
            if shown:
                yield f"{analysis.name}_quantiles", draw(swept, shown)


def columns_of(swept: Swept) -> list[Column]:
    """Quantities that are shown: those that are known and vary."""
    kind = str(swept.analysis.attributes["of_type"])
    return [c for c in spread_of(kind, columns_in(kind, [swept.summary])) if _varies(c, swept.summary[c.name])][:MOST]


def _varies(column: Column, values: Array) -> bool:
    """By more than rounding; of a damping ratio rounding is no share of it."""
    known = values[np.isfinite(values)]
    scale = 1.0 if column.unit in PURE else np.abs(known).max(initial=0.0)
    return bool(len(known) and np.ptp(known) > SAME * scale)


def draw(swept: Swept, shown: list[Column]) -> Figure:
    """A panel for each quantity, a line for each level and combination of the keys that are no seeds."""
    rows, alone = -(-len(shown) // 2), not crossed(swept.plan)
    figure, axes = style.new_figure(0.9 + 3.0 * rows, rows=rows, columns=min(2, len(shown)), squeeze=False)
    for plane, column in zip(axes.ravel(), shown):
        lines = samples(swept, column.name)
        colours = style.PALETTE if len(lines) <= len(style.PALETTE) else style.shades(len(lines))
        for (name, values), colour in zip(lines, colours):
            _one(plane, values * (100.0 if _in_percent(column) else 1.0), colour, name, alone)
        plane.xaxis.set_major_locator(MaxNLocator(5))
        plane.set_xlabel(_label(swept, column), fontsize=9.5)
        plane.set_ylabel("Share of the draws")
        plane.set_ylim(0.0, 1.0)
    for plane in axes.ravel()[len(shown) :]:
        plane.set_visible(False)
    band = f"{100 * CONFIDENCE:g} % interval, value by value"
    if alone:
        axes[0, 0].fill_between([], [], color=style.BLUE, alpha=0.2, linewidth=0, label=band)
    style.legend_outside(figure, axes[0, 0], columns=2)
    return figure


def _label(swept: Swept, column: Column) -> str:
    """Long names take several lines."""
    text, number = column.long_name, column.name.partition("_at_")[2]
    if number:
        at = range_text(swept.summary[AMPLITUDE_AT + number].ravel())
        text = text.replace("this amplitude", f"{at} {swept.unit('length')}")
    unit = "%" if _in_percent(column) else swept.unit(column.unit)
    return fill(style.label(text[:1].upper() + text[1:], unit), 48)


def _in_percent(column: Column) -> bool:
    """Damping ratios are shown as in the other pictures."""
    return "zeta" in column.name and column.unit in PURE


def samples(swept: Swept, name: str) -> list[tuple[str, Array]]:
    """Name and values of each line: of the draws whose branch came to its end."""
    data = swept.summary[name].reshape(len(swept.plan), -1)
    done = swept.summary.get("done", np.ones(data.shape)).reshape(data.shape)
    found = []
    for others, numbers in groups_of(swept.plan):
        for k in range(data.shape[1]):
            values = data[numbers, k][(done[numbers, k] == 1) & np.isfinite(data[numbers, k])]
            found.append((_named(swept, others, k, len(values)), values))
    return found


def _named(swept: Swept, others: dict[str, Any], part: int, count: int) -> str:
    words = Plan({key: [value] for key, value in others.items()}, swept.plan.units).labels() if others else []
    words += [f"{swept.split.replace('_', ' ')} {swept.parts[part]:g}"] if len(swept.parts) > 1 else []
    return ", ".join([*words, f"{count} draws"])


def _one(axes: Axes, values: Array, colour: str | tuple[float, ...], name: str, alone: bool) -> None:
    """Steps at the values; of draws that are independent the band of the share, and quantiles with their intervals."""
    if not len(values):
        return
    ordered, share, low, high = distribution(values)
    axes.step(ordered, share, where="post", color=colour, linewidth=1.4, label=name)
    if not alone:
        return
    axes.fill_between(ordered, low, high, step="post", color=colour, alpha=0.2, linewidth=0)
    known = [one for one in quantiles(values) if np.isfinite(one.low + one.high)]
    for one in known:
        axes.plot([one.low, one.high], 2 * [one.probability], color=style.INK, linewidth=1.2, zorder=5)
    places = [one.value for one in known], [one.probability for one in known]
    words = "quantile with its interval" if known else None
    axes.plot(*places, "o", color=style.INK, markersize=4, zorder=6, label=words)
