"""Columns of numbers in text files."""

from __future__ import annotations

import codecs
import re
import zipfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from ..arrays import Array, IntArray
from ..errors import InputError
from ..texts import display
from .entries import Entries

COMMENTS = ("*", "#", "%")
#: Rows for each entry from which on an index is wrong: mass and stiffness have an entry in every row.
SPARSEST = 10
#: Bytes at a file's end, and lines there before the last, by which its last number is judged.
TAIL, JUDGES = 4096, 8
ZIP = b"PK\x03\x04"
#: How files begin that are no plain text: what they are, and what to do.
PACKED = {
    ZIP: ("compressed (zip)", "unpack it: unzip {}"),
    b"\x1f\x8b": ("compressed (gzip)", "unpack it: gunzip {}"),
    b"BZh": ("compressed (bzip2)", "unpack it: bunzip2 {}"),
    b"\xfd7zXZ\x00": ("compressed (xz)", "unpack it: unxz {}"),
    codecs.BOM_UTF16_LE: ("text in UTF-16", "write it in UTF-8: iconv -f UTF-16 -t UTF-8 {}"),
    codecs.BOM_UTF16_BE: ("text in UTF-16", "write it in UTF-8: iconv -f UTF-16 -t UTF-8 {}"),
}
_UNIT = re.compile(r"[\[(][^\[\](),\t]*[\])]")
_EXPONENT = re.compile(r"[eEdD][+-]?\d+$")


def head_of(path: Path, size: int = 65536) -> bytes:
    """How a file begins, without the mark that editors put before UTF-8."""
    with path.open("rb") as file:
        return file.read(size).removeprefix(codecs.BOM_UTF8)


def check_plain(path: Path, what: str) -> None:
    """A file is neither compressed nor in UTF-16; a .npz, which is a zip archive of arrays, counts as plain.

    Raises
    ------
    InputError
    """
    head = head_of(path, 8) if path.is_file() else b""
    for begin, (kind, fix) in PACKED.items():
        if head.startswith(begin) and not (begin == ZIP and _has_arrays(path)):
            raise InputError(f"the {what} cannot be read", display(path), kind, "plain", fix.format(display(path)))


def _has_arrays(path: Path) -> bool:
    """A zip archive has them, or is damaged, which its reader tells."""
    try:
        with zipfile.ZipFile(path) as archive:
            return any(name.endswith(".npy") for name in archive.namelist())
    except (zipfile.BadZipFile, OSError, ValueError, NotImplementedError):
        return True


def check_unmarked(path: Path) -> None:
    """A file that another package reads begins without the mark of UTF-8, which would hide its first line.

    Raises
    ------
    InputError
    """
    with path.open("rb") as file:
        if file.read(3) != codecs.BOM_UTF8:
            return
    fix = f"save it without: sed -i '1s/^\\xEF\\xBB\\xBF//' {display(path)}"
    raise InputError("the file begins with the mark of UTF-8", display(path), "EF BB BF", "its first line", fix)


def first_data_line(head: bytes) -> str:
    """The first line that is no comment and no keyword."""
    return _first_data(head)[1]


def _first_data(head: bytes) -> tuple[int, str]:
    """How many lines stand above the first that is no comment and no keyword, and that one."""
    lines = enumerate(head.decode("utf-8", errors="replace").splitlines())
    return next(((n, line) for n, line in lines if line.strip() and not line.lstrip().startswith(COMMENTS)), (0, ""))


def check_heading(line: str, columns: Sequence[str], where: str) -> None:
    """Columns that a heading names stand where they are read; other words, and units, are passed over.

    Raises
    ------
    InputError
        A column stands at another's place, or before another that it follows.
    """
    words = _heading_words(line)
    named = [(place, columns.index(word)) for place, word in enumerate(words) if word in columns]
    found = [column for _, column in named]
    moved = len(words) <= len(columns) and any(place != column for place, column in named)
    if moved or found != sorted(found):  # more words than columns: blanks part a name of several words
        expected, fix = ",".join(columns), "write the columns in this order"
        raise InputError("the columns stand in another order", where, line.strip(), expected, fix)


def _heading_words(line: str) -> list[str]:
    """How the name of each column begins, without its unit: z of ``z (mm)``, ``z/mm``, or ``Z position [mm]``."""
    plain = _UNIT.sub(" ", line).strip()
    names = plain.split(",") if "," in plain else re.split(r"\t+" if "\t" in plain else r"\s+", plain)
    return [re.split(r"[\s/\[(]", name.strip('" '))[0].lower() for name in names]


def columns_of(
    path: Path,
    width: int,
    converters: Mapping[int | str, Callable[[str], float]] | None = None,
    names: Sequence[str] = (),
) -> Array:
    """(n_lines, width) numbers, separated by blanks or commas, after comments and one heading at most.

    Parameters
    ----------
    converters : what makes numbers of the words of a column
    names : of the columns, which a heading may not name in another order
    """
    doubt_of_end(path)  # a last number that was cut is refused
    head = head_of(path)
    above, first = _first_data(head)
    if ";" in first:
        expected, fix = "columns separated by commas or blanks", "write commas between columns, points in decimals"
        raise InputError("columns are separated by semicolons", display(path), first.strip(), expected, fix)
    skip = above + 1 if first.strip().strip('"')[:1].isalpha() else 0  # with its heading
    if skip:
        check_heading(first, names, f"{display(path)}:{skip}")
    mark = head.lstrip()[:1].decode("utf-8", "replace")
    # One mark of comments is looked for in C, several line by line in Python: five times slower.
    comments, delimiter = mark if mark in COMMENTS else "*", "," if "," in first else None
    with path.open("rb") as file:
        encoding = "utf-8-sig" if file.read(3) == codecs.BOM_UTF8 else "latin1"
    try:
        table = np.loadtxt(path, float, comments, delimiter, converters, skip, ndmin=2, encoding=encoding)
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
    _check_no_size(table, where)
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


def _check_no_size(table: Array, where: str) -> None:
    """The first line is no "rows columns entries": that of the last row's diagonal, which stands again further down."""
    (rows, columns, count), rest = table[0], table[1:]
    is_size = rows == columns == table[:, :2].max() and count == np.floor(count) and count >= len(rest)
    if is_size and (rest[:, :2] == rows).all(axis=1).any():
        measured = f"{rows:g} {columns:g} {count:g}, then {len(rest)} lines"
        fix = "remove that line, or begin with `%%MatrixMarket matrix coordinate real general` (or `symmetric`)"
        raise InputError("the first line is the size of a matrix", where, measured, "row column value", fix)


def doubt_of_end(path: Path) -> str:
    """A warning where the last line does not end, so that its number may have been cut; "" where it is whole.

    Raises
    ------
    InputError
        It was cut: the lines before end with exponents of one length, the last does not.
    """
    with path.open("rb") as file:
        file.seek(max(0, path.stat().st_size - TAIL))
        tail = file.read().decode("utf-8", "replace")
    lines = [line for line in tail.splitlines() if line.strip() and not line.lstrip().startswith(COMMENTS)]
    if not lines or tail.endswith(("\n", "\r")):
        return ""
    *before, last = [len(found[0]) if (found := _EXPONENT.search(line.rstrip())) else 0 for line in lines[-JUDGES:]]
    if set(before) not in ({0}, set()) and set(before) == {last}:
        return ""
    if len(set(before)) == 1 and before[0]:
        fix = "export it again; is the file complete?"
        raise InputError("the last line is cut", display(path), lines[-1], "a value as in the lines before", fix)
    return f"{display(path)} does not end with the end of a line: is its last one whole, `{lines[-1].strip()}`?"
