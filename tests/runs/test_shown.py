"""What is printed of a run: little that says something; run.log has every line, whatever is printed."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from command_line import call
from models.pad_beside_ground import MODEL, N0, PAD, K

from fretwave import console as module
from fretwave.console import Console, Estimate, Shown, duration

pytestmark = pytest.mark.ranks(1)

CASE = Path(__file__).parents[2] / "cases" / "two_dof" / "case.toml"
ARGUMENTS = ["run", CASE, "--quick", "--no-plots", "--only", "mode,flutter"]


@pytest.fixture(scope="module")
def printed(tmp_path_factory) -> dict[str, tuple[list[str], list[str]]]:
    """Of each option what a run prints, and its run.log, without times."""
    found = {}
    for option in ("", "-q", "-v"):
        folder = tmp_path_factory.mktemp("run")
        capture = pytest.MonkeyPatch()
        lines: list[str] = []
        capture.setattr(module, "_print", lines.append)
        assert call(*ARGUMENTS, *option.split(), "--out", folder) == 0
        capture.undo()
        found[option] = lines, (folder / "run.log").read_text().splitlines()
    return found


def test_verbose_prints_the_log(printed) -> None:
    lines, log = printed["-v"]
    assert lines == log and len(log) > 100


def test_quiet_prints_nothing(printed) -> None:
    assert printed["-q"][0] == []


def test_the_log_is_the_same_whatever_is_printed(printed) -> None:
    plain = [[re.sub(r"[-+\d.e ]+", "#", line) for line in log] for _, log in printed.values()]
    assert plain[0] == plain[1] == plain[2]


def test_the_short_form_has_what_happened(printed) -> None:
    lines, log = printed[""]
    assert set(lines) < set(log) and len(lines) < len(log) / 3
    points = [line for line in lines if line.startswith(("mode  ", "flutter  "))]
    words = ("fold", "report", "peak damping", "zero damping")
    assert points == [line for line in log if line.startswith(("mode  ", "flutter  ")) and line.endswith(words)]
    for said in ("mode: 1 of 2 analyses", "limit cycle at a = 0.137", "largest damping 3.703 %", "done after"):
        assert any(said in line for line in lines), said


SLOW = """
import time
import numpy as np
import fretwave as fw
def build():
    time.sleep(2.0)
    return fw.Structure(np.eye(1), 4.0 * np.eye(1), names=["m1"])
"""


def test_the_time_of_a_run_has_that_of_its_builder(tmp_path: Path, capfd) -> None:
    """Of `blisk_ring` it said 26 s after 90."""
    (tmp_path / "slow.py").write_text(SLOW)
    text = '[model]\nbuilder = "slow.py"\n[[analysis]]\nname = "modes"\ntype = "linear"\nmodes = 1\n'
    (tmp_path / "case.toml").write_text(text)
    assert call("run", tmp_path / "case.toml", "--no-plots", "--out", tmp_path / "run") == 0
    assert int(re.findall(r"done after (\d+) s", capfd.readouterr().out)[0]) >= 2


UNREAD = 141  #: as shells count SIGPIPE


def test_a_reader_who_leaves_ends_a_run_without_a_word(tmp_path: Path) -> None:
    """`fretwave run ... -v | head -1`: it ended in PETSc's report of a fault. What was found is kept."""
    command = [sys.executable, "-m", "fretwave", *map(str, ARGUMENTS), "-v", "--out", str(tmp_path / "run")]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None and process.stderr is not None
    lines = [process.stdout.readline() for _ in range(6)]
    process.stdout.close()
    said = process.stderr.read()
    assert process.wait(timeout=60) == UNREAD and said == "" and all(lines)
    assert call("resume", tmp_path / "run", "-q", "--no-plots") == 0


def unread(*words: object) -> tuple[int, str]:
    """Exit code and what is said of a command whose standard output nobody reads."""
    reader, writer = os.pipe()
    os.close(reader)
    kept = {key: value for key, value in os.environ.items() if key != "PYTHONUNBUFFERED"}
    process = [sys.executable, "-m", "fretwave", *map(str, words)]
    done = subprocess.run(process, stdout=writer, stderr=subprocess.PIPE, text=True, env=kept)
    os.close(writer)
    return done.returncode, done.stderr


@pytest.mark.parametrize(
    "words",
    (
        "--version",
        "doctor",
        "doctor --constants",
        "check CASE",
        "check --keys",
        "check --schema",
        "check --schema CASE",
        "run CASE --quick --only mode --out OUT",
    ),
)
def test_output_that_nobody_reads_ends_without_a_word(tmp_path: Path, words: str) -> None:
    """What Python had kept to print at its end made exit code 120 and "Exception ignored"; PETSc reported a fault."""
    given = words.replace("CASE", str(CASE)).replace("OUT", str(tmp_path / "run"))
    assert unread(*given.split()) == (UNREAD, "")


def test_so_does_one_whose_plug_in_brings_petsc(tmp_path: Path) -> None:
    law = Path(__file__).parents[1] / "models" / "toy_law.py"
    (tmp_path / "plug.py").write_text(law.read_text() + "\nimport petsc4py.PETSc\n")
    (tmp_path / "case.toml").write_text(f'plugins = ["plug.py"]\n{CASE.read_text()}')
    assert unread("check", "--keys", tmp_path / "case.toml") == (UNREAD, "")


@pytest.mark.parametrize("command", ("show", "probe --csv --dof m1", "plot", "report"))
def test_so_do_those_that_read_results(tmp_path_factory, command: str) -> None:
    """Some print inside a block in which an error of the system gets the name of a file, or on the first rank alone."""
    folder = tmp_path_factory.getbasetemp() / "unread"
    if not folder.exists():
        assert call(*ARGUMENTS, "-q", "--out", folder) == 0
    first, *more = command.split()
    code, said = unread(first, folder, *more)
    assert code == UNREAD and not re.search("error|Exception|Broken", said)


def test_an_error_is_told_although_nobody_reads_the_rest(tmp_path: Path) -> None:
    """What was printed before it is dropped."""
    loose = MODEL.replace(f"K = {K.tolist()}", "K = [[0.0, 0.0], [0.0, 2.0]]") + PAD.replace(f"= {N0}", "= 0.0")
    mode = '[[analysis]]\nname = "mode"\ntype = "mode"\nharmonics = 1\nnormalise = "x"\namplitude = [0.1, 3.0]\n'
    (tmp_path / "case.toml").write_text(loose + mode)
    code, said = unread("check", tmp_path / "case.toml")
    assert code == 2 and said.startswith("error: linear mode 1 is a rigid motion") and "Exception" not in said


def test_a_broken_pipe_is_no_error_of_a_file(tmp_path: Path) -> None:
    from mpi4py import MPI

    from fretwave.files.whole import told
    from fretwave.mpi.guard import on_first_rank

    def left() -> None:
        with told(tmp_path / "file"):
            raise BrokenPipeError

    with pytest.raises(BrokenPipeError):
        on_first_rank(MPI.COMM_SELF, left)


def test_resume_and_sweep_are_quiet_too(tmp_path: Path, capfd) -> None:
    folder = tmp_path / "sweep"
    short = [
        "--quick",
        "--no-plots",
        "--only",
        "mode",
        "--set",
        "mode.amplitude=[0.02,0.03]",
        "--set",
        "mode.report_at=[]",
    ]
    assert call("sweep", CASE, *short, "--over", "mode.harmonics=3,5", "-q", "--out", folder) == 0
    assert call("resume", folder, "-q", "--no-plots") == 0
    assert capfd.readouterr().out == ""
    assert call("resume", folder, "--no-plots") == 0
    assert "harmonics = 3: already done" in capfd.readouterr().out


def test_both_at_once_are_refused(capfd) -> None:
    assert call(*ARGUMENTS, "-q", "-v") == 2
    assert "not allowed with" in capfd.readouterr().err


def points(console: Console) -> None:
    with console.progress("mode"):
        console.point("mode 0 plain", "a 1", 0.25)
        console.point("mode 1 fold", "a 2", 0.5, notable=True)


@pytest.mark.parametrize("shown", list(Shown))
@pytest.mark.parametrize("terminal", [True, False])
def test_points_that_stay(capsys, terminal: bool, shown: Shown) -> None:
    lines: list[str] = []
    points(Console(True, lines.append, terminal, shown))
    said = capsys.readouterr().out
    assert lines == ["mode 0 plain", "mode 1 fold"]
    assert ("mode 1 fold" in said) == (shown > Shown.NOTHING)
    assert ("mode 0 plain" in said) == (shown is Shown.ALL)


def test_other_ranks_say_nothing(capsys) -> None:
    lines: list[str] = []
    points(Console(False, lines.append, True, Shown.ALL))
    assert (capsys.readouterr().out, lines) == ("", [])


class Clock:
    now = 100.0

    def perf_counter(self) -> float:
        return self.now


def test_time_that_is_left(monkeypatch) -> None:
    clock = Clock()
    monkeypatch.setattr(module, "time", clock)
    estimate = Estimate()
    assert estimate.left(0.2) == ""  # a run that goes on from here
    clock.now += 30.0
    assert estimate.left(0.21) == ""
    assert estimate.left(0.4) == "about 1 min 30 s left"


def test_long_analyses_say_how_far_they_are_more_and_more_seldom(monkeypatch, capsys) -> None:
    clock = Clock()
    monkeypatch.setattr(module, "time", clock)
    console = Console(True, terminal=False)
    with console.progress("mode"):
        for second in range(12 * 3600):
            console.point("a plain point", "a 1 m", second / (12 * 3600))
            clock.now += 1.0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "mode: 0 % of the way after 30 s, a 1 m"
    assert lines[-1] == "mode: 69 % of the way after 8 h 18 min, a 1 m, about 3 h 41 min left"
    assert len(lines) == 18


@pytest.mark.parametrize(
    ("seconds", "said"), [(0.4, "0 s"), (59.7, "1 min 0 s"), (3599, "59 min 59 s"), (7500, "2 h 05 min")]
)
def test_durations(seconds: float, said: str) -> None:
    assert duration(seconds) == said


def test_what_was_done_once_is_said_so() -> None:
    from types import SimpleNamespace

    from fretwave.analyses.parts.branch import tell_fallbacks

    said: list[str] = []
    context = SimpleNamespace(name="mode", entry={}, console=SimpleNamespace(line=said.append))
    tell_fallbacks(context, SimpleNamespace(fallbacks={"rebuilt": 1, "condensed": 2, "whole": 0, "said": ""}))
    (line,) = said
    assert line.endswith("preconditioner rebuilt once, condensed contact system factorised 2 times")
