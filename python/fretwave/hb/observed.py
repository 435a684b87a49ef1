"""What an amplitude is of, normalised or observed: a dof, a row of displacements, a linear mode's coordinate."""

from __future__ import annotations

from collections.abc import Sequence
from typing import SupportsIndex, Union, cast

import numpy as np

from ..arrays import Array
from ..columns import MODAL_UNIT
from ..errors import InputError
from ..given import array_of, whole
from ..model.model import Model
from ..model.modes import LinearMode

#: What is normalised or observed: a dof's number, a row (n_dof,), or a linear mode's coordinate.
Observed = Union[int, Sequence[float], Array, LinearMode]


def row_of(model: Model, observed: Observed) -> list[tuple[int, float]]:
    """Entries (dof, weight) of what is observed, on every rank. Collective.

    Raises
    ------
    InputError
        The row does not fit the model.
    """
    if isinstance(observed, LinearMode):
        if np.any(observed.imaginary):
            fix = "take a real mode, or a dof"
            raise InputError("a complex mode has no one coordinate", None, repr(observed), "a standing wave", fix)
        return row_of(model, model.inertia(observed.shape))
    if array_of(observed).ndim == 0:
        return [(_dof(model, cast(int, observed)), 1.0)]
    row = array_of(observed)
    if row.dtype.kind not in "biufc" or np.any(np.imag(row) != 0):
        raise InputError("a row of displacements is real", None, f"entries of type {row.dtype}", "weights", "give one")
    row = np.real(row).astype(float)
    if row.shape != (model.n_dof,) or not np.isfinite(row).all():
        fix = "give one weight a dof"
        raise InputError("the row does not fit the model", None, row.shape, f"({model.n_dof},), finite", fix)
    return [(int(k), float(row[k])) for k in np.flatnonzero(row)]


def _dof(model: Model, given: SupportsIndex) -> int:
    dof = whole(given)
    if dof is None or not 0 <= dof < model.n_dof:
        measured, expected = repr(given), f"0 to {model.n_dof - 1}"
        raise InputError("the chosen dof does not exist", None, measured, expected, "choose a dof of the model")
    return dof


def unit_of(observed: Observed) -> str:
    """Of the amplitude of what is observed, as a quantity."""
    return MODAL_UNIT if isinstance(observed, LinearMode) else "length"


def named(observed: Observed) -> str:
    """As a problem's text has it."""
    if isinstance(observed, LinearMode):
        return f"the coordinate of {observed.frequency_hz:.6g} Hz"
    return f"dof {observed!r}" if np.ndim(observed) == 0 else "a row"
