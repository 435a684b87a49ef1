"""One run at a time in a folder.

The lock is the kernel's (``flock`` on ``.lock``): it ends with its process, however that ends, so that no stale one is
left by a kill. Where a network file system keeps such locks to one host, or knows none, the file says who runs, and its
time is set anew every few seconds: a run that no lock tells of counts as alive as long as that goes on.
"""

from __future__ import annotations

import errno
import fcntl
import json
import os
import socket
import tempfile
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..texts import display
from .whole import told, write_all

LOCK = ".lock"
#: A run gives a sign of life this often, and counts as dead after so long without one [s].
BEAT, DEAD = 15.0, 60.0
#: flock says that another process has it.
TAKEN = (errno.EWOULDBLOCK, errno.EACCES)


class FolderLock:
    """Held from `take` until `release` or the end of the process.

    Parameters
    ----------
    folder : Path
        Must exist when the lock is taken.
    """

    def __init__(self, folder: Path) -> None:
        self.path = folder / LOCK
        self._descriptor = -1
        self._end = threading.Event()

    def take(self) -> None:
        """Take it and begin to give signs of life.

        Raises
        ------
        InputError
            Another run has the folder.
        """
        with told(self.path):
            descriptor = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
        try:
            locked = _seize(descriptor)
            if not _is_in_place(descriptor, self.path):  # its holder removed it just now
                os.close(descriptor)
                return self.take()
            _check_signs(self.path, _holder(descriptor), locked)
            with told(self.path):
                os.ftruncate(descriptor, 0)
                os.lseek(descriptor, 0, os.SEEK_SET)
                write_all(descriptor, json.dumps(_self()).encode())
        except BlockingIOError:
            holder = _holder(descriptor)
            os.close(descriptor)
            raise _in_use(self.path, holder) from None
        except BaseException:
            os.close(descriptor)
            raise
        self._descriptor = descriptor
        threading.Thread(target=self._beat, daemon=True).start()

    def _beat(self) -> None:
        while not self._end.wait(BEAT):
            with suppress(OSError):
                os.utime(self._descriptor)

    def release(self) -> None:
        """Let others in."""
        if self._descriptor < 0:
            return
        self._end.set()
        with suppress(OSError):
            self.path.unlink()
        os.close(self._descriptor)
        self._descriptor = -1


def check_free(folder: Path) -> None:
    """Refuse a folder that a run has, before anything is solved for it.

    Raises
    ------
    InputError
        Another run has the folder.
    """
    path = folder / LOCK
    try:
        descriptor = os.open(path, os.O_RDWR | os.O_CLOEXEC)
    except OSError:  # nobody has been here, or may write here: that is found when the run begins to write
        return
    try:
        locked = _seize(descriptor)
        _check_signs(path, _holder(descriptor), locked)
    except BlockingIOError:
        raise _in_use(path, _holder(descriptor)) from None
    finally:
        os.close(descriptor)


def is_taken(folder: Path) -> bool:
    """Whether a run goes on in a folder."""
    try:
        check_free(folder)
    except InputError:
        return True
    return False


def _is_in_place(descriptor: int, path: Path) -> bool:
    try:
        return os.fstat(descriptor).st_ino == path.stat().st_ino
    except FileNotFoundError:
        return False


def _seize(descriptor: int) -> bool:
    """Take the kernel's lock; False where the file system knows none, and the signs of life must do."""
    for tries in reversed(range(4)):  # one who only looks has it for an instant
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return True
        except OSError as error:
            if error.errno not in TAKEN:
                return False
            if not tries:
                raise BlockingIOError(error.errno, error.strerror) from None
            time.sleep(0.05)
    return False


def _self() -> dict[str, Any]:
    return {"host": socket.gethostname(), "pid": os.getpid(), "since": time.strftime("%Y-%m-%d %H:%M:%S")}


def _holder(descriptor: int) -> dict[str, Any]:
    """Who wrote the file, {} when nobody is left."""
    with suppress(OSError, ValueError):
        found = json.loads(os.pread(descriptor, 4096, 0))
        return found if isinstance(found, dict) else {}
    return {}


def _check_signs(path: Path, holder: dict[str, Any], locked: bool) -> None:
    """Of a run that the kernel's lock, if there is one, says nothing of."""
    here = holder.get("host") == socket.gethostname()
    if not holder or (here and (locked or not _goes_on(holder.get("pid")))):
        return
    with told(path), tempfile.TemporaryFile(dir=path.parent) as now:  # the time of the disk, not of this host
        silent = os.fstat(now.fileno()).st_mtime - path.stat().st_mtime
    if silent < DEAD:
        raise _in_use(path, holder, f"last sign of life {max(silent, 0.0):.0f} s ago; ")


def _goes_on(pid: object) -> bool:
    """Whether there is such a process on this host, of anybody."""
    try:
        os.kill(int(str(pid)), 0)
    except (ProcessLookupError, ValueError, OverflowError):
        return False
    except OSError:  # it is another user's
        return True
    return True


def _in_use(path: Path, holder: dict[str, Any], silent: str = "") -> InputError:
    who = f"process {holder['pid']} on {holder['host']}, since {holder['since']}" if len(holder) >= 3 else "a process"
    return InputError(
        "another run writes into this folder",
        display(path.parent),
        f"{silent}{who}",
        "a folder of its own for each run",
        "choose another one with --out, or wait for the other run to end",
    )
