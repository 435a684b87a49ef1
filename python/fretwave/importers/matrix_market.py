"""Matrix Market exchange format: ``%%MatrixMarket matrix coordinate|array real general|symmetric``.

Layout: R. F. Boisvert, R. Pozo, K. A. Remington, "The Matrix Market Exchange Formats: Initial Design", NISTIR 5935.
A symmetric file holds the lower triangle; SciPy gives both.
"""

from __future__ import annotations

from pathlib import Path

import scipy.io

from ..source import display
from .entries import Entries


def read(path: Path) -> Entries:
    """A matrix, both triangles when its header says symmetric."""
    symmetry = scipy.io.mminfo(str(path))[5]
    mirrored = "lower triangle (symmetric by its header), mirrored" if symmetry == "symmetric" else ""
    return Entries.of(scipy.io.mmread(str(path)), display(path), "Matrix Market", mirrored)
