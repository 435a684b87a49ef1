"""Where files are put: never in the place of a device or a pipe, and behind a link."""

from __future__ import annotations

import os
import stat
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path

import pytest
from command_line import call

from fretwave.errors import InputError
from fretwave.files.place import expect_writable
from fretwave.files.streams import is_stream
from fretwave.files.whole import replace_text, replaced
from fretwave.view.vtkhdf import GridFile

pytestmark = pytest.mark.ranks(1)

CASE = Path(__file__).parents[2] / "cases" / "two_dof" / "case.toml"


def through_a_pipe(pipe: Path, write: Callable[[Path], object]) -> str:
    """What comes out of a named pipe that is written to."""
    os.mkfifo(pipe)
    read: list[str] = []
    reader = threading.Thread(target=lambda: read.append(pipe.read_text()), daemon=True)
    reader.start()
    write(pipe)
    reader.join(20)
    assert not reader.is_alive() and stat.S_ISFIFO(pipe.stat().st_mode)
    return read[0]


def test_a_pipe_takes_what_is_written(tmp_path: Path) -> None:
    """As `--out /dev/stdout` or `>(...)`; written as root, /dev/null had become a file."""
    assert through_a_pipe(tmp_path / "text", lambda pipe: replace_text(pipe, "all of it")) == "all of it"
    assert list(tmp_path.iterdir()) == [tmp_path / "text"]


def test_devices_and_pipes_are_told_from_files(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    known = {"/dev/null": True, "/dev/stdout/none": False, tmp_path / "file": False, tmp_path: False}
    assert {place: is_stream(Path(place)) for place in known} == known


@pytest.mark.parametrize("own", [False, True])
def test_a_link_stays_one(tmp_path: Path, own: bool) -> None:
    """The file behind it, on another disk perhaps, is replaced; nothing is left beside either."""
    disk, link = tmp_path / "disk", tmp_path / "link.png"
    disk.mkdir()
    (disk / "3fa9c1").write_text("old")
    link.symlink_to(disk / "3fa9c1")
    with replaced(link, own=own, keep_suffix=own) as fresh:
        fresh.write_text("new")
        assert fresh.parent == disk and (fresh.suffix == ".png") == own
    assert link.is_symlink() and (disk / "3fa9c1").read_text() == "new" == link.read_text()
    assert sorted(tmp_path.rglob("*")) == sorted([disk, link, disk / "3fa9c1"])


WRITER = "from pathlib import Path; from fretwave.files.whole import replace_text as r; r(Path({}), 'told\\n')"


@pytest.mark.parametrize("place", ["/dev/stdout", "/dev/fd/1", "/proc/self/fd/1"])
def test_what_a_shell_has_opened_keeps_what_it_had(tmp_path: Path, place: str) -> None:
    """`(echo first; fretwave report --out /dev/stdout; echo last) >> log`"""
    log = tmp_path / "log"
    log.write_text("before\n")
    code = WRITER.format(repr(place))
    subprocess.run(
        ["sh", "-c", f"(echo first; '{sys.executable}' -c \"{code}\"; echo last) >> '{log}'"], check=True, timeout=60
    )
    assert log.read_text().split() == ["before", "first", "told", "last"]


def test_a_file_written_in_any_order_is_no_pipe(tmp_path: Path) -> None:
    pipe = tmp_path / "steps.vtkhdf"
    os.mkfifo(pipe)
    with pytest.raises(InputError, match="a device or a pipe"):
        GridFile(pipe, [0.0])
    assert stat.S_ISFIFO(pipe.stat().st_mode) and list(tmp_path.iterdir()) == [pipe]


@pytest.mark.parametrize("place", ["/proc/1/run", "/proc/run/deep"])
def test_a_place_without_files_is_refused_before_anything_is_solved(
    place: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """The folder is made with the first point, which may come hours later."""

    def solved(*_: object, **__: object) -> None:
        raise AssertionError("a model is built")

    monkeypatch.setattr("fretwave.case.build.build_model", solved)
    assert call("run", CASE, "--out", place) == 1
    said = capfd.readouterr().err
    assert "a file cannot be written or read" in said and "/proc" in said and "check that the folder" in said


def test_nothing_is_left_where_it_was_tried(tmp_path: Path) -> None:
    expect_writable(tmp_path / "runs" / "deep")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("target", ["gone", "run"], ids=["gone", "itself"])
@pytest.mark.parametrize("below", ["", "below"], ids=["the_folder", "one_in_it"])
def test_a_link_that_leads_nowhere_is_no_folder_for_results(tmp_path: Path, capfd, target: str, below: str) -> None:
    """It was found when the first point was solved: the file exists, exit 1."""
    (tmp_path / "run").symlink_to(target)
    assert call("run", CASE, "--only", "mode", "--out", tmp_path / "run" / below) == 2
    said = capfd.readouterr()
    assert "this link leads nowhere" in said.err and f"run -> {target}" in said.err and "asymptotes" not in said.out
