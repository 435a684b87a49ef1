"""Ansys: matrices of a .full file against the modes of Ansys' own result file, and what is made of a .full file."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.sparse as sp
from models.matrix_files import Held
from tolerances import LAST_BIT, REPEATED

from fretwave.commands.main import main
from fretwave.errors import InputError
from fretwave.importers import ansys_full, assemble
from fretwave.importers.extras import reader_of
from fretwave.importers.node_files import read_node_file
from fretwave.results import model_file

pytestmark = pytest.mark.ranks(1)

HEADER = ansys_full.HEADER
#: Where the stand-in's dofs are.
PLACE = 1000


def write_head(folder: Path, **items: int) -> Path:
    """A file of the records' head and header alone."""
    words = np.zeros(HEADER + 102, dtype="<i4")
    words[:3] = np.frombuffer(ansys_full.head_of(4), "<i4")
    for name, value in {"SYMBOLIC": -4, "DOFS": PLACE, **items}.items():
        words[HEADER + 2 + getattr(ansys_full, name)] = value
    words.tofile(folder / "job.full")
    return folder / "job.full"


class StandIn:
    """What ansys-mapdl-reader gives of `Held`: upper triangles in an order of their own, rows of held dofs empty."""

    kinds = (1, 2, 3)

    def __init__(self, _: str) -> None:
        held = Held()
        n = len(held.bar.nodes)
        order = np.random.default_rng(1).permutation(3 * n)
        inside = sp.eye(3 * n, format="csr")[:, held.free]
        self.K, self.M = (sp.triu((inside @ A @ inside.T)[order][:, order], format="csc") for A in (held.K, held.M))
        self.labels = np.column_stack([order // 3 + 1, np.zeros(3 * n)]).astype(np.int32)
        dofs = (order % 3 + 1) * np.where(np.isin(order, held.free), 1, -1)
        kinds = HEADER + 100 + ansys_full.FRAME
        self.records = {HEADER: np.zeros(100), kinds: np.array(self.kinds), PLACE: np.full(n, 3)}
        self.records[PLACE + n + ansys_full.FRAME] = dofs

    def load_km(self, as_sparse: bool, sort: bool) -> tuple[np.ndarray, sp.csc_matrix, sp.csc_matrix]:
        assert as_sparse and not sort
        return self.labels, self.K, self.M

    def read_record(self, word: int) -> np.ndarray:
        return self.records[word]


@pytest.fixture
def stand_in(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ansys_full, "reader_of", lambda *_: SimpleNamespace(FullFile=StandIn))


def test_rows_of_held_dofs_are_left_out(stand_in: None, tmp_path: Path) -> None:
    """Both triangles, and each row's node and direction, in whatever order the file has."""
    path, held = write_head(tmp_path), Held()
    found = assemble({letter: ansys_full.read(path, letter) for letter in "MK"})
    assert found.symmetry["K"] == found.symmetry["M"] == "upper triangle, mirrored"
    order = np.lexsort(found.labels.T[::-1])
    np.testing.assert_array_equal(found.labels[order], held.labels)
    for letter, A in (("K", held.K), ("M", held.M)):
        assert abs(found.matrices[letter][order][:, order] - A).max() == 0


@pytest.mark.parametrize("kinds", [(1, 2, 3, 20), (1, 2)])
def test_other_dofs_are_refused(
    kinds: tuple[int, ...], stand_in: None, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Temperatures; a plane model."""
    monkeypatch.setattr(StandIn, "kinds", kinds)
    with pytest.raises(InputError, match="dofs are no displacements in space"):
        ansys_full.read(write_head(tmp_path), "K")


@pytest.mark.parametrize(
    "item, value, said",
    [
        ("SYMBOLIC", 4, "frontal"),
        ("LUMPED", 1, "lumped"),
        ("UNSYMMETRIC", 1, "not symmetric"),
        ("CONSTRAINTS", 12, "12 constraint equations"),
    ],
)
def test_what_is_not_read(item: str, value: int, said: str, stand_in: None, tmp_path: Path) -> None:
    with pytest.raises(InputError) as refused:
        ansys_full.read(write_head(tmp_path, **{item: value}), "K")
    assert said in str(refused.value.measured) and refused.value.fix


def test_damping_is_not_read(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="damping is not read"):
        ansys_full.read(write_head(tmp_path), "C")


@pytest.mark.parametrize(
    "module, package, command",
    [
        ("ansys", "ansys-mapdl-reader", "pip install ansys-mapdl-reader"),
        ("mapdl_archive", "mapdl-archive", "pip install mapdl-archive"),
        ("pyyeti", "pyyeti", "pip install --no-deps pyyeti"),
    ],
)
def test_a_missing_extra(
    module: str,
    package: str,
    command: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    """Whether it is installed or not: one error with what to install."""
    (tmp_path / f"{module}.py").write_text("raise ImportError('not here')\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    (tmp_path / "model.cdb").write_text("/PREP7\nNBLOCK,6,SOLID,1,1\n")
    (tmp_path / "model.op4").write_text("       1       1       6       2KAA\n")
    np.save(tmp_path / "A.npy", np.eye(3))
    matrix = {"ansys": write_head(tmp_path), "mapdl_archive": tmp_path / "A.npy", "pyyeti": tmp_path / "model.op4"}[
        module
    ]
    arguments = ["import", str(tmp_path / "m.h5"), "--mass", str(matrix), "--stiffness", str(matrix)]
    assert main([*arguments, "--coordinates", str(tmp_path / "model.cdb")]) == 2
    text = capfd.readouterr().err
    assert f"this file is read by the package {package}" in text
    assert "not here" in text and text.count("fix:") == 1 and command in text


EXTRA = "ansys-mapdl-reader is not installed: it brings VTK, 600 MB"


@pytest.fixture(scope="module")
def examples() -> Path:
    """A beam of 40 SOLID186 held at one end, of Ansys 15: its .full; without the hold: its .rst; its mesh as .cdb."""
    package = pytest.importorskip("ansys.mapdl.reader", reason=EXTRA)
    return Path(package.__file__).parent / "examples"


def test_modes_of_ansys(examples: Path, tmp_path: Path) -> None:
    """Six modes of the free beam by Ansys solve the rows of K and M that no held node's element touches.

    The first two within 7e-12 of its frequency, the last within 4e-8: the residual says how well Ansys solved each.
    """
    beam = [str(examples / "file.full")] * 2
    mesh = ["--coordinates", str(examples / "HexBeam.cdb")]
    assert main(["import", str(tmp_path / "m.h5"), "--mass", beam[0], "--stiffness", beam[1], *mesh]) == 0
    model = model_file.read_model(tmp_path / "m.h5")
    result = reader_of("ansys.mapdl.reader", "", "ansys", "").read_binary(str(examples / "file.rst"))
    assert model.n_dof == 900 and len(model.hexahedra) == 40
    held = ~np.isin(model.node_numbers, model.labels[:, 0])
    cells = model.hexahedra
    touched = np.unique(cells[held[cells].any(axis=1)])
    rows = ~np.isin(model.labels[:, 0], model.node_numbers[touched])
    assert held.sum() == 21 and rows.sum() == 810
    for mode, hertz in enumerate(result.time_values):
        numbers, shape = result.nodal_solution(mode)
        u = shape[np.searchsorted(numbers, model.labels[:, 0]), model.labels[:, 1] - 1]
        force, inertia = (model.K @ u)[rows], (model.M @ u)[rows]
        square = force @ inertia / (inertia @ inertia)
        assert np.sqrt(square) / (2 * np.pi) == pytest.approx(hertz, rel=5 * REPEATED)
        assert np.linalg.norm(force - square * inertia) < 2e-6 * np.linalg.norm(force)


def test_the_mesh_of_a_result(examples: Path) -> None:
    """As that of the archive; elements by their numbers."""
    result, archive = (read_node_file(examples / name) for name in ("file.rst", "HexBeam.cdb"))
    np.testing.assert_array_equal(result.numbers, archive.numbers)
    np.testing.assert_allclose(result.coordinates, archive.coordinates, atol=LAST_BIT)
    np.testing.assert_array_equal(*(mesh.elements.vtk()["quadratic_hexahedron"] for mesh in (result, archive)))


def test_a_cut_file(examples: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """The reader may crash on it; the import does not."""
    (tmp_path / "job.full").write_bytes((examples / "file.full").read_bytes()[:300000])
    matrix = str(tmp_path / "job.full")
    assert main(["import", str(tmp_path / "m.h5"), "--mass", matrix, "--stiffness", matrix]) == 2
    assert "the file of M cannot be read" in capfd.readouterr().err
