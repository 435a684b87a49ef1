"""The journal of an analysis that goes on: every row at once, in order, each with its checksum.

A row is one `write` at the end of one file, so that nothing can spoil those before it: a kill, a full disk or a power
failure leaves whole rows and perhaps a torn one, which is cut off. results.h5 is made from the journal when the
analysis is complete (`results`); until then readers see the journal in its place.

::

    .<name>.rows          records: how the table is laid out; then rows, with their arrays; and further arrays
    .<name>.state         what the analysis goes on from after its last row
    .<name>.state_safe    the same of some seconds ago, known to be on the disk with all its rows
"""

from __future__ import annotations

import json
import os
import struct
import time
import uuid
import zlib
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from ..errors import InputError
from ..files.whole import replace_bytes, told, write_all
from ..texts import display

#: Before each record: a mark, the length of the content and its checksum, and the checksum of these.
_HEAD = struct.Struct("<4sQII")
_MARK = b"frw1"
#: A state and its rows are brought to the disk this often [s]: a power failure costs no more.
SAFE_EVERY = 3.0


@dataclass
class Record:
    """One entry: its kind, plain values and arrays, and its bytes in the file."""

    kind: str
    values: dict[str, Any] = field(default_factory=dict)
    arrays: dict[str, Any] = field(default_factory=dict)
    length: int = 0


def packed(record: Record) -> bytes:
    """The bytes of a record."""
    arrays = {name: np.asarray(value, order="C") for name, value in record.arrays.items()}
    layout = [[name, array.dtype.str, array.shape] for name, array in arrays.items()]
    text = json.dumps([record.kind, record.values, layout]).encode()
    body = b"".join([struct.pack("<Q", len(text)), text, *(array.tobytes() for array in arrays.values())])
    numbers = struct.pack("<4sQI", _MARK, len(body), zlib.crc32(body))
    return numbers + struct.pack("<I", zlib.crc32(numbers)) + body


def unpacked(body: bytes) -> Record:
    """The inverse, of a record's content."""
    (length,) = struct.unpack_from("<Q", body)
    kind, values, layout = json.loads(body[8 : 8 + length])
    place, arrays = 8 + length, {}
    for name, dtype, shape in layout:
        array = np.frombuffer(body, dtype, int(np.prod(shape)), place).reshape(shape)
        arrays[name], place = array, place + array.nbytes
    return Record(kind, values, arrays, _HEAD.size + len(body))


def _read_head(data: bytes) -> tuple[int, int] | None:
    """Length and checksum of the content that follows, None where no record begins."""
    if len(data) < _HEAD.size:
        return None
    mark, length, checksum, own = _HEAD.unpack_from(data)
    return (length, checksum) if mark == _MARK and own == zlib.crc32(data[: _HEAD.size - 4]) else None


def read_records(path: Path) -> Iterator[tuple[int, Record]]:
    """Place and record of each, up to the end or to a torn one.

    Raises
    ------
    InputError
        It is damaged in its middle: whole records follow a spoilt one.
    """
    size = path.stat().st_size
    with path.open("rb") as file:
        place = 0
        while place < size:
            file.seek(place)
            head = _read_head(file.read(_HEAD.size))
            body = file.read(head[0]) if head is not None and head[0] <= size - place else b""
            if head is None or len(body) != head[0] or zlib.crc32(body) != head[1]:
                _check_torn(file, path, place)
                return
            yield place, unpacked(body)
            place += _HEAD.size + len(body)


def _check_torn(file: BinaryIO, path: Path, place: int) -> None:
    """Nothing whole follows what is spoilt at `place`: then it was the last and is torn."""
    file.seek(place + 1)
    rest = file.read()
    at = rest.find(_MARK)
    while at >= 0:
        head = _read_head(rest[at : at + _HEAD.size])
        if head is not None and zlib.crc32(rest[at + _HEAD.size :][: head[0]]) == head[1]:
            raise InputError(
                "the journal of an analysis is damaged",
                display(path),
                f"a spoilt record at byte {place}, whole ones after it",
                "records as they were written",
                "restore it from a copy, or run the case anew into another folder",
            )
        at = rest.find(_MARK, at + 1)


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
        self._states = [self.path.with_suffix(suffix) for suffix in (".state", ".state_safe")]
        self._descriptor = -1
        self._length = 0
        self._safe_at = 0.0
        self.token = ""

    def begin(self, layout: Record, first: Record) -> None:
        """Start anew with the layout and the first row; an earlier journal is replaced by both in one step."""
        self.token = uuid.uuid4().hex
        layout.values["token"] = self.token
        replace_bytes(self.path, packed(layout) + packed(first))
        self._open(self.path.stat().st_size)

    def go_on(self, size: int, token: str) -> None:
        """Write on after the first `size` bytes of what is there."""
        self.token = token
        self._open(size)

    def _open(self, size: int) -> None:
        with told(self.path):
            self._descriptor = os.open(self.path, os.O_WRONLY | os.O_CLOEXEC)
            os.ftruncate(self._descriptor, size)
            os.lseek(self._descriptor, size, os.SEEK_SET)
        self._length = size

    def append(self, record: Record) -> None:
        """Add a record; where the disk takes only a part of it, none of it stays."""
        data = packed(record)
        with told(self.path):
            try:
                write_all(self._descriptor, data)
            except OSError:
                with suppress(OSError):
                    os.ftruncate(self._descriptor, self._length)
                raise
        self._length += len(data)

    def keep_state(self, rows: int, arrays: Mapping[str, Any]) -> None:
        """Keep what the analysis goes on from after its rows so far."""
        data = packed(Record("state", {"rows": rows, "token": self.token}, dict(arrays)))
        replace_bytes(self._states[0], data, sync=False)
        now = time.monotonic()
        if now - self._safe_at > SAFE_EVERY:
            with told(self.path):
                os.fsync(self._descriptor)
            replace_bytes(self._states[1], data)
            self._safe_at = time.monotonic()

    def state(self, token: str, rows: int) -> tuple[int, dict[str, Any]] | None:
        """The newest state whose rows are all there: how many, and its arrays. None when none was kept.

        Raises
        ------
        InputError
            States are there but rows of all of them are missing.
        """
        found = []
        for path in self._states:
            with suppress(OSError, InputError, StopIteration):
                record = next(read_records(path))[1]
                if record.values["token"] == token:
                    found.append((int(record.values["rows"]), record.arrays))
        usable = [state for state in found if state[0] <= rows]
        if found and not usable:
            raise InputError(
                "rows of an analysis are missing",
                display(self.path),
                f"{rows} rows",
                f"{min(state[0] for state in found)} rows, as the analysis had when it was cut off",
                "restore it from a copy, or run the case anew into another folder",
            )
        return max(usable, key=lambda state: state[0], default=None)

    def close(self) -> None:
        """Leave the files for another process to go on."""
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1

    def remove(self) -> None:
        """All is in results.h5."""
        self.close()
        for path in (*self._states, self.path):
            path.unlink(missing_ok=True)


def journal_path(folder: Path, name: str) -> Path:
    """Where the rows of an analysis are until it is done."""
    return folder / f".{name}.rows"


def unfinished(folder: Path) -> dict[str, Path]:
    """Journals of a run folder by the name of their analysis."""
    return {path.name[1 : -len(".rows")]: path for path in sorted(folder.glob(".*.rows"))} if folder.is_dir() else {}
