"""A branch from a script: along the cubic through its points, with the points and the events on it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..plots import marks, scales, style
from ..plots.scales import Scale

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
    curve, along = branch.curve(), _scale(branch, abscissa)
    with style.rules():
        figure, axes = style.new_figure(6.0, rows=2, sharex=True)
        for place, column in zip(axes, columns):
            unwrap, scale = np.unwrap if column == "phase" else np.asarray, _scale(branch, column)
            line = scale(unwrap(curve[column]))
            x, rows = along(branch[abscissa]), line[curve["place"] % 1 == 0]
            place.plot(along(curve[abscissa]), line, color=style.BLUE, label=branch.meaning.kind)
            marks.points(place, x, rows, style.BLUE)
            _events(place, branch, x, rows)
            end = (float(x[-1]), float(rows[-1])) if len(branch) else None
            marks.stops(place, {"": end}, {} if branch.converged else {"": branch.reason})
            place.set_ylabel(scale.label(_name(column)))
        axes[1].set_xlabel(along.label(_name(abscissa)))
        if branch.meaning.kind == "mode" and len(branch) > 1:
            style.log_amplitude(axes[1], along(branch[abscissa]))
        marks.point_entry(axes[0])
        style.legend_outside(figure, axes[0])
    return figure


def _scale(branch: Branch, column: str) -> Scale:
    """Of its axis; that of an amplitude on which the other columns stand is logarithmic."""
    choose = scales.logarithmic if branch.meaning.kind == "mode" else scales.linear
    symbol = branch.units[column]
    return choose(branch.unit_system, symbol, branch[column]) if column == "amplitude" else Scale(1.0, symbol)


def _name(column: str) -> str:
    return {"zeta": "Damping ratio", "frequency_hz": "Frequency", "amplitude": "Amplitude", "phase": "Phase"}[column]


def _events(axes: Axes, branch: Branch, x: Array, y: Array) -> None:
    names = [name for name in dict.fromkeys(event.name for event in branch.events) if name not in PLAIN]
    for name, mark in zip(names, MARKS):
        rows = branch.met(name)
        look = {"color": style.INK, "markersize": 4.5, "linestyle": "none", "zorder": 5}
        axes.plot(x[rows], y[rows], mark, label=name.replace("_", " "), **look)
