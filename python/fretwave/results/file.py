"""results.h5: written as a whole, sealed, and read together with the journals of analyses that are not done."""

from __future__ import annotations

import os
import shutil
import uuid
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import InputError
from ..files.dimensions import put_array
from ..files.streams import behind
from ..files.whole import Unfailing, beside, check_whole, seal, sealed_size, take_place, told
from ..kinds import of_their_kinds
from ..texts import display
from ..units import units_of
from .journal import unfinished
from .record import RECORD
from .rows import Rows, build_group

if TYPE_CHECKING:
    import h5py
    import numpy.typing as npt

#: Attribute of an analysis: what the command line changed of the case, as it was typed.
OVERRIDES = "command_line"
#: Attribute of an analysis of several branches: levels or nodal diameters that came to their end, as JSON.
ENDED = "ended"


class NewResults:
    """results.h5 as it will be, beside the present one and without its group `name`.

    Attributes
    ----------
    file : h5py.File
    """

    def __init__(self, path: Path, name: str) -> None:
        import h5py

        path = behind(path)
        self._path, self._fresh = path, beside(path)
        if path.exists():
            check_whole(path, "results.h5")
            with told(self._fresh):  # group by group would lose the dimension scales
                shutil.copyfile(path, self._fresh)
                size = sealed_size(path)
                if size is not None:
                    os.truncate(self._fresh, size)
        self._raw = Unfailing(self._fresh, "r+b" if path.exists() else "w+b")
        self.file: h5py.File = h5py.File(self._raw, "r+" if path.exists() else "w")
        if name in self.file:
            del self.file[name]

    def array(self, group: str, name: str, values: npt.ArrayLike, attributes: Mapping[str, Any]) -> None:
        """Put a further array into a group."""
        put_array(self.file[group], name, values, attributes)

    def check(self) -> None:
        """Before something of it is read.

        Raises
        ------
        FileError
            The disk has not taken what was written.
        """
        self.file.flush()
        self._raw.check()

    def publish(self) -> None:
        """Bring it to the disk and put it in the place of the present one.

        Raises
        ------
        FileError
            The disk does not take it; the present one stays.
        """
        try:
            self._close()
            with told(self._path):
                seal(self._fresh)
                take_place(self._fresh, self._path)
        finally:
            self.discard()

    def discard(self) -> None:
        """Leave the present one as it is."""
        with suppress(Exception):
            self._close()
        self._fresh.unlink(missing_ok=True)

    def _close(self) -> None:
        try:
            self.file.close()
        finally:
            self._raw.close()


@contextmanager
def rewritten(path: Path, name: str) -> Iterator[h5py.File]:
    """results.h5 to write to, without its group `name`; the new file takes the old one's place at the end."""
    new = NewResults(path, name)
    try:
        yield new.file
        new.publish()
    finally:
        new.discard()


class Results(Mapping[str, Any]):
    """The groups of results.h5 and those that are still in journals, to be read; close it or use ``with``.

    A journal's group is made when it is first asked for.
    """

    def __init__(self, path: Path, file: h5py.File | None, journals: Mapping[str, Rows]) -> None:
        self.path, self.file, self.journals = path, file, dict(journals)
        self._made: dict[str, h5py.File] = {}

    @property
    def attrs(self) -> Any:
        """Of results.h5, else of a journal."""
        if self.file is not None:
            return self.file.attrs
        return next(iter(self.journals.values())).layout.values["file_attributes"]

    def __getitem__(self, name: str) -> Any:
        first = name.strip("/").split("/")[0]
        if first in self.journals:
            with suppress(FileNotFoundError):  # completed just now: it is in results.h5
                return self._of_journal(first)[name]
            if self.file is not None:
                self.file.close()
            self.file = _open_file(self.path)
            del self.journals[first]
        if self.file is None:
            raise KeyError(name)
        return self.file[name]

    def __iter__(self) -> Iterator[str]:
        there = [] if self.file is None else [name for name in self.file if name not in self.journals]
        return iter([*there, *self.journals])

    def __len__(self) -> int:
        return len(list(iter(self)))

    def __contains__(self, name: object) -> bool:
        return name in self.journals or (self.file is not None and name in self.file)

    def __enter__(self) -> Results:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _of_journal(self, name: str) -> h5py.File:
        if name not in self._made:
            self._made[name] = _in_memory(name, self.journals[name])
        return self._made[name]

    def close(self) -> None:
        """Close all files."""
        for file in (self.file, *self._made.values()):
            if file is not None:
                file.close()


@of_their_kinds
def has_results(folder: str | Path) -> bool:
    """Whether there is anything for `open_results`."""
    folder = Path(folder)
    return (folder / "results.h5").exists() or bool(unfinished(folder))


def no_results(folder: Path) -> InputError:
    """Of a folder of no run, or of one that was ended before anything was solved, or a sweep in its midst."""
    if not (folder / RECORD).exists():
        return InputError("there are no results here", display(folder), fix="give the folder of a run")
    fix = f"`fretwave resume {display(folder)}` goes on with the run"
    return InputError("there are no results here yet", display(folder), fix=fix)


def unit_of_amplitudes(group: h5py.Group) -> str:
    """Of an analysis; that of its lengths where the results tell none."""
    of_lengths = units_of(group.attrs)("length")
    return str(group["points/amplitude"].attrs.get("units", of_lengths)) if "points/amplitude" in group else of_lengths


@of_their_kinds
def open_results(path: str | Path) -> Results:
    """The results of a run folder, those of unfinished analyses included, to be read.

    Parameters
    ----------
    path : the folder, or its results.h5

    Raises
    ------
    InputError
        There are none, or they are damaged.
    """
    path = Path(path)
    path = path if path.name == "results.h5" else path / "results.h5"
    for _ in range(9):
        with suppress(FileNotFoundError):  # of a journal whose analysis was completed just now
            return _open_all(path)
    return _open_all(path)


def _open_all(path: Path) -> Results:
    journals = {name: Rows.of(place) for name, place in unfinished(path.parent).items()}
    file = _open_file(path) if path.exists() or not journals else None
    return Results(path, file, {name: rows for name, rows in journals.items() if not _superseded(rows, file, name)})


def _superseded(rows: Rows, file: h5py.File | None, name: str) -> bool:
    """Killed between the writing of results.h5 and the removal of the journal: it is there already."""
    if file is None or name not in file:
        return False
    run = rows.layout.values["attributes"].get("run_id")
    there = file[name].attrs
    return run is not None and there.get("run_id") == run and there.get("status") in ("done", "stopped")


def _in_memory(name: str, rows: Rows) -> h5py.File:
    import h5py

    key = (name, rows.token, len(rows))
    if _images is not None and key in _images:
        return h5py.File(BytesIO(_images[key]), "r")
    file = h5py.File(uuid.uuid4().hex, "w", driver="core", backing_store=False)
    build_group(file, name, rows)
    if _images is not None:
        file.flush()
        _images[key] = file.id.get_file_image()
    return file


#: Groups made of journals, by analysis and what was in its journal; None where they are made for each reader.
_images: dict[tuple[str, str, int], bytes] | None = None


@contextmanager
def journals_made_once() -> Iterator[None]:
    """Within it `open_results` makes the group of an unfinished analysis once: for who opens them many times."""
    global _images
    _images = {}
    try:
        yield
    finally:
        _images = None


def _open_file(path: Path) -> h5py.File:
    import h5py

    if not path.exists():
        raise no_results(path.parent)
    if not path.is_file():
        raise InputError("results.h5 is no file", display(path), fix="give the folder of a run")
    check_whole(path, "results.h5")
    try:
        return h5py.File(path, "r")
    except OSError as error:
        measured = " ".join(str(error).split())
        fix = "restore it from a copy, or run the case anew into another folder"
        raise InputError("results.h5 cannot be opened", display(path), measured, None, fix) from None
