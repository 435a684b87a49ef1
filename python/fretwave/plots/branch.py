"""A branch from a script: along the cubic through its points, with the points and the events on it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..plots import style

if TYPE_CHECKING:
    from ..arrays import Array
    from ..solve.branch import Branch

#: What is drawn over what: abscissa, and the columns of the two pictures.
AXES = {"mode": ("amplitude", "frequency_hz", "zeta"), "forced": ("frequency_hz", "amplitude", "phase")}
#: Events that everyone sees without a mark.
PLAIN = ("start", "stop", "report")
MARKS = "Dos^v"


def draw(branch: Branch) -> Figure:
    """Two pictures over a common axis."""
    abscissa, *columns = AXES[branch.meaning.kind]
    curve = branch.curve()
    with style.rules():
        figure, axes = style.new_figure(6.0, rows=2, sharex=True)
        for place, column in zip(axes, columns):
            unwrap = np.unwrap if column == "phase" else np.asarray
            line = unwrap(curve[column])
            rows = line[curve["place"] % 1 == 0]
            place.plot(curve[abscissa], line, color=style.BLUE, label=branch.meaning.kind)
            place.plot(branch[abscissa], rows, ".", color=style.BLUE, markersize=4, label="points")
            _events(place, branch, branch[abscissa], rows)
            place.set_ylabel(style.label(_name(column), branch.units[column]))
        axes[1].set_xlabel(style.label(_name(abscissa), branch.units[abscissa]))
        if branch.meaning.kind == "mode" and len(branch) > 1:
            style.log_amplitude(axes[1], branch[abscissa])
        style.legend_outside(figure, axes[0])
    return figure


def _name(column: str) -> str:
    return {"zeta": "Damping ratio", "frequency_hz": "Frequency", "amplitude": "Amplitude", "phase": "Phase"}[column]


def _events(axes: Axes, branch: Branch, x: Array, y: Array) -> None:
    names = [name for name in dict.fromkeys(event.name for event in branch.events) if name not in PLAIN]
    for name, mark in zip(names, MARKS):
        rows = branch.met(name)
        look = {"color": style.INK, "markersize": 4.5, "linestyle": "none", "zorder": 5}
        axes.plot(x[rows], y[rows], mark, label=name.replace("_", " "), **look)
