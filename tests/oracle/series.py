"""Harmonic balance in continuous time: what samples tend to at a given H, and with many harmonics the exact solution.

(K + s_n C + s_n^2 M) q_n + B^T F_n = P_n with F_n integrated exactly (`period`). The complex nonlinear mode (CNM),
s_n = n lambda, has its contact forces on the motion without decay: s_n = i n w - |n| beta is no derivative in time but
one along the period and a Hilbert transform, so that no differential equation has it as its periodic motion, and this
series is its definition. Orders up to `low` are Newton's, those above follow them by q_n = - Z_n^-1 B^T F_n.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Optional

import numpy as np

from .flow import OracleError
from .laws import Array
from .period import Complex, Hysteresis, hysteresis
from .system import System


@dataclass(frozen=True)
class SeriesMotion:
    """Coefficients q (n_dof, highest + 1), exponent lambda (EPMC, forced: i w0) and damping g of C - g M."""

    system: System
    method: str
    q: Complex
    lambda_: complex
    g: float
    defect: float
    periods: list[Hysteresis]

    @property
    def omega0(self) -> float:
        """|lambda| [rad/s]."""
        return abs(self.lambda_)

    @property
    def zeta(self) -> float:
        """Modal damping ratio."""
        return (self.g / 2 if self.method == "EPMC" else -self.lambda_.real) / self.omega0

    def state(self, phase: float = 0.0) -> Array:
        """(x, x', s) at a phase of the period, for an orbit to begin with."""
        n = np.arange(self.q.shape[1])
        waves = self.q * np.exp(1j * n * phase)
        x, v = waves.sum(axis=1).real, (n * self.lambda_ * waves).sum(axis=1).real
        return np.concatenate([x, v, [period.at(phase) for period in self.periods]])


class _Balance:
    """The equations up to `low`, with those above carried along."""

    def __init__(self, system: System, method: str, orders: range, low: int, dof: int, amplitude: float) -> None:
        self.system, self.method, self.dof, self.amplitude = system, method, dof, amplitude
        self.orders, self.low = orders, [n for n in orders if n <= low]
        self.high = [n for n in orders if n > low]
        self.free = method != "forced"

    def exponents(self, z: tuple[float, float]) -> tuple[complex, float]:
        """lambda and g of the scalars (beta or g, w)."""
        return (complex(-z[0], z[1]), 0.0) if self.method == "CNM" else (complex(0, z[1]), z[0])

    def stiffness(self, n: int, z: tuple[float, float]) -> Complex:
        lambda_, g = self.exponents(z)
        s, S = n * lambda_, self.system
        return S.K + s * (S.C - g * S.M) + s**2 * S.M

    def load(self, n: int) -> Complex:
        zero = np.zeros(self.system.n_dof, complex)
        return zero + (self.system.P if n == 1 and not self.free else self.system.p if n == 0 else 0)

    def contact(self, q: Complex) -> tuple[list[Hysteresis], Complex]:
        """Each contact's period, and B^T F (n_dof, highest + 1)."""
        periods, total = [], np.zeros_like(q)
        for law in self.system.contacts:
            periods.append(hysteresis(law, law.B @ q))  # type: ignore[arg-type]
            total += np.outer(law.B, periods[-1].force())
        return periods, total

    def newton(
        self, q: Complex, z: tuple[float, float], periods: list[Hysteresis], F: Complex
    ) -> tuple[Complex, Complex]:
        """Newton's step of the low orders and the scalars, with the residual."""
        N, k = self.system.n_dof, len(self.low)
        size = 2 * N * k + 2 * self.free
        r, J = np.zeros(size), np.zeros((size, size))
        blocks = np.zeros((k, N, k, N, 2), complex)
        for law, period in zip(self.system.contacts, periods):
            blocks += np.einsum("i,nmp,j->nimjp", law.B, period.derivative(self.low), law.B)
        R = np.zeros((k, N), complex)
        by_z = np.zeros((k, N, 2), complex)
        for i, n in enumerate(self.low):
            Z = self.stiffness(n, z)
            blocks[i, :, i, :, 0] += Z
            blocks[i, :, i, :, 1] += -1j * Z
            R[i] = Z @ q[:, n] + F[:, n] - self.load(n)
            by_z[i] = self._by_scalars(n, z, q[:, n])
        r[: 2 * N * k] = np.concatenate([R.real.ravel(), R.imag.ravel()])
        columns = np.moveaxis(blocks, -1, 2).reshape(k * N, 2 * k * N)
        J[: 2 * N * k, : 2 * N * k] = np.concatenate([columns.real, columns.imag])
        if self.free:
            at = self.low.index(1)
            J[: 2 * N * k, -2:] = np.concatenate([by_z.reshape(-1, 2).real, by_z.reshape(-1, 2).imag])
            J[-2, at * N + self.dof], J[-1, (k + at) * N + self.dof] = 1, 1
            r[-2], r[-1] = q[self.dof, 1].real - self.amplitude, -q[self.dof, 1].imag
        return np.linalg.solve(J, -r), R

    def _by_scalars(self, n: int, z: tuple[float, float], q: Complex) -> Complex:
        """d (Z_n q) / d z (n_dof, 2)."""
        lambda_, g = self.exponents(z)
        s, S = n * lambda_, self.system
        slope = (S.C - g * S.M + 2 * s * S.M) @ q
        if self.method == "CNM":
            return np.stack([-n * slope, 1j * n * slope], axis=1)
        return np.stack([-s * (S.M @ q), 1j * n * slope], axis=1)

    def solve(self, q: Complex, z: tuple[float, float], tolerance: float) -> tuple[Complex, tuple[float, float], float]:
        """Newton on the low orders; those above are set from their forces after each step."""
        k, N = len(self.low), self.system.n_dof
        size, best = abs(q[:, 1]).max(), np.inf
        for _ in range(60):
            periods, F = self.contact(q)
            step, _ = self.newton(q, z, periods, F)
            c, s = step[: 2 * N * k].reshape(2, k, N)
            new = q.copy()
            new[:, self.low] += (c - 1j * s).T
            new[:, 0] = new[:, 0].real
            turned = 0.0
            if self.free:
                z, turned = (z[0] + step[-2], z[1] + step[-1]), abs(step[-2:]).max() / abs(z[1])
            if self.high:
                total = self.contact(new)[1]
                for n in self.high:
                    new[:, n] = np.linalg.solve(self.stiffness(n, z), self.load(n) - total[:, n])
            change = max(abs(new - q).sum(axis=1).max() / size, turned)
            q, stalled = new, change >= best / 2
            best = min(best, change)
            if best <= tolerance and stalled:
                return q, z, best
            if not np.isfinite(change):
                break
        raise OracleError(f"harmonic balance in continuous time: steps stay at {best:.1e}, {tolerance:.0e} wanted")


def stuck_mode(system: System) -> tuple[float, Complex]:
    """Frequency [rad/s] and shape of the first mode with all sliders stuck."""
    from scipy.linalg import eigh

    K = system.K + sum(law.kt * np.outer(law.B, law.B) for law in system.contacts)  # type: ignore[attr-defined]
    values, shapes = eigh(K, system.M)
    return float(np.sqrt(values[0])), shapes[:, 0].astype(complex)


def series_motion(
    system: System,
    method: str,
    highest: int,
    dof: int = 0,
    amplitude: float = 0.0,
    guess: Optional[SeriesMotion] = None,
    low: int = 41,
    odd: bool = True,
    tolerance: float = 1e-12,
) -> SeriesMotion:
    """A motion with Jenkins contacts in harmonics up to `highest`, its contact forces integrated exactly.

    Parameters
    ----------
    method : CNM, EPMC (fundamental of `dof` is (amplitude, 0)), or forced (the system's force and omega)
    guess : a motion nearby; default the first stuck mode, or no motion
    low : highest order of Newton's unknowns

    Raises
    ------
    OracleError
        Newton's steps stay above the tolerance, relative to the fundamental.
    """
    orders = range(1, highest + 1, 2) if odd else range(highest + 1)
    balance = _Balance(system, method, orders, low, dof, amplitude)
    q = np.zeros((system.n_dof, highest + 1), complex)
    z = (0.0, system.omega)
    if guess is not None:
        kept = min(highest + 1, guess.q.shape[1])
        q[:, :kept] = guess.q[:, :kept]
        z = (guess.g if method == "EPMC" else -guess.lambda_.real, guess.lambda_.imag) if balance.free else z
        if balance.free:
            q *= amplitude / abs(q[dof, 1])
    elif balance.free:
        omega, shape = stuck_mode(system)
        q[:, 1], z = amplitude * shape / shape[dof], (0.0, omega)
    else:
        q[:, 1] = np.linalg.solve(
            balance.stiffness(1, z) + sum(law.kt * np.outer(law.B, law.B) for law in system.contacts),  # type: ignore
            system.P,
        )
    q, z, defect = balance.solve(q, z, tolerance)
    lambda_, g = balance.exponents(z)
    return SeriesMotion(system, method, q, lambda_, g, defect, balance.contact(q)[0])
