"""The journal of an analysis that goes on: every row at once, in order, each with its checksum.

A row goes to the end of one file, its head last, so that nothing can spoil those before it: a kill, a full disk or a
power failure leaves whole rows and perhaps a torn one, which is cut off. results.h5 is made from the journal when the
analysis is complete (`results`); until then readers see the journal in its place. One rank writes; arrays that lie in
parts on the ranks pass through it a piece at a time (`mpi.spread`), and long ones are read so.

::

    .<name>.rows          records: how the table is laid out; then rows, with their arrays; and further arrays
    .<name>.state         what the analysis goes on from after its last row, or the one before it
    .<name>.state_other   the same: each is written over in turn, so that one of them is always whole
    .<name>.state_safe    the same of some seconds ago, known to be on the disk with all its rows
"""

from __future__ import annotations

import json
import math
import os
import shutil
import struct
import time
import uuid
import zlib
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from ..arrays import AnyArray
from ..errors import InputError
from ..files.whole import BLOCK, replaced, told, write_all
from ..mpi.spread import Spread
from ..texts import display

#: Before each record: a mark, the length of the content and its checksum, and the checksum of these.
_HEAD = struct.Struct("<4sQII")
_MARK = b"frw1"
#: A state and its rows are brought to the disk this often [s]: a power failure costs no more.
SAFE_EVERY = 3.0


@dataclass
class Record:
    """One entry: kind, plain values, arrays (also `Spread`, and as read `Stored`), and its bytes in the file."""

    kind: str
    values: dict[str, Any] = field(default_factory=dict)
    arrays: dict[str, Any] = field(default_factory=dict)
    length: int = 0


class _Kept:
    """A file that stays open as long as anything of it may be read, whatever takes its place."""

    def __init__(self, file: BinaryIO) -> None:
        self._descriptor = os.dup(file.fileno())

    def read(self, count: int, place: int) -> bytes:
        blocks = []
        while count and (block := os.pread(self._descriptor, min(count, BLOCK), place)):
            blocks.append(block)
            count, place = count - len(block), place + len(block)
        return b"".join(blocks)

    def __del__(self) -> None:
        os.close(self._descriptor)


@dataclass
class Stored:
    """An array in a file, its rows read when they are asked for (`stored[a:b]`), all by `np.asarray`."""

    file: _Kept
    place: int
    dtype: np.dtype[Any]
    shape: tuple[int, ...]

    @property
    def ndim(self) -> int:
        return len(self.shape)

    @property
    def nbytes(self) -> int:
        return self.dtype.itemsize * math.prod(self.shape)

    def __getitem__(self, rows: slice) -> AnyArray:
        first, last, _ = rows.indices(self.shape[0])
        row = self.nbytes // self.shape[0]
        data = self.file.read((last - first) * row, self.place + first * row)
        return np.frombuffer(data, self.dtype).reshape(last - first, *self.shape[1:])

    def __array__(self, dtype: npt.DTypeLike = None, copy: bool | None = None) -> AnyArray:
        return self[:].astype(dtype or self.dtype, copy=False)


def _content(record: Record) -> Iterator[bytes | memoryview]:
    """What follows the head, a piece at a time."""
    arrays = {name: v if isinstance(v, Spread) else np.asarray(v, order="C") for name, v in record.arrays.items()}
    arrays = dict(sorted(arrays.items(), key=lambda entry: isinstance(entry[1], Spread)))
    layout = [[name, a.dtype.str, a.shape] for name, a in arrays.items()]
    text = json.dumps([record.kind, record.values, layout]).encode()
    plain = [a.tobytes() for a in arrays.values() if not isinstance(a, Spread)]
    yield b"".join([struct.pack("<Q", len(text)), text, *plain])
    for array in arrays.values():
        if isinstance(array, Spread):
            left = math.prod(array.shape)
            for piece in array.pieces():
                left -= len(piece)
                yield piece.data
            if left:
                raise RuntimeError(f"{left} entries of an array did not arrive")


def write_record(descriptor: int, place: int, record: Record) -> int:
    """Write a record at a place of a file, its head last; gives the place behind it."""
    length = checksum = 0
    for piece in _content(record):
        write_all(descriptor, piece, place + _HEAD.size + length)
        length, checksum = length + memoryview(piece).nbytes, zlib.crc32(piece, checksum)
    numbers = struct.pack("<4sQI", _MARK, length, checksum)
    write_all(descriptor, numbers + struct.pack("<I", zlib.crc32(numbers)), place)
    return place + _HEAD.size + length


def _read_record(file: BinaryIO, kept: _Kept, length: int, checksum: int) -> Record | None:
    """The record whose content comes next; arrays longer than a block are left there. None where it is spoilt."""
    place = file.tell()
    source: BinaryIO = BytesIO(file.read(length)) if length <= BLOCK else file
    if _checksum(source, length) != checksum:
        return None
    at = 0 if source is not file else place
    source.seek(at)
    (text,) = struct.unpack("<Q", source.read(8))
    kind, values, layout = json.loads(source.read(text))
    at += 8 + text
    arrays: dict[str, Any] = {}
    for name, dtype, shape in layout:
        stored = Stored(kept, at, np.dtype(dtype), tuple(shape))
        at += stored.nbytes
        if stored.nbytes > BLOCK:
            arrays[name] = stored
            source.seek(at)
        else:
            arrays[name] = np.frombuffer(source.read(stored.nbytes), dtype).reshape(shape)
    return Record(kind, values, arrays, _HEAD.size + length)


def _checksum(file: BinaryIO, length: int) -> int | None:
    """Of the next bytes; None where there are fewer."""
    total = 0
    while length and (block := file.read(min(BLOCK, length))):
        total, length = zlib.crc32(block, total), length - len(block)
    return None if length else total


def _read_head(data: bytes) -> tuple[int, int] | None:
    """Length and checksum of the content that follows, None where no record begins."""
    if len(data) < _HEAD.size:
        return None
    mark, length, checksum, own = _HEAD.unpack_from(data)
    return (length, checksum) if mark == _MARK and own == zlib.crc32(data[: _HEAD.size - 4]) else None


def _record_at(file: BinaryIO, kept: _Kept, place: int, size: int) -> Record | None:
    """Of a file as it was when it had `size` bytes; None where no whole record begins."""
    file.seek(place)
    head = _read_head(file.read(_HEAD.size))
    return _read_record(file, kept, *head) if head is not None and head[0] <= size - place else None


def first_record(path: Path) -> Record | None:
    """The record that a file begins with; None where it is spoilt."""
    with path.open("rb") as file:
        return _record_at(file, _Kept(file), 0, path.stat().st_size)


def read_records(path: Path) -> Iterator[tuple[int, Record]]:
    """Place and record of each, up to the end or to a torn one.

    Raises
    ------
    InputError
        It is damaged in its middle: whole records follow a spoilt one.
    """
    size = path.stat().st_size
    with path.open("rb") as file:
        kept, place = _Kept(file), 0
        while place < size:
            record = _record_at(file, kept, place, size)
            if record is None:
                _check_torn(file, path, place, size)
                return
            yield place, record
            place += record.length


def _check_torn(file: BinaryIO, path: Path, place: int, size: int) -> None:
    """Nothing whole follows what is spoilt at `place`: then it was the last and is torn.

    Of the file as it was when it had `size` bytes: beside a writer it may be the last no more.
    """
    file.seek(place + 1)
    rest = file.read(size - place - 1)
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
