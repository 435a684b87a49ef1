"""A VTKHDF file of this package as ParaView before 5.12 reads it: a ``.pvd`` that names a ``.vtu`` for each step.

Layout of "VTK XML file formats" (docs.vtk.org), unstructured grid with appended raw data, each array in blocks that
zlib compresses. ParaView 5.11, which Debian 12 has, reads VTKHDF of one step alone.
"""

from __future__ import annotations

import shutil
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING
from xml.sax.saxutils import quoteattr

import numpy as np

from ..arrays import AnyArray

if TYPE_CHECKING:
    import h5py

#: Bytes of a block before it is compressed.
BLOCK = 1 << 18
NAMES = {"f4": "Float32", "f8": "Float64", "i1": "Int8", "i4": "Int32", "u1": "UInt8"}
HEADER = 'byte_order="LittleEndian" header_type="UInt64" compressor="vtkZLibDataCompressor"'


def write_series(source: Path, out: Path) -> int:
    """Write ``<name>.pvd`` and the folder ``<name>_steps`` beside it from a VTKHDF file; returns the bytes of all."""
    import h5py

    folder = out.with_name(f"{out.stem}_steps")
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    with h5py.File(source, "r") as file:
        root = file["VTKHDF"]
        grid, values = _Grid(root), root["Steps/Values"][()]
        names = [f"{folder.name}/{step:04d}.vtu" for step in range(len(values))]
        for step, name in enumerate(names):
            grid.write(step, out.parent / name)
    shown = [f'<DataSet timestep="{value!r}" file={quoteattr(name)}/>' for value, name in zip(values.tolist(), names)]
    lines = ['<VTKFile type="Collection" version="0.1">', "<Collection>", *shown, "</Collection>", "</VTKFile>"]
    out.write_text("\n".join(lines) + "\n")
    return out.stat().st_size + sum((out.parent / name).stat().st_size for name in names)


class _Grid:
    """The grid, which stays, and its fields."""

    def __init__(self, root: h5py.Group) -> None:
        self.root = root
        self.n_points, self.n_cells = (int(root[f"NumberOf{name}"][()].sum()) for name in ("Points", "Cells"))
        self.geometry = {"Points": _plain(root["Points"][()].astype("f4")), **self._cells()}

    def _cells(self) -> dict[str, AnyArray]:
        """Connectivity and ends of the cells of all parts together, in the numbers of all points."""
        root = self.root
        sizes = [root[f"NumberOf{name}"][()] for name in ("Points", "Cells", "ConnectivityIds")]
        first = np.concatenate([[0], np.cumsum(sizes[0])[:-1]])
        ids = root["Connectivity"][()] + np.repeat(first, sizes[2])
        ends = np.split(root["Offsets"][()], np.cumsum(sizes[1] + 1)[:-1])
        widths = np.concatenate([np.diff(end) for end in ends])
        return {"connectivity": _plain(ids), "offsets": _plain(np.cumsum(widths)), "types": root["Types"][()]}

    def _fields(self, step: int) -> Iterator[tuple[str, AnyArray]]:
        for name, data in self.root["PointData"].items():
            begin = int(self.root[f"Steps/PointDataOffsets/{name}"][step])
            yield name, _plain(data[begin : begin + self.n_points])

    def write(self, step: int, path: Path) -> None:
        """One step as a file of its own."""
        appended = _Appended()
        numbers = {name: data[step : step + 1] for name, data in self.root["FieldData"].items()}
        told = [appended.tag(name, values, " NumberOfTuples='1'") for name, values in numbers.items()]
        fields = [appended.tag(name, values) for name, values in self._fields(step)]
        points, *cells = (appended.tag(name, values) for name, values in self.geometry.items())
        head = [f'<VTKFile type="UnstructuredGrid" version="1.0" {HEADER}>', "<UnstructuredGrid>", "<FieldData>", *told]
        head += ["</FieldData>", f'<Piece NumberOfPoints="{self.n_points}" NumberOfCells="{self.n_cells}">']
        head += ["<PointData>", *fields, "</PointData>", "<Points>", points, "</Points>", "<Cells>", *cells, "</Cells>"]
        head += ["</Piece>", "</UnstructuredGrid>", '<AppendedData encoding="raw">', "_"]
        tail = b"\n</AppendedData>\n</VTKFile>\n"
        path.write_bytes("\n".join(head).encode() + b"".join(appended.blocks) + tail)


class _Appended:
    """Arrays behind the text of a file, one after the other."""

    def __init__(self) -> None:
        self.blocks: list[bytes] = []
        self.size = 0

    def tag(self, name: str, values: AnyArray, more: str = "") -> str:
        """Keep an array; its line in the text."""
        kept, begin = _compressed(np.ascontiguousarray(values).tobytes()), self.size
        self.blocks.append(kept)
        self.size += len(kept)
        components = f' NumberOfComponents="{values.shape[1]}"' if values.ndim == 2 else ""
        kind = NAMES[values.dtype.str[1:]]
        return f'<DataArray type="{kind}" Name="{name}"{components} format="appended" offset="{begin}"{more}/>'


def _compressed(data: bytes) -> bytes:
    """Number of blocks, their size, that of a last smaller one, their compressed sizes, and the blocks."""
    blocks = [zlib.compress(data[k : k + BLOCK], 6) for k in range(0, len(data), BLOCK)]
    header = [len(blocks), BLOCK, len(data) % BLOCK, *map(len, blocks)]
    return np.array(header, dtype="<u8").tobytes() + b"".join(blocks)


def _plain(values: AnyArray) -> AnyArray:
    """As types that hold what a picture needs: single precision, numbers of 32 bits."""
    small = {"f": "<f4", "i": "<i4", "u": "<u1"}
    keep = values.dtype.itemsize == 1
    return values if keep else values.astype(small[values.dtype.kind])
