"""Direct time integration: free motions that may diverge, forced motions until they are steady."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol, Union

import numpy as np

from ..arrays import Array
from ..post.cycles import fundamental
from ..post.motion import complex_amplitudes

#: periods integrated between two looks at the amplitude of a forced motion
PIECE = 10
#: a forced motion is steady when the fundamental's relative change over a period, divided by the part that is
#: lost in a period (so that slow convergence is not mistaken for an end), stays below this for `STEADY_PERIODS`; its
#: amplitude and phase, for the amplitude of a beat that dies away stands still wherever it turns
STEADY = 2e-5
STEADY_PERIODS = 4
#: a fundamental of damping ratio 0.001 needs some 1700 of these
MOST_PERIODS = 3000
#: more explicit steps than a quarter of these give way to implicit ones; more implicit ones end the integration
STEPS_PER_PERIOD = 20_000


class TimeIntegrator(Protocol):
    """What is used of :class:`fretwave.Transient`."""

    def run(
        self,
        x0: Array,
        v0: Array,
        t_end: float,
        dt_out: float,
        rtol: float = ...,
        limit: float = ...,
        most_steps: float = ...,
    ) -> Mapping[str, Any]: ...


@dataclass(frozen=True)
class Motion:
    """What is seen of a motion, (n,) each; `diverged` when the limit stopped it, `stopped` says why before its end."""

    t: Array
    x: Array
    v: Array
    diverged: bool
    stopped: str = ""
    implicit: bool = False


@dataclass(frozen=True)
class SteadyState:
    """Steady forced motion: fundamental amplitude, periods it took, the state at its end; why it was not reached."""

    amplitude: float
    periods: int
    steady: bool
    end: tuple[Array, Array]
    stopped: str = ""


def start_state(labels: list[str], coefficients: Array, beta: float, omega: float) -> tuple[Array, Array]:
    """Displacement and velocity (n_dof,) of a nonlinear mode's motion at t = 0, all harmonics included."""
    amplitudes = complex_amplitudes(labels, coefficients)
    x0 = sum(q.real for q in amplitudes.values())
    v0 = sum((n * (-beta + 1j * omega) * q).real for n, q in amplitudes.items())
    return np.asarray(x0, dtype=float), np.asarray(v0, dtype=float)


def free_motion(
    integrator: TimeIntegrator,
    state: tuple[Array, Array],
    seen: Union[int, Array],
    step: float,
    count: int,
    tolerance: float,
    limit: float = np.inf,
    most_steps: float = np.inf,
) -> Motion:
    """Integrate over `count` output steps, or until |x| of any dof exceeds `limit`. Collective.

    Parameters
    ----------
    state : displacement and velocity (n_dof,) at t = 0
    seen : a dof, or weights (n_dof,)
    step : between outputs [s]
    most_steps : of the integrator itself
    """
    run = integrator.run(*state, count * step, step, rtol=tolerance, limit=limit, most_steps=most_steps)
    t, x, v = (np.asarray(run[key], dtype=float) for key in ("t", "x", "v"))
    return Motion(
        t, _along(x, seen), _along(v, seen), run["reason"] == "limit", _stopped(run, count * step), run["implicit"]
    )


def _along(x: Array, seen: Union[int, Array]) -> Array:
    """(n,) of motions (n, n_dof)."""
    return np.asarray(x[:, seen] if isinstance(seen, int) else x @ seen)


def _stopped(run: Mapping[str, Any], end: float) -> str:
    """Why an integration ended before its end; empty where it did not."""
    if run["reason"] in ("end", "limit"):
        return ""
    kind = "implicit" if run["implicit"] else "explicit"
    what = "it would take too many" if run["reason"] == "steps" else "no step is accurate enough, however short, of its"
    return f"time integration ended at {run['t'][-1]:.3g} of {end:.3g} s: {what} {kind} steps"


def steady_motion(
    integrator: TimeIntegrator,
    state: tuple[Array, Array],
    seen: Union[int, Array],
    omega: float,
    samples: int,
    tolerance: float,
) -> SteadyState:
    """Integrate a forced motion period by period until the fundamental of what is seen is steady. Collective.

    Parameters
    ----------
    seen : a dof, or weights (n_dof,)
    integrator : its force has the angular frequency `omega` [rad/s] and phase zero at t = 0
    """
    period = 2.0 * np.pi / omega
    found: list[complex] = []
    while len(found) < MOST_PERIODS and not _is_steady(found):
        most = PIECE * STEPS_PER_PERIOD
        piece = integrator.run(*state, PIECE * period, period / samples, rtol=tolerance, most_steps=most)
        stopped = _stopped(piece, PIECE * period)
        if stopped:
            return SteadyState(abs(found[-1]) if found else np.nan, len(found), False, state, stopped)
        # the integrator may give one sample beyond the end
        state = piece["x"][PIECE * samples], piece["v"][PIECE * samples]
        motion = _along(np.asarray(piece["x"])[: PIECE * samples], seen).reshape(PIECE, samples)
        found += map(fundamental, motion)
    return SteadyState(abs(found[-1]), len(found), _is_steady(found), state)


def _is_steady(found: list[complex]) -> bool:
    """Remaining distance estimated as change / (1 - ratio of successive changes), for the last few periods."""
    if len(found) < 2 * STEADY_PERIODS:
        return False
    change = np.abs(np.diff(found[-STEADY_PERIODS - 2 :])) + 1e-300
    ratio = np.clip((change[-1] / change[0]) ** (1.0 / (len(change) - 1)), 0.0, 0.999)
    return bool(change.max() / (1.0 - ratio) <= STEADY * abs(found[-1]))
