"""Amplitude, frequency and damping of every cycle of a measured or integrated free motion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Array

if TYPE_CHECKING:
    from scipy.interpolate import CubicHermiteSpline

#: samples of a cycle in the projection on its fundamental; the trapezoidal rule is spectrally accurate there
PROJECTION_SAMPLES = 128
#: the decay rate enters the projection it is computed from; each pass gains about two digits
PASSES = 4
#: Noise of an integration in times its tolerance and its largest amplitude. Steps may be off by one of these each; of
#: decaying oscillators 6 to 22 remain for ever, and at 51 the amplitude of a cycle is 1 % off.
NOISE = 100.0


@dataclass(frozen=True)
class Cycles:
    """One entry per full cycle.

    Attributes
    ----------
    time : (n,) middle of the cycle [s]
    amplitude : (n,) fundamental amplitude at that time, unit of the signal
    omega : (n,) damped angular frequency, 2 pi over the time between upward crossings of zero or the mean [rad/s]
    zeta : (n,) damping ratio from the logarithmic decrement over the neighbouring cycles
    """

    time: Array
    amplitude: Array
    omega: Array
    zeta: Array

    def __len__(self) -> int:
        return len(self.time)


def extract(t: Array, x: Array, v: Array, period: float = 0.0) -> Cycles:
    """Cycle by cycle values of a signal `x` with its velocity `v`, sampled at times `t`.

    The amplitude is that of the fundamental: x e^{beta (t - t_mid)} is projected on the cycle's own
    frequency, which is exact for m + a e^{-beta t} cos(omega t) and comparable with a modal amplitude.

    Parameters
    ----------
    period : of a signal that need not swing about zero [s], roughly: cycles then begin where it passes its mean over
        such a time upwards
    """
    none = Cycles(*(np.empty(0) for _ in range(4)))
    if len(t) < 2 or not np.all(np.isfinite([x, v])):
        return none
    signal = interpolated(t, x, v)
    bounds = upward_crossings(_about_its_mean(signal, period) if period else signal)
    if len(bounds) < 5:
        return none
    middle = 0.5 * (bounds[1:] + bounds[:-1])
    omega = 2.0 * np.pi / np.diff(bounds)
    beta = np.zeros_like(omega)
    for _ in range(PASSES):
        amplitude = _fundamental(signal, bounds, beta)
        beta = -np.gradient(np.log(amplitude), middle, edge_order=2)
    return Cycles(middle, amplitude, omega, beta / np.hypot(beta, omega))


def noise_floor(cycles: Cycles, tolerance: float, size: float) -> Array:
    """Amplitude (n,) below which a cycle is noise of the integration that it comes from.

    Parameters
    ----------
    tolerance : relative, of the integration
    size : largest displacement of its start, or velocity over the angular frequency, unit of the signal
    """
    return NOISE * tolerance * np.maximum.accumulate(np.maximum(cycles.amplitude, size))


def above_noise(cycles: Cycles, floor: Array) -> Cycles:
    """Cycles before the first one below its floor (n,), and without the one that ends where that begins."""
    below = np.flatnonzero(cycles.amplitude < floor)
    last = max(int(below[0]) - 1, 0) if len(below) else len(cycles)
    return Cycles(cycles.time[:last], cycles.amplitude[:last], cycles.omega[:last], cycles.zeta[:last])


def interpolated(t: Array, x: Array, v: Array) -> CubicHermiteSpline:
    """The signal between its samples."""
    from scipy.interpolate import CubicHermiteSpline

    return CubicHermiteSpline(t, x, v)


def upward_crossings(signal: CubicHermiteSpline) -> Array:
    """Times at which the signal passes zero upwards [s]."""
    roots = np.unique(signal.roots(discontinuity=False, extrapolate=False))
    roots = roots[np.isfinite(roots)]
    return np.asarray(roots[signal(roots, 1) > 0.0], dtype=float)


def peaks(t: Array, x: Array, v: Array) -> tuple[Array, Array]:
    """Times and values of all extrema (v = 0) of the signal, by its cubic Hermite interpolant."""
    signal = interpolated(t, x, v)
    times = np.unique(signal.derivative().roots(discontinuity=False, extrapolate=False))
    times = times[np.isfinite(times)]
    return times, np.asarray(signal(times), dtype=float)


def _about_its_mean(signal: CubicHermiteSpline, period: float) -> CubicHermiteSpline:
    """A signal less its mean over a period around each of its samples; a e^{-beta t} cos(omega t) remains of this form.

    Without the half periods at both ends.
    """
    t, half, whole = signal.x, 0.5 * period, signal.antiderivative()
    t = t[(t >= t[0] + half) & (t <= t[-1] - half)]
    if len(t) < 2:
        return signal
    mean, rate = ((f(t + half) - f(t - half)) / period for f in (whole, signal))
    return interpolated(t, signal(t) - mean, signal(t, 1) - rate)


def _fundamental(signal: CubicHermiteSpline, bounds: Array, beta: Array) -> Array:
    """Of each cycle, less its mean m(t), linear by those of the cycles around, which grows to m(t) e^{beta t} here."""
    phase = np.arange(PROJECTION_SAMPLES) / PROJECTION_SAMPLES
    length = np.diff(bounds)[:, None]
    time = (phase - 0.5) * length
    grown = np.exp(beta[:, None] * time)
    steady = signal(bounds[:-1, None] + phase * length) * grown
    mean = steady.sum(axis=1) / grown.sum(axis=1)
    rate = np.gradient(mean, 0.5 * (bounds[1:] + bounds[:-1]), edge_order=2)
    steady -= (mean[:, None] + rate[:, None] * time) * grown
    return np.asarray(np.abs(steady @ np.exp(-2j * np.pi * phase)) * 2.0 / PROJECTION_SAMPLES, dtype=float)


def fundamental(x: Array) -> complex:
    """Amplitude and phase of the fundamental of one period, given without its last point (n samples)."""
    return complex(2.0 * np.fft.rfft(x)[1] / len(x))
