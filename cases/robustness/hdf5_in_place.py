"""What a kill leaves of an HDF5 file that is added to in place, with a flush after each row: why fretwave does not.

    .venv/bin/python cases/robustness/hdf5_in_place.py

HDF5's writes are recorded, and the file as it stands after each of them is opened and read in a process of its own.
"""

from __future__ import annotations

import io
import os
import tempfile
from collections import Counter
from pathlib import Path
from typing import Any

import h5py
import numpy as np

ROWS, COLUMNS = 40, 12


class Recorded(io.BytesIO):
    """A file in memory that remembers what was done to it."""

    def __init__(self) -> None:
        super().__init__()
        self.steps: list[tuple[int, bytes | None, int]] = []
        self.rows = 0

    def write(self, data: Any) -> int:
        self.steps.append((self.tell(), bytes(data), self.rows))
        return super().write(data)

    def truncate(self, size: int | None = None) -> int:
        self.steps.append((int(size or 0), None, self.rows))
        return super().truncate(size)


def recorded() -> Recorded:
    """A table that grows as the branch of a mode does."""
    raw = Recorded()
    with h5py.File(raw, "w") as file:
        columns = [file.create_dataset(f"c{k}", (0,), "f8", maxshape=(None,), chunks=(256,)) for k in range(COLUMNS)]
        coefficients = file.create_dataset("q", (0, 20, 15), "f8", maxshape=(None, 20, 15), chunks=(8, 20, 15))
        for row in range(ROWS):
            for data in columns:
                data.resize((row + 1,))
                data[row] = row + 1.0
            coefficients.resize(row + 1, axis=0)
            coefficients[row] = row + 1.0
            if row % 10 == 0:
                file.create_group(f"contact_{row}")["u"] = np.ones((64, 3))
            file.flush()
            raw.rows = row + 1
    return raw


def outcome(path: Path, rows: int) -> str:
    """What is left of the rows that were flushed."""
    child = os.fork()
    if child == 0:
        code = 3
        try:
            with h5py.File(path, "r") as file:
                there = [file[f"c{k}"][:rows] for k in range(COLUMNS)] + [file["q"][:rows, 0, 0]]
            code = 0 if all(np.array_equal(v, np.arange(1.0, rows + 1)) for v in there) else 2
        except Exception:
            code = 1
        finally:
            os._exit(code)
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    return {0: "whole", 1: "cannot be read", 2: "flushed rows are wrong or gone"}.get(code, "crash")


def main() -> int:
    """Count what is left after each write."""
    raw, data, found = recorded(), bytearray(), Counter[str]()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.h5"
        for place, written, rows in raw.steps:
            if written is None:
                data = data[:place].ljust(place, b"\0")
            else:
                data = data.ljust(place, b"\0")
                data[place : place + len(written)] = written
            if rows:
                path.write_bytes(data)
                found[outcome(path, rows)] += 1
    print(f"{sum(found.values())} places to be killed at: " + ", ".join(f"{n} {word}" for word, n in found.items()))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
