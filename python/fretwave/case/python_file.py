"""Files of Python that a case names, builders and plug-ins: whether they are there, and where they fail."""

from __future__ import annotations

import traceback
from pathlib import Path

from ..errors import InputError
from ..texts import display, is_there, names_beside, nearest


def check_there(path: Path, what: str, where: str, expected: str) -> None:
    """The file is there.

    Raises
    ------
    InputError
        `what` says that it is not.
    """
    if path.suffix != ".py" or not is_there(path) or not path.is_file():
        files = names_beside(path, "*.py")
        near = nearest(path.name, files) or (f"there is {', '.join(files)}" if files else "check the path")
        raise InputError(what, where, display(path), expected, near)


def line_of(error: BaseException, path: Path) -> int | None:
    """Line of a file that raised an error or led to it, None where it did not."""
    if isinstance(error, SyntaxError):
        return error.lineno
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if Path(frame.filename) == path]
    return frames[-1].lineno if frames else None
