"""Amplitude in time from low, intermediate and high starts, with the predicted limit cycles (paper's figure 6)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Optional

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..arrays import AnyArray
from ..post.decays import DIVERGES
from ..post.limit_cycles import SHORT
from ..post.motion import motion
from ..results.analysis import Analysis, Table
from ..results.reader import Run
from . import marks, scales, style
from .scales import Scale

#: top of the axes, in largest starts or predictions; what goes beyond has left the picture
HEIGHT = 4.0
NAMES = {1: ("start",), 2: ("low start", "high start"), 3: ("low start", "intermediate start", "high start")}


def figures(run: Run) -> Iterator[tuple[str, Figure]]:
    """Per limit-cycle analysis the envelopes, and the phase planes when the motion was kept."""
    for motions, mode in run.compared("limit_cycle"):
        yield f"{motions.name}_envelopes", envelopes(mode, motions)
        if all(len(motions.history(start)) for start, _ in motions.starts()):
            yield f"{motions.name}_phase_planes", phase_planes(mode, motions)


def envelopes(mode: Analysis, motions: Analysis) -> Figure:
    """Fundamental amplitude of every cycle against time, all starts on one axes."""
    figure, axes = style.new_figure(4.6)
    table, starts, scale = motions.columns, motions.starts(), scales.amplitudes(mode)
    seconds = scales.linear(mode.unit_system, "s", _settled(table))
    for (number, start), colour, name in zip(starts, style.PALETTE, _names(len(starts))):
        rows = table["start"] == number
        time, amplitude = seconds(table["time"][rows]), scale(table["amplitude"][rows])
        axes.plot(time, amplitude, color=colour, label=f"{name}, a = {scale.text(start, 4)}")
        if time[-1] < 0.9 * seconds(table["time"].max()):
            grows = bool(amplitude[-1] > amplitude[0])
            axes.plot(time[-1:], amplitude[-1:], "^" if grows else "v", color=colour)
            end = time[-1], amplitude[-1]
            axes.annotate(_end(motions, number, grows), end, (8, 0), textcoords="offset points", va="center")
    _predicted(axes, mode, scale)
    shown = scale(np.array(_visible(mode, motions)))
    axes.set(yscale="log", xlim=(0.0, seconds(_settled(table))), ylim=shown)
    axes.set_xlabel(seconds.label("Time"))
    axes.set_ylabel(scale.label(f"Amplitude of {mode.observed()} per cycle"))
    style.plain_numbers(axes.yaxis)
    style.legend_outside(figure, axes, columns=3)
    return figure


def _end(motions: Analysis, number: int, grows: bool) -> str:
    """Why the cycles of a start end before those of the others."""
    endings = motions.attributes.get("endings")
    told = endings[number]["text"] if endings else DIVERGES
    return f"{told}, stopped" if grows else "ends"


def _visible(mode: Analysis, motions: Analysis) -> tuple[float, float]:
    """Amplitudes shown: everything, but not far beyond the starts and predictions."""
    amplitude = motions.columns["amplitude"]
    largest = [crossing.amplitude for crossing in mode.mode_curve().crossings()] + [
        start for _, start in motions.starts()
    ]
    return 0.7 * float(amplitude.min()), min(HEIGHT * max(largest), 1.4 * float(amplitude.max()))


def _settled(table: Table) -> float:
    """Time shown: half as long again as the slowest start needs to come within 2 % of where it ends."""
    last = 0.0
    for start in np.unique(table["start"]):
        rows = table["start"] == start
        amplitude, time = table["amplitude"][rows], table["time"][rows]
        away = np.flatnonzero(np.abs(amplitude / amplitude[-1] - 1.0) > 0.02)
        last = max(last, float(time[away[-1]]) if len(away) else 0.0)
    return min(1.5 * last, float(table["time"].max())) or float(table["time"].max())


def _predicted(axes: Axes, mode: Analysis, scale: Scale) -> None:
    for crossing in mode.mode_curve().crossings():
        name = f"predicted, {SHORT[crossing.stable]}, a = {scale.text(crossing.amplitude)}"
        line = marks.CYCLES[crossing.stable][-1]
        axes.axhline(scale(crossing.amplitude), color=style.INK, linestyle=line, label=name)


def phase_planes(mode: Analysis, motions: Analysis) -> Figure:
    """Velocity against displacement of the normalised dof, one axes per start, with the predicted limit cycle."""
    starts = motions.starts()
    figure, axes = style.new_figure(3.6, columns=len(starts), squeeze=False)
    orbits, scale = predicted_orbits(mode), scales.amplitudes(mode)
    speed = Scale(scale.factor, f"{scale.unit}/s" if scale.unit else "")
    for (number, start), plane, colour, name in zip(starts, axes[0], style.PALETTE, _names(len(starts))):
        _, x, v = motions.history(number)
        plane.plot(scale(x), speed(v), color=colour, linewidth=0.5)
        for stable, x, v in orbits:
            kind, _, line = marks.CYCLES[stable]
            plane.plot(scale(x), speed(v), color=style.INK, linestyle=line, label=f"predicted {kind}")
        plane.set_title(f"{name},\na = {scale.text(start, 4)}")
        plane.set_xlabel(scale.label("Displacement"))
    axes[0, 0].set_ylabel(speed.label("Velocity"))
    axes[0, 0].plot([], [], color=style.GREY, linewidth=0.8, label="time integration")
    style.legend_outside(figure, axes[0, 0], columns=3)
    return figure


def predicted_orbits(mode: Analysis) -> list[tuple[Optional[bool], AnyArray, AnyArray]]:
    """Closed orbits of the normalised dof at the zeros of the damping, from the nearest point scaled to the zero.

    Its mean is as it is there: that of a static state has nothing to do with the amplitude.
    """
    orbits, moves = [], np.array([label != "0" for label in mode.labels], dtype=bool)
    for crossing in mode.mode_curve().crossings() if mode.labels else []:
        away = np.abs(mode.columns["amplitude"] / crossing.amplitude - 1.0) + np.abs(mode.columns["zeta"])
        point = int(np.argmin(away))
        factor = np.where(moves, crossing.amplitude / mode.columns["amplitude"][point], 1.0)
        coefficients = mode.coefficients([point])[0] * factor
        x, v = motion(mode.labels, coefficients, 0.0, crossing.omega)
        orbits.append((crossing.stable, mode.along(x), mode.along(v)))
    return orbits


def _names(count: int) -> tuple[str, ...]:
    return NAMES.get(count, tuple(f"start {i + 1}" for i in range(count)))
