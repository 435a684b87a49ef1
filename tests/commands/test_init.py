"""``fretwave init`` writes a case that runs as it is, and nothing over anything."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest
from command_line import call

pytestmark = pytest.mark.ranks(1)


def test_the_template_checks_and_runs(tmp_path: Path, monkeypatch, capfd) -> None:
    monkeypatch.chdir(tmp_path)
    assert call("init", "mine/first") == 0
    assert "`fretwave run mine/first/case.toml`" in capfd.readouterr().out
    assert call("check", "mine/first/case.toml") == 0
    assert "no errors" in capfd.readouterr().out
    assert call("run", "mine/first/case.toml", "--no-plots") == 0
    with open("runs/first/forced_peaks.csv", newline="") as file:
        peaks = list(csv.DictReader(file))
    assert [float(row["level"]) for row in peaks] == [1.0, 2.0], "a peak at every level"
    with open("runs/first/mode.csv", newline="") as file:
        events = " ".join(row["event"] for row in csv.DictReader(file))
    assert "peak_damping" in events and "report" in events


def test_here_and_only_once(tmp_path: Path, monkeypatch, capfd) -> None:
    monkeypatch.chdir(tmp_path)
    assert call("init") == 0
    (tmp_path / "case.toml").write_text("mine")
    assert call("init") == 2
    assert (tmp_path / "case.toml").read_text() == "mine"
    said = capfd.readouterr().err
    assert "error: there is a case already" in said and "where:    case.toml" in said and "  fix: " in said


def test_not_into_a_file(tmp_path: Path, capfd) -> None:
    (tmp_path / "file").write_text("")
    assert call("init", tmp_path / "file") == 2
    assert "this is a file, not a folder" in capfd.readouterr().err


def test_two_ranks_write_it_once(tmp_path: Path, launch) -> None:
    done = launch(2, "-m", "fretwave", "init", str(tmp_path))
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.count("written: ") == 1
