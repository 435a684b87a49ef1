"""What a study refuses before it runs anything, and models whose truth is zero."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest
from command_line import call

from fretwave.run.study_plan import Plan, Settings

pytestmark = pytest.mark.ranks(1)

CASE = """
[model]
dofs = ["m1", "m2", "m3"]
M = [[1.0, 0.0, 0.0], [0.0, 0.02, 0.0], [0.0, 0.0, 1.0]]
K = [[640.0, -40.0, 0.0], [-40.0, 40.0, 0.0], [0.0, 0.0, 100.0]]

[[contact]]
name = "damper"
law = "jenkins"
pairs = ["m2"]
friction_limit = 1e9
tangential_stiffness = 100.0

[[analysis]]
name = "mode"
type = "mode"
linear_mode = 2
method = "EPMC"
harmonics = 3
samples = 64
normalise = "m1"
amplitude = [0.02, 3.0]

[[analysis]]
name = "forced"
type = "forced"
harmonics = 3
samples = 64
force = { m1 = 1.0 }
levels = [2.0]
observe = "m3"
frequency = [2.0, 3.5]
"""
SMALL = ["--harmonics", "1,3", "--samples", "64", "--tolerance", "1e-10", "--repeats", "1"]


def study(folder: Path, *words: str, more: str = "") -> int:
    (folder / "case.toml").write_text(CASE + more)
    return call("study", folder / "case.toml", "--out", folder / "study", *SMALL, *words)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--harmonics", "0"], "whole numbers from 1 up are expected"),
        (["--harmonics=-1,3"], "whole numbers from 1 up are expected"),
        (["--harmonics", "1,,3"], "whole numbers from 1 up are expected"),
        (["--harmonics", "99999999999"], "whole numbers from 1 up are expected"),
        (["--tolerance", "0,1e-8"], "numbers above 0 are expected"),
        (["--harmonics", "1_0"], "whole numbers from 1 up are expected"),
        (["--tolerance", "1e-1_0"], "numbers above 0 are expected"),
        (["--tolerance", "nan"], "numbers above 0 are expected"),
        (["--accuracy", "0"], "numbers above 0 and below 1 are expected"),
        (["--accuracy", "1"], "numbers above 0 and below 1 are expected"),
        (["--repeats", "0"], "a whole number from 1 up is expected"),
        (["--samples", "33,64"], "a number of samples is odd"),
        (["--harmonics", "1,40"], "fewer than two samples per period of its highest harmonic"),
        (["--pressure-change", "0.1"], "this is a sweep of wear"),
        (["--component-modes", "3"], "the case is not reduced"),
    ],
)
def test_what_no_study_can_sweep_is_refused_before_it_runs(tmp_path: Path, capfd, words: list[str], said: str) -> None:
    assert study(tmp_path, *words) == 2
    told = capfd.readouterr()
    assert said in told.err and "Newton" not in told.out
    assert not (tmp_path / "study" / "study.csv").exists()


@pytest.mark.parametrize("wrong", ["harmonics = [0, 3]", "samples = [-4, 64]", "accuracy = [1e-1, 0.0]"])
def test_the_keys_of_a_case_are_held_to_the_same(tmp_path: Path, capfd, wrong: str) -> None:
    assert study(tmp_path, more=f"\n[study]\n{wrong}\n") == 2
    assert f"study.{wrong.split()[0]}" in capfd.readouterr().err


def test_a_value_given_twice_is_swept_once(tmp_path: Path) -> None:
    assert study(tmp_path, "--harmonics", "3,1,3") == 0
    with (tmp_path / "study" / "study.csv").open(newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["sweep"] == "harmonics"]
    assert [row["harmonics"] for row in rows] == ["1", "3"]


def test_settings_that_cannot_be_run_are_named() -> None:
    plan = Plan(harmonics=(1, 3), samples=(4, 64), tolerance=(1e-10,))
    assert plan.impossible == [Settings(3, 4, 1e-10)]
    assert not {settings for _, settings in plan.sweeps()} & set(plan.impossible)


def test_settings_left_out_are_said_in_the_notes(tmp_path: Path) -> None:
    assert study(tmp_path, "--samples", "4,64") == 0
    assert "highest harmonic: H = 3, N_t = 4, tolerance 1e-10." in (tmp_path / "study" / "study.md").read_text()


def test_a_mode_that_never_slips_has_errors_as_they_are(tmp_path: Path) -> None:
    """Its damping is zero: no peak can divide its errors, which are rounding."""
    assert study(tmp_path) == 0
    with (tmp_path / "study" / "study.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    for name in ("zeta_error", "peak_zeta_error", "zeta_error_estimate", "omega_error"):
        assert all(float(row[name]) < 1e-10 for row in rows), name
    assert (tmp_path / "study" / "study.png").exists()


def test_a_dof_that_does_not_move_is_no_truth(tmp_path: Path, capfd) -> None:
    assert study(tmp_path, "--analysis", "forced") == 2
    told = capfd.readouterr().err
    assert "what is observed does not move" in told and "forced.observe" in told


def test_a_finest_run_that_stops_is_told_what_the_run_would_say(tmp_path: Path, capfd) -> None:
    """A looser tolerance is of no use against a largest number of points."""
    assert study(tmp_path, "--set", "mode.step.max_points=3") == 3
    told = capfd.readouterr().err.rpartition("try:")[2]
    assert "mode.step.max_points=20000" in told
    assert "tolerance" not in told and "milder" not in told
