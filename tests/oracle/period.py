"""Hysteresis of a slider under one period of motion given by its harmonics, in continuous time.

u(tau) = sum_n Re(u_n e^{i n tau}): between turning points u is monotone, so that f = clip(f + kt du) from one to the
next is exact. Forces are integrated in closed form between the transitions: what sampling tends to as N_t grows.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.optimize import brentq
from scipy.signal import fftconvolve

from .laws import Array, Jenkins

Complex = npt.NDArray[np.complex128]


class Series:
    """u and its derivatives at any tau, from u_n, n = 0 .. highest."""

    def __init__(self, u: Complex) -> None:
        self.u, self.n = u, np.arange(len(u))

    def __call__(self, tau: float, derivative: int = 0) -> float:
        """The derivative (0: u itself) at tau."""
        factor = (1j * self.n) ** derivative * self.u
        factor[0] = 0.0 if derivative else self.u[0]
        return float((factor * np.exp(1j * self.n * tau)).sum().real)

    def change(self, begin: float, end: float) -> float:
        """u(end) - u(begin) term by term: the rounding of two sums is 2e-5 N where kt is 1e12 N/m."""
        half = 1j * self.n * (end - begin) / 2
        return float((self.u * np.exp(0.5j * self.n * (begin + end)) * 2 * np.sinh(half)).sum().real)

    def area(self, begin: float, end: float) -> float:
        """Of u - u(begin) from begin to end, term by term."""
        waves = integral(self.n, begin, end) - np.exp(1j * self.n * begin) * (end - begin)
        return float((self.u * waves).sum().real)

    def grid(self, count: int, derivative: int = 0, offset: float = 0.0) -> Array:
        """The derivative at `count` times of the period from `offset` on."""
        c = np.zeros(count // 2 + 1, complex)
        c[: len(self.u)] = (1j * self.n) ** derivative * self.u * np.exp(1j * self.n * offset) * count / 2
        c[0] = 0.0 if derivative else self.u[0] * count
        return np.fft.irfft(c, count)


@dataclass(frozen=True)
class Stick:
    """The slider stands from tau = begin to end, under the force f at its begin (at u = 0 where it never slips)."""

    begin: float
    end: float
    f: float


@dataclass(frozen=True)
class Hysteresis:
    """One closed period; sticks in order, wrapped past 2 pi where one crosses the period's end."""

    law: Jenkins
    series: Series
    sticks: list[Stick]
    slips: list[tuple[float, float, float]]  #: begin, end, force

    def force(self) -> Complex:
        """F_n = Fc_n - i Fs_n of all orders of the motion."""
        H, kt = len(self.series.u) - 1, self.law.kt
        if not self.slips:
            f = kt * self.series.u
            f[0] += self.sticks[0].f
            return f
        k = np.arange(-2 * H, 2 * H + 1)
        stick = sum((integral(-k, s.begin, s.end) for s in self.sticks), np.zeros(len(k), complex)) / (2 * np.pi)
        half = 0.5j * self.series.n * self.series.u
        rate = np.concatenate([half[:0:-1].conj(), half])  # of u', orders -H .. H
        product = kt * fftconvolve(stick, rate, "same") if H < 32 else kt * fftconvolve(stick, rate)[H:-H]
        n = np.arange(1, H + 1)
        return np.concatenate([[self._mean()], 2 * product[2 * H + 1 : 3 * H + 1] / (1j * n)])

    def at(self, tau: float) -> float:
        """The force at one time."""
        for begin, end, f in self.slips:
            if (tau - begin) % (2 * np.pi) < end - begin:
                return f
        s = next(s for s in self.sticks if (tau - s.begin) % (2 * np.pi) <= s.end - s.begin)
        return s.f + self.law.kt * (self.series.change(s.begin, tau) if self.slips else self.series(tau))

    def _mean(self) -> float:
        total = sum((end - begin) * f for begin, end, f in self.slips)
        for s in self.sticks:
            total += self.law.kt * self.series.area(s.begin, s.end) + s.f * (s.end - s.begin)
        return total / (2 * np.pi)

    def derivative(self, orders: Any) -> Complex:
        """d F_n / d (c_m, s_m) of u_m = c_m - i s_m: (orders, orders, 2), stick by stick kt (du - du(begin))."""
        n = np.asarray(orders)
        D = np.zeros((len(n), len(n), 2), complex)
        minus, plus = n[None, :] - n[:, None], -n[None, :] - n[:, None]
        norm = np.where(n == 0, 2 * np.pi, np.pi)[:, None]
        for s in self.sticks:
            a, b, c = (integral(k, s.begin, s.end) / norm for k in (minus, plus, -n[:, None]))
            start = s.begin if self.slips else np.nan
            for part, (wave, at) in enumerate([((a + b) / 2, np.cos(n * start)), ((a - b) / 2j, np.sin(n * start))]):
                D[..., part] += self.law.kt * (wave - (c * at[None, :] if self.slips else 0))
        return D


def integral(k: Any, begin: float, end: float) -> Complex:
    """Of e^{i k tau} from begin to end."""
    k = np.asarray(k)
    half = (end - begin) / 2
    return np.exp(1j * k * (begin + end) / 2) * 2 * half * np.sinc(k * half / np.pi)


def turning_points(series: Series, count: int) -> list[float]:
    """Where u' changes its sign, of those that a grid of `count` times sees."""
    step = 2 * np.pi / count
    offset = 0.381966 * step  # symmetric motions turn at round fractions of the period
    v = series.grid(count, 1, offset)
    out = []
    for k in np.flatnonzero(np.sign(v) != np.sign(np.roll(v, -1))):
        low, high = offset + k * step, offset + (k + 1) * step
        if series(low, 1) * series(high, 1) < 0:
            out.append(float(brentq(series, low, high, args=(1,), xtol=1e-16, rtol=1e-15)))
    return out


def hysteresis(law: Jenkins, u: Complex, rest: float = 0.0) -> Hysteresis:
    """The closed period of a slider that stands at `rest` (f = kt (u - rest)) before it is first moved."""
    series = Series(u)
    H = len(u) - 1
    # where a stiff slider drags, u may turn twice within a thousandth of the period
    tau = turning_points(series, max(1 << 14, 1 << int(np.ceil(np.log2(16 * H)))))
    if not tau:
        raise ValueError("the motion stands still")
    times = [*tau, tau[0] + 2 * np.pi]
    f = float(np.clip(law.kt * (series(tau[0]) - rest), -law.limit, law.limit))
    for _ in range(2):
        pieces: list[tuple[float, float, float, bool]] = []  # begin, end, force at its begin, slips
        for begin, end in zip(times, times[1:]):
            rise = series.change(begin, end)
            trial, sign = f + law.kt * rise, np.sign(rise)
            if abs(trial) <= law.limit:
                pieces.append((begin, end, f, False))
                f = trial
                continue
            goal = (sign * law.limit - f) / law.kt
            at = begin
            if goal != 0:
                at = float(
                    brentq(lambda t, a=begin, g=goal: series.change(a, t) - g, begin, end, xtol=1e-16, rtol=1e-15)
                )
            pieces += [(begin, at, f, False), (at, end, sign * law.limit, True)]
            f = sign * law.limit
    return _joined(law, series, pieces)


def _joined(law: Jenkins, series: Series, pieces: list[tuple[float, float, float, bool]]) -> Hysteresis:
    """Neighbouring pieces of one state as one, beginning with the first after a slip."""
    slips = [(a, b, f) for a, b, f, slip in pieces if slip]
    if not slips:
        begin, f = pieces[0][0], pieces[0][2]
        return Hysteresis(law, series, [Stick(0.0, 2 * np.pi, f - law.kt * series(begin))], [])
    last = max(k for k, piece in enumerate(pieces) if piece[3])
    turned = pieces[last + 1 :] + [(a + 2 * np.pi, b + 2 * np.pi, f, slip) for a, b, f, slip in pieces[: last + 1]]
    sticks: list[Stick] = []
    open_stick = False
    for begin, end, f, slip in turned:
        if slip:
            open_stick = False
        elif open_stick:
            sticks[-1] = Stick(sticks[-1].begin, end, sticks[-1].f)
        else:
            sticks.append(Stick(begin, end, f))
            open_stick = True
    return Hysteresis(law, series, sticks, slips)
