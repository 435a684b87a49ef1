"""``fretwave stress``: gauges, the worst stress and Goodman's limit over the points of a run's branches."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..columns import Column
from ..errors import InputError
from ..files.csv_table import table_text
from ..files.whole import replace_text
from ..results.overview import amplitude_column, whose_amplitude
from ..texts import counted, display
from ..view.endurance import BEFORE, YES, endurance, told_at_limit
from ..view.stress import StressTable, stress_tables

#: Names of the tables, behind that of the analysis.
GAUGES, LIMITS = "gauges", "goodman"
#: Means below this share of the amplitude are printed as zero.
SMALL = 1e-6


def stress(folder: Path, asked: str | None = None, out: Path | None = None) -> None:
    """Write the tables and say what they tell. One rank only.

    Raises
    ------
    InputError
        As `stress_tables`; one file for several analyses.
    """
    tables = list(stress_tables(folder, asked))
    if out is not None and len(tables) > 1:
        names = ", ".join(table.name for table in tables)
        raise InputError("one file cannot take several tables", "--out", names, "one analysis", "add --analysis NAME")
    for table in tables:
        path = out or folder / f"{table.name}_{GAUGES}.csv"
        replace_text(path, table_text(table.columns, table.rows))
        print(f"{table.name}: {counted(len(table.rows), 'point')}, {display(path)}")
        print("\n".join(f"  {line}" for line in lines(table)))
        if out is None:
            _write_limits(folder / f"{table.name}_{LIMITS}.csv", table)


def _write_limits(path: Path, table: StressTable) -> None:
    """A table of limits that the case no longer gives would be shown beside the new one of the gauges."""
    columns, rows = endurance(table)
    if rows:
        replace_text(path, table_text(columns, rows))
    else:
        path.unlink(missing_ok=True)


def lines(table: StressTable) -> Iterator[str]:
    """What a reader asks for first."""
    known = {column.name: column for column in table.columns}
    yield from table.notes
    for name in known:
        if name.endswith("_strain") and len(table.rows):
            yield _of_gauge(table, name, known[amplitude_column(known)])
    if "stress_amplitude" in table and len(table.rows):
        yield _of_stress(table, known)
    columns, rows = endurance(table)
    units = {column.name: column.symbol for column in columns}
    yield from (_of_limit(row, units) for row in rows)
    yield from _of_level(rows)


def _at(table: StressTable, k: int, amplitude: Column) -> str:
    return f"at point {k}, amplitude {table[amplitude.name][k]:.5g} {amplitude.symbol}{whose_amplitude(table)}"


def _of_gauge(table: StressTable, name: str, amplitude: Column) -> str:
    values, gauge = table[name], name[: -len("_strain")]
    k = int(np.argmax(values))
    mean = _mean(table[f"{gauge}_mean"][k], values[k])
    return f"gauge {gauge}: strain amplitude up to {values[k]:.5g} about {mean}, {_at(table, k, amplitude)}"


def _mean(value: float, amplitude: float) -> str:
    """What is rounding is zero."""
    return f"{value:.4g}" if abs(value) > SMALL * amplitude else "0"


def _of_stress(table: StressTable, known: Mapping[str, Column]) -> str:
    k = int(np.argmax(table["goodman" if "goodman" in table else "stress_amplitude"]))
    row, unit = table.rows[k], known["stress_amplitude"].symbol
    sector = f" of sector {row['worst_sector']}" if "worst_sector" in row else ""
    mean = _mean(row["mean_stress"], row["stress_amplitude"])
    values = f"amplitude {row['stress_amplitude']:.5g} {unit} about a mean of {mean} {unit}"
    return f"worst stress: {values}, node {row['worst_node']}{sector}, {_at(table, k, known[amplitude_column(known)])}"


def _of_level(rows: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """At which level of a force the largest factor is 1: between two of them, or below the lowest."""
    if not rows or "limit_level" not in rows[0]:
        return
    level, lowest = rows[0]["limit_level"], min(rows, key=lambda row: float(row["level"]))
    if np.isfinite(level):
        lower = "" if all(row["peak_within"] for row in rows) else ", or lower: peaks are beyond the frequency range"
        yield f"Goodman factor 1 at level {level:.5g} of the force{lower}"
    elif lowest["largest_goodman"] >= 1:
        yield f"Goodman factor 1 below level {lowest['level']:g} of the force, the lowest"


def _of_limit(row: Mapping[str, Any], units: Mapping[str, str]) -> str:
    """Of one branch."""
    parts = [f"{name.replace('_', ' ')} {row[name]:g}" for name in ("level", "nodal_diameter", "line") if name in row]
    of = f"{', '.join(parts)}: " if parts else ""
    known = [name.removeprefix("limit_") for name in row if name.startswith("limit_")]
    at = f"at_{amplitude_column(known)}"
    largest = f"largest {row['largest_goodman']:.4g} at {row[at]:.5g} {units[at]}{whose_amplitude(known)}"
    largest += "" if row.get("peak_within", 1) else " (at an end of the frequency range: the peak is beyond)"
    if row["reached"] == YES:
        told = (f"{row[f'limit_{name}']:.6g} {units[f'limit_{name}']}" for name in told_at_limit(known))
        return f"{of}Goodman factor 1 at {', '.join(told)}; {largest}"
    if row["reached"] == BEFORE:
        return f"{of}Goodman factor above 1 from the first point on; {largest}"
    return f"{of}Goodman factor 1 is not reached; {largest}"
