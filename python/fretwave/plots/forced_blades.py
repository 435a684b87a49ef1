"""Forced response of a whole wheel: every blade's curve at one level, and its peak against the tuned wheel's."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from ..arrays import AnyArray
from ..post.blade_peaks import whitehead
from ..results.analysis import Analysis, Table
from ..results.reader import Run
from . import marks, scales, style
from .forced import smooth

BOUND = "Whitehead's bound (linear, one family, waves damped alike)"
#: share of the largest amplitude below which a curve lies on its axis
SEEN = 0.03


def figures(run: Run) -> Iterator[tuple[str, Figure]]:
    """One picture per forced analysis of a wheel."""
    for forced in run.of_kind("forced"):
        blades, tuned = (run.table(f"{forced.name}_{suffix}") for suffix in ("blades", "tuned"))
        if blades is not None and tuned is not None:
            yield f"{forced.name}_blades", draw(forced, blades, tuned)


def draw(forced: Analysis, blades: Table, tuned: Table) -> Figure:
    """Curves of all blades at the first level over the peaks at every level."""
    figure, (upper, lower) = style.new_figure(7.4, rows=2)
    _curves(upper, forced, tuned)
    levels, sectors = np.unique(blades["level"]), np.unique(blades["sector"])
    for level, colour in zip(levels, style.shades(len(levels))):
        rows = blades["level"] == level
        lower.plot(sectors, blades["amplification"][rows], "o-", color=colour, linewidth=1.0, label=f"level {level:g}")
    bound = whitehead(len(sectors))
    lower.axhline(1.0, color=style.GREY, linestyle="--", linewidth=1.2, label="tuned wheel")
    lower.axhline(bound, color=style.GREY, linestyle=":", linewidth=1.2, label=BOUND)
    lower.set_ylim(bottom=0.0, top=1.25 * max(bound, float(np.nanmax(blades["amplification"]))))  # room for the legend
    lower.xaxis.set_major_locator(MaxNLocator(integer=True, nbins=13))
    lower.set_xlabel("Sector")
    lower.set_ylabel("Peak of the sector / tuned peak")
    style.legend(lower, loc="upper right", ncols=3)
    return figure


def _shown(frequency: AnyArray, largest: AnyArray) -> tuple[float, float]:
    """Where any blade has a share of its peak that can be told from none."""
    high = frequency[largest > SEEN * largest.max()]
    return float(high.min()), float(high.max())


def _curves(axes: Axes, forced: Analysis, tuned: Table) -> None:
    """Responses of all blades, of the one that moves most, and of the tuned wheel, at the smallest level."""
    level = forced.columns["level"].min()
    points = np.flatnonzero(forced.columns["level"] == level)
    unit = int(forced.attributes["sector_dofs"])
    c, s = (forced.labels.index(label) for label in ("1c", "1s"))
    q = forced.coefficients(list(points))[:, forced.normalised_dof() % unit :: unit]
    amplitude, frequency = np.hypot(q[:, :, c], q[:, :, s]), forced.columns["frequency_hz"][points]
    most = int(np.argmax(amplitude.max(axis=0)))
    scale = scales.linear(forced.unit_system, forced.unit("amplitude"), amplitude)
    for j, blade in enumerate(scale(amplitude).T):
        look = {"color": style.BLUE, "linewidth": 1.8, "zorder": 5} if j == most else {"color": "#bbbbbb"}
        name = f"sector {j}, which moves most" if j == most else "other sectors"
        axes.plot(*smooth(frequency, blade), **{"linewidth": 0.8, **look}, label=name)
    rows = tuned["level"] == level
    marks.points(axes, frequency, scale(amplitude[:, most]), style.BLUE)
    line = smooth(tuned["frequency_hz"][rows], scale(tuned["amplitude"][rows]))
    axes.plot(*line, "--", color=style.INK, label="tuned wheel")
    axes.set_xlim(*_shown(frequency, amplitude.max(axis=1)))
    axes.set_ylim(0.0, None)
    axes.set_xlabel(style.label("Excitation frequency", "Hz"))
    dof = forced.dofs[forced.normalised_dof()].split("@")[0] if forced.dofs else ""
    axes.set_ylabel(scale.label(f"Amplitude of {dof}, level {level:g}"))
    marks.point_entry(axes)
    last = float(frequency[-1]), float(scale(amplitude[-1, most]))
    name = f"level {level:g}"
    stopped = marks.why_stopped(forced, [f"level {one:g}" for one in np.unique(forced.columns["level"])])
    marks.stops(axes, {name: last}, {one: reason for one, reason in stopped.items() if one == name})
    style.legend(axes, loc="upper right")
