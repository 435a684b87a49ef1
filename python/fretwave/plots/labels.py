"""Names beside what they name: where they cover no other name, no mark, and as little of lines as can be.

Each takes the cheapest of some places, one after the other, in a picture whose other parts are all drawn and laid out.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.text import Annotation
from matplotlib.transforms import Bbox

from ..arrays import Array
from . import style

#: Distances of a name from its point that are tried [pt]; from the second on a line leads there.
DISTANCES = (3.0, 9.0, 18.0, 30.0)
#: Sides of a name's point, the one preferred first.
SIDES = ((1, 1), (1, -1), (-1, 1), (-1, -1), (0, 1), (0, -1), (1, 0), (-1, 0))
#: Cost of what a name covers: another name, the outside of the axes, a mark, a piece of a line; of the next place, and
#: of each further distance to which a line has to lead.
NAME, OUTSIDE, MARK, LINE, LATER, LED = 100.0, 60.0, 8.0, 1.0, 0.02, 6.0
#: Length of a piece of a line [px], and room about a name [px].
PIECE, ROOM = 5.0, 1.5
#: Shares of a horizontal line at which its name may stand.
ALONG = (0.99, 0.01, 0.5, 0.75, 0.25)


class Cover:
    """What is drawn on some axes, in pixels."""

    def __init__(self, axes: Axes) -> None:
        axes.figure.draw_without_rendering()
        self.axes, self.renderer = axes, axes.figure.canvas.get_renderer()
        self.names = [text.get_window_extent(self.renderer) for text in axes.texts if text.get_text()]
        self.names += [inset.get_tightbbox(self.renderer) for inset in axes.child_axes]
        lines = [line for line in axes.get_lines() if line.get_visible() and len(line.get_xydata())]
        drawn = [(line, line.get_transform().transform(line.get_xydata())) for line in lines]
        marked = [points for line, points in drawn if line.get_marker() not in ("None", "", " ", None)]
        joined = [_pieces(points) for line, points in drawn if line.get_linestyle() not in ("None", "", " ")]
        self.marks, self.lines = (np.concatenate([np.empty((0, 2)), *found]) for found in (marked, joined))

    def cost(self, box: Bbox) -> float:
        """Of a name in this place."""
        covered = sum(box.overlaps(name) for name in self.names)
        ends = self.axes.bbox
        outside = box.x0 < ends.x0 or box.x1 > ends.x1 or box.y0 < ends.y0 or box.y1 > ends.y1
        marks, lines = (np.count_nonzero(_inside(points, box)) for points in (self.marks, self.lines))
        return float(NAME * covered + OUTSIDE * outside + MARK * marks + LINE * lines)

    def cheapest(self, places: Sequence[Bbox], more: Sequence[float] = ()) -> int:
        """Number of the best of some places, which is taken from then on; `more` is what each costs beside."""
        extra = np.array(more or len(places) * [0.0]) + LATER * np.arange(len(places))
        best = int(np.argmin([self.cost(box) for box in places] + extra))
        self.names.append(places[best])
        return best


def _inside(points: Array, box: Bbox) -> Array:
    x, y = points.T
    return np.asarray((x > box.x0 - ROOM) & (x < box.x1 + ROOM) & (y > box.y0 - ROOM) & (y < box.y1 + ROOM))


def _pieces(points: Array) -> Array:
    """Points (n, 2) along a polygon, no further apart than a piece."""
    points = points[np.isfinite(points).all(axis=1)]
    found = [points]
    for begin, end in zip(points, points[1:]):
        count = int(min(np.hypot(*(end - begin)) / PIECE, 400.0))
        found.append(begin + np.linspace(0.0, 1.0, count + 1)[1:-1, None] * (end - begin))
    return np.concatenate(found)


def beside(
    axes: Axes, texts: Sequence[str], points: Sequence[tuple[float, float]], looks: Sequence[dict[str, Any]]
) -> list[Annotation]:
    """Write names beside points of the axes, once all else is there.

    Parameters
    ----------
    points : in data
    looks : of each text, as `annotate` takes them
    """
    cover, found, points_per_pixel = Cover(axes), [], 72.0 / axes.figure.dpi
    for text, point, look in zip(texts, points, looks):
        options = {"textcoords": "offset points", "ha": "center", "va": "center", "zorder": 4, **look}
        note = axes.annotate(text, point, (0.0, 0.0), **options)
        own = note.get_window_extent(cover.renderer)
        shifts = list(_shifts(own, 1.0 / points_per_pixel))
        best = cover.cheapest([own.translated(x, y) for x, y, _ in shifts], [LED * led for *_, led in shifts])
        x, y, led = shifts[best]
        note.xyann = (x * points_per_pixel, y * points_per_pixel)
        note.set_in_layout(False)
        if led:
            _leader(axes, point, note)
        found.append(note)
    return found


def _shifts(own: Bbox, pixels_per_point: float) -> Iterator[tuple[float, float, int]]:
    """To the places about a point [px], the nearest first, and how far a line has to lead, 0 without one."""
    for number, distance in enumerate(DISTANCES):
        for x, y in SIDES:
            away = distance * pixels_per_point
            yield x * (own.width / 2 + away), y * (own.height / 2 + away), max(0, number - 1)


def _leader(axes: Axes, point: tuple[float, float], note: Annotation) -> None:
    """A thin line from a name to its point."""
    look = {"arrowstyle": "-", "color": note.get_color(), "linewidth": 0.6, "shrinkB": 2.0}
    line = axes.annotate("", point, note.xyann, textcoords="offset points", arrowprops=look)
    line.set_in_layout(False)


def along(axes: Axes, names: Sequence[tuple[str, float]], fontsize: float | None = None) -> list[Annotation]:
    """Name horizontal lines, each at its height: where the curves leave room, above or below."""
    cover, found = Cover(axes), []
    places = [(share, side) for share in ALONG for side in (-1, 1)]
    for text, height in names:
        options: dict[str, Any] = {
            "xycoords": ("axes fraction", "data"),
            "textcoords": "offset points",
            "color": style.GREY,
        }
        options["fontsize"] = fontsize
        tried = [axes.annotate(text, (share, height), **_at(share, side), **options) for share, side in places]
        best = cover.cheapest([note.get_window_extent(cover.renderer) for note in tried])
        for number, note in enumerate(tried):
            if number != best:
                note.remove()
        found.append(tried[best])
    return found


def _at(share: float, side: int) -> dict[str, Any]:
    """Inside the axes, above or below the line."""
    ends = {"ha": "right"} if share > 0.9 else {"ha": "left"} if share < 0.1 else {"ha": "center"}
    return {"xytext": (0.0, 3.0 * side), "va": "bottom" if side > 0 else "top", **ends}
