"""A mode of a whole wheel: amplitude sector by sector, the waves it is made of, and how both change on the branch."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..arrays import Complex
from ..cyclic.engine_order import folded
from ..post.largest import as_large
from ..post.mode_curve import without_rounding
from ..post.motion import complex_amplitudes
from ..post.wave_content import wave_content
from ..results.analysis import Analysis
from ..results.reader import Run
from . import scales, style

#: points of a branch that are drawn
SHOWN = 4
#: a point of largest damping nearer than this in log amplitude to another is not drawn beside it
APART = 0.3
#: a participation ratio that changes by less on a branch is not drawn over amplitude
CHANGES = 0.02
#: sectors whose amplitudes differ by less, relative, move alike: none of them moves most
ALIKE = 1e-3


def figures(run: Run) -> Iterator[tuple[str, Figure]]:
    """For every mode of a whole wheel."""
    for mode in run.of_kind("mode"):
        if "sector_dofs" not in mode.attributes:
            continue
        yield f"{mode.name}_sectors", draw_sectors(mode)
        if np.ptp(mode.columns["participation"]) > CHANGES:
            yield f"{mode.name}_localisation", draw_change(mode)


def sector_amplitudes(mode: Analysis, points: list[int]) -> Complex:
    """Complex fundamental of the observed dof in all sectors, (points, N)."""
    unit, dof = int(mode.attributes["sector_dofs"]), mode.normalised_dof()
    q = [complex_amplitudes(mode.labels, Q)[1] for Q in mode.coefficients(points)]
    return np.array(q)[:, dof % unit :: unit]


def draw_sectors(mode: Analysis) -> Figure:
    """Left the amplitude of every sector, over that of the tuned wave of the same energy; right the waves' shares."""
    points = _points(mode)
    a = sector_amplitudes(mode, points)
    figure, panels = style.new_figure(
        1.1 + 1.55 * len(points), rows=len(points), columns=2, sharex="col", sharey="col", squeeze=False
    )
    for row, (point, values) in enumerate(zip(points, a)):
        _sectors(panels[row, 0], mode, point, values)
        _waves(panels[row, 1], values)
    panels[0, 0].set_ylim(0.0, 1.25 * max(mode.columns["amplification"][points].max(), 1.0))
    panels[-1, 0].set_xlabel("Sector")
    panels[-1, 1].set_xlabel("Nodal diameters (backward < 0 < forward)")
    dof = str(mode.attributes.get("normalise", "")).partition("@")[0]
    panels[0, 0].set_title(f"Amplitude of {dof} (tuned wave: 1)")
    panels[0, 1].set_title("Share of each wave")
    return figure


def _points(mode: Analysis) -> list[int]:
    """First, reported, that of largest damping, and last."""
    amplitude = mode.columns["amplitude"]
    points = [0, *mode.met("report"), len(mode) - 1]
    for peak in mode.met("peak_damping")[:1]:
        if np.abs(np.log(amplitude[points] / amplitude[peak])).min() > APART:
            points.append(peak)
    points = sorted(set(points))
    if len(points) <= SHOWN:
        return points
    return [points[k] for k in np.unique(np.linspace(0, len(points) - 1, SHOWN).round().astype(int))]


def _sectors(axes: Axes, mode: Analysis, point: int, a: Complex) -> None:
    tuned = np.abs(a).max() / mode.columns["amplification"][point]
    places, size = np.arange(len(a)), np.abs(a)
    most = as_large(size, ALIKE)
    alone = most & (most.sum() == 1)  # not of a tuned wave
    axes.bar(places, size / tuned, color=np.where(alone, style.RED, style.BLUE), width=0.8)
    axes.axhline(1.0, color=style.GREY, linestyle="--", linewidth=1.0)
    axes.set_xlim(-0.7, len(a) - 0.3)
    axes.grid(axis="x", visible=False)
    size, zeta = mode.columns["amplitude"][point], mode.columns["zeta"][point]
    text = f"a = {scales.amplitudes(mode).text(size)}, ζ = {style.number(100.0 * without_rounding(zeta))} %"
    text = f"{text}, participation {mode.columns['participation'][point]:.2f}"
    axes.annotate(text, (0.99, 0.97), xycoords="axes fraction", ha="right", va="top", fontsize=9.5)


def _waves(axes: Axes, a: Complex) -> None:
    share = np.abs(wave_content(a)) ** 2
    diameters = np.array([folded(k, len(a)) for k in range(len(a))])
    axes.bar(diameters, share / share.sum(), color=np.where(diameters < 0, style.ORANGE, style.GREEN), width=0.8)
    axes.grid(axis="x", visible=False)


def draw_change(mode: Analysis) -> Figure:
    """Participation ratio and amplification along the branch."""
    figure, (upper, lower) = style.new_figure(5.2, rows=2, sharex=True)
    scale = scales.amplitudes(mode)
    amplitude = scale(mode.columns["amplitude"])
    for axes, column in ((upper, "participation"), (lower, "amplification")):
        axes.plot(amplitude, mode.columns[column], ".-", color=style.BLUE, markersize=4)  # no scalars of the branch
    upper.set_ylim(0.0, 1.05)
    upper.set_ylabel("Participation ratio")
    lower.set_ylabel("Amplification")
    for value, text in (
        (1.0, "travelling wave"),
        (2.0 / 3.0, "standing wave"),
        (1.0 / _sectors_of(mode), "one sector"),
    ):
        upper.axhline(value, color=style.GREY, linestyle="--", linewidth=1.0)
        upper.annotate(
            text,
            (1.0, value),
            (-4, 3 if value < 0.5 else -11),
            xycoords=("axes fraction", "data"),
            textcoords="offset points",
            ha="right",
            color=style.GREY,
            fontsize=9,
        )
    style.log_amplitude(lower, amplitude)
    dof = mode.attributes.get("normalise", "")
    lower.set_xlabel(scale.label(f"Modal amplitude of {dof}"))
    return figure


def _sectors_of(mode: Analysis) -> int:
    return int(mode.attributes["sectors"])
