"""Direct time integration: free motions that may diverge, forced motions until they are steady."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from ..harmonic_motion import complex_amplitudes
from .cycles import harmonic_amplitude

Array = npt.NDArray[np.float64]

#: periods integrated between two looks at the amplitude of a forced motion
PIECE = 10
#: a forced motion is steady when the fundamental's relative change over a period, divided by the part that is
#: lost in a period (so that slow convergence is not mistaken for an end), stays below this for `STEADY_PERIODS`
STEADY = 2e-5
STEADY_PERIODS = 4
MOST_PERIODS = 1500


class TimeIntegrator(Protocol):
    """What is used of :class:`fretwave.Transient`."""

    def run(
        self, x0: Array, v0: Array, t_end: float, dt_out: float, rtol: float = ..., limit: float = ...
    ) -> Mapping[str, Any]: ...


@dataclass(frozen=True)
class Motion:
    """Motion of one dof (n,) each; `diverged` when it was stopped by the limit."""

    t: Array
    x: Array
    v: Array
    diverged: bool


@dataclass(frozen=True)
class SteadyState:
    """Steady forced motion: fundamental amplitude, periods it took, and the state at its end."""

    amplitude: float
    periods: int
    steady: bool
    end: tuple[Array, Array]


def start_state(labels: list[str], coefficients: Array, beta: float, omega: float) -> tuple[Array, Array]:
    """Displacement and velocity (n_dof,) of a nonlinear mode's motion at t = 0, all harmonics included."""
    amplitudes = complex_amplitudes(labels, coefficients)
    x0 = sum(q.real for q in amplitudes.values())
    v0 = sum((n * (-beta + 1j * omega) * q).real for n, q in amplitudes.items())
    return np.asarray(x0, dtype=float), np.asarray(v0, dtype=float)


def free_motion(
    integrator: TimeIntegrator,
    state: tuple[Array, Array],
    dof: int,
    step: float,
    count: int,
    tolerance: float,
    limit: float = np.inf,
) -> Motion:
    """Integrate over `count` output steps, or until |x| of any dof exceeds `limit`. Collective.

    Parameters
    ----------
    state : displacement and velocity (n_dof,) at t = 0
    step : between outputs [s]
    """
    run = integrator.run(*state, count * step, step, rtol=tolerance, limit=limit)
    t, x, v = (np.asarray(run[key], dtype=float) for key in ("t", "x", "v"))
    return Motion(t, x[:, dof], v[:, dof], not run["finished"])


def steady_motion(
    integrator: TimeIntegrator, state: tuple[Array, Array], dof: int, omega: float, samples: int, tolerance: float
) -> SteadyState:
    """Integrate a forced motion period by period until the fundamental of the dof is steady. Collective.

    Parameters
    ----------
    integrator : its force has the angular frequency `omega` [rad/s] and phase zero at t = 0
    """
    period = 2.0 * np.pi / omega
    amplitudes: list[float] = []
    while len(amplitudes) < MOST_PERIODS and not _is_steady(amplitudes):
        piece = integrator.run(*state, PIECE * period, period / samples, rtol=tolerance)
        # the integrator may give one sample beyond the end
        state = piece["x"][PIECE * samples], piece["v"][PIECE * samples]
        motion = np.asarray(piece["x"])[: PIECE * samples, dof].reshape(PIECE, samples)
        amplitudes += [harmonic_amplitude(one) for one in motion]
    return SteadyState(amplitudes[-1], len(amplitudes), _is_steady(amplitudes), state)


def _is_steady(amplitudes: list[float]) -> bool:
    """Remaining distance estimated as change / (1 - ratio of successive changes), for the last few periods."""
    if len(amplitudes) < 2 * STEADY_PERIODS:
        return False
    change = np.abs(np.diff(amplitudes[-STEADY_PERIODS - 2 :])) + 1e-300
    ratio = np.clip((change[-1] / change[0]) ** (1.0 / (len(change) - 1)), 0.0, 0.999)
    return bool(change.max() / (1.0 - ratio) <= STEADY * amplitudes[-1])
