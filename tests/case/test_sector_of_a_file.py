"""A case of a sector that a model file brings: as the file says, as the case says, and what contradicts it."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from models.meshed_wheel import PAIRS, SECTORS, STIFFNESS, Wheel, imported, sector_of
from tolerances import TIGHT

from fretwave.case.load import load_case
from fretwave.commands.main import main
from fretwave.errors import CaseErrors
from fretwave.mpi.guard import on_first_rank

TEXT = f"""
[model]
file = "m.h5"

[[contact]]
name = "shroud"
law = "coulomb_3d"
normal_stiffness = {STIFFNESS}
tangential_stiffness = {STIFFNESS}
normal_load = 100.0
friction_coefficient = 0.3

[[analysis]]
name = "linear"
type = "linear"
modes = 3
contact = ["stuck"]
"""


def written(folder: Path, model: str = "", rest: str = "", *, contact: bool = True) -> Path:
    """The case with more keys in [model] and more tables, with or without its contact."""
    text = TEXT.replace('file = "m.h5"', f'file = "m.h5"\n{model}') + rest
    if not contact:
        text = text[: text.index("[[contact]]")] + text[text.index("[[analysis]]") :].replace("stuck", "free")
    path = folder / "case.toml"
    path.write_text(text, encoding="utf-8")
    return path


def frequencies(folder: Path, path: Path, comm) -> np.ndarray:
    """The lowest five of the case's linear analysis, those of a wave and the wave that runs back. Collective."""
    assert main(["run", str(path), "--out", str(folder / "run"), "--no-plots", "--force"]) == 0
    comm.barrier()
    with (folder / "run" / "linear.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    found = [float(row["frequency_hz"]) for row in rows for _ in range(1 + (row["nodal_diameter"] != "0"))]
    return np.sort(found)[:5]


def names(nodes: np.ndarray, directions: str = "xyz") -> list[str]:
    return [f"n{node + 1}{direction}" for direction in directions for node in nodes]


def faces(wheel: Wheel, directions: str = "xyz") -> dict[str, list[str]]:
    """Names of the dofs of both faces that are free, direction by direction."""
    free = np.isin(wheel.face("rim", "low"), wheel.free)
    return {side: names(wheel.face("rim", side)[free], directions) for side in ("low", "high")}


def keys(**given: object) -> str:
    return "".join(f"{key} = {json.dumps(value)}\n" for key, value in given.items())


@pytest.mark.parametrize("reduced", [False, True])
def test_the_file_alone_says_that_it_is_a_sector(comm, shared_tmp: Path, reduced: bool) -> None:
    """Stuck waves are the whole wheel's, also on reduced coordinates that leave nothing out."""
    imported(comm, shared_tmp, Wheel(), *sector_of(), *PAIRS)
    table = "\n[reduction]\nmodes = 48\ncompare = 0\n" if reduced else ""
    path = on_first_rank(comm, lambda: written(shared_tmp, rest=table))
    np.testing.assert_allclose(frequencies(shared_tmp, path, comm), Wheel().hz("stuck")[:5], rtol=TIGHT)


@pytest.mark.parametrize("told", ["node by node", "as the file"])
def test_faces_that_the_case_names_turn_as_well(comm, shared_tmp: Path, told: str) -> None:
    """Dofs along x, y, z in any order, of a file that says nothing of a sector, or says the same."""
    wheel = Wheel(0.4)
    imported(comm, shared_tmp, wheel, *([] if told == "node by node" else sector_of()))
    given = {"sectors": SECTORS, **(dict(**faces(wheel), axis="z") if told == "node by node" else {})}
    path = on_first_rank(comm, lambda: written(shared_tmp, keys(**given), contact=False))
    np.testing.assert_allclose(frequencies(shared_tmp, path, comm), Wheel().hz()[:5], rtol=TIGHT)


@pytest.mark.ranks(1)
def test_faces_of_nodes_without_places(comm, shared_tmp: Path) -> None:
    """Directions are known from the table of dofs alone."""
    wheel = Wheel(0.4)
    command = wheel.write(shared_tmp)
    assert main(command[: command.index("--coordinates")]) == 0
    path = written(shared_tmp, keys(sectors=SECTORS, **faces(wheel), axis="z"), contact=False)
    np.testing.assert_allclose(frequencies(shared_tmp, path, comm), Wheel().hz()[:5], rtol=TIGHT)


@pytest.mark.ranks(1)
def test_faces_that_move_along_the_axis_alone_do_not_turn(comm, shared_tmp: Path) -> None:
    wheel = Wheel()
    imported(comm, shared_tmp, wheel)
    given = faces(wheel, "z")
    cut = load_case(written(shared_tmp, keys(sectors=SECTORS, **given, axis="z"), contact=False)).structure.cut
    assert cut.axis is None and [cut.dof_names[k] for k in cut.high] == given["high"]


def wrong_faces(kind: str) -> tuple[dict[str, object], str]:
    """What a case says wrongly of a sector, and what it is told."""
    given = faces(Wheel())
    low, high = given["low"], given["high"]
    return {
        "no axis": (dict(sectors=5, **given), 'add `axis = "z"`'),
        "one direction": (dict(sectors=5, **faces(Wheel(), "x")), 'add `axis = "z"`'),
        "two directions": (dict(sectors=5, **faces(Wheel(), "xy"), axis="z"), "with some of its directions only"),
        "another axis": (dict(sectors=5, **given, axis="x"), "give the axis z"),
        "number": (dict(sectors=6, **given, axis="z"), "give 5 sectors"),
        "swapped": (dict(sectors=5, low=high, high=low, axis="z"), "swap low and high"),
        "order": (
            dict(sectors=5, low=low, high=names_swapped(high), axis="z"),
            "list the nodes of both faces in one order",
        ),
        "unlike": (dict(sectors=5, low=low, high=high[::-1], axis="z"), "the faces' dofs differ in direction"),
        "no number": (dict(axis="z"), "without a number of sectors"),
    }[kind]


def names_swapped(high: list[str]) -> list[str]:
    """Its two nodes the other way round, direction by direction."""
    return [name for k in range(0, len(high), 2) for name in (high[k + 1], high[k])]


@pytest.mark.ranks(1)
@pytest.mark.parametrize(
    "kind",
    ["no axis", "one direction", "two directions", "another axis", "number", "swapped", "order", "unlike", "no number"],
)
def test_what_a_case_says_wrongly(comm, shared_tmp: Path, kind: str) -> None:
    imported(comm, shared_tmp, Wheel())
    given, said = wrong_faces(kind)
    with pytest.raises(CaseErrors) as caught:
        load_case(written(shared_tmp, keys(**given), contact=False))
    assert said in str(caught.value) and len(caught.value.problems) == 1


@pytest.mark.ranks(1)
def test_a_number_that_contradicts_the_file(comm, shared_tmp: Path) -> None:
    imported(comm, shared_tmp, Wheel(), *sector_of())
    with pytest.raises(CaseErrors, match="give 5 sectors"):
        load_case(written(shared_tmp, "sectors = 6", contact=False))
