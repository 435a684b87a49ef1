"""Component modes of a run that reads results of an earlier one, which had taken more of them than were chosen."""

from __future__ import annotations

import shutil
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from command_line import call
from test_run_more_modes import chain, record

from fretwave.case.component_modes import Choice
from fretwave.case.kept import KeptOn
from fretwave.errors import EXIT_BAD_INPUT, EXIT_NOT_CONVERGED
from fretwave.run import more_modes

pytestmark = pytest.mark.ranks(1)

STOP = 'name = "stop"\nlaw = "unilateral_spring"\npairs = ["m20"]\nnormal_stiffness = 60.0\ngap = 0.02\n'
MODE = 'type = "mode"\nnormalise = "m20"\naccuracy = 1e-2\n'
FORCED = 'type = "forced"\nobserve = "m20"\nforce = { m20 = 1.0 }\nlevels = [0.01]\nharmonics = 1\n'
ANALYSES = f"""
[[analysis]]
name = "a"
{MODE}amplitude = [0.01, 0.03]

[[analysis]]
name = "b"
{MODE}amplitude = [0.01, 0.012]

[[analysis]]
name = "d"
type = "free_decay"
mode = "a"
amplitude = [0.02]
periods = 6
tolerance = 1e-6

[[analysis]]
name = "e"
type = "free_decay"
mode = "b"
amplitude = [0.011]
periods = 2

[[analysis]]
name = "f"
{FORCED}frequency = [0.08, 0.083]
backbone = ["a"]
"""
#: Of a run that reads results of `a`.
LAST = "reduction: 40 component modes: as the results of 'a' from an earlier run"


def run(folder: Path, only: str, *words: str) -> int:
    return call("run", folder / "case.toml", "--no-plots", "--out", folder / "run", "--only", only, *words)


@pytest.fixture(scope="module")
def of_a(tmp_path_factory) -> Path:
    """A run of `a` that has taken 40 component modes in place of 20."""
    folder = tmp_path_factory.mktemp("first")
    chain(folder, "[reduction]", STOP, ANALYSES)
    assert run(folder, "a") == 0
    assert [one["limited_by"] for one in record(folder)[more_modes.GREW]] == [20]
    return folder


@pytest.fixture
def grown(of_a: Path, tmp_path: Path) -> Path:
    """The same, to run more in."""
    return Path(shutil.copytree(of_a, tmp_path / "own"))


def log(folder: Path) -> list[str]:
    return (folder / "run" / "run.log").read_text().splitlines()


def test_an_analysis_that_needs_the_results_is_on_as_many(grown: Path) -> None:
    assert run(grown, "d") == 0
    assert record(grown)["reduction"]["component_modes"] == 40 and log(grown)[-2] == LAST
    assert sum("kept and 40 component modes" in line for line in log(grown)) == 1  # and on no other before
    assert not any("kept and 20 component modes" in line for line in log(grown)[-20:])


def test_an_analysis_that_only_compares_is_on_as_many(grown: Path) -> None:
    assert run(grown, "f") == 0
    assert record(grown)["reduction"]["component_modes"] == 40 and log(grown)[-2] == LAST
    assert not [text for text in record(grown)["analyses"]["f"]["left_out"] if "no results" in text]


def test_a_run_that_broke_off_goes_on_with_as_many(grown: Path, monkeypatch) -> None:
    from fretwave.results.results import AnalysisWriter

    def broken(writer, *arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr(AnalysisWriter, "close", broken)
    run(grown, "d")
    monkeypatch.undo()
    assert record(grown)["status"] == "running"
    assert call("resume", grown / "run", "--no-plots") == 0 and log(grown)[-2] == LAST


def test_results_on_several_numbers_are_told_apart(grown: Path, capsys) -> None:
    """Before anything is reduced; `b` is on the 20 that were chosen."""
    assert run(grown, "b") == 0 and record(grown)["reduction"]["component_modes"] == 20
    capsys.readouterr()
    assert run(grown, "d,e") == EXIT_BAD_INPUT
    said = capsys.readouterr()
    assert "are on 20 component modes" in said.err and "expected: 40," in said.err and "--only b,e" in said.err
    assert "component modes (up to" not in said.out


def test_more_than_they_have_are_taken_where_the_case_asks_for_more(grown: Path, capsys) -> None:
    """Another analysis is to be more accurate now: what was chosen for less does not serve it."""
    more = ("--set", "b.accuracy=1e-4")
    assert run(grown, "b") == 0  # the folder is that of this case from here on
    assert run(grown, "f", *more) == 0
    assert record(grown)["reduction"]["component_modes"] > 40
    assert any("no results of it" in text for text in record(grown)["analyses"]["f"]["left_out"])
    assert run(grown, "d", *more) == EXIT_BAD_INPUT
    assert "those in" in (said := capsys.readouterr().err) and "are on 40 component modes" in said


@pytest.mark.parametrize(
    ("chosen_for", "serves"),
    [((1e-6, 5, 10.0), True), ((1e-7, 6, 20.0), True), ((1e-5, 5, 10.0), False), ((1e-6, 4, 10.0), False)]
    + [((1e-6, 5, 9.0), False), ((), False)],
    ids=["same", "more", "less accurate", "fewer", "not as high", "told"],
)
def test_a_number_serves_what_asks_for_no_more(chosen_for: tuple[float, ...], serves: bool) -> None:
    assert KeptOn(40, chosen_for).serves(Choice(1e-6, 5, 10.0)) == serves


def test_a_run_that_needs_results_takes_no_more_than_these_have(monkeypatch) -> None:
    """They would not be its own any more."""
    monkeypatch.setattr(more_modes, "choice_of", lambda case: Choice(1e-6, 1))
    case: Any = SimpleNamespace(reduced=SimpleNamespace(component_modes=40, inner=1000))
    reason = "stop value reached; accuracy 0.01 kept at 3 of 40 points, 37 limited by the reduction"
    entry = {"analysis": "a", "taken": 40}
    with pytest.raises(more_modes.TooFewModes):
        more_modes.expect_enough(case, "f", reason, {more_modes.GREW: [entry]})
    why = more_modes.expect_enough(case, "f", reason, {more_modes.GREW: [{**entry, "needed": True}]})
    assert why == "the results of 'a', which are needed, are on 40"


def test_a_run_says_that_more_of_them_have_not_helped(tmp_path: Path, monkeypatch) -> None:
    """Not by the share of the points that it counts; it keeps what it has found on them."""
    monkeypatch.setattr(more_modes, "limited_points", lambda reason, source: (3, 4))
    chain(tmp_path, "[reduction]", STOP.replace("60.0", "100.0"), ANALYSES)
    assert run(tmp_path, "a") == EXIT_NOT_CONVERGED
    why = "20 limited 3 of 4 points, 40 limit 3 of 4"
    assert record(tmp_path)["analyses"]["a"][more_modes.KEPT] == why
    assert record(tmp_path)["reduction"]["component_modes"] == 40
    assert f"a: no more component modes are taken: {why}" in log(tmp_path)
    assert log(tmp_path)[-2] == "reduction: 40 component modes: 20 limited the accuracy of 'a', no more for 'a'"


def test_sweeps_say_which_numbers_their_values_have_taken(tmp_path: Path) -> None:
    swept = '[[analysis]]\nname = "s"\ntype = "sweep"\nof = "a"\nover.contact.stop.gap = [0.02]\n'
    chain(tmp_path, "[reduction]", STOP, f"{ANALYSES}\n{swept}")
    over = ("--over", "contact.stop.gap=0.02", "--only", "a", "--no-plots")
    assert call("sweep", tmp_path / "case.toml", *over, "--out", tmp_path / "swept") == 0
    assert run(tmp_path, "s") == 0
    line = "reduction: component modes in place of those chosen at 1 of 1 value: 40 at 1 value"
    assert f"{line}: 20 limited the accuracy of 'a'" in (tmp_path / "swept" / "run.log").read_text()
    assert f"s: {line}: 20 limited the accuracy of 'a'" in log(tmp_path)


def test_values_of_a_sweep_in_one_line() -> None:
    grew = {"analysis": "a", "limited_by": 20, "points": [3, 4], "taken": 40}
    records = [{}, {more_modes.GREW: [grew]}, None, {more_modes.GREW: [grew, {**grew, "limited_by": 40, "taken": 80}]}]
    (line,) = more_modes.line_of_values(records)
    assert line.startswith("reduction: component modes in place of those chosen at 2 of 4 values: 40 at 1 value, 80 at")
    assert line.endswith(": 20 limited the accuracy of 'a', 40 limited the accuracy of 'a'")
    assert more_modes.line_of_values([{}, None]) == []
