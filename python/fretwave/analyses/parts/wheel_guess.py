"""First guess of a travelling wave on a tuned wheel: the way up from stick is taken on one sector."""

from __future__ import annotations

from typing import TYPE_CHECKING, Optional

from ...case.harmonic import nodal_diameter
from ...case.observed import dof_of
from ...mpi.destroyable import Owned
from .branch import mode_problem, step_control
from .rest import rest_state, retained
from .tuned import tuned_sector

if TYPE_CHECKING:
    from petsc4py import PETSc

    from ...hb.nonlinear_mode import NonlinearMode
    from ..mode import ModeAnalysis
    from .context import AnalysisContext
    from .wheel_start import Start


def from_one_sector(
    context: AnalysisContext[ModeAnalysis], problem: NonlinearMode, start: Start
) -> Optional[PETSc.Vec]:
    """Unknowns of the wheel where one sector's branch begins. Collective.

    Returns
    -------
    Vec or None
        None where the sectors do not all move alike (a standing wave, a mistuned wheel), and where that branch does not
        begin: the wheel looks for its own first point then.
    """
    analysis = context.analysis
    if start.tuned is None or context.wheel.deviations is not None or analysis.wave == "standing":
        return None
    with tuned_sector(context) as tuned:
        tuned = tuned.of(analysis.model_copy(update={"name": f"{analysis.name}_sector"}))
        rest, dof = rest_state(tuned), context.tuned.dof(dof_of(analysis.normalise))
        harmonics = retained(tuned)
        if harmonics.orders != problem.harmonics.orders:
            return None
        one = mode_problem(tuned, harmonics, start.tuned, rest, dof)
        try:
            return _unfolded(context, problem, one)
        finally:
            one.destroy()


def _unfolded(
    context: AnalysisContext[ModeAnalysis], problem: NonlinearMode, one: NonlinearMode
) -> Optional[PETSc.Vec]:
    from ...cyclic.around_wheel import around_wheel
    from ...solve.continuation import Continuation

    analysis = context.analysis
    low, high = analysis.amplitude
    with Owned() as own:
        branch = own(Continuation(one, own(one.initial(low)), (low, high), step_control(analysis.step)))
        point = next(branch, None)
        y = None if point is None else around_wheel(problem, one, own(point).y, nodal_diameter(analysis))
        if branch.started:
            context.console.line(f"{context.name}: started: on one sector {branch.started}")
        return y
