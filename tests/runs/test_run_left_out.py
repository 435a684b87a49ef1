"""What a run says at its end that it left out."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import pytest

from fretwave.case.load import load_case
from fretwave.commands.main import main
from fretwave.run.left_out import left_out_lines

pytestmark = pytest.mark.ranks(1)

CASES = Path(__file__).parents[2] / "cases"
ODD = "even harmonics and the mean (the contact laws are odd, there is no preload)"


def said(
    case: str, names: list[str], entries: dict[str, list[str]], plots: bool = True, options: Sequence[str] = ()
) -> list[str]:
    loaded = load_case(CASES / case / "case.toml", list(options))
    return left_out_lines(loaded, names, {name: {"left_out": told} for name, told in entries.items()}, plots)


def test_what_all_left_out_is_one_line():
    lines = said("two_dof", ["mode", "flutter"], {"mode": [ODD], "flutter": [ODD]}, plots=False)
    assert lines == [f"left out: {ODD}; reduction, wear, time integration (not asked for); pictures (--no-plots)"]


def test_what_some_left_out_names_them():
    check = "check by time integration (time_points = 0)"
    options = ["forced.time_points=0"]
    lines = said("two_dof", ["mode", "forced"], {"mode": [ODD], "forced": [ODD, check]}, options=options)
    assert lines == [f"left out: {ODD}; reduction, wear (not asked for)", f"left out of forced: {check}"]


def test_integration_in_time_is_not_said_to_be_left_out():
    (line,) = said("two_dof", ["free_decay"], {"free_decay": []})
    assert line == "left out: reduction, wear (not asked for)"


def test_one_sector_and_the_whole_wheel():
    first, second = said("blisk_lumped", ["mode", "mode_wheel"], {"mode": [], "mode_wheel": []})
    flow = "the forces of the flow (aerodynamics = false)"
    assert first == f"left out: {flow}; reduction, wear, time integration (not asked for)"
    assert second == "left out of mode: 23 of 24 sectors (a wave moves them as this one, each a phase later)"


def test_the_record_of_a_run_has_it(tmp_path):
    arguments = ["run", str(CASES / "two_dof" / "case.toml"), "--quick", "--no-plots", "--only", "mode"]
    assert main([*arguments, "--set", "mode.errors=false", "--out", str(tmp_path)]) == 0
    record, log = (tmp_path / "run.json").read_text(), (tmp_path / "run.log").read_text()
    told = json.loads(record)["left_out"]
    assert log.splitlines()[-2:-1] == told, "before what it says at its end"
    assert "errors of the points (errors = false)" in told[0] and "pictures (--no-plots)" in told[0]
