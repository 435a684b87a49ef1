"""Tables of an analysis: ``<name>.csv`` and a group of ``results.h5``, a row at a time, safe against kills.

Nothing of an earlier run is touched before the first row arrives: then the group is built in a new file that
replaces the old one in one step, and rows are added in place, flushed one by one. Files are written by rank
0 alone; methods marked Collective are called on every rank.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from inspect import signature
from pathlib import Path
from typing import Any

import numpy as np

from .columns import Column, Value, columns_named, csv_header, csv_line
from .errors import InputError
from .source import display
from .state import Slot, Slots, State, read_valid

#: Rows of one HDF5 chunk: a branch of usual length allocates no chunk while it grows.
CHUNK_ROWS = 256
CHUNK_BYTES = 1 << 20
#: Up to this size results.h5 is copied before a group is added, so that a kill cannot spoil the other groups.
COPY_BYTES = 1 << 28

Motion = Mapping[str, Mapping[str, Any]]


@dataclass(frozen=True)
class Field:
    """An array that every row of a table has."""

    shape: tuple[int, ...]
    unit: str
    long_name: str


class AnalysisWriter:
    """Writes the table of one analysis.

    Parameters
    ----------
    folder : Path
        The run folder.
    name : str
        Name of the analysis: ``<name>.csv`` and ``/<name>``.
    columns : sequence of str or Column
        Columns of the table.
    attributes : mapping
        Attributes of the group.
    dofs, labels : sequence of str
        Names along the axes of the coefficients; without `labels` there are none.
    active : bool
        True on the rank that writes.
    before_first : callable
        Called on every rank before the first row is written; may raise.
    file_attributes : mapping, optional
        Attributes of results.h5 itself.
    arrays : mapping, optional
        Arrays [m] of the group that are there from the first row on.
    fields : mapping, optional
        Arrays that every row brings.
    """

    def __init__(
        self,
        folder: Path,
        name: str,
        columns: Sequence[str | Column],
        attributes: Mapping[str, Any],
        dofs: Sequence[str] = (),
        labels: Sequence[str] = (),
        active: bool = True,
        before_first: Callable[[], None] = lambda: None,
        file_attributes: Mapping[str, Any] | None = None,
        arrays: Mapping[str, Any] | None = None,
        fields: Mapping[str, Field] | None = None,
    ) -> None:
        self.folder, self.name, self.active = folder, name, active
        self.columns = columns_named(columns)
        self.attributes = dict(attributes)
        self.rows = 0
        self.reported = 0
        self._sequence = 0
        self._dofs, self._labels = list(dofs), list(labels)
        self._before_first = before_first
        self._file_attributes, self._arrays = dict(file_attributes or {}), dict(arrays or {})
        self.fields = dict(fields or {})
        self._file: Any = None
        self._table: Any = None
        self._data: list[tuple[Column, Any]] = []
        self._coefficients: Any = None
        self._slots: Any = None

    @property
    def group(self) -> Any:
        """The open group (on the writing rank, after the first row)."""
        return self._file[self.name]

    def append(
        self,
        row: Mapping[str, Value],
        coefficients: Any = None,
        motions: Motion | None = None,
        state: State | None = None,
        fields: Mapping[str, Any] | None = None,
    ) -> None:
        """Add a row and flush it. Collective.

        Parameters
        ----------
        row : mapping
            One value per column.
        coefficients : (n_dof, m), optional
            Harmonic coefficients of the point.
        motions : mapping, optional
            Contact name -> u, v, f over one period, for points that are reported.
        state : mapping, optional
            Arrays from which the analysis can go on after this row.
        fields : mapping, optional
            The arrays of the row.
        """
        if self.rows == 0:
            self._before_first()
        if self.active:
            if self._file is None:
                self._create(row)
            else:
                self._table.write(csv_line(self.columns, row))
                self._table.flush()
            self._write_row(row, coefficients)
            for name in self.fields:
                _extend(self.group[name], self.rows, np.asarray((fields or {})[name], dtype=float))
            for contact, motion in (motions or {}).items():
                self._write_motion(contact, motion)
            if motions:
                _extend(self.group["reported"], self.reported, np.array(self.rows))
            self.reported += bool(motions)
        self.rows += 1
        if self.active:
            # Both slots exist before the file takes its place; later ones are written in place.
            for _ in range(0 if state is None else 2 if self.rows == 1 else 1):
                self._slots.write(Slot(self._sequence, self.rows, self.reported, dict(state or {})))
                self._sequence += 1
            self._file.flush()
            if self.rows == 1:
                self._publish()

    def dataset(self, name: str, values: Any, **attributes: Any) -> None:
        """Keep a further array (time histories, peaks) in the group, replacing one of the same name."""
        if not self.active:
            return
        if name in self.group:
            del self.group[name]
        self.group.create_dataset(name, data=values).attrs.update(attributes)
        self._file.flush()

    def close(self, status: str, reason: str, **attributes: Any) -> None:
        """End the table; `status` is ``done`` or ``stopped``. Without any row nothing is written."""
        if self._file is None:
            return
        self.group.attrs.update({**attributes, "status": status, "reason": reason})
        self.abandon()

    def abandon(self) -> None:
        """Close the files, leaving the analysis unfinished (after an error)."""
        if self._file is not None:
            self._data, self._coefficients, self._slots = [], None, None
            self._table.close()
            self._file.close()
            self._file = None
            for name in ("results.h5", f"{self.name}.csv"):
                _temporary(self.folder / name).unlink(missing_ok=True)

    # Creation: all structure is in place before the new files replace the old ones.

    def _create(self, row: Mapping[str, Value]) -> None:
        self.folder.mkdir(parents=True, exist_ok=True)
        self._file = _copy_without(self.folder / "results.h5", self.name)
        self._file.attrs.update(self._file_attributes)
        group = self._file.create_group(self.name)
        group.attrs.update({**self.attributes, "status": "running", "reason": ""})
        points = group.create_group("points")
        for column in self.columns:
            data = points.create_dataset(column.name, (0,), column.dtype, maxshape=(None,), chunks=(CHUNK_ROWS,))
            data.attrs.update({"units": column.unit, "long_name": column.long_name})
        points[self.columns[0].name].make_scale(self.columns[0].name)
        for column in self.columns[1:]:
            points[column.name].dims[0].attach_scale(points[self.columns[0].name])
        self._create_coefficients(group)
        for name, field in self.fields.items():
            data = group.create_dataset(name, (0, *field.shape), "f8", maxshape=(None, *field.shape))
            data.attrs.update({"units": field.unit, "long_name": field.long_name})
            data.dims[0].attach_scale(points[self.columns[0].name])
        for name, values in self._arrays.items():
            group.create_dataset(name, data=values).attrs["units"] = "m"
        group.create_dataset("reported", (0,), "i8", maxshape=(None,), chunks=(CHUNK_ROWS,))
        self._table = _temporary(self.folder / f"{self.name}.csv").open("w", encoding="utf-8")
        self._table.write(csv_header(self.columns) + csv_line(self.columns, row))
        self._table.flush()
        self._cache()

    def _create_coefficients(self, group: Any) -> None:
        if not self._labels:
            return
        shape = (len(self._dofs), len(self._labels))
        rows = max(1, min(CHUNK_ROWS, CHUNK_BYTES // (8 * shape[0] * shape[1])))
        data = group.create_dataset("coefficients", (0, *shape), "f8", maxshape=(None, *shape), chunks=(rows, *shape))
        data.attrs.update({"units": "m", "long_name": "harmonic coefficients of the displacement"})
        data.dims[0].attach_scale(group["points"][self.columns[0].name])
        for axis, (name, texts) in enumerate((("dof", self._dofs), ("harmonic", self._labels)), 1):
            group.create_dataset(name, data=np.array([text.encode() for text in texts]))
            group[name].make_scale(name)
            data.dims[axis].attach_scale(group[name])

    def _publish(self) -> None:
        """Put the new files in the place of the old ones."""
        for name in ("results.h5", f"{self.name}.csv"):
            fresh = _temporary(self.folder / name)
            if fresh.exists():
                os.replace(fresh, self.folder / name)

    # Rows

    def _write_row(self, row: Mapping[str, Value], coefficients: Any) -> None:
        """Through h5py's low-level calls, which take a fifth of the time of indexing."""
        from h5py import h5s

        here = h5s.create_simple((self.rows + 1,))
        here.select_hyperslab((self.rows,), (1,))
        one = h5s.create_simple((1,))
        for column, data in self._data:
            data.set_extent((self.rows + 1,))
            data.write(one, here, column.stored(row[column.name]).reshape(1))
        if coefficients is not None and self._labels:
            _extend(self._coefficients, self.rows, np.asarray(coefficients, dtype=float))

    def _cache(self) -> None:
        """Hold on to the datasets that every row writes to."""
        points = self.group["points"]
        self._data = [(column, points[column.name].id) for column in self.columns]
        self._coefficients = self.group.get("coefficients")
        self._slots = Slots(self.group)

    def _write_motion(self, contact: str, motion: Mapping[str, Any]) -> None:
        holder = self.group.require_group(f"contact_{contact}")
        units = {"u": "m", "v": "m/s", "f": "N"}
        long = {"u": "relative displacement", "v": "relative velocity", "f": "contact force"}
        for key in ("u", "v", "f"):
            values = np.asarray(motion[key], dtype=float)
            if key not in holder:
                data = holder.create_dataset(
                    key, (0, *values.shape), "f8", maxshape=(None, *values.shape), chunks=(1, *values.shape)
                )
                data.attrs.update({"units": units[key], "long_name": f"{long[key]} over one period"})
            _extend(holder[key], self.reported, values)

    # Resuming

    def go_on(self) -> dict[str, Any] | None:
        """Open the unfinished table of an earlier process, cut back to its last state (writing rank only).

        Returns
        -------
        dict or None
            The state's arrays; None when there is nothing to go on from.
        """
        path = self.folder / "results.h5"
        file = open_results(path, "r+") if path.exists() else None
        slot = self._usable(file[self.name]) if file is not None and self.name in file else None
        if file is None or slot is None:
            if file is not None:
                file.close()
            return None
        self._file, self.rows, self.reported = file, slot.rows, slot.reported
        self._sequence = slot.sequence + 1
        self._cut_back()
        self._rewrite_table()
        self._cache()
        return slot.arrays

    def _usable(self, group: Any) -> Slot | None:
        """The newest state whose rows are all in the file: HDF5 writes a state at once but rows when flushed."""
        tables = [group["points"][column.name] for column in self.columns]
        tables += [group[name] for name in ("coefficients", *self.fields) if name in group]
        reported = [group["reported"]]
        reported += [group[name][key] for name in group if name.startswith("contact_") for key in ("u", "v", "f")]
        rows, motions = min(map(len, tables)), min(map(len, reported))
        return next((slot for slot in read_valid(group) if slot.rows <= rows and slot.reported <= motions), None)

    def _cut_back(self) -> None:
        group = self.group
        for column in self.columns:
            group["points"][column.name].resize(self.rows, axis=0)
        for name in ("coefficients", *self.fields):
            if name in group:
                group[name].resize(self.rows, axis=0)
        group["reported"].resize(self.reported, axis=0)
        for name in [name for name in group if name.startswith("contact_")]:
            for key in ("u", "v", "f"):
                group[name][key].resize(self.reported, axis=0)
        self._file.flush()

    def _rewrite_table(self) -> None:
        """The CSV again from results.h5: its numbers are the same to the last digit."""
        path = self.folder / f"{self.name}.csv"
        stored = {column.name: self.group["points"][column.name][()] for column in self.columns}
        self._table = _temporary(path).open("w", encoding="utf-8")
        self._table.write(csv_header(self.columns))
        for row in range(self.rows):
            values = {column.name: column.loaded(stored[column.name][row]) for column in self.columns}
            self._table.write(csv_line(self.columns, values))
        self._table.flush()
        os.replace(_temporary(path), path)


def _temporary(path: Path) -> Path:
    return path.with_name(f".{path.name}.new")


def _extend(data: Any, row: int, values: Any) -> None:
    """Write row number `row`, growing the dataset to it."""
    if len(data) <= row:
        data.resize(row + 1, axis=0)
    data[row] = values


@contextmanager
def rewritten(path: Path, name: str) -> Iterator[Any]:
    """results.h5 to write to, without its group `name`; the new file takes the old one's place at the end."""
    file = _copy_without(path, name)
    try:
        yield file
        file.close()
        if _temporary(path).exists():
            os.replace(_temporary(path), path)
    finally:
        file.close()
        _temporary(path).unlink(missing_ok=True)


def _copy_without(path: Path, name: str) -> Any:
    """Open results.h5 for a new group `name`, as a copy without the old one (in place if large without it)."""
    import h5py

    if path.exists():
        large = path.stat().st_size > COPY_BYTES
        old = open_results(path, "r+" if large else "r")
        if large and name not in old:
            return old
        old.close()
        shutil.copyfile(path, _temporary(path))  # group by group would lose the dimension scales
        fresh = open_results(_temporary(path), "r+")
        if name in fresh:
            del fresh[name]
        return fresh
    return h5py.File(_temporary(path), "w")


def open_results(path: Path, mode: str = "r") -> Any:
    """Open a results.h5.

    Raises
    ------
    InputError
        It is missing, damaged or open in another process.
    """
    import h5py

    # A reader without a lock may look at a run that goes on.
    locking = {} if mode != "r" or "locking" not in signature(h5py.File.__init__).parameters else {"locking": False}
    try:
        return h5py.File(path, mode, **locking)
    except OSError as error:
        missing = not path.exists()
        raise InputError(
            "there are no results here" if missing else "results.h5 cannot be opened",
            where=display(path),
            measured=None if missing else " ".join(str(error).split()),
            expected="a results.h5 that no other process writes",
            fix="give the folder of a run" if missing else "end the process that has it open, or run the case anew",
        ) from None


def read_attributes(group: Any) -> dict[str, Any]:
    """Attributes of a group; JSON texts are decoded."""
    plain = {}
    for key, value in group.attrs.items():
        text = value.decode() if isinstance(value, bytes) else value
        plain[key] = json.loads(text) if key in ("events", "left_out", "case") else text
    return plain
