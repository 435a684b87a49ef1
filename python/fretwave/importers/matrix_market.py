"""Matrix Market exchange format: ``%%MatrixMarket matrix coordinate|array real general|symmetric``.

Layout: R. F. Boisvert, R. Pozo, K. A. Remington, "The Matrix Market Exchange Formats: Initial Design", NISTIR 5935.
A symmetric file holds the lower triangle; SciPy gives both.
"""

from __future__ import annotations

from pathlib import Path

import scipy.io

from ..texts import display
from .entries import Entries


def read(path: Path) -> Entries:
    """A matrix, both triangles when its header says symmetric."""
    rows, columns, entries, layout, _, symmetry = scipy.io.mminfo(str(path))
    least = 2 * (rows * columns // 2 if layout == "array" else entries)  # a digit and a blank each
    if min(rows, columns) < 0 or least > path.stat().st_size:
        raise ValueError(f"{rows} x {columns} with {entries} entries by its header, in {path.stat().st_size} bytes")
    mirrored = "lower triangle (symmetric by its header), mirrored" if symmetry == "symmetric" else ""
    return Entries.of(scipy.io.mmread(str(path)), display(path), "Matrix Market", mirrored)
