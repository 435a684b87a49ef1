"""Columns of numbers in text files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..arrays import Array, IntArray
from ..errors import InputError
from ..texts import display
from .entries import Entries

COMMENTS = ("*", "#", "%")
#: Rows for each entry from which on an index is wrong: mass and stiffness have an entry in every row.
SPARSEST = 10


def first_data_line(head: bytes) -> str:
    """The first line that is no comment and no keyword."""
    lines = head.decode("utf-8", errors="replace").splitlines()
    return next((line for line in lines if line.strip() and not line.lstrip().startswith(COMMENTS)), "")


def columns_of(path: Path, width: int) -> Array:
    """(n_lines, width) numbers, separated by blanks or commas, after comments and one heading at most."""
    with path.open("rb") as file:
        head = file.read(65536)
    first = first_data_line(head)
    skip = int(first.strip()[:1].isalpha())  # a heading stands in the first line
    mark = head.lstrip()[:1].decode("utf-8", "replace")
    # One mark of comments is looked for in C, several line by line in Python: five times slower.
    comments, delimiter = mark if mark in COMMENTS else "*", "," if "," in first else None
    try:
        table = np.loadtxt(path, ndmin=2, skiprows=skip, comments=comments, delimiter=delimiter)
    except ValueError as error:
        fix = "is the file complete, and of one matrix?"
        raise InputError(f"the file is no table of {width} columns", display(path), error, None, fix) from None
    if table.shape[1] != width or not len(table):
        measured = f"{len(table)} lines of {table.shape[1]} columns"
        raise InputError(
            "the file is no table of numbers", display(path), measured, f"{width} columns", "check the file"
        )
    return np.asarray(table)


def whole(values: Array | IntArray, where: str) -> IntArray:
    """Numbers of nodes and directions, of any shape, as whole numbers.

    Raises
    ------
    InputError
        One is none.
    """
    with np.errstate(invalid="ignore"):
        found = np.asarray(values).astype(np.int64)
    wrong = np.argwhere(found != values)
    if len(wrong):
        measured = f"{np.asarray(values)[tuple(wrong[0])]:g} in entry {wrong[0][0] + 1}, {len(wrong)} such"
        raise InputError("a node or direction is no whole number", where, measured, "whole numbers", "correct the file")
    return found


def triplets(table: Array, where: str, kind: str) -> Entries:
    """Entries of lines "row column value", indices from 1; the largest index is the size."""
    places = table[:, :2].astype(np.int64) - 1
    wrong = (places + 1 != table[:, :2]).any(axis=1) | (places < 0).any(axis=1)
    if wrong.any():
        line = int(np.flatnonzero(wrong)[0])
        measured = f"entry {line + 1}: {table[line, 0]:g} {table[line, 1]:g}"
        fix = "export again; internal dofs of Abaqus need FORMAT=MATRIX INPUT"
        raise InputError("a row or column is not a number from 1 on", where, measured, "1, 2, ...", fix)
    size = int(places.max()) + 1
    if size > SPARSEST * len(table) + 1000:
        measured, fix = f"{size} rows, {len(table)} entries", "correct the number of the row or column"
        raise InputError("most rows of a matrix are empty", where, measured, "an entry in each row", fix)
    return Entries(places[:, 0], places[:, 1], table[:, 2], (size, size), where, kind)
