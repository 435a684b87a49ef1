"""Matrix Market exchange format: ``%%MatrixMarket matrix coordinate|array real general|symmetric``.

Layout: R. F. Boisvert, R. Pozo, K. A. Remington, "The Matrix Market Exchange Formats: Initial Design", NISTIR 5935.
A symmetric file holds the lower triangle; SciPy gives both.
"""

from __future__ import annotations

import codecs
from io import BytesIO
from pathlib import Path

import scipy.io

from ..errors import InputError
from ..texts import display
from .entries import Entries
from .text import doubt_of_end

BANNER = b"%%MatrixMarket"


def looks_like(head: bytes) -> bool:
    """It begins with the banner in letters of any case, after blank lines too."""
    return head.lstrip()[: len(BANNER)].lower() == BANNER.lower()


def read(path: Path) -> Entries:
    """A matrix, both triangles when its header says symmetric."""
    rows, columns, entries, layout, field, symmetry = scipy.io.mminfo(_source(path))
    if field == "pattern":
        what, measured, expected = "the matrix has places without values", "pattern in its header", "real"
        raise InputError(what, display(path), measured, expected, "write it with its values: scipy.io.mmwrite")
    least = 2 * (rows * columns // 2 if layout == "array" else entries)  # a digit and a blank each
    if min(rows, columns) < 0 or least > path.stat().st_size:
        raise ValueError(f"{rows} x {columns} with {entries} entries by its header, in {path.stat().st_size} bytes")
    mirrored = "lower triangle (symmetric by its header), mirrored" if symmetry == "symmetric" else ""
    found = Entries.of(scipy.io.mmread(_source(path)), display(path), "Matrix Market", mirrored)
    found.doubt = doubt_of_end(path)
    return found


def _source(path: Path) -> str | BytesIO:
    """The file itself where SciPy knows its banner, else its content under the banner that SciPy knows."""
    with path.open("rb") as file:
        if file.read(len(BANNER)) == BANNER:
            return str(path)
    content = path.read_bytes().removeprefix(codecs.BOM_UTF8).lstrip()
    return BytesIO(BANNER + content[len(BANNER) :])
