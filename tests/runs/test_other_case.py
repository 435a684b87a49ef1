"""A folder with the results of another case is refused, and given up with ``--force``; one's own is used again."""

from __future__ import annotations

import html
import json
import shutil
from pathlib import Path

import h5py
import pytest
from command_line import call

from fretwave.plots import backbone, forced
from fretwave.report.report import report_text
from fretwave.results.reader import Run
from fretwave.results.stamp import of_one_model, stamp_of
from fretwave.texts import display

pytestmark = pytest.mark.ranks(1)

CASE = Path(__file__).parents[2] / "cases" / "two_dof" / "case.toml"
SHORT = [
    "--quick",
    "--no-plots",
    "--only",
    "mode",
    "-q",
    "--set",
    "mode.amplitude=[0.02,0.03]",
    "--set",
    "mode.report_at=[]",
]


@pytest.fixture(scope="module")
def first(tmp_path_factory) -> Path:
    """Results of a case."""
    folder = tmp_path_factory.mktemp("first")
    assert call("run", CASE, *SHORT, "--out", folder) == 0
    return folder


@pytest.fixture
def folder(first: Path, tmp_path: Path) -> Path:
    """A copy of them."""
    return Path(shutil.copytree(first, tmp_path / "run"))


@pytest.fixture
def other(tmp_path: Path) -> Path:
    """Another case."""
    path = tmp_path / "other.toml"
    text = CASE.read_text().replace("[1.0, 0.0]", "[1.1, 0.0]").replace("\nmode.", "\nfirst.")
    for before in ("name = ", "backbone = [", "mode = "):
        text = text.replace(f'{before}"mode"', f'{before}"first"')
    path.write_text(text)
    return path


def names(folder: Path) -> set[str]:
    with h5py.File(folder / "results.h5") as file:
        return set(file)


def short(*analyses: str) -> list[str]:
    keys = [f"{name}.{key}" for name in analyses for key in ("amplitude=[0.02,0.03]", "report_at=[]")]
    changed = [word for key in keys for word in ("--set", key)]
    return ["--only", ",".join(analyses), "--no-plots", "-q", *changed, "--set", "first.harmonics=3"]


@pytest.mark.parametrize("command", ["run", "sweep", "study"])
def test_another_case_is_refused_before_anything_is_written(command, folder, other, capfd) -> None:
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    more = {"run": short("first"), "sweep": [*short("first"), "--over", "first.harmonics=3,5"], "study": []}
    assert call(command, other, *more[command], "--out", folder) == 2
    said = capfd.readouterr().err
    assert "error: this folder holds the results of another case" in said
    for line in (
        f"where:    {display(folder)}",
        "measured: ",
        "two_dof/case.toml",
        f"expected: {display(other)}",
        "fix: ",
        "--force",
    ):
        assert line in said
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before


def test_forced_only_the_other_case_is_there(folder: Path, other: Path) -> None:
    assert names(folder) == {"mode"}
    assert call("run", other, *short("first"), "--out", folder, "--force") == 0
    assert names(folder) == {"first"}
    assert set(json.loads((folder / "run.json").read_text())["analyses"]) == {"first"}


def test_the_same_case_changed_or_moved_is_no_other(folder: Path, tmp_path: Path) -> None:
    assert call("run", CASE, *SHORT, "--set", "mode.harmonics=5", "--out", folder) == 0
    assert call("run", CASE, *SHORT, "--out", folder) == 0
    moved = Path(shutil.copy(CASE, tmp_path / "moved.toml"))
    assert call("run", moved, *SHORT, "--out", folder) == 0


@pytest.fixture(scope="module")
def changed(tmp_path_factory) -> Path:
    """A mode of the changed case beside what was found of the case as it was."""
    path = tmp_path_factory.mktemp("changed") / "case.toml"
    words = [*SHORT[:4], "-q", "--set", "mode.amplitude=[0.02,1.0]", "--set", "mode.report_at=[]"]
    others = ["--set", "free_decay.amplitude=[0.8]", "--set", "forced.levels=[2.0]", "--set", "forced.time_points=0"]
    path.write_text(CASE.read_text())
    every = [*words[:3], "mode,mode_epmc,forced,free_decay", *words[4:], *others, "--out", path.parent / "run"]
    assert call("run", path, *every) == 0
    path.write_text(CASE.read_text().replace("friction_limit = 5.0", "friction_limit = 7.0"))
    assert call("run", path, *words, *others, "--out", path.parent / "run") == 0
    return path.parent / "run"


def test_results_of_the_case_before_it_changed_are_told_apart(changed: Path, capsys) -> None:
    assert call("show", changed) == 0
    now = "contact.damper.friction_limit = 5.0 (now 7.0)"
    said = f"mode_epmc, forced, free_decay: results of an earlier case, with {now}\n"
    assert said in capsys.readouterr().out
    assert call("show", changed, "--json") == 0
    told = {one["name"]: one["changed"] for one in json.loads(capsys.readouterr().out)["analyses"]}
    assert told["mode"] == "" and "friction_limit = 5.0" in told["forced"]
    assert said.strip() in html.unescape(report_text(changed))


def test_results_of_two_models_are_not_drawn_into_one_picture(changed: Path) -> None:
    run = Run(changed)
    assert not list(run.compared("free_decay"))
    assert [name for name, _ in backbone.figures(run)] == ["mode_backbone", "mode_epmc_backbone"]
    (figure,) = dict(forced.figures(run)).values()
    names = [line.get_label() for line in figure.axes[0].lines]
    assert "backbone, EPMC" in names and "backbone, CNM" not in names


def test_what_is_solved_in_another_way_is_of_the_same_model(changed: Path) -> None:
    """Other harmonics of the mode leave it beside its decay; dampers, which the decay has too, do not."""
    run = Run(changed)
    decay, mode = run["free_decay"], run["mode_epmc"]
    stamp = stamp_of(decay.attributes)
    own = {key: value for key, value in stamp.items() if key.startswith("mode.")}
    for key, value, same in (("harmonics", 9, True), ("dampers", [{"dof": "m1", "c": 1.0}], False)):
        assert f"mode.{key}" in own
        mode.attributes["case"] = json.dumps({**stamp, f"mode.{key}": value})
        assert of_one_model(decay, mode) is same


def test_a_study_or_a_sweep_does_not_hide_a_run(folder, capsys):
    """`show` takes a folder for one of them: the run's results were there, and nothing told of them."""
    study = ["study", CASE, "--analysis", "mode", "--harmonics", "3,5", "--repeats", "1", "--quick"]
    sweep = ["sweep", CASE, *SHORT, "--over", "mode.harmonics=3,5"]
    for words in (study, sweep):
        assert call(*words, "--out", folder) == 2
        said = capsys.readouterr().err
        assert "results of another kind" in said and "a run" in said and "--force" in said
    assert call("show", folder) == 0
    assert "0.02" in capsys.readouterr().out


def test_a_run_takes_a_sweeps_folder_by_force_alone(tmp_path, capsys):
    """And then the whole of it: results of the sweep stood beside those of the run."""
    assert call("sweep", CASE, *SHORT, "--over", "mode.harmonics=3,5", "--out", tmp_path) == 0
    epmc = ["run", CASE, "--quick", "--no-plots", "-q", "--only", "mode_epmc", "--out", tmp_path]
    assert call(*epmc) == 2
    assert "a sweep" in capsys.readouterr().err
    assert call(*epmc, "--force") == 0
    with h5py.File(tmp_path / "results.h5", "r") as file:
        assert set(file) == {"mode_epmc"}
    assert not (tmp_path / "values").exists() and call("show", tmp_path) == 0
    assert "sweep" not in capsys.readouterr().out
