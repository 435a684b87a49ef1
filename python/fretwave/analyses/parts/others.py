"""What else grows beside a stable limit cycle or a steady response: modes of its own wave, or of the whole wheel."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Optional

import numpy as np
import scipy.sparse as sp

from ...arrays import Complex
from ...case.harmonic import HarmonicSection, nodal_diameter
from ...cyclic.engine_order import folded
from ...errors import FretwaveError
from ...post.largest import largest
from ...post.limit_cycles import STUCK, others
from .context import AnalysisContext
from .fed_modes import FED, fed_modes, motions, shapes_of, told
from .tuned import in_waves

if TYPE_CHECKING:
    from ...model.modes import LinearMode
    from .wheel_start import Start


#: Rows of a damping matrix up to which all its eigenvalues are asked for.
DENSE = 1000
#: Of its largest entry, an eigenvalue that is none.
ROUNDING = 1e-12


def with_others(fed: Callable[[], list[dict[str, Any]]], cycles: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Limit cycles, to stable ones added `fed`, the modes beside theirs that gain energy. Collective."""
    if not any(cycle["stable"] for cycle in cycles):
        return list(cycles)
    added = found_of(fed)
    return [{**cycle, **(added if cycle["stable"] else {})} for cycle in cycles]


def found_of(fed: Callable[[], list[dict[str, Any]]]) -> dict[str, Any]:
    """`fed`, modes that gain energy or, where they are not to be had, `not_looked_at`, which says why. Collective."""
    try:
        return {"fed": fed()}
    except FretwaveError as error:  # on all ranks
        return {"not_looked_at": error.what}


def fed_beside(context: AnalysisContext[HarmonicSection], start: Start, first: complex) -> list[dict[str, Any]]:
    """Modes that gain energy beside the one of `start`, as `fed_modes` gives them; of a wheel with their `diameters`.

    Collective.

    Parameters
    ----------
    first : lambda at the first point of the branch [rad/s]
    """
    if context.case.wheel is None:
        return fed_modes(context, start.mode)
    if context.wheel.deviations is None:
        return _on_tuned(context, start.tuned)
    return _on_mistuned(context, start.mode, first)


def fed_under_force(context: AnalysisContext[HarmonicSection]) -> list[str]:
    """A line of the modes that gain energy by themselves, beside which steady responses may not last; often none.

    Sought where something may feed them: the flow, or dampers. Collective.
    """
    C = context.case.damping_with(context.analysis.dampers)
    if not (context.analysis.aerodynamics or (C is not None and _may_feed(C))):
        return []
    found = found_of(lambda: _of_any_wave(context))
    context.entry.update(found)
    told = others(found.get("fed", []), found.get("not_looked_at", ""))
    return [f"whether the responses are stable is not known{told}"] if told else []


def in_other_waves(analysis: HarmonicSection, what: str) -> list[str]:
    """What an analysis of one sector leaves out under the flow, which acts in its own wave alone."""
    one_wave = analysis.aerodynamics and not analysis.wheel
    return [f"stability of {what} against waves of other nodal diameters"] if one_wave else []


def _may_feed(C: sp.spmatrix) -> bool:
    """Whether x^T C x is below zero for some x; of large matrices, for one dof."""
    if C.diagonal().min() < 0 or C.shape[0] > DENSE:
        return bool(C.diagonal().min() < 0)
    dense = C.toarray()
    return bool(np.linalg.eigvalsh((dense + dense.T) / 2)[0] < -ROUNDING * abs(dense).max())


def _of_any_wave(context: AnalysisContext[HarmonicSection]) -> list[dict[str, Any]]:
    """Modes that gain energy: of a sector in its wave. Collective."""
    if context.case.wheel is None:
        return fed_modes(context, None)
    return _on_tuned(context) if context.wheel.deviations is None else _on_mistuned(context)


def _on_tuned(context: AnalysisContext[HarmonicSection], tuned: Optional[LinearMode] = None) -> list[dict[str, Any]]:
    """Wave by wave, each on one sector, but the followed mode of its own. Collective."""
    found, sectors = [], context.wheel.sectors
    own = folded(nodal_diameter(context.analysis), sectors)
    for wave, sector in in_waves(context, sorted(folded(k, sectors) for k in range(sectors))):
        followed = tuned if wave == own else None
        found += [{**mode, "diameters": wave} for mode in fed_modes(sector, followed)]
    return found


def _on_mistuned(
    context: AnalysisContext[HarmonicSection], followed: Optional[LinearMode] = None, first: complex = 0j
) -> list[dict[str, Any]]:
    """On all sectors, with contact that sticks: of the families up to the followed one and the next. Collective.

    Their `diameters` are those of the largest wave, negative backward. A standing shape has as much of the forward
    wave as of the backward one: of those most like it the branch's own motion is the one that moves as it begins.
    """
    from ...model.modes import factor_fits

    if not factor_fits(context.model):
        raise FretwaveError("a factor of the wheel does not fit the memory")
    sectors, number = context.wheel.sectors, context.analysis.linear_mode
    family = number if context.analysis.nodal_diameter is not None else -(-number // sectors)  # else one of all modes
    modes = context.linear_mode(STUCK, min(context.model.n_dof, sectors * (family + 1)))
    values, shares, own = motions(context, modes)
    M, phi = context.case.M, shapes_of(modes)
    grows = own & (values.real > FED * np.abs(values))
    if followed is not None:
        alike = np.abs(shares.conj().T @ (phi.conj().T @ (M @ (followed.shape + 1j * followed.imaginary))))
        like = own & (alike > 0.5 * alike[own].max())
        grows[np.argmin(np.where(like, np.abs(values - first), np.inf))] = False
    return [
        {"diameters": _largest_wave(context, motion), "contact": STUCK, **told(value)}
        for value, motion in zip(values[grows], (phi @ shares[:, grows]).T)
    ]


def _largest_wave(context: AnalysisContext[HarmonicSection], motion: Complex) -> int:
    """Nodal diameters of the wave with the largest share in the kinetic energy of a motion (N n_dof,)."""
    waves = np.fft.ifft(context.wheel.by_sector(motion), axis=0)
    M = sp.csr_matrix(context.tuned.M)
    share = np.array([np.real(c.conj() @ (M @ c)) for c in waves])
    return folded(largest(share), context.wheel.sectors)
