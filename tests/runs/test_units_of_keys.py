"""Keys that a sweep goes through have units in tables, pictures and texts, as all other columns have."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import h5py
import pytest
from command_line import call
from models.joint_in_units import SCALES, write_case

from fretwave.case.key_units import key_units
from fretwave.case.toml.source import Source
from fretwave.model.laws import laws
from fretwave.plots import families
from fretwave.results.reader import Run
from fretwave.units import MM_T_S, SI

pytestmark = pytest.mark.ranks(1)

CASE = """
[model]
dofs = ["m1"]

[[contact]]
name = "pad"
law = "coulomb_3d"

[[contact]]
name = "slider"
law = "jenkins"

[[analysis]]
name = "mode"
type = "mode"
dampers = [{ dof = "m1", c = 0.1 }]

[[analysis]]
name = "forced"
type = "forced"
"""
#: In quantities as a text book has them; None where there is none, or where the value says of which it is.
KEYS = {
    "contact.slider.friction_limit": "N",
    "contact.slider.tangential_stiffness": "N/mm",
    "contact.slider.tangential_stiffness_per_area": "MPa/mm",
    "contact.slider.friction_limit_per_area": "MPa",
    "contact.pad.friction_coefficient": None,
    "contact.pad.gap": "mm",
    "contact.pad.law": None,
    "contact.pad.friction_coefficient_per_area": None,
    "contact.pad.load_rpm": "rev/min",
    "model.speed_rpm": "rev/min",
    "model.mass_damping": "1/s",
    "model.K.0.0": "N/mm",
    "model.options.friction": None,
    "material.youngs_modulus": "MPa",
    "damping.zeta": None,
    "reduction.up_to_hz": "Hz",
    "title": None,
    "mode.harmonics": None,
    "mode.amplitude": None,
    "mode.dampers.0.c": "N s/mm",
    "analysis.mode.dampers.0.dof": None,
    "forced.force.m1": "N",
    "forced.frequency": "Hz",
    "forced.levels": None,
}


def test_every_kind_of_key_has_the_unit_of_its_quantity(tmp_path: Path) -> None:
    (tmp_path / "case.toml").write_text(CASE, encoding="utf-8")
    source = Source(tmp_path / "case.toml")
    assert key_units(source, KEYS, laws(), MM_T_S) == {key: unit for key, unit in KEYS.items() if unit}
    in_si = key_units(source, KEYS, laws(), SI)
    assert in_si["contact.slider.tangential_stiffness_per_area"] == "Pa/m" and in_si["mode.dampers.0.c"] == "N s/m"


STIFFNESS = "contact.pads.tangential_stiffness_per_area"


@pytest.fixture(scope="module", params=SCALES)
def swept(request, tmp_path_factory) -> tuple[str, Path]:
    """Over the stiffness of the pads and the number of harmonics."""
    folder = tmp_path_factory.mktemp("keys")
    case, s = write_case(folder / "case", request.param), SCALES[request.param]
    values = ",".join(f"{factor * s.stiffness / s.length**2:.17g}" for factor in (1e10, 1.5e10, 2e10))
    words = ["--only", "mode", "--over", f"{STIFFNESS}={values}", "--over", "mode.harmonics=1,3", "--no-plots"]
    assert call("sweep", case, "--set", "mode.samples=32", *words, "--out", folder / "run") == 0
    return request.param, folder / "run"


def test_a_swept_key_has_its_unit_wherever_it_stands(swept: tuple[str, Path], capsys) -> None:
    """All these were without one."""
    system, folder = swept
    unit = {"m-kg-s": "Pa/m", "mm-t-s": "MPa/mm"}[system]
    for name in ("mode.csv", "summary.csv"):
        with (folder / name).open(newline="") as file:
            heads = next(csv.reader(file))
        assert (STIFFNESS if system == "m-kg-s" else f"{STIFFNESS} [{unit}]") in heads and "mode.harmonics" in heads
    with h5py.File(folder / "results.h5") as file:
        for place in ("points", "over", "summary"):
            assert file[f"mode/{place}/{STIFFNESS}"].attrs["units"] == unit
        assert json.loads(file["mode"].attrs["over"]).keys() == {STIFFNESS, "mode.harmonics"}
    capsys.readouterr()
    assert call("show", folder) == 0
    assert f" {unit}, harmonics = 3: " in capsys.readouterr().out


def test_pictures_of_a_swept_key_have_its_unit(swept: tuple[str, Path]) -> None:
    unit = {"m-kg-s": "Pa/m", "mm-t-s": "MPa/mm"}[swept[0]]
    found = [figure for _, figures in families() for _, figure in figures(Run(swept[1]))]
    axes = [plane.get_xlabel() for figure in found for plane in figure.axes]
    assert f"tangential stiffness per area [{unit}]" in axes
    names = [text.get_text() for figure in found for legend in figure.legends for text in legend.get_texts()]
    names += [t.get_text() for f in found for p in f.axes if p.get_legend() for t in p.get_legend().get_texts()]
    told = [name for name in names if name.startswith("tangential_stiffness_per_area = ")]
    assert len(told) == 3 and all(name.endswith(f" {unit}") for name in told)
    assert "harmonics = 3" in names


def test_a_key_that_texts_are_given_has_no_unit(tmp_path: Path, capsys) -> None:
    """It was told "stiffness.csv" N/m."""
    case = tmp_path / "case.toml"
    case.write_text(
        "[model]\ndofs = ['a', 'b']\nM = [[1.0, 0.0], [0.0, 1.0]]\nK = [[2.0, -1.0], [-1.0, 2.0]]\n[[contact]]\n"
        "name = 'pads'\nlaw = 'jenkins'\npairs = ['a', 'b']\ntangential_stiffness = 1.0\nfriction_limit = 1.0\n"
        "[[analysis]]\nname = 'linear'\ntype = 'linear'\nmodes = 2\n",
        encoding="utf-8",
    )
    for name, values in (("one", (0.5, 0.6)), ("two", (0.7, 0.8))):
        rows = "".join(f"{pair},{value}\n" for pair, value in enumerate(values))
        (tmp_path / f"{name}.csv").write_text(f"pair,tangential_stiffness [N/m]\n{rows}", encoding="utf-8")
    key = "contact.pads.tangential_stiffness"
    words = ["--over", f'{key}="one.csv","two.csv"', "--no-plots", "--out", tmp_path / "run"]
    assert call("sweep", case, *words) == 0
    capsys.readouterr()
    assert call("show", tmp_path / "run") == 0
    said = capsys.readouterr().out
    assert 'tangential_stiffness = "two.csv"' in said and '.csv" N' not in said
