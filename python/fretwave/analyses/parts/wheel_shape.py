"""What a motion of a whole wheel looks like around the wheel, in numbers.

The numbers are those of `fretwave.cyclic.wheel_shape`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ...arrays import Complex
from ...case.observed import dof_of
from ...columns import Column
from ...cyclic.engine_order import folded
from ...cyclic.wheel_shape import WheelShape as Shape
from ...post.motion import complex_amplitudes
from ...post.wave_content import phases, wave_content
from .context import AnalysisContext

if TYPE_CHECKING:
    from petsc4py import PETSc

    from ...case.analysis import AnalysisSection
    from ...case.case import Case
    from ...hb.nonlinear_mode import NonlinearMode
    from ...model.modes import LinearMode
    from ...results.results import AnalysisWriter
    from ..mode import ModeAnalysis
    from .wheel_start import Start


#: So many folds within this share of one amplitude are those of single sectors.
MANY_FOLDS, SAME_AMPLITUDE = 8, 0.01

WHEEL = (
    Column("amplification", "1", "largest amplitude of a sector over that of the tuned wave of the same energy"),
    Column("participation", "1", "participation ratio of the sectors"),
    Column("largest_sector", "1", "sector that moves most", "i"),
    Column("diameters", "1", "nodal diameters of the largest wave, negative backward", "i"),
    Column("diameters_share", "1", "share of the largest wave in the sum of squares"),
    Column("unfolding", "1", "force on the avoided mode of a double one over the inertia force"),
)


#: Participation ratio above which all sectors move alike, to rounding: amplitudes differ by 1e-6 of themselves.
ALIKE = 1 - 1e-12
#: Deviations of sectors that differ by less hardly part the two modes of a double one.
NEARLY_TUNED = 1e-6
#: A force on the avoided mode above this share of the inertia force is no rounding.
HELD = 1e-8


class WheelShape:
    """The columns :data:`WHEEL` of a table.

    Parameters
    ----------
    context
        Of an analysis on a wheel.
    dof : str
        Observed in each sector.
    tuned_amplitude : float
        Of that dof in each sector, in the tuned travelling wave of unit modal mass.
    mode : LinearMode
        The problem's start.
    """

    def __init__(
        self, context: AnalysisContext[AnalysisSection], dof: str, tuned_amplitude: float, mode: LinearMode
    ) -> None:
        M = context.case.M
        self.shape = Shape(M, context.wheel.sectors, context.tuned.dof(dof), tuned_amplitude)
        self.places = context.case.places(dof)
        phi = mode.shape + 1j * mode.imaginary
        # what forces are measured in, per displacement (`reference_stiffness` of the core)
        self.stiffness = mode.omega**2 * np.real(phi.conj() @ (M @ phi)) / np.linalg.norm(phi) ** 2

    def row(self, problem: NonlinearMode, y: PETSc.Vec) -> dict[str, Any]:
        """Of one point. Collective."""
        unfolding, state = problem.unfolding(y), problem.state(y)
        labels, model = problem.harmonics.labels, problem.model
        q = complex_amplitudes(labels, problem.local_coefficients(y))[1]  # this rank's
        a = complex_amplitudes(labels, problem.coefficients_at(y, self.places))[1]
        Mq = model.local_inertia(q)
        square, modal = model.comm.allreduce(np.array([np.linalg.norm(Mq) ** 2, np.vdot(q, Mq).real]))
        held = self.stiffness * state["amplitude"] / (state["omega0"] ** 2 * np.sqrt(square))
        told = self.shape.told(a, float(modal))
        return {**told, "unfolding": float(held * np.linalg.norm(unfolding))}


def finish_wheel(context: AnalysisContext[ModeAnalysis], writer: AnalysisWriter, start: Start) -> list[str]:
    """Keep what the branch says of the wheel in run.json and in two tables; lines to print. One rank writes.

    ``<name>_sectors.csv`` has the amplitude and phase of the observed dof in every sector, ``<name>_diameters.csv`` the
    share of every wave, both at the points with an event.
    """
    if not writer.active or not writer.rows:
        return []
    points = {column.name: writer.group["points"][column.name][()] for column in writer.columns}
    where = np.flatnonzero([bool(text) for text in points["event"]])
    a = _sector_amplitudes(context, writer, where)
    n = a.shape[1]
    shared = {"point": np.repeat(points["point"][where], n), "amplitude": np.repeat(points["amplitude"][where], n)}
    sector = {"sector": np.tile(np.arange(n), len(where)), "sector_amplitude": np.abs(a).ravel()}
    context.write_table("sectors", {**shared, **sector, "phase": phases(a).ravel()})
    content = np.abs(wave_content(a)) ** 2
    diameters = np.tile([folded(k, n) for k in range(n)], len(where))
    share = content / content.sum(axis=1, keepdims=True)
    context.write_table("diameters", {**shared, "nodal_diameter": diameters, "share": share.ravel()})
    deviations = context.wheel.deviations
    assert start.tuned is not None
    context.entry["wheel"] = {
        "sectors": n,
        "normalise": start.attributes["normalise"],
        "deviations": None if deviations is None else deviations.tolist(),
        "tuned_frequency_hz": start.tuned.frequency_hz,
        "start_frequency_hz": start.mode.frequency_hz,
        "largest_amplification": float(points["amplification"].max()),
        "smallest_participation": float(points["participation"].min()),
        "largest_unfolding": float(points["unfolding"].max()) if start.avoid is not None else None,
    }
    return _lines(context.name, points, start, context.units("length"))


def in_every_sector(case: Case, dof: str) -> slice:
    """Rows of a wheel's coefficients that are one dof's, as HDF5 reads them at once."""
    places = case.places(dof)
    return slice(places[0], places[-1] + 1, places[1] - places[0])


def _sector_amplitudes(
    context: AnalysisContext[ModeAnalysis], writer: AnalysisWriter, points: npt.NDArray[np.intp]
) -> Complex:
    """Of the observed dof at some points, (points, N), from the coefficients written."""
    sectors = in_every_sector(context.case, dof_of(context.analysis.normalise))
    group = writer.group
    labels = [text.decode() for text in group["harmonic"][()]]
    kept = [group["coefficients"][int(point), sectors] for point in points]
    return np.array([complex_amplitudes(labels, Q)[1] for Q in kept])


def _lines(name: str, points: dict[str, Any], start: Start, unit: str) -> list[str]:
    lines = []
    shown = [0, *np.flatnonzero(points["event"] == b"report").tolist(), len(points["point"]) - 1]
    for k in dict.fromkeys(shown):
        lines.append(
            f"{name}: at a = {points['amplitude'][k]:.4g} {unit} amplification {points['amplification'][k]:.4g},"
            f" participation ratio {points['participation'][k]:.4g}, {_largest(points, k)},"
            f" {100 * points['diameters_share'][k]:.3g} % is the wave of {points['diameters'][k]} nodal diameters"
        )
    if start.avoid is not None:
        force = float(points["unfolding"].max())
        text = f"{name}: force on the avoided mode at most {force:.1e} of the inertia force"
        held = ": not quite a free motion, it holds the wave in its place (the sector is no mirror image of itself)"
        lines.append(text + (held if force > HELD else ""))
    return lines


def _largest(points: dict[str, Any], k: int) -> str:
    return (
        "all sectors alike"
        if points["participation"][k] > ALIKE
        else f"sector {points['largest_sector'][k]} moves most"
    )


def one_by_one(table: dict[str, Any], unit: str) -> str:
    """Advice on a branch that folds again and again at one amplitude; empty when it does not.

    A friction contact whose force falls steeply where slip begins is bistable there. In a wave that runs all sectors
    pass the fold together. Where sectors of almost equal amplitude pass it one after another there are up to 2^n
    solutions between, and the branch goes through many of them: that is the physics of the case, not a failure.
    """
    folds = table["amplitude"][["fold" in event.split() for event in table["event"]]]
    if len(folds) < MANY_FOLDS:
        return ""
    middle = float(np.median(folds))
    near = int(np.count_nonzero(np.abs(folds / middle - 1) < SAME_AMPLITUDE))
    if near < MANY_FOLDS:
        return ""
    return (
        f"{near} folds lie within {100 * SAME_AMPLITUDE:g} % of a = {middle:.4g} {unit}: sectors that move almost alike"
        " begin to slip one after another, each with a fold of its own; begin above this amplitude, deviate more, or"
        " follow a travelling wave"
    )


def nearly_tuned(deviations: npt.NDArray[np.float64] | None) -> str:
    """Advice on a branch of a wheel whose given deviations leave its modes double; empty where they do not.

    The equations of a tuned wheel hold its double modes apart by a force that comes out as zero; those of a mistuned
    one do not, and every combination of two waves is a mode of theirs while the contact sticks.
    """
    if deviations is None or np.ptp(deviations) >= NEARLY_TUNED:
        return ""
    return (
        "remove `mistuning`, for a wave of the tuned wheel (wave = ...): deviations differ by"
        f" {np.ptp(deviations):.1g}, and modes that are double are no one branch; or deviate more"
    )
