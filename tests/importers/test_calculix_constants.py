"""Energy and uniform strain of CalculiX' K for every kind of solid element: what `fretwave stress` compares."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg
from command_line import call
from models.solid_meshes import bent, deck, mesh

import fretwave as fw
from fretwave.case.gauge_places import solids_of
from fretwave.fe.internal_forces import StressPoints
from fretwave.view.constants import constants_of
from fretwave.view.inner_nodes import with_inner_nodes

pytestmark = [
    pytest.mark.ranks(1),
    pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX is not installed"),
]

KINDS = {
    "C3D4": "tetrahedron",
    "C3D10": "quadratic_tetrahedron",
    "C3D6": "wedge",
    "C3D15": "quadratic_wedge",
    "C3D8": "hexahedron",
    "C3D8I": "hexahedron",
    "C3D8R": "hexahedron",
    "C3D20": "quadratic_hexahedron",
    "C3D20R": "quadratic_hexahedron",
}
STEEL = (210e3, 0.3)


@pytest.mark.parametrize("element", KINDS)
def test_energy_and_constants_are_those_of_the_deck(element: str, tmp_path: Path) -> None:
    """Of curved cells: the constants of all; the energy of the first eight modes of all but C3D8R, of one point."""
    nodes, solids = mesh(KINDS[element], (4, 2, 2), bent)
    (tmp_path / "bar.inp").write_text(deck(element, nodes, solids, "*FREQUENCY, SOLVER=MATRIXSTORAGE\n3"))
    subprocess.run(["ccx", "bar"], cwd=tmp_path, check=True, capture_output=True)
    made = [tmp_path / f"bar{end}" for end in (".mas", ".sti", ".inp")]
    words = ("--mass", made[0], "--stiffness", made[1], "--coordinates", made[2], "--units", "mm-t-s")
    assert call("import", tmp_path / "bar.h5", *words) == 0
    model = with_inner_nodes(fw.read_model(tmp_path / "bar.h5"), "the model")
    K, coordinates = model.own("K").tocsr(), np.asarray(model.coordinates)
    few, full = (StressPoints.of(coordinates, solids_of(model), STEEL, full) for full in (False, True))
    found = constants_of(model, K, few)
    assert found is not None
    assert len(found.numbers) >= 20
    assert found.off.max() < 3e-4
    np.testing.assert_allclose(found.together, STEEL, rtol=1e-4)
    last = [model.n_dof - 8, model.n_dof - 1]
    shapes = scipy.linalg.eigh(model.M.toarray(), K.toarray(), subset_by_index=last)[1]
    own = np.einsum("nc,nc->c", shapes, K @ shapes) / 2
    moved = np.vstack([shapes, np.zeros(8)])[model.displacements]
    ratios = np.array([points.energies(moved).sum(axis=0) / own for points in (few, full)])
    if element == "C3D8R":
        assert (ratios > 1.3).all()
    else:
        assert abs(ratios - 1).max(axis=1).min() < 1e-9
