"""``fretwave init``: a small case with comments to begin with."""

from __future__ import annotations

from pathlib import Path

from ..errors import InputError
from ..files.whole import told
from ..texts import display, is_there

TEMPLATE = Path(__file__).parent / "template.toml"


def write_template(folder: Path) -> Path:
    """Write ``case.toml`` into a folder, which is made where it is not there. One rank only.

    Raises
    ------
    InputError
        There is such a file already, or the folder is a file.
    FileError
        It cannot be written.
    """
    path = folder / "case.toml"
    if is_there(folder) and not folder.is_dir():
        raise InputError("this is a file, not a folder", display(folder), fix="name a folder; it is made if need be")
    if is_there(path):
        raise _there(path)
    with told(path):
        folder.mkdir(parents=True, exist_ok=True)
        try:
            with path.open("x", encoding="utf-8") as file:
                file.write(TEMPLATE.read_text(encoding="utf-8"))
        except FileExistsError:  # since a moment ago
            raise _there(path) from None
    return path


def _there(path: Path) -> InputError:
    fix = "`fretwave init FOLDER` with another folder, or remove the file"
    return InputError("there is a case already", display(path), "a file", "no file of this name", fix)
