"""Nonlinear modes by the extended periodic motion concept (Krack 2015), exact.

M x'' + (C - 2 zeta w0 M) x' + K x + f = 0 has a periodic motion of a given fundamental amplitude; unknowns are its
start, its period and the damping.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Optional

import numpy as np

from .flow import Flow, OracleError, Passage
from .laws import Array
from .orbit import Orbit, multipliers, newton_step, nodes
from .system import Pattern, System


@dataclass(frozen=True)
class ModeOrbit(Orbit):
    """A periodic motion under the damping - 2 zeta w0 M; `amplitude` is that of the fundamental of `dof`."""

    amplitude: float
    g: float  #: 2 zeta w0 [1/s]

    @property
    def omega0(self) -> float:
        """[rad/s]"""
        return 2 * np.pi / self.period

    @property
    def zeta(self) -> float:
        """Modal damping ratio."""
        return self.g / (2 * self.omega0)

    @property
    def lambda_(self) -> complex:
        """- zeta w0 + i w0 sqrt(1 - zeta^2), as a mode table reports it."""
        return self.omega0 * complex(-self.zeta, np.sqrt(1 - self.zeta**2))


@dataclass(frozen=True)
class _Equations:
    """Periodicity and normalisation at (state, T, g)."""

    system: System
    dof: int
    goal: complex  #: q_1 of `dof` from t = 0 on
    share: float

    def passage(self, z: Array, pattern: Pattern, tangent: bool) -> Passage:
        m = self.system.n_state
        damped = replace(self.system, C=self.system.C - z[m + 1] * self.system.M)
        return Flow(damped, self.share).passage(damped.extended(z[:m]), pattern, z[m], tangent)

    def fundamental(self, passage: Passage, period: float, tangent: bool = False) -> Any:
        """(2 / T) int e^{-2 pi i t / T} x dt, of the motion or of its derivative by the start."""
        t, weight, y = nodes(passage, 20, tangent)
        wave = 2 / period * weight * np.exp(-2j * np.pi * t / period)
        return np.tensordot(wave, y[:, self.dof], 1)

    def residual(self, z: Array, passage: Passage) -> Array:
        m = self.system.n_state
        off = self.fundamental(passage, z[m]) - self.goal
        return np.concatenate([(passage.end[:m] - z[:m]), [off.real, off.imag]])

    def jacobian(self, z: Array, pattern: Pattern, passage: Passage) -> Array:
        """By the start with the monodromy, by T in closed form, by g from differences."""
        m, T = self.system.n_state, z[self.system.n_state]
        assert passage.monodromy is not None
        J = np.zeros((m + 2, m + 2))
        J[:m, :m] = passage.monodromy[:m, :m] - np.eye(m)
        by_start = self.fundamental(passage, T, tangent=True)[:m]
        t, weight, y = nodes(passage, 20)
        moving = 2 / T * (weight * 2j * np.pi * t / T**2 * np.exp(-2j * np.pi * t / T)) @ y[:, self.dof]
        by_period = moving + (2 * passage.end[self.dof] - self.fundamental(passage, T)) / T
        last = passage.steps[-1]
        J[:m, m] = (last.piece.A @ passage.end)[:m]
        J[m, :m], J[m + 1, :m] = by_start.real, by_start.imag
        J[m, m], J[m + 1, m] = by_period.real, by_period.imag
        ends = []
        for sign in (1, -1):
            other = z.copy()
            other[m + 1] += sign * 1e-6 * 2 * np.pi / T
            ends.append(self.residual(other, self.passage(other, pattern, False)))
        J[:, m + 1] = (ends[0] - ends[1]) / (2e-6 * 2 * np.pi / T)
        return J


def mode_orbit(
    system: System,
    dof: int,
    amplitude: float,
    omega0: float,
    zeta: float,
    state: Array,
    pattern: Optional[Pattern] = None,
    phase: float = 0.0,
    share: float = 1.0,
    tolerance: float = 1e-12,
) -> ModeOrbit:
    """The periodic motion whose fundamental is amplitude cos(w0 t + phase) at `dof`.

    Parameters
    ----------
    omega0, zeta, state, pattern : a motion nearby, (x, x', s) at t = 0
    phase : of t = 0 in the period, to keep it off events

    Raises
    ------
    OracleError
        The defect stays above the tolerance.
    """
    m, T = system.n_state, 2 * np.pi / omega0
    equations = _Equations(system, dof, amplitude * np.exp(1j * phase), share)
    z = np.concatenate([np.asarray(state, float)[:m], [T, 2 * zeta * omega0]])
    pattern = system.start if pattern is None else pattern
    best = np.inf
    for attempt in range(25):
        passage = equations.passage(z, pattern, tangent=True)
        pattern = passage.steps[0].pattern
        r = equations.residual(z, passage)
        scale = np.concatenate([passage.sizes[:m], [amplitude, amplitude]])
        defect = float((abs(r) / scale).max())
        if defect <= tolerance and (attempt and defect >= best / 4 or defect < 1e-15):
            assert passage.monodromy is not None
            damped = replace(system, C=system.C - z[m + 1] * system.M)
            found = damped, z[:m], pattern, float(z[m]), passage, defect, multipliers(passage.monodromy[:m, :m])
            return ModeOrbit(*found, amplitude, float(z[m + 1]))
        best = min(best, defect)
        J = equations.jacobian(z, pattern, passage)
        z = z + newton_step(system, passage, J, r, np.concatenate([scale[:m], [T, 1 / T]]))
        if not (np.isfinite(z).all() and 0.1 * T < z[m] < 10 * T):
            break
    raise OracleError(f"no periodic motion at amplitude {amplitude}: the defect stays at {best:.1e}")
