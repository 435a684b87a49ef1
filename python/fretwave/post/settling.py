"""Whether the amplitudes of a free motion come to an end: what is still to come, by the changes so far.

Levels are logarithms of the amplitudes of its cycles (n,).
"""

from __future__ import annotations

import numpy as np

from ..arrays import Array

#: a motion has settled when the amplitude of its last cycles varies by less than this, and will
SETTLED = 1e-3
LAST_CYCLES = 10
#: changes from one of so many parts of the motion's last half to the next show its slow trend
PARTS = 3
#: change of the level over a cycle that the integration alone makes, in tolerances: up to 10 without any damping
DRIFT = 20.0
#: a motion whose amplitudes differ by more than this has moved, whatever noise could hide
MOVED = 1e-2
#: growth has a trend when it changes by more than this, relative, while the amplitude doubles
TREND = 1e-3
LEAST_CHANGES = 3


def slope(level: Array) -> float:
    """Mean change of the level over one of the last cycles; nan where these vary by more than they go."""
    last = level[-LAST_CYCLES:]
    way = float(last[-1] - last[0])
    return way / (len(last) - 1) if abs(way) > _scatter(last) else np.nan


def spread(level: Array) -> float:
    """Range of the last cycles."""
    return float(np.ptp(level[-LAST_CYCLES:]))


def has_settled(level: Array) -> bool:
    """The last cycles agree, and by the trend of the changes so will all that follow."""
    if len(level) < LAST_CYCLES:
        return False
    return spread(level) < SETTLED and all(_to_come(level, length) < SETTLED for length in _lengths(level))


def has_moved(level: Array, tolerance: float) -> bool:
    """The amplitude has changed by more than a trend that noise hides could make of all cycles.

    Parameters
    ----------
    tolerance : relative, of the integration
    """
    hidden = min(_scatter(level[-length:]) / length for length in _lengths(level))
    noise = _scatter(level[-LAST_CYCLES:])
    return float(np.ptp(level)) > min(len(level) * max(hidden, DRIFT * tolerance) + noise, MOVED)


def growth_trend(level: Array, tolerance: float) -> int:
    """Sign of the change of the growth while the amplitude doubled last; 0 within noise, or where nothing grows."""
    growing = level[level >= level[-1] - np.log(2.0)] if len(level) else level
    growing = level[-max(len(growing), LEAST_CHANGES + 1) :]
    changes = np.diff(growing)
    if len(changes) < LEAST_CHANGES or changes[0] <= 0.0:
        return 0
    change = float(changes[-1] - changes[0])
    return int(np.sign(change)) if abs(change) > max(TREND * float(changes[0]), DRIFT * tolerance) else 0


def _lengths(level: Array) -> set[int]:
    """Cycles in one part: of the last ones, and of half of the motion."""
    short = min(LAST_CYCLES, len(level) // PARTS)
    return {short, max(short, len(level) // (2 * PARTS))}


def _to_come(level: Array, length: int) -> float:
    """Change of the level still to come, by Aitken's extrapolation over the means of the last three parts.

    Changes within the scatter of the last part are noise, and no more than that is to come; else the scatter counts
    against the motion. Changes within the scatter of what came before, to where it has been, are part of a swing, as
    of cycles whose samples drift along their period: it goes no further. Infinite where the changes do not become
    smaller and are neither.
    """
    parts = level[-PARTS * length :].reshape(PARTS, length)
    before, last = np.abs(np.diff(parts.mean(axis=1)))
    earlier = level[len(level) // 2 : -length]
    scatter, swing = _scatter(parts[-1]), _scatter(earlier)
    if last <= scatter:
        return scatter
    left = before - last - 2.0 * scatter
    further = float(last * (last + scatter) / left) if left > 0.0 else np.inf
    returns = last <= swing and earlier.min() <= parts[-1].mean() <= earlier.max()
    return min(further, swing) if returns else further


def _scatter(level: Array) -> float:
    """Range of what a straight line leaves."""
    place = np.arange(len(level)) - 0.5 * (len(level) - 1)
    level = level - level.mean()
    return float(np.ptp(level - place * (place @ level) / max(place @ place, 1.0)))
