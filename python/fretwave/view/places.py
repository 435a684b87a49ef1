"""Where the branches of an analysis pass an amplitude: of a branch that folds back at several places."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Array, Indices
from ..post.mode_curve import AT_THE_END, at_the_end
from ..results.parts import PARTS, rows_of_branches

if TYPE_CHECKING:
    import h5py

#: Rows of a table, and their amplitudes.
Part = tuple[Indices, Array]


def of_linear_modes(group: h5py.Group) -> bool:
    """Whether an analysis has shapes alone, whose amplitudes are those of a unit modal mass."""
    return "mode" in group["points"]


def linear_last(file: Mapping[str, Any], names: Iterable[str]) -> list[str]:
    """Names of analyses, those with motions of some amplitude first."""
    return sorted(names, key=lambda name: of_linear_modes(file[name]))


def branches_of(group: h5py.Group) -> list[Part]:
    """Of an analysis; linear modes are on no branch, each stands alone."""
    points = group["points"]
    columns = {name: points[name][()] for name in ("amplitude", *PARTS) if name in points}
    count = len(columns["amplitude"])
    rows = np.arange(count)[:, None] if of_linear_modes(group) else rows_of_branches(columns)
    return [(chosen, columns["amplitude"][chosen]) for chosen in rows]


def around_places(branches: Sequence[Part], kept: Indices, asked: float) -> list[int]:
    """Of each place where a branch passes an amplitude, the nearer one of the two kept points around it.

    Parameters
    ----------
    kept : points that may be chosen
    asked : amplitude [length]
    """
    found = []
    for rows, amplitude in branches:
        own = kept[np.isin(kept, rows)]
        for before, behind in _places(amplitude, at_the_end(amplitude, asked)) if len(own) else ():
            around = np.concatenate([own[own <= rows[before]][-1:], own[own >= rows[behind]][:1]])
            off = np.abs(amplitude[np.searchsorted(rows, around)] - asked)
            found.append(int(around[np.argmin(off)]))
    return found


def _places(amplitude: Array, asked: float) -> list[tuple[int, int]]:
    """Points before and behind each place where a branch has an amplitude; one point where it is met there.

    Points one behind the other that have it are one place: those of wear, whose amplitude stays as it is.
    """
    off = np.where(np.abs(amplitude - asked) <= AT_THE_END * amplitude, 0.0, amplitude - asked)
    there = off == 0
    met = [(int(k), int(k)) for k in np.flatnonzero(there) if k == 0 or not there[k - 1]]
    between = [(int(k), int(k) + 1) for k in np.flatnonzero(off[1:] * off[:-1] < 0)]
    return sorted(met + between)
