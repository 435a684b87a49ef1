"""Tables as CSV: numbers with all digits, texts quoted where they must be."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping, Sequence
from io import StringIO
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from ..columns import Column, Value
from .whole import replace_text

#: Headings of columns by name where they are not the names.
Headings = Mapping[str, str]
_NAMES: Headings = MappingProxyType({})


def header_line(columns: Sequence[Column]) -> str:
    """First line of a table: names, with their units where they are not SI's."""
    return _lines([[column.heading for column in columns]])


def row_line(columns: Sequence[Column], row: Mapping[str, Value]) -> str:
    """A row of a table, for what is written a row at a time."""
    return _lines([[column.text(row[column.name]) for column in columns]])


def table_text(columns: Sequence[Column], rows: Iterable[Mapping[str, Value]]) -> str:
    """A table with its first line."""
    return "".join([header_line(columns), *(row_line(columns, row) for row in rows)])


def write_columns(path: Path, columns: Mapping[str, Any], headings: Headings = _NAMES) -> None:
    """A table by its columns, written in one step.

    Raises
    ------
    FileError
    """
    replace_text(path, _lines([[headings.get(name, name) for name in columns], *zip(*columns.values())]))


def write_rows(path: Path, rows: Sequence[Mapping[str, Any]], headings: Headings = _NAMES) -> None:
    """A table by its rows, empty where a row has no such column, written in one step.

    Raises
    ------
    FileError
    """
    names = list(dict.fromkeys(name for row in rows for name in row))
    write_columns(path, {name: [row.get(name, "") for row in rows] for name in names}, headings)


def _lines(rows: Iterable[Iterable[Any]]) -> str:
    text = StringIO()
    csv.writer(text, lineterminator="\n").writerows([plain(value) for value in row] for row in rows)
    return text.getvalue()


def plain(value: object) -> Any:
    """The value as Python's own, a number as the text with all its digits."""
    own = value.item() if isinstance(value, np.generic) else value
    return own.decode() if isinstance(own, bytes) else repr(own) if isinstance(own, float) else own
