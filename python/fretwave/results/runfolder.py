"""The run folder: run.json, run.log, a copy of the case. Nothing is written before the first solved point."""

from __future__ import annotations

import platform
import resource
import shutil
import socket
import sys
import time
import uuid
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import InputError
from ..files.lock import FolderLock, check_free
from ..files.place import expect_place, expect_writable
from ..files.whole import replace_text, told, write_all
from ..mpi.guard import on_first_rank
from ..texts import display, own_version
from .journal import Journal, unfinished
from .record import RECORD, read_record, write_record

if TYPE_CHECKING:
    from mpi4py import MPI

CASE_COPY = "case.toml"


def results_folder(given: Path | None, name: str, comm: MPI.Comm) -> Path:
    """Where results go: as ``--out`` says, or ``runs/<name>``. Collective.

    Raises
    ------
    InputError
        It is a file, lies in one, or has a name that none can have.
    FileError
        It cannot be written.
    """
    folder = given or Path("runs") / name
    on_first_rank(comm, lambda: _expect_folder(folder))
    return folder


def _expect_folder(folder: Path) -> None:
    expect_place(folder / RECORD, "name a folder")
    expect_writable(folder)


def _kind(record: Mapping[str, Any]) -> str:
    """What ``show`` takes a folder for."""
    return next((f"a {kind}" for kind in ("sweep", "study") if kind in record), "a run")


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
    force : bool
        Replace results of another case; they are refused otherwise.
    """

    def __init__(
        self,
        path: Path,
        record: dict[str, Any],
        case_text: str,
        active: bool,
        resumed: bool = False,
        force: bool = False,
    ) -> None:
        self.path, self.record, self.active = path, record, active
        self._case_text = case_text
        self._waiting: list[str] = []
        self._log: Any = None
        self._resumed, self._force = resumed, force
        self._lock = FolderLock(path)
        self.started = False

    def check_free(self) -> None:
        """Refuse a folder that another run has, results of another case, or of another kind. One rank only."""
        check_free(self.path)
        earlier = None if self._force else self._earlier()
        if earlier is None:
            return
        fix = "choose another folder with --out, or replace the results with --force"
        if self._of_another_case(earlier):
            measured, expected = (display(Path(record["case"]["path"])) for record in (earlier, self.record))
            what = "this folder holds the results of another case"
            raise InputError(what, display(self.path), measured, expected, fix)
        if _kind(earlier) != _kind(self.record):
            what = "this folder holds results of another kind, which would not be shown any more"
            raise InputError(what, display(self.path), _kind(earlier), _kind(self.record), fix)

    def _earlier(self) -> dict[str, Any] | None:
        """Record of another run that this one takes the folder of; None of a damaged one."""
        if self._resumed or "part_of" in self.record or not (self.path / RECORD).exists():
            return None
        try:
            return read_record(self.path)
        except InputError:
            return None

    def _of_another_case(self, earlier: Mapping[str, Any]) -> bool:
        """A case in another file with another content."""
        own, other = self.record["case"], earlier["case"]
        return bool(other["path"] != own["path"] and other.get("digest") != own["digest"])

    def start(self) -> None:
        """Lock the folder, write the record and open the log; called when the first point is there.

        Raises
        ------
        InputError
            Another run has the folder.
        FileError
            It cannot be written.
        """
        if self.started or not self.active:
            self.started = True
            return
        with told(self.path):
            self.path.mkdir(parents=True, exist_ok=True)
        self._lock.take()
        self.started = True
        earlier = self._earlier()
        if earlier is None or not (self._of_another_case(earlier) or _kind(earlier) != _kind(self.record)):
            self._keep_earlier()
        else:
            self._forget(earlier)
        replace_text(self.path / CASE_COPY, self._case_text)
        self.record["case"]["text_checksum"] = text_checksum(self._case_text.encode("utf-8"))
        self.save()
        with told(self.path / "run.log"):
            self._log = (self.path / "run.log").open("ab" if self._resumed else "wb", buffering=0)
        for line in self._waiting:
            self._write(line)

    def _keep_earlier(self) -> None:
        """Entries of analyses that this run leaves as they are."""
        try:
            earlier = read_record(self.path)["analyses"] if (self.path / RECORD).exists() else {}
        except InputError:
            return  # of a damaged record nothing is kept: a new one is written
        kept = {name: entry for name, entry in earlier.items() if self._resumed or name not in self.record["selected"]}
        self.record["analyses"] = {**kept, **self.record["analyses"]}

    def _forget(self, earlier: Mapping[str, Any]) -> None:
        """Remove results of another case or kind; its tables and pictures stay until others take their names."""
        (self.path / "results.h5").unlink(missing_ok=True)
        if "sweep" in earlier:
            shutil.rmtree(self.path / "values", ignore_errors=True)
        for name in unfinished(self.path):
            Journal(self.path, name).remove()

    def log(self, line: str) -> None:
        """One line of run.log, kept back until the run starts."""
        if not self.active:
            return
        if self._log is None:
            self._waiting.append(line)
        else:
            self._write(line)

    def _write(self, line: str) -> None:
        with told(self.path / "run.log"):
            write_all(self._log.fileno(), f"{line}\n".encode())

    def save(self) -> None:
        """Write run.json in one step."""
        if self.active and self.started:
            write_record(self.path, self.record)

    def close(self) -> None:
        """Write the record a last time, close the log and let others into the folder."""
        self.save()
        self.leave()

    def leave(self) -> None:
        """Close the log and let others into the folder."""
        if self._log is not None:
            self._log.close()
            self._log = None
        self._lock.release()


def read_copy(folder: Path, record: Mapping[str, Any]) -> str:
    """Text of the case as the folder keeps it.

    Raises
    ------
    InputError
        It is gone or not what was written.
    """
    path, given = folder / CASE_COPY, record["case"].get("text_checksum")
    try:
        text = path.read_bytes()
    except OSError as error:
        fix = "restore it from a copy, or put the case file back into its place"
        raise InputError("the copy of the case is gone", display(path), error.strerror, None, fix) from None
    if given is not None and given != text_checksum(text):
        fix = "restore it from a copy, or put the case file back into its place"
        raise InputError("the copy of the case is damaged", display(path), "its checksum is another", given, fix)
    return text.decode("utf-8", "replace")


def text_checksum(text: bytes) -> str:
    """Of the case's text, kept in run.json."""
    return f"{zlib.crc32(text):08x}"


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


__all__ = ["CASE_COPY", "RECORD", "RunFolder", "new_record", "peak_memory_mb", "read_copy", "read_record"]


def versions() -> dict[str, str]:
    """Versions of everything that decides the numbers."""
    import h5py
    import numpy
    import petsc4py
    import scipy
    import slepc4py
    from mpi4py import MPI
    from petsc4py import PETSc

    return {
        "fretwave": own_version(),
        "python": platform.python_version(),
        "petsc": ".".join(str(part) for part in PETSc.Sys.getVersion()),
        "petsc4py": petsc4py.__version__,
        "slepc4py": slepc4py.__version__,
        "numpy": numpy.__version__,
        "scipy": scipy.__version__,
        "h5py": h5py.__version__,
        "hdf5": h5py.version.hdf5_version,
        "mpi": MPI.Get_library_version().split("\n")[0].strip("\0 "),
        "system": platform.platform(),
    }


def peak_memory_mb(comm: MPI.Comm) -> dict[str, float]:
    """Largest resident size of a rank and the sum over ranks [MB]. Collective."""
    unit = 1 if sys.platform == "darwin" else 1024
    sizes = comm.allgather(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e6)
    return {"largest_rank": round(max(sizes), 1), "all_ranks": round(sum(sizes), 1)}
