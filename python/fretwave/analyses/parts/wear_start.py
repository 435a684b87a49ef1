"""Where the lines of wear begin: unworn points of the mode's branch, and the normalised cycle."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import NotConverged
from ...mpi.destroyable import Owned
from ...mpi.gather import on_all_ranks
from .branch import mode_problem, points_of, step_control
from .context import AnalysisContext
from .rest import retained, start_mode
from .wear_line import wear_areas

if TYPE_CHECKING:
    from ...solve.point import Point
    from ..mode import ModeAnalysis
    from ..wear import WearAnalysis


def unworn_starts(context: AnalysisContext[ModeAnalysis], analysis: WearAnalysis) -> dict[str, Any]:
    """Unknowns at each amplitude by its number, from the mode's branch, and the normalised cycle. Collective."""
    from ...solve.continuation import Continuation
    from ...solve.worn_mode import WornMode

    settings = context.analysis
    stuck, rest = start_mode(context, settings.linear_mode)
    harmonics = retained(context)
    context.leave_out(harmonics.left_out)
    problem = mode_problem(context, harmonics, stuck, rest)
    low, high = min(settings.amplitude[0], *analysis.amplitude), max(settings.amplitude[1], *analysis.amplitude)
    found: dict[str, Any] = {}
    control, reports, areas = step_control(settings.step), sorted(analysis.amplitude), wear_areas(context.case)
    with Owned() as own:
        branch = own(Continuation(own(problem), own(problem.initial(low)), (low, high), control, reports))
        mode = own(WornMode(problem, analysis.coefficient, areas))
        with context.console.progress(context.name):
            for point in points_of(branch):
                if "cycle_unit" not in found:
                    load = mode.measure(point.y, np.zeros(len(mode.areas))).load
                    where = f"analysis '{analysis.name}'"
                    found["cycle_unit"] = mode.cycle_unit(load, analysis.cycles, analysis.cycle_unit, where)
                _take(context, analysis, point, found)
                if len(found) == 1 + 2 * len(analysis.amplitude):
                    own(point)
                    break
        why = branch.reason
    if len(found) < 1 + 2 * len(analysis.amplitude):
        context.console.line(f"{context.name}: the mode ends early: {why}")
    if len(found) < 2:
        raise NotConverged(
            "the mode reaches none of the amplitudes of wear",
            None,
            f"the mode ends early: {why}",
            f"amplitudes {analysis.amplitude}",
            f"lower amplitudes, or shorter steps of the mode (--set {analysis.mode}.step.maximum=0.03)",
        )
    return found


def _take(context: AnalysisContext[ModeAnalysis], analysis: WearAnalysis, point: Point, found: dict[str, Any]) -> None:
    """Keep the unknowns of a point that lies on an amplitude, the first on a branch that folds. Collective."""
    if point.event == "":
        return
    whole = on_all_ranks(context.comm, point.y)
    for number, amplitude in enumerate(analysis.amplitude):
        if math.isclose(point.parameter, amplitude, rel_tol=1e-9) and f"y_{number}" not in found:
            found[f"y_{number}"] = whole
            found[f"outcome_{number}"] = np.array([point.newton, point.linear, point.residual])
