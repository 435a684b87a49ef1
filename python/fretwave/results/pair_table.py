"""A table of the contact pairs at one point of an analysis, from its results alone."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from ..arrays import AnyArray, Array
from ..columns import Column
from ..model.law_info import Role, kept_laws
from ..post.contact_history import ContactHistory
from ..post.pair_values import COLUMNS, pair_values
from .analysis import Analysis

#: What each row begins with.
LEAD = (
    Column("contact", "", "name of the contact", "s"),
    Column("pair", "1", "number of the pair", "i"),
    Column("face", "", "name of the face", "s"),
    Column("along", "length", "place on the face, first coordinate"),
    Column("across", "length", "place on the face, second coordinate"),
)


def history_of(analysis: Analysis, contact: str, point: int) -> ContactHistory:
    """The period of a contact at a point that keeps it."""
    law = kept_laws(analysis.attributes.get("laws", {})).get(contact)
    return ContactHistory.of(analysis.loop(contact, point), None if law is None else law.normal)


def pair_table(analysis: Analysis, point: int) -> tuple[list[Column], list[dict[str, Any]]]:
    """Columns that any contact has, in the units of the results, and a row for each pair of each contact."""
    rows: list[dict[str, Any]] = []
    for contact in analysis.contacts:
        rows += _rows(contact, _pairs_of(analysis, contact, point))
    there = {name for row in rows for name in row}
    columns = [column.in_units(analysis.unit_system) for column in (*LEAD, *COLUMNS) if column.name in there]
    return columns, rows


def _rows(contact: str, values: Mapping[str, Array]) -> list[dict[str, Any]]:
    count = len(next(iter(values.values())))
    return [{"contact": contact, "pair": k, **{key: one[k] for key, one in values.items()}} for k in range(count)]


def _pairs_of(analysis: Analysis, contact: str, point: int) -> dict[str, Any]:
    """Places and values of a contact's pairs."""
    history = history_of(analysis, contact, point)
    stiffness = analysis.parameter(contact, Role.TANGENTIAL_STIFFNESS)
    spread = {name: _spread(values, history.n_pairs) for name, values in analysis.pairs(contact).items()}
    places = {}
    if "position" in spread:
        along, across = spread["position"].T
        places = {"face": spread["face"], "along": along, "across": across}
    kt = None if stiffness is None else _spread(stiffness, history.n_pairs)
    return {**places, **pair_values(history, kt, spread.get("area"))}


def _spread(values: npt.ArrayLike, count: int) -> AnyArray:
    """Of one sector's pairs for those of all sectors of a wheel, or one value for all."""
    one = np.atleast_1d(values)
    return np.concatenate([one] * (count // len(one)))
