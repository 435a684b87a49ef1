"""Piecewise-linear contact laws: what holds while a contact stays in one state.

All is linear in the extended state y = (x, x', s, cos wt, sin wt, 1), s the contacts' inner states, so that a force, a
rate or a guard is a row vector over y. Forces act on the structure as - B^T f; relative displacement u = B x.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Optional

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
#: A row that has to stay above zero, and the state that follows where it does not.
Guard = tuple[Array, str]


@dataclass(frozen=True)
class Rows:
    """Row vectors over y of one contact: relative displacement, velocity, inner state, and the constant 1."""

    u: Array
    v: Array
    s: Array
    one: Array
    row: Callable[[Any], tuple[Array, Array]]  #: displacement and velocity along another direction of x


@dataclass(frozen=True)
class Local:
    """A contact in one of its states.

    force : row of f; None: f is whatever keeps u' at zero
    rate : row of s'
    landing : row of the value that s takes on entering the state; None: it stays as it is
    guards : of the row of the force, for where f is a constraint it is known only then
    """

    force: Optional[Array]
    rate: Optional[Array] = None
    landing: Optional[Array] = None
    guards: Callable[[Array], list[Guard]] = field(default=lambda force: [])


@dataclass(frozen=True)
class Law:
    """One contact along the direction B (n_dof,)."""

    B: Array

    #: has an inner state s
    inner = False

    @property
    def start(self) -> str:
        """The state at rest, under preloads alone."""
        return "stick"

    def local(self, state: str, y: Rows) -> Local:
        """The law in a state."""
        raise NotImplementedError


@dataclass(frozen=True)
class Jenkins(Law):
    """Elastic Coulomb slider: f = kt (u - w), |f| <= limit; s is f."""

    kt: float
    limit: float
    inner = True

    def local(self, state: str, y: Rows) -> Local:
        R = self.limit * y.one
        if state == "stick":
            return Local(y.s, self.kt * y.v, guards=lambda f: [(R - f, "+"), (R + f, "-")])
        sign = 1.0 if state == "+" else -1.0
        return Local(sign * R, landing=sign * R, guards=lambda f: [(sign * y.v, "stick")])


@dataclass(frozen=True)
class Unilateral(Law):
    """f = max(0, kn (u - gap)); a negative gap is a preload of - kn gap."""

    kn: float
    gap: float

    @property
    def start(self) -> str:
        """Closed by a preload."""
        return "closed" if self.gap < 0 else "open"

    def load(self, y: Rows) -> Array:
        """Row of kn (u - gap)."""
        return self.kn * (y.row(self.B)[0] - self.gap * y.one)

    def local(self, state: str, y: Rows) -> Local:
        N = self.load(y)
        if state == "open":
            return Local(0 * N, guards=lambda f: [(-N, "closed")])
        return Local(N, guards=lambda f: [(N, "open")])


@dataclass(frozen=True)
class Coulomb(Law):
    """Rigid friction: f = limit sgn u', and whatever within +- limit keeps u' = 0. B M^-1 B^T must not vanish."""

    limit: float

    def local(self, state: str, y: Rows) -> Local:
        R = self.limit * y.one
        if state == "stick":
            return Local(None, guards=lambda f: [(R - f, "+"), (R + f, "-")])
        sign = 1.0 if state == "+" else -1.0
        return Local(sign * R, guards=lambda f: [(sign * y.v, "stick")])


@dataclass(frozen=True)
class LoadedJenkins(Law):
    """Elastic Coulomb slider under the load N of a one-sided spring: f = kt (u - w), |f| <= mu N; w = u where open.

    The spring itself is a contact of its own: `normal` is only read here. s is f.
    """

    kt: float
    mu: float
    normal: Unilateral
    inner = True

    @property
    def start(self) -> str:
        """Sticks under a preload."""
        return "stick" if self.normal.gap < 0 else "open"

    def local(self, state: str, y: Rows) -> Local:
        N, Nrate = self.normal.load(y), self.normal.kn * y.row(self.normal.B)[1]
        R, Rrate = self.mu * N, self.mu * Nrate
        if state == "open":
            return Local(0 * N, landing=0 * N, guards=lambda f: [(-N, "stick")])
        if state == "stick":
            return Local(y.s, self.kt * y.v, guards=lambda f: [(N, "open"), (R - f, "+"), (R + f, "-")])
        sign = 1.0 if state == "+" else -1.0
        slip = sign * self.kt * y.v - Rrate  # kt times the slider's speed
        return Local(sign * R, sign * Rrate, sign * R, lambda f: [(N, "open"), (slip, "stick")])
