"""Closed trajectories of a mode in the plane of two dofs, at several amplitudes (paper's figure 2)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from matplotlib.figure import Figure

from ..arrays import AnyArray
from ..results.analysis import Analysis, motion_of
from ..results.reader import Run
from . import scales, style
from .scales import Scale

#: amplitudes in one picture
CURVES = 7
#: up to this number a reader knows each dof by its name
FEW_DOFS = 12


def figures(run: Run) -> Iterator[tuple[str, Figure]]:
    """One picture per mode analysis of a model with at least two dofs, and few."""
    for mode in run.of_kind("mode"):
        if mode.labels and 1 < len(mode.dofs) <= FEW_DOFS:
            yield f"{mode.name}_trajectories", draw(mode)


def draw(mode: Analysis) -> Figure:
    """Left as they are, right from their means and divided by the amplitude: curvature and opening at every level."""
    points = spread(mode, CURVES)
    across, up = mode.normalised_dof(), other_dof(mode)
    motions, scale = displacements(mode, points)
    figure, (left, right) = style.new_figure(4.3, columns=2)
    for point, colour in zip(points, style.shades(len(points))):
        amplitude = mode.columns["amplitude"][point]
        x = motions[point]
        left.plot(scale(x[:, across]), scale(x[:, up]), color=colour, label=amplitude_name(mode, point))
        x = from_mean(x)
        right.plot(x[:, across] / amplitude, x[:, up] / amplitude, color=colour)
    left.set(xlabel=scale.label(f"Displacement of {mode.dofs[across]}"))
    left.set(ylabel=scale.label(f"Displacement of {mode.dofs[up]}"))
    swing = f"{about(mode)} / modal amplitude"
    right.set(xlabel=f"{mode.dofs[across]}{swing}", ylabel=f"{mode.dofs[up]}{swing}")
    style.legend_outside(figure, left, columns=CURVES, title=f"Modal amplitude, {mode.method()}")
    return figure


def displacements(mode: Analysis, points: Sequence[int]) -> tuple[dict[int, AnyArray], Scale]:
    """Of all dofs over a closed period (n, n_dof), by point, and the unit of an axis for them."""
    found = {point: motion_of(mode, point)[0] for point in points}
    return found, scales.linear(mode.unit_system, mode.length_unit(), *found.values())


def from_mean(closed: AnyArray) -> AnyArray:
    """What swings of a closed period (n + 1, ...), without the place that it swings about."""
    return np.asarray(closed - closed[:-1].mean(axis=0))


def about(mode: Analysis) -> str:
    """Beside a dof whose mean is taken off; empty where a mode has no mean."""
    return " from its mean" if "0" in mode.labels else ""


def amplitude_name(mode: Analysis, point: int) -> str:
    """The point's amplitude with its unit."""
    return scales.amplitudes(mode).text(mode.columns["amplitude"][point])


def other_dof(mode: Analysis) -> int:
    """The dof whose motion differs most from the normalised one: where the contact is felt."""
    across = mode.normalised_dof()
    x = from_mean(motion_of(mode, int(np.argmax(mode.columns["zeta"])))[0])
    reference = x[:, across]
    share = x.T @ reference / (reference @ reference)
    rest = np.linalg.norm(x - np.outer(reference, share), axis=0)
    rest[across] = -1.0
    return int(np.argmax(rest))


def spread(mode: Analysis, count: int) -> list[int]:
    """Points at `count` amplitudes: reported ones when there are enough, else even in log amplitude."""
    amplitude = mode.columns["amplitude"]
    reported = mode.met("report")
    pool = np.array(reported if len(reported) >= 3 else range(len(mode)))
    if len(pool) <= count:
        return sorted(pool.tolist(), key=lambda i: float(amplitude[i]))
    wanted = np.linspace(np.log(amplitude[pool].min()), np.log(amplitude[pool].max()), count)
    nearest = [int(pool[np.argmin(np.abs(np.log(amplitude[pool]) - value))]) for value in wanted]
    return sorted(set(nearest), key=lambda i: float(amplitude[i]))
