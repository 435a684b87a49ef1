"""Tables and results.h5: values come back, an earlier run is replaced only by a solved point, kills spoil nothing."""

from __future__ import annotations

import csv
from pathlib import Path

import h5py
import numpy as np
import pytest

from fretwave.columns import COLUMNS, MODE
from fretwave.errors import InputError
from fretwave.results import AnalysisWriter, open_results

pytestmark = pytest.mark.ranks(1)

LABELS = ["1c", "1s", "3c", "3s"]


def row(index: int) -> dict[str, float | int | str]:
    """Numbers with all their digits."""
    values: dict[str, float | int | str] = {name: (index + 1) / 3.0 for name in MODE}
    values.update(
        point=index, newton=3, linear=3, event="report" if index % 3 == 0 else ""
    )
    return values


def writer(folder: Path, name: str = "mode", **options: object) -> AnalysisWriter:
    return AnalysisWriter(
        folder, name, MODE, {"type": "mode"}, ["m1", "m2"], LABELS, **options
    )  # type: ignore[arg-type]


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
    table = writer(tmp_path)
    for count in range(1, 4):
        fill(table, 1)
        (tmp_path / "copy.h5").write_bytes((tmp_path / "results.h5").read_bytes())
        with h5py.File(tmp_path / "copy.h5") as file:
            assert len(file["mode/points/zeta"]) == count
        assert len((tmp_path / "mode.csv").read_text().splitlines()) == count + 1
    table.abandon()


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


@pytest.mark.parametrize("spoilt", ["checksum", "rows"])
def test_the_older_state_is_used_when_the_newer_is_spoilt(
    tmp_path: Path, spoilt: str
) -> None:
    """A kill in the middle of a write: a half-written state, or a state whose row is not in the table yet."""
    table = writer(tmp_path)
    fill(table, 6)
    table.abandon()
    with h5py.File(tmp_path / "results.h5", "r+") as file:
        if spoilt == "rows":
            file["mode/points/zeta"].resize(5, axis=0)
        else:
            newer = max(
                ("state_0", "state_1"), key=lambda name: file["mode"][name]["header"][0]
            )
            file["mode"][newer]["y"][2] = 17.0
    table = writer(tmp_path)
    state = table.go_on()
    assert state is not None
    assert (int(state["index"]), table.rows) == (4, 5)
    table.abandon()
    with h5py.File(tmp_path / "results.h5") as file:
        assert {len(file["mode/points"][name]) for name in MODE} == {5}
    assert len((tmp_path / "mode.csv").read_text().splitlines()) == 6


def test_nothing_to_go_on_from(tmp_path: Path) -> None:
    assert writer(tmp_path).go_on() is None
    table = writer(tmp_path, "other")
    fill(table, 1)
    table.close("done", "")
    assert writer(tmp_path).go_on() is None


def test_unreadable_results_are_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no results here"):
        open_results(tmp_path / "results.h5")
    (tmp_path / "results.h5").write_bytes(b"not HDF5")
    with pytest.raises(InputError, match="cannot be opened"):
        open_results(tmp_path / "results.h5")
