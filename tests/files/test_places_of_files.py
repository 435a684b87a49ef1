"""Where files are put: never in the place of a device or a pipe, and behind a link."""

from __future__ import annotations

import os
import stat
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from fretwave.errors import InputError
from fretwave.files.whole import is_stream, replace_text, replaced
from fretwave.view.vtkhdf import GridFile

pytestmark = pytest.mark.ranks(1)


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
    disk, link = tmp_path / "disk", tmp_path / "link.csv"
    disk.mkdir()
    (disk / "table.csv").write_text("old")
    link.symlink_to(disk / "table.csv")
    with replaced(link, own=own) as fresh:
        fresh.write_text("new")
        assert fresh.parent == disk
    assert link.is_symlink() and (disk / "table.csv").read_text() == "new" == link.read_text()
    assert sorted(tmp_path.rglob("*")) == sorted([disk, link, disk / "table.csv"])


def test_a_file_written_in_any_order_is_no_pipe(tmp_path: Path) -> None:
    pipe = tmp_path / "steps.vtkhdf"
    os.mkfifo(pipe)
    with pytest.raises(InputError, match="a device or a pipe"):
        GridFile(pipe, [0.0])
    assert stat.S_ISFIFO(pipe.stat().st_mode) and list(tmp_path.iterdir()) == [pipe]
