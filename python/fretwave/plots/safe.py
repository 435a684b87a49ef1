"""SAFE diagram: frequency over nodal diameters, and what the engine orders of the operating speed excite.

References
----------
Singh, M. P., Vargo, J. J., Schiffer, D. M., Dello, J. D., SAFE diagram - a design and reliability tool for turbine
blading, 17th Turbomachinery Symposium, 1988.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..post.engine_orders import excited_by
from ..results.analysis import Analysis
from ..results.reader import Run
from . import style
from .linear_bands import PEAK, PEAK_NAME, Band, bands, highest, other_entry, peaks

#: Height of the picture over the highest mode, and room beside the first and last wave over half the sectors.
ABOVE, BESIDE = 1.06, 0.11


def figures(run: Run) -> Iterator[tuple[str, Figure]]:
    """One picture per linear analysis of a sector."""
    for linear in run.of_kind("linear"):
        if linear.attributes.get("sectors"):
            yield f"{linear.name}_safe", draw(run, linear)


def draw(run: Run, linear: Analysis) -> Figure:
    """Each mode's band from stuck to sliding over the nodal diameters, and the line of the engine orders."""
    figure, axes = style.new_figure(5.8)
    drawn, sectors = bands(linear), int(linear.attributes["sectors"])
    speed = float(linear.attributes.get("speed_rpm", 0.0))
    for _, family in groupby(drawn, lambda band: band.number):
        _family(axes, list(family), speed)
    other_entry(axes, drawn)
    top = ABOVE * highest(drawn)
    if speed:
        _engine_orders(axes, sectors, speed, top)
    for peak in (peak for peak in peaks(run, linear, drawn) if peak.speed in (None, speed)):
        axes.plot([peak.diameter], [peak.hz], **PEAK, label=PEAK_NAME)
    axes.set_xlim(-BESIDE * sectors / 2, (1 + BESIDE) * sectors / 2)
    axes.spines["left"].set_visible(False)  # engine orders are named there
    axes.set_ylim(0.0, top)
    axes.locator_params("x", integer=True)
    axes.set_xlabel("Nodal diameters")
    axes.set_ylabel(style.label("Frequency", "Hz"))
    style.legend_outside(figure, axes, columns=3)
    return figure


def _family(axes: Axes, family: Sequence[Band], speed: float) -> None:
    """A mode over the waves, at a speed; its band is broken where the mode most like it is another one."""
    band, diameters = family[0], np.array([one.diameter for one in family])
    hz, other = np.transpose([one.at(speed) for one in family])
    axes.plot(diameters, hz, "o-", color=band.colour, markersize=4, label=f"mode {band.number}, {band.contact}")
    like = np.array([one.like[np.argmin(np.abs(one.speeds - speed))] for one in family])
    for piece in np.split(np.arange(len(family)), np.flatnonzero(np.diff(like) != 0) + 1):
        of_piece = diameters[piece], hz[piece], other[piece]
        axes.fill_between(*of_piece, color=band.colour, alpha=0.2, linewidth=0, zorder=0.5)
        axes.plot(diameters[piece], other[piece], ".--", color=band.colour, linewidth=1.0, markersize=3)


def _engine_orders(axes: Axes, sectors: int, speed_rpm: float, top: float) -> None:
    """h times the speed over the nodal diameters that order h excites: a line that is folded at 0 and N / 2."""
    per_order = speed_rpm / 60.0
    folds = sectors / 2 * np.arange(np.ceil(2 * top / (per_order * sectors)) + 1)
    line = {"color": style.GREY, "linewidth": 0.9, "zorder": 1}
    axes.plot(folds % sectors, folds * per_order, **line)
    orders = np.arange(1, int(folds[-1]) + 1)
    dots = {**line, "marker": "o", "markersize": 2.5}
    axes.plot([excited_by(h, sectors) for h in orders], orders * per_order, **{**dots, "linestyle": ""})
    axes.plot([], [], **dots, label=f"engine orders at {speed_rpm:g} rev/min")
    for fold in folds[1:]:
        if fold * per_order < top and not fold % 1:
            at_half = bool(fold % sectors)
            side = {"ha": "left" if at_half else "right", "va": "center", "fontsize": 8.5, "color": style.GREY}
            where, place = (fold % sectors, fold * per_order), (5 if at_half else -5, 0)
            axes.annotate(f"EO {fold:.0f}", where, place, textcoords="offset points", **side)
