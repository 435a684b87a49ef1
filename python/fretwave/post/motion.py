"""Motion in time from harmonic coefficients, in NumPy: for pictures and starts of time integrations."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from ..arrays import Array


def complex_amplitudes(labels: Sequence[str], coefficients: Array) -> dict[int, npt.NDArray[np.complex128]]:
    """q_n = Qc_n - i Qs_n of each retained harmonic, (n_dof,) each.

    Parameters
    ----------
    labels : of the columns, "0", "1c", "1s", ...
    coefficients : (n_dof, m)
    """
    amplitudes: dict[int, npt.NDArray[np.complex128]] = {}
    for column, label in enumerate(labels):
        part = coefficients[:, column].astype(np.complex128) * (-1j if label.endswith("s") else 1.0)
        order = int(label.rstrip("cs"))
        amplitudes[order] = amplitudes[order] + part if order in amplitudes else part
    return amplitudes


def waves(labels: Sequence[str], phases: Array) -> Array:
    """Value (n_phases, m) of each coefficient's function of time: x = sum Qc_n cos n tau + Qs_n sin n tau."""
    found = [(np.sin if text.endswith("s") else np.cos, int(text.rstrip("cs"))) for text in labels]
    return np.column_stack([wave(order * phases) for wave, order in found])


def motion(labels: Sequence[str], coefficients: Array, beta: float, omega: float, n: int = 512) -> tuple[Array, Array]:
    """Displacement and velocity (n + 1, n_dof) over one closed period (first = last).

    The factor e^{-n beta t} is left out, as in the alternating frequency-time scheme; the velocity follows from
    s_n = n (-beta + i omega) (Laxalde et al. 2008, eq. 6).
    """
    phase = 2.0 * np.pi * np.arange(n + 1) / n
    x, v = np.zeros((n + 1, len(coefficients))), np.zeros((n + 1, len(coefficients)))
    for order, q in complex_amplitudes(labels, coefficients).items():
        turn = np.exp(1j * order * phase)[:, None] * q
        x += turn.real
        v += (order * (-beta + 1j * omega) * turn).real
    return x, v
