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

    Degenerate perturbation theory to first order, by the symmetric part of C, whose skew part linear modes leave out.
    Those that it damps alike, and rigid motions, stay as they are, as far as that goes.
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
    ratios, basis = np.linalg.eigh(0.5 * (damping + damping.conj().T))
    alike = np.split(np.arange(len(own)), 1 + np.flatnonzero(np.diff(ratios) > ROUNDING * np.abs(ratios).max()))
    if len(alike) == 1:
        return own
    basis = np.column_stack([_nearest(basis[:, columns]) for columns in alike])
    return [replace(mode, shape=x.real.copy(), imaginary=x.imag.copy()) for mode, x in zip(own, (phi @ basis).T)]


def _nearest(columns: AnyArray) -> AnyArray:
    """The orthonormal basis of these columns' space that is nearest to as many of the axes, which are taken in turn.

    The solver's axes are the same on any number of ranks, `eigh`'s choice of a basis and its signs are not.
    """
    space, axes = columns @ columns.conj().T, list[int]()
    left = space.copy()
    for _ in range(columns.shape[1]):
        weights = np.abs(left.diagonal())
        axes.append(int(np.flatnonzero(weights > 0.9 * weights.max())[0]))
        own = left[:, axes[-1]] / np.linalg.norm(left[:, axes[-1]])
        left = left - np.outer(own, own.conj() @ left)
    U, _, V = np.linalg.svd(space[:, sorted(axes)], full_matrices=False)
    nearest: AnyArray = U @ V
    return nearest
