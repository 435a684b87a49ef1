"""`fretwave stress`: gauges of a cantilever against beam theory, Goodman's amplitude, what is refused."""

from __future__ import annotations

import os
import re
import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
from command_line import call
from models import cantilever
from models.cantilever import HEIGHT, LENGTH, STEEL
from models.csv_columns import table
from tolerances import ROUNDING, SOLVED

from fretwave.plots import plot_run
from fretwave.report.report import report_text

pytestmark = pytest.mark.ranks(1)
pytest.importorskip("skfem")

CASE = """
title = "Cantilever with gauges"

[model]
builder = "cantilever.py"

[reduction]
modes = 16

[[contact]]
name = "slider"
law = "jenkins"
tangential_stiffness = 1e-3
friction_limit = 1e9
"""
MATERIAL = """
[material]
youngs_modulus = 210e3
poisson_ratio = 0.3
endurance_limit = 250.0
ultimate_strength = 600.0
"""
GAUGES = """
[[gauge]]
name = "root"
point = [60.0, 0.0, 1.5]
direction = [2.0, 0.0, 0.0]

[[gauge]]
name = "across"
point = [60.0, 0.0, 1.5]
direction = [0.0, 1.0, 0.0]
"""
MODE = """
[[analysis]]
name = "mode"
type = "mode"
method = "EPMC"
harmonics = 3
samples = 64
normalise = "tip"
amplitude = [0.1, 40.0]
"""
LINEAR = """
[[analysis]]
name = "linear"
type = "linear"
modes = 2
"""
FORCED = """
[[analysis]]
name = "forced"
type = "forced"
harmonics = 1
samples = 64
observe = "tip"
force = { tip = 0.1 }
frequency = [27.3, 28.4]
levels = [0.5, 1.0, 4.0]
"""


def solved(folder: Path, text: str, *words: str) -> Path:
    """Folder of a run of a case beside its builder."""
    shutil.copy(cantilever.__file__, folder / "cantilever.py")
    (folder / "case.toml").write_text(text)
    assert call("run", folder / "case.toml", "--no-plots", "-q", "--out", folder / "run", *words) == 0
    return folder / "run"


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> Path:
    damped = CASE.replace('"cantilever.py"', '"cantilever.py"\nmass_damping = 6.0')
    folder = solved(tmp_path_factory.mktemp("stress"), damped + MATERIAL + GAUGES + MODE + FORCED)
    assert call("stress", folder) == 0
    return folder


def curvature(x: float) -> float:
    """Of the first mode of a cantilever with a tip displacement of 1, at a share of its length (Euler, Bernoulli)."""
    beta = 1.8751040687119611
    sigma = (np.cosh(beta) + np.cos(beta)) / (np.sinh(beta) + np.sin(beta))
    tip = np.cosh(beta) - np.cos(beta) - sigma * (np.sinh(beta) - np.sin(beta))
    bent = np.cosh(beta * x) + np.cos(beta * x) - sigma * (np.sinh(beta * x) + np.sin(beta * x))
    return float((beta / LENGTH) ** 2 * bent / tip)


def test_a_level_below_the_lowest_is_said(tmp_path: Path, capfd) -> None:
    """The lowest level breaks the beam: the force that it bears is below, and no level between two is."""
    damped = CASE.replace('"cantilever.py"', '"cantilever.py"\nmass_damping = 6.0')
    levels = FORCED.replace("[0.5, 1.0, 4.0]", "[40.0, 80.0]")
    folder = solved(tmp_path, damped + MATERIAL + levels)
    capfd.readouterr()
    assert call("stress", folder) == 0
    found = table(folder / "forced_goodman.csv")
    assert (found["largest_goodman"] > 1).all() and np.isnan(found["limit_level"]).all()
    assert "Goodman factor 1 below level 40 of the force, the lowest" in capfd.readouterr().out


def test_a_level_that_is_largest_at_an_end_of_the_range_has_no_peak(run: Path, tmp_path: Path, capfd) -> None:
    """Below its resonance at 27.8 Hz a beam that breaks there was told not to reach the limit, without a word."""
    damped = CASE.replace('"cantilever.py"', '"cantilever.py"\nmass_damping = 6.0')
    beside = FORCED.replace("[27.3, 28.4]", "[26.0, 27.0]").replace("[0.5, 1.0, 4.0]", "[1.0, 20.0]")
    folder = solved(tmp_path, damped + MATERIAL + beside)
    capfd.readouterr()
    assert call("stress", folder) == 0
    printed, found = capfd.readouterr().out, table(folder / "forced_goodman.csv")
    assert found["reached"].tolist() == ["no", "before its first point"]
    assert found["peak_within"].tolist() == [0, 0]
    assert printed.count("(at an end of the frequency range: the peak is beyond)") == 2
    assert re.search(r"1 at level [\d.]+ of the force, or lower: peaks are beyond the frequency range", printed)
    assert table(run / "forced_goodman.csv")["peak_within"].tolist() == [1, 1, 1]


def test_a_gauge_reads_the_strain_of_a_beam(run: Path) -> None:
    found = table(run / "mode_gauges.csv")
    wanted = curvature(0.2) * HEIGHT / 2 * found["amplitude"]
    np.testing.assert_allclose(found["root_strain"], wanted, rtol=5e-3)
    np.testing.assert_allclose(found["across_strain"], 0.3 * wanted, rtol=1e-2)
    assert np.ptp(found["root_strain"] / found["amplitude"]) < SOLVED * found["root_strain"][0]
    assert abs(found["root_mean"]).max() == 0
    forced = table(run / "forced_gauges.csv")
    top = np.argmax(forced["amplitude"])  # in resonance it is the mode
    assert forced["root_strain"][top] / forced["amplitude"][top] == pytest.approx(
        wanted[0] / found["amplitude"][0], rel=5e-3
    )


def test_shapes_of_linear_modes_are_no_motion_to_look_at_first(tmp_path: Path, capfd) -> None:
    """They come first in the case, at the amplitude of a unit modal mass: no stress of the structure, no default."""
    folder = solved(tmp_path, CASE + MATERIAL + GAUGES + LINEAR + MODE.replace("40.0", "0.2"))
    assert call("stress", folder) == 0
    assert (folder / "mode_gauges.csv").exists() and not (folder / "linear_gauges.csv").exists()
    capfd.readouterr()
    assert call("stress", folder, "--analysis", "linear") == 2
    assert "--analysis mode" in capfd.readouterr().err.rpartition("fix:")[2]
    for words in (["probe", folder, "--dof", "tip"], ["view", folder, "--png"]):
        assert call(*words) == 0
        assert capfd.readouterr().out.startswith("mode: point ")
    assert call("view", folder, "--analysis", "linear", "--png") == 0
    assert "linear: point 0, " in capfd.readouterr().out


def test_beside_linear_modes_alone_no_analysis_is_advised(tmp_path: Path, capfd) -> None:
    folder = solved(tmp_path, CASE + MATERIAL + GAUGES + LINEAR + LINEAR.replace('"linear"', '"linear2"', 1))
    for asked in ([], ["--analysis", "linear"], ["--analysis", "linear2"]):
        assert call("stress", folder, *asked) == 2
        assert capfd.readouterr().err.rpartition("fix:")[2].strip() == "run such an analysis"


def test_the_limit_of_a_linear_mode_is_in_closed_form(run: Path, capfd) -> None:
    """Stress is linear in the amplitude: the limit is the amplitude over its factor."""
    found, limit = table(run / "mode_gauges.csv"), table(run / "mode_goodman.csv")
    share = found["goodman"] / found["amplitude"]
    np.testing.assert_allclose(share, share[0], rtol=SOLVED)
    np.testing.assert_allclose(found["goodman"], found["stress_amplitude"] / 250.0, rtol=ROUNDING)
    assert limit["reached"] == ["yes"]
    assert limit["limit_amplitude"][0] == pytest.approx(1 / share[0], rel=SOLVED)
    assert limit["limit_frequency_hz"][0] == pytest.approx(found["frequency_hz"][0], rel=SOLVED)
    capfd.readouterr()
    assert call("stress", run, "--analysis", "mode") == 0
    printed = capfd.readouterr().out
    assert re.search(rf"Goodman factor 1 at {limit['limit_amplitude'][0]:.6g} mm", printed), printed


def test_the_level_of_a_response_is_between_those_solved(run: Path) -> None:
    """Of a linear response the factor's peak is linear in the level."""
    found, limit = table(run / "forced_gauges.csv"), table(run / "forced_goodman.csv")
    assert limit["level"].tolist() == [0.5, 1.0, 4.0]
    np.testing.assert_allclose(limit["limit_level"], limit["level"] / limit["largest_goodman"], rtol=1e-2)
    peaks = [found["goodman"][found["level"] == level].max() for level in limit["level"]]
    np.testing.assert_array_equal(limit["largest_goodman"], peaks)
    assert limit["reached"].tolist() == ["no", "no", "before its first point"]


def test_a_static_load_is_the_mean_stress(tmp_path: Path, capfd) -> None:
    """The tip's weight of 0.2 N: mean strain of the formula, and Goodman's amplitude less by the mean's share.

    A run of before, whose basis does not tell what loads do beyond the component modes, is read with a note.
    """
    text = CASE + '[preload]\nloads = ["weight"]\npair_loads = false\n' + MATERIAL + GAUGES + MODE
    shutil.copy(cantilever.__file__, tmp_path / "cantilever.py")
    builder = tmp_path / "cantilever.py"
    builder.write_text(builder.read_text().replace("load[tip] = 1.0", "load[tip] = 0.2"))
    (tmp_path / "case.toml").write_text(text)
    assert call("run", tmp_path / "case.toml", "--no-plots", "-q", "--out", tmp_path / "run") == 0
    assert call("stress", tmp_path / "run") == 0
    found, limit = table(tmp_path / "run" / "mode_gauges.csv"), table(tmp_path / "run" / "mode_goodman.csv")
    inertia = cantilever.WIDTH * HEIGHT**3 / 12
    bending = -0.2 * 0.8 * LENGTH * HEIGHT / 2 / (STEEL.youngs_modulus * inertia)
    np.testing.assert_allclose(found["root_mean"], bending, rtol=5e-3)
    factor = found["stress_amplitude"] / 250.0 + np.maximum(found["mean_stress"], 0) / 600.0
    np.testing.assert_allclose(found["goodman"], factor, rtol=ROUNDING)
    assert found["mean_stress"].max() > 5.0
    share, mean = found["stress_amplitude"][-1] / found["amplitude"][-1], found["mean_stress"][-1]
    assert limit["limit_amplitude"][0] == pytest.approx(250.0 * (1 - mean / 600.0) / share, rel=1e-6)
    assert "the component modes alone" not in capfd.readouterr().out
    with h5py.File(tmp_path / "run" / "reduction.h5", "a") as file:
        del file["load"], file["beyond"]
    assert call("stress", tmp_path / "run") == 0
    assert "note: the displacement at rest under weight is that of the component modes" in capfd.readouterr().out


def test_tables_may_be_added_after_the_run(tmp_path: Path, capfd) -> None:
    run = solved(tmp_path, CASE + MODE)
    capfd.readouterr()
    assert call("stress", run) == 2
    assert "neither gauges nor a material" in capfd.readouterr().err
    (tmp_path / "case.toml").write_text(CASE + GAUGES + MODE)
    assert call("stress", run, "--out", tmp_path / "own.csv") == 0
    assert {"root_strain", "across_mean"} <= set(table(tmp_path / "own.csv"))
    assert "goodman" not in table(tmp_path / "own.csv") and not (run / "mode_gauges.csv").exists()
    assert call("resume", run, "--no-plots", "-q") == 0  # no result depends on them


def test_limits_that_are_taken_out_leave_no_table_of_before(tmp_path: Path) -> None:
    """The report would show them beside the new table of the gauges."""
    folder = solved(tmp_path, CASE + MATERIAL + MODE.replace("40.0", "0.2"))
    assert call("stress", folder) == 0 and (folder / "mode_goodman.csv").exists()
    (tmp_path / "case.toml").write_text(CASE + MATERIAL.partition("endurance_limit")[0] + MODE.replace("40.0", "0.2"))
    assert call("stress", folder) == 0
    assert (folder / "mode_gauges.csv").exists() and not (folder / "mode_goodman.csv").exists()


def test_check_and_report_tell_of_gauges(run: Path, capfd) -> None:
    capfd.readouterr()
    assert call("check", run.parent / "case.toml", "--no-solve") == 0
    assert "gauge 'root': point (60, 0, 1.5) along (2, 0, 0)" in capfd.readouterr().out
    page = report_text(run)
    assert "Gauges and stress" in page and "limit amplitude" in page


def test_pictures_are_drawn_until_the_results_are_newer(run: Path, tmp_path: Path) -> None:
    shutil.copytree(run, tmp_path / "run")
    drawn = plot_run(tmp_path / "run", ["gauges"])
    assert sorted(path.name for path in drawn) == ["forced_gauges.png", "mode_gauges.png"]
    then = (run / "mode_gauges.csv").stat().st_mtime + 10
    os.utime(tmp_path / "run" / "results.h5", (then, then))
    assert plot_run(tmp_path / "run", ["gauges"]) == []
    assert "Gauges and stress" not in report_text(tmp_path / "run")


@pytest.mark.parametrize(
    "text, said",
    [
        ('[[gauge]]\nname = "g"\nnode = 100000\ndirection = [1.0, 0.0, 0.0]\n', "gauge.g.node is no node of a solid"),
        ('[[gauge]]\nname = "g"\npoint = [60.0, 0.0, 9.0]\ndirection = [1.0, 0.0, 0.0]\n', "lies beside all solid"),
        ('[[gauge]]\nname = "g"\nnode = 1\ndirection = [0.0, 0.0, 0.0]\n', "gauge.g.direction is none"),
        ('[[gauge]]\nname = "g"\ndirection = [1.0, 0.0, 0.0]\n', "gauge.g has no place, or two"),
        ('[[gauge]]\nname = "g"\nnode = 1\ndirection = [1.0, 0.0, 0.0]\nsector = 2\n', "gauge.g.sector is none"),
        ("[material]\nyoungs_modulus = 1e5\n", "is given without poisson_ratio"),
        ("[material]\nendurance_limit = 1e2\nultimate_strength = 1e3\n", "a limit of a stress that is not known"),
    ],
)
def test_what_is_wrong_is_told_beforehand(text: str, said: str, tmp_path: Path, capfd) -> None:
    shutil.copy(cantilever.__file__, tmp_path / "cantilever.py")
    (tmp_path / "case.toml").write_text(CASE + text + MODE)
    assert call("check", tmp_path / "case.toml", "--no-solve") == 2
    told = capfd.readouterr().err
    assert said in told and "fix:" in told, told


SLIPS = [
    ("youngs_modulus = 210e3", "youngs_modulus = 210e9", ("youngs_modulus = 2.1e+11 MPa", "100 to 2e+06 MPa")),
    ("endurance_limit = 250.0", "endurance_limit = 250e6", ("endurance_limit = 2.5e+08 MPa", "2.1 to 4.2e+04 MPa")),
    ("ultimate_strength = 600.0", "ultimate_strength = 0.6", ("ultimate_strength = 0.6 MPa",)),
]


@pytest.mark.parametrize("right, slip, words", SLIPS)
def test_a_material_in_other_units_is_warned_of_and_makes_no_stress(
    right: str, slip: str, words: tuple[str, ...], run: Path, capfd
) -> None:
    """210 GPa in Pa in a model in mm, t, s; strengths in Pa, or in GPa."""
    path = run.parent / "case.toml"
    kept = path.read_text()
    path.write_text(kept.replace(right, slip))
    try:
        assert (call("check", path, "--no-solve"), call("stress", run)) == (0, 2)
    finally:
        path.write_text(kept)
    said = capfd.readouterr()
    warned = said.out.partition("warning: ")[2]
    for word in (*words, "case.toml:", "in which steel has a modulus of 210000"):
        assert word in warned and word in said.err


def test_a_model_without_cells_has_no_stress(tmp_path: Path, capfd) -> None:
    text = CASE.replace('"cantilever.py"', '"cantilever.py"\noptions = { cells_known = false, cells = 4 }')
    run = solved(tmp_path, text + MATERIAL + MODE)
    capfd.readouterr()
    assert call("stress", run) == 2
    assert "the model has no solid cells" in capfd.readouterr().err
    (tmp_path / "case.toml").write_text(text + GAUGES + MODE)
    assert call("check", tmp_path / "case.toml", "--no-solve") == 2
    assert "is on no solid" in capfd.readouterr().err
