"""Records of a journal: how they lie in a file, and what a torn or spoilt one is told by."""

from __future__ import annotations

import json
import math
import os
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from ..arrays import AnyArray
from ..errors import InputError
from ..files.whole import BLOCK, write_all
from ..mpi.spread import Spread
from ..texts import display

#: Before each record: a mark, the length of the content and its checksum, and the checksum of these.
_HEAD = struct.Struct("<4sQII")
_MARK = b"frw1"


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
