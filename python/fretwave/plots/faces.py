"""Contact pairs drawn where they lie on their faces: load at rest, and stick, slip and open in a mode."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ..arrays import Array
from ..model.law_info import OPEN, SLIP, STICK
from ..results.analysis import Analysis, Table
from ..results.reader import Run
from ..units import UnitSystem
from . import scales, style
from .scales import Scale

#: amplitudes of a map
MAPS = 4
#: diameter of a pair's disc [pt], and margin around the pairs over their extent
DISC = 13.0
MARGIN = 0.22
#: smaller shares than this are too thin to draw
SEEN = 0.005
STATUS = {"stick": style.BLUE, "slip": style.ORANGE, "open": "#dddddd"}


def figures(run: Run) -> Iterator[tuple[str, Figure]]:
    """For contacts with known places: loads of a static analysis, maps of a mode."""
    for static in run.of_kind("static"):
        table = run.table(static.name)
        for contact in static.placed() if table is not None else ():
            yield f"{static.name}_load_{contact}", draw_load(static, contact, table or {})
    for mode in run.of_kind("mode"):
        for contact in mode.placed():
            if contact in mode.contacts and mode.reported and mode.tells_status(contact):
                yield f"{mode.name}_map_{contact}", draw_map(mode, contact)


def draw_load(static: Analysis, contact: str, table: dict[str, Array]) -> Figure:
    """Normal force of every pair at the largest load factor; the shape of the mark tells its status.

    Of a law without a normal direction the tangential force.
    """
    rows = (table["contact"] == contact) & (table["factor"] == table["factor"].max())
    status, known = table["status"][rows], np.isfinite(table["normal_force"][rows]).all()
    shown, what = (table["normal_force"], "normal force") if known else (table["tangential_force"], "tangential force")
    scale = scales.linear(static.unit_system, static.unit_system("force"), shown[rows])
    force, (pairs, unit) = scale(shown[rows]), placed(static.pairs(contact), static.unit_system)
    digits = max(0, 1 - int(np.floor(np.log10(force.max() or 1.0))))
    names = list(dict.fromkeys(pairs["face"]))
    figure, panels = style.new_figure(1.2 + 1.9 * len(names), rows=len(names), sharex=True, squeeze=False)
    marks = {"stick": "s", "slip": "o", "open": "x"}
    for name, axes in zip(names, panels[:, 0]):
        mine = pairs["face"] == name
        for word, mark in marks.items():
            here = mine & (status == word)
            look = {"vmin": 0.0, "vmax": force.max(), "cmap": "viridis", "marker": mark, "s": 130}
            dots = axes.scatter(*pairs["position"][here].T, c=force[here], **look)
        for place, value in zip(pairs["position"][mine], force[mine]):
            axes.annotate(f"{value:.{digits}f}", place, (0, 8), textcoords="offset points", fontsize=8, ha="center")
        place_face(axes, name, pairs["position"])
        axes.set_ylabel(style.label("Up the face", unit))
    panels[-1, 0].set_xlabel(style.label("Along the face", unit))
    figure.colorbar(dots, ax=panels, label=scale.label(what.capitalize()), shrink=0.8)
    counts = ", ".join(f"{int((status == word).sum())} {word}" for word in marks)
    total = f"{what}s {force.sum():.4g} {scale.unit}"
    text = f"Contact {contact} at rest, load factor {table['factor'].max():g}: {total}; {counts}"
    figure.suptitle(text, fontsize=11.5)
    return figure


def draw_map(mode: Analysis, contact: str) -> Figure:
    """Shares of the period that each pair sticks, slips and is open, at several amplitudes, below the shares of all."""
    points = chosen_points(mode)
    (pairs, of_face), scale = placed(mode.pairs(contact), mode.unit_system), scales.linear_amplitudes(mode)
    names = list(dict.fromkeys(pairs["face"]))
    figure, _ = style.new_figure(3.6 + 1.25 * len(points))
    figure.clear()
    grid = figure.add_gridspec(1 + len(points), len(names), height_ratios=[1.9, *(1.0 for _ in points)])
    _shares(figure.add_subplot(grid[0, :]), mode, points, scale)
    for row, point in enumerate(points):
        kept = mode.loop(contact, point)
        shares = kept["shares"] if "shares" in kept else status_shares(kept["status"])
        for column, name in enumerate(names):
            axes = figure.add_subplot(grid[1 + row, column])
            mine = pairs["face"] == name
            _pies(axes, pairs["position"][mine], shares[:, mine])
            place_face(axes, f"{name}, {scale.text(mode.columns['amplitude'][point])}", pairs["position"])
            axes.tick_params(labelbottom=row == len(points) - 1, labelleft=column == 0)
    along = style.label("Along the face", of_face)
    figure.supxlabel(f"{along}; each disc is one contact pair, cut by its shares of a period", fontsize=10)
    figure.supylabel(style.label("Up the face", of_face), fontsize=10, y=0.36)
    return figure


def placed(pairs: Table, units: UnitSystem) -> tuple[Table, str]:
    """`Analysis.pairs` with positions in the unit of places on a face, and that unit."""
    scale, unit = units.of_faces
    return {**pairs, "position": scale * pairs["position"]}, unit


def chosen_points(mode: Analysis) -> list[int]:
    """Kept points at which not all pairs stick, even in number; the largest amplitude is among them."""
    moving = [p for p in mode.reported if mode.columns["stick"][p] < 1] or mode.reported
    moving = sorted(moving, key=lambda p: float(mode.columns["amplitude"][p]))
    return [moving[i] for i in np.unique(np.linspace(0, len(moving) - 1, MAPS).round().astype(int))]


def status_shares(status: Array) -> Array:
    """Shares (3, n_pairs) of the samples (n_samples, n_pairs) that stick, slip and are open."""
    return np.array([np.mean(status == state, axis=0) for state in (STICK, SLIP, OPEN)])


def _shares(axes: Axes, mode: Analysis, points: Sequence[int], scale: Scale) -> None:
    """Stick, slip and open of all pairs over the amplitude."""
    amplitude = scale(mode.columns["amplitude"])
    order = np.argsort(amplitude)
    values = [100 * mode.columns[word][order] for word in STATUS]
    axes.stackplot(amplitude[order], *values, colors=STATUS.values(), alpha=0.85)
    for point in points:
        axes.axvline(amplitude[point], color=style.INK, linewidth=0.8, linestyle=":")
    axes.set(xlim=(amplitude.min(), amplitude.max()), ylim=(0, 100), ylabel="Share of time [%]")
    text = scale.label(f"Modal amplitude of {mode.observed()}")
    axes.set_xlabel(f"{text}, {mode.method()}; dotted: the maps below")
    axes.grid(False)
    handles = [Line2D([], [], marker="o", linestyle="", color=colour, label=word) for word, colour in STATUS.items()]
    above = {"loc": "lower center", "bbox_to_anchor": (0.5, 1.0), "borderaxespad": 0.2, "frameon": False}
    axes.legend(handles=handles, ncols=3, **above)


def _pies(axes: Axes, places: Array, shares: Array) -> None:
    """One disc per pair, cut into its shares, of one size on paper whatever the scale of the axes."""
    for place, parts in zip(places, shares.T):
        parts = np.where(parts < SEEN, 0.0, parts)
        ends = 2 * np.pi * np.concatenate([[0.0], np.cumsum(parts / parts.sum())])
        for begin, end, colour in zip(ends, ends[1:], STATUS.values()):
            if end > begin:
                angle = np.linspace(begin, end, 2 + int(24 * (end - begin)))
                arc = np.column_stack([np.sin(angle), np.cos(angle)])
                outline = arc if end - begin > 6.28 else np.vstack([[0.0, 0.0], arc])
                axes.plot(*place, marker=outline, markersize=DISC, color=colour, markeredgewidth=0, clip_on=False)
        axes.plot(*place, "o", markersize=DISC, markerfacecolor="none", markeredgecolor=style.GREY, markeredgewidth=0.6)


def place_face(axes: Axes, title: str, places: Array) -> None:
    """Axes of a face that hold all these places (n_pairs, 2)."""
    low, high = places.min(axis=0), places.max(axis=0)
    reach = MARGIN * np.where(high > low, high - low, max(*(high - low), 1.0))
    axes.set(xlim=(low[0] - reach[0], high[0] + reach[0]), ylim=(low[1] - reach[1], high[1] + reach[1]))
    axes.set_title(title, fontsize=10)
    axes.grid(False)
