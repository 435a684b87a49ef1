"""Journals: the same bytes from any number of ranks; long arrays are read and published a piece at a time."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from mpi4py import MPI

from fretwave.mpi.spread import Spread, send_parts
from fretwave.results import journal_records, rows
from fretwave.results.journal_records import Record, Stored, read_records, write_record
from fretwave.results.results import AnalysisWriter, open_results

WHOLE = np.linspace(-1.0, 1.0, 60).reshape(20, 3)
COLUMNS = ["point", "event"]


def part(comm: MPI.Comm, whole: npt.NDArray[np.float64]) -> Spread:
    """This rank's rows."""
    ends = np.linspace(0, len(whole), comm.size + 1, dtype=int)
    return Spread(comm, whole[ends[comm.rank] : ends[comm.rank + 1]])


def written(path: Path, comm: MPI.Comm) -> None:
    """Two records with plain arrays and one that is spread, as rank 0 and the others take part in them."""
    given = part(comm, WHOLE)
    arrays = {"first": [1.0, 2.0], "spread": given, "last": np.arange(3)}
    if comm.rank:
        send_parts(arrays)
        send_parts(arrays)
        return
    with path.open("wb", buffering=0) as file:
        place = write_record(file.fileno(), 0, Record("row", {"point": 0}, arrays))
        write_record(file.fileno(), place, Record("row", {"point": 1}, arrays))


@pytest.mark.ranks(1, 2, 3, 4)
def test_the_same_bytes_from_any_number_of_ranks(comm: MPI.Comm, tmp_path: Path) -> None:
    written(tmp_path / "parallel", comm)
    if comm.rank:
        return
    written(tmp_path / "serial", MPI.COMM_SELF)
    assert (tmp_path / "parallel").read_bytes() == (tmp_path / "serial").read_bytes()
    found = [record for _, record in read_records(tmp_path / "parallel")]
    assert [record.values["point"] for record in found] == [0, 1]
    for record in found:
        assert np.array_equal(record.arrays["spread"], WHOLE)
        assert list(record.arrays["first"]) == [1.0, 2.0] and list(record.arrays["last"]) == [0, 1, 2]


@pytest.mark.ranks(1)
def test_a_record_without_its_head_is_torn(comm: MPI.Comm, tmp_path: Path) -> None:
    """As a kill leaves it, whose content is there already."""
    written(tmp_path / "whole", comm)
    second = [place for place, _ in read_records(tmp_path / "whole")][1]
    data = bytearray((tmp_path / "whole").read_bytes())
    data[second : second + 20] = bytes(20)
    (tmp_path / "torn").write_bytes(data)
    assert [record.values["point"] for _, record in read_records(tmp_path / "torn")] == [0]


@pytest.mark.ranks(1)
def test_what_a_writer_has_yet_to_end_is_not_damaged(comm: MPI.Comm, tmp_path: Path) -> None:
    """A reader beside it: behind a record that it met half written another one is whole by now."""
    written(tmp_path / "whole", comm)
    data = (tmp_path / "whole").read_bytes()
    second = [place for place, _ in read_records(tmp_path / "whole")][1]
    (tmp_path / "rows").write_bytes(data[:second] + bytes(30))
    reader = read_records(tmp_path / "rows")
    next(reader)
    with (tmp_path / "rows").open("ab") as file:
        file.write(data[second:])
    assert not list(reader)


@pytest.mark.ranks(1)
def test_rows_of_a_long_array_are_read_when_asked_for(
    comm: MPI.Comm, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(journal_records, "BLOCK", 100)
    written(tmp_path / "rows", comm)
    for _, record in read_records(tmp_path / "rows"):
        stored = record.arrays["spread"]
        assert isinstance(stored, Stored) and stored.ndim == 2 and stored.shape == WHOLE.shape
        assert np.array_equal(stored[3:7], WHOLE[3:7]) and np.array_equal(stored[18:30], WHOLE[18:])
        (tmp_path / "rows").unlink(missing_ok=True)
        assert np.array_equal(np.asarray(stored), WHOLE)
        assert list(record.arrays["last"]) == [0, 1, 2]


@pytest.mark.ranks(1)
@pytest.mark.parametrize("count", [4, 5])
def test_what_is_gone_on_from_stays_while_later_states_are_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, count: int
) -> None:
    """States are written over in turn: not what is still read from, and never the only one that is whole."""
    monkeypatch.setattr(journal_records, "BLOCK", 100)

    def fill(writer: AnalysisWriter, first: int, end: int) -> None:
        for k in range(first, end):
            writer.append({"point": k, "event": ""}, None, None, {"y": k * WHOLE, "index": k})

    writer = AnalysisWriter(tmp_path, "mode", COLUMNS, {"type": "mode"})
    fill(writer, 0, count)
    writer.abandon()
    again = AnalysisWriter(tmp_path, "mode", COLUMNS, {"type": "mode"})
    found = again.go_on()
    assert found is not None and isinstance(found["y"], Stored)
    fill(again, count, count + 1)
    again.abandon()
    for path in (tmp_path / ".mode.state", tmp_path / ".mode.state_other"):
        assert [int(record.values["rows"]) - count in (0, 1) for _, record in read_records(path)] == [True]
    third = AnalysisWriter(tmp_path, "mode", COLUMNS, {"type": "mode"})
    assert int((third.go_on() or {})["index"]) == count
    fill(third, count + 1, count + 5)
    assert np.array_equal(np.asarray(found["y"]), (count - 1) * WHOLE)
    third.abandon()


@pytest.mark.ranks(1, 2)
@pytest.mark.parametrize("size", [1 << 30, 100])
def test_long_rows_in_the_results(comm: MPI.Comm, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, size: int) -> None:
    """Coefficients and state of points come back, whether as a whole or by pieces."""
    monkeypatch.setattr(journal_records, "BLOCK", size)
    monkeypatch.setattr(rows, "BATCH_BYTES", size)
    folder = Path(comm.bcast(str(tmp_path)))
    dofs, labels = [str(k) for k in range(20)], ["0", "1c", "1s"]
    given = {"type": "mode"}
    writer = AnalysisWriter(folder, "mode", COLUMNS, given, dofs, labels, active=comm.rank == 0)
    for k in range(3):
        state = {"y": part(comm, (k + 1.0) * WHOLE.ravel()), "index": k}
        writer.append({"point": k, "event": ""}, part(comm, k * WHOLE), None, state)
    writer.abandon()
    if comm.rank:
        return
    again = AnalysisWriter(folder, "mode", COLUMNS, given, dofs, labels)
    state_kept = again.go_on()
    assert state_kept is not None and int(state_kept["index"]) == 2
    assert np.array_equal(np.asarray(state_kept["y"]), 3.0 * WHOLE.ravel())
    again.append({"point": 3, "event": ""}, 3.0 * WHOLE[:, :2], None, None)  # of fewer harmonics
    again.close("done", "stop value reached")
    with open_results(folder / "results.h5") as file:
        data = file["mode/coefficients"]
        assert data.shape == (4, 20, 3) and (data.chunks[1] < 20) == (size == 100)
        for k in range(3):
            assert np.array_equal(data[k], k * WHOLE)
        assert np.array_equal(data[3, :, :2], 3.0 * WHOLE[:, :2])


@pytest.mark.ranks(2, 3)
def test_the_writing_rank_holds_no_point_as_a_whole(comm: MPI.Comm, tmp_path: Path) -> None:
    """Of 16 MB a rank, it takes a message's 32 MB at the most, whatever the number of ranks."""
    folder, n = Path(comm.bcast(str(tmp_path))), 2_000_000
    local = np.full((n, 1), float(comm.rank))
    given = Spread(comm, local)
    writer = AnalysisWriter(folder, "mode", COLUMNS, {"type": "mode"}, ["x"], ["1c"], active=comm.rank == 0)
    writer.append({"point": 0, "event": ""}, given, None, {"y": given})
    tracemalloc.start()
    writer.append({"point": 1, "event": ""}, given, None, {"y": given})
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    writer.abandon()
    assert peak < 34e6 if comm.rank == 0 else peak < 1e6
