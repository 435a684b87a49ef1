"""Numbers pair by pair, or sector by sector, from a table: ``normal_load = "loads.csv"``."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

import numpy as np

from ..errors import InputError
from ..texts import display, is_there, names_beside, nearest, number_in, shortened

#: A text with this ending is a file with a value for each pair or sector.
TABLE = ".csv"


@dataclass(frozen=True)
class ValueTable:
    """One column of a CSV file, a row for each pair (or sector) in any order.

    Attributes
    ----------
    path : Path
    key : heading of the column, with ``[unit]`` behind it or without
    unit : of the values, in the symbols of the case; empty for pure numbers
    where : place of the key in the case
    lower, strict : bound of the values, which are above it where it is strict
    row : what the rows are of, heading of the column with their numbers from 0
    """

    path: Path
    key: str
    unit: str
    where: str
    lower: float
    strict: bool = False
    row: str = "pair"

    def values(self, count: int) -> list[float]:
        """Those of all pairs.

        Raises
        ------
        InputError
            The file, or a line of it, is wrong.
        """
        found: dict[int, float] = {}
        row = self.row
        for line, number, value in self._rows():
            if not number.strip().isdecimal() or int(number) >= count:
                self._wrong(f"is of no {row}", line, f"{row} {number}", f"0 to {count - 1}", "correct the number")
            if int(number) in found:
                self._wrong(
                    f"has a {row} again", line, f"{row} {number}", f"each {row} once", "remove one of the lines"
                )
            found[int(number)] = self._number(line, value)
        missing = [number for number in range(count) if number not in found]
        if missing:
            measured = f"none for {row} {missing[0]}" + (f" and {len(missing) - 1} more" if missing[1:] else "")
            self._wrong(f"lacks {row}s", None, measured, f"{count} lines, one for each {row}", "add the lines")
        return [found[number] for number in range(count)]

    def _rows(self) -> Iterator[tuple[int, str, str]]:
        """Line, number and value of each row that is not empty."""
        if not is_there(self.path):
            near = nearest(self.path.name, names_beside(self.path, f"*{TABLE}"))
            fix = near or "check the path, which is relative to the case file"
            self._wrong("does not exist", None, display(self.path), "a CSV file", fix)
        try:
            lines = list(csv.reader(self.path.read_text(encoding="utf-8-sig").splitlines()))
        except (OSError, ValueError, csv.Error) as error:
            self._wrong("cannot be read", None, shortened(str(error)), "a CSV file", "write it anew")
        headings = [text.strip() for text in lines[0]] if lines else []
        places = self._places(headings)
        for line, row in enumerate(lines[1:], 2):
            if not any(text.strip() for text in row):
                continue
            self._check_length(line, row, headings)
            yield line, row[places[0]], row[places[1]]

    def _places(self, headings: Sequence[str]) -> tuple[int, int]:
        known = (self.key, f"{self.key} [{self.unit}]" if self.unit else self.key)
        place = next((k for k, text in enumerate(headings) if text in known), None)
        if place is None or self.row not in headings:
            measured, expected = shortened(",".join(headings)) or "nothing", f"{self.row},{known[1]}"
            commas = "write commas between columns, and decimal points"
            fix = commas if ";" in measured else "write that as its first line"
            self._wrong("has other headings", 1, measured, expected, fix)
        for names in (known, (self.row,)):
            if sum(text in names for text in headings) > 1:
                measured, expected = shortened(",".join(headings)), f"one column {names[-1]}"
                self._wrong("has a column twice", 1, measured, expected, "remove one of them")
        return headings.index(self.row), place

    def _check_length(self, line: int, row: Sequence[str], headings: Sequence[str]) -> None:
        """A decimal comma makes two columns of a number."""
        if len(row) == len(headings):
            return
        what, fix = "ends early", "complete the line"
        if len(row) > len(headings):
            what, fix = "has a line of more columns than headings", "write decimal points, not commas"
        measured, expected = f"{len(row)} columns: {shortened(','.join(row))}", f"{len(headings)}, as its headings"
        self._wrong(what, line, measured, expected, fix)

    def _number(self, line: int, text: str) -> float:
        value, low, strict = np.nan, self.lower, self.strict
        with suppress(ValueError):
            value = number_in(text)
        if not np.isfinite(value) or value < low or (strict and value == low):
            bound = f" {'>' if strict else '>='} {low:g}" if low > -1e300 else ""
            self._wrong("has no such value", line, text.strip() or "nothing", f"a number{bound}", "correct the line")
        return value

    def _wrong(self, what: str, line: int | None, measured: str, expected: str, fix: str) -> NoReturn:
        place = f"{display(self.path)}:{line}" if line else display(self.path)
        raise InputError(f"the table of {self.key} {what}", f"{self.where}, {place}", measured, expected, fix)
