"""A model without the forces of the flow, and what these would do to a static displacement."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...arrays import Array
from ...case.analysis import AnalysisSection
from ...case.flow import with_flow
from ...case.harmonic import nodal_diameter
from ...model.sectors import in_wave
from .context import AnalysisContext

if TYPE_CHECKING:
    from ...model.model import Model


def still_model(context: AnalysisContext[AnalysisSection]) -> Model:
    """That of an analysis without the flow, which the caller closes. Collective."""
    from ...case.build import build_model

    case, analysis = context.case, context.analysis
    dampers, preload = analysis.acting_dampers(case), case.preload_of(analysis)
    return build_model(case, dampers, context.comm, preload, nodal_diameter(analysis))


def held_by_flow(context: AnalysisContext[AnalysisSection], displacement: Array) -> Array:
    """Load (n_dof,) that balances the stiffness of the flow under a displacement of all sectors alike."""
    structure = context.case.structure
    fed, _ = with_flow(context.case, structure.K, None, nodal_diameter(context.analysis))
    added = in_wave(fed, displacement, 0.0) - in_wave(structure.K, displacement, 0.0)
    return np.ascontiguousarray(added.real)
