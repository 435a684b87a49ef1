"""What linear modes leave out of a damping matrix with a gyroscopic (skew) part, which moves frequencies."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Optional

import numpy as np

from ...model.sectors import Term, in_wave

if TYPE_CHECKING:
    from ...model.modes import LinearMode

#: Shares of a frequency below this are not told.
TOLD = 1e-6


def gyroscopic_shift(modes: Sequence[LinearMode], C: Optional[Term], theta: float = 0.0) -> float:
    """Largest share by which the skew part of C moves one of these frequencies, in the space of their shapes.

    G = (Phi* C Phi - (Phi* C Phi)*) / 2 of shapes of unit modal mass leaves w^2 x = w S x + W^2 x, with S = i G
    Hermitian and W the frequencies without it; w are the positive eigenvalues of [[0, W], [W, S]] (y = W x / w).
    """
    moving = [mode for mode in modes if mode.omega]
    if C is None or not moving:
        return 0.0
    phi = np.column_stack([mode.shape + 1j * mode.imaginary for mode in moving])
    projected = phi.conj().T @ np.column_stack([in_wave(C, shape, theta) for shape in phi.T])
    S, W = 0.5j * (projected - projected.conj().T), np.diag([mode.omega for mode in moving])
    moved = np.linalg.eigvalsh(np.block([[np.zeros_like(S), W], [W, S]]))[len(moving) :]
    return float(np.max(np.abs(moved / np.sort(np.diag(W)) - 1.0)))


def gyroscopic_lines(name: str, shift: float) -> list[str]:
    """What is said of it; nothing of rounding."""
    if shift < TOLD:
        return []
    left_out = "C has a gyroscopic part, which linear modes leave out"
    return [
        f"{name}: {left_out}: it moves their frequencies by up to {100 * shift:.2g} % (of a wheel those of forward and"
        ' backward waves apart); `type = "mode"` has all of C'
    ]
