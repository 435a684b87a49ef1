"""A ``.pvd`` with its ``.vtu``: read back as "VTK XML file formats" says, equal to the VTKHDF file."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
import zlib

import numpy as np
import pytest
from models.vtkhdf_files import read_step

from fretwave.view.series import BLOCK, write_series
from fretwave.view.vtkhdf import TRIANGLE, VERTEX, GridFile

pytestmark = pytest.mark.ranks(1)
TYPES = {"Float32": "<f4", "Float64": "<f8", "Int32": "<i4", "Int8": "<i1", "UInt8": "<u1"}
SINGLE = 1e-6


def read_vtu(path):
    """Arrays of a file by name, and its numbers of points and cells."""
    content = path.read_bytes()
    begin = content.index(b'<AppendedData encoding="raw">') + len(b'<AppendedData encoding="raw">\n_')
    root = ElementTree.fromstring(content[:begin] + b"</AppendedData></VTKFile>")
    assert root.attrib["compressor"] == "vtkZLibDataCompressor" and root.attrib["header_type"] == "UInt64"
    found = {}
    for array in root.iter("DataArray"):
        at = begin + int(array.attrib["offset"])
        count, size, last = np.frombuffer(content, "<u8", 3, at)
        sizes = np.frombuffer(content, "<u8", int(count), at + 24)
        at, data = at + 24 + 8 * int(count), b""
        for number in sizes:
            data += zlib.decompress(content[at : at + int(number)])
            at += int(number)
        assert size == BLOCK and len(data) == (int(count) - bool(last)) * BLOCK + int(last)
        values = np.frombuffer(data, TYPES[array.attrib["type"]])
        columns = int(array.attrib.get("NumberOfComponents", 1))
        found[array.attrib["Name"]] = values.reshape(-1, columns) if columns > 1 else values
    (piece,) = root.iter("Piece")
    return found, int(piece.attrib["NumberOfPoints"]), int(piece.attrib["NumberOfCells"])


def write_parts(path, n=30000):
    """Two parts of points and triangles over three steps, large enough for several blocks."""
    random = np.random.default_rng(1)
    corners = random.integers(0, n, (n, 3))
    with GridFile(path, [0.0, 0.25, 0.5]) as grid:
        for part in range(2):
            grid.part(random.random((n, 3)) + part, (corners, TRIANGLE), ([[0], [1]], VERTEX))
        moved = grid.field("displacement", 3, [0, 1, 2])
        for step in range(3):
            for part in range(2):
                moved(step, part, random.random((n, 3)))
        fixed = grid.field("sector", dtype="i4")
        for part in range(2):
            fixed(0, part, np.full(n, part))
        grid.field_data("amplitude", [1.0, 2.0, 3.0])


def test_every_step_is_that_of_the_vtkhdf_file(tmp_path):
    write_parts(tmp_path / "grid.vtkhdf")
    size = write_series(tmp_path / "grid.vtkhdf", tmp_path / "seen.pvd")
    sets = list(ElementTree.parse(tmp_path / "seen.pvd").getroot().iter("DataSet"))
    assert [float(one.attrib["timestep"]) for one in sets] == [0.0, 0.25, 0.5]
    files = [tmp_path / one.attrib["file"] for one in sets]
    assert size == sum(path.stat().st_size for path in [tmp_path / "seen.pvd", *files])
    for step, path in enumerate(files):
        found, n_points, n_cells = read_vtu(path)
        expected = read_step(tmp_path / "grid.vtkhdf", step)
        assert (n_points, n_cells) == (len(expected["points"]), len(expected["types"]))
        for name, theirs in (("Points", "points"), ("displacement", "displacement"), ("sector", "sector")):
            np.testing.assert_allclose(found[name], expected[theirs], rtol=SINGLE)
        assert found["types"].tolist() == expected["types"].tolist()
        cells = np.split(found["connectivity"], found["offsets"])[:-1]
        assert len(cells) == n_cells and found["connectivity"].dtype == np.int32
        assert all(np.array_equal(one, other) for one, other in zip(cells, expected["cells"]))
        assert found["amplitude"] == expected["amplitude"]


def test_steps_of_a_longer_series_do_not_stay(tmp_path):
    write_parts(tmp_path / "grid.vtkhdf", 5)
    (tmp_path / "seen_steps").mkdir()
    (tmp_path / "seen_steps" / "0007.vtu").write_text("of before")
    write_series(tmp_path / "grid.vtkhdf", tmp_path / "seen.pvd")
    assert sorted(path.name for path in (tmp_path / "seen_steps").iterdir()) == ["0000.vtu", "0001.vtu", "0002.vtu"]
