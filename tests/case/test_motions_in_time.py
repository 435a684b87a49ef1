"""What analyses by time integration are refused before anything is computed."""

from __future__ import annotations

from pathlib import Path

import pytest
from command_line import call

from fretwave.case.checks import check_chosen
from fretwave.case.load import load_case
from fretwave.errors import CaseErrors, InputError

pytestmark = pytest.mark.ranks(1)
CASE = Path(__file__).parents[2] / "cases" / "two_dof" / "case.toml"


def problems(*overrides: str) -> list[InputError]:
    with pytest.raises(CaseErrors) as caught:
        load_case(CASE, list(overrides))
    return list(caught.value.problems)


@pytest.mark.parametrize("name", ["free_decay", "limit_cycle"])
@pytest.mark.parametrize("start", [0.0199, 3.001])
@pytest.mark.parametrize("command", ["check", "run"])
def test_a_start_outside_of_its_mode_is_refused_at_once(tmp_path, capfd, command: str, name: str, start: float) -> None:
    out = ["--out", tmp_path / "run"] if command == "run" else []
    assert call(command, CASE, "--set", f"{name}.amplitude=[0.3, {start}]", *out) == 2
    said = capfd.readouterr()
    assert f"error: {name}.amplitude[1] is outside the mode's branch" in said.err and "0 points" not in said.out
    assert "amplitude = [0.02, 3.0]" in said.err and "fix:" in said.err
    assert not (tmp_path / "run").exists()


def test_a_start_at_an_end_of_its_mode_is_right() -> None:
    case = load_case(CASE, ["limit_cycle.amplitude=[0.02, 3.0]", "free_decay.amplitude=[3.0000000000000004]"])
    check_chosen(case.analyses.values(), case)


def test_starts_that_are_left_out_bind_no_mode() -> None:
    assert (
        call("check", CASE, "--only", "mode", "--set", "mode.amplitude=[0.02,0.3]", "--set", "mode.report_at=[]") == 0
    )


def test_a_range_that_is_wrong_is_told_where_it_stands() -> None:
    [problem] = problems('mode.amplitude=["a", 3.0]')
    assert problem.what.startswith("mode.amplitude")


@pytest.mark.parametrize("name", ["free_decay", "limit_cycle"])
def test_a_tolerance_with_which_nothing_is_found_is_refused(name: str) -> None:
    """At 0.1 and 0.03 starts of this case left its limit cycle at 0.137 m for infinity."""
    load_case(CASE, [f"{name}.tolerance=1e-3"])
    for tolerance in (0.1, 0.03, 1.1e-3):
        [problem] = problems(f"{name}.tolerance={tolerance}")
        assert "<= 0.001" in str(problem.expected) and problem.fix


def test_too_few_periods_for_a_verdict_are_refused() -> None:
    load_case(CASE, ["limit_cycle.periods=12"])
    [problem] = problems("limit_cycle.periods=11")
    assert problem.what == "limit_cycle.periods is too few for a verdict" and problem.fix


@pytest.mark.parametrize("key", ["forced.levels", "mode.amplitude", "free_decay.amplitude", "limit_cycle.amplitude"])
def test_a_motion_has_a_size_whose_square_is_a_number(key: str) -> None:
    """A level of 1e155 ended in Python's own error, an amplitude of that as a mode that sticks."""
    found = problems(f"{key}=[1.0, 1e155]")
    assert "<= 1e+150" in str(found[0].expected) and found[0].fix


@pytest.mark.parametrize("loaded, refused", [("mode", "free_decay"), ("flutter", "limit_cycle"), ("forced", "forced")])
def test_a_preload_is_refused_wherever_it_is_given(loaded: str, refused: str) -> None:
    """An analysis' own one was not seen: its motions in time lacked the load, steady ones by 0.98 of themselves."""
    [problem] = problems(f"{loaded}.preload={{balanced=false}}")
    assert problem.what.startswith(refused) and "does not know a preload" in problem.what
    assert problem.fix and (loaded == refused or f"the preload of '{loaded}'" in problem.fix)


@pytest.mark.parametrize("loaded", ["mode", "flutter", "forced"])
@pytest.mark.parametrize("preload", ["{}", "{loads=[]}", "{loads=[], pair_loads=true, balanced=true}"])
def test_a_preload_without_loads_is_as_none(loaded: str, preload: str) -> None:
    """It was refused as one that acts."""
    assert load_case(CASE, [f"{loaded}.preload={preload}"]).acting_loads == []
