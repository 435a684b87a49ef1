"""What `fretwave stress` wrote: strain of gauges, the worst stress, and Goodman's factor with its limit."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..post.fatigue import doubts, first_reaching
from ..results.analysis import Analysis, Table
from ..results.overview import amplitude_column, whose_amplitude
from ..results.parts import PARTS, rows_of_branches
from ..results.reader import Run
from . import scales, style
from .scales import Scale

#: Columns that are stresses.
STRESSES = ("stress_amplitude", "mean_stress")
#: Axes that are no amplitude.
OVER = {"frequency_hz": "Frequency", "cycles": "Wear cycles"}
#: Above a picture, where the table has a warning.
DOUBTFUL = "The stress is not that of the model's stiffness: the table says why"
#: Microstrain of a strain.
MICRO = 1e6


def figures(run: Run) -> Iterator[tuple[str, Figure]]:
    """Of each analysis with a table of gauges: responses over frequency, wear over cycles, others over amplitude."""
    for analysis in run.analyses.values():
        table = run.table_since(f"{analysis.name}_gauges")
        if table is not None and len(table["amplitude"]) > 1:
            yield f"{analysis.name}_gauges", draw(analysis, table)


def draw(analysis: Analysis, table: Table) -> Figure:
    """A panel each for strain, stress and Goodman's factor, as far as the table has them."""
    gauges = [name for name in table if name.endswith("_strain")]
    panels = [*(["strain"] if gauges else []), *(name for name in ("stress_amplitude", "goodman") if name in table)]
    over = "frequency_hz" if analysis.kind == "forced" else "cycles" if "cycles" in table else "amplitude"
    own = amplitude_column(table)
    scale = scales.logarithmic(analysis.unit_system, analysis.unit(own), table[own])
    table = {**table, own: scale(table[own])}
    stress = _stresses(analysis, table)
    table = {name: stress(values) if name in STRESSES else values for name, values in table.items()}
    figure, axes = style.new_figure(1.2 + 2.6 * len(panels), rows=len(panels), sharex=True, squeeze=False)
    branches = list(rows_of_branches(table))
    for place, panel in zip(axes[:, 0], panels):
        for number, rows in enumerate(branches):
            branch = {name: values[rows] for name, values in table.items()}
            _draw(place, panel, gauges, branch, over, number, scale.unit)
            if panel == "goodman":
                _limit(place, branch, over, number, scale.unit)
        place.set_ylim(bottom=0.0)
    for place, panel in zip(axes[:, 0], panels):
        place.set_ylabel(_label(panel, stress))
    if over == "amplitude":
        style.log_amplitude(axes[-1, 0], table[over])
    what = OVER.get(over) or f"Amplitude of {analysis.observed()}"
    axes[-1, 0].set_xlabel(scale.label(what) if over == "amplitude" else style.label(what, analysis.unit(over)))
    if doubts(table):
        axes[0, 0].set_title(DOUBTFUL, fontsize=9.5, color=style.RED)
    for place in axes[:, 0]:
        style.legend(place, loc="best")
    return figure


def _stresses(analysis: Analysis, table: Table) -> Scale:
    """The unit of the axis of stresses."""
    symbol = analysis.unit_system("pressure")
    return scales.linear(analysis.unit_system, symbol, *(table[name] for name in STRESSES if name in table))


def _draw(place: Axes, panel: str, gauges: list[str], table: Table, over: str, number: int, unit: str) -> None:
    """One branch in one panel; of wear it is named by its amplitude."""
    named = {name: f"{name.replace('_', ' ')} {table[name][0]:g}" for name in PARTS if name in table}
    if over == "cycles":
        named["line"] = style.with_unit(style.number(float(table["amplitude"][0])), unit)
    said = ", ".join(named.values())
    look = {"marker": ".", "markersize": 4, "lw": 1.2}
    if panel == "strain":
        for k, name in enumerate(gauges):
            words = ", ".join(filter(None, [f"gauge {name[: -len('_strain')]}", said]))
            colour = style.PALETTE[(k + number * len(gauges)) % len(style.PALETTE)]
            place.plot(table[over], MICRO * table[name], color=colour, label=words, **look)
        return
    colour = style.PALETTE[number % len(style.PALETTE)]
    place.plot(table[over], table[panel], color=colour, label=said or None, **look)
    if panel == "stress_amplitude" and np.any(np.abs(table["mean_stress"]) > 1e-3 * table[panel].max()):
        place.plot(table[over], np.maximum(table["mean_stress"], 0.0), ":", color=colour, label="tensile mean")


def _limit(place: Axes, table: Table, over: str, number: int, unit: str) -> None:
    """The line at 1, and where the branch first passes it."""
    if number == 0:
        place.axhline(1.0, color=style.RED, lw=1.2, ls="--", label="limit")
    passed = first_reaching(table["goodman"], 1.0, table[over], table[amplitude_column(table)])
    if passed is not None:
        at = f"at an amplitude{whose_amplitude(table)} of {style.with_unit(style.number(passed[1]), unit)}"
        words = f"reached {f'after {style.number(passed[0])} cycles' if over == 'cycles' else at}"
        place.plot(passed[0], 1.0, marker="*", ms=11, ls="", color=style.ORANGE, mec=style.INK, label=words)


def _label(panel: str, stress: Scale) -> str:
    if panel == "strain":
        return style.label("Strain amplitude", "10⁻⁶")
    if panel == "goodman":
        return "Goodman's factor"
    return stress.label("Worst stress amplitude")
