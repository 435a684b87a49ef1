"""A journal as a group of results.h5: what it holds, and the datasets made of it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..columns import Column, Value
from ..errors import InputError
from ..files.dimensions import name_dimensions, put_array
from ..post.contact_history import AXES, MOTION
from ..texts import display
from ..units import UnitSystem, units_of
from .field import Field
from .journal_records import Record, Stored, read_records

if TYPE_CHECKING:
    import h5py
    import numpy.typing as npt

#: Rows of one HDF5 chunk: a branch of usual length allocates no chunk while it grows.
CHUNK_ROWS = 256
CHUNK_BYTES = 1 << 20
#: Of rows that wait to be written together.
BATCH_BYTES = 1 << 24


#: Of a row whose coefficients are more than those of the first ones: entry of its record.
LABELS = "labels of its coefficients"


@dataclass
class Rows:
    """What a journal holds: its layout and where its rows and arrays are.

    Attributes
    ----------
    layout : Record
    places : list of (place in the file, place behind it, number of the row or -1 for an array)
    values : list of dict
        Of each row, by column.
    reported : list of int
        Rows with the contacts' motion.
    """

    path: Path
    layout: Record
    places: list[tuple[int, int, int]]
    values: list[dict[str, Value]]
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
        values: list[dict[str, Value]] = []
        reported: list[int] = []
        for place, record in read_records(path):
            if layout is None:
                layout = record
                continue
            is_row = record.kind == "row"
            places.append((place, place + record.length, len(values) if is_row else -1))
            if is_row and any(name.startswith("motion/") for name in record.arrays):
                reported.append(len(values))
            if is_row:
                values.append(record.values)
        if layout is None or not values:
            size, fix = f"{path.stat().st_size} bytes", "restore it from a copy, or run the case anew"
            raise InputError("the journal of an analysis is damaged", display(path), size, "a row at least", fix)
        return cls(path, layout, places, values, reported, places[-1][1])

    def __len__(self) -> int:
        return len(self.values)

    @property
    def token(self) -> str:
        return str(self.layout.values["token"])

    @property
    def units(self) -> UnitSystem:
        """The system that its numbers are in; the units that it keeps are of quantities."""
        return units_of(self.layout.values["attributes"])

    @property
    def columns(self) -> list[Column]:
        return [Column(*given).in_units(self.units) for given in self.layout.values["columns"]]

    @property
    def fields(self) -> dict[str, Field]:
        return {name: Field.of(described) for name, described in self.layout.values["fields"].items()}

    def first(self, count: int) -> Rows:
        """Only so many rows, and the arrays before the next one."""
        end = next((k for k, (_, _, row) in enumerate(self.places) if row == count), len(self.places))
        places, reported = self.places[:end], [r for r in self.reported if r < count]
        return replace(self, places=places, values=self.values[:count], reported=reported, size=places[-1][1])

    def records(self) -> Iterator[tuple[int, Record]]:
        """Number of the row, -1 for an array, and record of each."""
        ends = {place: row for place, _, row in self.places}
        for place, record in read_records(self.path):
            if place in ends:
                yield ends[place], record


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
            put_array(group, key[len("array/") :], values, {"units": rows.units("length")})
    _fill(group, rows)


def in_units(attributes: Mapping[str, Any], units: UnitSystem) -> dict[str, Any]:
    """Attributes of an array, its unit in symbols of a system."""
    return {key: units(value) if key == "units" else value for key, value in attributes.items()}


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
    if size > BATCH_BYTES:  # HDF5 has none of more than 4 GB
        chunk = (1, max(1, BATCH_BYTES * shape[0] // size), *chunk[2:])
    return group.create_dataset(name, (rows, *shape), dtype, maxshape=(None, *shape), chunks=chunk, fillvalue=missing)


def _create_points(group: h5py.Group, rows: Rows) -> None:
    points, columns, table = group.create_group("points"), rows.columns, rows.values
    first = columns[0]
    scale = _growing(group, first.name, len(rows), (), CHUNK_ROWS, first.dtype)
    scale[...] = np.array([first.stored(row[first.name]) for row in table], first.dtype)
    scale.attrs.update(first.attributes)
    scale.make_scale(first.name)
    for column in columns:
        data = _growing(points, column.name, len(rows), (), CHUNK_ROWS, column.dtype)
        data[...] = np.array([column.stored(row[column.name]) for row in table], column.dtype)
        data.attrs.update(column.attributes)
        if column is not first:
            name_dimensions(points, data, [first.name])
    # a column of the dimension's name is its coordinate, and a scale
    points[first.name].make_scale(first.name)


def _create_coefficients(group: h5py.Group, rows: Rows) -> None:
    dofs, labels = rows.layout.values["dofs"], rows.layout.values["labels"]
    if not labels:
        return
    labels = max([labels, *(row[LABELS] for row in rows.values if LABELS in row)], key=len)
    data = _growing(group, "coefficients", len(rows), (len(dofs), len(labels)), CHUNK_ROWS)
    data.attrs.update({"units": rows.units("length"), "long_name": "harmonic coefficients of the displacement"})
    _name_axes(group, {"dof": dofs, "harmonic": labels})
    name_dimensions(group, data, [rows.columns[0].name, "dof", "harmonic"])


def _create_field(group: h5py.Group, rows: Rows, name: str, kept: Field) -> None:
    data = group.create_dataset(name, (len(rows), *kept.shape), "f8")
    data.attrs.update(in_units({"units": kept.unit, "long_name": kept.long_name, **kept.attributes}, rows.units))
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
    batches = _Batches(group)
    for row, record in rows.records():
        if row < 0:
            attributes = in_units(record.values["attributes"], rows.units)
            put_array(group, record.values["name"], record.arrays["values"], attributes)
            continue
        for name, values in record.arrays.items():
            if name.startswith("motion/"):
                _, contact, key = name.split("/")
                _put_motion(group, rows, contact, key, values, rows.reported.index(row))
            else:
                batches.put(name.removeprefix("field/"), row, values)
    batches.write()


class _Batches:
    """Rows of datasets, written many at a time: h5py takes 0.2 ms for each, however short."""

    def __init__(self, group: h5py.Group) -> None:
        self._group = group
        self._waiting: dict[str, tuple[int, list[npt.NDArray[Any]]]] = {}
        self._bytes = 0

    def put(self, name: str, row: int, values: npt.NDArray[Any] | Stored) -> None:
        """A row of a dataset, whose values may be fewer along the last axis than others' are."""
        if isinstance(values, Stored):
            return self._copy(self._group[name], row, values)
        first, rows = self._waiting.get(name, (row, []))
        if rows and (row != first + len(rows) or values.shape != rows[0].shape):
            self._write(name, first, rows)
            first, rows = row, []
        rows.append(values)
        self._waiting[name] = first, rows
        self._bytes += values.nbytes
        if self._bytes > BATCH_BYTES:
            self.write()

    def write(self) -> None:
        """All that waits."""
        for name, (first, rows) in self._waiting.items():
            self._write(name, first, rows)
        self._waiting, self._bytes = {}, 0

    @staticmethod
    def _copy(data: h5py.Dataset, row: int, values: Stored) -> None:
        """A long row, not as a whole."""
        step = max(1, BATCH_BYTES * values.shape[0] // values.nbytes)
        for start in range(0, values.shape[0], step):
            part = values[start : start + step]
            data[(row, slice(start, start + len(part)), *(slice(n) for n in part.shape[1:]))] = part

    def _write(self, name: str, first: int, rows: list[npt.NDArray[Any]]) -> None:
        own = tuple(slice(n) for n in rows[0].shape)
        self._group[name][(slice(first, first + len(rows)), *own)] = np.stack(rows)


def _put_motion(group: h5py.Group, rows: Rows, contact: str, key: str, values: npt.NDArray[Any], place: int) -> None:
    holder = group.require_group(f"contact_{contact}")
    if key not in holder:
        unit, long_name, dtype, missing = MOTION[key]
        data = _growing(holder, key, len(rows.reported), values.shape, 1, dtype, missing)
        data.attrs.update({"units": rows.units(unit), "long_name": long_name})
        name_dimensions(holder, data, ["reported", *AXES[key]])
    holder[key][place] = values
