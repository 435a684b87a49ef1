"""Flutter by nodal diameter: total damping over amplitude, and where the motion of each wave grows or decays."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..arrays import AnyArray
from ..post.flutter_waves import with_sign
from ..post.mode_curve import NO_DAMPING
from ..results.analysis import Analysis
from ..results.reader import Run
from . import marks, scales, style
from .scales import Scale

#: half width of a wave's bar, in distances of neighbouring ones
HALF = 0.32


def figures(run: Run) -> Iterator[tuple[str, Figure]]:
    """Two pictures per flutter analysis."""
    for flutter in run.of_kind("flutter"):
        yield f"{flutter.name}_damping", damping(flutter)
        yield f"{flutter.name}_limits", limits(flutter)


def diameters(flutter: Analysis) -> list[int]:
    """Nodal diameters that have points, ascending."""
    return [int(d) for d in np.unique(flutter.columns["nodal_diameter"])]


def wave(flutter: Analysis, diameter: int) -> tuple[AnyArray, AnyArray]:
    """Amplitude and damping [%] along the branch of a wave, its points among them."""
    curve = flutter.curve()
    rows = curve["nodal_diameter"] == diameter
    return curve["amplitude"][rows], 100.0 * curve["zeta"][rows]


def damping(flutter: Analysis) -> Figure:
    """Total damping of every wave over its amplitude; forward waves solid, backward ones dashed."""
    figure, axes = style.new_figure(5.2)
    found, scale = diameters(flutter), scales.amplitudes(flutter)
    ends: dict[str, tuple[float, float] | None] = {}
    for diameter, colour in zip(found, style.shades(len(found))):
        amplitude, zeta = wave(flutter, diameter)
        look = {"color": colour, "linestyle": "-" if diameter >= 0 else "--"}
        axes.plot(scale(amplitude), zeta, label=f"ND {with_sign(diameter)}", **look)
        rows = flutter.columns["nodal_diameter"] == diameter
        computed = scale(flutter.columns["amplitude"][rows]), 100.0 * flutter.columns["zeta"][rows]
        if "zeta_error" in flutter.columns:
            style.error_band(axes, *computed, 100.0 * flutter.columns["zeta_error"][rows], colour)
        marks.points(axes, *computed, colour, len(flutter) > marks.MANY)
        ends[_called(diameter)] = float(computed[0][-1]), float(computed[1][-1])
    axes.axhline(0.0, color=style.INK, linewidth=1.0)
    _cycles(axes, flutter, lambda cycle: (scale(cycle["amplitude"]), 0.0))
    marks.stops(axes, ends, marks.why_stopped(flutter, list(ends)))
    low, high = axes.get_ylim()
    if low < 0.0:
        axes.axhspan(low, 0.0, color=style.RED, alpha=0.07, zorder=0)
        axes.set_ylim(low, high)
    style.log_amplitude(axes, scale(flutter.columns["amplitude"]))
    axes.set_xlabel(_amplitude(flutter, scale))
    axes.set_ylabel(style.label("Damping ratio ζ, friction and flow", "%"))
    marks.point_entry(axes, len(flutter) > marks.MANY)
    error = flutter.columns.get("zeta_error")
    marks.error_entry(axes, {"%": [None if error is None else 100.0 * error]})
    style.legend_outside(figure, axes, columns=5)
    return figure


def limits(flutter: Analysis) -> Figure:
    """Amplitudes at which each wave grows (red) and decays (blue), and the limit cycles between them."""
    figure, axes = style.new_figure(4.8)
    found, scale = diameters(flutter), scales.amplitudes(flutter)
    for place, diameter in enumerate(found):
        amplitude, zeta = wave(flutter, diameter)
        for low, high, sign in spans(scale(amplitude), zeta):
            axes.fill_between(
                [place - HALF, place + HALF],
                low,
                high,
                color=style.BLUE if sign > 0 else style.RED,
                alpha=0.25,
                linewidth=0,
                label="decays" if sign > 0 else "grows",
            )
    _cycles(axes, flutter, lambda cycle: (found.index(cycle["nodal_diameter"]), scale(cycle["amplitude"])))
    ends = {_called(d): (float(k), float(scale(wave(flutter, d)[0][-1]))) for k, d in enumerate(found)}
    marks.stops(axes, ends, marks.why_stopped(flutter, list(ends)))
    axes.set_yscale("log")
    axes.set_ylim(*scale(np.array([flutter.columns["amplitude"].min(), flutter.columns["amplitude"].max()])))
    axes.set_xticks(range(len(found)), [with_sign(diameter) for diameter in found])
    axes.set_xlabel("Nodal diameters, negative for backward waves")
    axes.set_ylabel(_amplitude(flutter, scale))
    style.plain_numbers(axes.yaxis)
    style.legend_outside(figure, axes, columns=5)
    return figure


def spans(amplitude: AnyArray, zeta: AnyArray) -> list[tuple[float, float, float]]:
    """Ranges of amplitude between sign changes of the damping [%] along a branch: (low, high, sign)."""
    signs = np.sign(zeta)
    signs[np.abs(zeta) < 100.0 * NO_DAMPING] = 0  # located limit cycles belong to both sides
    ends = np.concatenate([[0], np.flatnonzero(signs == 0), [len(zeta) - 1]])
    parts = [(i, k) for i, k in zip(ends, ends[1:]) if k > i]
    return [(float(amplitude[i]), float(amplitude[k]), float(np.sign(zeta[i : k + 1].sum()))) for i, k in parts]


def _cycles(axes: Axes, flutter: Analysis, place: object) -> None:
    """Limit cycles: green where stable in their own amplitude, open where not, grey where that is not known."""
    for cycle in flutter.attributes.get("events", []):
        kind, face, _ = marks.CYCLES[None if cycle["folds"] else cycle["stable"]]
        look = {"marker": "o", "markersize": 7, "markeredgecolor": style.INK, "linestyle": "", "zorder": 6}
        x, y = place(cycle)  # type: ignore[operator]
        axes.plot([x], [y], label=kind, markerfacecolor=face, **look)


def _called(diameter: int) -> str:
    """As the results name the branch of a wave."""
    return f"nodal diameter {diameter}"


def _amplitude(flutter: Analysis, scale: Scale) -> str:
    return scale.label(f"Modal amplitude of {flutter.observed()}".rstrip(" of"))
