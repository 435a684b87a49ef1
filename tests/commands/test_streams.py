"""Standard streams that a shell has closed, or that take no more: the work is done, or one message says why not."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import fretwave as fw

pytestmark = pytest.mark.ranks(1)

CASE = Path(__file__).parents[2] / "cases" / "two_dof" / "case.toml"
SHORT = "--set mode.harmonics=3 --set mode.amplitude=[0.02,0.03] --set mode.report_at=[]"
RUN = f"run {CASE} --only mode --no-plots {SHORT}"


def ended(arguments: str, streams: str) -> tuple[int, str]:
    """Exit code, and what came out wherever it could."""
    command = f"exec '{sys.executable}' -m fretwave {arguments} {streams}"
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, timeout=60)
    return done.returncode, done.stdout + done.stderr


@pytest.mark.parametrize("streams", [">&-", ">&- 2>&-", "<&- >&- 2>&-"])
def test_a_run_needs_nobody_to_listen(tmp_path: Path, streams: str) -> None:
    """Python's own error came out; and a file of the results could have had the number of what is printed to."""
    assert ended(f"{RUN} --out {tmp_path / 'run'}", streams) == (0, "")
    assert fw.open_run(tmp_path / "run")["mode"]["amplitude"][-1] == pytest.approx(0.03, rel=1e-9)


@pytest.mark.parametrize("arguments", ["--version", "check --keys", f"check --no-solve {CASE}"])
def test_other_commands_neither(arguments: str) -> None:
    assert ended(arguments, ">&-") == (0, "")


@pytest.mark.parametrize("arguments", ["--help", "check --keys", f"check --no-solve {CASE}"])
def test_a_full_disk_under_what_is_printed_is_one_message(arguments: str) -> None:
    """There were two tracebacks, of the message's own printing too."""
    code, said = ended(arguments, ">/dev/full")
    assert code == 1 and said.startswith("error: the disk takes no more") and said.count("\n") == 3


def test_a_message_that_cannot_be_printed_leaves_its_exit_code() -> None:
    for streams in ("2>&-", "2>/dev/full", ">/dev/full 2>/dev/full"):
        assert ended("check nowhere.toml", streams) == (2, "")


def test_letters_that_the_output_has_not_are_escaped(tmp_path: Path) -> None:
    """A title in Greek ended the run at its first line, as a defect of fretwave."""
    text = CASE.read_text().replace("Two-dof oscillator", "Ω")
    (tmp_path / "case.toml").write_text(text, encoding="utf-8")
    run = RUN.replace(str(CASE), str(tmp_path / "case.toml"))
    command = f"PYTHONIOENCODING=ascii exec '{sys.executable}' -m fretwave {run} --out {tmp_path / 'run'}"
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stderr) == (0, "") and "\\u03a9" in done.stdout.splitlines()[0]
    assert "Ω" in (tmp_path / "run" / "run.log").read_text(encoding="utf-8").splitlines()[0]
