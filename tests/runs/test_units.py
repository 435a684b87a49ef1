"""One joint in SI and in mm-t-s: the same numbers after conversion, and every label in its own system."""

from __future__ import annotations

import csv
from pathlib import Path

import h5py
import numpy as np
import pytest
from command_line import call
from models.joint_in_units import SCALES, write_case
from tolerances import SOLVED

import fretwave as fw
from fretwave.plots import families
from fretwave.results.reader import Run
from fretwave.units import SI, SYSTEMS

pytestmark = pytest.mark.ranks(1)

#: What rounding leaves, and time: numbers that no two runs share.
CHANCE = ("wall_s", "cpu_s", "residual", "rounding", "unclosed", "energy_error", "force_outside", "linear")
#: Newton's steps where the residual is per sqrt(mass), or of all points together.
COUNTS = (("coordinate", "newton"), ("over_friction_summary", "newton"))
#: Errors, which are differences of two solutions, by what they are errors of.
ERRORS_OF = {"lambda": "omega", "omega": "omega", "amplitude": "amplitude", "zeta": "zeta"}
#: Whose error estimates have more unknowns than the direct route takes.
BY_GMRES = ("coordinate", "forced", "forced_peaks")
TABLES = ("rest", "mode", "coordinate", "forced", "forced_peaks", "wear", "over_friction", "over_friction_summary")


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    base, found = tmp_path_factory.mktemp("units"), {}
    for system in SCALES:
        case = write_case(base / system, system)
        found[system] = base / system / "run"
        assert call("run", case, "--out", found[system], "--no-plots") == 0
    return found


def label(unit: str) -> str:
    """In mm-t-s what SI calls so."""
    return SYSTEMS["mm-t-s"](unit)


def heading(name: str) -> tuple[str, str]:
    """Name and unit of a column of a CSV."""
    text, _, unit = name.partition(" [")
    return text, unit.rstrip("]")


def table(path: Path) -> dict[str, list[str]]:
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    return {name: [row[name] for row in rows] for name in rows[0]}


def tolerance(name: str, columns: dict[str, np.ndarray], table: str) -> float | np.ndarray:
    """Of a column: a share of its largest number, of an error a share of what it is the error of.

    Errors that GMRES solves for are estimated to 1 % (`-fw_error_tolerance`).
    """
    of = next((key for part, key in ERRORS_OF.items() if name.startswith(f"{part}_error")), name)
    least = SOLVED * float(np.nanmax(np.abs(columns[of]), initial=0.0))
    return least if of == name or table not in BY_GMRES else np.maximum(least, 0.01 * np.abs(columns[name]))


def at_rounding(table: dict[str, list[str]]) -> np.ndarray:
    """Rows whose residual is within a factor of 2 of what rounding leaves, as far as a table says."""
    residual = np.maximum(np.array(table["residual"], dtype=float), 1e-300)
    rounding = np.array(table.get("rounding", np.ones(residual.size)), dtype=float)
    return np.asarray(np.abs(np.log2(residual / rounding)) < 1)


@pytest.mark.parametrize("name", TABLES)
def test_tables_are_the_same_after_conversion_and_say_their_units(runs: dict[str, Path], name: str) -> None:
    si, mm = (table(runs[system] / f"{name}.csv") for system in SCALES)
    units = dict(map(heading, mm))
    assert list(units) == list(si), "SI has the names alone"
    numbers = {
        key: np.array(column, dtype=float) for key, column in si.items() if key not in ("event", "contact", "status")
    }
    for (key, there), column in zip(units.items(), mm.values()):
        if key not in numbers:
            assert column == si[key]
        elif key not in CHANCE and (name, key) not in COUNTS:
            factor = SCALES["mm-t-s"].of(there)
            found = factor * np.array(column, dtype=float)
            allowed = tolerance(key, numbers, name)
            if key == "newton":  # whether a guess needs no step at all, or one more at rounding level, rounding decides
                allowed = ((np.minimum(found, numbers[key]) == 0) | at_rounding(si) | at_rounding(mm)).astype(float)
            assert np.isclose(found, numbers[key], rtol=0, atol=allowed, equal_nan=True).all(), key
    lengths = {key for key, unit in units.items() if unit in ("mm", "sqrt(t) mm")}
    assert lengths
    assert units.get("amplitude", "mm") == ("sqrt(t) mm" if name == "coordinate" else "mm")


def test_every_array_of_the_results_is_the_same_after_conversion(runs: dict[str, Path]) -> None:
    """Coefficients, fields, motions of the contacts, summaries: with the unit that the attribute says."""
    with h5py.File(runs["m-kg-s"] / "results.h5") as si, h5py.File(runs["mm-t-s"] / "results.h5") as mm:
        assert mm.attrs["unit_system"] == "mm-t-s" and si.attrs["unit_system"] == "m-kg-s"
        compared: set[str] = set()

        def compare(name: str, here: h5py.Dataset | h5py.Group) -> None:
            if not isinstance(here, h5py.Dataset) or here.dtype.kind != "f" or "units" not in here.attrs:
                return
            last, there = name.rpartition("/")[2], mm[name]
            assert there.attrs["units"] == label(here.attrs["units"]), name
            if last in (*CHANCE, "newton", "slopes") or "_error" in last:
                return
            x, y = here[()], SCALES["mm-t-s"].of(there.attrs["units"]) * there[()]
            scale = float(np.nanmax(np.abs(x), initial=0.0)) if np.isfinite(x).any() else 0.0
            np.testing.assert_allclose(y, x, rtol=0, atol=SOLVED * scale, err_msg=name)
            compared.add(str(there.attrs["units"]))

        si.visititems(compare)
        assert {"mm", "mm/s", "mm^2", "mm^3", "N", "mJ", "sqrt(t) mm", "Hz", "1/s", "1"} <= compared


def texts(folder: Path) -> list[str]:
    """All that stands on the axes and in the legends of all pictures."""
    run, found = Run(folder), []
    for _, figures in families():
        for _, figure in figures(run):
            found += [text.get_text() for axes in figure.axes for text in (axes.xaxis.label, axes.yaxis.label)]
            found += [axes.get_title(loc=place) for axes in figure.axes for place in ("left", "center")]
            found += [text.get_text() for legend in figure.legends for text in legend.get_texts()]
            found += [text.get_text() for text in figure.texts]
    return found


def test_pictures_are_labelled_in_their_own_system(runs: dict[str, Path]) -> None:
    """What takes a prefix is the same in both; modal coordinates and what follows from pressure are not."""
    si, mm = (texts(runs[system]) for system in SCALES)
    assert len(si) == len(mm)
    differ = {(here, there) for here, there in zip(si, mm) if here != there}
    shared = {here for here, there in zip(si, mm) if here == there}
    assert ("Modal amplitude of mode 1 [sqrt(kg) m]", "Modal amplitude of mode 1 [sqrt(t) mm]") in differ
    assert {"Modal amplitude of tip [µm]", "Amplitude of tip [µm]"} <= shared
    assert any("1/Pa" in here and "1/MPa" in there for here, there in differ)
    assert {"Worn depth [µm]", "Worn volume [mm³]", "Along the face [mm]", "Normal force [N]"} <= shared
    assert not any("[m]" in there or "Pa" in there.replace("MPa", "") for there in mm)


def test_messages_tell_units(runs: dict[str, Path], capsys: pytest.CaptureFixture[str]) -> None:
    """The log, show and view: 2.5 µm of tip, worn volumes in mm^3, mm-t-s in the file for ParaView."""
    log = (runs["mm-t-s"] / "run.log").read_text()
    assert "a = 0.0025 mm" in log and "mm^3" in log and "1.606e-06 m " not in log and " m " not in log
    shown = {}
    for system, folder in runs.items():
        assert call("show", folder) == 0
        shown[system] = capsys.readouterr().out
        assert call("view", folder, "--analysis", "wear", "--out", folder / "wear.vtkhdf") == 0
        assert f"units: {system}" in capsys.readouterr().out
        with h5py.File(folder / "wear.vtkhdf") as file:
            assert file.attrs["unit_system"] == system
    worn = [
        line[line.index("worn ") :].split()[:3]
        for text in shown.values()
        for line in text.splitlines()
        if "worn" in line
    ]
    assert worn[0] == worn[1] and worn[0][2] == "mm^3"
    assert "2e-07 - 4e-06 m" in shown["m-kg-s"] and "0.0002 - 0.004 mm" in shown["mm-t-s"]
    assert call("view", runs["mm-t-s"], "--analysis", "wear", "--amplitude", "1.0") == 2
    assert "1 mm" in capsys.readouterr().err


def test_a_run_of_another_system_is_another_case(runs: dict[str, Path], capsys: pytest.CaptureFixture[str]) -> None:
    folder = runs["mm-t-s"]
    case = folder.parent / "case.toml"
    text = case.read_text()
    case.write_text(text.replace('units = "mm-t-s"', 'units = "mm-kg-s"'))
    try:
        assert call("resume", folder) == 2
        assert 'model.units: "mm-t-s" then, "mm-kg-s" now' in capsys.readouterr().err
    finally:
        case.write_text(text)


def test_a_study_of_wear_is_in_cubic_millimetres(runs: dict[str, Path], tmp_path: Path) -> None:
    """Whatever the system is: the same column has the same numbers."""
    worn = []
    for system, folder in runs.items():
        out = tmp_path / system
        case = folder.parent / "case.toml"
        assert call("study", case, "--analysis", "wear", "--tolerance", "1e-1,1e-2", "--out", out) == 0
        assert f" {SYSTEMS[system].length}, " in (out / "study.md").read_text()
        worn.append(np.array(table(out / "study.csv")["worn_mm3"], dtype=float))
    np.testing.assert_allclose(worn[1], worn[0], rtol=SOLVED)


def test_a_builder_says_its_units(tmp_path: Path) -> None:
    assert (
        call("run", write_case(tmp_path / "own", "mm-t-s", declares=True), "--only", "rest", "--out", tmp_path / "r")
        == 0
    )
    assert "normal_force [N]" in table(tmp_path / "r" / "rest.csv")
    assert Run(tmp_path / "r")["rest"].unit("gap") == "mm"


def test_results_of_earlier_versions_are_in_si(runs: dict[str, Path], tmp_path: Path) -> None:
    """They name no system: the same file without the attribute."""
    copy = tmp_path / "results.h5"
    with h5py.File(runs["m-kg-s"] / "results.h5") as old, h5py.File(copy, "w") as new:
        old.copy("mode", new)
        assert new["mode"].attrs.pop("unit_system") == "m-kg-s"
    mode = Run(tmp_path)["mode"]
    assert mode.unit_system == SI and mode.length_unit() == "m" and mode.curve().units["amplitude"] == "m"


def test_a_script_says_its_units(tmp_path: Path) -> None:
    """Of the model: branches carry them into tables, files and back."""
    slider = fw.Contact("jenkins", [[1.0]], {"tangential_stiffness": 5e-3, "friction_limit": 1.0})
    with fw.Model([[1e-3]], [[4e-3]], contacts=[slider], units="mm-t-s") as model:
        mode = fw.NonlinearMode(model, fw.choose_harmonics(model, 1))
        branch = fw.follow(mode, 100.0, 4000.0, observe={"energy_of_all": "energy"})
        assert branch.at(150.0)["omega"] == pytest.approx([3.0], abs=5e-3)
    assert (branch.units["amplitude"], branch.units["unclosed"], branch.units["energy_of_all"]) == ("mm", "mm", "mJ")
    branch.to_csv(tmp_path / "branch.csv")
    assert {"amplitude [mm]", "zeta", "energy_of_all [mJ]"} <= set(table(tmp_path / "branch.csv"))
    branch.save(tmp_path / "branch.h5")
    loaded = fw.Branch.load(tmp_path / "branch.h5")
    assert loaded.units == branch.units and loaded.unit_system.name == "mm-t-s"
    assert branch.plot().axes[1].get_xlabel() == "Amplitude [m]"  # from 0.1 to 4 m
