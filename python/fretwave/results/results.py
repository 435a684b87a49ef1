"""Tables of an analysis: ``<name>.csv`` and a group of ``results.h5``, a row at a time, safe against kills.

Rows go to the analysis' journal and its CSV, one by one. When the analysis is complete, with all its further tables,
results.h5 is written anew with its group and takes the old one's place in one step; `open_results` shows what is still
in a journal as if it were there already. Nothing of an earlier run is touched before the first row arrives. Files are
written by rank 0 alone; methods marked Collective are called on every rank.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..columns import Column, Value, check_names, columns_named
from ..errors import InputError
from ..files.csv_table import header_line, row_line
from ..files.whole import replace_bytes, told, write_all
from ..mpi.spread import Spread, send_parts
from ..post.contact_history import MOTION
from ..units import units_of
from .field import Field
from .file import NewResults, has_results, open_results, rewritten
from .journal import Journal, journal_path
from .journal_records import Record
from .rows import LABELS, Rows, attributes_of, build_group, in_units

if TYPE_CHECKING:
    import h5py
    import numpy.typing as npt

Motion = Mapping[str, Mapping[str, Any]]
State = Mapping[str, Any]


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
        Attributes of the group; `unit_system` says which symbols the units of columns, fields and arrays are written
        in, SI without it.
    dofs, labels : sequence of str
        Names along the axes of the coefficients; without `labels` there are none.
    active : bool
        True on the rank that writes.
    before_first : callable
        Called on every rank before the first row is written; may raise.
    file_attributes : mapping, optional
        Attributes of results.h5 itself.
    arrays : mapping, optional
        Arrays [length] of the group that are there from the first row on.
    fields : mapping, optional
        Arrays that every row brings.
    publish_later : bool
        `close` leaves it to `publish` to write results.h5: tables that belong to the analysis are still to come.
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
        publish_later: bool = False,
    ) -> None:
        self.folder, self.name, self.active = folder, name, active
        self.attributes, self.units = dict(attributes), units_of(attributes)
        self.columns = columns_named(columns, self.units)
        check_names(self.columns, f"analysis '{name}'")
        self.rows = 0
        self.reported = 0
        self.publish_later = publish_later
        self.fields = dict(fields or {})
        self._dofs, self._labels = list(dofs), list(labels)
        self._before_first = before_first
        self._file_attributes, self._arrays = dict(file_attributes or {}), dict(arrays or {})
        self._journal = Journal(folder, name)
        self._table = -1
        self._ending: dict[str, Any] | None = None
        self.closed = False  #: its end has been told, on the writing rank
        self._new: NewResults | None = None

    @property
    def group(self) -> h5py.Group:
        """The group of the new results.h5 as it will be (on the writing rank, after the last row).

        Raises
        ------
        FileError
            The disk does not take it, and nothing can be read of it.
        """
        if self._new is None:
            self._new = NewResults(self.folder / "results.h5", self.name)
            build_group(self._new.file, self.name, Rows.of(journal_path(self.folder, self.name)))
        try:
            self._new.check()
        except BaseException:  # a file of h5py on one of Python's may not be left open at the end of the process
            self._discard()
            raise
        return self._new.file[self.name]

    def keep(self, fields: Mapping[str, Field]) -> None:
        """Let every row bring these arrays too; a table that was begun keeps what it was begun with."""
        if not self.rows:
            self.fields.update(fields)

    def append(
        self,
        row: Mapping[str, Value],
        coefficients: npt.ArrayLike | Spread | None = None,
        motions: Motion | None = None,
        state: State | None = None,
        fields: Mapping[str, Any] | None = None,
        labels: Sequence[str] = (),
    ) -> None:
        """Add a row; it is there when this returns. Collective.

        Parameters
        ----------
        row : mapping
            One value per column.
        coefficients : (n_dof, m), optional
            Harmonic coefficients of the point, on the writing rank or spread over all.
        motions : mapping, optional
            Contact name -> u, v, f over one period, for points that are reported.
        state : mapping, optional
            Arrays from which the analysis can go on after this row, of those that are spread each rank's part.
        fields : mapping, optional
            The arrays of the row.
        labels : sequence of str, optional
            Of its coefficients where they are others than the table's; one begins with the other.

        Raises
        ------
        FileError
            On the writing rank: the disk does not take it. What was there before stays.
        """
        if self.rows == 0:
            self._before_first()
        spread = isinstance(coefficients, Spread) and bool(self._labels)
        if self.active:
            self._write(self._record(row, coefficients, motions, fields, labels), row_line(self.columns, row))
        elif spread:
            send_parts({"coefficients": coefficients})
        self.rows += 1
        self.reported += bool(motions)
        if state is not None:
            self._journal.keep_state(self.rows, state) if self.active else send_parts(state)

    def _record(
        self,
        row: Mapping[str, Value],
        coefficients: npt.ArrayLike | Spread | None,
        motions: Motion | None,
        fields: Mapping[str, Any] | None,
        labels: Sequence[str],
    ) -> Record:
        values: dict[str, Any] = {
            column.name: column.loaded(column.stored(row[column.name])[()]) for column in self.columns
        }
        arrays: dict[str, Any] = {
            f"field/{name}": np.asarray((fields or {})[name], dtype=float) for name in self.fields
        }
        if coefficients is not None and self._labels:
            shape = (len(self._dofs), len(labels or self._labels))
            arrays["coefficients"] = (
                coefficients if isinstance(coefficients, Spread) else self._fitting(coefficients, shape)
            )
            if len(labels) > len(self._labels):
                values[LABELS] = list(labels)
        for contact, motion in (motions or {}).items():
            arrays.update({f"motion/{contact}/{key}": values for key, values in _kept(motion)})
        return Record("row", values, arrays)

    def _fitting(self, coefficients: npt.ArrayLike, shape: tuple[int, int]) -> npt.NDArray[Any]:
        """Coefficients as an array that has a row for each dof and a column for each label, or fewer."""
        found = np.asarray(coefficients)
        if found.shape[:1] != shape[:1] or found.ndim != 2 or found.shape[1] > shape[1] or np.iscomplexobj(found):
            measured, where = f"{found.dtype.name} {found.shape}", f"analysis '{self.name}'"
            fix = "give one row a dof and one column a label, of cosines and sines"
            raise InputError("coefficients do not fit the table", where, measured, f"real {shape}", fix)
        return found.astype(float)

    def _write(self, record: Record, line: str) -> None:
        """A row to the journal, then to the CSV; the first one starts both."""
        if self.rows == 0:
            with told(self.folder):
                self.folder.mkdir(parents=True, exist_ok=True)
            self._journal.begin(self._layout(), record)
            self._open_table(header_line(self.columns) + line)
            return
        self._journal.append(record)
        with told(self.folder / f"{self.name}.csv"):
            write_all(self._table, line.encode())

    def _layout(self) -> Record:
        """What the group is made of besides its rows."""
        plain, arrays = attributes_of({**self.attributes, "status": "running", "reason": ""})
        fields = {name: kept.described() for name, kept in self.fields.items()}
        told_arrays = {f"array/{name}": np.asarray(values) for name, values in self._arrays.items()}
        return Record(
            "layout",
            {
                "columns": [[c.name, c.unit, c.long_name, c.kind] for c in self.columns],
                "attributes": plain,
                "file_attributes": self._file_attributes,
                "dofs": self._dofs,
                "labels": self._labels,
                "fields": fields,
            },
            {**{f"attribute/{name}": values for name, values in arrays.items()}, **told_arrays},
        )

    def _open_table(self, text: str) -> None:
        path = self.folder / f"{self.name}.csv"
        replace_bytes(path, text.encode(), sync=False)
        with told(path):
            self._table = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CLOEXEC)

    def dataset(self, name: str, values: npt.ArrayLike, **attributes: Value) -> None:
        """Keep a further array (time histories, peaks) in the group, replacing one of the same name.

        Its attribute `units` is of a quantity, as that of a column.
        """
        if not self.active:
            return
        self._journal.append(Record("array", {"name": name, "attributes": attributes}, {"values": values}))
        if self._new is not None:
            self._new.array(self.name, name, values, in_units(attributes, self.units))

    def close(self, status: str, reason: str, **attributes: Value) -> None:
        """End the table; `status` is ``done`` or ``stopped``. Without any row nothing is written."""
        if not self.active or not self.rows:
            return
        self._ending, self.closed = {**attributes, "status": status, "reason": reason}, True
        if not self.publish_later:
            self.publish()

    def publish(self) -> None:
        """Write results.h5 with the closed table, which counts as done from here on. Writing rank only.

        Raises
        ------
        FileError
            The disk does not take it; `fretwave resume` goes on from the last row.
        """
        if self._ending is None:
            return
        ending, self._ending = self._ending, None
        self.group.attrs.update(ending)
        assert self._new is not None
        new, self._new = self._new, None
        new.publish()
        self._journal.remove()

    def abandon(self) -> None:
        """Close the files, leaving the analysis unfinished unless it was closed before."""
        if self._table >= 0:
            os.close(self._table)
            self._table = -1
        if self._ending is None:
            self._journal.close()
            self._discard()

    def forget(self) -> None:
        """Leave nothing to go on with, closed or not."""
        self._ending = None
        self.abandon()
        self._journal.remove()

    def _discard(self) -> None:
        if self._new is not None:
            self._new.discard()
            self._new = None

    def go_on(self) -> dict[str, Any] | None:
        """Open the unfinished table of an earlier process, cut back to its last state (writing rank only).

        Returns
        -------
        dict or None
            The state's arrays; None when there is nothing to go on from.

        Raises
        ------
        InputError
            The journal is damaged.
        """
        path = journal_path(self.folder, self.name)
        if not path.exists():
            return None
        rows = Rows.of(path)
        state = self._journal.state(rows.token, len(rows))
        if state is None:
            return None
        kept = rows.first(state[0])
        self.fields, self.columns = kept.fields, kept.columns  # of the version that began it
        self.rows, self.reported = len(kept), len(kept.reported)
        self._journal.go_on(kept.size, kept.token)
        lines = [row_line(self.columns, values) for values in kept.values]
        self._open_table("".join([header_line(self.columns), *lines]))
        return state[1]

    def __del__(self) -> None:
        with suppress(Exception):
            self.abandon()


def _kept(motion: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """What there is of a contact's period; no gap of a law that has none."""
    for key, (_, _, dtype, missing) in MOTION.items():
        if key in motion:
            values = np.asarray(motion[key], dtype)
            if not (np.isnan(missing) and np.isnan(values).all()):
                yield key, values


__all__ = ["AnalysisWriter", "Field", "has_results", "open_results", "rewritten"]
