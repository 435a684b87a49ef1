"""Wear of single contact pairs: histories of different kinds, and the worn profiles of the faces (figures 15, 16)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..arrays import Array
from ..results.analysis import Analysis, Table
from ..results.reader import Run
from ..units import UnitSystem
from . import style
from .faces import place_face, placed
from .wear_lines import (
    KINDS,
    RULE,
    WearLine,
    amplitude_text,
    cycle_label,
    examples,
    kinds,
    telling_line,
    wears,
)

#: side of a pair's mark [pt^2]
MARK = 150.0
#: decimals that tell rows of pairs apart
ROUND = 6


def figures(run: Run) -> Iterator[tuple[str, Figure]]:
    """Of each contact that wears: histories, and for known places the profiles."""
    for wear, lines in wears(run):
        for contact in wear.worn_contacts():
            line = telling_line(lines, contact)
            pairs = wear.pairs(contact) if contact in wear.placed() else None
            yield f"{wear.name}_pairs_{contact}", draw_histories(wear, line, contact, pairs)
            if pairs is not None:
                yield f"{wear.name}_profile_{contact}", draw_profiles(line, contact, pairs)


def draw_histories(wear: Analysis, line: WearLine, contact: str, pairs: Table | None) -> Figure:
    """Depth and mean normal force of all pairs over the cycles, one pair of each kind in front, and where they lie."""
    words = kinds(line.depth[contact], line.rate[contact])
    chosen = examples(line, contact)
    faces = [] if pairs is None else list(dict.fromkeys(pairs["face"]))
    figure, _ = style.new_figure(6.4 + (2.2 if faces else 0.0))
    figure.clear()
    grid = figure.add_gridspec(3 if faces else 2, max(len(faces), 1), height_ratios=[2, 1.6, 0.9][: 3 if faces else 2])
    upper = figure.add_subplot(grid[0, :])
    lower = figure.add_subplot(grid[1, :], sharex=upper)
    scale, unit = line.units.of_depths
    _histories(upper, line.cycles, scale * line.depth[contact], words, chosen)
    _histories(lower, line.cycles, line.load[contact], words, chosen)
    upper.set_ylabel(style.label("Worn depth", unit))
    missing = ", ".join(kind for kind in KINDS if kind not in chosen)
    text = f"{amplitude_text(line)}, {len(words)} pairs of {contact}"
    upper.set_title(text + (f"; left out, for there is none: {missing}" if missing else ""))
    lower.set_ylabel(style.label("Mean normal force", line.units("force")))
    lower.set_xlabel(cycle_label(wear))
    lower.set(xlim=(0.0, line.cycles[-1]))
    for column, face in enumerate(faces):
        places = figure.add_subplot(grid[2, column])
        unit = _places(places, pairs or {}, line.units, face, words, chosen)
        places.set_xlabel(style.label("Along the face", unit))
        places.set_ylabel("" if column else style.label("Up the face", unit))
    figure.supxlabel(RULE, fontsize=9, color=style.GREY)
    style.legend_outside(figure, upper, columns=2)
    return figure


def draw_profiles(line: WearLine, contact: str, pairs: Table) -> Figure:
    """Depth at the last cycle: maps of the faces on one colour scale, and profiles along each row of pairs."""
    (scale, unit), (pairs, of_face) = line.units.of_depths, placed(pairs, line.units)
    depth, faces = scale * line.depth[contact][-1], list(dict.fromkeys(pairs["face"]))
    rows, deepest = _rows(pairs["position"][:, 1]), float(depth.max()) or 1.0
    figure, axes = style.new_figure(5.8, rows=2, columns=len(faces), sharex=True, sharey="row", squeeze=False)
    for (upper, lower), face in zip(axes.T, faces):
        mine = pairs["face"] == face
        dots = _depths(upper, pairs["position"][mine], depth[mine], deepest)
        place_face(upper, face, pairs["position"])
        _profiles(lower, pairs["position"][mine], depth[mine], rows, of_face)
        lower.set_xlabel(style.label("Along the face", of_face))
    axes[0, 0].set_ylabel(style.label("Up the face", of_face))
    axes[1, 0].set_ylabel(style.label("Worn depth", unit))
    axes[1, 0].set_ylim(0.0, 1.08 * deepest)
    figure.colorbar(dots, ax=axes[0, :], label=style.label("Worn depth", unit), pad=0.02)
    text = f"Worn profiles of {contact} after {line.cycles[-1]:.4g} wear cycles at {amplitude_text(line)}"
    style.legend_outside(figure, axes[1, 0], columns=4, title=text)
    return figure


def _depths(axes: Axes, places: Array, depth: Array, deepest: float) -> Any:
    """A mark for each pair with its depth in numbers, two digits for the deepest."""
    digits = max(0, 1 - int(np.floor(np.log10(deepest))))
    for place, value in zip(places, depth):
        axes.annotate(f"{value:.{digits}f}", place, (0, 9), textcoords="offset points", fontsize=8, ha="center")
    look = {"vmin": 0.0, "vmax": deepest, "cmap": "magma_r", "marker": "s", "s": MARK, "linewidths": 0.5}
    return axes.scatter(*places.T, c=depth, edgecolors=style.GREY, **look)


def _profiles(axes: Axes, places: Array, depth: Array, rows: Array, unit: str) -> None:
    """Depth along each row of pairs; single dots where pairs do not stand in rows."""
    for row, colour in zip(rows, style.shades(len(rows))):
        here = np.flatnonzero(np.isclose(places[:, 1], row, rtol=0.0, atol=10.0**-ROUND))
        here = here[np.argsort(places[here, 0])]
        axes.plot(places[here, 0], depth[here], "o-", color=colour, label=f"{row:.3g} {unit} up the face", markersize=4)
    if not len(rows):
        axes.plot(places[:, 0], depth, "o", color=style.BLUE)


def _rows(heights: Array) -> Array:
    """Heights (n_pairs,) of the rows of pairs; none where most rows would be of one pair."""
    rows = np.unique(np.round(heights, ROUND))
    return rows if 2 * len(rows) <= len(heights) else rows[:0]


def _histories(axes: Axes, cycles: Array, values: Array, words: list[str], chosen: dict[str, int]) -> None:
    for curve, kind in zip(values.T, words):
        axes.plot(cycles, curve, color=KINDS[kind], linewidth=0.6, alpha=0.45)
    for kind, pair in chosen.items():
        count = words.count(kind)
        text = f"{kind} ({f'{count} pairs; here' if count > 1 else 'only'} pair {pair})"
        axes.plot(cycles, values[:, pair], color=KINDS[kind], linewidth=2.6, label=text)
    axes.set_ylim(bottom=0.0)


def _places(axes: Axes, pairs: Table, units: UnitSystem, face: str, words: list[str], chosen: dict[str, int]) -> str:
    """Kind of each pair of a face; the pairs drawn in front have a ring. The unit of the places."""
    pairs, unit = placed(pairs, units)
    for pair in np.flatnonzero(pairs["face"] == face):
        ring = pair in chosen.values()
        look = {"markeredgecolor": style.INK if ring else style.GREY, "markeredgewidth": 2.0 if ring else 0.4}
        axes.plot(*pairs["position"][pair], "o", color=KINDS[words[pair]], markersize=10, **look)
    place_face(axes, face, pairs["position"])
    return unit
