"""Frequency and damping per cycle of integrated free decays, over the mode's curves."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..arrays import AnyArray
from ..results.reader import Analysis, Run, Table
from . import style


def figures(run: Run) -> Iterator[tuple[str, Figure]]:
    """One picture per free-decay analysis."""
    for decay, mode in run.compared("free_decay"):
        yield f"{decay.name}_cycles", draw(mode, decay)


def draw(mode: Analysis, decay: Analysis) -> Figure:
    """Circles are cycles of the unreduced equations in time, the line is the nonlinear mode."""
    figure, (upper, lower) = style.new_figure(6.2, rows=2, sharex=True)
    curve, table = mode.curve(), decay.columns
    shown = _shown(table)
    for axes, column, factor in ((upper, "frequency_hz", 1.0), (lower, "zeta", 100.0)):
        axes.plot(curve["amplitude"], factor * curve[column], color=style.INK, label=f"mode, {mode.method()}")
        cycles = table["omega"] / (2.0 * np.pi) if axes is upper else 100.0 * table["zeta"]
        style.fit_values(axes, curve["amplitude"], factor * curve[column], shown, cycles)
    for (start, amplitude), colour in zip(decay.starts(), style.PALETTE):
        rows = table["start"] == start
        name = f"cycles of the decay from {style.number(amplitude)} {mode.unit('amplitude')}".strip()
        _cycles(upper, table, rows, table["omega"] / (2.0 * np.pi), colour, name)
        _cycles(lower, table, rows, 100.0 * table["zeta"], colour, name)
    _finish(figure, upper, lower, mode, table)
    return figure


def _cycles(axes: Axes, table: Table, rows: AnyArray, values: AnyArray, colour: str, name: str) -> None:
    look = {"markerfacecolor": "none", "markeredgecolor": colour, "markersize": 6, "label": name}
    axes.plot(table["amplitude"][rows], values[rows], "o", zorder=3, **look)


def _shown(table: Table) -> tuple[float, float]:
    """Amplitudes of the cycles, and a little room."""
    return float(table["amplitude"].min() / 1.3), float(table["amplitude"].max() * 1.3)


def _finish(figure: Figure, upper: Axes, lower: Axes, mode: Analysis, table: Table) -> None:
    style.log_amplitude(lower, _shown(table))
    upper.set_ylabel(style.label("Frequency ω/2π", "Hz"))
    lower.set_ylabel(style.label("Damping ratio ζ", "%"))
    dof = mode.observed()
    lower.set_xlabel(style.label(f"Amplitude of {dof}", mode.unit("amplitude")))
    style.legend_outside(figure, upper, columns=3)
