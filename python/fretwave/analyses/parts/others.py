"""What else grows beside a stable limit cycle: modes of its own wave, or of the whole wheel."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from ...arrays import Complex
from ...case.harmonic import HarmonicSection, nodal_diameter
from ...cyclic.engine_order import folded
from ...errors import FretwaveError
from ...post.largest import largest
from ...post.limit_cycles import STUCK
from .context import AnalysisContext
from .fed_modes import FED, fed_modes, motions, shapes_of, told
from .tuned import in_waves

if TYPE_CHECKING:
    from ...model.modes import LinearMode
    from .wheel_start import Start


def with_others(fed: Callable[[], list[dict[str, Any]]], cycles: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Limit cycles, to stable ones added `fed`, the modes beside theirs that gain energy. Collective.

    Where modes are not to be had, `not_looked_at` says why.
    """
    if not any(cycle["stable"] for cycle in cycles):
        return list(cycles)
    try:
        added: dict[str, Any] = {"fed": fed()}
    except FretwaveError as error:  # on all ranks
        added = {"not_looked_at": error.what}
    return [{**cycle, **(added if cycle["stable"] else {})} for cycle in cycles]


def fed_beside(context: AnalysisContext[HarmonicSection], start: Start, first: complex) -> list[dict[str, Any]]:
    """Modes that gain energy beside the one of `start`, as `fed_modes` gives them; of a wheel with their `diameters`.

    Collective.

    Parameters
    ----------
    first : lambda at the first point of the branch [rad/s]
    """
    if context.case.wheel is None:
        return fed_modes(context, start.mode)
    return _on_tuned(context, start) if context.wheel.deviations is None else _on_mistuned(context, start.mode, first)


def _on_tuned(context: AnalysisContext[HarmonicSection], start: Start) -> list[dict[str, Any]]:
    """Wave by wave, each on one sector. Collective."""
    found, sectors = [], context.wheel.sectors
    own = folded(nodal_diameter(context.analysis), sectors)
    for wave, sector in in_waves(context, sorted(folded(k, sectors) for k in range(sectors))):
        followed = start.tuned if wave == own else None
        found += [{**mode, "diameters": wave} for mode in fed_modes(sector, followed)]
    return found


def _on_mistuned(
    context: AnalysisContext[HarmonicSection], followed: LinearMode, first: complex
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
    alike = np.abs(shares.conj().T @ (phi.conj().T @ (M @ (followed.shape + 1j * followed.imaginary))))
    grows = own & (values.real > FED * np.abs(values))
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
