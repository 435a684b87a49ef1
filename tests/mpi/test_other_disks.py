"""Ranks that do not see the files of the first one: nothing waits for ever, and no rows are lost on their disks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from test_built import BUILDER, TEXT
from test_resume import command, kill_at
from test_sweep import column
from test_wear_case import WEAR
from tolerances import REPEATED

from fretwave.commands.main import main

pytestmark = pytest.mark.ranks(1)

#: The other ranks are told of another folder, and find nothing in the first one's.
PROGRAM = """
import sys
from pathlib import Path
from mpi4py import MPI
from fretwave.commands.main import main
from fretwave.mpi.guard import guarded
rank, (here, away, *words) = MPI.COMM_WORLD.rank, sys.argv[1:]
stat = Path.stat
def none_of_ours(path, **options):
    if str(path).startswith(here):
        raise FileNotFoundError(str(path))
    return stat(path, **options)
if rank:
    Path.stat, words = none_of_ours, [word.replace(here, away) for word in words]
sys.exit(guarded(lambda: main(words)))
"""
SWEEP = ["--only", "mode", "--over", "contact.pads.friction_coefficient=0.3,0.4"]


@pytest.fixture(scope="module")
def here(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("here")
    (folder / "model.py").write_text(BUILDER.read_text())
    (folder / "case.toml").write_text(TEXT.replace("[2e-7, 2.2e-6]", "[1e-6, 1.8e-6]").split("report_at")[0] + WEAR)
    return folder


@pytest.fixture
def apart(here: Path, tmp_path: Path, launch):
    """A command on two ranks with a disk each."""

    def run(*words: str) -> str:
        done = launch(2, "-c", PROGRAM, str(here), str(tmp_path), *words, "--no-plots", timeout=120)
        assert done.returncode == 0, done.stderr
        return str(done.stdout)

    return run


def same(whole: Path, found: Path, name: str) -> None:
    for key in ("amplitude", "omega", "zeta"):
        one, other = (column(folder / f"{name}.csv", key) for folder in (whole, found))
        assert np.shape(one) == np.shape(other) and np.allclose(one, other, rtol=REPEATED), key


def start(verb: str, here: Path, out: str, *words: str) -> list[str]:
    return [verb, str(here / "case.toml"), *words, "--out", str(here / out)]


def test_lines_of_wear_meet_in_one_table(here: Path, apart) -> None:
    assert main([*start("run", here, "wear_whole", "--only", "wear"), "--no-plots"]) == 0
    apart(*start("run", here, "wear", "--only", "wear"))
    same(here / "wear_whole", here / "wear", "wear")


def test_a_run_whose_basis_is_kept_goes_on(here: Path, apart) -> None:
    assert main([*start("run", here, "whole", "--only", "mode"), "--no-plots"]) == 0
    kill_at(command(*start("run", here, "killed", "--only", "mode")), here / "killed" / "mode.csv", 4)
    assert (here / "killed" / "reduction.h5").exists()
    apart("resume", str(here / "killed"))
    same(here / "whole", here / "killed", "mode")


def test_a_sweep_and_one_that_goes_on(here: Path, apart) -> None:
    assert main([*start("sweep", here, "swept", *SWEEP), "--no-plots"]) == 0
    kill_at(command(*start("sweep", here, "cut", *SWEEP)), here / "cut" / "values" / "0001" / "mode.csv", 3)
    assert "one after the other" in apart(*start("sweep", here, "again", *SWEEP))
    apart("resume", str(here / "cut"))
    for found in ("again", "cut"):
        same(here / "swept", here / found, "mode")
