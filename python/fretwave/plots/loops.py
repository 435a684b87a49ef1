"""Hysteresis loops of contacts in three dimensions: the pair that dissipates most on each face."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..arrays import AnyArray
from ..model.law_info import Role
from ..results.analysis import Analysis
from ..results.reader import Run
from . import scales, style
from .phase_planes import kept_points
from .scales import Scale
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
    points = kept_points(mode)
    chosen = busiest(mode, contact, points[-1])
    length, force = _scales(mode, contact, points, list(chosen.values()))
    figure, axes = style.new_figure(7.0, rows=2, columns=len(chosen), sharey=True, squeeze=False)
    for (name, pair), (upper, lower) in zip(chosen.items(), axes.T):
        tangent = _direction(mode, contact, points[-1], pair)
        for point, colour in zip(points, style.shades(len(points))):
            motion = mode.loop(contact, point)
            u, f = (np.append(motion[key][:, :, pair], motion[key][:1, :, pair], axis=0) for key in "uf")
            normal, friction = force(f[:, 0]), force(f[:, 1:] @ tangent)
            upper.plot(length(u[:, 1:] @ tangent), friction, color=colour, label=amplitude_name(mode, point))
            lower.plot(normal, friction, color=colour)
        upper.set_title(f"{name}, pair {pair}", fontsize=10.5)
        upper.set_xlabel(length.label("Tangential displacement"))
        lower.set_xlabel(force.label("Normal force"))
        _limits(lower, mode, contact, pair)
    for first in axes[:, 0]:
        first.set_ylabel(force.label("Friction force"))
    style.legend_outside(figure, axes[0, 0], columns=LEGEND_COLUMNS, title=f"Modal amplitude, {mode.method()}")
    return figure


def _scales(mode: Analysis, contact: str, points: Sequence[int], pairs: Sequence[int]) -> tuple[Scale, Scale]:
    """Of the tangential displacements and of the forces of some pairs, the same on all axes."""
    motions, units = [mode.loop(contact, point) for point in points], mode.unit_system
    u, f = ([motion[key][:, :, list(pairs)] for motion in motions] for key in "uf")
    length = scales.linear(units, units("length"), *(one[:, 1:] for one in u))
    return length, scales.linear(units, units("force"), *f)


def _limits(axes: Axes, mode: Analysis, contact: str, pair: int) -> None:
    """Coulomb's limits, where the friction coefficient is known."""
    coefficient = mode.parameter(contact, Role.FRICTION_COEFFICIENT)
    if coefficient is None and contact in mode.placed():
        coefficient = mode.pairs(contact)[Role.FRICTION_COEFFICIENT.value]
    if coefficient is None:
        return
    normal = np.array([0.0, axes.get_xlim()[1]])
    limit = np.resize(coefficient, pair + 1)[pair] * normal  # one for all pairs, or the same in each sector
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
