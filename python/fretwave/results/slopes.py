"""The cubic of a branch in results.h5: of each point the derivatives over the step that ends there.

The scalars themselves are functions of the table's columns (`ModalState.scalars_of`), so that nothing is kept twice.
Where no step ends, at the first point of a branch, the derivatives are nan.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Array
from ..columns import COLUMNS, Column, columns_named, over
from ..hb.states import ForcedState, ModalState, State, described, state_of
from ..solve.curve import APART as OF_A_RUN
from ..solve.curve import Curve
from ..solve.hermite import Cubic
from ..solve.table import Table
from ..units import UnitSystem
from .field import Field

if TYPE_CHECKING:
    import h5py

    from ..solve.trace import Knot

NAME = "slopes"
#: Of the step.
ENDS = ("begin", "end")
#: What tells the branches of one table apart.
APART = (*OF_A_RUN, "value")


def slope_fields(meaning: State) -> dict[str, Field]:
    """The arrays that a branch's rows bring."""
    known = {"meaning": json.dumps(described(_physical(meaning)))}
    axes, shape = {"end": ENDS, "scalar": meaning.scalars}, (len(ENDS), len(meaning.scalars))
    text = "derivatives of the scalar unknowns by the share of the step that ends at the point"
    return {NAME: Field(shape, "", text, axes, known)}


def slopes_of(meaning: State, knot: Knot) -> dict[str, Array]:
    """A point's arrays, in physical units."""
    factors = meaning.factors
    return {NAME: factors * np.array([knot.begin, knot.end])[:, : len(factors)]}


def _physical(meaning: State) -> State:
    return ModalState(meaning.method) if isinstance(meaning, ModalState) else ForcedState(meaning.level)


def read_slopes(group: h5py.Group) -> tuple[State | None, Array | None]:
    """What the scalars of an analysis mean, and (n_points, 2, k) derivatives; None without.

    A sweep has those of its values one after the other. Results of earlier versions have none.
    """
    holders = [group[f"values/{name}"] for name in sorted(group["values"])] if "values" in group else [group]
    if holders and all(NAME in holder for holder in holders):
        meaning = state_of(json.loads(holders[0][NAME].attrs["meaning"]))
        return meaning, np.concatenate([holder[NAME][()] for holder in holders])
    kind = group.attrs.get("of_type", group.attrs.get("type"))
    if kind in ("mode", "flutter"):
        return ModalState(str(group.attrs.get("method", "CNM"))), None
    return (ForcedState(1.0), None) if kind == "forced" else (None, None)


def curves_of(
    columns: Mapping[str, Array],
    units: Mapping[str, str],
    system: UnitSystem,
    events: list[str],
    meaning: State,
    slopes: Array | None,
) -> list[tuple[int, Curve]]:
    """The branches of a table in a system of units, each with the number of its first row."""
    count = len(events)
    starts = ["start" in text.split() for text in events]
    new = np.array(starts, dtype=bool) if slopes is None else np.isnan(slopes).any(axis=(1, 2))
    for name in APART:
        if name in columns:
            new[1:] |= np.diff(columns[name]) != 0
    new[:1] = True
    ends = [*np.flatnonzero(new).tolist(), count]
    known = [COLUMNS.get(name, Column(name, units.get(name, ""), "")) for name in columns]
    kinds = columns_named(over(known, units.get("amplitude") or "length"), system)
    found = []
    for first, last in zip(ends, ends[1:]):
        table = Table(kinds, {name: values[first:last] for name, values in columns.items()})
        mine = replace(meaning, level=float(table["level"][0])) if isinstance(meaning, ForcedState) else meaning
        cubic = None
        if slopes is not None:
            cubic = Cubic(mine.scalars_of(_columns(table)), *np.moveaxis(slopes[first + 1 : last], 1, 0))
        found.append((first, Curve(table, mine, cubic)))
    return found


def _columns(table: Table) -> dict[str, Any]:
    return {name: table[name] for name in table.names}
