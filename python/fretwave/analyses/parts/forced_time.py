"""Points of a frequency response by direct time integration (paper, circles of figure 7)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Union

import numpy as np

from ...arrays import Array
from ...case.observed import unit_of
from ...mpi.petsc_share import TIME
from ...post.response_peaks import points_around_peak
from ...solve.steady import SteadyState, steady_motion
from ...texts import counted
from .context import AnalysisContext
from .excitation import forces
from .observed import dense
from .whole import integrated_model

if TYPE_CHECKING:
    from ...hb.observed import Observed
    from ...model.model import Model
    from ..forced import ForcedAnalysis


SAMPLES = 64
#: of the time integration: tight enough that results do not depend on the number of ranks beyond 1e-9
TOLERANCE = 1e-10


def time_points(
    context: AnalysisContext[ForcedAnalysis], table: Mapping[str, Any], count: int, observed: Observed
) -> tuple[list[str], str]:
    """Integrate `count` points per level to their steady state and write `<name>_time.csv`. Collective.

    The first point of a level starts from rest, the others from their neighbour's steady state. Columns: level,
    frequency_hz, amplitude, amplitude_hb, relative_difference, periods, steady (0 when it never was).

    Parameters
    ----------
    table : columns of the finished analysis; only rank 0 needs to have them
    observed : whose amplitude is compared

    Returns
    -------
    Lines that say how well they agree, and why a point was given up (empty where none was).
    """
    columns = ("level", "omega", "amplitude")
    numbers = context.comm.bcast({key: np.asarray(table[key]) for key in columns} if context.comm.rank == 0 else None)
    with integrated_model(context) as model:
        rows = list(_integrated(context, model, numbers, count, dense(context.model, observed)))
    stopped = next((str(row["stopped"]) for row in rows if row["stopped"]), "")
    lengths = unit_of(context.analysis.observe)
    context.write_table("time", {key: [row[key] for row in rows] for key in rows[0] if key != "stopped"}, lengths)
    return [f"{context.name}: {_compared(rows)}"], stopped


def _compared(rows: Sequence[Mapping[str, Any]]) -> str:
    """In words: how far both are apart at the points that became steady, where anything moves."""
    unsteady = sum(not row["steady"] for row in rows)
    apart = [abs(row["relative_difference"]) for row in rows if row["steady"]]
    known = [value for value in apart if np.isfinite(value)]
    words = f"amplitude differs by up to {max(known):.1e} (relative)" if known else "no amplitude to compare"
    words += f"; {unsteady} did not become steady" if unsteady else ""
    return f"{counted(len(rows), 'point')} by time integration, {words}"


def _integrated(
    context: AnalysisContext[ForcedAnalysis],
    model: Model,
    table: Mapping[str, Array],
    count: int,
    seen: Union[int, Array],
) -> Iterator[dict[str, Any]]:
    for level in np.unique(table["level"]):
        rows = {key: values[table["level"] == level] for key, values in table.items()}
        state = np.zeros(model.n_dof), np.zeros(model.n_dof)
        for point in points_around_peak(rows["amplitude"], rows["omega"], count):
            omega, expected = float(rows["omega"][point]), float(rows["amplitude"][point])
            found = _steady(context, model, state, seen, float(level), omega)
            state = found.end
            context.console.line(f"{context.name}: level {level:g}, {omega / (2 * np.pi):.5g} Hz in time")
            yield {
                "level": float(level),
                "frequency_hz": omega / (2.0 * np.pi),
                "amplitude": found.amplitude,
                "amplitude_hb": expected,
                "relative_difference": found.amplitude / expected - 1.0 if expected else np.nan,
                "periods": found.periods,
                "steady": int(found.steady),
                "stopped": found.stopped,
            }


def _steady(
    context: AnalysisContext[ForcedAnalysis],
    model: Model,
    state: tuple[Array, Array],
    seen: Union[int, Array],
    level: float,
    omega: float,
) -> SteadyState:
    from ...solve.transient import Transient

    force = {1: np.zeros(model.n_dof, dtype=complex)}
    for name, value in forces(context).items():
        force[1][context.case.dof(name)] = value
    integrator = Transient(model, force=force, level=level, omega=omega, prefix=context.prefix + TIME)
    return steady_motion(integrator, state, seen, omega, SAMPLES, TOLERANCE)
