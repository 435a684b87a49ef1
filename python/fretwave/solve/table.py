"""A table in memory: columns by name, rows by number, as the CSV of a run has them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, overload

import numpy as np

from ..arrays import AnyArray
from ..columns import Column, Value
from ..errors import InputError
from ..files.csv_table import header_line, row_line
from ..files.whole import replaced
from ..given import whole
from ..units import UnitSystem

#: Rows that a table's text shows before it leaves out its middle.
SHOWN = 12


class Table:
    """Named columns of equal length.

    Attributes
    ----------
    columns : list of Column
        Name, unit and long name of each.

    Examples
    --------
    >>> from fretwave.columns import COLUMNS
    >>> table = Table([COLUMNS["amplitude"], COLUMNS["zeta"]], {"amplitude": [0.1, 0.2], "zeta": [0.01, 0.03]})
    >>> table["zeta"].max(), len(table), table[1]
    (0.03, 2, {'amplitude': 0.2, 'zeta': 0.03})
    """

    def __init__(self, columns: Sequence[Column], values: Mapping[str, Any]) -> None:
        types = {"f": float, "i": np.int64, "s": str}
        self.columns = list(columns)
        self._values = {c.name: np.asarray(values[c.name], dtype=types[c.kind]) for c in self.columns}

    @classmethod
    def of_rows(cls, columns: Sequence[Column], rows: Sequence[Mapping[str, Value]]) -> Table:
        """From rows by column name."""
        return Table(columns, {c.name: [row[c.name] for row in rows] for c in columns})

    @classmethod
    def joined(cls, tables: Sequence[Table]) -> Table:
        """One under the other, all with the columns of the first."""
        columns = tables[0].columns
        return Table(columns, {c.name: np.concatenate([table[c.name] for table in tables]) for c in columns})

    def moved(self, name: str, by: float) -> Table:
        """The same with a number added to all of a column."""
        return Table(self.columns, {**self._values, name: self._values[name] + by})

    @property
    def names(self) -> list[str]:
        """Names of the columns."""
        return [column.name for column in self.columns]

    @property
    def units(self) -> dict[str, str]:
        """Unit of each column in symbols, "1" for a pure number."""
        return {column.name: column.symbol for column in self.columns}

    @property
    def unit_system(self) -> UnitSystem:
        """The system that its numbers are in."""
        return self.columns[0].units

    def __len__(self) -> int:
        return len(next(iter(self._values.values()), ()))

    def __contains__(self, name: object) -> bool:
        return name in self._values

    @overload
    def __getitem__(self, key: str) -> AnyArray: ...
    @overload
    def __getitem__(self, key: int) -> dict[str, Value]: ...
    def __getitem__(self, key: str | int) -> AnyArray | dict[str, Value]:
        """A column by its name, a copy that may be changed, or a row by its number."""
        if isinstance(key, str):
            if key not in self._values:
                raise KeyError(f"no column '{key}'; there are {', '.join(self.names)}")
            return self._values[key].copy()
        row = whole(key)
        if row is None:
            raise InputError(
                "a row is taken by its number", None, repr(key), "one whole number", "take columns to slice"
            )
        return {name: values[row].item() for name, values in self._values.items()}

    def __iter__(self) -> Iterator[dict[str, Value]]:
        return (self[row] for row in range(len(self)))

    def to_csv(self, path: str | Path) -> None:
        """Write it as the table of a run is written: shortest text that gives the same numbers back."""
        with replaced(Path(path), own=True) as fresh:
            text = "".join([header_line(self.columns), *(row_line(self.columns, row) for row in self)])
            fresh.write_text(text, encoding="utf-8")

    def text(self) -> str:
        """Its first and last rows, aligned."""
        count = len(self)
        rows = range(count) if count <= SHOWN else [*range(SHOWN // 2), *range(count - SHOWN // 2, count)]
        names = [name for name in self.names if name in _SHORT] or self.names
        lines = [names, *([_cell(self[row][name]) for name in names] for row in rows)]
        if count > SHOWN:
            lines.insert(1 + SHOWN // 2, ["..."] + [""] * (len(names) - 1))
        widths = [max(len(line[k]) for line in lines) for k in range(len(names))]
        return "\n".join("  ".join(cell.rjust(width) for cell, width in zip(line, widths)) for line in lines)

    def __repr__(self) -> str:
        return f"{type(self).__name__}: {len(self)} rows\n{self.text()}"


#: Columns worth a line of text.
_SHORT = ("place", "point", "level", "amplitude", "cycles", "omega", "frequency_hz", "zeta", "phase", "slip", "event")


def _cell(value: Value) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)


#: Where on a branch something lies: 3.25 is a quarter of the step from row 3 to row 4.
PLACE = Column("place", "1", "number of the row before, and share of the step to the next one")
