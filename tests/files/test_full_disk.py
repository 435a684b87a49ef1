"""A full disk ends a run in one message, and it goes on from there (long form: cases/robustness/full_disk.py)."""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import h5py
import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "cases" / "robustness"))
from command_line import call
from test_results import fill, writer

from fretwave.files.whole import FileError, Unfailing
from fretwave.mpi.guard import describe
from fretwave.results.results import open_results
from fretwave.texts import display

pytestmark = pytest.mark.ranks(1)


def full_after(monkeypatch, count: int) -> None:
    """The disk takes so many bytes more."""
    left = [count]

    def limited(real: Callable[..., int]) -> Callable[..., int]:
        def write(descriptor: int, data: bytes, *place: int) -> int:
            if descriptor <= 2:
                return real(descriptor, data, *place)
            part = bytes(data)[: left[0]]
            if len(data) and not part:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            left[0] -= len(part)
            return real(descriptor, part, *place)

        return write

    for name in ("write", "pwrite"):
        monkeypatch.setattr(os, name, limited(getattr(os, name)))


@pytest.mark.parametrize("room", [0, 3000, 6000, 12000, 30000, 45000])
def test_what_was_written_before_a_full_disk_is_kept(tmp_path: Path, monkeypatch, room: int) -> None:
    whole = writer(tmp_path / "whole")
    fill(whole, 9)
    whole.close("done", "")
    table, message = writer(tmp_path / "run"), ""
    with monkeypatch.context() as patch:
        full_after(patch, room)
        try:
            fill(table, 9)
            table.close("done", "")
        except FileError as error:
            message = error.render()
        table.abandon()
    kept = table.rows
    assert "the disk takes no more" in message and "No space left" in message
    table = writer(tmp_path / "run")
    if (tmp_path / "run" / ".mode.rows").exists():
        with open_results(tmp_path / "run" / "results.h5") as file:
            assert len(file["mode/points/zeta"]) >= kept
        table.go_on()
    fill(table, 9 - table.rows)
    table.close("done", "")
    assert (tmp_path / "run" / "mode.csv").read_bytes() == (tmp_path / "whole" / "mode.csv").read_bytes()
    with h5py.File(tmp_path / "run" / "results.h5") as one, h5py.File(tmp_path / "whole" / "results.h5") as two:
        assert np.array_equal(one["mode/coefficients"], two["mode/coefficients"])


def test_hdf5_never_meets_a_failing_write(tmp_path: Path, monkeypatch) -> None:
    raw = Unfailing(tmp_path / "a.h5")
    full_after(monkeypatch, 2000)
    with h5py.File(raw, "w") as file:
        file["x"] = np.arange(10000.0)
    with pytest.raises(FileError, match="takes no more"):
        raw.close()


@pytest.mark.parametrize("room", [0, 2000, 8000, 20000, 40000, 60000, 80000])
def test_nothing_is_read_of_what_a_full_disk_has_not_taken(tmp_path: Path, monkeypatch, room: int) -> None:
    """A line said that damping was 12 % instead of 0.07 %, and a curve was written of it, before the disk's error."""
    table = writer(tmp_path / "run")
    fill(table, 9)
    right = {name: np.asarray(values) for name, values in table.group["points"].items()}
    table.abandon()
    table.go_on()
    with monkeypatch.context() as patch:
        full_after(patch, room)
        with suppress(FileError):
            for name, values in table.group["points"].items():
                assert np.array_equal(values, right[name]), name
        with pytest.raises(FileError, match="takes no more"):
            table.close("done", "")
            table.publish()
    table.abandon()


def test_a_full_disk_ends_the_command_in_one_message(tmp_path: Path, monkeypatch, capfd) -> None:
    import small_runs

    scene = small_runs.scenes(tmp_path)[0]
    full_after(monkeypatch, 30000)
    assert call(*scene.start(tmp_path / "run")) == 1
    said = capfd.readouterr().err
    assert said.count("error:") == 1 and "Traceback" not in said
    assert "fretwave resume" in said and "  fix: " in said
    monkeypatch.undo()
    assert call("resume", tmp_path / "run", "--no-plots") == 0


def test_a_file_in_the_place_of_the_folder_is_named(tmp_path: Path, capfd) -> None:
    import small_runs

    (tmp_path / "run").write_text("")
    assert call(*small_runs.scenes(tmp_path)[0].start(tmp_path / "run")) == 2
    said = capfd.readouterr().err
    assert said.count("error:") == 1 and display(tmp_path / "run") in said and "Traceback" not in said


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (OSError(errno.ENOSPC, "No space left on device"), "the disk takes no more"),
        (MemoryError("Unable to allocate 7 TiB"), "not enough memory"),
        (RuntimeError("std::bad_alloc"), "not enough memory"),
        (PermissionError(errno.EACCES, "Permission denied", "runs"), "runs"),
    ],
)
def test_errors_of_the_machine_come_without_a_traceback(error: BaseException, said: str) -> None:
    text = describe(error)
    assert said in text and "Traceback" not in text and "  fix: " in text
