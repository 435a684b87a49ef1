"""What is said of a wave whose frequency is not the one at which the flow's coefficients hold."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Optional

import numpy as np

from ...case.flow import flow_of
from .context import AnalysisContext

if TYPE_CHECKING:
    from ...model.modes import LinearMode

#: Share of its frequency by which a wave may be beside the flow's without a word.
FAR = 0.1
#: Of the largest coefficient, a damping that is none.
ROUNDING = 1e-12


def beside_flow(context: AnalysisContext[Any], mode: LinearMode, diameters: Optional[int]) -> str:
    """Said of a mode where the flow's coefficients hold elsewhere, and how much it damps this wave there and here.

    `diameters` is None for a mode of a mistuned wheel that is of no wave.
    """
    case = context.case.sector or context.case
    section = case.aerodynamics
    if section is None or case.neighbours is None or abs(mode.frequency_hz / section.frequency - 1) <= FAR:
        return ""
    if diameters is None:
        return f" (the flow's forces hold at {section.frequency:g} Hz)"
    flow, sectors = flow_of(case), case.neighbours.sectors
    there, here = (flow.damping(diameters, sectors, omega) for omega in (flow.omega, mode.omega))
    least = ROUNDING * max(abs(L) for L in flow.influence.values()) / flow.omega**2 if flow.influence else np.inf
    times = f": {here / there:.3g} times their damping" if abs(there) > least else ""
    return f" (the flow's forces hold at {section.frequency:g} Hz{times})"
