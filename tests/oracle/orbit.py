"""Periodic motions: shooting, Floquet multipliers, and what is read from them, all to rounding."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Optional

import numpy as np
import numpy.typing as npt

from .flow import Event, Flow, OracleError, Passage
from .laws import Array, Coulomb, Jenkins, LoadedJenkins
from .system import Pattern, System


@dataclass(frozen=True)
class Orbit:
    """A periodic motion of a system.

    Attributes
    ----------
    state, pattern : (x, x', s) and the contacts' states at t = 0
    period : [s]
    defect : largest |y(T) - y(0)|, relative to the largest displacement, velocity or inner state
    multipliers : Floquet multipliers, largest first, of the inner states as well
    """

    system: System
    state: Array
    pattern: Pattern
    period: float
    passage: Passage
    defect: float
    multipliers: npt.NDArray[np.complex128]

    @property
    def events(self) -> list[Event]:
        """Changes of state in the period."""
        return self.passage.events

    def harmonics(self, rows: Any, highest: int) -> npt.NDArray[np.complex128]:
        """q_n = Qc_n - i Qs_n of rows . y, n = 0 .. highest: (..., highest + 1)."""
        t, weight, y = nodes(self.passage, 14 + _oscillations(self.passage, self.period, highest))
        waves = np.exp(-2j * np.pi / self.period * np.outer(t, np.arange(highest + 1)))
        waves *= (2 * weight / self.period)[:, None]
        waves[:, 0] /= 2
        return (np.asarray(rows) @ y.T) @ waves

    def sampled(self, row: Array, count: int = 1000) -> tuple[Array, Array]:
        """Times, and row . y there, equidistant over the period."""
        t = np.arange(count) * self.period / count
        starts = np.array([step.t for step in self.passage.steps])
        value = np.empty(count)
        for k, at in enumerate(t):
            step = self.passage.steps[int(np.searchsorted(starts, at, "right")) - 1]
            value[k] = row @ step.piece.after(step.y, (at - step.t) / step.piece.step)
        return t, value

    def peak(self, row: Array) -> float:
        """Largest |row . y|, where its derivative vanishes or at an event."""
        best = 0.0
        for step in self.passage.steps:
            c = row @ (step.piece.taylor @ step.y).T
            grid = np.linspace(0, step.length, 9)
            value = np.polyval(c[::-1], grid)
            slope = np.polyder(np.poly1d(c[::-1]))
            at = grid[abs(value).argmax()]
            for _ in range(8):
                bend = np.polyder(slope)(at)
                at = float(np.clip(at - slope(at) / bend if bend else at, 0, step.length))
            best = max(best, abs(value).max(), abs(np.polyval(c[::-1], at)))
        return float(best)

    def work(self) -> Array:
        """Dissipated by each contact over a period, the integral of f u' [J]."""
        total = np.zeros(len(self.system.contacts))
        for step in self.passage.steps:
            _, weight, y = nodes(replace(self.passage, steps=[step]), 22)
            for j, contact in enumerate(self.system.contacts):
                power = (y @ step.piece.linear.forces[j]) * (y @ self.system.velocity(contact.B))
                total[j] += weight @ power
        return total


def nodes(passage: Passage, count: int, tangent: bool = False) -> tuple[Array, Array, Array]:
    """Times (k,), weights (k,) [s] and y (k, n) of a Gauss rule, `count` nodes a step; `tangent`: dy / dy(0)."""
    x, w = np.polynomial.legendre.leggauss(count)
    times, weights, values = [], [], []
    for step in passage.steps:
        sigma = step.length * (x + 1) / 2
        times.append(step.t + step.piece.step * sigma)
        weights.append(step.piece.step * step.length / 2 * w)
        powers = sigma[:, None] ** np.arange(len(step.piece.taylor))
        values.append(np.tensordot(powers, step.piece.taylor @ (step.tangent if tangent else step.y), 1))
    return np.concatenate(times), np.concatenate(weights), np.concatenate(values)


def _oscillations(passage: Passage, period: float, order: int) -> int:
    """Phase of a harmonic over the longest step [rad]."""
    longest = max(step.length * step.piece.step for step in passage.steps)
    return int(order * 2 * np.pi / period * longest)


def linear_response(system: System) -> Array:
    """(x, x', s) at t = 0 of the response that never leaves the pattern at rest, sliders at their rest."""
    m, A = system.n_state, system.linear(system.start).A
    keep = constants(system, list(range(len(system.contacts))))
    Z = np.linalg.solve(1j * system.omega * np.eye(m) - A[:m, :m], A[:m, -3] - 1j * A[:m, -2])
    mean = np.linalg.lstsq(np.vstack([A[:m, :m], keep]), np.concatenate([-A[:m, -1], np.zeros(len(keep))]), rcond=None)
    return np.asarray(Z.real + mean[0])


def constants(system: System, contacts: list[int]) -> Array:
    """Rows over (x, x', s) of what stays as it is while these contacts stick [m]: f / kt - u, u of rigid ones."""
    m, rows = system.n_state, []
    for j in contacts:
        law = system.contacts[j]
        if isinstance(law, Coulomb):
            rows.append(system.displacement(law.B)[:m])
        elif isinstance(law, (Jenkins, LoadedJenkins)):
            rows.append(np.eye(m)[system.inner_at(j)] / law.kt - system.displacement(law.B)[:m])
    return np.array(rows).reshape(-1, m)


def newton_step(system: System, passage: Passage, J: Array, r: Array, sizes: Array) -> Array:
    """J dz = - r, where contacts that stick all over the period leave their place as it is: a datum, not a result."""
    changing = {event.contact for event in passage.events}
    keep = constants(system, [j for j, s in enumerate(passage.pattern) if s == "stick" and j not in changing])
    wide = np.zeros((len(keep), J.shape[1]))
    wide[:, : keep.shape[1]] = keep / sizes[: system.n_dof].max()
    rows = np.vstack([J / sizes[:, None], wide]) * sizes
    return np.linalg.lstsq(rows, np.concatenate([-r / sizes, np.zeros(len(keep))]), rcond=1e-15)[0] * sizes


def forced_orbit(
    system: System,
    state: Optional[Array] = None,
    pattern: Optional[Pattern] = None,
    settle: float = 0,
    periods: int = 1,
    share: float = 1.0,
    tolerance: float = 1e-12,
) -> Orbit:
    """The periodic response to the system's force.

    Parameters
    ----------
    state, pattern : (x, x', s) where to begin; default the linear response
    settle : periods of transient before the first Newton step; more where it fails
    periods : of the force in one of the motion
    share : shortens all steps by this factor

    Raises
    ------
    OracleError
        The defect stays above the tolerance.
    """
    period = periods * 2 * np.pi / system.omega
    flow = Flow(system, share)
    y = system.extended(linear_response(system) if state is None else np.asarray(state, float))
    pattern = system.start if pattern is None else pattern
    for _ in range(6):
        if settle:
            begun = flow.passage(y, pattern, settle * period)
            y, pattern = system.extended(begun.end[: system.n_state]), begun.pattern
        found = _shoot(flow, system, y, pattern, period, tolerance)
        if isinstance(found, Orbit):
            return found
        settle = max(2 * settle, 10)
    raise OracleError(f"no periodic motion: |y(T) - y(0)| stays at {found:.1e}, {tolerance:.0e} wanted")


def _shoot(flow: Flow, system: System, y: Array, pattern: Pattern, period: float, tolerance: float) -> Any:
    """Newton on y(T) - y(0) with the exact monodromy; the defect where it is not enough."""
    m, best = system.n_state, np.inf
    for attempt in range(12):
        try:
            passage = flow.passage(y, pattern, period, tangent=True)
        except OracleError:
            return best
        pattern = passage.steps[0].pattern
        assert passage.monodromy is not None
        r, Phi = (passage.end - y)[:m], passage.monodromy[:m, :m]
        sizes = passage.sizes[:m]
        defect = float((abs(r) / sizes).max())
        if defect <= tolerance and (attempt and defect >= best / 4 or defect < 1e-15):
            return Orbit(system, y[:m], pattern, period, passage, defect, multipliers(Phi))
        best = min(best, defect)
        y = system.extended(y[:m] + newton_step(system, passage, Phi - np.eye(m), r, sizes))
    return best


def multipliers(Phi: Array) -> npt.NDArray[np.complex128]:
    """Eigenvalues, largest first."""
    values = np.linalg.eigvals(Phi).astype(complex)
    return values[np.lexsort((-values.imag, -abs(values).round(14)))]
