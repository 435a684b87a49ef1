"""Tables of a run as columns."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np


def table(path: Path) -> dict[str, np.ndarray]:
    """Columns of a CSV by their names without units."""
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    found = {key.partition(" [")[0]: [row[key] for row in rows] for key in rows[0]}
    return {k: np.array(v if k == "reached" else [float(x) for x in v]) for k, v in found.items()}
