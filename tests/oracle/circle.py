"""Periodic motions with friction in three dimensions: |T| <= mu N on a circle, N of a one-sided spring.

The law of `coulomb_3d` in continuous time: T' = kt u' while it sticks, T' = kt u' - n (kt n . u' - R') on the circle of
radius R = mu N with n = T / R, T = 0 while open. On the circle that is not linear: the Taylor series comes from its own
recursion, its step from its last coefficients, and events are zeros of the guards' series as in `pieces`. Where a slip
begins or ends at N = 0 the equation is singular; it is entered and left at 1e-9 and 1e-12 of the largest load, which
the motion forgets. Newton has its Jacobian from differences.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Optional

import numpy as np
import numpy.typing as npt

from .flow import Event, OracleError
from .laws import Array
from .orbit import multipliers
from .pieces import DEGREE, ROUNDING, TO_BERNSTEIN, falls_below_zero
from .system import Pattern

#: Of the largest load: where a slip on a growing and on a vanishing circle begins and ends.
ENTERED, LEFT = 1e-9, 1e-12
ORDERS = np.arange(DEGREE + 1)


@dataclass(frozen=True)
class Pair:
    """Contact of two points along B (3, n_dof): normal (closing), two tangents. Parameters of `coulomb_3d`."""

    B: Array
    kn: float
    kt: float
    mu: float
    N0: float = 0.0
    gap: float = 0.0


@dataclass(frozen=True)
class Block:
    """M x'' + C x' + K x + sum B^T (N, T) = Re(P e^{i omega t}) + p; states (x, x', T of all pairs)."""

    M: Array
    C: Array
    K: Array
    pairs: list[Pair]
    P: npt.NDArray[Any]
    p: Array
    omega: float

    @property
    def n_dof(self) -> int:
        """Degrees of freedom."""
        return len(self.M)

    def load(self, j: int, x: Array) -> float:
        """N0 + kn (u_n - gap) of a pair, negative where it is open."""
        pair = self.pairs[j]
        return float(pair.N0 + pair.kn * (x[: self.n_dof] @ pair.B[0] - pair.gap))

    def traction(self, j: int) -> slice:
        """Where T of a pair stands."""
        at = 2 * self.n_dof + 2 * j
        return slice(at, at + 2)


@dataclass
class _Slip:
    """Series on the circle: R, 1 / R, n, kt u', and s, kt times the slider's speed."""

    R: Array
    inverse: Array
    n: Array
    d: Array
    s: Array

    @staticmethod
    def empty() -> _Slip:
        scalar, vector = np.zeros(DEGREE + 1), np.zeros((DEGREE + 1, 2))
        return _Slip(scalar.copy(), scalar.copy(), vector.copy(), vector.copy(), scalar.copy())

    def rate(self, k: int, T: Array, R: float, R_rate: float, d: Array) -> Array:
        """Coefficient k of T', from those of R, R' and d of that order and T up to it."""
        self.R[k], self.d[k] = R, d
        self.inverse[k] = (float(k == 0) - self.R[1 : k + 1] @ self.inverse[:k][::-1]) / self.R[0]
        self.n[k] = self.inverse[: k + 1][::-1] @ T[: k + 1]
        self.s[k] = (self.n[: k + 1] * self.d[: k + 1][::-1]).sum() - R_rate
        return d - self.s[: k + 1][::-1] @ self.n[: k + 1]


class Passage3d:
    """A motion from a state and a pattern (stick, slip, open) over a duration: steps, events, end."""

    def __init__(self, block: Block, state: Array, pattern: Pattern, duration: float, share: float = 1.0) -> None:
        self.block, self.t, self.y, self.share = block, 0.0, np.array(state, float), share
        self.pattern: list[str] = list(pattern)
        self.events: list[Event] = []
        self.steps: list[tuple[float, float, Array]] = []  #: time, length, coefficients of sigma in [0, 1]
        self.inverse = np.linalg.inv(block.M)
        self.sizes = np.zeros(len(self.y))
        self._measure()
        for j, word in enumerate(pattern):
            self._enter(j, word)
        at_once = 0
        while self.t < duration:
            before = self.t
            self._step(duration)
            at_once = at_once + 1 if self.t == before else 0
            if at_once > 8 * len(self.pattern):
                raise OracleError(f"the contacts find no state at t = {self.t}: {self.pattern}")

    def _measure(self) -> None:
        """Largest |x|, |x'| and T so far, and the load that goes with them."""
        n = self.block.n_dof
        for kind in (slice(0, n), slice(n, 2 * n), slice(2 * n, None)):
            if len(self.y[kind]):
                self.sizes[kind] = np.maximum(self.sizes[kind], abs(self.y[kind]).max())
        reach = [abs(p.N0) + p.kn * (abs(p.B[0]) @ self.sizes[:n]) for p in self.block.pairs]
        self.most = max([1e-300, *reach])

    def _series(self) -> tuple[Array, dict[int, _Slip]]:
        """Taylor coefficients in time of the state, and of what circles need."""
        block, n = self.block, self.block.n_dof
        y = np.zeros((DEGREE + 1, len(self.y)))
        y[0] = self.y
        slips = {j: _Slip.empty() for j, word in enumerate(self.pattern) if word == "slip"}
        wave = block.P * np.exp(1j * block.omega * self.t)
        for k in range(DEGREE):
            x, v = y[k, :n], y[k, n : 2 * n]
            push = wave.real - block.K @ x - block.C @ v + (block.p if k == 0 else 0)
            for j, pair in enumerate(block.pairs):
                if self.pattern[j] == "open":
                    continue
                at = block.traction(j)
                N = pair.kn * (pair.B[0] @ x) + (pair.N0 - pair.kn * pair.gap if k == 0 else 0)
                push -= pair.B[0] * N + pair.B[1:].T @ y[k, at]
                rate = d = pair.kt * (pair.B[1:] @ v)
                if j in slips:
                    rate = slips[j].rate(k, y[:, at], pair.mu * N, pair.mu * pair.kn * (pair.B[0] @ v), d)
                y[k + 1, at] = rate / (k + 1)
            y[k + 1, :n], y[k + 1, n : 2 * n] = v / (k + 1), self.inverse @ push / (k + 1)
            wave = wave * 1j * block.omega / (k + 1)
        return y, slips

    def _length(self, y: Array) -> float:
        """Step whose last coefficients are rounding, of each kind by itself."""
        n, h = self.block.n_dof, np.inf
        for kind in (slice(0, n), slice(n, 2 * n), slice(2 * n, None)):
            size = max(abs(y[0, kind]).max(initial=0), self.sizes[kind].max(initial=0))
            for k in (DEGREE - 1, DEGREE):
                last = abs(y[k, kind]).max(initial=0)
                if last > 0 and size > 0:
                    h = min(h, (1e-17 * size / last) ** (1 / k))
        return self.share * min(h, 0.1 * 2 * np.pi / self.block.omega)

    def _guards(self, y: Array, slips: dict[int, _Slip]) -> Iterator[tuple[int, str, Array, float]]:
        """Pair, state that follows where the series falls below zero, the series, the size of its terms."""
        for j, pair in enumerate(self.block.pairs):
            moved = pair.kn * (y[:, : self.block.n_dof] @ pair.B[0])
            N = moved + (pair.N0 - pair.kn * pair.gap) * (ORDERS == 0)
            size = max(abs(pair.N0), abs(moved[0]))
            if self.pattern[j] == "open":
                yield j, "closed", -N, size
                continue
            yield j, "open", N, size
            if self.pattern[j] == "stick":
                R, T = pair.mu * N, y[:, self.block.traction(j)]
                square = [R[: k + 1] @ R[k::-1] for k in ORDERS], [(T[: k + 1] * T[k::-1]).sum() for k in ORDERS]
                yield j, "slip", np.subtract(*square), square[0][0] + square[1][0]
            else:
                yield j, "stick", slips[j].s, float(abs(slips[j].d[0]).max())

    def _step(self, duration: float) -> None:
        y, slips = self._series()
        h = self._length(y)
        last = self.t + h >= duration
        h = min(h, duration - self.t)
        sigma, pair, follows = 2.0, -1, ""
        for j, word, c, size in self._guards(y, slips):
            found = first_zero(c * h**ORDERS, size)
            if found < sigma:
                sigma, pair, follows = found, j, word
        self._advance(y, h * min(sigma, 1.0))
        if pair >= 0:
            return self._change(pair, follows)
        if last:
            self.t = duration
        for j, word in enumerate(self.pattern):
            low = self.block.load(j, self.y) < LEFT * self.most
            if word == "slip" and low and self.block.pairs[j].B[0] @ self._speed() < 0:
                self._change(j, "open")

    def _advance(self, y: Array, h: float) -> None:
        if h > 0:
            self.steps.append((self.t, h, y * (h**ORDERS)[:, None]))
            self.y = self.steps[-1][2].sum(axis=0)
            self.t += h
            self._measure()

    def _speed(self) -> Array:
        return self.y[self.block.n_dof : 2 * self.block.n_dof]

    def _change(self, j: int, follows: str) -> None:
        before, pair = self.pattern[j], self.block.pairs[j]
        if follows == "closed":
            d, closing = pair.kt * (pair.B[1:] @ self._speed()), pair.kn * (pair.B[0] @ self._speed())
            follows = "stick" if np.linalg.norm(d) <= pair.mu * closing else "slip"
            if follows == "slip":
                self._advance(self._series()[0], ENTERED * self.most / closing)
        self.events.append(Event(self.t, j, before, follows))
        self._enter(j, follows)

    def _enter(self, j: int, word: str) -> None:
        """Put T where the state has it: on its circle, or at zero."""
        block, at = self.block, self.block.traction(j)
        R = block.pairs[j].mu * block.load(j, self.y)
        if word == "slip" and R <= 0:
            word = "open"
        if word == "open":
            self.y[at] = 0.0
        elif word == "slip":
            T = self.y[at] if self.y[at].any() else block.pairs[j].B[1:] @ self._speed()
            self.y[at] = T * (R / np.linalg.norm(T))
        self.pattern[j] = word


def first_zero(a: Array, size: float) -> float:
    """First sigma in [0, 1] at which a series falls below zero; a zero it begins with is none. 2: nowhere."""
    found = np.flatnonzero(abs(a) > ROUNDING * size)
    if not len(found):
        return 2.0
    first = int(found[0])
    if a[first] < 0:
        return 0.0
    c = np.concatenate([a[first:], np.zeros(first)])
    return 2.0 if (TO_BERNSTEIN @ c).min() >= 0 else falls_below_zero(c)


@dataclass(frozen=True)
class Orbit3d:
    """A periodic motion of a block; `multipliers` from differences, within about 1e-6."""

    block: Block
    state: Array
    pattern: Pattern
    passage: Passage3d
    defect: float
    multipliers: npt.NDArray[np.complex128]

    @property
    def events(self) -> list[Event]:
        """Changes of state in the period."""
        return self.passage.events

    def harmonics(self, highest: int) -> npt.NDArray[np.complex128]:
        """q_n = Qc_n - i Qs_n of (x, x', T), n = 0 .. highest: (n_state, highest + 1)."""
        w, n = self.block.omega, np.arange(highest + 1)
        node, weight = np.polynomial.legendre.leggauss(20 + highest)
        sigma = (node + 1) / 2
        out = np.zeros((len(self.state), highest + 1), complex)
        for t, h, c in self.passage.steps:
            waves = np.exp(-1j * w * np.outer(t + h * sigma, n)) * (weight * h / 2 * w / np.pi)[:, None]
            out += (sigma[:, None] ** ORDERS @ c).T @ waves
        out[:, 0] /= 2
        return out


def orbit_3d(
    block: Block,
    state: Optional[Array] = None,
    pattern: Optional[Pattern] = None,
    settle: int = 15,
    share: float = 1.0,
    tolerance: float = 1e-11,
) -> Orbit3d:
    """The periodic response of a block from rest (or a state): transient, then Newton on its period.

    Raises
    ------
    OracleError
        The defect, relative to the largest displacement, velocity and traction, stays above the tolerance.
    """
    T, m = 2 * np.pi / block.omega, 2 * block.n_dof + 2 * len(block.pairs)
    y = np.zeros(m) if state is None else np.asarray(state, float)
    words = tuple("open" if block.load(j, y) <= 0 else "stick" for j in range(len(block.pairs)))
    words, best = (words if pattern is None else pattern), np.inf
    for _ in range(settle):
        begun = Passage3d(block, y, words, T, share)
        y, words = begun.y, tuple(begun.pattern)
    passage, Phi = Passage3d(block, y, words, T, share), None
    for _ in range(30):
        r, sizes = passage.y - y, np.where(passage.sizes > 0, passage.sizes, 1.0)
        defect = float((abs(r) / sizes).max())
        if defect <= tolerance and defect >= best / 4 and Phi is not None:
            return Orbit3d(block, y, words, passage, defect, multipliers(Phi))
        if Phi is None or defect > best / 10 > tolerance:
            Phi = _monodromy(block, y, words, T, share, passage)
        best = min(best, defect)
        y = y + _newton(block, passage, Phi - np.eye(m), r, sizes)
        passage = Passage3d(block, y, words, T, share)
    raise OracleError(f"no periodic motion: |y(T) - y(0)| stays at {best:.1e}, {tolerance:.0e} wanted")


def _monodromy(block: Block, y: Array, words: Pattern, T: float, share: float, passage: Passage3d) -> Array:
    """dy(T) / dy(0) by differences."""
    Phi = np.empty((len(y), len(y)))
    for k, size in enumerate(np.where(passage.sizes > 0, passage.sizes, 1.0)):
        dy = 1e-7 * size * np.eye(len(y))[k]
        Phi[:, k] = (Passage3d(block, y + dy, words, T, share).y - passage.y) / (1e-7 * size)
    return Phi


def _newton(block: Block, passage: Passage3d, J: Array, r: Array, sizes: Array) -> Array:
    """J dy = - r, where T - kt u of pairs that never slip nor open stays as it is."""
    changing, keep = {event.contact for event in passage.events}, []
    for j, pair in enumerate(block.pairs):
        if j not in changing and passage.pattern[j] == "stick":
            rows = np.zeros((2, len(r)))
            rows[:, block.traction(j)] = np.eye(2) / pair.kt
            rows[:, : block.n_dof] = -pair.B[1:]
            keep.append(rows / sizes[0])
    wide = np.concatenate(keep) if keep else np.zeros((0, len(r)))
    rows = np.vstack([J / sizes[:, None], wide]) * sizes
    return np.asarray(np.linalg.lstsq(rows, np.concatenate([-r / sizes, np.zeros(len(wide))]), rcond=1e-13)[0] * sizes)
