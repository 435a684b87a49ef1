"""What a run was made with, and digests of what it was made from and of what came out."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from ..results.journal import unfinished
from ..results.runfolder import CASE_COPY
from ..results.source_file import digest
from ..texts import counted, own_version
from . import page

#: Keys of [model] that name a file, with what they are.
FILES = {"builder": "builder", "file": "model file", "M": "mass matrix", "K": "stiffness matrix", "C": "damping matrix"}
NAMES = {"petsc": "PETSc", "mpi": "MPI", "hdf5": "HDF5", "numpy": "NumPy", "scipy": "SciPy", "python": "Python"}


def provenance(folder: Path, record: Mapping[str, Any]) -> str:
    """Tables of versions and machine, and of digests."""
    made = page.facts([*_versions(record["versions"]), *_machine(record)])
    return made + page.titled("Digests (SHA-256)", page.facts(_digests(folder, record)))


def _versions(found: Mapping[str, str]) -> Iterator[tuple[str, object]]:
    for name, version in found.items():
        yield NAMES.get(name, name), version
    if found.get("fretwave") != own_version():
        yield "fretwave of this report", own_version()


def _machine(record: Mapping[str, Any]) -> Iterator[tuple[str, object]]:
    memory = record.get("peak_memory_mb", {})
    yield "machine", record.get("host", "")
    yield "MPI ranks", counted(record["ranks"], "rank")
    yield "peak memory", f"{memory['largest_rank']:g} MB of a rank, {memory['all_ranks']:g} MB in all" if memory else ""
    yield "PETSc options", record["case"]["petsc"]
    yield "run", record["run_id"]


def _digests(folder: Path, record: Mapping[str, Any]) -> Iterator[tuple[str, object]]:
    case = record["case"]
    yield "case file", case["path"]
    yield "its copy in the folder", _digest(folder / CASE_COPY)
    yield "all values that decide", case.get("digest", "not kept")
    for key, what in FILES.items():
        given = case["resolved"].get(f"model.{key}")
        if isinstance(given, str):
            yield _model_file(Path(case["path"]).parent, what, given)
    yield "results.h5", _digest(folder / "results.h5")
    for path in unfinished(folder).values():
        yield f"{path.name}, not done", _digest(path)


def _model_file(beside: Path, what: str, given: str) -> tuple[str, object]:
    """The file that the case names, and whether it is still the run's: run.json keeps the begin of its digest."""
    if given.startswith("sha256:"):
        return f"{what}, as read", given[len("sha256:") :]
    name, _, then = given.rpartition(" ")
    now = _digest(beside / name)
    changed = then and now[: len(then)] != then and "there" not in now
    return f"{what} {name}", f"{now} (CHANGED since the run: {then}...)" if changed else now


def _digest(path: Path) -> str:
    return digest(path) if path.is_file() else "not there"
