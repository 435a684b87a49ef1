"""What a period is to each contact pair: work, forces, slip, gap and shares of its status, from what results keep."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..arrays import Array
from ..columns import Column
from ..model.law_info import OPEN, STATUS, STICK
from .contact_history import ContactHistory

#: Directions in which the extent of a path in the plane is looked at; the largest of them is short by 2e-4 at most.
DIRECTIONS = 90

COLUMNS = (
    Column("work", "energy", "energy that the pair dissipates in a period"),
    Column("normal_mean", "force", "mean normal force, > 0 in contact"),
    Column("normal_least", "force", "least normal force of the period"),
    Column("normal_largest", "force", "largest normal force of the period"),
    Column("pressure_mean", "pressure", "mean normal force over the pair's area"),
    Column("pressure_least", "pressure", "least normal force over the pair's area"),
    Column("pressure_largest", "pressure", "largest normal force over the pair's area"),
    Column("tangential_largest", "force", "largest tangential force of the period"),
    Column("slip_range", "length", "largest distance between two places that the slider comes to in the period"),
    Column("gap_largest", "length", "largest distance to contact, 0 where the pair stays closed"),
    *(Column(word, "1", f"share of the period: {word}") for word in STATUS),
)


def pair_values(history: ContactHistory, stiffness: Array | None = None, area: Array | None = None) -> dict[str, Array]:
    """Values (n_pairs,) by the names of `COLUMNS`; those that the law does not know are left out.

    Parameters
    ----------
    stiffness : (n_pairs,) tangential [force/length], without it the slider moves as the pair does
    area : (n_pairs,) [length^2]
    """
    found = dict(_values(history, stiffness))
    if area is not None and "normal_mean" in found:
        found.update({f"pressure_{word}": found[f"normal_{word}"] / area for word in ("mean", "least", "largest")})
    return {column.name: found[column.name] for column in COLUMNS if column.name in found}


def _values(history: ContactHistory, stiffness: Array | None) -> Iterator[tuple[str, Array]]:
    normal, tangential, gap = history.normal_force, history.tangential_force, history.gap
    yield "work", history.work
    if history.normal is not None:
        least, largest = normal.min(axis=0), normal.max(axis=0)
        yield "normal_mean", np.clip(normal.mean(axis=0), least, largest)  # rounding leaves it outside
        yield "normal_least", least
        yield "normal_largest", largest
    yield "tangential_largest", tangential.max(axis=0)
    if not np.isnan(gap).any():
        yield "gap_largest", gap.max(axis=0)
    yield "slip_range", slip_range(history, stiffness)
    if history.kept_shares is not None or history.status is not None:
        yield from ((word, history.share(status)) for word, status in STATUS.items())


def slip_range(history: ContactHistory, stiffness: Array | None = None) -> Array:
    """(n_pairs,) [length]: largest distance between two places of the slider w = u - f / kt while it is closed.

    Zero of a pair that sticks all the time. Elastic laws slip by less than their relative displacement.
    """
    rows = [row for row in range(history.u.shape[1]) if row != history.normal]
    if not rows:
        return np.zeros(history.n_pairs)
    path = history.u[:, rows] - (0.0 if stiffness is None else history.f[:, rows] / stiffness)
    if history.status is not None:
        path = np.where((history.status == OPEN)[:, None], np.nan, path)
    angles = np.pi * np.arange(DIRECTIONS) / DIRECTIONS if len(rows) == 2 else np.zeros(1)
    turns = np.column_stack([np.cos(angles), np.sin(angles)])[:, : len(rows)]
    found = np.max([_extent(np.einsum("c,ncp->np", turn, path)) for turn in turns], axis=0)
    if stiffness is None or (history.kept_shares is None and history.status is None):
        return np.asarray(found)
    # of what sticks the rounding of u and f, which grows with the static load; samples may miss a short slip
    return np.asarray(np.where(history.share(STICK) == 1, 0.0, found))


def _extent(values: Array) -> Array:
    """Largest less least of (n_samples, n_pairs), of the samples that are known; 0 where none is."""
    known = np.isfinite(values)
    high, low = np.where(known, values, -np.inf).max(axis=0), np.where(known, values, np.inf).min(axis=0)
    return np.where(known.any(axis=0), high - low, 0.0)
