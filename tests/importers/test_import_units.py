"""``fretwave import --units``: kept in the model file, and refused where the numbers say otherwise."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp
from command_line import call
from models.hexahedra import bar
from models.matrix_files import write_npz

import fretwave as fw
from fretwave.importers.nodes import Material, read_nodes
from fretwave.importers.units import DENSITY_OF_BOX, SPEED, Evidence, Number, check_declared, evidence_of
from fretwave.results import model_file
from fretwave.units import SYSTEMS

pytestmark = pytest.mark.ranks(1)

BAR = bar((3, 1, 1), (0.06, 0.02, 0.01))
HELD = sp.csr_matrix(BAR.K + 1e-3 * sp.diags(BAR.K.diagonal()))


def matrices(folder: Path, system: str, materials: str = "") -> list[object]:
    """A titanium bar on soft ground in a system: the command that imports it, with a deck of nodes and materials."""
    units = SYSTEMS[system]
    M, K, nodes = BAR.M / units.kilograms, HELD / units.kilograms, BAR.nodes / units.metres
    parts = [write_npz(folder, A, letter, np.zeros(0)) for letter, A in (("M", M), ("K", K))]
    lines = "\n".join(f"{k}, {x:.9g}, {y:.9g}, {z:.9g}" for k, (x, y, z) in enumerate(nodes, 1))
    (folder / "bar.inp").write_text(f"*NODE\n{lines}\n{materials}")
    return [
        "import",
        folder / "bar.h5",
        "--mass",
        parts[0],
        "--stiffness",
        parts[1],
        "--coordinates",
        folder / "bar.inp",
    ]


TITANIUM_MM = "*MATERIAL, NAME=TI\n*ELASTIC\n114000., 0.32\n*DENSITY\n4.43e-9,\n"
IN_SI = TITANIUM_MM.replace("114000.", "1.14e11").replace("4.43e-9", "4430.")


@pytest.mark.parametrize("system", SYSTEMS)
def test_declared_units_are_kept_and_told(tmp_path: Path, system: str, capfd: pytest.CaptureFixture[str]) -> None:
    assert call(*matrices(tmp_path, system), "--units", system) == 0
    said = capfd.readouterr().out
    mass = 4430.0 * 0.06 * 0.02 * 0.01 / SYSTEMS[system].kilograms
    assert f"units: {system}\n" in said and "warning" not in said and "first frequencies [Hz]" in said
    assert f"{mass:.6g} along z [{SYSTEMS[system].mass}]" in said
    assert f"units: like {system} for a solid" in said
    assert fw.read_model(tmp_path / "bar.h5").units == system
    assert model_file.read_sources(tmp_path / "bar.h5")[0] == system


@pytest.mark.parametrize("declared", SYSTEMS)
@pytest.mark.parametrize("given", SYSTEMS)
def test_contradicted_units_are_refused(
    tmp_path: Path, given: str, declared: str, capfd: pytest.CaptureFixture[str]
) -> None:
    """Of all pairs of systems; what is refused writes nothing, and its fix is taken."""
    code = call(*matrices(tmp_path, given), "--units", declared)
    assert code == (0 if given == declared else 2)
    assert (tmp_path / "bar.h5").exists() == (given == declared)
    if code:
        error = capfd.readouterr().err
        assert "the numbers contradict the declared units" in error and f"where:    --units {declared}" in error
        assert "measured: speed of sound about" in error and f"which in {declared} are" in error
        assert (
            "expected: a solid's 500 to 50000 m/s, 40 to 20000 kg/m^3" in error
            and f"fix:      --units {given}\n" in error
        )


def test_materials_of_the_deck_tell_units(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """Against the units that are declared: with the line of the deck."""
    materials = read_deck(tmp_path, TITANIUM_MM)
    assert [(one.name, one.modulus, one.density) for one in materials] == [("TI", 114000.0, 4.43e-9)]
    command = matrices(tmp_path, "mm-t-s", TITANIUM_MM)
    assert call(*command, "--units", "m-kg-s") == 2
    error = capfd.readouterr().err
    assert "Young's modulus 1.14e+05, density 4.43e-09 of TI, which in m-kg-s are 1.14e+05 Pa, 4.43e-09 kg/m^3" in error
    assert f"bar.inp:{1 + len(BAR.nodes) + 5}" in error and "fix:      --units mm-t-s" in error
    assert call(*command, "--units", "mm-t-s") == 0


def read_deck(folder: Path, materials: str) -> list[Material]:
    matrices(folder, "mm-t-s", materials)
    return read_nodes(folder / "bar.inp").materials


@pytest.mark.parametrize(
    ("modulus", "density", "fits"),
    [
        (2.1e11, 7850.0, "m-kg-s"),
        (2.1e5, 7.85e-9, "mm-t-s"),
        (2.1e8, 7.85e-6, "mm-kg-s"),
        (3.05e7, 7.35e-4, "in-lbf-s"),
        (4.1e11, 19300.0, "m-kg-s"),
        (1.0e3, 1.1e-9, "mm-t-s"),
        (5.0, 1.1e-9, ""),
        (2.1e11, None, "m-kg-s"),
        (None, 7.85e-9, "mm-t-s"),
    ],
)
def test_solids_fit_one_system(modulus: float | None, density: float | None, fits: str) -> None:
    """Steel, tungsten, a polymer; rubber (5 MPa) is in no window, so that nothing is refused for it."""
    nothing = fw.Structure([[1.0]], [[1.0]])
    (evidence,) = evidence_of(nothing, [Material("a material", "", modulus, density)])
    assert evidence.fits == ((fits,) if fits else ())


def test_the_matrices_are_the_model(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """A deck's materials in other units are no reason to read the matrices in theirs: refused, or a warning."""
    command = matrices(tmp_path, "mm-t-s", IN_SI)
    assert call(*command, "--units", "m-kg-s") == 2
    said = capfd.readouterr().err
    assert "measured: speed of sound about" in said and "which in m-kg-s are" in said
    assert "fix:      --units mm-t-s, or export deck and matrices from one model: Young's modulus 1.14e+11" in said
    assert not (tmp_path / "bar.h5").exists()
    for units in (["--units", "mm-t-s"], []):
        assert call(*command, *units) == 0
        said = capfd.readouterr().out
        assert "of TI is like m-kg-s, the matrices like mm-t-s: are deck and matrices of one model?" in said
        assert ("give --units mm-t-s" in said) == (not units) and "give --units m-kg-s" not in said


@pytest.mark.parametrize("declared", ["mm-t-s", "m-kg-s"])
def test_a_deck_in_millimetres_beside_matrices_in_si(
    tmp_path: Path, declared: str, capfd: pytest.CaptureFixture[str]
) -> None:
    """K in N/m and M in kg are kg/s^2 and kg: with millimetres those of mm-kg-s, which is taken."""
    command, mm = matrices(tmp_path, "m-kg-s"), BAR.nodes * 1e3
    lines = "\n".join(f"{k}, {x:.9g}, {y:.9g}, {z:.9g}" for k, (x, y, z) in enumerate(mm, 1))
    (tmp_path / "bar.inp").write_text(f"*NODE\n{lines}\n{TITANIUM_MM}")
    assert call(*command, "--units", declared) == 2
    said = capfd.readouterr().err
    assert "fix:      --units mm-kg-s, or export deck and matrices from one model" in said and "like mm-t-s" in said
    assert call(*command, "--units", "mm-kg-s") == 0


@pytest.mark.parametrize("materials", [TITANIUM_MM, ""])
def test_coordinates_in_other_units_than_the_matrices(
    tmp_path: Path, materials: str, capfd: pytest.CaptureFixture[str]
) -> None:
    command = matrices(tmp_path, "mm-t-s")
    lines = "\n".join(f"{k}, {x:.9g}, {y:.9g}, {z:.9g}" for k, (x, y, z) in enumerate(BAR.nodes, 1))
    (tmp_path / "bar.inp").write_text(f"*NODE\n{lines}\n{materials}")
    assert call(*command, "--units", "mm-t-s") == 0
    said = capfd.readouterr().out
    assert "the coordinates seem not to be the model's, but in m beside matrices like mm-t-s" in said
    assert "is M in the units of K" not in said


def test_a_frame_that_hardly_fills_its_box() -> None:
    """10 kg/m^3 of its box in mm-kg-s is 1e4 in mm-t-s: with its material it is not refused."""
    numbers = [Number("speed", 5e6, "m/s", SPEED), Number("density", 1e-8, "kg/m^3", DENSITY_OF_BOX, at_least=True)]
    frame = Evidence(numbers, "by mass, stiffness and size", of_model=True)
    (steel,) = evidence_of(fw.Structure([[1.0]], [[1.0]]), [Material("STEEL", "", 2.1e8, 7.85e-6)])
    assert frame.fits == ("mm-t-s",) and steel.fits == ("mm-kg-s",)
    check_declared("mm-kg-s", [steel, frame], "", str)
    with pytest.raises(fw.InputError, match="contradict"):
        check_declared("m-kg-s", [steel, frame], "", str)


def test_without_evidence_nothing_is_said(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    command = matrices(tmp_path, "mm-t-s")
    assert call(*command[:6], "--units", "m-kg-s") == 0
    assert "warning" not in capfd.readouterr().out


def test_without_units_it_warns(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """A model in millimetres is read as SI: the import says so, and so does the case."""
    assert call(*matrices(tmp_path, "mm-t-s")) == 0
    said = capfd.readouterr().out
    assert "units: not declared, read as m-kg-s" in said and "first frequencies [1/time]" in said
    assert "warning: units: read as m-kg-s, for none is declared, but like mm-t-s: give --units mm-t-s" in said
    (tmp_path / "case.toml").write_text(
        '[model]\nfile = "bar.h5"\n[[analysis]]\nname = "mode"\ntype = "mode"\nharmonics = 1\nnormalise = "n1x"\n'
        "amplitude = [0.1, 1.0]\n"
    )
    assert fw.load_case(tmp_path / "case.toml").notes[0].startswith("units: read as m-kg-s, but like mm-t-s")


def test_unknown_units_are_refused(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert call(*matrices(tmp_path, "mm-t-s"), "--units", "kg, N, m") == 2
    error = capfd.readouterr().err
    assert "unknown unit system" in error and "--units" in error and ", ".join(SYSTEMS) in error
    with pytest.raises(fw.InputError, match="unknown unit system"):
        fw.write_model(tmp_path / "bar.h5", fw.Structure([[1.0]], [[4.0]]), units="kg, N, m")
