"""The lock of a run folder where the file system knows no locks: signs of life, and processes of this host."""

from __future__ import annotations

import errno
import json
import os
import socket
import time
from pathlib import Path

import pytest

from fretwave.errors import InputError
from fretwave.files import lock
from fretwave.files.lock import FolderLock, check_free, is_taken

pytestmark = pytest.mark.ranks(1)


@pytest.fixture(params=[errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP], ids=["nolck", "nosys", "opnotsupp"])
def no_locks(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """As NFS without its lock daemon or Lustre without `-o flock`."""

    def refuse(*_: object) -> None:
        raise OSError(request.param, os.strerror(request.param))

    monkeypatch.setattr(lock.fcntl, "flock", refuse)


def left_by(folder: Path, pid: int) -> None:
    holder = {"host": socket.gethostname(), "pid": pid, "since": "2026-01-01 00:00:00"}
    (folder / ".lock").write_text(json.dumps(holder))


@pytest.mark.usefixtures("no_locks")
def test_a_second_run_on_this_host_is_refused(tmp_path: Path) -> None:
    """Both went on, and each wrote over the other's rows."""
    first = FolderLock(tmp_path)
    first.take()
    with pytest.raises(InputError, match="another run writes into this folder") as found:
        FolderLock(tmp_path).take()
    assert f"process {os.getpid()} on {socket.gethostname()}" in str(found.value)
    with pytest.raises(InputError, match="another run"):
        check_free(tmp_path)
    first.release()
    check_free(tmp_path)
    FolderLock(tmp_path).take()


@pytest.mark.usefixtures("no_locks")
def test_what_a_killed_run_left_keeps_nobody_out(tmp_path: Path) -> None:
    child = os.fork()
    if child == 0:
        os._exit(0)
    os.waitpid(child, 0)
    left_by(tmp_path, child)
    FolderLock(tmp_path).take()


@pytest.mark.usefixtures("no_locks")
def test_another_process_of_that_number_gives_no_signs_of_life(tmp_path: Path) -> None:
    left_by(tmp_path, os.getppid())
    assert is_taken(tmp_path)
    long_ago = time.time() - 3600
    os.utime(tmp_path / ".lock", (long_ago, long_ago))
    assert not is_taken(tmp_path)
    FolderLock(tmp_path).take()
