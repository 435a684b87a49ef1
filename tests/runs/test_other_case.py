"""A folder with the results of another case is refused, and given up with ``--force``; one's own is used again."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import h5py
import pytest
from command_line import call

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
