"""Amplitudes around a wheel in numbers: wave content, participation, phases."""

from __future__ import annotations

import numpy as np

from ..arrays import Array, Complex

#: How far the cut of a phase lies beside pi [rad], where sectors that move against each other stand to rounding.
CUT = 1e-6


def wave_content(a: Complex) -> Complex:
    """c_n of n = 0 .. N - 1, of sectors' amplitudes along the last axis."""
    return np.asarray(np.fft.ifft(a))


def participation(a: Complex) -> float:
    """Participation ratio."""
    square = np.abs(a) ** 2
    return float(square.sum() ** 2 / (len(a) * (square**2).sum()))


def phases(a: Complex) -> Array:
    """Angle of each amplitude [rad], in (-pi + CUT, pi + CUT]: opposite to the reference reads pi, never -pi."""
    angle = np.angle(a)
    return np.where(angle <= CUT - np.pi, angle + 2.0 * np.pi, angle)
