"""Whole runs of the two-dof case in its short form: what is written, said and kept; the same numbers on 2 ranks."""

from __future__ import annotations

import csv
import json
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from tolerances import SOLVED

from fretwave.case.load import load_case
from fretwave.commands.main import main
from fretwave.post.limit_cycles import limit_cycles
from fretwave.results.reader import open_run
from fretwave.run.order import in_order

pytestmark = pytest.mark.ranks(1)

CASE = Path(__file__).parents[2] / "cases" / "two_dof" / "case.toml"
ARGUMENTS = [
    *("run", str(CASE), "--quick", "--no-plots", "--only", "mode,mode_epmc,flutter,forced"),
    *("--set", "forced.levels=[8.0]", "--set", "forced.time_points=0"),
]
RANK_TOLERANCE = 1e-9


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> Path:
    folder, hook = tmp_path_factory.mktemp("run"), sys.excepthook
    assert main([*ARGUMENTS, "--out", str(folder)]) == 0
    sys.excepthook = hook
    return folder


def column(folder: Path, name: str, key: str) -> np.ndarray:
    with open(folder / f"{name}.csv", newline="") as file:
        return np.array([float(row[key]) for row in csv.DictReader(file)])


def test_files_of_a_run(run: Path) -> None:
    names = {path.name for path in run.iterdir()}
    tables = {"mode.csv", "mode_epmc.csv", "flutter.csv", "forced.csv", "forced_peaks.csv"}
    tables |= {f"{name}_curve.csv" for name in ("mode", "mode_epmc", "flutter", "forced")}
    assert names == tables | {"results.h5", "run.json", "run.log", "case.toml"}
    assert (run / "case.toml").read_text() == CASE.read_text()


def test_columns_are_those_of_the_contract(run: Path) -> None:
    header = (run / "mode.csv").read_text().splitlines()[0]
    assert header == (
        "point,amplitude,omega,omega0,frequency_hz,beta,zeta,omega_error,zeta_error,"
        "lambda_error_harmonics,lambda_error_samples,lambda_error_solver,lambda_error_reduction,stick,slip,open,"
        "force_outside,residual,newton,linear,wall_s,rounding,accepted,unclosed,energy,event"
    )
    header = (run / "forced.csv").read_text().splitlines()[0]
    assert header.startswith("point,level,omega,frequency_hz,amplitude,phase,")


def test_record_and_log(run: Path) -> None:
    record = json.loads((run / "run.json").read_text())
    assert record["status"] == "done"
    assert record["ranks"] == 1
    assert {"petsc", "numpy", "h5py", "mpi", "python"} <= set(record["versions"])
    assert record["case"]["resolved"]["mode.harmonics"] == 7
    for entry in record["analyses"].values():
        assert entry["status"] == "done"
        assert entry["peak_memory_mb"]["all_ranks"] > 0
        assert any("even harmonics" in text for text in entry["left_out"])
    log = (run / "run.log").read_text()
    assert log.count(": left out: even harmonics") == 4, "each analysis at its start"
    assert log.count("\nleft out: even harmonics") == 1, "the run at its end"
    assert log.count("\nmode  ") == len(column(run, "mode", "point"))


def test_attributes_of_the_results(run: Path) -> None:
    with h5py.File(run / "results.h5") as file:
        attributes = file["mode"].attrs
        assert (attributes["type"], attributes["method"], attributes["harmonics"]) == ("mode", "CNM", 7)
        assert (attributes["samples"], attributes["normalise"]) == (256, "m1")
        assert attributes["stuck_omega"] == pytest.approx(np.sqrt(640.0), rel=SOLVED)
        assert attributes["free_omega"] == pytest.approx(24.1562, rel=1e-5)
        reported = file["mode/reported"][()]
        events = file["mode/points/event"][()]
        assert len(file["mode/contact_damper/f"]) == len(reported)
        assert list(reported) == [point for point, event in enumerate(events) if event]


def test_limit_cycles_are_labelled(run: Path) -> None:
    with h5py.File(run / "results.h5") as file:
        first, second = json.loads(file["flutter"].attrs["events"])
        assert json.loads(file["mode"].attrs["events"]) == []
    assert (first["stable"], second["stable"]) == (True, False)
    assert first["amplitude"] < second["amplitude"]
    assert "limit cycle at a = " in (run / "run.log").read_text()


def test_slope_of_the_damping_decides_also_on_a_falling_branch() -> None:
    """The same curve run through backwards has the same limit cycle."""
    table = {
        "amplitude": np.array([1.0, 2.0, 3.0]),
        "zeta": np.array([-0.1, 0.0, 0.1]),
        "frequency_hz": np.ones(3),
        "event": np.array(["start", "zero_damping", "stop"]),
    }
    backwards = {key: values[::-1] for key, values in table.items()}
    assert [limit_cycles(t)[0]["stable"] for t in (table, backwards)] == [True, True]
    cut = {key: values[:2] for key, values in table.items()}
    assert limit_cycles(cut)[0]["stable"] is None


def test_same_numbers_on_two_ranks(run: Path, tmp_path: Path, launch) -> None:
    done = launch(2, "-m", "fretwave", *ARGUMENTS, "--out", str(tmp_path), timeout=300)
    assert done.returncode == 0, done.stderr
    for name, keys in {"mode": ("omega", "omega0"), "mode_epmc": ("omega", "zeta"), "forced": ("amplitude",)}.items():
        assert len(column(run, name, "point")) == len(column(tmp_path, name, "point"))
        for key in keys:
            one, two = (at_given(folder, name, key) for folder in (run, tmp_path))
            assert len(one) >= 2
            assert np.allclose(one, two, rtol=RANK_TOLERANCE, atol=0), key


def at_given(folder: Path, name: str, key: str) -> np.ndarray:
    """A column at the amplitudes or frequencies that the case asks for.

    Points between them lie where steps of arclength happen to end: rounding moves them along the branch.
    """
    with open(folder / f"{name}.csv", newline="") as file:
        rows = csv.DictReader(file)
        return np.array([float(row[key]) for row in rows if row["event"] in ("start", "report", "stop")])


def test_rerun_of_one_analysis_keeps_the_others(run: Path) -> None:
    before = (run / "mode.csv").read_bytes()
    hook = sys.excepthook
    assert main([*ARGUMENTS[:-6], "--only", "flutter", "--out", str(run)]) == 0
    sys.excepthook = hook
    assert (run / "mode.csv").read_bytes() == before
    assert set(json.loads((run / "run.json").read_text())["analyses"]) == {"mode", "mode_epmc", "flutter", "forced"}
    with h5py.File(run / "results.h5") as file:
        assert set(file) == {"mode", "mode_epmc", "flutter", "forced"}


def test_analyses_come_after_those_they_need() -> None:
    case = load_case(CASE)
    assert in_order(case, ["forced", "limit_cycle", "flutter", "mode"]) == ["mode", "forced", "flutter", "limit_cycle"]


def test_show_lists_the_branches(run: Path, capsys) -> None:
    assert main(["show", str(run)]) == 0
    text = capsys.readouterr().out
    for said in ("mode CNM", "mode EPMC", "forced", "stable", "unstable"):
        assert said in text


@pytest.mark.parametrize("mode", ["mode", "mode_epmc"])
def test_distance_from_a_backbone_is_that_from_the_branch_s_own_curve(run: Path, mode: str) -> None:
    """Through the points alone it was off by 1e-4 of the frequency, of a distance of 4e-3."""
    peak, here = (column(run, "forced_peaks", key)[0] for key in ("frequency_hz", "amplitude"))
    found = [peak / hertz - 1 for hertz in open_run(run)[mode].at(here)["frequency_hz"]]
    assert column(run, "forced_peaks", f"distance_{mode}")[0] == pytest.approx(min(found, key=abs), abs=2e-5)
