"""Sweeps that cannot be: named with their place before anything runs, by the command line and in a case."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from models.swept_case import CASE, OVER_LINE, fretwave

from fretwave.analyses.sweep import SweepAnalysis
from fretwave.case.load import load_case
from fretwave.errors import CaseErrors, InputError
from fretwave.post.grid import Plan
from fretwave.run.sweep_plan import plan_of

pytestmark = pytest.mark.ranks(1)


@pytest.fixture(scope="module")
def case(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("slider") / "slider.toml"
    path.write_text(CASE)
    return path


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--over", "contact.slider.friction_limt=1,2"], "--over contact.slider.friction_limt=1"),
        (["--over", "contact.slider.friction_limit=1,-2"], "--over contact.slider.friction_limit=-2"),
        (["--over", "mode.samples=5,64"], "write `samples = 6`"),
        (["--over", "mod.samples=64"], "did you mean `mode.samples`?"),
        (["--over", "model.K.0=1,2,3"], "measured: with 2 more values"),
        (["--over", "mode.samples=64,64"], "has the value 64 twice"),
        (["--over", "mode.samples="], "gives no array of values"),
        (["--over", "mode.samples"], "is not KEY=value"),
        (["--over", "mode.samples=64", "--over", "mode.samples=128"], "a second time"),
        (["--over", "mode.samples=64", "--over", "analysis.mode.samples=128"], "a second time"),
        (["--over", "mode.samples=64", "--groups", "5"], "so many groups"),
        (["--over", "mode.samples=64", "--only", "limits"], "there is no analysis 'limits'"),
        (["--over", "mode.harmonics=1,40"], "with harmonics = 40: mode.samples is too small"),
        ([], "--over KEY=v1,v2"),
    ],
)
def test_wrong_command_lines_run_nothing(case: Path, tmp_path: Path, capsys, arguments, said) -> None:
    shorter = ["--set", "mode.samples=64"] if "harmonics=1,40" in str(arguments) else []
    assert fretwave("sweep", case, *arguments, *shorter, "--out", tmp_path / "out") == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (("friction_limit = [0.2, 1.0, 5.0]", "friction_limt = [0.2]"), f"slider.toml:{OVER_LINE} (limits.over)"),
        (("overrides.mode.amplitude", "overrides.mode.ampltude"), f"slider.toml:{OVER_LINE + 1} (limits.overrides)"),
        (("[0.2, 1.0, 5.0]", "0.2"), "gives no array of values"),
        (("[0.2, 1.0, 5.0]", "[]"), "gives no array of values"),
        (
            ("overrides.mode", "over.mode.samples = [64]\nover.analysis.mode.samples = [64]\noverrides.mode"),
            "second time",
        ),
        (("overrides.mode", 'over.mode.samples = [64]\nover."mode.samples" = [64]\noverrides.mode'), "second time"),
        (('of = "mode"', 'of = "limits"'), "limits.of is no analysis to sweep"),
        (('of = "mode"', 'of = "mod"'), "did you mean `mode`?"),
        (('of = "mode"', 'of = "mode"\ndampers = [{ dof = "x", c = 1.0 }]'), "give them to 'mode'"),
    ],
)
def test_wrong_sweeps_of_a_case(tmp_path: Path, capsys, wrong, said) -> None:
    path = tmp_path / "slider.toml"
    path.write_text(CASE.replace(*wrong))
    for command in (["check", path], ["run", path, "--out", tmp_path / "out"]):
        assert fretwave(*command) == 2
        assert said in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_plans() -> None:
    plan = plan_of(["a.b=1, 2", 'c="x",[1.0, 2.0]', "d=y, true"])
    assert (len(plan), plan.shape) == (8, (2, 2, 2))
    assert list(plan.values())[3] == {"a.b": 1, "c": [1.0, 2.0], "d": True}
    assert plan.overrides()[4] == ["a.b=2", 'c="x"', 'd="y"']
    assert plan.labels()[4] == 'b = 2, c = "x", d = "y"'
    assert plan.labels() is plan.labels() and plan.overrides() is plan.overrides(), (
        "each of many values asks for its own"
    )
    assert Plan({"a.b": [1], "c.b": [2]}).labels() == ["a.b = 1, c.b = 2"]
    assert SweepAnalysis(name="s", type="sweep", of="m", over={"a.b": [1], "c": {"d": [2]}}).plan().keys == [
        "a.b",
        "c.d",
    ]
    assert len(Plan({"a": [1, 2, 3], "b": [True, False]})) == 6


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("1:4", [1, 2, 3, 4]),
        ("3:-1", [3, 2, 1, 0, -1]),
        ("7:7", [7]),
        ("1:3,9,-5:-4", [1, 2, 3, 9, -5, -4]),
        ("0.1:0.5:n=5", [0.1, 0.2, 0.3, 0.4, 0.5]),
        ("1e-3:.1:log=3", [0.001, 0.01, 0.1]),
        ("100.0:1:log=3", [100.0, 10.0, 1.0]),
        ("1:9:n=5", [1, 3, 5, 7, 9]),
        ("512:64:log=4", [512, 256, 128, 64]),
        ("1:6:n=3", [1.0, 3.5, 6.0]),
        ("-0.3:0.5:n=9", [-0.3, -0.2, -0.1, 0.0, 0.1, 0.2, 0.3, 0.4, 0.5]),
        ("-1e308:1e308:n=3", [-1e308, 0.0, 1e308]),
        ("1e-200:1e200:log=3", [1e-200, 1.0, 1e200]),
        ("a.npz:K,2:3", ["a.npz:K", 2, 3]),
    ],
)
def test_ranges(text: str, values: list) -> None:
    found = plan_of([f"key={text}"]).over["key"]
    assert found == values and [type(value) for value in found] == [type(value) for value in values]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("0.1:0.5", "not whole, without their count"),
        ("0.1:0.5:5", "ends in ':5'"),
        ("1:10:step=2", "ends in ':step=2'"),
        ("1:10:n=1", "2 to 100000 values"),
        ("0:10:log=3", "not positive"),
        ("1:999999", "999999 values"),
        ("1:3,2", "has the value 2 twice"),
        ("1,1.0", "has the value 1.0 twice"),
        ("[0.0],[-0.0]", "has the value [-0.0] twice"),
        ("10:20:30", "ends in ':30'"),
        ("1:1e400:n=3", "infinity"),
        ("2#,3", "what follows # is a comment"),
        ("2,3 # 5", "what follows # is a comment"),
        ("2,3] #", "TOML"),
    ],
)
def test_wrong_ranges(text: str, said: str) -> None:
    with pytest.raises(InputError) as found:
        plan_of([f"key={text}"])
    assert said in str(found.value) and f"--over key={text}" in str(found.value)


def test_equal_steps_between_decimal_numbers_are_decimal_numbers() -> None:
    """Exact, of 2000 ranges up and down, also through zero: k steps of a fraction, once rounded to a float."""
    random = np.random.default_rng(3)
    for _ in range(2000):
        first, step = (Fraction(int(n), 1000) for n in (random.integers(-500, 500), random.integers(1, 200)))
        count, down = int(random.integers(2, 40)), int(random.choice([1, -1]))
        exact = [float(first + down * step * k) for k in range(count)]
        assert plan_of([f"key={exact[0]!r}:{exact[-1]!r}:n={count}"]).over["key"] == exact


def test_problems_of_values_can_be_sent_between_ranks(case: Path) -> None:
    import pickle

    with pytest.raises(CaseErrors) as caught:
        load_case(case, ["mode.samples=5"])
    assert isinstance(pickle.loads(pickle.dumps(caught.value)), InputError)
