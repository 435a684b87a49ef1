"""Linear modes beside the followed one that gain energy by themselves, which its limit cycles may not withstand.

A limit cycle whose damping rises with amplitude is stable in its own amplitude; any other motion that is fed may still
grow out of it. The lowest modes of each linear state of the contact, stuck and without friction, tell of such motions:
the damping and the flow act on the space that they span. Of 34 cycles of random structures with one to three sliders,
integrated in time, those beside a mode that is fed while the contact sticks were left in 9 cases of 22; none of the 12
others was, 4 of them beside modes that are fed without contact alone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ...arrays import Complex
from ...case.flow import with_flow
from ...case.harmonic import HarmonicSection, nodal_diameter, with_flow_forces
from ...case.observed import dof_of
from ...cyclic.engine_order import folded
from ...errors import FretwaveError
from ...model.sectors import in_wave
from ...post.limit_cycles import STUCK
from ...post.wave_content import largest, wave_content
from .asymptotes import MORE_MODES, loose_modes, most_like, sector_phase
from .context import AnalysisContext
from .rest import RIGID, stuck_or_no_modes

if TYPE_CHECKING:
    from ...model.modes import LinearMode

#: Damping ratios above this, its sign apart, are more than rounding.
FED = 1e-8


def with_others(
    context: AnalysisContext[HarmonicSection], followed: Callable[[], LinearMode], cycles: Sequence[dict[str, Any]]
) -> list[dict[str, Any]]:
    """Limit cycles, to stable ones added `fed`, the modes beside theirs that gain energy. Collective.

    `followed` gives the linear mode of theirs. Where modes are not to be had, `not_looked_at` says why.
    """
    if not any(cycle["stable"] for cycle in cycles):
        return list(cycles)
    look = fed_modes if context.case.wheel is None else fed_waves
    try:
        added: dict[str, Any] = {"fed": look(context, followed())}
    except FretwaveError as error:  # on all ranks
        added = {"not_looked_at": error.what}
    return [{**cycle, **(added if cycle["stable"] else {})} for cycle in cycles]


def fed_modes(context: AnalysisContext[HarmonicSection], followed: LinearMode) -> list[dict[str, Any]]:
    """Modes of negative damping other than the followed one, in each state of the contact. Collective.

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
        own = most_like(context, modes, followed, nodal_diameter(context.analysis)).omega if modes else 0.0
        first = next((number for number, mode in enumerate(modes) if mode.omega == own), None)  # of a double one
        for number, value in _growing(context, modes).items():
            if number != first:
                zeta, frequency = -value.real / abs(value), abs(value.imag) / (2 * np.pi)
                found.append({"mode": number + 1, "contact": contact, "frequency_hz": frequency, "zeta": zeta})
    return found


def fed_waves(context: AnalysisContext[HarmonicSection], followed: LinearMode) -> list[dict[str, Any]]:
    """The same of a whole wheel whose contact sticks, of the families up to the followed one and the next. Collective.

    Returns
    -------
    list of dict
        diameters, of the wave with the largest share in the motion of the observed dof, negative backward; contact;
        frequency_hz; zeta.
    """
    from ...model.modes import factor_fits

    if not factor_fits(context.model):
        raise FretwaveError("a factor of the wheel does not fit the memory")
    sectors, number = context.wheel.sectors, context.analysis.linear_mode
    family = number if context.analysis.nodal_diameter is not None else -(-number // sectors)  # else one of all modes
    modes = context.linear_mode(STUCK, min(context.model.n_dof, sectors * (family + 1)))
    values, shares, own = _motions(context, modes)
    M, phi = context.case.M, _shapes(modes)
    alike = np.abs(shares.conj().T @ (phi.conj().T @ (M @ (followed.shape + 1j * followed.imaginary))))
    grows = own & (values.real > FED * np.abs(values))
    grows[np.argmax(np.where(own, alike, -1.0))] = False
    observed = context.analysis.observed()
    assert observed is not None
    places = context.case.places(dof_of(observed[1]))
    found = []
    for value, motion in zip(values[grows], (phi[places] @ shares[:, grows]).T):
        wave = folded(largest(np.abs(wave_content(motion))), sectors)
        zeta, frequency = -value.real / abs(value), abs(value.imag) / (2 * np.pi)
        found.append({"diameters": wave, "contact": STUCK, "frequency_hz": frequency, "zeta": zeta})
    return found


def _growing(context: AnalysisContext[HarmonicSection], modes: Sequence[LinearMode]) -> dict[int, complex]:
    """lambda of what grows by number of the undamped mode, from 0, that has the largest share in it."""
    if not modes:
        return {}
    values, shares, own = _motions(context, modes)
    grows = own & (values.real > FED * np.abs(values))
    found: dict[int, complex] = {}
    for value, share in zip(values[grows], shares[:, grows].T):
        number = int(np.argmax(np.abs(share)))
        found[number] = max(found.get(number, value), value, key=lambda one: float(one.real))
    return dict(sorted(found.items()))


def _motions(
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


def _shapes(modes: Sequence[LinearMode]) -> Complex:
    """(n_dof, n)"""
    return np.column_stack([mode.shape + 1j * mode.imaginary for mode in modes])


def _companion(context: AnalysisContext[HarmonicSection], modes: Sequence[LinearMode]) -> Complex:
    """First-order matrix of damping and flow on the space of undamped modes, each of unit modal mass there."""
    case, analysis = context.case, context.analysis
    theta = sector_phase(case, nodal_diameter(analysis))
    structure = case.damped(analysis.dampers)
    K, C = structure.K, structure.C
    phi = _shapes(modes)
    phi /= np.sqrt(np.einsum("ij,ij->j", phi.conj(), in_wave(structure.M, phi, theta)).real)
    stiffness = np.diag([mode.omega**2 for mode in modes]).astype(complex)
    if with_flow_forces(analysis):
        fed, C = with_flow(case, K, C, nodal_diameter(analysis))
        stiffness += phi.conj().T @ (in_wave(fed, phi, theta) - in_wave(K, phi, theta))
    damping = np.zeros_like(stiffness) if C is None else phi.conj().T @ in_wave(C, phi, theta)
    zero = np.zeros_like(stiffness)
    return np.block([[zero, np.eye(len(modes))], [-stiffness, -damping]])
