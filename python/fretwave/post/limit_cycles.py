"""Limit cycles of a branch: where its damping passes through zero, and what is known of their stability."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Optional

import numpy as np
import numpy.typing as npt

from ..arrays import Array
from ..texts import counted, plus_minus
from .mode_curve import NO_DAMPING, forward

#: The state of the contact in which motions begin to grow.
STUCK = "stuck"
#: Of a limit cycle, by what is known of it.
SHORT = {True: "stable in its own amplitude", False: "unstable", None: "stability unknown"}
#: What the errors of a cycle take the slopes of, over amplitude.
OF_A_CYCLE = ("zeta", "frequency_hz")
#: Points of a branch whose amplitudes differ relatively by less are one.
ONE_POINT = 1e-6
#: Of another mode's values, about half of the last digit that they are told with.
TOLD = {"frequency_hz": 5e-4, "zeta": 5e-3}


def limit_cycles(table: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Zero crossings of the damping, each a limit cycle; also one exactly at an end of the branch.

    Damping that rises through zero with amplitude draws motions of this mode to the cycle from both sides (stable);
    falling, it drives them away (unstable). None where that is not known: at an end of the branch, and where the
    branch runs back between two folds. There motions of one amplitude are no longer those of one mode, and time
    integration finds cycles of either kind.
    """
    amplitude, zeta = np.asarray(table["amplitude"]), np.asarray(table["zeta"])
    met = np.array(["zero_damping" in event.split() for event in table["event"]], bool)
    return [
        {
            "point": int(point),
            "event": "zero_damping",
            "amplitude": float(amplitude[point]),
            "frequency_hz": float(table["frequency_hz"][point]),
            "runs_back": forward(amplitude, int(point)) is False,
            "stable": _stable(amplitude, zeta, int(point)),
            **_errors(table, int(point)),
        }
        for point in np.flatnonzero(met | _at_the_ends(zeta, table.get("stick")))
    ]


def place(cycle: Mapping[str, Any], unit: str) -> str:
    """Amplitude and frequency in words."""
    names = ("amplitude", "frequency_hz")
    a, hertz = (f"{cycle[name]:.5g}{plus_minus(cycle.get(f'{name}_error'))}" for name in names)
    return f"a = {a} {unit}, {hertz} Hz"


def _errors(table: Mapping[str, Any], point: int) -> dict[str, Optional[float]]:
    """To first order, with the slopes of the parabola through the points around."""
    unknown = dict.fromkeys(("amplitude_error", "frequency_hz_error"))
    if "zeta_error" not in table:
        return unknown
    a = np.asarray(table["amplitude"])
    apart = np.flatnonzero(np.abs(a - a[point]) > ONE_POINT * a[point])
    rows = [*apart[apart < point][-1:], point, *apart[apart > point][:1]]
    x = a[rows] - a[point]
    if len(rows) < 2 or len(rows) == 3 and x[0] * x[2] > 0:  # at a fold there is no slope
        return unknown
    zeta, hertz = (np.polyfit(x, np.asarray(table[name])[rows], len(rows) - 1)[-2] for name in OF_A_CYCLE)
    if not np.isfinite(table["zeta_error"][point]) or not zeta:
        return unknown
    amplitude_error = float(table["zeta_error"][point] / abs(zeta))
    if not amplitude_error < np.abs(x).max():  # beyond the points whose slope it takes
        return unknown
    frequency_error = float(table["omega_error"][point] / (2 * np.pi) + abs(hertz) * amplitude_error)
    return {"amplitude_error": amplitude_error, "frequency_hz_error": frequency_error}


def _at_the_ends(zeta: Array, stick: Optional[Array]) -> npt.NDArray[np.bool_]:
    """Whether a point is the first or last one, and the damping is zero there and not beside it.

    Not where all pairs stick (share 1): without damping such motions are neither fed nor damped.
    """
    zero = np.abs(zeta) <= NO_DAMPING
    ends = np.zeros(len(zeta), bool)
    if len(zeta) > 1:
        ends[[0, -1]] = zero[[0, -1]] & ~zero[[1, -2]]
    return ends & (np.asarray(stick) < 1.0) if stick is not None else ends


def _stable(amplitude: Array, zeta: Array, point: int) -> Optional[bool]:
    damped = np.flatnonzero(np.abs(zeta) > NO_DAMPING)
    before, behind = damped[damped < point], damped[damped > point]
    if not len(before) or not len(behind) or not forward(amplitude, point):
        return None
    rises = zeta[behind[0]] - zeta[before[-1]]
    grows = amplitude[behind[0]] - amplitude[before[-1]]
    return bool(rises * grows > 0) if rises * grows else None


def stability(cycle: Mapping[str, Any]) -> str:
    """What is known of a limit cycle, in words."""
    if cycle["stable"] is None:
        return f"stability unknown ({'the branch runs back there' if cycle.get('runs_back') else 'branch end'})"
    if not cycle["stable"]:
        return "unstable (damping falls)"
    return "stable in its own amplitude (damping rises)" + others(cycle.get("fed", []), cycle.get("not_looked_at", ""))


def others(fed: Sequence[Mapping[str, Any]], not_looked_at: str = "") -> str:
    """What other linear modes have to say of a cycle that is stable in its own amplitude; empty when all are damped.

    Parameters
    ----------
    fed : modes that gain energy: mode (number from 1), on a wheel diameters, contact, frequency_hz, zeta
    not_looked_at : why they are not known
    """
    if not_looked_at:
        return f", other modes not looked at ({not_looked_at})"
    states: list[tuple[Mapping[str, Any], list[str]]] = []
    for contact in dict.fromkeys(mode["contact"] for mode in fed):
        own = sorted((mode for mode in fed if mode["contact"] == contact), key=lambda mode: mode["zeta"])
        first, more = own[0], len(own) - 1
        also = f", as {'does' if more == 1 else 'do'} {counted(more, 'other')}" if more else ""
        known = next((where for other, where in states if _alike(first, other)), None)
        if known is None:
            states.append((first, known := []))
        known.append(contact + also)
    word = "but" if any(mode["contact"] == STUCK for mode in fed) else "though"
    told = [f"{_gains(mode)} ({'; '.join(where)})" for mode, where in states]
    return f", {word} {', and '.join(told)}" if told else ""


def _alike(mode: Mapping[str, Any], other: Mapping[str, Any]) -> bool:
    """One mode in two states of the contact: what is told of both differs by about its last digit, in any unit."""
    near = (abs(mode[key] - other[key]) <= share * abs(other[key]) for key, share in TOLD.items())
    return _gains(mode) == _gains(other) or (_which(mode) == _which(other) and all(near))


def _gains(mode: Mapping[str, Any]) -> str:
    text = f"{_which(mode)}, {mode['frequency_hz']:.4g} Hz, gains energy by itself:"
    return f"{text} zeta {100 * mode['zeta']:.3g} %"


def _which(mode: Mapping[str, Any]) -> str:
    words = f"linear mode {mode['mode']}" if "mode" in mode else "a motion"
    if "diameters" not in mode:
        return words
    diameters = int(mode["diameters"])
    return f"{words} of {f'{diameters:+d}' if diameters else '0'} nodal diameters"
