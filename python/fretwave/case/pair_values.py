"""A law's parameter pair by pair from a table: ``normal_load = "loads.csv"``."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import NoReturn

import numpy as np

from ..errors import InputError
from ..model.laws import ParameterInfo
from ..texts import display, is_there, names_beside, nearest, shortened

#: Heading of the column with the numbers of the pairs.
PAIR = "pair"


class PairTable:
    """One column of a CSV file, a row for each pair in any order.

    Parameters
    ----------
    path : Path
    key : heading of the column, with ``[unit]`` behind it or without
    parameter : whose bound the values keep
    unit : of the values, in the symbols of the case
    where : place of the key in the case
    """

    def __init__(self, path: Path, key: str, parameter: ParameterInfo, unit: str, where: str) -> None:
        self.path, self.key, self.parameter, self.unit, self.where = path, key, parameter, unit, where

    def values(self, n_pairs: int) -> list[float]:
        """Those of all pairs.

        Raises
        ------
        InputError
            The file, or a line of it, is wrong.
        """
        found: dict[int, float] = {}
        for line, pair, value in self._rows():
            if not pair.strip().isdecimal() or int(pair) >= n_pairs:
                self._wrong("is of no pair", line, f"pair {pair}", f"0 to {n_pairs - 1}", "correct the number")
            if int(pair) in found:
                self._wrong("has a pair again", line, f"pair {pair}", "each pair once", "remove one of the lines")
            found[int(pair)] = self._number(line, value)
        missing = [pair for pair in range(n_pairs) if pair not in found]
        if missing:
            measured = f"none for pair {missing[0]}" + (f" and {len(missing) - 1} more" if missing[1:] else "")
            self._wrong("lacks pairs", None, measured, f"{n_pairs} lines, one for each pair", "add the lines")
        return [found[pair] for pair in range(n_pairs)]

    def _rows(self) -> Iterator[tuple[int, str, str]]:
        """Line, pair and value of each row that is not empty."""
        if not is_there(self.path):
            fix = (
                nearest(self.path.name, names_beside(self.path)) or "check the path, which is relative to the case file"
            )
            self._wrong("does not exist", None, display(self.path), "a CSV file", fix)
        try:
            lines = list(csv.reader(self.path.read_text(encoding="utf-8-sig").splitlines()))
        except (OSError, ValueError, csv.Error) as error:
            self._wrong("cannot be read", None, shortened(str(error)), "a CSV file", "write it anew")
        places = self._places([text.strip() for text in lines[0]] if lines else [])
        for line, row in enumerate(lines[1:], 2):
            if not any(text.strip() for text in row):
                continue
            if len(row) <= max(places):
                self._wrong("ends early", line, f"{len(row)} columns", "as many as headings", "complete the line")
            yield line, row[places[0]], row[places[1]]

    def _places(self, headings: Sequence[str]) -> tuple[int, int]:
        known = (self.key, f"{self.key} [{self.unit}]")
        place = next((k for k, text in enumerate(headings) if text in known), None)
        if place is None or PAIR not in headings:
            measured, expected = shortened(",".join(headings)) or "nothing", f"{PAIR},{known[1]}"
            self._wrong("has other headings", 1, measured, expected, "write that as its first line")
        return headings.index(PAIR), place

    def _number(self, line: int, text: str) -> float:
        value, low, strict = np.nan, self.parameter.lower, self.parameter.strict
        with suppress(ValueError):
            value = float(text)
        if not np.isfinite(value) or value < low or (strict and value == low):
            bound = f" {'>' if strict else '>='} {low:g}" if low > -1e300 else ""
            self._wrong("has no such value", line, text.strip() or "nothing", f"a number{bound}", "correct the line")
        return value

    def _wrong(self, what: str, line: int | None, measured: str, expected: str, fix: str) -> NoReturn:
        place = f"{display(self.path)}:{line}" if line else display(self.path)
        raise InputError(f"the table of {self.key} {what}", f"{self.where}, {place}", measured, expected, fix)
