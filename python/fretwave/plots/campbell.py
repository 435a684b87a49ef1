"""Campbell diagram: frequencies over the rotor's speed, engine orders, and where they meet."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..post.engine_orders import crossing_speeds, exciting
from ..results.analysis import Analysis
from ..results.reader import Run
from . import labels, style
from .linear_bands import PEAK, PEAK_NAME, Band, Peak, bands, highest, other_entry, peaks

#: Waves in a picture: those whose crossings are nearest to the operating speed.
WAVES = 6
#: Highest speed over the operating speed, unless told.
UP_TO = 1.25
#: Crossings nearer to the operating speed than this share of it have their margin written.
NEAR = 0.2
#: Height of a panel over its highest mode, and at most over what its engine orders reach; points of a curve.
ABOVE, OVER_ORDERS, POINTS = 1.06, 1.6, 101
#: Least distance of the names of engine orders, as a share of a panel's height.
APART = 0.09


def figures(run: Run) -> Iterator[tuple[str, Figure]]:
    """One picture per linear analysis with an operating speed, not of all modes of a whole wheel."""
    for linear in run.of_kind("linear"):
        if linear.attributes.get("engine_orders") and not linear.attributes.get("wheel"):
            yield f"{linear.name}_campbell", draw(run, linear)


def draw(run: Run, linear: Analysis) -> Figure:
    """A panel for each of the waves that the engine orders excite nearest to the operating speed."""
    drawn = bands(linear)
    found = list(peaks(run, linear, drawn))
    waves = _nearest(linear, drawn)
    columns = min(len(waves), 2)
    rows = -(-len(waves) // columns)
    figure, axes = style.new_figure(5.0 if rows == 1 else 2.9 * rows, rows, columns, squeeze=False, sharex=True)
    panels = {diameter: _Panel(linear, diameter, drawn, found) for diameter in waves}
    for number in sorted({band.number for panel in panels.values() for band in panel.shown}):
        band = next(band for band in drawn if band.number == number)
        axes.flat[0].plot([], [], color=band.colour, linewidth=1.4, label=f"mode {number}, {band.contact}")
    raised = any(panel.above for panel in panels.values())
    for place, panel in zip(axes.flat, panels.values()):
        panel.draw(place)
        place.set_title(panel.title, pad=14.0 if raised else None)
    if found:
        axes.flat[0].plot([], [], **PEAK, label=PEAK_NAME)
    _labels(list(axes.flat), columns, len(waves))
    left = len({band.diameter for band in drawn}) - len(waves)
    title = f"The {len(waves)} of {len(waves) + left} waves with crossings nearest to the operating speed"
    style.legend_outside(figure, axes.flat[0], columns=3, title=title if left else None)
    for place, panel in zip(axes.flat, panels.values()):
        panel.name(place)
    return figure


def _labels(panels: Sequence[Axes], columns: int, count: int) -> None:
    """Of the axes at the left and below; panels beyond the count are none."""
    for number, panel in enumerate(panels):
        panel.set_visible(number < count)
        if number + columns >= count:
            panel.set_xlabel(style.label("Speed", "rev/min"))
            panel.tick_params(labelbottom=True)
        if number % columns == 0:
            panel.set_ylabel(style.label("Frequency", "Hz"))


def _speed(linear: Analysis) -> float:
    return float(linear.attributes["speed_rpm"])


def _orders(linear: Analysis, diameter: int) -> list[int]:
    """Engine orders that excite a wave; of a structure all of them."""
    return exciting(linear.attributes["engine_orders"], diameter, int(linear.attributes["sectors"]))


def _nearest(linear: Analysis, drawn: Sequence[Band]) -> list[int]:
    """Waves with a panel, ascending."""
    distance: dict[int, float] = {}
    for band in drawn:
        orders = _orders(linear, band.diameter)
        met = [speed for order in orders for speed in crossing_speeds(band.speeds, band.hz, order)]
        away = min((abs(speed / _speed(linear) - 1.0) for speed in met), default=np.inf)
        if orders:
            distance[band.diameter] = min(away, distance.get(band.diameter, np.inf))
    return sorted(sorted(distance, key=lambda diameter: distance[diameter])[:WAVES])


class _Panel:
    """One wave: its bands up to a height that the engine orders reach and the marks of nonlinear modes need."""

    def __init__(self, linear: Analysis, diameter: int, drawn: Sequence[Band], found: Sequence[Peak]) -> None:
        self.diameter, self.speed, self.orders = diameter, _speed(linear), _orders(linear, diameter)
        self.title = f"{diameter} nodal diameter{'s' * (diameter != 1)}" if linear.attributes["sectors"] else ""
        self.last = float(linear.attributes.get("up_to_rpm", UP_TO * self.speed))
        self.peaks = [peak for peak in found if peak.diameter == diameter]
        own = [band for band in drawn if band.diameter == diameter]
        reached = OVER_ORDERS * max(self.orders) * self.last / 60.0
        self.top = max(min(ABOVE * highest(own), reached), *(ABOVE * peak.hz for peak in self.peaks), 0.0)
        self.shown = [band for band in own if np.nanmin([band.hz, band.other_hz]) < self.top]

    def draw(self, axes: Axes) -> None:
        """Bands, engine orders, where they meet, and the operating speed."""
        for band in self.shown:
            _band(axes, band, self.last)
        other_entry(axes, self.shown)
        for band in self.shown:
            for order in self.orders:
                _crossings(axes, band, order)
        _engine_orders(axes, self.orders, self.last, self.top)
        name = f"operating speed, {self.speed:g} rev/min"
        axes.axvline(self.speed, color=style.INK, linewidth=1.0, linestyle=":", label=name)
        for peak in self.peaks:
            axes.plot([self.speed if peak.speed is None else peak.speed], [peak.hz], **PEAK, clip_on=False)
        axes.set_xlim(0.0, self.last)
        axes.set_ylim(0.0, self.top)

    @property
    def above(self) -> bool:
        """Whether an engine order is named above the panel."""
        return max(self.orders) * self.last / 60.0 > self.top

    def name(self, axes: Axes) -> None:
        """By how much crossings near the operating speed lie above it, once all is drawn and laid out."""
        met = [(met, order) for band in self.shown for order in self.orders for met in _met(band, order)]
        near = [(s, order * s / 60.0) for s, order in met if abs(s / self.speed - 1.0) < NEAR and s < self.last]
        box = {"facecolor": "white", "alpha": 0.75, "edgecolor": "none", "pad": 0.8}
        look = {"fontsize": 9, "bbox": box}
        labels.beside(axes, [_margin(s / self.speed - 1.0) for s, _ in near], near, [look for _ in near])


def _met(band: Band, order: int) -> list[float]:
    """Speeds at which an engine order excites a band in its own limit of the contact."""
    return list(crossing_speeds(band.speeds, band.hz, order))


def _band(axes: Axes, band: Band, last: float) -> None:
    speeds = np.linspace(0.0, last, POINTS)
    hz, other = band.at(speeds)
    axes.plot(speeds, hz, color=band.colour, linewidth=1.4)
    if np.isfinite(other).any():
        axes.fill_between(speeds, hz, other, color=band.colour, alpha=0.2, linewidth=0, zorder=0.5)
        axes.plot(speeds, other, "--", color=band.colour, linewidth=1.0)


def _engine_orders(axes: Axes, orders: Sequence[int], last: float, top: float) -> None:
    """Their lines from standstill, named where they leave the panel: at the right apart from each other, or above."""
    text = {"textcoords": "offset points", "fontsize": 8.5, "color": style.GREY, "annotation_clip": False}
    lowest = -np.inf
    for order in sorted(orders):
        end = min(last, 60.0 * top / order)
        axes.plot([0.0, end], [0.0, order * end / 60.0], color=style.GREY, linewidth=0.9, zorder=1)
        if end < last:
            axes.annotate(f"EO {order}", (end, top), (0, 2), ha="center", va="bottom", **text)
            continue
        lowest = max(order * last / 60.0, lowest + APART * top)
        axes.annotate(f"EO {order}", (last, lowest), (7, 0), ha="left", va="center", **text)


def _crossings(axes: Axes, band: Band, order: int) -> None:
    """Where an engine order meets a band."""
    look = {"marker": "o", "markeredgecolor": style.INK, "linestyle": ""}
    kinds = (
        (band.hz, band.contact, {"markerfacecolor": style.INK, "markersize": 3.0, "zorder": 5}),
        (band.other_hz, band.other, {"markerfacecolor": "white", "markersize": 6.0, "zorder": 4.5}),
    )
    for hz, limit, face in kinds:
        for met in crossing_speeds(band.speeds, hz, order):
            axes.plot([met], [order * met / 60.0], label=f"crossing, {limit}", **look, **face)


def _margin(share: float) -> str:
    """Of a crossing's speed above the operating one."""
    return f"{100 * share:+.2g} %".replace("-", "\N{MINUS SIGN}")
