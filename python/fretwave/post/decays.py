"""Tables and verdicts of time integrations: cycles beside the mode, endings beside the predicted limit cycles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Array
from ..errors import InputError
from .cycles import Cycles
from .mode_curve import Crossing, ModeCurve, at_the_end
from .settling import LAST_CYCLES, growth_trend, has_moved, has_settled, slope, spread

#: a motion that never moved is on a predicted limit cycle when it is as near as this, relative
NEAR = 0.05
#: what became of a start, in a word
LIMIT_CYCLE, KEPT, NOT_SETTLED = "limit cycle", "keeps its amplitude", "not settled"
DIVERGES, LEAVES, FALLS = "diverges", "leaves the mode's range", "ends in the noise of the integration"
#: largest relative change of a damping ratio from one cycle to the next of a motion that is called slow
SLOW = 0.2


@dataclass(frozen=True)
class Ending:
    """Where a start ended: the mean of its last cycles, the last one of a motion that leaves or fades; nan without any.

    Attributes
    ----------
    zeta : damping ratio by the decrement of the last cycles; nan where these vary by more than they go
    spread : relative range of the last amplitudes
    """

    text: str
    amplitude: float = np.nan
    omega: float = np.nan
    zeta: float = np.nan
    spread: float = np.nan


def mode_state(
    table: Mapping[str, Array], coefficients: Array, amplitude: float, method: str
) -> tuple[Array, float, float]:
    """Harmonic coefficients (n_dof, m), beta and omega of the motion at an amplitude of a finished branch.

    CNM motions decay; EPMC motions are periodic with omega0, so beta is 0 there. Between the two neighbouring points
    of the last sheet, the one a decay from above meets, beta and omega are linear in log a, the coefficients in a: a
    place of rest that the motion swings about and what grows with it are exact, as is the fundamental of the
    normalised dof.
    """
    level, wanted = np.log(table["amplitude"]), np.log(at_the_end(table["amplitude"], amplitude))
    between = np.flatnonzero((level[:-1] - wanted) * (level[1:] - wanted) <= 0.0)
    if not len(between):
        raise _outside(amplitude, table["amplitude"])
    pair = [int(between[-1]), int(between[-1]) + 1]
    weights = _weights(level[pair], wanted)
    shares = _weights(table["amplitude"][pair], np.exp(wanted))
    decays = method == "CNM"
    beta = float(weights @ table["beta"][pair]) if decays else 0.0
    omega = float(weights @ table["omega" if decays else "omega0"][pair])
    return np.tensordot(shares, coefficients[pair], axes=1), beta, omega


def _weights(ends: Array, wanted: float) -> Array:
    """Of two values, for what is linear between them."""
    behind = np.interp(wanted, *np.array(sorted(zip(ends, [0.0, 1.0]))).T)
    return np.array([1.0 - behind, behind])


def _outside(amplitude: float, branch: Array) -> InputError:
    return InputError(
        "a start lies outside the mode's branch",
        measured=f"amplitude {amplitude:g}",
        expected=f"between {branch.min():g} and {branch.max():g}",
        fix="change the start's amplitude, or widen the amplitude range of the mode analysis",
    )


def decay_rows(start: int, cycles: Cycles, mode: ModeCurve) -> list[dict[str, float | int]]:
    """Table rows of one decay: each cycle beside the mode at the same amplitude."""
    rows: list[dict[str, float | int]] = []
    for i in range(len(cycles)):
        value = mode.at(float(cycles.amplitude[i]), falling=bool(cycles.zeta[i] >= 0.0))
        rows.append(
            {
                "start": start,
                "cycle": i + 1,
                "time": float(cycles.time[i]),
                "amplitude": float(cycles.amplitude[i]),
                "omega": float(cycles.omega[i]),
                "zeta": float(cycles.zeta[i]),
                "omega_mode": value.omega,
                "zeta_mode": value.zeta,
                "sheets": value.sheets,
            }
        )
    return rows


def cycle_rows(start: int, cycles: Cycles) -> list[dict[str, float | int]]:
    """Table rows of one start towards a limit cycle."""
    return [
        {
            "start": start,
            "cycle": i + 1,
            "time": float(cycles.time[i]),
            "amplitude": float(cycles.amplitude[i]),
            "frequency_hz": float(cycles.omega[i]) / (2.0 * np.pi),
        }
        for i in range(len(cycles))
    ]


def ending(
    cycles: Cycles,
    stopped: bool,
    crossings: Sequence[Crossing] = (),
    reach: float = np.inf,
    tolerance: float = 0.0,
    faded: bool = False,
) -> Ending:
    """What became of a start.

    Parameters
    ----------
    stopped : at a bound far beyond the mode's motions
    reach : largest amplitude of the mode
    tolerance : relative, of the integration
    faded : its cycles end in the noise of the integration
    """
    if not len(cycles):
        return Ending(DIVERGES if stopped else FALLS if faded else NOT_SETTLED)
    level, last = np.log(cycles.amplitude), cycles.amplitude[-1]
    zeta, varies = -slope(level) / (2.0 * np.pi), float(np.expm1(spread(level)))
    if stopped:
        text = LEAVES if growth_trend(level, tolerance) < 0 else DIVERGES
        return Ending(text, float(last), float(cycles.omega[-1]), zeta, varies)
    text = FALLS if faded else _verdict(level, crossings, tolerance)
    leaves = text == NOT_SETTLED and last > reach and zeta < 0.0
    if leaves or faded:
        return Ending(LEAVES if leaves else text, float(last), float(cycles.omega[-1]), zeta, varies)
    amplitude, omega = cycles.amplitude[-LAST_CYCLES:], cycles.omega[-LAST_CYCLES:]
    return Ending(text, float(amplitude.mean()), float(omega.mean()), zeta, varies)


def _verdict(level: Array, crossings: Sequence[Crossing], tolerance: float) -> str:
    """Of a motion to its end: one that never moved is no limit cycle for that, but where one is predicted."""
    if len(level) < LAST_CYCLES:
        return NOT_SETTLED
    if has_moved(level, tolerance):
        return LIMIT_CYCLE if has_settled(level) else NOT_SETTLED
    possible = [crossing for crossing in crossings if crossing.stable is not False]
    distances = [abs(np.log(crossing.amplitude) - level[-1]) for crossing in possible]
    return LIMIT_CYCLE if min(distances, default=np.inf) < NEAR else KEPT


def compare(found: Ending, crossings: Sequence[Crossing]) -> dict[str, float]:
    """Relative differences from the predicted limit cycle that lies nearest; nan when there is none.

    A motion may end on every cycle that is not known to be unstable.
    """
    possible = [crossing for crossing in crossings if crossing.stable is not False]
    if not possible or found.text not in (LIMIT_CYCLE, NOT_SETTLED) or not np.isfinite(found.amplitude):
        return {"predicted": np.nan, "amplitude_difference": np.nan, "frequency_difference": np.nan}
    nearest = min(possible, key=lambda crossing: abs(np.log(crossing.amplitude / found.amplitude)))
    return {
        "predicted": nearest.amplitude,
        "amplitude_difference": found.amplitude / nearest.amplitude - 1.0,
        "frequency_difference": found.omega / nearest.omega - 1.0,
    }


def largest_differences(rows: Sequence[Mapping[str, float | int]]) -> tuple[float, float]:
    """Largest relative difference of omega and absolute one of zeta from the mode, over the slow cycles.

    A mode describes motions whose amplitude changes slowly. A cycle counts when the mode is unique at its amplitude
    and neither damping ratio changes by more than `SLOW` to the cycles before and after it; first and last do not.
    """
    slow = [row for before, row, after in zip(rows, rows[1:], rows[2:]) if _is_slow(before, row, after)]
    omega = [abs(row["omega"] / row["omega_mode"] - 1.0) for row in slow]
    zeta = [abs(row["zeta"] - row["zeta_mode"]) for row in slow]
    return max(omega, default=np.nan), max(zeta, default=np.nan)


def _is_slow(*rows: Mapping[str, float | int]) -> bool:
    pairs = [(row[key], rows[1][key]) for key in ("zeta", "zeta_mode") for row in rows]
    slow = all(abs(value - middle) < SLOW * abs(middle) for value, middle in pairs)
    return len({row["start"] for row in rows}) == 1 and rows[1]["sheets"] == 1 and slow
