"""A killed run, sweep or study goes on to what the uninterrupted one has (long form: cases/robustness/kills.py)."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from functools import partial
from importlib import import_module
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "cases" / "robustness"))
import small_runs
from command_line import call
from kills import Counting
from small_runs import Scene, begins_like, differences

from fretwave.files.lock import FolderLock, check_free
from fretwave.results import journal
from fretwave.results.results import open_results
from fretwave.texts import display

pytestmark = pytest.mark.ranks(1)

NAMES = ("run", "sweep", "analysis", "study")
#: Share of the calls that change files after which a process dies; the last ones write tables and end the analysis.
PLACES = {
    ("run", False): 0.9,
    ("run", True): 0.3,
    ("sweep", False): 0.97,
    ("analysis", False): 0.97,
    ("study", False): 0.5,
}

#: What the scenes import, once for all forks.
LOADED = (
    "analyses.mode",
    "analyses.forced",
    "analyses.free_decay",
    "analyses.limit_cycle",
    "run.sweep_analysis",
    "commands.sweep",
    "commands.study",
)


@pytest.fixture(scope="module")
def known(tmp_path_factory) -> dict[str, Scene]:
    return {scene.name: scene for scene in small_runs.scenes(tmp_path_factory.mktemp("scenes"))}


def child(arguments: list[str], before=lambda: None) -> int:
    """Exit code of `fretwave` in a fork, which has no MPI of its own to start."""
    process = os.fork()
    if process == 0:
        code = 70
        try:
            null = os.open(os.devnull, os.O_WRONLY)
            os.dup2(null, 1)
            os.dup2(null, 2)
            before()
            code = call(*arguments)
        finally:
            os._exit(code)
    return os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])


@pytest.fixture(scope="module", autouse=True)
def the_same_calls_in_every_run() -> Iterator[None]:
    """States are forced onto the disk after so many seconds: on a busy machine one run makes calls another does not."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(journal, "SAFE_EVERY", float("inf"))
        yield


@pytest.fixture(scope="module")
def whole(the_same_calls_in_every_run, known, tmp_path_factory) -> dict[str, tuple[Path, int]]:
    """Of each scene the uninterrupted folder, and how many calls changed files on the way."""
    small_runs.load()
    for module in LOADED:
        import_module(f"fretwave.{module}")
    found = {}
    for name in NAMES:
        folder, note = tmp_path_factory.mktemp(name) / "run", tmp_path_factory.mktemp("note") / "count.bin"
        assert child(known[name].start(folder), Counting(-1, False, note).install) == 0
        found[name] = folder, note.stat().st_size
    return found


@pytest.mark.parametrize(("name", "torn"), PLACES)
def test_nothing_is_lost_twice_or_changed(known, whole, tmp_path: Path, name: str, torn: bool) -> None:
    expected, calls = whole[name]
    folder = tmp_path / "run"
    arguments = known[name].start(folder)
    assert child(arguments, Counting(int(PLACES[name, torn] * calls), torn).install) == -signal.SIGKILL
    assert begins_like(expected, folder) == []
    again = ["resume", str(folder), "--no-plots"] if (folder / "run.json").exists() else arguments
    assert child(again) == 0
    assert differences(expected, folder) == []


def test_every_call_after_the_last_row_may_be_the_last(known, whole, tmp_path: Path) -> None:
    """Tables, run.json, results.h5 and the removal of the journal: whichever is missing is made when it goes on."""
    expected, calls = whole["run"]
    for back in (2, 6, 11):
        folder = tmp_path / str(back)
        assert child(known["run"].start(folder), Counting(calls - back, False).install) == -signal.SIGKILL
        assert child(["resume", str(folder), "--no-plots"]) == 0
        assert differences(expected, folder) == []


def test_a_killed_run_can_be_shown(known, whole, tmp_path: Path, capsys) -> None:
    _, calls = whole["run"]
    folder = tmp_path / "run"
    child(known["run"].start(folder), Counting(calls // 4, False).install)
    assert call("show", folder) == 0
    assert "not finished" in capsys.readouterr().out


# One run at a time


def test_a_second_run_in_a_folder_is_refused(known, whole, tmp_path: Path, capsys) -> None:
    folder = tmp_path / "run"
    shutil.copytree(whole["run"][0], folder)
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    lock = FolderLock(folder)
    lock.take()
    for arguments in (known["run"].start(folder), ["resume", str(folder)], known["study"].start(folder)):
        assert call(*arguments) == 2
        said = capsys.readouterr().err
        assert "another run writes into this folder" in said and str(os.getpid()) in said and "  fix: " in said
    lock.release()
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before


def test_a_lock_ends_with_its_process(tmp_path: Path) -> None:
    def hold() -> None:
        FolderLock(tmp_path).take()
        os.kill(os.getpid(), signal.SIGKILL)

    child([], hold)
    assert (tmp_path / ".lock").exists()
    check_free(tmp_path)
    lock = FolderLock(tmp_path)
    lock.take()
    lock.release()


def test_a_run_on_another_host_counts_as_long_as_it_gives_signs_of_life(tmp_path: Path) -> None:
    from fretwave.errors import InputError

    (tmp_path / ".lock").write_text('{"host": "elsewhere", "pid": 7, "since": "2026-01-01 00:00:00"}')
    with pytest.raises(InputError, match="another run") as found:
        FolderLock(tmp_path).take()
    assert "process 7 on elsewhere" in str(found.value)
    long_ago = time.time() - 3600
    os.utime(tmp_path / ".lock", (long_ago, long_ago))
    FolderLock(tmp_path).take()


# Told to end

#: A thousand points: such a run does not end before mpirun has passed the signal on.
LONG = ("--set", "mode.step={initial=1e-3, maximum=1e-3}")


def told_to_end(arguments: list[str], ranks: int, number: int, after: str, all_ranks: bool = False) -> str:
    """What a command says whose ranks, or mpirun, get a signal once it has printed a line with these words.

    Its exit code is 130; that of Open MPI's mpirun is 1 when it is told itself, whatever its ranks answer.
    """
    launcher = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
    command = [*launcher, sys.executable, "-m", "fretwave", *arguments]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    # As Python knows the environment: MPI of this process has added to it what confuses mpirun. A suite in the
    # background ignores SIGINT, and a run started so keeps to that.
    heard = partial(signal.signal, number, signal.SIG_DFL)
    patient = {"OMPI_MCA_odls_base_sigkill_timeout": "4"}  # [s] that ranks have to answer, on a machine that is busy
    with subprocess.Popen(command, env={**os.environ, **patient}, preexec_fn=heard, **pipes) as process:  # type: ignore[call-overload]
        assert process.stdout is not None
        assert any(after in line for line in process.stdout)
        for told in children(process.pid) if all_ranks else [process.pid]:
            os.kill(told, number)
        _, said = process.communicate(timeout=60)
    assert process.returncode == (1 if ranks > 1 and not all_ranks else 130), said
    return said


def children(process: int) -> list[int]:
    return [int(text) for text in Path(f"/proc/{process}/task/{process}/children").read_text().split()]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_ranks_that_hear_it_themselves_answer_130(known, tmp_path: Path, number: int) -> None:
    """As launchers that pass signals on have it."""
    said = told_to_end([*known["run"].start(tmp_path / "run"), *LONG, "-v"], 2, number, "mode    3", all_ranks=True)
    assert said.count(f"interrupted by {signal.Signals(number).name}") == 1


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_told_to_end_it_says_how_to_go_on(known, tmp_path: Path, ranks: int, number: int) -> None:
    folder = tmp_path / "run"
    said = told_to_end([*known["run"].start(folder), *LONG, "-v"], ranks, number, "mode    3")
    assert said.count("interrupted by SIG") == 1 and f"`fretwave resume {display(folder)}`" in said
    assert "Traceback" not in said
    with open_results(folder / "results.h5") as file:
        assert len(file["mode/points/amplitude"]) > 3  # what it had told of


def test_a_resumed_run_and_a_sweep_told_to_end(known, whole, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    assert child(known["run"].start(folder), Counting(whole["run"][1] // 8, False).install) == -signal.SIGKILL
    said = told_to_end(["resume", str(folder), "-v"], 1, signal.SIGINT, "newton")
    assert f"finished points are kept in {display(folder)}" in said and "Traceback" not in said
    folder = tmp_path / "sweep"
    said = told_to_end(known["sweep"].start(folder), 1, signal.SIGINT, ": done (")
    assert f"finished points are kept in {display(folder)}" in said and "Traceback" not in said
