"""The journal of an analysis that goes on: every row at once, in order, each with its checksum.

A row goes to the end of one file as a record (`journal_records`), its head last, so that nothing can spoil those before
it: a kill, a full disk or a power failure leaves whole rows and perhaps a torn one, which is cut off. results.h5 is
made from the journal when the analysis is complete (`results`); until then readers see the journal in its place. One
rank writes; arrays that lie in parts on the ranks pass through it a piece at a time (`mpi.spread`), and long ones are
read so.

::

    .<name>.rows          records: how the table is laid out; then rows, with their arrays; and further arrays
    .<name>.state         what the analysis goes on from after its last row, or the one before it
    .<name>.state_other   the same: each is written over in turn, so that one of them is always whole
    .<name>.state_safe    the same of some seconds ago, known to be on the disk with all its rows
"""

from __future__ import annotations

import os
import shutil
import time
import uuid
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..files.whole import replaced, told
from ..texts import display
from .journal_records import Record, first_record, write_record

#: A state and its rows are brought to the disk this often [s]: a power failure costs no more.
SAFE_EVERY = 3.0


class Journal:
    """The files of one analysis; writes on one rank.

    Parameters
    ----------
    folder : Path
        The run folder.
    name : str
        Of the analysis.
    """

    def __init__(self, folder: Path, name: str) -> None:
        self.path = journal_path(folder, name)
        self._states = [self.path.with_suffix(suffix) for suffix in (".state", ".state_other")]
        self._safe = self.path.with_suffix(".state_safe")
        self._descriptor = -1
        self._length = 0
        self._kept_in: dict[Path, int] = {}
        self._next = 0  # of the two states
        self._safe_at = 0.0
        self.token = ""

    def begin(self, layout: Record, first: Record) -> None:
        """Start anew with the layout and the first row; an earlier journal is replaced by both in one step."""
        self.token = uuid.uuid4().hex
        layout.values["token"] = self.token
        with replaced(self.path) as fresh, fresh.open("wb", buffering=0) as file:
            size = write_record(file.fileno(), write_record(file.fileno(), 0, layout), first)
        self._open(size)

    def go_on(self, size: int, token: str) -> None:
        """Write on after the first `size` bytes of what is there."""
        self.token = token
        self._open(size)

    def _open(self, size: int) -> None:
        with told(self.path):
            self._descriptor = os.open(self.path, os.O_WRONLY | os.O_CLOEXEC)
            os.ftruncate(self._descriptor, size)
        self._length = size

    def append(self, record: Record) -> None:
        """Add a record; where the disk takes only a part of it, none of it stays."""
        with told(self.path):
            try:
                self._length = write_record(self._descriptor, self._length, record)
            except OSError:
                with suppress(OSError):
                    os.ftruncate(self._descriptor, self._length)
                raise

    def keep_state(self, rows: int, arrays: Mapping[str, Any]) -> None:
        """Keep what the analysis goes on from after its rows so far."""
        record = Record("state", {"rows": rows, "token": self.token}, dict(arrays))
        newest = self._states[self._next]
        with told(newest):
            descriptor = self._state_file(newest)
            os.ftruncate(descriptor, write_record(descriptor, 0, record))
        self._next = 1 - self._next
        now = time.monotonic()
        if now - self._safe_at > SAFE_EVERY:
            with told(self.path):
                os.fsync(self._descriptor)
            with replaced(self._safe) as fresh:
                shutil.copyfile(newest, fresh)
            self._safe_at = time.monotonic()

    def _state_file(self, path: Path) -> int:
        """To be written over; a new one at first, for what an earlier process left may still be read from."""
        if path not in self._kept_in:
            path.unlink(missing_ok=True)
            self._kept_in[path] = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_CLOEXEC, 0o666)
        return self._kept_in[path]

    def state(self, token: str, rows: int) -> tuple[int, dict[str, Any]] | None:
        """The newest state whose rows are all there: how many, and its arrays. None when none was kept.

        Raises
        ------
        InputError
            States are there but rows of all of them are missing.
        """
        found = []
        for path in (*self._states, self._safe):
            with suppress(OSError):
                record = first_record(path)
                if record is not None and record.values["token"] == token:
                    found.append((int(record.values["rows"]), record.arrays, path))
        usable = [state for state in found if state[0] <= rows]
        if found and not usable:
            raise InputError(
                "rows of an analysis are missing",
                display(self.path),
                f"{rows} rows",
                f"{min(state[0] for state in found)} rows, as the analysis had when it was cut off",
                "restore it from a copy, or run the case anew into another folder",
            )
        if not usable:
            return None
        count, arrays, path = max(usable, key=lambda state: state[0])
        self._next = int(path == self._states[0])
        return count, arrays

    def close(self) -> None:
        """Leave the files for another process to go on."""
        for descriptor in (self._descriptor, *self._kept_in.values()):
            if descriptor >= 0:
                os.close(descriptor)
        self._descriptor = -1
        self._kept_in = {}

    def remove(self) -> None:
        """All is in results.h5."""
        self.close()
        for path in (*self._states, self._safe, self.path):
            path.unlink(missing_ok=True)


def journal_path(folder: Path, name: str) -> Path:
    """Where the rows of an analysis are until it is done."""
    return folder / f".{name}.rows"


def unfinished(folder: Path) -> dict[str, Path]:
    """Journals of a run folder by the name of their analysis."""
    return {path.name[1 : -len(".rows")]: path for path in sorted(folder.glob(".*.rows"))} if folder.is_dir() else {}
