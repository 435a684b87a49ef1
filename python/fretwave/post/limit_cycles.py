"""Limit cycles of a branch: where its damping passes through zero."""

from __future__ import annotations

from typing import Any

import numpy as np


def limit_cycles(table: dict[str, Any]) -> list[dict[str, Any]]:
    """Zero crossings of the damping, each a limit cycle.

    Damping that rises through zero with amplitude draws motions to the cycle from both sides (stable);
    falling, it drives them away (unstable). At the end of a branch the slope is not known (None).
    """
    cycles = []
    for point in np.flatnonzero(["zero_damping" in event.split() for event in table["event"]]):
        around = [int(point) - 1, int(point) + 1]
        known = around[0] >= 0 and around[1] < len(table["zeta"])
        zeta, amplitude = table["zeta"], table["amplitude"]
        slope = np.diff(zeta[around])[0] * np.diff(amplitude[around])[0] if known else 0.0
        cycles.append(
            {
                "point": int(point),
                "event": "zero_damping",
                "amplitude": float(amplitude[point]),
                "frequency_hz": float(table["frequency_hz"][point]),
                "stable": bool(slope > 0) if slope else None,
            }
        )
    return cycles
