"""What a curve rests on and where it ends: computed points, error, and why a branch stopped short of its end."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from textwrap import fill, shorten
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from ..arrays import AnyArray
from ..post.limit_cycles import SHORT
from ..results.analysis import Analysis
from . import style

#: Look of a computed point on its curve.
POINT: dict[str, Any] = {
    "marker": "o",
    "markersize": 3.8,
    "linestyle": "",
    "markeredgecolor": "white",
    "markeredgewidth": 0.5,
    "zorder": 3,
}
#: Look of the last point of a branch that stopped short.
STOP: dict[str, Any] = {
    "marker": "X",
    "markersize": 9,
    "linestyle": "",
    "color": style.RED,
    "markeredgecolor": style.INK,
    "zorder": 7,
    "clip_on": False,
}
#: Name of a limit cycle, the face of its mark, and the line of its orbit, by whether it is stable.
CYCLES = {
    True: (f"limit cycle, {SHORT[True]}", style.GREEN, "--"),
    False: (f"limit cycle, {SHORT[False]}", "white", ":"),
    None: (f"limit cycle, {SHORT[None]}", style.GREY, "-."),
}
UNFINISHED = "not finished: the run goes on, or was cut off"
#: Reasons that a legend has room for, characters of one, and of a line of it.
REASONS, LETTERS, LINE = 3, 170, 64
#: A picture with more points than this has smaller marks, which leave its lines to be seen.
MANY = 100
#: These, of the same colour on every line.
SMALL: dict[str, Any] = {"markersize": 2.2, "markeredgewidth": 0.0, "color": style.INK}


def points(axes: Axes, x: AnyArray, y: AnyArray, colour: style.Colour, many: bool = False) -> None:
    """Marks where a curve was computed; between them it is the cubic through them."""
    axes.plot(x, y, **{**POINT, "color": colour, **(SMALL if many else {})})


def point_entry(axes: Axes, many: bool = False) -> None:
    """The legend's word on computed points."""
    axes.plot([], [], label="computed points", **{**POINT, "color": style.GREY, **(SMALL if many else {})})


def error_entry(axes: Axes, errors: Mapping[str, Sequence[AnyArray | None]]) -> None:
    """The legend's word on error bands: how large they are at most, or that nobody estimated them.

    Parameters
    ----------
    errors : by the unit of an axis those of every curve there, (n,) each; None, or nan, where they are not known
    """
    most = {unit: _largest(of_curves) for unit, of_curves in errors.items()}
    if all(value is None for value in most.values()):
        axes.plot([], [], linestyle="", label="error not estimated")
        return
    said = [style.with_unit(style.number(value, 2), unit) for unit, value in most.items() if value is not None]
    name = f"estimated error, at most {' and '.join(said)}"
    axes.plot([], [], color=style.GREY, alpha=0.3, linewidth=9, label=name)


def _largest(errors: Sequence[AnyArray | None]) -> float | None:
    known = np.concatenate([np.empty(0), *(error for error in errors if error is not None)])
    known = known[np.isfinite(known)]
    return float(known.max()) if len(known) else None


def why_stopped(analysis: Analysis, names: Sequence[str] = ("",)) -> dict[str, str]:
    """Reason of each branch that is no whole one.

    Parameters
    ----------
    names : of its branches, as its results call them in front of their reasons ("level 2"); "" for the only one
    """
    status, reason = (str(analysis.attributes.get(key, "")) for key in ("status", "reason"))
    if status == "running":
        return {names[-1]: UNFINISHED}
    if status != "stopped":
        return {}
    if "" in names:
        return {"": reason}
    parts = re.split(rf"(?:^|; )({'|'.join(map(re.escape, names))}): ", reason)
    return dict(zip(parts[1::2], parts[2::2])) or {names[-1]: reason}


def stops(axes: Axes, ends: Mapping[str, tuple[float, float] | None], reasons: Mapping[str, str]) -> None:
    """A mark at the last point of each branch that stopped short, and the reasons in the legend.

    Parameters
    ----------
    ends : last point of each branch by its name, None where it has none
    reasons : by the same names, as from `why_stopped`
    """
    for number, (name, reason) in enumerate(reasons.items()):
        end = ends.get(name)
        place = ([], []) if end is None else ([end[0]], [end[1]])
        left = len(reasons) - REASONS
        text = words(name, reason) if number < REASONS else f"and {left} more that stopped"
        axes.plot(*place, label=text, **STOP)


def words(name: str, reason: str) -> str:
    """A branch's name and why it stopped, in lines that a legend has room for; a dollar sign would begin a formula."""
    said = reason if reason == UNFINISHED else f"stopped short: {reason}"
    text = f"{name} {said}" if name else said
    return fill(shorten(text, LETTERS, placeholder=" ..."), LINE).replace("$", r"\$")
