"""Wear of a travelling wave on one sector: before the first cycle it is the mode that it names, in every reader."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from command_line import call
from models import built_sector
from tolerances import LAST_DIGITS

from fretwave.case.load import load_case
from fretwave.errors import CaseErrors
from fretwave.results.reader import Run
from fretwave.run import left_out

pytestmark = pytest.mark.ranks(1)

CASE = """
[model]
builder = "model.py"
options = { sectors = 6, order = 1, on_face = false }

[reduction]
modes = 6
compare = 0

[material]
youngs_modulus = 210e9
poisson_ratio = 0.3

[[gauge]]
name = "rim"
point = [0.2, 0.0, 0.02]
direction = [0.0, 1.0, 0.0]

[[contact]]
name = "pads"
law = "coulomb_3d"
friction_coefficient = 0.3

[aerodynamics]
frequency = 2500.0
damping = { 1 = -0.02, -1 = 0.01 }

[[analysis]]
name = "mode"
type = "mode"
harmonics = 1
samples = 36
nodal_diameter = 1
aerodynamics = true
normalise = "tip"
amplitude = [1e-6, 2e-6]

[[analysis]]
name = "wear"
type = "wear"
mode = "mode"
amplitude = [1e-6]
cycles = 0.1
coefficient = 1e-13
cycle_unit = 1e6
"""


@pytest.mark.parametrize("wheel", ["", "wheel = true\n"])
def test_volumes_are_said_to_be_of_one_sector(wheel: str, tmp_path: Path) -> None:
    """Also where the mode is of the whole wheel: nothing told that its wear is not."""
    shutil.copy(built_sector.__file__, tmp_path / "model.py")
    (tmp_path / "case.toml").write_text(CASE.replace("nodal_diameter = 1\n", f"nodal_diameter = 1\n{wheel}"))
    case = load_case(tmp_path / "case.toml")
    mode, wear = (left_out._of_an_analysis(case, case.analyses[name]) for name in ("mode", "wear"))
    assert "5 of 6 sectors" in wear[0] and "worn volumes are of one" in wear[0]
    assert not wheel or not mode


@pytest.mark.parametrize("key", ["wheel = true", ""], ids=["wheel", "sector"])
def test_errors_without_the_reduction_s_are_told_as_such(key: str, tmp_path: Path, capfd) -> None:
    """A wheel's mode was told right to 1e-13 % where its sector's, of the same six component modes, is to 0.1 %."""
    shutil.copy(built_sector.__file__, tmp_path / "model.py")
    flow = "[aerodynamics]\nfrequency = 2500.0\ndamping = { 1 = -0.02, -1 = 0.01 }\n"
    text = CASE.replace(flow, "").replace("aerodynamics = true", key)
    (tmp_path / "case.toml").write_text(text)
    assert call("run", tmp_path / "case.toml", "--no-plots", "--out", tmp_path / "run") == 0
    mode, wear = (line for line in capfd.readouterr().out.splitlines() if "error of zeta up to" in line)
    assert ("without the reduction's, which is not known" in mode) == bool(key)
    assert "without the reduction's" not in wear
    assert call("show", tmp_path / "run") == 0
    shown = capfd.readouterr().out
    assert shown.count("% zeta without the reduction's") == bool(key)


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("wave")
    shutil.copy(built_sector.__file__, folder / "model.py")
    (folder / "case.toml").write_text(CASE)
    assert call("run", folder / "case.toml", "--no-plots", "--out", folder / "run") == 0
    return folder / "run"


def test_the_flow_acts_as_in_the_mode(run: Path) -> None:
    mode, wear = (Run(run)[name] for name in ("mode", "wear"))
    for column in ("omega", "zeta"):
        assert wear[column][0] == pytest.approx(mode[column][0], rel=LAST_DIGITS), column
    assert wear["zeta"][0] < -0.01, "fed by the flow"


@pytest.mark.parametrize("sector", [0, 1, 4])
def test_a_node_moves_as_in_the_mode_in_every_sector(run: Path, sector: int, tmp_path: Path) -> None:
    found = []
    for name in ("mode", "wear"):
        out = tmp_path / f"{name}.csv"
        words = ("--node", 12, "--sector", sector, "--at", "start", "--out", out)
        assert call("probe", run, "--analysis", name, *words) == 0
        found.append(np.genfromtxt(out, delimiter=",", skip_header=1))
    assert found[1] == pytest.approx(found[0], rel=1e-9)


def test_gauges_and_stress_are_those_of_the_mode(run: Path) -> None:
    assert call("stress", run) == 0
    mode, wear = (np.genfromtxt(run / f"{name}_gauges.csv", delimiter=",", names=True) for name in ("mode", "wear"))
    wear = np.atleast_1d(wear)
    for column in ("rim_strain", "worst_node", "stress_amplitude"):
        assert wear[column][0] == pytest.approx(mode[column][0], rel=1e-9), column


@pytest.mark.parametrize("how", ['wave = "standing"', "mistuning = { standard_deviation = 0.02 }"])
def test_a_wheel_whose_sectors_wear_differently_is_refused(run: Path, how: str) -> None:
    """The tuned wave of one sector was marched in its place."""
    path = run.parent / "whole.toml"
    path.write_text(CASE.replace("aerodynamics = true", f"wheel = true\n{how}"))
    with pytest.raises(CaseErrors) as found:
        load_case(path)
    assert "wear.mode moves the sectors of a wheel differently" in str(found.value)
    path.write_text(CASE.replace("aerodynamics = true", "wheel = true"))
    load_case(path)
