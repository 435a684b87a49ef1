"""Modes of a mistuned wheel in the span of some waves of the tuned one, its nominal modes; no factor of the wheel.

Waves phi_a of unit modal mass, x_j = u_a e^{-i j d_a theta} / sqrt(N) in sector j (`fretwave.cyclic.sector`), make
M and the tuned K diagonal. Deviations delta_j of a part of each sector's K couple them by

    phi_a^H dK phi_b = D(d_b - d_a) u_a^H T_a^H K_part T_b u_b,    D(m) = 1/N sum_j delta_j e^{-i j m theta},

T_a = sum_k T_k e^{-i k d_a theta} the ties that give a sector's dofs with both its faces.

References
----------
Yang, M.-T., Griffin, J. H., A reduced-order model of mistuning using a subset of nominal system modes, J. Eng. Gas
Turbines Power 123, 2001.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Array, Complex
from ..model.modes import LinearMode
from ..model.sectors import Parts, Sparse, in_wave

#: {nodal diameter of 0 to N/2: its waves}, of unit modal mass.
Waves = Mapping[int, Sequence[LinearMode]]


@dataclass(frozen=True)
class Mistuning:
    """Relative deviations (N,) of a part (n_full, n_full) of each sector's K, and the sector's ties to its neighbours.

    Attributes
    ----------
    ties : {k: (n_full, n_dof)}
        {0: identity} where nothing was tied.
    """

    deviations: Array
    part: Sparse
    ties: Parts


def mistuned_modes(waves: Waves, mistuning: Mistuning, near: float, count: int) -> list[LinearMode]:
    """The modes nearest to a frequency [rad/s], in ascending order; with all waves there are they are exact."""
    sectors = len(mistuning.deviations)
    nominal = shapes, diameters, _ = _nominal(waves, sectors)
    omega, weights = _in_span(nominal, mistuning, near, count)
    found = []
    for value, row in zip(omega, weights.T):
        content = np.zeros((sectors, len(shapes)), dtype=complex)
        for d in set(diameters):
            content[d] = shapes[:, diameters == d] @ row[diameters == d]
        phi = np.real(np.fft.fft(content, axis=0)).ravel() / np.sqrt(sectors)
        found.append(LinearMode(float(value), 0.0, phi, np.zeros(len(phi))))
    return found


def mistuned_frequencies(waves: Waves, mistuning: Mistuning, near: float, count: int) -> Array:
    """Those of `mistuned_modes` [rad/s]."""
    return _in_span(_nominal(waves, len(mistuning.deviations)), mistuning, near, count)[0]


def _in_span(
    nominal: tuple[Complex, Array, Array], mistuning: Mistuning, near: float, count: int
) -> tuple[Array, Complex]:
    """Frequencies [rad/s] of the nearest modes, and the waves that each consists of (p, count)."""
    shapes, diameters, square = nominal
    to_real = _to_real(diameters, len(mistuning.deviations))
    H = np.diag(square) + _coupling(shapes, diameters, mistuning)
    values, vectors = np.linalg.eigh(np.real(to_real.conj().T @ H @ to_real))
    omega = np.sqrt(np.maximum(values, 0.0))
    chosen = np.sort(np.argsort(np.abs(omega - near), kind="stable")[:count])
    return omega[chosen], to_real @ vectors[:, chosen]


def _nominal(waves: Waves, sectors: int) -> tuple[Complex, Array, Array]:
    """Shapes (n_dof, p) of sector 0, nodal diameters and omega^2 (p,) of all waves, backward ones behind forward."""
    shapes, diameters, square = [], [], []
    for d, modes in waves.items():
        for mode in modes:
            u = mode.shape + 1j * mode.imaginary
            double = 2 * d % sectors != 0
            shapes += [u, u.conj()] if double else [u]
            diameters += [d, sectors - d] if double else [d]
            square += [mode.omega**2] * (2 if double else 1)
    return np.array(shapes).T, np.array(diameters), np.array(square)


def _to_real(diameters: Array, sectors: int) -> Complex:
    """Standing waves, real in all sectors, from the forward and backward ones that stand side by side (p, p)."""
    Q = np.eye(len(diameters), dtype=complex)
    forward = np.flatnonzero((2 * diameters < sectors) & (diameters > 0))
    for a in forward:
        Q[a : a + 2, a : a + 2] = np.array([[1.0, -1j], [1.0, 1j]]) / np.sqrt(2)
    return Q


def _coupling(shapes: Complex, diameters: Array, mistuning: Mistuning) -> Complex:
    """phi_a^H dK phi_b (p, p)."""
    sectors = len(mistuning.deviations)
    full = [in_wave(mistuning.ties, u, 2 * np.pi * d / sectors) for u, d in zip(shapes.T, diameters)]
    U = np.array(full).T
    D = np.fft.fft(mistuning.deviations) / sectors
    turns = np.subtract.outer(-diameters, -diameters) % sectors  # d_b - d_a
    return np.asarray(D[turns] * (U.conj().T @ (mistuning.part @ U)))
