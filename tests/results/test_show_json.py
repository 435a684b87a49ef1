"""``fretwave show --json``: what `show` prints, for programs."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from command_line import call
from tolerances import ROUNDING

import fretwave as fw
from fretwave.columns import Column
from fretwave.results.results import AnalysisWriter

pytestmark = pytest.mark.ranks(1)

CASE = Path(__file__).parents[2] / "cases" / "two_dof" / "case.toml"


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("show") / "run"
    only = "mode,flutter,forced"
    short = ("--quick", "--only", only, "--set", "forced.time_points=0", "--no-plots", "-q")
    assert call("run", CASE, *short, "--out", folder) == 0
    return folder


def told(folder: Path, capsys) -> dict:
    assert call("show", folder, "--json") == 0
    return json.loads(capsys.readouterr().out)


def printed(folder: Path, capsys) -> list[str]:
    assert call("show", folder) == 0
    return capsys.readouterr().out.splitlines()


def test_it_holds_what_show_prints(run: Path, capsys) -> None:
    found, lines = told(run, capsys), printed(run, capsys)
    assert lines[0] == found["title"] and lines[1].startswith(f"{found['status']}, {found['ranks']} rank")
    rows = {line.split()[0]: line for line in lines[3 : 3 + len(found["analyses"])]}
    assert list(rows) == [one["name"] for one in found["analyses"]] == ["mode", "flutter", "forced"]
    for one in found["analyses"]:
        line, top, span = rows[one["name"]], one["peak"], one["range"]
        assert f"{span['low']:.4g} - {span['high']:.4g} {span['unit']}" in line
        assert f" {one['points']} " in line and f"{one['wall_s']:.2f} s" in line
        share = f"zeta {100 * top['zeta']:.3g} %" if one["type"] == "mode" else f"{top['frequency_hz']:.4g} Hz"
        assert share in line and one["status"] == "done" and one["overrides"].startswith("--quick")
    assert lines[3 + len(rows) :] == found["notes"]
    assert sum("limit cycle at" in note for note in found["notes"]) == len(found["analyses"][1]["limit_cycles"]) == 2
    assert [cycle["stable"] for cycle in found["analyses"][1]["limit_cycles"]] == [True, False]


def test_its_numbers_are_the_tables(run: Path, capsys) -> None:
    found, tables = told(run, capsys), fw.open_run(run)
    for one in found["analyses"]:
        table, top = tables[one["name"]], dict(one["peak"])
        point = top.pop("point")
        assert top == {name: table[name][point] for name in top}
        assert one["points"] == len(table) and one["unit"] == table.units["amplitude"]
        of = f"{one['error']['of']}_error"
        assert one["error"]["value"] == np.nanmax(table[of])
        assert one["wall_s"] == pytest.approx(table["wall_s"].sum(), rel=ROUNDING)


def test_of_a_run_that_is_not_finished(run: Path, tmp_path: Path, capsys) -> None:
    """What a killed run leaves: a journal in the place of results.h5."""
    writer = AnalysisWriter(tmp_path, "mode", ["point", "amplitude", "zeta", "omega0"], {"type": "mode"})
    writer.append({"point": 0, "amplitude": 0.5, "zeta": float("nan"), "omega0": 3.0})
    writer.append({"point": 1, "amplitude": 0.7, "zeta": 0.02, "omega0": 3.0})
    assert not (tmp_path / "results.h5").exists()
    found = told(tmp_path, capsys)
    (one,) = found["analyses"]
    assert one["status"] == "running" and one["points"] == 2 and found["status"] == ""
    assert one["peak"]["zeta"] == 0.02  # what is not known is not the largest
    assert any("not finished" in note for note in found["notes"])
    writer.abandon()


def test_two_ranks_say_it_once(run: Path, launch) -> None:
    done = launch(2, "-m", "fretwave", "show", str(run), "--json")
    assert done.returncode == 0, done.stderr
    assert [one["name"] for one in json.loads(done.stdout)["analyses"]] == ["mode", "flutter", "forced"]
    for words, said in (
        (["report"], "report.html"),
        (["probe", "--dof", "m1"], "dof m1, amplitude"),
        (["plot", "--only", "forced"], "1 picture in"),
    ):
        done = launch(2, "-m", "fretwave", words[0], str(run), *words[1:])
        assert done.returncode == 0 and done.stdout.count(said) == 1, done.stderr


def test_a_folder_without_results_is_refused(tmp_path: Path, capsys) -> None:
    assert call("show", tmp_path, "--json") == 2
    said = capsys.readouterr()
    assert said.out == "" and said.err.count("fix:") == 1


def test_the_peak_of_a_driven_wheel_is_that_of_any_sector(tmp_path: Path, capsys) -> None:
    """Not the largest amplitude of the sector that is observed, which is elsewhere."""
    columns = ["point", "level", "frequency_hz", "amplitude", "largest_amplitude", "largest_sector"]
    writer = AnalysisWriter(tmp_path, "wheel", columns, {"type": "forced"})
    for point, (own, largest, sector) in enumerate([(0.1, 0.2, 3), (0.2, 0.9, 14), (0.8, 0.81, 5)]):
        values = (point, 1.0, 10.0 + point, own, largest, sector)
        writer.append(dict(zip(columns, values)))
    writer.close("done", "stop value reached")
    (one,) = told(tmp_path, capsys)["analyses"]
    assert one["peak"]["point"] == 1 and one["peak"]["largest_sector"] == 14 and one["peak"]["amplitude"] == 0.2
    assert any("a 0.9 m of sector 14, 11 Hz" in line for line in printed(tmp_path, capsys))


def test_rounding_is_no_frequency(tmp_path: Path, capsys) -> None:
    """A rigid motion in the table of linear modes."""
    other = Column("other_hz", "Hz", "frequency of the mode most like it")
    writer = AnalysisWriter(tmp_path, "linear", ["point", "frequency_hz", other], {"type": "linear"})
    for point, hertz in enumerate((6.2e-18, 100.0)):
        writer.append({"point": point, "frequency_hz": hertz, "other_hz": hertz})
    writer.close("done", "stop value reached")
    assert any("0 - 100 Hz" in line for line in printed(tmp_path, capsys))
