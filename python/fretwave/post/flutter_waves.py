"""What the total damping of each nodal diameter means: where its motion grows, where it decays, and between."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from .limit_cycles import limit_cycles, others, place, stability
from .mode_curve import NO_DAMPING, most_damped, without_rounding

#: Of a wave whose damping changes its sign, but at no point: the corrector failed there, or the two zeros beside a peak
#: are nearer to each other than the branch's own cubic tells.
NOT_LOCATED = "limit cycle not located"
#: Verdicts of a wave whose small motions do not grow in this family; in others they may.
DECAYS = ("neutral", "stable", "stable below")
STABLE = {True: "stable", False: "unstable", None: "unknown"}


def describe_waves(table: Mapping[str, Any], diameters: Sequence[int]) -> list[dict[str, Any]]:
    """Each wave of a flutter table that has points.

    Returns
    -------
    list of dict
        nodal_diameter; frequency_hz and zeta at the smallest amplitude; largest_zeta and at_amplitude; last_amplitude,
        up to which the branch has been, also if it comes back from there; verdict, of :func:`verdict`; limit_cycles,
        each as :func:`limit_cycles` gives it with its nodal_diameter and, where the branch runs back there, the
        amplitudes of the folds around it (None elsewhere).
    """
    columns = np.asarray(table["nodal_diameter"])
    rows = {diameter: np.flatnonzero(columns == diameter) for diameter in diameters}
    return [_wave(table, diameter, points) for diameter, points in rows.items() if len(points)]


def _wave(table: Mapping[str, Any], diameter: int, rows: npt.NDArray[np.intp]) -> dict[str, Any]:
    names = ("amplitude", "frequency_hz", "zeta", "event", "stick")
    part = {name: np.asarray(table[name])[rows] for name in names if name in table}
    amplitude, zeta = part["amplitude"], part["zeta"]
    top = most_damped(zeta)
    cycles = [
        {**cycle, "point": int(rows[cycle["point"]]), "nodal_diameter": diameter, "folds": _folds(part, cycle["point"])}
        for cycle in limit_cycles(part)
    ]
    return {
        "nodal_diameter": diameter,
        "frequency_hz": float(part["frequency_hz"][0]),
        "zeta": float(zeta[0]),
        "largest_zeta": float(zeta[top]),
        "at_amplitude": float(amplitude[top]),
        "last_amplitude": float(amplitude.max()),
        "verdict": verdict(zeta, int(np.argmax(amplitude))),
        "limit_cycles": cycles,
    }


def _folds(part: Mapping[str, Any], point: int) -> list[float] | None:
    """Amplitudes [length] of the folds before and behind a point between which the branch runs back."""
    turns = np.flatnonzero(["fold" in str(event).split() for event in part["event"]])
    before, behind = turns[turns < point], turns[turns > point]
    if len(before) % 2 == 0 or not len(behind):
        return None
    return sorted([float(part["amplitude"][before[-1]]), float(part["amplitude"][behind[0]])])


def verdict(zeta: npt.ArrayLike, top: int = -1) -> str:
    """From the signs of the damping along a branch that begins with the contact stuck.

    Parameters
    ----------
    top : point of the largest amplitude, the last one unless the branch comes back from there

    Returns
    -------
    str
        ``stable``: damped at every amplitude. ``unbounded``: fed at every amplitude. ``bounded``: fed at first, damped
        at the top. ``bounded below``: damped in between only, and beyond the last limit cycle without bound.
        ``stable below``: damped at first. ``neutral``: neither.
    """
    signs = np.sign(np.where(np.abs(zeta) > NO_DAMPING, zeta, 0.0))
    before_top = signs if top == -1 else signs[: top + 1]
    at_top, signs = before_top[before_top != 0][-1:], signs[signs != 0]
    if not len(signs):
        return "neutral"
    if (signs > 0).all() or (signs < 0).all():
        return "stable" if signs[0] > 0 else "unbounded"
    if signs[0] > 0:
        return "stable below"
    return "bounded" if (at_top > 0).any() else "bounded below"


def words(wave: Mapping[str, Any], unit: str, stopped: bool = False) -> str:
    """A wave's fate in one line; `unit` of its amplitudes. `stopped`: its branch did not come to its end."""
    cycles = "; ".join(_cycle(cycle, unit) for cycle in wave["limit_cycles"]) or NOT_LOCATED
    peak = f"largest damping {100 * wave['largest_zeta']:+.3g} % at a = {wave['at_amplitude']:.3g} {unit}"
    last = f"{wave['last_amplitude']:.3g} {unit}"
    fate = {
        "neutral": "neither damped nor fed",
        "stable": f"stable at every amplitude up to {last}",
        "unbounded": f"grows at every amplitude up to {last}, friction does not make up for the flow there: {peak}",
        "bounded": f"{cycles}; {peak}",
        "bounded below": f"{cycles}, growth without bound beyond; {peak}",
        "stable below": f"decays below, {cycles}; {peak}",
    }[wave["verdict"]]
    first = 100 * without_rounding(wave["zeta"])
    stuck = f"{wave['frequency_hz']:.5g} Hz, {first:+.3g} % at the smallest amplitude"
    beyond = f" (the branch stopped early, at most {last}: what is beyond is not known)" if stopped else ""
    fate += others(wave.get("fed", []), wave.get("not_looked_at", ""))
    return f"ND {with_sign(wave['nodal_diameter'])}, {stuck}: {fate}{beyond}"


def with_sign(diameters: int) -> str:
    """Nodal diameters with the sign that tells forward from backward."""
    return f"{diameters:+d}" if diameters else "0"


def _cycle(cycle: Mapping[str, Any], unit: str) -> str:
    known = stability(cycle)
    if cycle["folds"]:
        low, high = cycle["folds"]
        known = known.replace("runs back there", f"runs back between {low:.5g} and {high:.5g} {unit}")
    return f"limit cycle at {place(cycle, unit)}: {known}"
