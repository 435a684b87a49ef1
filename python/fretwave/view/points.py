"""Points of a branch that a view shows: those asked for, by number or by amplitude, else that of the largest."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Indices
from ..errors import InputError
from ..results.file import unit_of_amplitudes
from ..results.overview import amplitude_column, whose_amplitude
from .options import ViewOptions
from .places import around_places, branches_of, of_linear_modes

if TYPE_CHECKING:
    import h5py

#: Points named in a message.
NAMED = 12


def kept_points(group: h5py.Group) -> Indices:
    """Points of which all is kept: where there are contacts, those at which their motion is."""
    with_contacts = any(name.startswith("contact_") for name in group)
    return np.asarray(group["reported"][()] if with_contacts else np.arange(len(group["coefficients"])), dtype=np.intp)


def points_asked(group: h5py.Group, kept: Indices, options: ViewOptions, where: str) -> list[tuple[int, str]]:
    """Numbers of points, each with a word on what was asked for; without a wish that of the largest amplitude.

    Parameters
    ----------
    kept : points that an amplitude may choose
    """
    amplitude, unit = group["points/amplitude"][()], unit_of_amplitudes(group)
    for point in options.points:
        if not 0 <= point < len(amplitude):
            near = kept[np.argmin(np.abs(kept - point))]
            raise not_kept("there is no such point", where, f"point {point}", kept, group, near, options.how)
    chosen = [(int(point), "") for point in options.points]
    for asked in options.amplitudes:
        around = around_places(branches_of(group), kept, asked)
        if not around:
            off = np.abs(amplitude[kept] - asked)
            near = kept[np.argmin(np.where(np.isfinite(off), off, np.inf))]
            what = "the branch does not reach this amplitude"
            raise not_kept(what, where, f"{asked:g} {unit}", kept, group, near, options.how)
        near = min(around, key=lambda point: abs(amplitude[point] - asked))
        places = f", which is passed at {len(around)} places" if len(around) > 1 else ""
        chosen.append((near, f", the kept point nearest to {asked:g} {unit}{places}"))
    return chosen or [_largest(group, kept)]


def _largest(group: h5py.Group, kept: Indices) -> tuple[int, str]:
    """The point shown without a wish; a linear mode's amplitude is none that could be largest."""
    if of_linear_modes(group):
        return int(kept[0]), ", the first mode"
    points = group["points"]
    size = points[amplitude_column(points)][()][kept]
    return int(kept[np.argmax(size)]), f", the kept point of the largest amplitude{whose_amplitude(points)}"


def not_kept(what: str, where: str, measured: str, kept: Indices, group: h5py.Group, near: int, how: str) -> InputError:
    """Names the kept points around the nearest one, and how to ask for that."""
    amplitude, unit = group["points/amplitude"][()], unit_of_amplitudes(group)
    place = int(np.flatnonzero(kept == near)[0])
    begin = max(0, min(place - NAMED // 2, len(kept) - NAMED))
    named = ", ".join(f"{point} ({amplitude[point]:.4g} {unit})" for point in kept[begin : begin + NAMED])
    more = f" ({len(kept)} in all)" if len(kept) > NAMED else ""
    expected = f"a point from 0 to {len(amplitude) - 1}, best one of {named}{more}"
    return InputError(what, where, measured, expected, how.format(near))
