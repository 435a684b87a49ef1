"""results.h5: written as a whole, sealed, and read together with the journals of analyses that are not done."""

from __future__ import annotations

import os
import shutil
import uuid
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..columns import Column, Value
from ..errors import InputError
from ..files.dimensions import name_dimensions, put_array
from ..files.whole import Unfailing, beside, bring_to_disk, check_whole, seal, sealed_size, told
from ..post.contact_history import MOTION
from ..texts import display
from .field import Field
from .journal import Record, read_records, unfinished

if TYPE_CHECKING:
    import h5py
    import numpy.typing as npt

#: Rows of one HDF5 chunk: a branch of usual length allocates no chunk while it grows.
CHUNK_ROWS = 256
CHUNK_BYTES = 1 << 20


@dataclass
class Rows:
    """What a journal holds: its layout and where its rows and arrays are.

    Attributes
    ----------
    layout : Record
    places : list of (place in the file, place behind it, number of the row or -1 for an array)
    reported : list of int
        Rows with the contacts' motion.
    """

    path: Path
    layout: Record
    places: list[tuple[int, int, int]]
    reported: list[int]
    size: int

    @classmethod
    def of(cls, path: Path) -> Rows:
        """Read a journal through.

        Raises
        ------
        InputError
            It is damaged in its middle, or has not even its first row, which is there from its beginning.
        """
        layout: Record | None = None
        places: list[tuple[int, int, int]] = []
        reported, row = [], 0
        for place, record in read_records(path):
            if layout is None:
                layout = record
                continue
            is_row = record.kind == "row"
            places.append((place, place + record.length, row if is_row else -1))
            if is_row and any(name.startswith("motion/") for name in record.arrays):
                reported.append(row)
            row += is_row
        if layout is None or not row:
            size, fix = f"{path.stat().st_size} bytes", "restore it from a copy, or run the case anew"
            raise InputError("the journal of an analysis is damaged", display(path), size, "a row at least", fix)
        return cls(path, layout, places, reported, places[-1][1])

    def __len__(self) -> int:
        return sum(row >= 0 for _, _, row in self.places)

    @property
    def token(self) -> str:
        return str(self.layout.values["token"])

    @property
    def columns(self) -> list[Column]:
        return [Column(*given) for given in self.layout.values["columns"]]

    @property
    def fields(self) -> dict[str, Field]:
        return {name: Field.of(described) for name, described in self.layout.values["fields"].items()}

    def first(self, count: int) -> Rows:
        """Only so many rows, and the arrays before the next one."""
        end = next((k for k, (_, _, row) in enumerate(self.places) if row == count), len(self.places))
        places = self.places[:end]
        return replace(self, places=places, reported=[r for r in self.reported if r < count], size=places[-1][1])

    def records(self) -> Iterator[tuple[int, Record]]:
        """Number of the row, -1 for an array, and record of each."""
        ends = {place: row for place, _, row in self.places}
        for place, record in read_records(self.path):
            if place in ends:
                yield ends[place], record

    def values(self) -> Iterator[dict[str, Value]]:
        """Of each row, by column."""
        return (record.values for row, record in self.records() if row >= 0)


def attributes_of(given: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Attributes as plain values and as arrays."""
    plain, arrays = {}, {}
    for name, value in given.items():
        value = value.item() if isinstance(value, np.generic) else value
        if isinstance(value, (str, bool, int, float)):
            plain[name] = value
        else:
            array = np.asarray(value)
            arrays[name] = np.char.encode(array) if array.dtype.kind == "U" else array
    return plain, arrays


def build_group(file: h5py.File, name: str, rows: Rows) -> None:
    """Make the group of an analysis from its journal."""
    told_of, arrays = rows.layout.values, rows.layout.arrays
    file.attrs.update(told_of["file_attributes"])
    group = file.create_group(name)
    group.attrs.update(told_of["attributes"])
    group.attrs.update({key[len("attribute/") :]: a for key, a in arrays.items() if key.startswith("attribute/")})
    _create_points(group, rows)
    _create_coefficients(group, rows)
    for key, kept in rows.fields.items():
        _create_field(group, rows, key, kept)
    for key, values in arrays.items():
        if key.startswith("array/"):
            put_array(group, key[len("array/") :], values, {"units": "m"})
    _fill(group, rows)


def _growing(
    group: h5py.Group,
    name: str,
    rows: int,
    shape: tuple[int, ...],
    most: int,
    dtype: str = "f8",
    missing: float | None = None,
) -> h5py.Dataset:
    """A dataset (rows, *shape) that other programs may add to."""
    size = 8 * int(np.prod(shape, dtype=np.int64))
    chunk = (max(1, min(most, CHUNK_BYTES // max(size, 1))), *(max(1, n) for n in shape))
    return group.create_dataset(name, (rows, *shape), dtype, maxshape=(None, *shape), chunks=chunk, fillvalue=missing)


def _create_points(group: h5py.Group, rows: Rows) -> None:
    points, columns = group.create_group("points"), rows.columns
    table = list(rows.values())
    first = columns[0]
    scale = _growing(group, first.name, len(rows), (), CHUNK_ROWS, first.dtype)
    scale[...] = np.array([first.stored(row[first.name]) for row in table], first.dtype)
    scale.attrs.update({"units": first.unit, "long_name": first.long_name})
    scale.make_scale(first.name)
    for column in columns:
        data = _growing(points, column.name, len(rows), (), CHUNK_ROWS, column.dtype)
        data[...] = np.array([column.stored(row[column.name]) for row in table], column.dtype)
        data.attrs.update({"units": column.unit, "long_name": column.long_name})
        if column is not first:
            name_dimensions(points, data, [first.name])
    # a column of the dimension's name is its coordinate, and a scale
    points[first.name].make_scale(first.name)


def _create_coefficients(group: h5py.Group, rows: Rows) -> None:
    dofs, labels = rows.layout.values["dofs"], rows.layout.values["labels"]
    if not labels:
        return
    data = _growing(group, "coefficients", len(rows), (len(dofs), len(labels)), CHUNK_ROWS)
    data.attrs.update({"units": "m", "long_name": "harmonic coefficients of the displacement"})
    _name_axes(group, {"dof": dofs, "harmonic": labels})
    name_dimensions(group, data, [rows.columns[0].name, "dof", "harmonic"])


def _create_field(group: h5py.Group, rows: Rows, name: str, kept: Field) -> None:
    data = group.create_dataset(name, (len(rows), *kept.shape), "f8")
    data.attrs.update({"units": kept.unit, "long_name": kept.long_name, **kept.attributes})
    _name_axes(group, kept.axes)
    name_dimensions(group, data, [rows.columns[0].name, *kept.axes])


def _name_axes(group: h5py.Group, axes: Mapping[str, Sequence[str]]) -> None:
    """Coordinates of axes that have names."""
    from h5py import string_dtype

    for name, texts in axes.items():
        if name not in group:
            group.create_dataset(name, data=list(texts), dtype=string_dtype())


def _fill(group: h5py.Group, rows: Rows) -> None:
    """Arrays of the rows, one after the other."""
    group.create_dataset("reported", data=np.array(rows.reported, "i8"), maxshape=(None,), chunks=(CHUNK_ROWS,))
    group["reported"].make_scale("reported")
    for row, record in rows.records():
        if row < 0:
            put_array(group, record.values["name"], record.arrays["values"], record.values["attributes"])
            continue
        for name, values in record.arrays.items():
            if name.startswith("motion/"):
                _, contact, key = name.split("/")
                _put_motion(group, rows, contact, key, values, rows.reported.index(row))
            else:
                group[name.removeprefix("field/")][row] = values


def _put_motion(group: h5py.Group, rows: Rows, contact: str, key: str, values: npt.NDArray[Any], place: int) -> None:
    holder = group.require_group(f"contact_{contact}")
    if key not in holder:
        unit, long_name, dtype, missing = MOTION[key]
        data = _growing(holder, key, len(rows.reported), values.shape, 1, dtype, missing)
        data.attrs.update({"units": unit, "long_name": long_name})
        axes = ["reported", "sample", "component", "pair"] if values.ndim == 3 else ["reported", "sample", "pair"]
        name_dimensions(holder, data, axes)
    holder[key][place] = values


class NewResults:
    """results.h5 as it will be, beside the present one and without its group `name`.

    Attributes
    ----------
    file : h5py.File
    """

    def __init__(self, path: Path, name: str) -> None:
        import h5py

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
                bring_to_disk(self._fresh)
                os.replace(self._fresh, self._path)
                bring_to_disk(self._path.parent)
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
    """The groups of results.h5 and those that are still in journals, to be read; close it or use ``with``."""

    def __init__(self, file: h5py.File | None, journals: Mapping[str, h5py.File]) -> None:
        self.file, self.journals = file, dict(journals)

    @property
    def attrs(self) -> Any:
        """Of results.h5, else of a journal."""
        return self.file.attrs if self.file is not None else next(iter(self.journals.values())).attrs

    def __getitem__(self, name: str) -> Any:
        first = name.strip("/").split("/")[0]
        if first in self.journals:
            return self.journals[first][name]
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

    def close(self) -> None:
        """Close all files."""
        for file in (self.file, *self.journals.values()):
            if file is not None:
                file.close()


def has_results(folder: Path) -> bool:
    """Whether there is anything for `open_results`."""
    return (folder / "results.h5").exists() or bool(unfinished(folder))


def open_results(path: Path) -> Results:
    """The results of a run folder, those of unfinished analyses included, to be read.

    Raises
    ------
    InputError
        There are none, or they are damaged.
    """
    for _ in range(9):
        with suppress(FileNotFoundError):  # of a journal whose analysis was completed just now
            return _open_all(path)
    return _open_all(path)


def _open_all(path: Path) -> Results:
    journals = {name: Rows.of(place) for name, place in unfinished(path.parent).items()}
    found = Results(_open_file(path) if path.exists() or not journals else None, {})
    try:
        for name, rows in journals.items():
            if not _superseded(rows, found.file, name):
                found.journals[name] = _in_memory(name, rows)
    except BaseException:
        found.close()
        raise
    return found


def _superseded(rows: Rows, file: h5py.File | None, name: str) -> bool:
    """Killed between the writing of results.h5 and the removal of the journal: it is there already."""
    if file is None or name not in file:
        return False
    run = rows.layout.values["attributes"].get("run_id")
    there = file[name].attrs
    return run is not None and there.get("run_id") == run and there.get("status") in ("done", "stopped")


def _in_memory(name: str, rows: Rows) -> h5py.File:
    import h5py

    file = h5py.File(uuid.uuid4().hex, "w", driver="core", backing_store=False)
    build_group(file, name, rows)
    return file


def _open_file(path: Path) -> h5py.File:
    import h5py

    if not path.exists():
        raise InputError("there are no results here", display(path), fix="give the folder of a run")
    if not path.is_file():
        raise InputError("results.h5 is no file", display(path), fix="give the folder of a run")
    check_whole(path, "results.h5")
    try:
        return h5py.File(path, "r")
    except OSError as error:
        measured = " ".join(str(error).split())
        fix = "restore it from a copy, or run the case anew into another folder"
        raise InputError("results.h5 cannot be opened", display(path), measured, None, fix) from None
