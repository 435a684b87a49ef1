"""Tables and results.h5: values come back, an earlier run is replaced only by a solved point, kills spoil nothing."""

from __future__ import annotations

import csv
import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest

from fretwave.columns import COLUMNS, MODE, Column
from fretwave.errors import InputError
from fretwave.results.results import AnalysisWriter, has_results, open_results

pytestmark = pytest.mark.ranks(1)

LABELS = ["1c", "1s", "3c", "3s"]


def row(index: int) -> dict[str, float | int | str]:
    """Numbers with all their digits."""
    values: dict[str, float | int | str] = {name: (index + 1) / 3.0 for name in MODE}
    values.update(point=index, newton=3, linear=3, event="report" if index % 3 == 0 else "")
    return values


def writer(folder: Path, name: str = "mode", **options: object) -> AnalysisWriter:
    return AnalysisWriter(folder, name, MODE, {"type": "mode"}, ["m1", "m2"], LABELS, **options)  # type: ignore[arg-type]


def fill(table: AnalysisWriter, count: int) -> None:
    """Rows with coefficients, every third with the contact's motion, each with a state."""
    for index in range(table.rows, table.rows + count):
        motion = {key: np.full((8, 1, 1), float(index)) for key in "uvf"}
        motions = {"damper": motion} if index % 3 == 0 else None
        state = {"y": np.full(5, float(index)), "index": index, "step": 0.5 * index}
        table.append(row(index), np.full((2, 4), float(index)), motions, state)


def test_values_units_and_names_come_back(tmp_path: Path) -> None:
    table = writer(tmp_path, file_attributes={"title": "a case"})
    fill(table, 7)
    table.close("done", "stop value reached", events="[]")
    with open(tmp_path / "mode.csv", newline="") as file:
        lines = list(csv.DictReader(file))
    assert list(lines[0]) == list(MODE)
    assert [float(line["zeta"]) for line in lines] == [row(i)["zeta"] for i in range(7)]
    with h5py.File(tmp_path / "results.h5") as file:
        group = file["mode"]
        assert file.attrs["title"] == "a case"
        assert group.attrs["status"] == "done"
        assert np.array_equal(group["points/zeta"], [row(i)["zeta"] for i in range(7)])
        assert group["points/omega"].attrs["units"] == "rad/s"
        assert group["points/omega"].attrs["long_name"] == COLUMNS["omega"].long_name
        assert group["points/event"][0] == b"report"
        assert group["coefficients"].shape == (7, 2, 4)
        assert [text.decode() for text in group["coefficients"].dims[1][0]] == [
            "m1",
            "m2",
        ]
        assert [text.decode() for text in group["coefficients"].dims[2][0]] == LABELS
        assert list(group["reported"]) == [0, 3, 6]
        assert np.array_equal(group["contact_damper/u"][:, 0, 0, 0], [0.0, 3.0, 6.0])


def test_every_row_is_there_before_the_table_is_closed(tmp_path: Path) -> None:
    """A copy of the files after each row is what a kill would leave."""
    table = writer(tmp_path / "run", file_attributes={"title": "a case"})
    for count in range(1, 4):
        fill(table, 1)
        copy = tmp_path / f"copy_{count}"
        shutil.copytree(tmp_path / "run", copy)
        with open_results(copy / "results.h5") as file:
            assert len(file["mode/points/zeta"]) == count
            assert file["mode"].attrs["status"] == "running"
            assert file.attrs["title"] == "a case"
            assert file.get("other") is None  # as of any mapping, also where there is no results.h5 yet
        assert len((copy / "mode.csv").read_text().splitlines()) == count + 1
    table.abandon()


def test_a_torn_row_is_left_out_and_all_before_it_are_there(tmp_path: Path) -> None:
    """Lengths that the journal can have after a kill in a write: about the end of each row, and many between."""
    table = writer(tmp_path)
    ends = []
    for _ in range(4):
        fill(table, 1)
        ends.append((tmp_path / ".mode.rows").stat().st_size)
    table.abandon()
    whole = (tmp_path / ".mode.rows").read_bytes()
    near = {end + beside for end in ends for beside in range(-4, 5)}
    for size in sorted(near.union(range(ends[0], ends[-1], 31)).intersection(range(ends[0], ends[-1]))):
        (tmp_path / ".mode.rows").write_bytes(whole[:size])
        with open_results(tmp_path / "results.h5") as file:
            assert len(file["mode/points/zeta"]) == sum(end <= size for end in ends)


def test_a_journal_damaged_in_its_middle_is_named(tmp_path: Path) -> None:
    table = writer(tmp_path)
    fill(table, 4)
    table.abandon()
    content = bytearray((tmp_path / ".mode.rows").read_bytes())
    content[len(content) // 2] ^= 1
    (tmp_path / ".mode.rows").write_bytes(content)
    for work in (lambda: open_results(tmp_path / "results.h5"), writer(tmp_path).go_on):
        with pytest.raises(InputError, match="damaged"):
            work()
    assert (tmp_path / ".mode.rows").read_bytes() == content


def test_earlier_results_stay_until_the_first_row(tmp_path: Path) -> None:
    first, other = writer(tmp_path), writer(tmp_path, "other")
    for table in (first, other):
        fill(table, 5)
        table.close("done", "")
    before = (
        (tmp_path / "results.h5").read_bytes(),
        (tmp_path / "mode.csv").read_bytes(),
    )

    def refuse() -> None:
        raise InputError("misspelt")

    again = writer(tmp_path, before_first=refuse)
    with pytest.raises(InputError):
        fill(again, 1)
    again.abandon()
    assert before == (
        (tmp_path / "results.h5").read_bytes(),
        (tmp_path / "mode.csv").read_bytes(),
    )

    again = writer(tmp_path)
    fill(again, 2)
    again.close("done", "")
    with h5py.File(tmp_path / "results.h5") as file:
        assert len(file["mode/points/zeta"]) == 2
        assert len(file["other/points/zeta"]) == 5
        assert file["other/coefficients"].dims[1][0][0] == b"m1"
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "mode.csv",
        "other.csv",
        "results.h5",
    ]


def test_going_on_gives_the_same_files(tmp_path: Path) -> None:
    whole, halves = tmp_path / "whole", tmp_path / "halves"
    table = writer(whole)
    fill(table, 9)
    table.close("done", "")
    table = writer(halves)
    fill(table, 4)
    table.abandon()
    table = writer(halves)
    state = table.go_on()
    assert state is not None
    assert (int(state["index"]), float(state["step"]), list(state["y"])) == (
        3,
        1.5,
        [3.0] * 5,
    )
    assert (table.rows, table.reported) == (4, 2)
    fill(table, 5)
    table.close("done", "")
    assert (whole / "mode.csv").read_bytes() == (halves / "mode.csv").read_bytes()
    with (
        h5py.File(whole / "results.h5") as one,
        h5py.File(halves / "results.h5") as two,
    ):
        for name in (
            "points/zeta",
            "points/event",
            "coefficients",
            "reported",
            "contact_damper/f",
        ):
            assert np.array_equal(one["mode"][name], two["mode"][name])


def test_a_table_goes_on_with_the_columns_that_it_was_begun_with(tmp_path: Path) -> None:
    """A later version may have more of them, and its rows then bring what the table does not have."""
    table = writer(tmp_path)
    fill(table, 3)
    table.abandon()
    later = writer(tmp_path)
    later.columns = [*later.columns, Column("energy", "J", "of a later version")]
    assert later.go_on() is not None
    fill(later, 2)
    later.close("done", "")
    header, *lines = (tmp_path / "mode.csv").read_text().splitlines()
    assert "energy" not in header and len(lines) == 5
    with open_results(tmp_path / "results.h5") as file:
        assert "energy" not in file["mode/points"]


@pytest.mark.parametrize("spoilt", [[".state_other"], [".state", ".state_other"], [".rows"]])
def test_the_older_state_is_used_when_the_newer_is_spoilt(tmp_path: Path, spoilt: list[str], monkeypatch) -> None:
    """A kill or a power failure: a half-written state, both, or a state whose row is not on the disk."""
    monkeypatch.setattr("fretwave.results.journal.SAFE_EVERY", 0.0)
    table = writer(tmp_path)
    fill(table, 5)
    monkeypatch.setattr("fretwave.results.journal.SAFE_EVERY", 1e9)
    fill(table, 1)
    table.abandon()
    for suffix in spoilt:
        path = tmp_path / f".mode{suffix}"
        path.write_bytes(path.read_bytes()[:-3])
    table = writer(tmp_path)
    state = table.go_on()
    assert state is not None
    assert (int(state["index"]), table.rows) == (4, 5)
    table.abandon()
    with open_results(tmp_path / "results.h5") as file:
        assert {len(file["mode/points"][name]) for name in MODE} == {5}
    assert len((tmp_path / "mode.csv").read_text().splitlines()) == 6


def test_rows_that_a_state_needs_and_that_are_gone_are_named(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr("fretwave.results.journal.SAFE_EVERY", 0.0)
    table = writer(tmp_path)
    fill(table, 6)
    table.abandon()
    path = tmp_path / ".mode.rows"
    path.write_bytes(path.read_bytes()[: 2 * path.stat().st_size // 3])
    with pytest.raises(InputError, match="rows of an analysis are missing"):
        writer(tmp_path).go_on()


def test_tables_still_to_come_keep_an_analysis_from_being_done(tmp_path: Path) -> None:
    """Closed but not published is what a kill between the last row and the last table leaves."""
    table = writer(tmp_path, publish_later=True)
    fill(table, 6)
    table.close("done", "stop value reached")
    assert len(table.group["points/zeta"]) == 6
    with open_results(tmp_path / "results.h5") as file:
        assert file["mode"].attrs["status"] == "running"
    assert not (tmp_path / "results.h5").exists()
    table.abandon()
    table.publish()
    with h5py.File(tmp_path / "results.h5") as file:
        assert file["mode"].attrs["status"] == "done"
    assert not list(tmp_path.glob(".mode.*"))


def test_nothing_to_go_on_from(tmp_path: Path) -> None:
    assert writer(tmp_path).go_on() is None
    table = writer(tmp_path, "other")
    fill(table, 1)
    table.close("done", "")
    assert writer(tmp_path).go_on() is None


def test_results_are_opened_by_their_file_or_their_folder(tmp_path: Path) -> None:
    table = writer(tmp_path)
    fill(table, 2)
    table.close("done", "")
    for place in (tmp_path, tmp_path / "results.h5", str(tmp_path), str(tmp_path / "results.h5")):
        with open_results(place) as file:
            assert list(file) == ["mode"]
    assert has_results(str(tmp_path))


def test_unreadable_results_are_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no results here"):
        open_results(tmp_path / "results.h5")
    (tmp_path / "results.h5").write_bytes(b"not HDF5")
    with pytest.raises(InputError, match="cannot be opened"):
        open_results(tmp_path / "results.h5")
