"""Error against run time of a study, double logarithmic."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..arrays import AnyArray
from ..results.analysis import Table
from ..results.reader import Run
from . import labels, style

SWEEPS = {
    "harmonics": ("H", "o-"),
    "samples": ("$N_t$", "s--"),
    "tolerance": ("tol", "^:"),
    "component_modes": ("modes", "v-."),
    "accuracy": ("asked for", "D-"),
    "pressure_change": ("of a step", "s--"),
}
ERRORS = {"zeta_error": "Damping: largest error / peak ζ", "omega_error": "Frequency: largest relative error"}
ERRORS_OF_RESPONSE = {
    "amplitude_error": "Amplitude: largest error / peak",
    "peak_amplitude_error": "Peak: relative error",
}
#: of wear, after the last cycle
ERRORS_OF_WEAR = {"zeta_error": "Damping", "omega_error": "Frequency", "worn_error": "Worn volume"}
#: an error of exactly zero, for which a logarithmic axis has no place: of the least other one
BELOW = 0.1
#: Ends of the time axis at the least over each other.
LEAST_TIMES = 4.0


def figures(run: Run) -> Iterator[tuple[str, Figure]]:
    """The picture of `study.csv`, when there is one."""
    table = run.table("study")
    if table is not None:
        yield "study", draw(table)


def _time_range(times: AnyArray, given: tuple[float, float]) -> tuple[float, float]:
    """Ends of the time axis [s]: not so near to each other that what a busy machine does looks like a cost."""
    middle = float(np.sqrt(times.min() * times.max()))
    return min(given[0], middle / np.sqrt(LEAST_TIMES)), max(given[1], middle * np.sqrt(LEAST_TIMES))


def draw(table: Table) -> Figure:
    """One axes per error, one line per swept setting; the reference run is left out."""
    of_wear = "worn_error" in table
    errors = ERRORS_OF_WEAR if of_wear else ERRORS_OF_RESPONSE if "amplitude_error" in table else ERRORS
    figure, axes = style.new_figure(4.8, columns=len(errors))
    for plane, (column, title) in zip(axes, errors.items()):
        for (sweep, (symbol, line)), colour in zip(SWEEPS.items(), style.PALETTE):
            _sweep(plane, table, sweep, symbol, column, line, colour)
        plane.set(xscale="log", yscale="log", title=title)
        plane.set_xlabel(style.label("Run time" if of_wear else "Run time of the branch", "s"))
        plane.set_xlim(_time_range(_times(table), plane.get_xlim()))
        style.plain_numbers(plane.xaxis, np.array(plane.get_xlim()))
    axes[0].set_ylabel("Relative error of the last cycle" if of_wear else "Error against the finest run")
    if not of_wear:
        axes[0].plot([], [], "o-", color=style.GREY, alpha=0.35, label="as the run estimates it")
    style.legend_outside(figure, axes[0], columns=4)
    for plane, column in zip(axes, errors):
        _name(plane, table, column)
    return figure


def _times(table: Table) -> AnyArray:
    """Of the processor; a study of wear has those of the wall."""
    return table["cpu_s" if "cpu_s" in table else "wall_s"]


def _shown(table: Table, column: str) -> AnyArray:
    """A column that can stand on a logarithmic axis."""
    errors = np.asarray(table[column], dtype=float)
    least = errors[errors > 0].min(initial=1.0)
    return np.where(errors > 0, errors, BELOW * least)


def _sweep(axes: Axes, table: Table, sweep: str, symbol: str, column: str, line: str, colour: str) -> None:
    rows = np.flatnonzero((table["sweep"] == sweep) & (table["reference"] == 0.0))
    if not len(rows):
        return
    time, error = _times(table)[rows], _shown(table, column)[rows]
    axes.plot(time, error, line, color=colour, label=f"{sweep.replace('_', ' ')} ({symbol})")
    if f"{column}_estimate" in table:
        axes.plot(time, _shown(table, f"{column}_estimate")[rows], line, color=colour, alpha=0.35)


def _name(axes: Axes, table: Table, column: str) -> None:
    """The swept setting beside every mark, of all sweeps together so that none covers another."""
    colours = dict(zip(SWEEPS, style.PALETTE))
    rows = np.flatnonzero((table["reference"] == 0.0) & np.isin(table["sweep"], list(SWEEPS)))
    sweeps = [str(sweep) for sweep in table["sweep"][rows]]
    points = list(zip(_times(table)[rows], _shown(table, column)[rows]))
    texts = [
        _text(sweep, table[sweep][row]) + ("" if table[column][row] else ": 0") for sweep, row in zip(sweeps, rows)
    ]
    labels.beside(axes, texts, points, [{"fontsize": 9, "color": colours[sweep]} for sweep in sweeps])


def _text(sweep: str, value: float) -> str:
    return f"{value:.0e}".replace("e-0", "e-") if sweep in ("tolerance", "accuracy") else f"{value:g}"
