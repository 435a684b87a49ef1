"""What `fretwave stress` wrote of an analysis: rows of its tables that a reader asks for."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..post.fatigue import doubts
from ..results.analysis import Analysis, Table
from ..results.reader import Run
from . import page

#: Columns that tell which node or branch, without a unit and whole.
WHOLE = ("point", "nodal_diameter", "line", "worst_node", "worst_sector")
STRESSES = ("stress_amplitude", "mean_stress")


def gauges_part(run: Run, analysis: Analysis) -> str:
    """Both tables; nothing where there are none, or where they are older than the results."""
    found, limits = (run.table_since(f"{analysis.name}_{end}") for end in ("gauges", "goodman"))
    if found is None:
        return ""
    warnings = doubts(found)
    found.pop("warning", None)
    rows = dict(_of_interest(found))
    parts = [_table(analysis, "gauges", found, rows)]
    if limits is not None:
        parts.append(_table(analysis, "goodman", limits, dict.fromkeys(range(len(limits["reached"])), "")))
    return page.titled("Gauges and stress", "\n".join([page.box(warnings), *parts]))


def _of_interest(table: Table) -> Iterator[tuple[int, str]]:
    """Rows in the order of the table, with what each is."""
    wanted = [name for name in table if name.endswith("_strain") or name in ("stress_amplitude", "goodman")]
    words = {int(np.argmax(table[name])): f"largest {name.replace('_', ' ')}" for name in wanted}
    yield from sorted(words.items())


def _table(analysis: Analysis, end: str, table: Table, rows: dict[int, str]) -> str:
    """Some rows with all columns."""
    head = ["what", "row", *(_heading(analysis, name) for name in table)]
    shown = [
        [word, str(row), *(_cell(analysis, end, table, name, row) for name in table)] for row, word in rows.items()
    ]
    return page.table(head, shown)


def _heading(analysis: Analysis, name: str) -> str:
    known = name.replace("limit_", "").replace("at_", "")
    unit = analysis.unit_system("pressure") if name in STRESSES else analysis.unit(known)
    words = name.replace("frequency_hz", "frequency").replace("_", " ")
    return f"{words} [{unit}]" if unit else words


def _cell(analysis: Analysis, end: str, table: Table, name: str, row: int) -> object:
    value = table[name][row]
    if name in WHOLE:
        return f"{value:.0f}"
    return str(value) if table[name].dtype.kind in "US" else page.Number(f"{analysis.name}_{end}/{name}/{row}", value)
