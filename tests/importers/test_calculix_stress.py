"""Stress of modes against CalculiX' own, at its points of integration, for every kind of solid element."""

from __future__ import annotations

import re
import shutil
import subprocess
from itertools import product
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg
from command_line import call
from models.solid_meshes import bent, deck, mesh

import fretwave as fw
from fretwave.case.gauge_places import solids_of
from fretwave.fe.solids import MODES as INNER
from fretwave.fe.strain import COMPONENTS, gradients, stress_of
from fretwave.view.inner_nodes import with_inner_nodes

pytestmark = [
    pytest.mark.ranks(1),
    pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX is not installed"),
]

#: Gauss points of a line, and CalculiX' points of integration in its order (gauss.f), first coordinate fastest.
TWO, THREE = 1 / np.sqrt(3) * np.array([-1, 1]), np.sqrt(0.6) * np.array([-1, 0, 1])
A, B = (5 - np.sqrt(5)) / 20, (5 + 3 * np.sqrt(5)) / 20
THIRDS, SIXTHS = [(1 / 3, 1 / 3)], [(1 / 6, 1 / 6), (2 / 3, 1 / 6), (1 / 6, 2 / 3)]


def cube(line: np.ndarray) -> np.ndarray:
    return np.array([(x, y, z) for z, y, x in product(line, repeat=3)])


ELEMENTS = {
    "C3D4": ("tetrahedron", np.full((1, 3), 0.25)),
    "C3D10": ("quadratic_tetrahedron", np.array([(A, A, A), (B, A, A), (A, B, A), (A, A, B)])),
    "C3D6": ("wedge", np.array([(*xy, z) for z in TWO for xy in THIRDS])),
    "C3D15": ("quadratic_wedge", np.array([(*xy, z) for z in THREE for xy in SIXTHS])),
    "C3D8": ("hexahedron", cube(TWO)),
    "C3D8I": ("hexahedron", cube(TWO)),
    "C3D20": ("quadratic_hexahedron", cube(THREE)),
    "C3D20R": ("quadratic_hexahedron", cube(TWO)),
}
MODES = 3


def calculix(folder: Path, element: str, text: str, step: str) -> Path:
    (folder / f"{step}.inp").write_text(text)
    done = subprocess.run(["ccx", step], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout
    return folder / step


def printed_stresses(path: Path) -> list[np.ndarray]:
    """Of each mode (n_cells * n_points, 6)."""
    blocks = re.split(r"stresses[^\n]*\n", path.read_text())[1:]
    found = []
    for block in blocks:
        rows = [line.split() for line in block.splitlines()]
        found.append(np.array([[float(x) for x in row[2:8]] for row in rows if len(row) == 8]))
    return found


@pytest.mark.parametrize("element", ELEMENTS)
def test_modal_stress_is_calculix(element: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """From the matrices that CalculiX wrote: the modes of fretwave's own model file, and their stress."""
    kind, points = ELEMENTS[element]
    nodes, solids = mesh(kind, (3, 2, 1), bent)
    step = "*FREQUENCY, SOLVER=MATRIXSTORAGE\n3"
    calculix(tmp_path, element, deck(element, nodes, solids, step), "matrices")
    step = f"*FREQUENCY\n{MODES}\n*EL PRINT, ELSET=BODY\nS"
    own = printed_stresses(calculix(tmp_path, element, deck(element, nodes, solids, step), "modes").with_suffix(".dat"))
    made = [tmp_path / f"matrices{end}" for end in (".mas", ".sti", ".inp")]
    words = ("--mass", made[0], "--stiffness", made[1], "--coordinates", made[2], "--units", "mm-t-s")
    assert call("import", tmp_path / "model.h5", *words) == 0, capfd.readouterr().err
    model = fw.read_model(tmp_path / "model.h5")
    last = [model.n_dof - MODES, model.n_dof - 1]  # M x = K x / omega^2: M of C3D20R is singular
    inverse, shapes = scipy.linalg.eigh(model.M.toarray(), model.K.toarray(), subset_by_index=last)
    shapes = (shapes / np.sqrt(inverse))[:, ::-1]
    whole = with_inner_nodes(model, "the model")
    ((cell_kind, table),) = solids_of(whole).items()
    assert cell_kind == (INNER if element == "C3D8I" else kind)
    moved = np.vstack([shapes, np.zeros(MODES)])[whole.displacements]  # (n_nodes, 3, MODES)
    slopes = np.einsum("eqan,enbk->eqabk", gradients(cell_kind, whole.coordinates[table], points), moved[table])
    strain = np.stack([(slopes[:, :, a, b] + slopes[:, :, b, a]) / 2 for a, b in COMPONENTS], axis=2)
    stress = stress_of(strain.reshape(-1, 6, MODES), 210e3, 0.3)
    assert len(own) == MODES
    for k, wanted in enumerate(own):
        sign = np.sign((stress[..., k] * wanted).sum())
        assert abs(sign * stress[..., k] - wanted).max() < 1e-4 * abs(wanted).max()
