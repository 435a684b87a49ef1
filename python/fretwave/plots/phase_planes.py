"""Phase planes of two dofs and hysteresis loops of the contacts at several amplitudes (paper's figure 4)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..arrays import AnyArray
from ..results.analysis import Analysis, motion_of
from ..results.reader import Run
from . import scales, style
from .trajectories import CURVES, FEW_DOFS, about, amplitude_name, from_mean, other_dof, spread


def figures(run: Run) -> Iterator[tuple[str, Figure]]:
    """Per mode analysis one picture of the planes (of a model with few dofs) and one of the loops of each contact."""
    for mode in run.of_kind("mode"):
        if not mode.labels:
            continue
        if len(mode.dofs) <= FEW_DOFS:
            yield f"{mode.name}_phase_planes", planes(mode)
        for contact in mode.contacts:
            if mode.reported and mode.components(contact) == 1:
                yield f"{mode.name}_hysteresis_{contact}", loops(mode, contact)


def planes(mode: Analysis) -> Figure:
    """Velocity against displacement, a column per dof: as they are, and below from the mean over a and a omega."""
    dofs = [mode.normalised_dof(), other_dof(mode)] if len(mode.dofs) > 1 else [0]
    points = spread(mode, CURVES)
    figure, axes = style.new_figure(7.2, rows=2, columns=len(dofs), squeeze=False)
    for dof, (upper, lower) in zip(dofs, axes.T):
        _plane(upper, lower, mode, points, dof)
    style.legend_outside(figure, axes[0, 0], columns=CURVES, title=f"Modal amplitude, {mode.method()}")
    return figure


def _plane(upper: Axes, lower: Axes, mode: Analysis, points: Sequence[int], dof: int) -> None:
    motions = {point: [values[:, dof] for values in motion_of(mode, point)] for point in points}
    unit, name = mode.length_unit(), mode.dofs[dof]
    length = scales.linear(mode.unit_system, unit, *(x for x, _ in motions.values()))
    speed = scales.linear(mode.unit_system, f"{unit}/s" if unit else "", *(v for _, v in motions.values()))
    for point, colour in zip(points, style.shades(len(points))):
        x, v = motions[point]
        a, omega = mode.columns["amplitude"][point], mode.columns["omega"][point]
        upper.plot(length(x), speed(v), color=colour, label=amplitude_name(mode, point))
        lower.plot(from_mean(x) / a, v / (a * omega), color=colour)
    upper.set_xlabel(length.label(f"Displacement of {name}"))
    upper.set_ylabel(speed.label(f"Velocity of {name}"))
    lower.set(xlabel=f"Displacement of {name}{about(mode)} / a", ylabel=f"Velocity of {name} / (a ω)")


def loops(mode: Analysis, contact: str) -> Figure:
    """Force against relative displacement of the pair that works most: as it is, and from their means scaled to one."""
    points = kept_points(mode)
    pair = _busiest(mode, contact, points[-1])
    closed = [_closed(mode, contact, point, pair) for point in points]
    length = scales.linear(mode.unit_system, mode.length_unit(), *(u for u, _ in closed))
    force = scales.linear(mode.unit_system, mode.unit_system("force"), *(f for _, f in closed))
    figure, (left, right) = style.new_figure(4.3, columns=2)
    for point, (u, f), colour in zip(points, closed, style.shades(len(points))):
        left.plot(length(u), force(f), color=colour, label=amplitude_name(mode, point))
        u, f = from_mean(u), from_mean(f)
        right.plot(u / max(np.abs(u).max(), 1e-300), f / max(np.abs(f).max(), 1e-300), color=colour)
    left.set_xlabel(length.label("Relative displacement"))
    left.set_ylabel(force.label("Contact force"))
    swing = f"{about(mode)} / its maximum"
    right.set(xlabel=f"Relative displacement{swing}", ylabel=f"Contact force{swing}")
    title = f"Contact {contact}{'' if pair[1] == 0 else f', pair {pair[1]}'}: modal amplitude, {mode.method()}"
    style.legend_outside(figure, left, columns=CURVES, title=title)
    return figure


def kept_points(mode: Analysis) -> list[int]:
    """Points whose loops were kept, thinned to a readable number."""
    wanted = [p for p in spread(mode, CURVES) if p in mode.reported]
    if len(wanted) >= 3:
        return wanted
    kept = sorted(mode.reported, key=lambda p: float(mode.columns["amplitude"][p]))
    chosen = np.unique(np.linspace(0, len(kept) - 1, min(CURVES, len(kept))).round().astype(int))
    return [kept[i] for i in chosen]


def _busiest(mode: Analysis, contact: str, point: int) -> tuple[int, int]:
    """Component and pair with the largest work per period."""
    motion = mode.loop(contact, point)
    work = np.abs((motion["f"] * motion["v"]).sum(axis=0))
    component, pair = np.unravel_index(int(np.argmax(work)), work.shape)
    return int(component), int(pair)


def _closed(mode: Analysis, contact: str, point: int, where: tuple[int, int]) -> tuple[AnyArray, AnyArray]:
    motion = mode.loop(contact, point)
    u, f = (motion[key][:, where[0], where[1]] for key in ("u", "f"))
    return np.append(u, u[0]), np.append(f, f[0])
