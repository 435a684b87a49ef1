"""Engine orders: which nodal diameters they excite, and at which speeds they meet a frequency.

A pattern of forces that stands still while the wheel of N sectors turns excites, with its h-th harmonic round the
circumference, waves of d nodal diameters with h = k N +- d and no others (Singh et al., SAFE diagram, 1988).

Where stiffness grows with the speed squared, a frequency is known at a few speeds. Between them its square is linear in
the square of the speed, as it is exactly for one mode; beyond them the last line goes on.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..arrays import AnyArray, Array

#: Engine orders of a structure that is no sector, unless told.
FIRST_ORDERS = 6


def excited_by(order: int, sectors: int) -> int:
    """Nodal diameters of the wave that an engine order excites: folded back at N / 2."""
    rest = order % sectors
    return min(rest, sectors - rest)


def exciting(orders: Sequence[int], diameters: int, sectors: int) -> list[int]:
    """Those of the engine orders that excite a wave; of a structure (no sectors) all."""
    return [order for order in orders if not sectors or excited_by(order, sectors) == diameters]


def usual_orders(diameters: Sequence[int], sectors: int) -> list[int]:
    """The two lowest engine orders of each nodal diameter, d and N - d; of a structure (no sectors) the first ones."""
    if not sectors:
        return list(range(1, FIRST_ORDERS + 1))
    return sorted({h for d in diameters for h in (d, sectors - d) if h})


def _lines(speeds: AnyArray, hz: AnyArray) -> tuple[Array, Array, Array]:
    """Begin (S,) of each piece in rpm^2, and y = a + b rpm^2 on it, y = hz^2."""
    s, y = np.square(np.asarray(speeds, dtype=float)), np.square(np.asarray(hz, dtype=float))
    if len(s) == 1:
        return np.zeros(1), y, np.zeros(1)
    slope = np.diff(y) / np.diff(s)
    return np.concatenate([[0.0], s[1:-1]]), y[:-1] - slope * s[:-1], slope


def frequency_at(speeds: AnyArray, hz: AnyArray, at: float | AnyArray) -> AnyArray:
    """Frequency [Hz] at other speeds [rev/min] than the ascending ones (S,) at which it is known."""
    begin, a, b = _lines(speeds, hz)
    s = np.square(np.asarray(at, dtype=float))
    piece = np.searchsorted(begin, s, side="right") - 1
    return np.asarray(np.sqrt(np.maximum(a[piece] + b[piece] * s, 0.0)))


def crossing_speeds(speeds: AnyArray, hz: AnyArray, order: int) -> list[float]:
    """Speeds [rev/min] at which an engine order excites a frequency that is known at some speeds; maybe none."""
    begin, a, b = _lines(speeds, hz)
    end = np.append(begin[1:], np.inf)
    slope = (order / 60.0) ** 2 - b  # of the order's square against the frequency's
    met = np.where(slope != 0, a / np.where(slope != 0, slope, 1.0), -1.0)
    inside = (met >= begin) & (met < end) & (met > 0)
    return [float(speed) for speed in np.sqrt(met[inside])]


def margins(
    known: dict[str, Any], speeds: AnyArray, hz: AnyArray, orders: Sequence[int], speed_rpm: float
) -> list[dict[str, Any]]:
    """Where engine orders meet the frequency of a mode.

    Parameters
    ----------
    known : what is said of the mode in every row
    speeds, hz : (S,) ascending speeds [rev/min] and its frequencies there
    speed_rpm : the operating speed

    Returns
    -------
    list of dict
        What is known, then engine_order, speed_rpm of the crossing, its frequency_hz, and margin: by how much of the
        operating speed the crossing lies above it.
    """
    return [
        {
            **known,
            "engine_order": order,
            "speed_rpm": speed,
            "frequency_hz": order * speed / 60.0,
            "margin": speed / speed_rpm - 1.0,
        }
        for order in orders
        for speed in crossing_speeds(speeds, hz, order)
    ]
