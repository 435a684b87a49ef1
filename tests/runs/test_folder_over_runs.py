"""What several runs leave in one folder: what is read, compared and said is of the case as it is, or said not to be."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import pytest
from command_line import call

from fretwave.case.load import load_case
from fretwave.report import report
from fretwave.results import further
from fretwave.results.results import AnalysisWriter
from fretwave.run.order import in_order

pytestmark = pytest.mark.ranks(1)

CASE = Path(__file__).parents[2] / "cases" / "two_dof" / "case.toml"
SHORT = {
    **{f"{name}.{key}": value for name in ("mode", "flutter") for key, value in (("harmonics", 3), ("samples", 64))},
    **{f"{name}.amplitude": [0.05, 0.3] for name in ("mode", "flutter")},
    **{"mode.report_at": [], "forced.harmonics": 3, "forced.samples": 64, "forced.levels": [8.0]},
    **{"forced.frequency": [3.85, 3.95], "forced.backbone": '"mode"', "forced.time_points": 0},
    **{"limit_cycle.amplitude": [0.1, 0.25], "limit_cycle.periods": 14},
}
ALL = "mode,flutter,forced,limit_cycle"


def run(folder: Path, only: str, **changes: object) -> int:
    settings = {**SHORT, **{key.replace("__", "."): value for key, value in changes.items()}}
    words = [word for key, value in settings.items() for word in ("--set", f"{key}={value}")]
    return call("run", CASE, "--no-plots", "-q", "--only", only, "--out", folder, *words)


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("whole") / "run"
    assert run(folder, ALL) == 0
    return folder


@pytest.fixture
def folder(whole: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(whole, tmp_path / "run"))


@pytest.fixture
def broken(folder: Path, monkeypatch, capfd) -> Path:
    """The mode with dampers is interrupted when it is followed anew."""
    append = AnalysisWriter.append

    def interrupted(self: AnalysisWriter, *given: object, **named: object) -> None:
        append(self, *given, **named)
        if self.rows == 12:
            raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(AnalysisWriter, "append", interrupted)
        assert run(folder, "flutter") == 130
    capfd.readouterr()
    return folder


def lines(folder: Path, capfd) -> list[str]:
    assert call("show", folder) == 0
    return capfd.readouterr().out.splitlines()


def test_a_branch_that_broke_off_is_no_result_for_others(broken: Path, whole: Path, capfd) -> None:
    assert run(broken, "limit_cycle") == 2
    assert "no finished results of 'flutter'" in capfd.readouterr().err
    assert run(broken, "flutter,limit_cycle") == 0  # as its fix says
    assert (broken / "limit_cycle.csv").read_text() == (whole / "limit_cycle.csv").read_text()


def test_only_what_resume_goes_on_with_is_said_to_be_resumed(broken: Path, capfd) -> None:
    goes_on = "flutter: not finished; `fretwave resume` goes on with it when it is cut off"
    assert goes_on in lines(broken, capfd)
    assert run(broken, "mode") == 0
    capfd.readouterr()
    anew = "flutter: not finished, and not of the last run: `fretwave run CASE --only flutter` does it anew"
    assert anew in lines(broken, capfd)
    assert call("resume", broken, "--no-plots", "-q") == 0
    assert anew in lines(broken, capfd)
    assert run(broken, "flutter") == 0
    assert not [line for line in lines(broken, capfd) if "not finished" in line]


def test_comparisons_with_a_mode_as_it_was_are_told(folder: Path, capfd) -> None:
    assert not [line for line in lines(folder, capfd) if "earlier case" in line]
    assert run(folder, "mode", mode__harmonics=1) == 0
    capfd.readouterr()
    told = [line for line in lines(folder, capfd) if "earlier case" in line]
    assert told == ["forced, limit_cycle: results of an earlier case, with mode.harmonics = 3 (now 1)"]


def test_what_was_compared_with_nothing_is_of_no_earlier_case(tmp_path: Path, capfd) -> None:
    assert run(tmp_path, "forced") == 0
    assert run(tmp_path, "mode", mode__harmonics=1) == 0
    capfd.readouterr()
    assert not [line for line in lines(tmp_path, capfd) if "earlier case" in line]


def test_a_mode_comes_before_the_motions_that_are_compared_with_it(tmp_path: Path) -> None:
    head, *blocks = CASE.read_text().split("[[analysis]]")
    path = tmp_path / "case.toml"
    blocks[-1] = blocks[-1].partition("\n[study]")[0]
    path.write_text("[[analysis]]".join([head, *(f"{block}\n" for block in reversed(blocks))]))
    case = load_case(path)
    order = in_order(case, list(case.analyses))
    assert list(case.analyses)[0] == "limit_cycle" and order.index("mode") < order.index("limit_cycle")


def test_rows_before_an_analysis_stops_are_counted(folder: Path, capfd) -> None:
    assert run(folder, "flutter", flutter__step__max_points=12) == 3
    capfd.readouterr()
    assert run(folder, "limit_cycle", flutter__step__max_points=12) == 3
    rows = len((folder / "limit_cycle.csv").read_text().splitlines()) - 1
    assert rows > 0 and f"'limit_cycle' stopped early; {rows} points are kept" in capfd.readouterr().err
    assert json.loads((folder / "run.json").read_text())["analyses"]["limit_cycle"]["points"] == rows


def test_a_report_has_the_settings_that_results_are_of(folder: Path, monkeypatch) -> None:
    monkeypatch.setattr(report, "pictures", lambda *given: [])  # they take seconds
    assert run(folder, "mode", forced__levels=[2.0]) == 0
    text = report.report_text(folder)
    section = text[text.index('id="a-forced"') : text.index('id="a-limit_cycle"')]
    assert "[8.0]" in section and "[2.0]" not in section


def test_motions_of_an_earlier_case_are_not_said_to_be_missing(folder: Path, capfd) -> None:
    assert run(folder, "mode", forced__levels=[2.0]) == 0
    capfd.readouterr()
    assert call("view", folder, "--analysis", "forced") == 2
    told = capfd.readouterr().err
    assert "the results of 'forced' are of the case before it changed" in told and "(now [2.0])" in told


def test_tables_of_an_earlier_run_do_not_stay_beside_a_new_one(folder: Path) -> None:
    old, other = folder / "limit_cycle_shifted_mode.csv", folder / "limit_cycle_of_mine.csv"
    shutil.copy(old, folder / "forced_time.csv")
    shutil.copy(old, other)
    assert old.exists()
    assert run(folder, "flutter,limit_cycle,forced", contact__damper__friction_limit=4.5, forced__levels=[7.0]) == 0
    assert not old.exists() and not (folder / "forced_time.csv").exists()  # nothing was compared, no time_points
    assert other.exists() and (folder / "forced_peaks.csv").exists()


def test_every_further_table_is_known() -> None:
    """Suffixes in the sources."""
    sources = Path(further.__file__).parents[1] / "analyses"
    texts = [path.read_text() for path in sources.rglob("*.py")]
    written = {suffix for text in texts for suffix in re.findall(r'write_table\(f?"(\w+)', text)}
    assert {"peaks", "time", "shifted_"} <= written
    assert {one.rstrip("*") for one in further.SUFFIXES} >= written


def test_an_address_of_nothing_has_a_way_out(tmp_path: Path, capfd) -> None:
    assert call("run", CASE, "--set", "study.harmonics=[1]", "--out", tmp_path / "run") == 2
    assert "fretwave check --keys" in capfd.readouterr().err
