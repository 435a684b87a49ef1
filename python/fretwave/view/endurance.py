"""Where the branches of an analysis reach Goodman's limit, off straight lines between their points."""

from __future__ import annotations

from collections.abc import Container, Mapping
from typing import Any

import numpy as np

from ..arrays import Array, Indices
from ..columns import Column
from ..post.fatigue import EQUAL, first_reaching
from ..post.largest import largest
from ..results.overview import amplitude_column
from ..results.parts import PARTS, rows_of_branches
from .stress import StressTable

#: Whether a branch reaches the limit.
YES, NO, BEFORE = "yes", "no", "before its first point"
LARGEST = Column("largest_goodman", "1", "largest Goodman factor of the branch")
REACHED = (
    Column("worst_node", "1", "node of the largest factor", "i"),
    Column("reached", "", "whether the branch reaches a factor of 1", "s"),
)
#: Of what else than the amplitude the limit is told, where a table has it.
BESIDE = ("frequency_hz", "cycles")
#: Of a frequency response.
WITHIN = Column("peak_within", "1", "1: the largest factor is a peak; 0: it is at an end of the frequency range", "i")
LEVEL = Column("limit_level", "1", "level of the force at which the largest factor over frequency is 1")

Row = dict[str, Any]


def endurance(table: StressTable) -> tuple[list[Column], list[Row]]:
    """Columns, and a row for each branch; no rows without Goodman factors."""
    if "goodman" not in table or not table.rows:
        return [], []
    known = {column.name: column for column in table.columns}
    parts = [name for name in PARTS if name in known]
    at_limit = [known[name] for name in told_at_limit(known)]
    columns = {name: table[name] for name in known}
    rows = [_row(columns, chosen, parts) for chosen in rows_of_branches(columns)]
    amplitude = _renamed(at_limit[0], "at", "of the largest factor")
    found = [*(known[name] for name in parts), LARGEST, amplitude, *REACHED]
    found += [_renamed(column, "limit", "where the factor is 1") for column in at_limit]
    if "level" in parts:
        level = _limit_level(rows)
        found += [LEVEL, WITHIN]
        within = [_has_peak(table["goodman"][chosen]) for chosen in rows_of_branches(columns)]
        rows = [{**row, LEVEL.name: level, WITHIN.name: int(inside)} for row, inside in zip(rows, within)]
    return found, rows


def told_at_limit(known: Container[str]) -> list[str]:
    """Columns of which the limit is told: the amplitude first, of a whole wheel's response that of any sector."""
    return [amplitude_column(known), *(name for name in BESIDE if name in known)]


def _renamed(column: Column, prefix: str, what: str) -> Column:
    return Column(f"{prefix}_{column.name}", column.unit, f"{column.long_name}, {what}", "f", column.units)


def _row(columns: Mapping[str, Array], chosen: Indices, parts: list[str]) -> Row:
    """Of one branch; the limit is where its factor first rises to 1."""
    factor = columns["goodman"][chosen]
    top = chosen[np.argmax(factor)]
    names = told_at_limit(columns)
    passed = first_reaching(factor, 1.0, *(columns[name][chosen] for name in names))
    before = bool(factor[0] >= 1)
    values = (np.nan,) * len(names) if before or passed is None else passed
    return {
        **{name: columns[name][top].item() for name in parts},
        "largest_goodman": float(columns["goodman"][top]),
        f"at_{names[0]}": float(columns[names[0]][top]),
        "worst_node": int(columns["worst_node"][top]),
        "reached": BEFORE if before else NO if passed is None else YES,
        **{f"limit_{name}": value for name, value in zip(names, values)},
    }


def _has_peak(factor: Array) -> bool:
    """Whether a response is largest between the ends of its range."""
    return 0 < largest(factor, EQUAL) < len(factor) - 1


def _limit_level(rows: list[Row]) -> float:
    """Between levels; not a number where the largest factors do not pass 1."""
    ordered = sorted(rows, key=lambda row: float(row["level"]))
    levels, factors = (np.array([row[key] for row in ordered], dtype=float) for key in ("level", "largest_goodman"))
    passed = first_reaching(factors, 1.0, levels)
    return np.nan if passed is None else passed[0]
