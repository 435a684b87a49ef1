"""``fretwave show`` says of each analysis what was not as in the case file."""

from __future__ import annotations

from pathlib import Path

import pytest
from command_line import call

pytestmark = pytest.mark.ranks(1)

CASE = Path(__file__).parents[2] / "cases" / "two_dof" / "case.toml"


def short(*names: str) -> list[str]:
    keys = [f"{name}.{key}" for name in names for key in ("amplitude=[0.02, 0.03]", "harmonics=3", "samples=64")]
    return [*(word for key in keys for word in ("--set", key)), "--only", ",".join(names), "--no-plots", "-q"]


def notes(folder: Path, capsys) -> list[str]:
    assert call("show", folder) == 0
    return [line for line in capsys.readouterr().out.splitlines() if ": with " in line]


def test_each_analysis_has_those_of_its_run(tmp_path: Path, capsys) -> None:
    first = [*short("mode"), "--set", "contact.damper.friction_limit=4", "--set", "mode.report_at=[]"]
    second = [*short("mode_epmc"), "--set", "analysis.flutter.harmonics=5", "--petsc", "-snes_max_it 40"]
    for arguments in (first, second):
        assert call("run", CASE, *arguments, "--out", tmp_path) == 0
    one, two = notes(tmp_path, capsys)
    assert one == (
        "mode: with --set 'mode.amplitude=[0.02, 0.03]' --set mode.harmonics=3 --set mode.samples=64"
        " --set contact.damper.friction_limit=4 --set 'mode.report_at=[]'"
    )
    assert two.startswith("mode_epmc: with --set 'mode_epmc.amplitude") and two.endswith("--petsc '-snes_max_it 40'")
    assert "flutter" not in two and "mode.harmonics" not in two


def test_the_same_of_all_is_said_once(tmp_path: Path, capsys) -> None:
    arguments = ["--quick", "--only", "mode,mode_epmc", "--no-plots", "-q"]
    assert call("run", CASE, *arguments, "--out", tmp_path) == 0
    assert notes(tmp_path, capsys) == ["all: with --quick"]


def test_the_same_of_some_is_said_once(tmp_path: Path, capsys) -> None:
    for words in (["--quick", "--only", "mode,mode_epmc"], short("flutter")):
        plots = [] if "--no-plots" in words else ["--no-plots", "-q"]
        assert call("run", CASE, *words, *plots, "--out", tmp_path) == 0
    one, two = notes(tmp_path, capsys)
    assert one == "mode, mode_epmc: with --quick" and two.startswith("flutter: with --set")


def test_of_a_sweep(tmp_path: Path, capsys) -> None:
    arguments = [*short("mode"), "--set", "mode.report_at=[]", "--over", "contact.damper.friction_limit=4,5"]
    assert call("sweep", CASE, *arguments, "--out", tmp_path) == 0
    (line,) = notes(tmp_path, capsys)
    assert line.startswith("mode: with --set 'mode.amplitude=[0.02, 0.03]'") and "friction_limit" not in line


def test_a_case_as_it_is_needs_no_word(tmp_path: Path, capsys) -> None:
    changed = tmp_path / "case.toml"
    text = CASE.read_text().replace(
        "amplitude = [0.02, 3.0]\nreport_at = [0.05, 0.13, 0.14, 0.17, 0.25, 0.5, 2.0]", "amplitude = [0.02, 0.03]"
    )
    changed.write_text(text)
    assert call("run", changed, "--only", "mode", "--no-plots", "-q", "--out", tmp_path / "run") == 0
    assert notes(tmp_path / "run", capsys) == []
