"""Linear modes beside the followed one that gain energy by themselves, which its limit cycles may not withstand.

A limit cycle whose damping rises with amplitude is stable in its own amplitude; any other motion that is fed may still
grow out of it. The lowest modes of each linear state of the contact, stuck and without friction, tell of such motions:
the damping and the flow act on the space that they span. Of 34 cycles of random structures with one to three sliders,
integrated in time, those beside a mode that is fed while the contact sticks were left in 9 cases of 22; none of the 12
others was, 4 of them beside modes that are fed without contact alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ...arrays import Complex
from ...case.flow import with_flow
from ...case.harmonic import HarmonicSection, nodal_diameter, with_flow_forces
from ...model.sectors import in_wave
from ...post.limit_cycles import STUCK
from .asymptotes import MORE_MODES, loose_modes, most_like, sector_phase
from .context import AnalysisContext
from .rest import RIGID, stuck_or_no_modes

if TYPE_CHECKING:
    from ...model.modes import LinearMode

#: Damping ratios above this, its sign apart, are more than rounding.
FED = 1e-8


def fed_modes(context: AnalysisContext[HarmonicSection], followed: LinearMode | None) -> list[dict[str, Any]]:
    """Modes of negative damping other than the followed one, if that is of this wave, in each state of the contact.

    Collective.

    Returns
    -------
    list of dict
        mode, its number from 1 in this state and wave; contact: ``stuck``, ``contact free`` or ``sliding``;
        frequency_hz; zeta.
    """
    count = min(context.model.n_dof, context.analysis.linear_mode + MORE_MODES)
    found = []
    states = [(STUCK, stuck_or_no_modes(context, count))]
    if context.case.contacts:
        limit, loose = loose_modes(context, count)
        states.append(("contact free" if limit == "free" else limit, loose))
    for contact, given in states:
        modes = sorted({id(mode): mode for mode in given}.values(), key=lambda mode: mode.omega)  # each once
        first = None
        if followed is not None and modes:
            own = most_like(context, modes, followed, nodal_diameter(context.analysis)).omega
            first = next((number for number, mode in enumerate(modes) if mode.omega == own), None)  # of a double one
        for number, value in _growing(context, modes).items():
            if number != first:
                found.append({"mode": number + 1, "contact": contact, **told(value)})
    return found


def told(value: complex) -> dict[str, float]:
    """What is said of lambda [rad/s]."""
    return {"frequency_hz": abs(value.imag) / (2 * np.pi), "zeta": -value.real / abs(value)}


def _growing(context: AnalysisContext[HarmonicSection], modes: Sequence[LinearMode]) -> dict[int, complex]:
    """lambda of what grows by number of the undamped mode, from 0, that has the largest share in it."""
    if not modes:
        return {}
    values, shares, own = motions(context, modes)
    grows = own & (values.real > FED * np.abs(values))
    found: dict[int, complex] = {}
    for value, share in zip(values[grows], shares[:, grows].T):
        number = int(np.argmax(np.abs(share)))
        found[number] = max(found.get(number, value), value, key=lambda one: float(one.real))
    return dict(sorted(found.items()))


def motions(
    context: AnalysisContext[HarmonicSection], modes: Sequence[LinearMode]
) -> tuple[Complex, Complex, npt.NDArray[np.bool_]]:
    """Eigenvalues on the space of undamped modes, their shares (n, 2 n) of unit size, and which are motions of it.

    The others move in the opposite wave, on one sector, or are conjugates or rigid.
    """
    values, shapes = np.linalg.eig(_companion(context, modes))
    size = np.abs(values)
    shares = shapes[: len(modes)]
    return (
        values,
        shares / np.linalg.norm(shares, axis=0),
        (values.imag >= -FED * size) & (size > RIGID * size.max()),
    )


def shapes_of(modes: Sequence[LinearMode]) -> Complex:
    """Of linear modes, (n_dof, n)."""
    return np.column_stack([mode.shape + 1j * mode.imaginary for mode in modes])


def _companion(context: AnalysisContext[HarmonicSection], modes: Sequence[LinearMode]) -> Complex:
    """First-order matrix of damping and flow on the space of undamped modes, each of unit modal mass there."""
    case, analysis = context.case, context.analysis
    theta = sector_phase(case, nodal_diameter(analysis))
    structure = case.damped(analysis.dampers)
    K, C = structure.K, structure.C
    phi = shapes_of(modes)
    phi /= np.sqrt(np.einsum("ij,ij->j", phi.conj(), in_wave(structure.M, phi, theta)).real)
    stiffness = np.diag([mode.omega**2 for mode in modes]).astype(complex)
    if with_flow_forces(analysis):
        fed, C = with_flow(case, K, C, nodal_diameter(analysis))
        stiffness += phi.conj().T @ (in_wave(fed, phi, theta) - in_wave(K, phi, theta))
    damping = np.zeros_like(stiffness) if C is None else phi.conj().T @ in_wave(C, phi, theta)
    zero = np.zeros_like(stiffness)
    return np.block([[zero, np.eye(len(modes))], [-stiffness, -damping]])
