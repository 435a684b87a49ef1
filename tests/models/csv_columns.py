"""Tables of a run as rows and as columns."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np


def rows(path: Path, **chosen: str) -> list[dict[str, str]]:
    """Of a CSV, as texts; those whose columns have these alone."""
    with path.open(newline="") as file:
        return [row for row in csv.DictReader(file) if all(row[key] == value for key, value in chosen.items())]


def column(path: Path, key: str, **chosen: str) -> np.ndarray:
    """Numbers of one column of them."""
    return np.array([float(row[key]) for row in rows(path, **chosen)])


def table(path: Path) -> dict[str, np.ndarray]:
    """Columns of a CSV by their names without units."""
    read = rows(path)
    found = {key.partition(" [")[0]: [row[key] for row in read] for key in read[0]}
    return {k: np.array(v if k == "reached" else [float(x) for x in v]) for k, v in found.items()}
