"""The motion from a state over a time: steps, events, and the derivative of its end by its beginning."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Optional

import numpy as np

from .laws import Array
from .pieces import ROUNDING, Piece
from .system import Pattern, System


class OracleError(Exception):
    """No consistent state, or no periodic motion."""


@dataclass(frozen=True)
class Step:
    """y(t + sigma piece.step) for sigma in [0, length]; `tangent`: d y(t) / d y(begin) where asked for."""

    t: float
    length: float
    y: Array
    piece: Piece
    pattern: Pattern
    tangent: Optional[Array]


@dataclass(frozen=True)
class Event:
    """A contact that changes its state."""

    t: float
    contact: int
    before: str
    after: str


@dataclass(frozen=True)
class Passage:
    """A motion: its steps and events, its end y, and the monodromy d y(end) / d y(begin) where asked for."""

    steps: list[Step]
    events: list[Event]
    end: Array
    pattern: Pattern
    monodromy: Optional[Array]
    sizes: Array  #: largest |y| on the way by kind (all displacements, all velocities, each inner state); 1 for none


class Flow:
    """Passages of one system. `share` < 1 shortens all steps, to see that nothing depends on them."""

    def __init__(self, system: System, share: float = 1.0) -> None:
        self.system, self.share = system, share
        self.pieces: dict[Pattern, Piece] = {}
        n = system.n_dof
        self._kinds = [slice(0, n), slice(n, 2 * n), *[slice(k, k + 1) for k in range(2 * n, system.n_state + 3)]]

    def piece(self, pattern: Pattern) -> Piece:
        """The linear system of a pattern, made once."""
        if pattern not in self.pieces:
            self.pieces[pattern] = Piece(self.system.linear(pattern), self.share)
        return self.pieces[pattern]

    def passage(self, y: Array, pattern: Pattern, duration: float, tangent: bool = False) -> Passage:
        """From y in a pattern over a duration [s]; a pattern that y contradicts is left at once."""
        return _Walk(self, y, pattern, tangent).over(duration)

    def sizes(self, y: Array) -> Array:
        """|y| by kind: all displacements alike, all velocities alike."""
        big = np.empty_like(y)
        for kind in self._kinds:
            big[kind] = abs(y[kind]).max()
        return big


class _Walk:
    """One passage while it is made."""

    def __init__(self, flow: Flow, y: Array, pattern: Pattern, tangent: bool) -> None:
        self.flow, self.t = flow, 0.0
        self.steps: list[Step] = []
        self.events: list[Event] = []
        self.monodromy = np.eye(len(y)) if tangent else None
        self.pattern, self.piece = pattern, flow.piece(pattern)
        self.y, self.big = y.copy(), flow.sizes(y)
        self._land()
        if self.monodromy is not None:
            self.monodromy = self.piece.linear.land @ self.monodromy
        for _ in range(8 * len(pattern) + 1):
            violated = self._violated()
            if not violated:
                return
            self._settle(*self.piece.owners[violated[0]], set())
            if self.monodromy is not None:
                self.monodromy = self.piece.linear.land @ self.monodromy
        raise OracleError(f"no state of the contacts is consistent at t = 0: {self.pattern}")

    def over(self, duration: float) -> Passage:
        begun = True
        while self.t < duration:
            most = min(1.0, (duration - self.t) / self.piece.step)
            coefficients = self.piece.beginning(self.y, self.big)[0] if begun else None
            sigma, guard = self.piece.first_zero(self.y, coefficients)
            begun = sigma <= most
            self._advance(min(sigma, most))
            if most < 1.0 and not begun:
                break
            if begun:
                self._change(guard)
        sizes = np.where(self.big > 0, self.big, 1.0)
        return Passage(self.steps, self.events, self.y, self.pattern, self.monodromy, sizes)

    def _advance(self, sigma: float) -> None:
        self.steps.append(Step(self.t, sigma, self.y, self.piece, self.pattern, self.monodromy))
        self.y = self.piece.after(self.y, sigma)
        if self.monodromy is not None:
            self.monodromy = self.piece.after(self.monodromy, sigma)
        self.big = np.maximum(self.big, self.flow.sizes(self.y))
        self.t += sigma * self.piece.step

    def _violated(self) -> list[int]:
        """Guards that fall below zero from here on."""
        return [int(g) for g in np.flatnonzero(self.piece.beginning(self.y, self.big)[1] < 0)]

    def _change(self, guard: int) -> None:
        """An event, and those at the same time that have surfaces of their own."""
        for _ in range(8 * len(self.pattern) + 1):
            row, rate, before = self.piece.rows[guard], self.piece.A @ self.y, self.monodromy
            self._settle(*self.piece.owners[guard], set())
            self._jump(row, rate, before)
            violated = self._violated()
            if not violated:
                return
            guard = violated[0]
        raise OracleError(f"the contacts find no state at t = {self.t}: {self.pattern}")

    def _settle(self, contact: int, follows: str, seen: set[Pattern]) -> None:
        """Take a contact to its next state, and on while that one cannot hold either (a slider that turns at once),
        and others with it whose force has jumped over their limit."""
        before = self.pattern[contact]
        self.pattern = tuple(follows if j == contact else s for j, s in enumerate(self.pattern))
        self.piece = self.flow.piece(self.pattern)
        self._land()
        self.events.append(Event(self.t, contact, before, follows))
        if self.pattern in seen:
            raise OracleError(f"the contacts come back to {self.pattern} at t = {self.t}")
        seen.add(self.pattern)
        small = ROUNDING * (abs(self.piece.rows) @ self.big)
        for g in self._violated():
            if self.piece.owners[g][0] == contact or self.piece.rows[g] @ self.y < -small[g]:
                return self._settle(*self.piece.owners[g], seen)

    def _land(self) -> None:
        self.y = self.piece.linear.land @ self.y

    def _jump(self, row: Array, rate: Array, before: Optional[Array]) -> None:
        """Saltation: a motion perturbed by dy meets the surface row . y = 0 later by - row . dy / (row . y')."""
        if before is None:
            return
        speed, change = row @ rate, self.piece.A @ self.y - rate
        after = before
        if abs(speed) > ROUNDING * (abs(row) @ (abs(self.piece.A) @ self.big)):  # else it only touches
            after = before + np.outer(change, row @ before) / speed
        self.monodromy = self.piece.linear.land @ after


def from_rest(system: System, periods: float, share: float = 1.0, state: Optional[Sequence[float]] = None) -> Passage:
    """The transient from rest, or from a state, over some periods of the force."""
    y = system.extended(np.zeros(system.n_state) if state is None else np.asarray(state, float))
    return Flow(system, share).passage(y, system.start, periods * 2 * np.pi / system.omega)
