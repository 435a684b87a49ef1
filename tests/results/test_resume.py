"""A run killed in mid-branch and resumed gives what the uninterrupted one gives, on any number of ranks."""

from __future__ import annotations

import csv
import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pytest
from command_line import call

from fretwave.analyses.parts import forced_time

pytestmark = pytest.mark.ranks(1)

CASE = Path(__file__).parents[2] / "cases" / "two_dof" / "case.toml"
#: Short steps, so that there are many points to be killed between; folds and several levels are crossed.
SETTINGS = {
    "mode.harmonics": "7",
    "mode.samples": "512",
    "mode.step.initial": "0.005",
    "mode.step.maximum": "0.02",
    "forced.harmonics": "5",
    "forced.samples": "256",
    "forced.levels": "[2.0, 8.0]",
    "forced.backbone": "['mode']",
    "forced.time_points": "0",
}
OVERRIDES = [word for key, value in SETTINGS.items() for word in ("--set", f"{key}={value}")]
#: Differences between rank counts come from the order of additions; amplified near folds.
RANK_TOLERANCE = 1e-9


def command(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "fretwave", *arguments, "--no-plots"]


def start(folder: Path) -> list[str]:
    return command("run", str(CASE), "--out", str(folder), "--only", "mode,forced", *OVERRIDES)


def kill_at(arguments: list[str], table: Path, lines: int) -> int:
    """Start a process, kill -9 when a table has this many lines; returns how many it had after the kill."""
    with subprocess.Popen(arguments, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        deadline = time.monotonic() + 60
        while not (table.exists() and len(table.read_text().splitlines()) >= lines):
            assert process.poll() is None, "the run ended before it could be killed"
            assert time.monotonic() < deadline
            time.sleep(0.005)
        process.send_signal(signal.SIGKILL)
        process.wait()
    return len(table.read_text().splitlines())


def rows(folder: Path, name: str) -> list[dict[str, str]]:
    with open(folder / f"{name}.csv", newline="") as file:
        return list(csv.DictReader(file))


def without_time(table: list[dict[str, str]]) -> list[dict[str, str]]:
    return [{key: value for key, value in row.items() if key != "wall_s"} for row in table]


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("whole")
    subprocess.run(start(folder), check=True, stdout=subprocess.DEVNULL)
    return folder


@pytest.fixture(scope="module")
def resumed(whole: Path, tmp_path_factory) -> Path:
    """Killed in the middle of the mode, resumed, killed in the second level, resumed."""
    folder = tmp_path_factory.mktemp("resumed")
    halfway = len(rows(whole, "mode")) // 2
    assert kill_at(start(folder), folder / "mode.csv", halfway) < len(rows(whole, "mode"))
    late = sum(row["level"] == "2.0" for row in rows(whole, "forced")) + 20
    assert kill_at(command("resume", str(folder)), folder / "forced.csv", late) < len(rows(whole, "forced"))
    subprocess.run(command("resume", str(folder)), check=True, stdout=subprocess.DEVNULL)
    return folder


@pytest.mark.parametrize("name", ["mode", "forced"])
def test_joined_tables_are_the_uninterrupted_ones(whole: Path, resumed: Path, name: str) -> None:
    assert without_time(rows(resumed, name)) == without_time(rows(whole, name))


def test_joined_results_are_the_uninterrupted_ones(whole: Path, resumed: Path) -> None:
    compared = []

    def compare(path: str, one: object) -> None:
        if isinstance(one, h5py.Dataset) and "/state_" not in path and not path.endswith("wall_s"):
            assert np.array_equal(one[()], two[path][()], equal_nan=one.dtype.kind == "f"), path
            compared.append(path)

    with (
        h5py.File(whole / "results.h5") as first,
        h5py.File(resumed / "results.h5") as two,
    ):
        first.visititems(compare)
        for name in ("mode", "forced"):
            one, other = dict(first[name].attrs), dict(two[name].attrs)
            assert one.pop("run_id") != other.pop("run_id")
            assert one == other
    assert {"mode/coefficients", "mode/contact_damper/f", "forced/points/phase"} <= set(compared)


def test_record_tells_of_a_finished_run(resumed: Path) -> None:
    record = json.loads((resumed / "run.json").read_text())
    assert record["status"] == "done"
    assert {name: entry["status"] for name, entry in record["analyses"].items()} == {
        "mode": "done",
        "forced": "done",
    }


def test_resuming_a_finished_run_does_nothing(resumed: Path, launch) -> None:
    before = (resumed / "results.h5").read_bytes()
    done = launch(1, "-m", "fretwave", "resume", str(resumed), "--no-plots")
    assert done.returncode == 0
    assert "mode: already done" in done.stdout
    assert (resumed / "results.h5").read_bytes() == before


def test_resuming_on_two_ranks(whole: Path, tmp_path: Path, launch) -> None:
    expected = rows(whole, "mode")
    arguments = [*start(tmp_path), "--only", "mode"]
    kill_at(arguments, tmp_path / "mode.csv", len(expected) - 40)
    done = launch(2, "-m", "fretwave", "resume", str(tmp_path), "--no-plots", timeout=120)
    assert done.returncode == 0, done.stderr
    found = rows(tmp_path, "mode")
    assert [row["event"] for row in found] == [row["event"] for row in expected]
    for name in ("amplitude", "omega", "zeta"):
        one, two = (np.array([float(row[name]) for row in table]) for table in (expected, found))
        assert np.allclose(one, two, rtol=RANK_TOLERANCE, atol=0.0), name


#: A mode of a few points.
SHORT = ["--set", "mode.amplitude=[0.02, 0.03]", "--set", "mode.report_at=[]", "--only", "mode", "--no-plots"]


def test_changed_case_is_refused(tmp_path: Path, launch) -> None:
    case, folder = tmp_path / "case.toml", tmp_path / "run"
    case.write_text(CASE.read_text())
    assert launch(1, "-m", "fretwave", "run", str(case), "--out", str(folder), *SHORT).returncode == 0
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    case.write_text(CASE.read_text().replace("friction_limit = 5.0", "friction_limit = 4.0"))
    done = launch(1, "-m", "fretwave", "resume", str(folder))
    assert done.returncode == 2
    assert "contact.damper.friction_limit: 5.0 then, 4.0 now" in done.stderr
    assert "  fix: " in done.stderr
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before


def test_resume_without_the_case_file_uses_the_copy(tmp_path: Path, launch) -> None:
    case, folder = tmp_path / "case.toml", tmp_path / "run"
    case.write_text(CASE.read_text())
    assert launch(1, "-m", "fretwave", "run", str(case), "--out", str(folder), *SHORT).returncode == 0
    case.unlink()
    assert launch(1, "-m", "fretwave", "resume", str(folder)).returncode == 0


def test_a_level_that_stopped_before_the_kill_is_not_forgotten(tmp_path: Path) -> None:
    """The first of three grows without bound; the run is killed in the last one."""
    text = ["--set", "forced.levels=[20.0, 2.0, 8.0]", "--set", "forced.backbone=[]"]
    whole_run = command("run", str(CASE), "--out", str(tmp_path / "whole"), "--only", "forced", *OVERRIDES, *text)
    told = subprocess.run(whole_run, check=False, capture_output=True, text=True)
    assert told.returncode == 3 and "level 20: the response grows without bound" in told.stderr
    cut = [str(tmp_path / "cut") if word == str(tmp_path / "whole") else word for word in whole_run]
    late = sum(row["level"] != "8.0" for row in rows(tmp_path / "whole", "forced")) + 20
    assert kill_at(cut, tmp_path / "cut" / "forced.csv", late) < len(rows(tmp_path / "whole", "forced"))
    resumed = subprocess.run(command("resume", str(tmp_path / "cut")), check=False, capture_output=True, text=True)
    assert resumed.returncode == 3 and resumed.stderr.splitlines()[2] == told.stderr.splitlines()[2]
    with h5py.File(tmp_path / "whole" / "results.h5") as one, h5py.File(tmp_path / "cut" / "results.h5") as other:
        for name, expected in (("status", "stopped"), ("ended", "[2.0, 8.0]")):
            assert one["forced"].attrs[name] == other["forced"].attrs[name] == expected
        assert one["forced"].attrs["reason"] == other["forced"].attrs["reason"]


def test_what_came_after_the_branches_and_was_given_up_is_not_done_when_resumed(
    tmp_path: Path, monkeypatch, capsys
) -> None:
    """Integration that does not come to a steady motion stops a response whose levels are done."""
    monkeypatch.setattr(forced_time, "time_points", lambda *_: ([], "too many steps"))
    few = ["--set", "forced.backbone=[]", "--set", "forced.levels=[2.0]", "--set", "forced.time_points=1"]
    words = ["--only", "forced", "--no-plots", "--quick", *few, "--out", tmp_path / "run"]
    assert call("run", CASE, *words) == 3
    said = capsys.readouterr().err
    assert call("resume", tmp_path / "run") == 3
    assert capsys.readouterr().err == said and "forced.time_points=0" in said
