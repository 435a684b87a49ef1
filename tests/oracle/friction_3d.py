"""Force of friction in three dimensions under one period of motion given by its harmonics, in continuous time.

N = max(0, N0 + kn (u_n - gap)), T = kt d with the arm d = u_t - w, and |d| <= R = mu N / kt. The slider w stands while
|d| < R; it is dragged, w' = s d / |d| with s = u' . e - R' >= 0, while d = R e, which gives R phi' = u' . e_phi for the
angle of e; while open w = u_t. Events are roots found to rounding, a drag is integrated by DOP853 (Radau where it is
stiff) together with its integrals, the period that closes is found by Newton.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Optional

import numpy as np
import numpy.typing as npt
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, minimize, minimize_scalar

from .flow import OracleError
from .laws import Array

Complex = npt.NDArray[np.complex128]
TURN = 2 * np.pi
#: Times from a landing and to a lift-off, where R phi' = u' . e_phi is singular: its series there, and nothing.
ENTERED, LEFT = 1e-7, 1e-9
STIFF = 3e3  #: |u'| / R times the duration of a drag, above which it is integrated by Radau
CLOSED = 1e-13  #: of the motion
MOST = 1000  #: changes of state in a period


@dataclass(frozen=True)
class Series:
    """Several real trigonometric polynomials Re sum_n c_n e^{i n tau}; c (rows, H + 1)."""

    c: Complex

    def __call__(self, tau: Any, derivative: int = 0) -> Array:
        """(rows, times)."""
        n = np.arange(self.c.shape[1])
        return np.asarray(((self.c * (1j * n) ** derivative) @ np.exp(1j * np.multiply.outer(n, tau))).real)

    def gain(self, tau: float, s: Any) -> Array:
        """Value at tau + s less that at tau, with all digits for small s."""
        half = np.multiply.outer(np.arange(self.c.shape[1]), s) / 2
        turned = self.c * np.exp(1j * np.arange(self.c.shape[1]) * tau)
        return np.asarray((turned @ (2j * np.sin(half) * np.exp(1j * half))).real)


def sign_changes(series: Series) -> list[float]:
    """Where a single series changes its sign in [0, 2 pi): among the unit roots of its polynomial, none is missed."""
    c = series.c[0]
    polynomial = np.concatenate([c[:0:-1], [2 * c[0].real], c[1:].conj()])
    z = np.roots(polynomial / abs(polynomial).max())
    tau = np.sort(np.angle(z[abs(abs(z) - 1) < 1e-3]) % TURN)
    if not len(tau):
        return []
    middles = (tau + np.concatenate([tau[1:], [tau[0] + TURN]])) / 2
    ends = np.concatenate([[middles[-1] - TURN], middles])
    value = series(ends)[0]
    return [
        float(brentq(lambda t: series(t)[0], ends[k], ends[k + 1], xtol=1e-300, rtol=1e-15)) % TURN
        for k in range(len(tau))
        if (value[k] > 0) != (value[k + 1] > 0)
    ]


@dataclass
class Pad:
    """A slider under its path: rows of `path` are the two tangents and R, below zero where it is open.

    integrals : of d times 1, cos n tau, sin n tau over what has been marched (2, m)
    """

    path: Series
    harmonics: int
    integrals: Array = field(init=False)
    events: list[tuple[float, str]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """Begin the integrals anew."""
        self.integrals, self.events = np.zeros((2, 2 * self.harmonics + 1)), []

    def waves(self, tau: Any) -> Array:
        """(m, times)."""
        return waves(self.harmonics, tau)

    def march(self, w: Array, begin: float, end: float) -> Array:
        """The slider at the end of a span in which the contact stays closed."""
        tau, (*u, R), (*v, rise) = begin, self.path(begin), self.path(begin, 1)
        d = np.array(u) - w
        size = np.linalg.norm(d)
        slips = size > R * (1 - 1e-14) and d @ v > rise * size
        if slips:
            d = d * (R / size)
        while tau < end:
            if len(self.events) > MOST:
                raise OracleError(f"more than {MOST} changes of state up to tau = {tau:.6g}")
            self.events.append((tau, "slip" if slips else "stick"))
            if slips:
                tau, d = self.slip(tau, float(np.arctan2(d[1], d[0])), end)
            else:
                tau, d = self.stick(tau, d, end)
            slips = not slips
        return np.asarray(self.path(end)[:2] - d)

    def land(self, begin: float, end: float) -> Array:
        """The same from a landing, where the arm is zero."""
        *v, rise = self.path(begin, 1)
        speed = np.hypot(*v)
        if speed <= rise:
            self.events.append((begin, "stick"))
            tau, d = self.stick(begin, np.zeros(2), end)
            return self.march(self.path(tau)[:2] - d, tau, end) if tau < end else self.path(end)[:2] - d
        a = self.path(begin, 2)
        turn = (v[0] * a[1] - v[1] * a[0]) / speed / (speed + rise)
        late = ENTERED * min(1.0, end - begin)
        self.events.append((begin, "slip"))
        tau, d = self.slip(begin + late, float(np.arctan2(v[1], v[0])) + turn * late, end)
        return self.march(self.path(tau)[:2] - d, tau, end) if tau < end else self.path(end)[:2] - d

    def stick(self, tau: float, d: Array, end: float, held: bool = False) -> tuple[float, Array]:
        """Until |d| = R or the end; if it is known to hold, to the end."""
        R = float(self.path(tau)[2])
        margin = d @ d - R * R
        margin = 0.0 if abs(margin) < 1e-13 * R * R else margin

        def beyond(s: Any) -> Any:
            """|d|^2 - R^2 after s."""
            *du, dR = self.path.gain(tau, s)
            return margin + 2 * (d[0] * du[0] + d[1] * du[1] - R * dR) + du[0] ** 2 + du[1] ** 2 - dR**2

        span = end - tau
        s = np.concatenate([span * np.geomspace(1e-12, 1e-3, 100), np.linspace(1e-3 * span, span, 4001)[1:]])
        value = beyond(s)
        for k in np.flatnonzero((value[1:-1] > value[:-2]) & (value[1:-1] > value[2:]) & (value[1:-1] <= 0)) + 1:
            top = minimize_scalar(lambda x: -beyond(x), bounds=(s[k - 1], s[k + 1]), method="bounded")
            s, value = np.append(s, top.x), np.append(value, -top.fun)
        order = np.argsort(s)
        s, value = s[order], value[order]
        out, at = np.flatnonzero(value > 0), span
        if len(out) and not held:
            first = int(out[0])
            at = float(brentq(beyond, s[first - 1], s[first], xtol=1e-300, rtol=1e-15)) if first else float(s[0])
        node, weight = np.polynomial.legendre.leggauss(2 * self.path.c.shape[1] + 2 * self.harmonics + 20)
        at_nodes = at * (node + 1) / 2
        arm = d[:, None] + self.path.gain(tau, at_nodes)[:2]
        self.integrals += (arm * weight * at / 2) @ self.waves(tau + at_nodes).T
        leaves = at < span
        d = d + self.path.gain(tau, at)[:2]
        return (tau + at if leaves else end), d

    def slip(self, tau: float, phi: float, end: float) -> tuple[float, Array]:
        """Until the slider's speed falls through zero, the end, or just before a lift-off there."""
        lifts = self.path(end)[2] < 1e-12 * abs(self.path.c[2]).max()
        stop = end - LEFT * min(1.0, end - tau) if lifts else end

        def speed(t: float, y: Array) -> float:
            v = self.path(t, 1)
            return float(v[0] * np.cos(y[0]) + v[1] * np.sin(y[0]) - v[2])

        def slope(t: float, y: Array) -> Array:
            v, R, e = self.path(t, 1), self.path(t)[2], np.array([np.cos(y[0]), np.sin(y[0])])
            rate = (v[1] * e[0] - v[0] * e[1]) / R
            return np.concatenate([[rate], np.outer(R * e, self.waves(t)).ravel()])

        def jacobian(t: float, y: Array) -> Array:
            v, R, J = self.path(t, 1), self.path(t)[2], np.zeros((len(y), len(y)))
            J[0, 0] = -(v[0] * np.cos(y[0]) + v[1] * np.sin(y[0])) / R
            J[1:, 0] = np.outer(R * np.array([-np.sin(y[0]), np.cos(y[0])]), self.waves(t)).ravel()
            return J

        if speed(tau, np.array([phi])) <= 0:  # the circle is only touched
            return tau, self.path(tau)[2] * np.array([np.cos(phi), np.sin(phi)])
        speed.terminal, speed.direction = True, -1  # type: ignore[attr-defined]
        y = np.concatenate([[phi], np.zeros(self.integrals.size)])
        times = np.linspace(tau, stop, 200)
        v = self.path(times, 1)
        stiff = (stop - tau) * float((np.hypot(v[0], v[1]) / abs(self.path(times)[2])).mean()) > STIFF
        how: dict[str, Any] = {"method": "Radau", "rtol": 1e-10, "jac": jacobian} if stiff else {"method": "DOP853"}
        size = abs(self.path.c[2]).max()
        how = {"rtol": 3e-14, "atol": np.append(1e-14, np.full(self.integrals.size, 1e-15 * size)), **how}
        solution = solve_ivp(slope, (tau, stop), y, events=speed, **how)
        if not solution.success:
            raise OracleError(f"a drag from tau = {tau:.6g} is not integrated: {solution.message}")
        y, at = solution.y[:, -1], float(solution.t[-1])
        if solution.status == 1:  # dense output has fewer digits than a step
            before = float(solution.t[-2])
            y = solve_ivp(slope, (before, at), solution.y[:, -2], **how).y[:, -1] if at > before else y
        else:
            at = end
        self.integrals += y[1:].reshape(self.integrals.shape)
        return at, self.path(at)[2] * np.array([np.cos(y[0]), np.sin(y[0])])


def waves(harmonics: int, tau: Any) -> Array:
    """1, cos tau, sin tau, cos 2 tau, ... (m, times)."""
    x = np.multiply.outer(np.arange(1, harmonics + 1), tau)
    both = np.stack([np.cos(x), np.sin(x)], axis=1).reshape(2 * harmonics, *np.shape(tau))
    return np.concatenate([np.ones((1, *np.shape(tau))), both])


def common_point(pad: Pad, rest: Array) -> Optional[Array]:
    """The point nearest to `rest` with |u - w| <= R at all times, from which nothing slips; None: there is none."""

    def peaks(w: Array) -> Array:
        """Times at which |u - w| - R has its maxima, the largest first."""
        value = over(grid, w)
        top = np.flatnonzero((value >= np.roll(value, 1)) & (value > np.roll(value, -1)))
        fine = np.array([peak(grid[k], w) for k in top[np.argsort(-value[top])][:8]] or [0.0])
        return fine[np.argsort(-over(fine, w))]

    def peak(t: float, w: Array) -> float:
        low, high = t - grid[1], t + grid[1]
        if rises(low, w) <= 0 or rises(high, w) >= 0:
            return t
        return float(brentq(rises, low, high, args=(w,), xtol=1e-300, rtol=1e-15))

    def rises(t: float, w: Array) -> float:
        x, v = pad.path(t), pad.path(t, 1)
        d = x[:2] - w
        return float(d @ v[:2] - v[2] * np.linalg.norm(d))

    def over(t: Any, w: Array) -> Any:
        x = pad.path(t)
        return np.hypot(x[0] - w[0], x[1] - w[1]) - x[2]

    size, grid = abs(pad.path.c).max(), TURN * np.arange(2048) / 2048
    if np.linalg.norm(rest) > 1e6 * size:
        raise OracleError(f"the slider's rest is {np.linalg.norm(rest) / size:.0e} motions away: no digits are left")
    times = peaks(rest)
    if over(times[0], rest) <= 0:
        return rest
    u = pad.path(times[0])
    w = u[:2] + u[2] * (rest - u[:2]) / np.linalg.norm(rest - u[:2])
    if over(peaks(w), w).max() <= 1e-13 * size:
        return np.asarray(w)
    found = minimize(
        lambda x: ((x - rest) ** 2).sum() / size**2,
        w,
        method="SLSQP",
        constraints={"type": "ineq", "fun": lambda x: -over(grid[::8], x) / size},
        options={"ftol": 1e-12, "maxiter": 200},
    )
    w = found.x
    for _ in range(20):  # the corner of two discs, each at its own farthest time
        times = peaks(w)[:2]
        if len(times) < 2:
            return None
        u = pad.path(times)
        arms = w - u[:2].T
        step = np.linalg.lstsq(arms / np.linalg.norm(arms, axis=1)[:, None], -over(times, w), rcond=1e-12)[0]
        w = w + step
        if np.linalg.norm(step) < 1e-15 * size:
            break
    nearest = np.linalg.norm(step) < 1e-12 * size and np.linalg.norm(w - found.x) < 1e-2 * size
    return w if nearest and over(peaks(w), w).max() <= 1e-13 * size else None


def cycle(pad: Pad, rest: Array) -> Array:
    """The slider at tau = 0 of the only period that closes with slip, of a contact that never opens."""
    size, w = abs(pad.path.c).max(), rest

    def gain(x: Array) -> Array:
        return pad.march(x, 0.0, TURN) - x

    w, g = w + gain(w), np.full(2, np.inf)
    for _ in range(60):
        before, g = np.linalg.norm(g), gain(w)
        if np.linalg.norm(g) <= CLOSED * size:
            return w
        fast = bool(np.linalg.norm(g) < 0.03 * before)
        if fast or np.linalg.norm(g) > 0.9 * before:  # forgets its start, or Newton went astray
            w = w + g
            continue
        h = 1e-6 * size
        J = np.column_stack([(gain(w + h * e) - gain(w - h * e)) / (2 * h) for e in np.eye(2)])
        w = w - np.linalg.solve(J, g) if abs(np.linalg.det(J)) > 1e-12 else w + g
    if np.linalg.norm(g) > 1e-11 * size:
        raise OracleError(f"the period does not close: the slider gains {np.linalg.norm(g) / size:.1e} of the motion")
    return w


def coefficients(u: Callable[[float], Any], count: int = 1024) -> Array:
    """Of a motion u(tau) -> (3,): the trigonometric polynomial through its values at `count` times."""
    c = np.fft.rfft(np.array([u(t) for t in TURN * np.arange(count) / count]), axis=0)[: count // 2].T * 2 / count
    last = int(np.flatnonzero(abs(c).max(axis=0) > 1e-15 * abs(c).max())[-1])
    out = np.zeros((len(c), 2 * last + 1))
    out[:, 0], out[:, 1::2], out[:, 2::2] = c[:, 0].real / 2, c[:, 1 : last + 1].real, -c[:, 1 : last + 1].imag
    return out


def forces(
    u: Any, kn: float, kt: float, mu: float, N0: float, gap: float = 0.0, rest: Any = (0.0, 0.0), harmonics: int = 10
) -> Array:
    """Coefficients [F0, Fc1, Fs1, ...] of (N, T1, T2) in the period that the slider closes.

    Parameters
    ----------
    u : (3, m) coefficients [Q0, Qc1, Qs1, ...] of the relative motion (normal, closing; two tangents), or a callable
        of tau in [0, 2 pi) that gives the three
    rest : slider in the static state; of the periods without slip the one nearest to it counts
    harmonics : highest order of the answer

    Returns
    -------
    (3, 2 harmonics + 1)
    """
    Q = coefficients(u) if callable(u) else np.asarray(u, float)
    c = np.concatenate([Q[:, :1], Q[:, 1::2] - 1j * Q[:, 2::2]], axis=1)
    rest, c[1:, 0] = np.asarray(rest, float) - Q[1:, 0], 0.0  # arms may be far shorter than the way to them
    load = kn * c[0]
    load[0] += N0 - kn * gap
    pad = Pad(Series(np.stack([c[1], c[2], mu / kt * load])), harmonics)
    normal, changes = Series(load[None]), sign_changes(Series(load[None]))
    out = np.zeros((3, 2 * harmonics + 1))
    if not changes and normal(0.0)[0] <= 0:
        return out
    spans = closed_spans(normal, changes)
    for begin, end in spans:
        node, weight = np.polynomial.legendre.leggauss(2 * c.shape[1] + 2 * harmonics + 20)
        tau = begin + (end - begin) * (node + 1) / 2
        out[0] += waves(harmonics, tau) @ (normal(tau)[0] * weight * (end - begin) / 2)
    if mu > 0 and not changes:
        stands = common_point(pad, rest)
        if stands is None:
            w = cycle(pad, rest)
            pad.forget()
            pad.march(w, 0.0, TURN)
        else:
            pad.stick(0.0, pad.path(0.0)[:2] - stands, TURN, held=True)
    elif mu > 0:
        for begin, end in spans:
            pad.land(begin, end)
    out[1:] = kt * pad.integrals
    out[:, 0] /= 2
    return out / np.pi


def closed_spans(normal: Series, changes: list[float]) -> list[tuple[float, float]]:
    """Where N > 0, from each landing on."""
    if not changes:
        return [(0.0, TURN)]
    t = sorted(changes)
    t = t if normal(t[0], 1)[0] > 0 else [*t[1:], t[0] + TURN]
    return list(zip(t[::2], t[1::2]))
