"""`fretwave stress` says whether its stress is that of K: its materials, its elements, and what else K holds."""

from __future__ import annotations

import re
import shutil
import subprocess
from html import escape
from pathlib import Path

import numpy as np
import pytest
from command_line import call
from models import two_materials
from models.csv_columns import rows
from models.solid_meshes import deck, mesh

pytestmark = pytest.mark.ranks(1)
pytest.importorskip("skfem")

CASE = """
[model]
builder = "{builder}.py"
{options}

[reduction]
modes = 4

[damping]
zeta = 0.01

[material]
youngs_modulus = 210e3
poisson_ratio = 0.3

[[analysis]]
name = "forced"
type = "forced"
harmonics = 1
samples = 64
observe = "tip"
force = {{ tip = 1.0 }}
levels = [1.0]
frequency = [{low}, {high}]
"""


def run(folder: Path, options: str, band: tuple[float, float] = (330.0, 350.0), reduced: bool = True) -> int:
    """Exit code of `fretwave stress` on a run of the beam of two halves."""
    shutil.copy(two_materials.__file__, folder / "two_materials.py")
    return run_of(folder, "two_materials", options, band, reduced)


def run_of(folder: Path, builder: str, options: str, band: tuple[float, float], reduced: bool = True) -> int:
    text = CASE.format(builder=builder, options=options, low=band[0], high=band[1])
    text = text if reduced else text.replace("[reduction]\nmodes = 4\n", "")
    (folder / "case.toml").write_text(text)
    assert call("run", folder / "case.toml", "--no-plots", "-q", "--out", folder / "run") == 0
    return call("stress", folder / "run")


def said(capfd: pytest.CaptureFixture[str]) -> tuple[float, str]:
    """The ratio of the energies, and all lines."""
    text = capfd.readouterr().out
    (found,) = re.findall(r"strain energy of the stress: ([0-9.]+) of the model's own", text)
    return float(found), text


@pytest.mark.parametrize("order", [1, 2])
def test_one_material_agrees(order: int, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """Curved and twisted cells of 8 and 27 nodes, whose K has 2 and 3 points an axis: 1 to the last digit told."""
    assert run(tmp_path, f"options = {{ order = {order} }}") == 0
    ratio, text = said(capfd)
    assert ratio == 1.0
    assert "warning" not in text and "note" not in text
    assert "warning" not in rows(tmp_path / "run" / "forced_gauges.csv")[0]


@pytest.mark.parametrize(("modulus", "ratio"), [(114e3, 0.3), (210e3, 0.33), (400e3, 0.2)])
def test_other_constants_are_told_by_the_stiffness(
    modulus: float, ratio: float, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """Exactly, a Poisson's ratio alone too, which the energy of bending hardly knows."""
    assert run(tmp_path, f"options = {{ moduli = [{modulus}, {modulus}], ratios = [{ratio}, {ratio}] }}") == 0
    energies, text = said(capfd)
    assert f"K has youngs_modulus = {modulus:.6g} [MPa] and poisson_ratio = {ratio:.4g}" in text
    assert "warning" in text
    kept = [row["warning"] for row in rows(tmp_path / "run" / "forced_gauges.csv") if row["warning"]]
    assert [f"  warning: {one}" in text for one in kept] == [True]
    assert call("report", tmp_path / "run") == 0 and call("plot", tmp_path / "run") == 0
    assert escape(kept[0]) in (tmp_path / "run" / "report.html").read_text()
    if ratio == 0.3:
        assert energies == pytest.approx(210e3 / modulus, abs=5e-5)  # to the digits told


def test_a_modulus_in_other_units_makes_no_stress(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert run(tmp_path, "options = { moduli = [210.0, 210.0] }", (10.0, 11.0)) == 2
    text = capfd.readouterr().err
    assert "[material] is not that of the model's stiffness" in text
    assert "youngs_modulus = 210 [MPa] and poisson_ratio = 0.3, which K has" in text
    assert not (tmp_path / "run" / "forced_gauges.csv").exists()


def test_two_materials_are_told_where_they_are(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """Though their energies differ by 8 % only: the outer half is bent less."""
    assert run(tmp_path, "options = { moduli = [210e3, 114e3] }", (320.0, 340.0)) == 0
    ratio, text = said(capfd)
    assert 1.05 < ratio < 1.1
    assert re.search(r"warning: .*K has 0\.543 to 0\.\d+ of the modulus of \[material\]", text)
    farthest = int(re.search(r"farthest at node (\d+)", text)[1]) - 1  # type: ignore[index]
    assert two_materials.build().coordinates[farthest, 0] > two_materials.LENGTH / 2
    worst = int(rows(tmp_path / "run" / "forced_gauges.csv")[0]["worst_node"]) - 1
    assert two_materials.build().coordinates[worst, 0] < two_materials.LENGTH / 2
    assert "the worst node too" not in text


@pytest.mark.parametrize("springs", ["mount = 1.0, retainer = 1e5", "mount = 1.0, strut = 1e5"])
def test_springs_are_no_other_material(springs: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """Of the end's nodes, to the ground and to each other: the stress of the cells is right, the rest is named."""
    assert run(tmp_path, f"options = {{ {springs} }}") == 0
    ratio, text = said(capfd)
    assert ratio < 0.9
    assert "warning" not in text
    node = int(re.search(r"note: .*most at node (\d+)", text)[1]) - 1  # type: ignore[index]
    assert two_materials.build().coordinates[node, 0] == pytest.approx(two_materials.LENGTH)


@pytest.mark.parametrize("order", [1, 2])
def test_a_bed_is_no_other_material(order: int, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """It joins neighbours on a face, as cells do, but bears what moves alike."""
    assert run(tmp_path, f"options = {{ order = {order}, bed = 1e5 }}", (330.0, 350.0)) == 0
    ratio, text = said(capfd)
    assert ratio < 0.9
    assert "note: strain" in text
    assert "warning" not in text


def test_cells_that_the_mesh_lacks_are_counted(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert run(tmp_path, "options = { known = 10 }") == 0
    model = two_materials.build(known=10)
    lonely = len(np.setdiff1d(np.flatnonzero((model.displacements >= 0).all(axis=1)), model.hexahedra))
    assert lonely > 100
    assert f"note: {lonely} nodes that K moves are of no solid cell" in said(capfd)[1]


def test_stiffness_of_a_speed_is_no_part_of_it(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """Stress stiffness bears no stress of the vibration."""
    assert run(tmp_path, "options = { spin = 0.2 }\nspeed_rpm = 3000.0", (370.0, 380.0)) == 0
    ratio, text = said(capfd)
    assert ratio == 1.0
    assert "warning" not in text


@pytest.mark.parametrize(("modulus", "energies"), [(210e3, 1.0), (300e3, 0.7)])
def test_a_model_that_its_builder_reduced_is_compared_by_its_energy(
    modulus: float, energies: float, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """Its nodes have no forces of their own: which of the causes it is cannot be told."""
    assert run(tmp_path, f"options = {{ moduli = [{modulus}, {modulus}], modes = 6 }}", reduced=False) == 0
    ratio, text = said(capfd)
    assert ratio == pytest.approx(energies, abs=5e-5)
    assert ("warning: " in text) == (modulus != 210e3) == ("[material] is not that of K, or" in text)


LUMPED = """
from dataclasses import replace
import fretwave as fw, numpy as np, scipy.sparse as sp
def build():
    model = fw.read_model({path!r})
    return replace(model, M=sp.diags(np.asarray(model.M.sum(axis=1)).ravel()).tocsr())
"""


@pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX is not installed")
def test_cells_of_one_point_make_no_stress(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """C3D8R, one element over the height: the strain of its 8 nodes has 30 times the energy of its one point."""
    nodes, solids = mesh("hexahedron", (8, 2, 1), lambda u: u * [3.0, 2.0, 1.0])
    text = deck("C3D8R", nodes, solids, "*FREQUENCY, SOLVER=MATRIXSTORAGE\n3")
    (tmp_path / "bar.inp").write_text(text)
    subprocess.run(["ccx", "bar"], cwd=tmp_path, check=True, capture_output=True)
    words = [str(tmp_path / f"bar{end}") for end in (".mas", ".sti", ".inp")]
    given = ("--mass", words[0], "--stiffness", words[1], "--coordinates", words[2], "--name", f"tip={len(nodes)}z")
    assert call("import", tmp_path / "bar.h5", *given, "--units", "mm-t-s") == 0
    (tmp_path / "lumped.py").write_text(LUMPED.format(path=str(tmp_path / "bar.h5")))
    assert run_of(tmp_path, "lumped", "", (400.0, 500.0)) == 2
    text = capfd.readouterr().err
    assert "the stress of these cells is not that of the model's stiffness" in text
    assert re.search(r"measured: 3\d\.\d+ times the strain energy", text)
