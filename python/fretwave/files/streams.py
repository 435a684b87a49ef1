"""Places that are no files of a folder: devices, pipes, what a shell has opened, and links."""

from __future__ import annotations

import os
import re
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory

from ..errors import InputError
from ..texts import display


def is_stream(path: Path) -> bool:
    """A device or a pipe, or what a shell has opened (`/dev/stdout`): no file is to take its place."""
    if _descriptor(path) is not None:
        return True
    with suppress(OSError):
        mode = path.stat().st_mode
        return not (stat.S_ISREG(mode) or stat.S_ISDIR(mode))
    return False


def _descriptor(path: Path) -> int | None:
    """N of /dev/fd/N and of links that lead there: a file behind it may have other content already."""
    own = re.compile(rf"/proc/{os.getpid()}(/task/[0-9]+)?/fd")
    for _ in range(40):  # links of links, as many as Linux follows
        if path.name.isdigit() and own.fullmatch(os.path.realpath(path.parent)):
            return int(path.name)
        if not path.is_symlink():
            break
        path = path.parent / os.readlink(path)
    return None


def refuse_stream(path: Path) -> None:
    """Of files whose parts are written in any order.

    Raises
    ------
    InputError
        The path is a device or a pipe.
    """
    if is_stream(path):
        expected, fix = "a file, whose parts are written in any order", "choose another place with --out"
        raise InputError("the file cannot be written", display(path), "a device or a pipe", expected, fix)


def behind(path: Path) -> Path:
    """The file that links lead to, which is replaced in the place of the link."""
    return Path(os.path.realpath(path)) if path.is_symlink() else path


@contextmanager
def streamed(path: Path) -> Iterator[Path]:
    """A name to write to; at the end of the block all of it is written to the device, pipe or descriptor."""
    number = _descriptor(path)
    with TemporaryDirectory() as folder:
        fresh = Path(folder) / path.name
        yield fresh
        with open(path if number is None else number, "wb", closefd=number is None) as out:
            out.write(fresh.read_bytes())
