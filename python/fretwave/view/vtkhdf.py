"""Writes VTKHDF for ParaView and VTK: one unstructured grid at rest whose fields change over steps.

Layout of "VTKHDF format specification" (docs.vtk.org, VTK file formats), version 2.0, sections "Unstructured grid" and
"Temporal data": all arrays of all steps stand one after the other, and ``Steps`` tells each step where to read. A grid
that stays is written once and has the offset 0 in every step; so has a field that is the same in several steps.
Plain serial h5py. ParaView reads such files from version 5.12 on (VTK 9.3).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ..arrays import AnyArray, Array, Indices, IntArray
from ..errors import InputError
from ..files.streams import behind, refuse_stream
from ..files.whole import replaced
from ..model.cells import KINDS
from ..texts import display
from ..units import ATTRIBUTE, SI, UnitSystem

if TYPE_CHECKING:
    import h5py


#: VTK's numbers of cell types that are no cells of a mesh, and of what a triquadratic hexahedron is cut into.
VERTEX, TRIANGLE, HEXAHEDRON = 1, KINDS["triangle"].vtk, KINDS["hexahedron"].vtk
#: Cells (n_cells, m) of one kind with VTK's number of it.
Cells = tuple[Indices, int]
#: The lowest version with steps: any reader of a later 2.x takes it.
VERSION = (2, 0)
#: Rows of one HDF5 chunk: a step of a small grid, some 100 kB of vectors of a large one.
CHUNK_ROWS = (256, 4096)
#: Corners of a hexahedron in VTK's order on the lattice {0, 1}^3.
_CORNERS = ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1))


class GridFile:
    """An unstructured grid over steps; the file takes its place when all is written (``with``).

    First every part by `part`, then fields, whose arrays may come in pieces: no more than a part, or a piece, is in
    memory at once. A wheel is its sectors one after the other, turned as they are written.

    Parameters
    ----------
    path : Path
    values : (n_steps,)
        What ParaView calls time.
    units : UnitSystem
        The system of all numbers, kept as an attribute of the file.
    """

    def __init__(self, path: Path, values: Sequence[float] | Array, units: UnitSystem = SI) -> None:
        refuse_stream(path)
        path = behind(path)
        self.path, self.steps = path, len(values)
        self._place = replaced(path, own=True, keep_suffix=True)
        self._file = _create(self._place.__enter__())
        self._file.attrs[ATTRIBUTE] = units.name
        self._root = self._file.create_group("VTKHDF", track_order=True)
        self._root.attrs["Version"] = np.array(VERSION, dtype="i8")
        _text_attribute(self._root, "Type", "UnstructuredGrid")
        for name, columns, dtype in (("Points", 3, "f8"), ("Connectivity", 0, "i8"), ("Offsets", 0, "i8")):
            self._table(self._root, name, columns, dtype)
        self._table(self._root, "Types", 0, "u1")
        for name in ("NumberOfPoints", "NumberOfCells", "NumberOfConnectivityIds"):
            self._table(self._root, name, 0, "i8")
        for name in ("PointData", "FieldData"):
            self._root.create_group(name, track_order=True)
        self._missing: dict[str, int] = {}
        self._steps(np.asarray(values, dtype=float))

    def _steps(self, values: Array) -> None:
        steps = self._root.create_group("Steps")
        steps.attrs["NSteps"] = np.int64(self.steps)
        steps["Values"] = values
        # The grid stays: every step reads the same parts, points and cells from their beginning.
        for name in ("PartOffsets", "PointOffsets"):
            steps[name] = np.zeros(self.steps, dtype="i8")
        for name in ("CellOffsets", "ConnectivityIdOffsets"):
            steps[name] = np.zeros((self.steps, 1), dtype="i8")
        for name in ("PointDataOffsets", "FieldDataOffsets"):
            steps.create_group(name)

    @property
    def n_points(self) -> int:
        """Points of all parts so far."""
        return len(self._root["Points"])

    def part(self, points: npt.ArrayLike, *blocks: Cells) -> None:
        """Add a part of the grid.

        Parameters
        ----------
        points : (n, 3) [length]
        blocks : ((n_cells, m), int) each
            Numbers of this part's points in VTK's order, and VTK's number of the cell type.
        """
        points = np.asarray(points, dtype=float)
        tables = [np.asarray(cells, dtype="i8") for cells, _ in blocks]
        ids = np.concatenate([cells.ravel() for cells in tables])
        if ids.size and not 0 <= ids.min() <= ids.max() < len(points):
            found, wanted = f"{ids.min()} to {ids.max()}", f"0 to {len(points) - 1}"
            raise InputError("a cell has a node that does not exist", display(self.path), found, wanted)
        widths = np.concatenate([np.full(len(cells), cells.shape[1]) for cells in tables])
        types = np.concatenate([np.full(len(cells), kind, "u1") for cells, (_, kind) in zip(tables, blocks)])
        arrays = {"Points": points, "Connectivity": ids, "Types": types, "Offsets": np.append(0, np.cumsum(widths))}
        sizes = {"NumberOfPoints": len(points), "NumberOfCells": len(types), "NumberOfConnectivityIds": ids.size}
        for name, values in {**arrays, **{name: np.array([size]) for name, size in sizes.items()}}.items():
            _append(self._root[name], values)

    def point_field(
        self, name: str, pieces: Iterable[AnyArray], of_step: npt.ArrayLike | None = None, dtype: str = "f8"
    ) -> None:
        """A field on the points.

        Parameters
        ----------
        pieces : iterable of (rows,) or (rows, n_components)
            One after the other they are the points of all parts, once for each state of the field.
        of_step : (n_steps,) int, optional
            State that each step shows; default: the first in all.
        """
        data, rows = None, 0
        for piece in pieces:
            if data is None:
                columns = piece.shape[1] if piece.ndim == 2 else 0
                data = self._table(self._root["PointData"], name, columns, dtype, self.n_points)
            _append(data, piece)
            rows += len(piece)
        shown = self._shown(name, of_step)
        if len(shown) != self.steps or rows != self.n_points * (int(shown.max()) + 1):
            raise ValueError(f"field {name}: {rows} rows for {shown.max() + 1} states of {self.n_points} points")

    def field(
        self, name: str, columns: int = 0, of_step: npt.ArrayLike | None = None, dtype: str = "f8"
    ) -> Callable[[int, int, AnyArray], None]:
        """A field on the points that is written part by part, in any order, after all parts were added.

        Parameters
        ----------
        columns : components of a vector, 0 for a number
        of_step : (n_steps,) int, optional
            State that each step shows; default: the first in all.

        Returns
        -------
        callable
            write(state, part, values): values (n,) or (n, columns) on the n points of a part.
        """
        shown = self._shown(name, of_step)
        data = self._table(self._root["PointData"], name, columns, dtype, self.n_points)
        data.resize((int(shown.max()) + 1) * self.n_points, axis=0)
        begins = np.append(0, np.cumsum(self._root["NumberOfPoints"][()]))
        self._missing[name] = len(data)

        def write(state: int, part: int, values: AnyArray) -> None:
            start = state * begins[-1] + begins[part]
            data[start : start + begins[part + 1] - begins[part]] = values
            self._missing[name] -= len(values)

        return write

    def _shown(self, name: str, of_step: npt.ArrayLike | None) -> IntArray:
        """State of a field that each step shows (n_steps,), told to the file once all parts are there."""
        shown = np.zeros(self.steps, dtype="i8") if of_step is None else np.asarray(of_step, dtype="i8")
        self._root[f"Steps/PointDataOffsets/{name}"] = shown * self.n_points
        return shown

    def field_data(self, name: str, values: npt.ArrayLike) -> None:
        """A number for each step, beside the grid."""
        self._root[f"FieldData/{name}"] = np.asarray(values, dtype=float)
        self._root[f"Steps/FieldDataOffsets/{name}"] = np.arange(self.steps, dtype="i8")

    def __enter__(self) -> GridFile:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is not None:  # which may be of another file
            self._file.close()
            with suppress(BaseException):
                self._place.__exit__(kind, error, trace)
            return
        with ExitStack() as ending:
            ending.push(self._place)
            ending.callback(self._file.close)
            self._complete()

    def _complete(self) -> None:
        missing = [name for name, rows in self._missing.items() if rows]
        if missing:
            raise ValueError(f"fields not written everywhere: {', '.join(missing)}")
        parts = len(self._root["NumberOfPoints"])
        self._root["Steps/NumberOfParts"] = np.full(self.steps, parts, dtype="i8")

    @staticmethod
    def _table(group: h5py.Group, name: str, columns: int, dtype: str, rows: int = 0) -> Any:
        """An empty dataset that grows, often by so many rows; `columns` 0 for one number a row."""
        tail = (columns,) if columns else ()
        chunk = min(max(rows, CHUNK_ROWS[0]), CHUNK_ROWS[1])
        return group.create_dataset(name, (0, *tail), dtype, maxshape=(None, *tail), chunks=(chunk, *tail))


def linear_cells(triquadratic: AnyArray, lattice: Sequence[tuple[int, int, int]]) -> IntArray:
    """Eight hexahedra (8 n, 8) on the nodes of each triquadratic one (n, 27).

    Parameters
    ----------
    lattice : 27 positions on {0, 1, 2}^3
        Of the nodes of a triquadratic hexahedron in VTK's order.
    """
    number = {place: k for k, place in enumerate(lattice)}
    picked = [[number[i + a, j + b, k + c] for a, b, c in _CORNERS] for i in (0, 1) for j in (0, 1) for k in (0, 1)]
    return np.asarray(triquadratic, dtype="i8")[:, picked].reshape(-1, 8)


def _append(data: h5py.Dataset, rows: AnyArray) -> None:
    start = len(data)
    data.resize(start + len(rows), axis=0)
    data[start:] = rows


def _text_attribute(group: h5py.Group, name: str, text: str) -> None:
    """Of fixed length, in ASCII: VTK's reader takes no other."""
    import h5py

    group.attrs.create(name, np.bytes_(text), dtype=h5py.string_dtype("ascii", len(text)))


def _create(path: Path) -> Any:
    import h5py

    try:
        return h5py.File(path, "w")
    except OSError as error:
        fix = "choose another place with --out"
        expected = "a folder that exists and can be written"
        raise InputError("the file cannot be written", display(path.parent), error, expected, fix) from None
