"""Whether a place that the command line names for results can be one."""

from __future__ import annotations

import os
from pathlib import Path
from tempfile import TemporaryFile

from ..errors import InputError
from ..texts import display, is_there
from .whole import told

LONGEST = 255  #: bytes of a name, in the file systems of Linux


def expect_writable(folder: Path) -> None:
    """Nothing is left there, or in the folder that it will be made in.

    Raises
    ------
    FileError
        Files cannot be made there.
    """
    there = next(parent for parent in (folder, *folder.absolute().parents) if is_there(parent))
    with told(there), TemporaryFile(dir=there):
        pass


def expect_place(path: Path, fix: str) -> None:
    """
    Raises
    ------
    InputError
        It lies in a file or behind a link that leads nowhere, or a name is longer than any file's can be.
    """
    for parent in path.parents:
        if os.path.islink(parent) and not is_there(parent):
            measured = f"{display(parent)} -> {os.readlink(parent)}"
            raise InputError("this link leads nowhere", "--out", measured, "a folder, or a name that is free", fix)
        if is_there(parent) and not parent.is_dir():
            raise InputError("this is a file, not a folder for results", "--out", display(parent), fix=fix)
    for name in path.parts:
        if len(os.fsencode(name)) > LONGEST:
            measured = f"{len(os.fsencode(name))} bytes: {name[:20]}..."
            raise InputError("this name is too long", "--out", measured, f"at most {LONGEST} bytes", fix)
