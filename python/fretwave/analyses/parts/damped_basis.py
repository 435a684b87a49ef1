"""Modes of one frequency in the basis that their damping chooses: to first order these are the damped modes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Optional

import numpy as np

from ...arrays import AnyArray, Indices
from ...model.sectors import Term, in_wave
from .asymptotes import planes_of

if TYPE_CHECKING:
    from ...model.modes import LinearMode

#: Of the largest entry of phi* C phi: what is smaller is rounding.
ROUNDING = 1e-9


def in_damped_basis(modes: Sequence[LinearMode], C: Optional[Term], theta: float = 0.0) -> list[LinearMode]:
    """The same modes, those of one frequency turned so that phi* C phi is diagonal, the least damped first.

    Degenerate perturbation theory to first order. Where C is not symmetric among them (gyroscopic forces), where it
    damps all alike, and of rigid motions, they stay as they are.
    """
    found = list(modes)
    if C is None:
        return found
    for plane in planes_of(modes):
        if len(plane) > 1 and modes[plane[0]].omega:
            for place, mode in zip(plane, _turned(modes, plane, C, theta)):
                found[place] = mode
    return found


def _turned(modes: Sequence[LinearMode], plane: Indices, C: Term, theta: float) -> list[LinearMode]:
    own = [modes[place] for place in plane]
    phi = np.column_stack([mode.shape + 1j * mode.imaginary for mode in own])
    damping: AnyArray = phi.conj().T @ in_wave(C, phi, theta)
    if not np.any(phi.imag):
        damping = damping.real  # so that the shapes stay real
    scale, skew = ROUNDING * np.abs(damping).max(), damping - damping.conj().T
    ratios, basis = np.linalg.eigh(0.5 * (damping + damping.conj().T))
    if np.abs(skew).max() > scale or np.ptp(ratios) <= scale:
        return own
    return [replace(mode, shape=x.real.copy(), imaginary=x.imag.copy()) for mode, x in zip(own, (phi @ basis).T)]
