"""Estimated over true error of lambda, or of a response's amplitude, point by point of a study."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from matplotlib.figure import Figure

from ..arrays import Indices
from ..post.calibration import FACTORS, can_be_told, share_within
from ..results.analysis import Table
from ..results.reader import Run
from . import style

MARKS = {"harmonics": "o", "samples": "s", "tolerance": "^", "component_modes": "D"}
FACTOR = FACTORS[0]


def figures(run: Run) -> Iterator[tuple[str, Figure]]:
    """The picture of `calibration.csv`, when there is one with errors that can be told."""
    table = run.table("calibration")
    if table is not None and len(_told(table)):
        yield "calibration", draw(table)


def _told(table: Table) -> Indices:
    error = table["error"]
    judge = table["judge"] if "judge" in table else np.zeros_like(error)  # a folder of before has none
    return np.flatnonzero(can_be_told(error, judge) & (table["estimate"] > 0))


def draw(table: Table) -> Figure:
    """One mark a point, the diagonal, and the band within a factor; the share within it is the title."""
    figure, plane = style.new_figure(5.0)
    rows = _told(table)
    error, estimate = table["error"][rows], table["estimate"][rows]
    ends = np.array([0.5 * error.min(), 2 * error.max()])
    words = f"within a factor of {FACTOR}"
    plane.fill_between(ends, ends / FACTOR, ends * FACTOR, color=style.GREY, alpha=0.25, lw=0, label=words)
    plane.plot(ends, ends, color=style.GREY, lw=1)
    for (sweep, mark), colour in zip(MARKS.items(), style.PALETTE):
        own = table["sweep"][rows] == sweep
        if own.any():
            words_of = f"by {sweep.replace('_', ' ')}"
            plane.plot(error[own], estimate[own], mark, ms=4, alpha=0.7, color=colour, label=words_of)
    within = share_within(estimate, error, FACTOR)
    plane.set(xscale="log", yscale="log", title=f"{100 * within:.0f} % of {len(rows)} points {words}")
    of, unit = ("λ", "1/s") if "amplitude" in table else ("the amplitude / peak", "")
    plane.set_xlabel(style.label(f"True error of {of}", unit))
    plane.set_ylabel(style.label(f"Estimated error of {of}", unit))
    style.legend_outside(figure, plane, columns=2)
    return figure
