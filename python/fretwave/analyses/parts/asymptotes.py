"""Linear modes at the far end of a backbone: contact free, or closed and sliding."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from ...case.analysis import AnalysisSection
from ...case.harmonic import HarmonicSection
from .context import AnalysisContext

if TYPE_CHECKING:
    from ...model.modes import LinearMode

#: Modes looked through for the one most like the stuck mode, beyond its own number.
MORE_MODES = 2


def other_asymptote(context: AnalysisContext[HarmonicSection], stuck: LinearMode) -> dict[str, float]:
    """Frequency of the linear mode most like the stuck one, without friction. Collective.

    Returns
    -------
    dict
        ``free_omega`` [rad/s]: no contact force at all. For contacts with a normal direction ``sliding_omega``:
        all pairs stay closed and slide without friction; without contact such a structure is often not held. Empty
        without contact.
    """
    if not context.case.contacts:
        return {}
    from ...model.model import Model
    from ...model.modes import linear_modes

    count = min(context.model.n_dof, context.analysis.linear_mode + MORE_MODES)
    if all(contact.components == 1 for contact in context.case.contacts):
        return {"free_omega": omega_most_alike(context, context.linear_mode("free", count), stuck)}
    if context.case.neighbours is not None:
        context.leave_out(["the closed and sliding asymptote (not computed for a sector of a wheel)"])
        return {}
    K = context.case.K + closed_stiffness(context)
    with Model(context.case.M, K, comm=context.comm) as model:
        return {"sliding_omega": omega_most_alike(context, linear_modes(model, count, contact="free"), stuck)}


def closed_stiffness(context: AnalysisContext[AnalysisSection], tangential: bool = False) -> sp.csr_matrix:
    """Stiffness of all pairs closed, on the dofs: sum kn b_n b_n^T, and kt b_t b_t^T when they do not slide."""
    total = sp.csr_matrix(context.case.K.shape)
    for contact in context.case.contacts:
        for row in range(contact.components):
            value = contact.value(contact.info.stiffness_along(row))
            if value is not None and (tangential or row == contact.info.normal):
                rows = contact.pairs.own[row :: contact.components]
                stiffness = np.broadcast_to(value, (contact.n_pairs,))
                total = total + rows.T @ sp.diags(stiffness) @ rows
    return total


def asymptote_line(name: str, stuck: float, other: dict[str, float]) -> str:
    """The asymptotes in one line."""
    words = {"free_omega": "contact free", "sliding_omega": "closed and sliding"}
    texts = [f"stuck {stuck / (2 * math.pi):.6g} Hz"]
    texts += [f"{words[key]} {omega / (2 * math.pi):.6g} Hz" for key, omega in other.items()]
    return f"{name}: asymptotes: {', '.join(texts)}"


def omega_most_alike(
    context: AnalysisContext[AnalysisSection], modes: Sequence[LinearMode], stuck: LinearMode
) -> float:
    """Frequency of the mode most like another [rad/s]."""
    M, wanted = context.case.M, stuck.shape + 1j * stuck.imaginary
    shapes = [mode.shape + 1j * mode.imaginary for mode in modes]
    likeness = [abs(phi.conj() @ (M @ wanted)) / math.sqrt((phi.conj() @ (M @ phi)).real) for phi in shapes]
    return float(modes[int(np.argmax(likeness))].omega)
