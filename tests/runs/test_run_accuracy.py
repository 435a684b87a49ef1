"""Runs whose harmonics and samples follow from an accuracy: table, results, log, resumed runs, and what is refused."""

from __future__ import annotations

import csv
from pathlib import Path

import h5py
import numpy as np
import pytest
from command_line import call
from tolerances import REPEATED, SOLVED

import fretwave as fw
from fretwave.errors import EXIT_BAD_INPUT, EXIT_NOT_CONVERGED
from fretwave.results import results
from fretwave.run import stopped
from fretwave.solve import accuracy as rules

pytestmark = pytest.mark.ranks(1)

CASE = Path(__file__).parents[2] / "cases" / "two_dof" / "case.toml"
SETTINGS = ["mode.accuracy=1e-2", "forced.accuracy=1e-2", "forced.levels=[8.0]", "forced.time_points=0"]
OVERRIDES = [word for setting in SETTINGS for word in ("--set", setting)]
ARGUMENTS = ["--quick", "--no-plots", "--only", "mode,forced", *OVERRIDES]


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    assert call("run", CASE, *ARGUMENTS, "--out", folder) == 0
    return folder


def rows(folder: Path, name: str) -> list[dict[str, str]]:
    with open(folder / f"{name}.csv", newline="") as file:
        return list(csv.DictReader(file))


@pytest.mark.parametrize("name", ["mode", "forced"])
def test_the_table_has_the_harmonics_and_samples_of_each_point(run, name):
    table = rows(run, name)
    highest, samples = ({int(row[key]) for row in table} for key in ("harmonics", "samples"))
    assert len(highest) > 2 and min(highest) == 5
    assert min(samples) == 128 and all(n % 128 == 0 for n in samples)
    log = (run / "run.log").read_text()
    assert f"harmonics up to {max(highest)}, " in log
    assert f"accuracy 0.01 kept at {len(table)} of {len(table)} points" in log


@pytest.mark.parametrize("name", ["mode", "forced"])
def test_results_hold_the_coefficients_of_the_largest_set(run, name):
    highest = np.array([int(row["harmonics"]) for row in rows(run, name)])
    with h5py.File(run / "results.h5") as file:
        labels = [text.decode() for text in file[name]["harmonic"][()]]
        coefficients = file[name]["coefficients"][()]
        reported = len(file[name]["reported"])
        assert file[name]["contact_damper/f"].shape == (reported, 128, 1, 1)
    assert int(labels[-1][:-1]) == highest.max()
    for row, H in zip(coefficients, highest):
        beyond = [k for k, label in enumerate(labels) if int(label[:-1]) > H]
        assert not row[:, beyond].any() and row[:, labels.index(f"{H}c")].any()


def test_the_curve_is_that_of_a_branch_with_many_harmonics(run, tmp_path):
    fine = ["mode.harmonics=61", "mode.samples=1024", "mode.errors=false"]
    words = [word for setting in fine for word in ("--set", setting)]
    assert call("run", CASE, "--no-plots", "--only", "mode", *words, "--out", tmp_path / "fine") == 0
    a = [0.05, 0.1, 0.15, 0.2, 0.5, 2.0]
    here, there = (fw.open_run(folder)["mode"].at(a) for folder in (run, tmp_path / "fine"))
    error = np.hypot(here["beta"] - there["beta"], here["omega"] - there["omega"])
    np.testing.assert_array_less(error, 1e-2 * there["zeta"] * there["omega0"])  # what was asked for
    np.testing.assert_allclose(here["zeta"], there["zeta"], rtol=1.2e-2)


def test_a_run_that_broke_off_goes_on_with_the_set_it_had(run, tmp_path, monkeypatch):
    whole, folder = rows(run, "mode"), tmp_path / "broken"
    append = results.AnalysisWriter.append

    def broken(writer, *arguments):
        if writer.rows == 17:
            raise KeyboardInterrupt
        append(writer, *arguments)

    monkeypatch.setattr(results.AnalysisWriter, "append", broken)
    call("run", CASE, *ARGUMENTS, "--out", folder)
    monkeypatch.undo()
    assert len(rows(folder, "mode")) == 17
    assert call("resume", folder, "--no-plots") == 0
    table = rows(folder, "mode")
    assert [row["harmonics"] for row in table] == [row["harmonics"] for row in whole]
    for key in ("amplitude", "omega", "zeta"):
        expected = [float(row[key]) for row in whole]
        np.testing.assert_allclose([float(row[key]) for row in table], expected, rtol=REPEATED, atol=SOLVED)


def test_an_accuracy_that_is_not_kept_is_no_success(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(rules, "MOST_HARMONICS", 7)
    only = ["--quick", "--no-plots", "--only", "mode", "--set", "mode.accuracy=1e-3"]
    assert call("run", CASE, *only, "--out", tmp_path / "out") == EXIT_NOT_CONVERGED
    said = capsys.readouterr().err
    assert "limited by harmonics" in said and "a milder --set mode.accuracy" in said and "shorter steps" not in said
    assert float(rows(tmp_path / "out", "mode")[-1]["amplitude"]) == pytest.approx(3.0)


def test_what_limits_it_most_is_what_to_change():
    kept = "level 2: stop value reached; accuracy 0.01 kept at 3 of 40 points, 7 limited by harmonics (255 at most)"
    assert stopped.advice("a", kept) == "a milder --set a.accuracy=..."
    kept += ", 30 limited by the reduction (more component modes: [reduction] modes)"
    assert stopped.advice("a", kept).startswith("more component modes")
    assert stopped.advice("a", f"{kept[9:]}, 31 limited by the solver").startswith("a tighter tolerance")


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        (["mode.accuracy=1e-2", "mode.errors=false"], "what `accuracy` is judged by"),
        (["mode.accuracy=2.0"], "a value < 1"),
        (["mode.accuracy=0.0"], "a value > 0"),
    ],
)
def test_what_is_refused(settings, said, tmp_path, capsys):
    words = [word for setting in settings for word in ("--set", setting)]
    assert call("run", CASE, "--only", "mode", *words, "--out", tmp_path / "out") == EXIT_BAD_INPUT
    assert said in capsys.readouterr().err


def test_a_case_needs_no_harmonics_beside_an_accuracy(tmp_path, capsys):
    text = CASE.read_text().replace("harmonics = 21", "accuracy = 1e-2", 1)
    (tmp_path / "case.toml").write_text(text)
    assert call("check", tmp_path / "case.toml") == 0
    assert "accuracy 0.01: harmonics and samples follow from it" in capsys.readouterr().out
