"""Peaks of a whole wheel's forced response, blade by blade, against the tuned wheel's.

Amplification is the largest peak of any blade over the peak of the tuned wheel under the same force. For one family of
modes, one degree of freedom a blade, waves that are damped alike and no friction it is at most (1 + sqrt(N)) / 2
(Whitehead, J. Mech. Eng. Sci. 8, 1966). A flow damps them unlike, and mistuning then leads the work of the force into
waves that it damps less.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Optional

import numpy as np

from ...arrays import Array
from ...case.observed import dof_of
from ...post.blade_peaks import beyond, blade_tables, whitehead
from ...post.mode_curve import ModeCurve
from ...post.response_peaks import Peak, distance
from ...results.results import AnalysisWriter
from ...texts import plus_minus
from .branch import points_of
from .excitation import Excitation, tuned_excitation
from .wheel_shape import in_every_sector


def blade_by_blade(
    excitation: Excitation, table: Mapping[str, Array], amplitudes: Optional[Array], curves: Mapping[str, ModeCurve]
) -> list[str]:
    """Write the peaks of all blades and of the tuned wheel; a line for each level. Collective.

    Parameters
    ----------
    table, amplitudes : of the finished analysis, (points, N); on other ranks than the writing one None
    curves : backbones that the largest peaks are compared with
    """
    context = excitation.context
    with tuned_excitation(context, excitation.harmonics) as sector:
        tuned = tuned_responses(sector)
    if amplitudes is None:
        return []
    peaks, blades = blade_tables(table, amplitudes, tuned)
    largest = [Peak(2 * np.pi * f, a) for f, a in zip(peaks["frequency_hz"], peaks["amplitude"])]
    for name, curve in curves.items():
        peaks[f"distance_{name}"] = np.array([distance(peak, curve, undamped=False) for peak in largest])
    for suffix, columns in (("peaks", peaks), ("blades", blades), ("tuned", tuned)):
        context.write_table(suffix, columns)
    rows = [{key: float(values[k]) for key, values in peaks.items()} for k in range(len(peaks["level"]))]
    context.entry["peaks"] = rows
    bound = f"{whitehead(context.case.wheel.sectors) if context.case.wheel else np.nan:.3f}"
    bound += " is of waves that the flow damps alike" * excitation.analysis.aerodynamics
    unit = context.units("length")
    more = beyond(table, amplitudes, blades)
    ends = [_at_an_end(more.get(row["level"]), unit) for row in rows]
    return [f"{context.name}: {_line(row, unit)} (Whitehead's bound {bound}){end}" for row, end in zip(rows, ends)]


def _at_an_end(found: Optional[tuple[int, float]], unit: str) -> str:
    """Of a blade that moves more than all peaks where the frequency range ends."""
    if found is None:
        return ""
    return f"; but sector {found[0]} moves {found[1]:.4g} {unit} at an end of the frequency range: its peak is beyond"


def _line(row: Mapping[str, float], unit: str) -> str:
    if not np.isfinite(row["amplitude"]):
        return f"level {row['level']:g}: no peak within the frequency range"
    peak = f"{row['amplitude']:.4g}{plus_minus(row['amplitude_error'])} {unit}"
    largest = f"level {row['level']:g}: largest peak a = {peak} at {row['frequency_hz']:.5g} Hz in sector"
    if not np.isfinite(row["tuned_amplitude"]):
        return f"{largest} {row['sector']:.0f}, and of the tuned wheel no peak within the frequency range"
    return (
        f"{largest} {row['sector']:.0f}, {row['amplification']:.4f} times the tuned {row['tuned_amplitude']:.4g} {unit}"
        f" at {row['tuned_frequency_hz']:.5g} Hz"
    )


def blade_amplitudes(excitation: Excitation, writer: AnalysisWriter) -> Array:
    """Fundamental amplitudes (points, N) [length] of the observed dof in all sectors (writing rank)."""
    labels = excitation.harmonics.labels
    sectors = in_every_sector(excitation.context.case, dof_of(excitation.analysis.observe))
    stored = writer.group["coefficients"][:, sectors, :]
    return np.asarray(np.hypot(stored[:, :, labels.index("1c")], stored[:, :, labels.index("1s")]))


def tuned_responses(excitation: Excitation) -> dict[str, Array]:
    """Responses of the tuned sector at every level: columns level, frequency_hz, amplitude, event. Collective."""
    rows = []
    for level in excitation.analysis.levels:
        problem = excitation.problem(level)
        branch = excitation.branch(problem)
        for point in points_of(branch):
            state = branch.problem.state(point.y)
            rows.append((level, state["frequency_hz"], state["amplitude"], point.event))
        branch.destroy()
        problem.destroy()
    names = ("level", "frequency_hz", "amplitude", "event")
    return {name: np.array(column) for name, column in zip(names, zip(*rows))}
