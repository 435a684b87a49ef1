"""Hysteresis loops of contacts in three dimensions: the pair that dissipates most on each face."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..arrays import AnyArray
from ..model.laws import Role
from ..results.reader import Analysis, Run
from . import style
from .phase_planes import kept_points
from .trajectories import amplitude_name

LEGEND_COLUMNS = 4


def figures(run: Run) -> Iterator[tuple[str, Figure]]:
    """One picture for each such contact of a mode."""
    for mode in run.of_kind("mode"):
        for contact in mode.contacts:
            if mode.reported and mode.components(contact) == 3:
                yield f"{mode.name}_hysteresis_{contact}", draw(mode, contact)


def draw(mode: Analysis, contact: str) -> Figure:
    """Above friction force against tangential displacement, below against normal force; a column per face."""
    points, (scale, unit), force = kept_points(mode), mode.unit_system.of_depths, mode.unit_system("force")
    chosen = busiest(mode, contact, points[-1])
    figure, axes = style.new_figure(7.0, rows=2, columns=len(chosen), sharey=True, squeeze=False)
    for (name, pair), (upper, lower) in zip(chosen.items(), axes.T):
        tangent = _direction(mode, contact, points[-1], pair)
        for point, colour in zip(points, style.shades(len(points))):
            motion = mode.loop(contact, point)
            u, f = (np.append(motion[key][:, :, pair], motion[key][:1, :, pair], axis=0) for key in "uf")
            upper.plot(scale * u[:, 1:] @ tangent, f[:, 1:] @ tangent, color=colour, label=amplitude_name(mode, point))
            lower.plot(f[:, 0], f[:, 1:] @ tangent, color=colour)
        upper.set_title(f"{name}, pair {pair}", fontsize=10.5)
        upper.set_xlabel(style.label("Tangential displacement", unit))
        lower.set_xlabel(style.label("Normal force", force))
        _limits(lower, mode, contact, pair)
    for first in axes[:, 0]:
        first.set_ylabel(style.label("Friction force", force))
    style.legend_outside(figure, axes[0, 0], columns=LEGEND_COLUMNS, title=f"Modal amplitude, {mode.method()}")
    return figure


def _limits(axes: Axes, mode: Analysis, contact: str, pair: int) -> None:
    """Coulomb's limits, where the friction coefficient is known."""
    if contact in mode.placed():
        normal = np.array([0.0, axes.get_xlim()[1]])
        limit = mode.pairs(contact)[Role.FRICTION_COEFFICIENT.value][pair] * normal
        for sign in (1.0, -1.0):
            axes.plot(normal, sign * limit, color=style.GREY, linestyle="--", linewidth=1.0, zorder=1)
        axes.annotate("dashed: friction limit", (0.03, 0.05), xycoords="axes fraction", fontsize=9.5)


def busiest(mode: Analysis, contact: str, point: int) -> dict[str, int]:
    """On each face the pair with the largest work of friction per period."""
    motion = mode.loop(contact, point)
    work = np.abs((motion["f"][:, 1:] * motion["v"][:, 1:]).sum(axis=(0, 1)))
    faces = mode.pairs(contact)["face"] if contact in mode.placed() else np.array([contact] * len(work))
    return {str(name): int(np.argmax(np.where(faces == name, work, -1.0))) for name in dict.fromkeys(faces)}


def _direction(mode: Analysis, contact: str, point: int, pair: int) -> AnyArray:
    """Unit vector (2,) along which the pair slides most."""
    u = mode.loop(contact, point)["u"][:, 1:, pair]
    direction = np.linalg.svd(u - u.mean(axis=0))[2][0]
    return np.asarray(direction * np.sign(direction[np.argmax(np.abs(direction))]))
