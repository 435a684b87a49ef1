"""Files that are there as a whole or not at all, and what went wrong with one in words.

A file is written beside its place, brought to the disk and renamed: a reader, a kill or a power failure meets the old
content or the new one. HDF5 files end in a seal, a checksum behind what HDF5 reads, so that no damage goes unseen.
"""

from __future__ import annotations

import errno
import os
import shutil
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from ..errors import FretwaveError, InputError
from ..texts import display, readable
from .streams import behind, is_stream, streamed

#: Errors of a disk that takes no more.
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
BLOCK = 1 << 22


class FileError(FretwaveError):
    """The disk, or a right on it, is missing; nothing is wrong with what the user gave."""


def file_error(error: OSError, path: str | Path | None = None) -> FileError:
    """The message of a file that cannot be written or read."""
    given = path if path is not None else error.filename
    place = Path(os.fsdecode(given)) if isinstance(given, (str, bytes, os.PathLike)) else None
    words = error.strerror or str(error)
    if error.errno not in FULL:
        what, fix = "a file cannot be written or read", "check that the folder can be written by you, and its disk"
        return FileError(what, display(place) if place else None, words, None, fix)
    free = ""
    with suppress(OSError):
        free = f", {shutil.disk_usage(place.parent if place else Path()).free / 1e6:.1f} MB are free"
    run = place is not None and (place.parent / "run.json").exists()
    told = f"; all before it is kept: then `fretwave resume {display(place.parent)}`" if place and run else ""
    where = display(place) if place else None
    return FileError("the disk takes no more", where, f"{words}{free}", None, f"make room (or raise the limit){told}")


@contextmanager
def told(path: Path) -> Iterator[None]:
    """Errors of the system get the name of the file they are about."""
    try:
        yield
    except BrokenPipeError:  # of what is printed
        raise
    except OSError as error:
        raise file_error(error, path) from None


def beside(path: Path, own: bool = False) -> Path:
    """Where a file is written before it takes its place; a name of its own where several processes may write it."""
    return path.with_name(f".{path.name}.{os.getpid()}.new" if own else f".{path.name}.new")


@contextmanager
def replaced(path: Path, own: bool = False, keep_suffix: bool = False, sync: bool = True) -> Iterator[Path]:
    """A name to write to; at the end of the block the file is brought to the disk and takes its place.

    That of the file behind it where the path is a link; a device, a pipe or `/dev/stdout` gets all of it in one go.

    Parameters
    ----------
    own : bool
        The name is this process' own: no lock keeps others from writing the file.
    keep_suffix : bool
        For libraries that go by the suffix of a file's name.
    sync : bool
        Without it a power failure may undo or spoil the file, a kill may not.

    Raises
    ------
    FileError
        The file cannot be written; the old one is untouched.
    """
    if is_stream(path):
        with told(path), streamed(path) as fresh:
            yield fresh
        return
    suffix, path = path.suffix, behind(path)
    fresh = beside(path, own)
    fresh = fresh.with_name(fresh.name + suffix) if keep_suffix else fresh
    if own:
        _forget_unfinished(path)
    with told(path):
        try:
            yield fresh
            take_place(fresh, path, sync)
        finally:
            with suppress(OSError):
                fresh.unlink()


def take_place(fresh: Path, path: Path, sync: bool = True) -> None:
    """A file that was written beside its place is brought to the disk and takes it; `sync` as of `replaced`."""
    if sync:
        bring_to_disk(fresh)
    os.replace(fresh, path)
    if sync:
        bring_to_disk(path.parent)


def _forget_unfinished(path: Path) -> None:
    """Remove what killed processes left beside a file."""
    for left in path.parent.glob(f".{path.name}.*.new*"):
        number = left.name[len(path.name) + 2 :].split(".")[0]
        if number.isdigit() and not Path(f"/proc/{number}").exists():
            left.unlink(missing_ok=True)


def replace_bytes(path: Path, data: bytes, sync: bool = True) -> None:
    """Write a file in one step; `sync` as of `replaced`.

    Raises
    ------
    FileError
    """
    with replaced(path, sync=sync) as fresh, fresh.open("wb", buffering=0) as file:
        write_all(file.fileno(), data)


def replace_text(path: Path, text: str) -> None:
    """Write a text in one step: a reader or a kill sees the old text or the new one."""
    replace_bytes(path, readable(text).encode("utf-8"))


def write_all(descriptor: int, data: bytes | memoryview, place: int | None = None) -> None:
    """Write all of it, at a place of the file: a signal or a nearly full disk may take a part only."""
    left, written = memoryview(data).cast("B"), 0
    while written < len(left):
        rest = left[written:]
        written += os.write(descriptor, rest) if place is None else os.pwrite(descriptor, rest, place + written)


def bring_to_disk(path: Path) -> None:
    """Wait until the content (of a folder: its names) is on the disk; some file systems know no such thing."""
    with suppress(PermissionError):
        descriptor = os.open(path, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        except OSError as error:
            if error.errno in (*FULL, errno.EIO):
                raise
        finally:
            os.close(descriptor)


# Seals

_SEAL = "\nfretwave seal {:08x} {:020d}\n"
#: Bytes of a seal.
SEAL_LENGTH = len(_SEAL.format(0, 0))
_HDF5 = b"\x89HDF\r\n\x1a\n"
#: Files found whole: (device, inode, size, time of change) by path.
_whole: dict[Path, tuple[int, ...]] = {}


def seal(path: Path) -> None:
    """Add a checksum of the content behind it; HDF5 does not read so far."""
    size = path.stat().st_size
    with path.open("ab", buffering=0) as file:
        write_all(file.fileno(), _SEAL.format(_checksum(path, size), size).encode())


def sealed_size(path: Path) -> int | None:
    """Bytes before the seal, None without one."""
    size = path.stat().st_size - SEAL_LENGTH
    if size < 0:
        return None
    with path.open("rb") as file:
        file.seek(size)
        words = file.read().split()
    return size if words[:2] == [b"fretwave", b"seal"] and words[-1] == b"%020d" % size else None


def check_whole(path: Path, what: str) -> None:
    """Refuse an HDF5 file whose content is not that which was sealed. One rank only.

    HDF5 can crash on a damaged file. One without a seal, of another program or changed by one, is therefore opened in
    a process of its own first.

    Raises
    ------
    InputError
        It is damaged.
    """
    with told(path):
        found = path.stat()
        mark = (found.st_dev, found.st_ino, found.st_size, found.st_mtime_ns)
        if _whole.get(path) == mark:
            return
        if not _is_hdf5(path):
            return  # HDF5 says so itself
        size = sealed_size(path)
        if size is not None:
            with path.open("rb") as file:
                file.seek(size)
                given = int(file.read().split()[2], 16)
            trouble = "" if _checksum(path, size) == given else "its checksum is not that of its content"
        else:
            trouble = _unsealed_trouble(path)
    if trouble:
        raise InputError(
            f"{what} is damaged",
            display(path),
            trouble,
            "a file as it was written",
            "restore it from a copy, or write it anew into another place",
        )
    _whole[path] = mark


def _is_hdf5(path: Path) -> bool:
    """Its mark stands at the beginning, or behind a user block of 512 bytes, 1024, ..."""
    with path.open("rb") as file:
        for place in (0, *(512 << k for k in range(20))):
            file.seek(place)
            if (mark := file.read(8)) == _HDF5 or not mark:
                return mark == _HDF5
    return False


def _checksum(path: Path, size: int) -> int:
    total = 0
    with path.open("rb") as file:
        while size > 0 and (block := file.read(min(BLOCK, size))):
            total, size = zlib.crc32(block, total), size - len(block)
    return total


def _unsealed_trouble(path: Path) -> str:
    """Why an HDF5 file without a seal cannot be read, "" when it can."""
    from .isolated import call_isolated

    try:
        end = call_isolated("fretwave.files.whole", "read_through", str(path))
    except InputError as error:
        return str(error.measured)
    rest = path.stat().st_size - int(end)
    return f"{rest} bytes stand behind its end and are no seal" if 0 < rest <= SEAL_LENGTH else ""


def read_through(path: str) -> int:
    """Read every dataset and attribute of an HDF5 file; gives where HDF5 says that it ends."""
    import h5py

    def read(_: str, item: h5py.Group | h5py.Dataset) -> None:
        dict(item.attrs)
        if isinstance(item, h5py.Dataset):
            step = max(1, BLOCK // max(1, item.dtype.itemsize * (item.size // max(1, len(item)) if item.shape else 1)))
            for start in range(0, len(item) if item.shape else 0, step):
                item[start : start + step]
            item[()] if not item.shape else None

    with h5py.File(path, "r") as file:
        dict(file.attrs)
        file.visititems(read)
        version = file.id.get_create_plist().get_version()[0]
    with open(path, "rb") as raw:
        head = raw.read(4096)
    at = head.find(_HDF5)
    place = at + (40 if version < 2 else 28)
    return at + int.from_bytes(head[place : place + 8], "little")


class Unfailing:
    """A file for h5py in which no write fails, for HDF5 may crash where one does; the first error is kept.

    ``with h5py.File(Unfailing(path), "w")``; afterwards `close` raises it, and `check` before anything is read.
    """

    def __init__(self, path: Path, mode: str = "w+b") -> None:
        self.path = path
        self.error: OSError | None = None
        with told(path):
            self._file: Any = path.open(mode, buffering=0)

    def write(self, data: bytes | memoryview) -> int:
        """All of it, as far as HDF5 can tell."""
        self._try(lambda: write_all(self._file.fileno(), data))
        return len(data)

    def truncate(self, size: int) -> int:
        """As `write`."""
        self._try(lambda: os.ftruncate(self._file.fileno(), size))
        return size

    def readinto(self, buffer: bytearray | memoryview) -> int:
        """After a failure HDF5 reads on in what it believes to have written."""
        count = self._file.readinto(buffer) or 0
        return len(buffer) if self.error is not None else count

    def read(self, size: int = -1) -> bytes:
        """As of any file: h5py knows one by it."""
        return bytes(self._file.read(size))

    def seek(self, offset: int, whence: int = 0) -> int:
        """As of any file."""
        return int(self._file.seek(offset, whence))

    def tell(self) -> int:
        """As of any file."""
        return int(self._file.tell())

    def flush(self) -> None:
        """Nothing waits in here."""

    def close(self) -> None:
        """Raises FileError where a write failed."""
        self._file.close()
        self.check()

    def check(self) -> None:
        """As `close`, of a file that stays open: what is read of it would be none of what was written."""
        if self.error is not None:
            raise file_error(self.error, self.path)

    def _try(self, work: Callable[[], object]) -> None:
        if self.error is None:
            try:
                work()
            except OSError as error:
                self.error = error
