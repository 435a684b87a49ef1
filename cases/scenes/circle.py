"""Friction on a circle at every time, for the judge: where |T| = mu N the arm d = u - w has |d| = R, R = mu N / kt.

Between events, which are roots found to rounding, the slider w stands or is dragged, and dragged it turns by
R phi' = u' . e_phi until the speed u' . e - R' of its drag falls through zero. That equation is solved by collocation
at Radau's points on panels as short as its Legendre coefficients ask for, stiff or not. Derivatives come from the
equations of variation: where it stands w keeps its variation, a drag takes over what lies along the circle, its end
changes nothing, and a landing, w = u, moves in time. The force has no jump, so that events add nothing to integrals.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np
from numpy.polynomial import legendre
from scipy.optimize import brentq

TURN = 2 * np.pi
POINTS = 16  #: of Radau in a panel
SMOOTH = 1e-12  #: last Legendre coefficient of the angle in a panel that is short enough
LEFT = 1e-7  #: of a period before lift-off, where R phi' = u' . e_phi is singular and the force as good as gone
AT_ONCE = 1e-9  #: R over the speed of u, time in which a drag takes its direction, below which it does so at once
MOST = 4000  #: panels of a drag
INSTANT = 1e-13  #: of time, before a lift-off that rounding lets come a little late
CLOSED = 1e-13  #: of R: an arm that comes back this near to its start has closed its period


def waves(orders, tau):
    """1, cos n tau, sin n tau (times, m)."""
    x = np.multiply.outer(tau, orders)
    return _columns(orders, np.cos(x), np.sin(x))


def gains(orders, tau, s):
    """Waves at tau + s less those at tau (times, m), with all digits for small s."""
    half, n = np.multiply.outer(s / 2, orders), np.asarray(orders)
    size, middle = 2 * np.sin(half), n * tau + half
    return _columns(orders, -size * np.sin(middle), size * np.cos(middle))


def _columns(orders, even, odd):
    """Cosine and sine of each order in turn, of order 0 the first alone."""
    mean = 0 if orders[0] else 1
    out = np.empty((*even.shape[:-1], 2 * len(orders) - mean))
    out[..., :mean] = even[..., :mean]
    out[..., mean::2], out[..., mean + 1 :: 2] = even[..., mean:], odd[..., mean:]
    return out


def rate(orders, U):
    """Coefficients of dU/dtau."""
    out, k = np.zeros_like(U), 0
    for n in orders:
        if n:
            out[..., k], out[..., k + 1] = n * U[..., k + 1], -n * U[..., k]
        k += 2 if n else 1
    return out


def zero(f, low, high):
    """Where f changes its sign, to rounding; the end at which it is nearer to zero, if rounding lets it not change."""
    a, b = f(low), f(high)
    if (a > 0) == (b > 0):
        return low if abs(a) < abs(b) else high
    return brentq(f, low, high, xtol=1e-300, rtol=1e-15, maxiter=1000, disp=False)


@cache
def _panel():
    """Radau's points c in (0, 1], their integrals A, and values at 0 and c to Legendre coefficients."""
    s = POINTS
    c = np.sort(legendre.legroots(np.r_[np.zeros(s - 1), -1.0, 1.0]).real)
    c[-1] = 1.0
    c = (c + 1) / 2
    powers = legendre.legvander(2 * c - 1, s - 1)
    high = legendre.legvander(2 * c - 1, s)
    integral = np.empty((s, s))
    integral[:, 0] = c
    for k in range(1, s):
        integral[:, k] = (high[:, k + 1] - high[:, k - 1]) / (2 * (2 * k + 1))
    A = integral @ np.linalg.inv(powers)
    return c, A, np.linalg.inv(legendre.legvander(2 * np.r_[0.0, c] - 1, s))


def _within(x):
    """From values at 0 and Radau's points to those at x."""
    return legendre.legvander(2 * np.atleast_1d(x) - 1, POINTS) @ _panel()[2]


@cache
def _fixed():
    """Matrices to 24 equidistant points, and to Gauss's with their weights."""
    x = np.linspace(0, 1, 25)[1:]
    node, weight = legendre.leggauss(24)
    return x, _within(x), (node + 1) / 2, weight / 2, _within((node + 1) / 2)


_gauss = cache(legendre.leggauss)


@dataclass
class Slider:
    """One slider under its path.

    Attributes
    ----------
    orders : of the waves
    U : (3, m) coefficients of the two tangents and of R, which is below zero where the contact is open
    vary : whether the coefficients are varied too; a start's two components always are
    integral, varied : of d times the waves (2, m), and its derivatives (2, m, directions)
    slipped : longest way of a drag so far
    """

    orders: list[int]
    U: Any
    vary: bool
    integral: Any = field(init=False)
    varied: Any = field(init=False)
    slipped: float = field(init=False)

    def __post_init__(self):
        self.V = rate(self.orders, self.U)
        self.W = rate(self.orders, self.V)
        self.h = np.inf
        self.forget()

    def forget(self):
        m = self.U.shape[1]
        self.directions = 2 + (3 * m if self.vary else 0)
        self.integral, self.varied, self.slipped = np.zeros((2, m)), np.zeros((2, m, self.directions)), 0.0

    def wave(self, tau):
        return waves(self.orders, np.atleast_1d(tau))

    def at(self, tau, C=None):
        """(3,) at one time, (3, times) at several."""
        value = (self.U if C is None else C) @ self.wave(tau).T
        return value if np.ndim(tau) else value[:, 0]

    def variation(self, wave):
        """Of path and R by each direction (times, 3, directions)."""
        m, out = self.U.shape[1], np.zeros((len(wave), 3, self.directions))
        for row in range(3 if self.vary else 0):
            out[:, row, 2 + row * m : 2 + (row + 1) * m] = wave
        return out

    def add(self, wave, weight, arm, varied):
        """To the integrals: arm (times, 2), varied (times, 2, directions)."""
        weighted = (wave * weight[:, None]).T
        self.integral += (weighted @ arm).T
        self.varied += (weighted @ varied.reshape(len(arm), -1)).reshape(-1, 2, self.directions).transpose(1, 0, 2)

    def march(self, tau, d, D, end):
        """Arm and its variations (2, directions) at the end of a span in which the contact stays closed."""
        (*_, R), v = self.at(tau), self.at(tau, self.V)
        size = np.hypot(*d)
        slips = size >= R * (1 - 1e-13) and d @ v[:2] > v[2] * size
        if slips:
            d = d * (R / size)
        while end - tau > INSTANT:
            if slips:
                e = d / np.hypot(*d)
                turn = np.array([-e[1], e[0]]) @ D / self.at(tau)[2]
                tau, d, D = self.slip(tau, *self.settle(tau, np.arctan2(d[1], d[0]), turn), end)
            else:
                tau, d, D = self.stick(tau, d, D, end)
            slips = not slips
        return d, D

    def land(self, begin, end):
        """The same from a landing: the arm is zero, wherever the slider was."""
        (*v, r), a = self.at(begin, self.V), self.at(begin, self.W)
        v, varied, late = np.array(v), self.variation(self.wave(begin))[0], self.variation(self.slopes(begin))[0]
        speed = np.hypot(*v)
        if speed <= r:
            tau, d, D = self.stick(begin, np.zeros(2), np.outer(v, varied[2]) / r, end)
        else:
            e, n = v / speed, np.array([-v[1], v[0]]) / speed
            turn = (n @ a[:2]) / (speed + r)
            by = (n @ late[:2] - varied[2] * turn) / speed
            tau, d, D = self.slip(begin, np.arctan2(e[1], e[0]), by, end)
        if end - tau > INSTANT:
            self.march(tau, d, D, end)

    def slopes(self, tau):
        """Derivatives of the waves (times, m)."""
        return self.wave(tau) @ rate(self.orders, np.eye(self.U.shape[1])).T

    # The slider stands

    def stick(self, tau, d, D, end):
        span = self.leaves(tau, d, end)
        node, weight = _gauss(2 * len(self.orders) + 2 * self.orders[-1] + 16)
        s = span * (node + 1) / 2
        gain = gains(self.orders, tau, s)
        arm = d + gain @ self.U[:2].T
        self.add(self.wave(tau + s), weight * span / 2, arm, D + self.variation(gain)[:, :2])
        gain = gains(self.orders, tau, np.array([span]))
        left = span < end - tau
        return (tau + span if left else end), d + self.U[:2] @ gain[0], D + self.variation(gain)[0, :2]

    def leaves(self, tau, d, end):
        """Time from tau to where |d| = R is first exceeded, at most to the end."""
        R = self.at(tau)[2]
        margin = d @ d - R * R
        margin = 0.0 if abs(margin) < 1e-13 * R * R else margin

        def beyond(s):
            """|d|^2 - R^2 after s, and half its derivative."""
            s = np.atleast_1d(s)
            x, v = self.U @ gains(self.orders, tau, s).T, self.V @ self.wave(tau + s).T
            value = margin + 2 * (d @ x[:2] - R * x[2]) + x[0] ** 2 + x[1] ** 2 - x[2] ** 2
            return value, (d[0] + x[0]) * v[0] + (d[1] + x[1]) * v[1] - (R + x[2]) * v[2]

        span, count = end - tau, 12 * self.orders[-1] + 48
        way = np.hypot(*self.at(tau, self.V)[:2]) * span
        least = 1e-10 * min(1.0, 1e7 * abs(R) / way) if way > 0 and R > 0 else 1e-10
        s = np.r_[span * np.geomspace(least, 1 / count, 64)[:-1], span * np.arange(1, count + 1) / count]
        value, slope = beyond(s)
        near = value > -0.3 * (R * R + abs(self.U[2]).max() ** 2)
        for k in np.flatnonzero((slope[:-1] > 0) & (slope[1:] <= 0) & (value[:-1] <= 0) & (near[:-1] | near[1:])):
            if value[k + 1] <= 0:  # a maximum between two times, perhaps above
                top = zero(lambda x: beyond(x)[1][0], s[k], s[k + 1])
                if beyond(top)[0][0] > 0:
                    s, value = np.insert(s, k + 1, top), np.insert(value, k + 1, beyond(top)[0][0])
                    break
        out = np.flatnonzero(value > 0)
        if not len(out):
            return span
        k = out[0]
        return zero(lambda x: beyond(x)[0][0], s[k - 1], s[k]) if k else s[0]

    # The slider is dragged

    def settle(self, tau, phi, turn, always=False):
        """Angle and variation at a drag's begin: those it has in no time where R is small to rounding.

        There phi - psi, psi of u', falls by tan(x / 2) ~ exp(-v t / R): to no force, but onsets move in time.
        """
        (*v, _), (*a, _), R = self.at(tau, self.V), self.at(tau, self.W), self.at(tau)[2]
        speed = np.hypot(*v)
        if not (AT_ONCE * speed > R or always):
            return phi, turn
        e, n = np.array(v) / speed, np.array([-v[1], v[0]]) / speed
        begun = np.array([np.cos(phi), np.sin(phi)])
        sine = begun @ n
        per = (begun - e) / sine if abs(sine) > 1e-6 else n
        wave, late = self.wave(tau), self.variation(self.slopes(np.array([tau])))[0]
        self.varied += R * R / speed * per[:, None, None] * wave[0][None, :, None] * turn
        return np.arctan2(*e[::-1]) - R * (n @ a) / speed**2, n @ late[:2] / speed

    def slip(self, tau, phi, turn, end):
        lifts = self.at(end)[2] <= 1e-12 * abs(self.U[2]).max()
        longest = 1.5 / (1 + self.orders[-1])
        h, F = min(longest, 2 * self.h), 0.0
        for _ in range(MOST):
            left = end - tau
            if left <= (LEFT if lifts else 0.0):
                return end, *self.ends(end, phi, turn)
            v = self.at(tau, self.V)
            if (
                v[0] * np.cos(phi) + v[1] * np.sin(phi) - v[2] <= 0 and self.at(tau)[2] > 0
            ):  # the circle is only touched
                return tau, *self.ends(tau, phi, turn)
            h = min(h, longest, left / 2 if lifts else left)
            solved = self.panel(tau, h, phi, F)
            if solved is None:
                h /= 4
                if h < 1e-13:
                    (phi, turn), h = self.settle(tau, phi, turn, always=True), longest
                continue
            ended = self.speed_ends(tau, h, solved[0])
            if ended == 0.0:
                return tau, *self.ends(tau, phi, turn)
            if ended is not None:
                h *= ended
                solved = self.panel(tau, h, phi, F, check=False)
            phi, turn = self.take(tau, h, solved, phi, turn)
            last = not lifts and tau + h >= end - 1e-15 * TURN
            tau = end if last else tau + h
            if ended is not None or last:
                return tau, *self.ends(tau, phi, turn)
            self.h = h
            F, h = solved[1][-1], 2 * h
        raise ArithmeticError(f"a drag takes more than {MOST} panels at tau = {tau:.6g}")

    def ends(self, tau, phi, turn):
        """Arm and its variation on the circle."""
        e, R = np.array([np.cos(phi), np.sin(phi)]), max(0.0, self.at(tau)[2])
        radius = self.variation(self.wave(tau))[0, 2]
        return R * e, np.outer(e, radius) + R * np.outer([-e[1], e[0]], turn)

    def panel(self, tau, h, phi, F, check=True):
        """Angles at 0 and the points, their rates F, the matrix of the variation; None where it is too long."""
        c, A, transform = _panel()
        wave = self.wave(tau + h * c)
        v, R = self.V[:2] @ wave.T, self.U[2] @ wave.T
        F = np.full(len(c), F)
        for _ in range(30):
            angle = phi + h * (A @ F)
            cos, sin = np.cos(angle), np.sin(angle)
            along = v[0] * cos + v[1] * sin
            J = np.diag(R) + along[:, None] * (h * A)
            step = np.linalg.solve(J, v[1] * cos - v[0] * sin - R * F)
            F = F + step
            moved = abs(h * (A @ step)).max()
            if not moved < 50:
                break
            if moved < 1e-14:
                break
        angle = np.r_[phi, phi + h * (A @ F)]
        # rounding of a motion that all but stands, and of an R that is almost zero, turns the direction
        noise = 1e-14 * abs(self.V[:2]).sum() / max(np.hypot(*v).min(), 1e-300) + 1e-15 * abs(self.U[2]).sum() / R.min()
        if check and not (moved < 10 * SMOOTH + noise and abs(transform @ angle)[-2:].max() < SMOOTH + noise):
            return None
        return angle, F, J

    def speed_ends(self, tau, h, angle):
        """Share of the panel after which the drag's speed is below zero; None if it never is."""
        x, to, *_ = _fixed()

        def speed(x, phi):
            v = self.V @ self.wave(tau + h * x).T
            return v[0] * np.cos(phi) + v[1] * np.sin(phi) - v[2]

        below = np.flatnonzero(speed(x, to @ angle) < 0)
        if not len(below):
            return None
        low, high = np.r_[0.0, x][below[0]], x[below[0]]
        if speed(np.array([low]), _within(low) @ angle)[0] <= 0:
            return low
        return zero(lambda t: speed(np.array([t]), _within(t) @ angle)[0], low, high)

    def take(self, tau, h, solved, phi, turn):
        """Integrals and variations of a panel."""
        angle, F, J = solved
        c, A, _ = _panel()
        wave = self.wave(tau + h * c)
        varied, late = self.variation(wave), self.variation(self.slopes(tau + h * c))
        v, cos, sin = self.V[:2] @ wave.T, np.cos(angle[1:]), np.sin(angle[1:])
        along = v[0] * cos + v[1] * sin
        right = cos[:, None] * late[:, 1] - sin[:, None] * late[:, 0] - F[:, None] * varied[:, 2]
        G = np.linalg.solve(J, right - along[:, None] * turn)
        turns = np.concatenate([turn[None], turn + h * (A @ G)])
        _, _, x, weight, to = _fixed()
        wave = self.wave(tau + h * x)
        R, e = self.U[2] @ wave.T, np.array([np.cos(to @ angle), np.sin(to @ angle)]).T
        n = np.stack([-e[:, 1], e[:, 0]], axis=1)
        by = e[:, :, None] * self.variation(wave)[:, 2:] + (R[:, None] * n)[:, :, None] * (to @ turns)[:, None]
        self.add(wave, h * weight, R[:, None] * e, by)
        speed = v[0] * cos + v[1] * sin - self.V[2] @ self.wave(tau + h * c).T
        self.slipped = max(self.slipped, h * float(abs(speed).max()))
        return angle[-1], turns[-1]
