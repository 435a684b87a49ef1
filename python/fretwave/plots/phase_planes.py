"""Phase planes of two dofs and hysteresis loops of the contacts at several amplitudes (paper's figure 4)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..arrays import AnyArray
from ..results.reader import Analysis, Run, motion_of
from . import style
from .trajectories import CURVES, FEW_DOFS, amplitude_name, other_dof, spread


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
    """Velocity against displacement, a column per dof: as they are, and below divided by a and a omega."""
    dofs = [mode.normalised_dof(), other_dof(mode)] if len(mode.dofs) > 1 else [0]
    points = spread(mode, CURVES)
    figure, axes = style.new_figure(7.2, rows=2, columns=len(dofs), squeeze=False)
    for dof, (upper, lower) in zip(dofs, axes.T):
        _plane(upper, lower, mode, points, dof)
    style.legend_outside(figure, axes[0, 0], columns=CURVES, title=f"Modal amplitude, {mode.method()}")
    return figure


def _plane(upper: Axes, lower: Axes, mode: Analysis, points: Sequence[int], dof: int) -> None:
    for point, colour in zip(points, style.shades(len(points))):
        x, v = motion_of(mode, point)
        a, omega = mode.columns["amplitude"][point], mode.columns["omega"][point]
        upper.plot(x[:, dof], v[:, dof], color=colour, label=amplitude_name(mode, point))
        lower.plot(x[:, dof] / a, v[:, dof] / (a * omega), color=colour)
    unit, name = mode.length_unit(), mode.dofs[dof]
    upper.set_xlabel(style.label(f"Displacement of {name}", unit))
    upper.set_ylabel(style.label(f"Velocity of {name}", f"{unit}/s" if unit else ""))
    lower.set(xlabel=f"Displacement of {name} / a", ylabel=f"Velocity of {name} / (a ω)")


def loops(mode: Analysis, contact: str) -> Figure:
    """Force against relative displacement of the pair that dissipates most: as it is, and both scaled to one."""
    points = kept_points(mode)
    pair = _busiest(mode, contact, points[-1])
    figure, (left, right) = style.new_figure(4.3, columns=2)
    for point, colour in zip(points, style.shades(len(points))):
        u, f = _closed(mode, contact, point, pair)
        left.plot(u, f, color=colour, label=amplitude_name(mode, point))
        right.plot(u / np.abs(u).max(), f / max(np.abs(f).max(), 1e-300), color=colour)
    left.set_xlabel(style.label("Relative displacement", mode.length_unit()))
    left.set_ylabel(style.label("Contact force", mode.unit_system("force")))
    right.set(xlabel="Relative displacement / its maximum", ylabel="Contact force / its maximum")
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
