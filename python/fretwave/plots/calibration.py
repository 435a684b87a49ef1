"""Estimated over true error of lambda, point by point of a study."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure

from ..results.reader import Run, Table
from . import style

Indices = npt.NDArray[np.intp]

SOURCES = {"harmonics": "o", "samples": "s", "tolerance": "^"}
#: [1/s], below which a difference of two runs is what their solvers leave
LEAST_ERROR = 1e-8


def figures(run: Run) -> Iterator[tuple[str, Figure]]:
    """The picture of `calibration.csv`, when there is one with errors that can be told."""
    table = run.table("calibration")
    if table is not None and len(_told(table)):
        yield "calibration", draw(table)


def _told(table: Table) -> Indices:
    return np.flatnonzero((table["error"] > LEAST_ERROR) & (table["estimate"] > 0))


def draw(table: Table) -> Figure:
    """One mark a point, the diagonal, and the band within a factor of 3; the share within it is the title."""
    figure, plane = style.new_figure(5.0)
    rows = _told(table)
    error, estimate = table["error"][rows], table["estimate"][rows]
    ends = np.array([0.5 * error.min(), 2 * error.max()])
    plane.fill_between(ends, ends / 3, ends * 3, color=style.GREY, alpha=0.25, lw=0, label="within a factor of 3")
    plane.plot(ends, ends, color=style.GREY, lw=1)
    for (sweep, mark), colour in zip(SOURCES.items(), style.PALETTE):
        own = table["sweep"][rows] == sweep
        if own.any():
            plane.plot(error[own], estimate[own], mark, ms=4, alpha=0.7, color=colour, label=f"by {sweep}")
    within = np.mean((estimate < 3 * error) & (estimate > error / 3))
    plane.set(xscale="log", yscale="log", title=f"{100 * within:.0f} % of {len(rows)} points within a factor of 3")
    plane.set_xlabel(style.label("True error of λ", "1/s"))
    plane.set_ylabel(style.label("Estimated error of λ", "1/s"))
    style.legend_outside(figure, plane, columns=2)
    return figure
