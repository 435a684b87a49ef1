"""Files of VTKHDF: layout as the specification says, parts and fields that come in pieces."""

from __future__ import annotations

import subprocess
import sys
from contextlib import nullcontext
from pathlib import Path

import h5py
import numpy as np
import pytest
from models.vtkhdf_files import read_step, skewed_mesh

from fretwave import fe
from fretwave.errors import InputError
from fretwave.fe.mesh import VTK_LATTICE
from fretwave.model.cells import KINDS
from fretwave.view.vtkhdf import VERTEX, GridFile, linear_cells

TRIQUADRATIC_HEXAHEDRON = KINDS["triquadratic_hexahedron"].vtk

pytestmark = pytest.mark.ranks(1)


@pytest.fixture(scope="module")
def skewed() -> fe.Mesh:
    return skewed_mesh()


def test_layout_follows_the_specification(tmp_path: Path, skewed: fe.Mesh) -> None:
    """Attributes, types and sizes; two parts, a field that stays, one that changes, one of two states."""
    path, n = tmp_path / "two.vtkhdf", len(skewed.nodes)
    changing = np.arange(3.0 * (n + 2)).reshape(3, n + 2)
    with GridFile(path, [0.0, 0.5, 1.0]) as grid:
        grid.part(skewed.nodes, (skewed.vtk_cells, TRIQUADRATIC_HEXAHEDRON))
        grid.part([[0.0, 0, 0], [1, 1, 1]], ([[0], [1]], VERTEX))
        grid.point_field("still", [skewed.nodes, np.zeros((2, 3))])
        grid.point_field("changing", changing, np.arange(3), "f4")
        grid.point_field("state", [np.zeros(n + 2), np.ones(n + 2)], [0, 1, 1])
        grid.field_data("level", [3.0, 4.0, 5.0])
    with h5py.File(path) as file:
        root = file["VTKHDF"]
        assert root.attrs["Version"].tolist() == [2, 0] and root.attrs["Version"].dtype.kind == "i"
        kind = root.attrs.get_id("Type").get_type()
        assert root.attrs["Type"] == b"UnstructuredGrid" and not kind.is_variable_str()
        assert kind.get_cset() == h5py.h5t.CSET_ASCII and kind.get_size() == len("UnstructuredGrid")
        assert root["Steps"].attrs["NSteps"] == 3 and root["Steps/Values"][()].tolist() == [0, 0.5, 1]
        assert root["NumberOfPoints"][()].tolist() == [n, 2] and root["NumberOfCells"][()].tolist() == [2, 2]
        assert root["NumberOfConnectivityIds"][()].tolist() == [54, 2] and len(root["Connectivity"]) == 56
        assert root["Offsets"][()].tolist() == [0, 27, 54, 0, 1, 2] and root["Points"].shape == (n + 2, 3)
        assert root["Types"].dtype == np.uint8 and root["Connectivity"].dtype.kind == "i"
        for name, shape in {"CellOffsets": (3, 1), "ConnectivityIdOffsets": (3, 1), "PointOffsets": (3,)}.items():
            assert root[f"Steps/{name}"].shape == shape and not root[f"Steps/{name}"][()].any()
        assert root["PointData/changing"].dtype == np.float32
    for step in range(3):
        found = read_step(path, step)
        assert found["types"].tolist() == [29, 29, 1, 1] and found["cells"][3].tolist() == [n + 1]
        assert found["changing"].tolist() == changing[step].tolist() and found["level"] == 3.0 + step
        assert np.all(found["state"] == min(step, 1)) and np.array_equal(found["still"][:n], skewed.nodes)


def test_a_failure_leaves_the_old_file(tmp_path: Path, skewed: fe.Mesh) -> None:
    path = tmp_path / "grid.vtkhdf"
    path.write_text("old")
    with pytest.raises(InputError, match="a node that does not exist"), GridFile(path, [0.0]) as grid:
        grid.part(skewed.nodes[:-1], (skewed.vtk_cells, TRIQUADRATIC_HEXAHEDRON))
    with pytest.raises(ValueError, match="rows"), GridFile(path, [0.0, 1.0]) as grid:
        grid.part(skewed.nodes, (skewed.vtk_cells, TRIQUADRATIC_HEXAHEDRON))
        grid.point_field("short", [skewed.nodes], [0, 1])
    assert path.read_text() == "old" and [entry.name for entry in tmp_path.iterdir()] == ["grid.vtkhdf"]


ANOTHER = """
import sys
from pathlib import Path
from fretwave.view.vtkhdf import VERTEX, GridFile

with GridFile(Path(sys.argv[1]), [0.0]) as grid:
    grid.part([[7.0, 0, 0]], ([[0]], VERTEX))
"""


def test_an_error_of_another_file_is_told_as_that(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"results\.h5"), GridFile(tmp_path / "view.vtkhdf", [0.0]):
        open(tmp_path / "results.h5").close()
    assert not list(tmp_path.iterdir())


def test_two_processes_may_write_one_file(tmp_path: Path) -> None:
    """Both wrote to one name beside it: the other was refused, or its file was taken. The last to end is there."""
    path = tmp_path / "grid.vtkhdf"
    with GridFile(path, [0.0, 1.0]) as grid:
        grid.part([[1.0, 0, 0], [2.0, 0, 0]], ([[0], [1]], VERTEX))
        subprocess.run([sys.executable, "-c", ANOTHER, path], check=True, timeout=60)
        assert read_step(path, 0)["points"].tolist() == [[7.0, 0.0, 0.0]]
    assert read_step(path, 1)["points"][:, 0].tolist() == [1.0, 2.0]
    assert [entry.name for entry in tmp_path.iterdir()] == ["grid.vtkhdf"]


def test_linear_cells_fill_the_same_volume(skewed: fe.Mesh) -> None:
    """Under a trilinear map the eight parts of a cell are exact; each is right-handed at all its corners."""
    cells = linear_cells(skewed.vtk_cells, VTK_LATTICE)
    lattice = np.array([0, 1, 3, 2, 4, 5, 7, 6])  # VTK's order to [i, j, k] in C order, reversed axes
    parts = fe.Mesh(skewed.nodes, cells[:, lattice].reshape(-1, 2, 2, 2).transpose(0, 3, 2, 1), 1, {})
    assert len(cells) == 16
    assert parts.jacobians([np.array([0.0, 1.0])] * 3).min() > 0
    assert parts.volume == pytest.approx(skewed.volume, rel=1e-13)


def test_a_field_comes_part_by_part_in_any_order(tmp_path: Path) -> None:
    """Two parts of 2 and 3 points, three states shown in four steps; what is left out is noticed."""
    path, values = tmp_path / "parts.vtkhdf", np.arange(3.0 * 5).reshape(3, 5)
    for complete in (True, False):
        fails = nullcontext() if complete else pytest.raises(ValueError, match="not written")
        with fails, GridFile(path, range(4)) as grid:
            for n in (2, 3):
                grid.part(np.zeros((n, 3)), (np.arange(n)[:, None], VERTEX))
            write, still = grid.field("moving", 0, [0, 1, 1, 2]), grid.field("still", 3, dtype="f4")
            for part, rows in ((1, slice(2, 5)), (0, slice(0, 2))):
                still(0, part, np.full((rows.stop - rows.start, 3), part))
                for state in (2, 0, 1) if complete else (2, 0):
                    write(state, part, values[state, rows])
    for step, state in enumerate([0, 1, 1, 2]):
        found = read_step(path, step)
        assert found["moving"].tolist() == values[state].tolist()
        assert found["still"][:, 2].tolist() == [0, 0, 1, 1, 1]
