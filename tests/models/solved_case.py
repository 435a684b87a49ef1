"""Tables of a case that a test writes and runs on all of its ranks."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
from mpi4py import MPI

from fretwave.run.order import RunOptions
from fretwave.run.runner import run_case

#: Columns of words.
WORDS = ("event", "contact")


def tables_of(text: str, folder: Path, comm: MPI.Comm, *names: str) -> list[dict[str, np.ndarray]]:
    """Run a case in a folder that all ranks share; its tables by name. Collective."""
    path, out = folder / "case.toml", folder / "run"
    if comm.rank == 0:
        path.write_text(text, encoding="utf-8")
    comm.barrier()
    assert run_case(path, RunOptions(out=out, plots=False, force=True), comm) == 0
    comm.barrier()
    return [columns(out / f"{name}.csv") for name in names]


def columns(path: Path) -> dict[str, np.ndarray]:
    """Of a CSV, by their names."""
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    return {key: np.array([row[key] if key in WORDS else float(row[key]) for row in rows]) for key in rows[0]}
