"""Frequency and damping per cycle of integrated free decays, over the mode's curves."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..arrays import AnyArray
from ..results.analysis import Analysis, Table
from ..results.reader import Run
from . import marks, scales, style
from .scales import Scale


def figures(run: Run) -> Iterator[tuple[str, Figure]]:
    """One picture per free-decay analysis."""
    for decay, mode in run.compared("free_decay"):
        yield f"{decay.name}_cycles", draw(mode, decay)


def draw(mode: Analysis, decay: Analysis) -> Figure:
    """Circles are cycles of the unreduced equations in time, the line is the nonlinear mode."""
    figure, (upper, lower) = style.new_figure(6.2, rows=2, sharex=True)
    curve, table, scale = mode.curve(), decay.columns, scales.amplitudes(mode)
    shown = _shown(table)
    for axes, column, factor in ((upper, "frequency_hz", 1.0), (lower, "zeta", 100.0)):
        axes.plot(scale(curve["amplitude"]), factor * curve[column], color=style.INK, label=f"mode, {mode.method()}")
        marks.points(axes, scale(mode.columns["amplitude"]), factor * mode.columns[column], style.INK)
        cycles = table["omega"] / (2.0 * np.pi) if axes is upper else 100.0 * table["zeta"]
        style.fit_values(axes, curve["amplitude"], factor * curve[column], shown, cycles)
    amplitude = scale(table["amplitude"])
    for (start, first), colour in zip(decay.starts(), style.PALETTE):
        rows = table["start"] == start
        name = f"cycles of the decay from {scale.text(first)}"
        _cycles(upper, amplitude[rows], table["omega"][rows] / (2.0 * np.pi), colour, name)
        _cycles(lower, amplitude[rows], 100.0 * table["zeta"][rows], colour, name)
    _finish(figure, upper, lower, mode, table, scale)
    return figure


def _cycles(axes: Axes, amplitude: AnyArray, values: AnyArray, colour: str, name: str) -> None:
    look = {"markerfacecolor": "none", "markeredgecolor": colour, "markersize": 6, "label": name}
    axes.plot(amplitude, values, "o", zorder=3.5, **look)


def _shown(table: Table) -> tuple[float, float]:
    """Amplitudes of the cycles, and a little room."""
    return float(table["amplitude"].min() / 1.3), float(table["amplitude"].max() * 1.3)


def _finish(figure: Figure, upper: Axes, lower: Axes, mode: Analysis, table: Table, scale: Scale) -> None:
    style.log_amplitude(lower, scale(np.array(_shown(table))))
    upper.set_ylabel(style.label("Frequency ω/2π", "Hz"))
    lower.set_ylabel(style.label("Damping ratio ζ", "%"))
    lower.set_xlabel(scale.label(f"Amplitude of {mode.observed()}"))
    marks.point_entry(upper)
    style.legend_outside(figure, upper, columns=3)
