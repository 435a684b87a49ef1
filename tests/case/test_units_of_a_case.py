"""`[model] units`: known systems, the model's own, and what contradicts it; and the symbols of each system."""

from __future__ import annotations

import re
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.sparse as sp
from command_line import call
from models.hexahedra import bar
from models.matrix_files import write_npz

import fretwave as fw
from fretwave.case.analysis_tables import Damper
from fretwave.case.load import load_case
from fretwave.case.schema import AerodynamicsSection, ModelSection, ReductionSection
from fretwave.columns import COLUMNS, ENERGY, MODAL_UNIT, columns_named, headings, name_of
from fretwave.errors import CaseErrors
from fretwave.post.contact_history import MOTION
from fretwave.registry import kinds
from fretwave.results.sweep_summary import columns_of
from fretwave.units import IN_LBF_S, MM_T_S, SI, SYSTEMS, quantity

pytestmark = pytest.mark.ranks(1)

ROOT = Path(__file__).parents[2]
CASE = """
[model]
{units}
dofs = ["m1"]
M = [[1.0]]
K = [[4.0]]

[[contact]]
law = "jenkins"
pairs = ["m1"]
tangential_stiffness = 5.0
friction_limit = 1.0

[[analysis]]
name = "mode"
type = "mode"
harmonics = 3
normalise = "m1"
amplitude = [0.1, 1.0]
"""
BUILDER = """
import fretwave as fw
def build():
    return fw.Structure([[1.0]], [[4.0]], names=["m1"], units={units!r})
"""


def write(folder: Path, units: str = "", text: str = CASE) -> Path:
    (folder / "case.toml").write_text(text.format(units=f'units = "{units}"' if units else ""))
    return folder / "case.toml"


@pytest.mark.parametrize(
    ("units", "expected"),
    [
        (SI, ("m", "kg", "N/m", "m/s", "m^3", "J", "1/Pa", "N s/m", "sqrt(kg) m", "kg/m^3")),
        (MM_T_S, ("mm", "t", "N/mm", "mm/s", "mm^3", "mJ", "1/MPa", "N s/mm", "sqrt(t) mm", "t/mm^3")),
        (
            IN_LBF_S,
            ("in", "lbf s^2/in", "lbf/in", "in/s", "in^3", "in lbf", "1/psi", "lbf s/in", "sqrt(lbf s^2/in) in"),
        ),
    ],
)
def test_labels_follow_from_quantities(units: fw.UnitSystem, expected: tuple[str, ...]) -> None:
    """SI's own symbols stand for them, in a user's plug-in; a label in symbols stays as it is."""
    given = ("length", "mass", "force/length", "length/s", "length^3", "energy", "1/pressure", "force s/length")
    given += ("sqrt(mass) length", "mass/length^3")
    for one, label in zip(given, expected):
        assert units(one) == label
        assert units(SI(one)) == label and quantity(SI(one)) == one
    for same in ("1", "-", "", "rad/s", "Hz", "rev/min", "s", "%"):
        assert units(same) == same


@pytest.mark.parametrize("units", SYSTEMS.values(), ids=SYSTEMS)
def test_systems_are_consistent(units: fw.UnitSystem) -> None:
    """Force, energy and pressure by their symbols are what the units of length and mass make of them."""
    newtons = {"N": 1.0, "mN": 1e-3, "lbf": 4.4482216152605}[units.force]
    pascals = {"Pa": 1.0, "MPa": 1e6, "kPa": 1e3, "psi": 6894.757293168}[units.pressure]
    joules = {"J": 1.0, "mJ": 1e-3, "µJ": 1e-6, "in lbf": 0.1129848290276167}[units.energy]
    force = units.kilograms * units.metres
    assert newtons == pytest.approx(force, rel=1e-12) and pascals == pytest.approx(force / units.metres**2, rel=1e-12)
    assert joules == pytest.approx(force * units.metres, rel=1e-12)
    assert units.cubic_millimetres == pytest.approx((units.metres / 1e-3) ** 3, rel=1e-14)


def test_headings_say_units_where_they_are_not_sis() -> None:
    for units, amplitude in ((SI, "amplitude"), (MM_T_S, "amplitude [mm]")):
        column, slip = columns_named(["amplitude", "slip"], units)
        assert (column.heading, slip.heading) == (amplitude, "slip") and name_of(amplitude) == "amplitude"
        assert column.attributes["units"] == units.length
    found = headings(["level", "quadrature_amplitude", "unknown"], MM_T_S, "sqrt(mass) length")
    assert found == {"level": "level", "quadrature_amplitude": "quadrature_amplitude [sqrt(t) mm]"}


def test_no_unit_is_written_in_code() -> None:
    """Docstrings and messages: files `units.py` alone have symbols (that of the importers has bounds in SI)."""
    symbol = r"(?:1/)?(?:m|N|J|Pa|kg|sqrt\(kg\))(?:\^?[23])?(?:[ /](?:m|s|N|Pa|kg)(?:\^?[23])?)*"
    literal = re.compile(rf"\[{symbol}\](?!\()|\}}\)? {symbol}[\s,;:.\")]")
    files = [
        *(ROOT / "python" / "fretwave").rglob("*.py"),
        *(ROOT / "src").rglob("*.cpp"),
        *(ROOT / "src").rglob("*.h"),
    ]
    assert len(files) > 300
    found = {
        f"{path.name}: {line.strip()}"
        for path in files
        if path.name != "units.py"
        for line in path.read_text().splitlines()
        if literal.search(line)
    }
    assert not found


def test_columns_keys_and_parameters_name_quantities() -> None:
    """In SI's symbols nothing would be another quantity: they are told in words."""
    given = [column.unit for column in COLUMNS.values()] + [MODAL_UNIT, ENERGY.unit]
    given += [unit for unit, *_ in MOTION.values()]
    given += [column.unit for kind in kinds() for column in columns_of(kind)]
    given += [parameter.unit for law in fw.laws().values() for parameter in law.parameters]
    for section in (ModelSection, ReductionSection, AerodynamicsSection, Damper, *kinds().values()):
        given += [(field.json_schema_extra or {}).get("unit") or "" for field in section.model_fields.values()]
    assert {"length", "force", "force/length", "length/s", "energy", "mass"} <= set(given)
    assert all(quantity(unit) == unit for unit in given)


def test_unknown_units_are_refused_with_the_known_ones(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert call("check", write(tmp_path, "mm-kg-ms")) == 2
    error = capsys.readouterr().err
    assert "unknown unit system" in error and "case.toml:3 (model.units)" in error and '"mm-kg-ms"' in error
    assert "m-kg-s, mm-t-s, mm-kg-s, in-lbf-s" in error and 'fix:      write for example "mm-t-s"' in error


def test_check_prints_the_units_and_its_messages_are_in_them(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert call("check", write(tmp_path, "mm-t-s")) == 0
    said = capsys.readouterr().out
    assert "units: mm-t-s (length mm, mass t, force N, energy mJ, pressure MPa, time s)" in said
    assert "a = 0.1 to 1 mm of m1" in said
    wrong = CASE.replace("friction_limit = 1.0", "").replace("amplitude = [0.1, 1.0]", "amplitude = [0.1]")
    assert call("check", write(tmp_path, "mm-t-s", wrong)) == 2
    error = capsys.readouterr().err
    assert "sliding force mu N [N]" in error and "first and last modal amplitude [mm, or sqrt(t) mm]" in error
    assert call("check", "--keys", write(tmp_path, "mm-t-s")) == 0
    assert "stiffness matrix, rows or a .npz/.mtx file [N/mm]" in capsys.readouterr().out
    assert call("check", "--keys") == 0
    said = capsys.readouterr().out
    assert "stiffness matrix, rows or a .npz/.mtx file [force/length]" in said and "unit system of all numbers" in said


def test_si_is_what_a_case_without_units_is_in(tmp_path: Path) -> None:
    """Said or not, it is the same case: runs of earlier versions go on."""
    plain, said = load_case(write(tmp_path)), load_case(write(tmp_path, "m-kg-s"))
    assert plain.units == said.units == SI and plain.digest == said.digest
    assert load_case(write(tmp_path, "mm-t-s")).digest != plain.digest


@pytest.mark.parametrize("own", ["mm-t-s", None, "furlong"])
def test_builder_and_case_agree(tmp_path: Path, own: str | None, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "model.py").write_text(BUILDER.format(units=own))
    text = CASE.replace('dofs = ["m1"]\nM = [[1.0]]\nK = [[4.0]]', 'builder = "model.py"')
    if own == "furlong":
        assert call("check", write(tmp_path, "", text)) == 2
        assert "its unit system 'furlong' is none of m-kg-s, mm-t-s" in capsys.readouterr().err
        return
    assert load_case(write(tmp_path, "", text)).units == SYSTEMS[own or "m-kg-s"]
    assert load_case(write(tmp_path, "mm-t-s", text)).units == MM_T_S
    if own is None:
        return
    assert call("check", write(tmp_path, "mm-kg-s", text)) == 2
    error = capsys.readouterr().err
    assert "the case and its builder declare different unit systems" in error and "case.toml:3 (model.units)" in error
    assert 'measured: units = "mm-kg-s"' in error and '"mm-t-s", as the builder says' in error and "fix:" in error


@pytest.fixture
def imported(tmp_path: Path) -> Path:
    """A titanium bar on soft ground in SI; its file says nothing of units."""
    made = bar((3, 1, 1), (0.06, 0.02, 0.01))
    K = sp.csr_matrix(made.K + 1e-3 * sp.diags(made.K.diagonal()))
    parts = [write_npz(tmp_path, A, letter, np.zeros(0)) for letter, A in (("M", made.M), ("K", K))]
    np.savez(tmp_path / "nodes.npz", coordinates=made.nodes)
    command = ["import", tmp_path / "bar.h5", "--mass", parts[0], "--stiffness", parts[1]]
    assert call(*command, "--coordinates", tmp_path / "nodes.npz") == 0
    return tmp_path / "bar.h5"


def of_file(folder: Path, units: str = "") -> Path:
    analysis = '[[analysis]]\nname = "mode"\ntype = "mode"\nharmonics = 1\nnormalise = "n1x"\namplitude = [0.1, 1.0]\n'
    return write(folder, units, '[model]\nfile = "bar.h5"\n{units}\n' + analysis)


def test_a_model_file_and_its_case_agree(imported: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = imported.parent
    capsys.readouterr()
    assert load_case(of_file(folder)).units == SI and not any(
        "units" in note for note in load_case(of_file(folder)).notes
    )
    with pytest.raises(CaseErrors, match="the numbers contradict the declared units"):
        load_case(of_file(folder, "mm-t-s"))
    with h5py.File(imported, "r+") as file:
        file.attrs["units"] = "kg, N, m"
    notes = load_case(of_file(folder)).notes
    assert "the model file's note on its units, 'kg, N, m', names no unit system: read as m-kg-s" in notes
    with h5py.File(imported, "r+") as file:
        file.attrs["units"] = "m-kg-s"
    assert load_case(of_file(folder)).units == SI
    assert call("check", of_file(folder, "mm-t-s")) == 2
    assert '"m-kg-s", as the model file says' in capsys.readouterr().err


def test_a_sweep_is_in_one_system(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Its tables would hold two: refused before anything runs."""
    command = ["sweep", write(tmp_path, "mm-t-s"), "--over", "model.units=mm-t-s,m-kg-s", "--out", tmp_path / "out"]
    assert call(*command) == 2
    error = capsys.readouterr().err
    assert "a sweep goes through several unit systems" in error and "measured: mm-t-s, m-kg-s" in error
    assert not (tmp_path / "out").exists()
