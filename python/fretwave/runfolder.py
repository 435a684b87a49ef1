"""The run folder: run.json, run.log, a copy of the case. Nothing is written before the first solved point."""

from __future__ import annotations

import json
import os
import platform
import resource
import socket
import sys
import time
import uuid
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from .errors import InputError
from .source import display

RECORD = "run.json"
CASE_COPY = "case.toml"


class RunFolder:
    """Keeps the record of one run. Only the rank with `active` writes.

    Parameters
    ----------
    path : Path
        The folder; made when the run starts.
    record : dict
        What ``run.json`` holds.
    case_text : str
        Text of the case file, kept as a copy.
    active : bool
        True on rank 0.
    resumed : bool
        The folder is that of this very run: its log is continued.
    """

    def __init__(self, path: Path, record: dict[str, Any], case_text: str, active: bool, resumed: bool = False) -> None:
        self.path, self.record, self.active = path, record, active
        self._case_text = case_text
        self._waiting: list[str] = []
        self._log: Any = None
        self._resumed = resumed
        self.started = False

    def start(self) -> None:
        """Write the record and open the log; called when the first point is there."""
        if self.started or not self.active:
            self.started = True
            return
        self.started = True
        self.path.mkdir(parents=True, exist_ok=True)
        self._keep_earlier()
        replace_text(self.path / CASE_COPY, self._case_text)
        self.save()
        self._log = (self.path / "run.log").open("a" if self._resumed else "w", encoding="utf-8")
        for line in self._waiting:
            self._write(line)

    def _keep_earlier(self) -> None:
        """Entries of analyses that this run leaves as they are."""
        try:
            earlier = json.loads((self.path / RECORD).read_text(encoding="utf-8"))["analyses"]
        except (OSError, ValueError, KeyError):
            return
        kept = {name: entry for name, entry in earlier.items() if self._resumed or name not in self.record["selected"]}
        self.record["analyses"] = {**kept, **self.record["analyses"]}

    def log(self, line: str) -> None:
        """One line of run.log, kept back until the run starts."""
        if not self.active:
            return
        if self._log is None:
            self._waiting.append(line)
        else:
            self._write(line)

    def _write(self, line: str) -> None:
        self._log.write(line + "\n")
        self._log.flush()

    def save(self) -> None:
        """Write run.json in one step."""
        if self.active and self.started:
            replace_text(self.path / RECORD, json.dumps(self.record, indent=2) + "\n")

    def close(self) -> None:
        """Write the record a last time and close the log."""
        self.save()
        if self._log is not None:
            self._log.close()
            self._log = None


def replace_text(path: Path, text: str) -> None:
    """Write a file in one step: a reader or a kill sees the old text or the new one."""
    fresh = path.with_name(f".{path.name}.new")
    fresh.write_text(text, encoding="utf-8")
    os.replace(fresh, path)


def new_record(case: Mapping[str, Any], ranks: int) -> dict[str, Any]:
    """run.json at the start of a run.

    Parameters
    ----------
    case : mapping
        How the case was given: path, overrides, quick, only, petsc, resolved, digest.
    """
    return {
        "run_id": uuid.uuid4().hex,
        "started": time.strftime("%Y-%m-%dT%H:%M:%S%z"),
        "status": "running",
        "ranks": ranks,
        "selected": [],
        "host": socket.gethostname(),
        "versions": versions(),
        "case": dict(case),
        "analyses": {},
    }


def read_record(folder: Path) -> dict[str, Any]:
    """run.json of a run folder.

    Raises
    ------
    InputError
        There is none, or it is damaged.
    """
    path = folder / RECORD
    try:
        record: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        return record
    except FileNotFoundError:
        inside = sorted(entry.parent for entry in folder.glob(f"*/{RECORD}")) if folder.is_dir() else []
        raise InputError(
            "this is not a run folder",
            where=display(folder),
            measured="no run.json in it" if folder.is_dir() else "no such folder",
            expected="the folder of a run, for example runs/two_dof",
            fix=f"did you mean {display(inside[0])}?" if inside else "start a run with `fretwave run CASE`",
        ) from None
    except json.JSONDecodeError as error:
        raise InputError("run.json is damaged", display(path), error, "JSON", "run the case anew") from None


def versions() -> dict[str, str]:
    """Versions of everything that decides the numbers."""
    from importlib.metadata import PackageNotFoundError, version

    import h5py
    import numpy
    import petsc4py
    import scipy
    from mpi4py import MPI
    from petsc4py import PETSc

    try:
        own = version("fretwave")
    except PackageNotFoundError:
        own = "not installed"
    return {
        "fretwave": own,
        "python": platform.python_version(),
        "petsc": ".".join(str(part) for part in PETSc.Sys.getVersion()),
        "petsc4py": petsc4py.__version__,
        "numpy": numpy.__version__,
        "scipy": scipy.__version__,
        "h5py": h5py.__version__,
        "hdf5": h5py.version.hdf5_version,
        "mpi": MPI.Get_library_version().split("\n")[0].strip("\0 "),
        "system": platform.platform(),
    }


def peak_memory_mb(comm: Any) -> dict[str, float]:
    """Largest resident size of a rank and the sum over ranks [MB]. Collective."""
    unit = 1 if sys.platform == "darwin" else 1024
    sizes = comm.allgather(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e6)
    return {"largest_rank": round(max(sizes), 1), "all_ranks": round(sum(sizes), 1)}
