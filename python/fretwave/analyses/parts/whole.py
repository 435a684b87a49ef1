"""Time integration of small models: whole on every rank."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from ...case.analysis import AnalysisSection
from .context import AnalysisContext

if TYPE_CHECKING:
    from ...model.model import Model

#: A time step of a smaller model is shorter than the messages it takes to share it: two dofs on two ranks took 250
#: times as long as on one. Every rank then integrates the same equations, to the same last digit.
WHOLE_DOFS = 2000


@contextmanager
def integrated_model(context: AnalysisContext[AnalysisSection]) -> Iterator[Model]:
    """The analysis' model for time integration, distributed only when it is large. Collective."""
    if context.comm.size == 1 or context.model.n_dof > WHOLE_DOFS:
        yield context.model
        return
    from mpi4py import MPI

    from ...case.build import build_model

    dampers = context.analysis.acting_dampers(context.case)
    with build_model(context.case, dampers, MPI.COMM_SELF) as model:
        yield model
