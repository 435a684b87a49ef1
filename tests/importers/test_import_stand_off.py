"""Sides that stand off or overlap in the mesh: the state at rest of a static contact step counts from there."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
import test_import_at_rest as blocks
from test_import_at_rest import KINDS, LENGTH, Block, N, ccx, heights, pressures, static_step, table

import fretwave as fw
from fretwave.importers.stand_off import StandOff, of_sides, read_stand_off

pytestmark = blocks.pytestmark

OVERLAP, APART = -1e-3, 1e-2


@pytest.fixture
def standing_off(monkeypatch):
    """A function that lifts the upper block in the mesh."""

    def lift(by: float) -> None:
        upper = Block(blocks.HEIGHT + by, 1 + len(blocks.LOWER.number), 1 + len(blocks.LOWER.elements))
        monkeypatch.setattr(sys.modules["test_import_at_rest"], "UPPER", upper)

    return lift


def imported(folder: Path, results: Path) -> dict[str, np.ndarray]:
    assert blocks.imported(folder, results, "--tolerance", 0.05) == 0
    return table(folder / "blocks_face.csv")


def apart(results: Path, found: dict[str, np.ndarray], begins: float | np.ndarray) -> np.ndarray:
    """Of both nodes of each pair in the end, by their places."""
    text = results.read_text()
    u = heights(text[text.rindex(" -4  DISP") :])
    return begins + np.array([u[b] - u[a] for a, b in zip(found["node_a"], found["node_b"])])


@pytest.mark.parametrize(
    ("kind", "by", "begins", "said"),
    [
        ("node", OVERLAP, OVERLAP, ""),
        ("surface", OVERLAP, OVERLAP, ""),
        ("surface", OVERLAP, 0.0, ", ADJUST=0."),
        ("node", APART, 0.0, ", ADJUST=0.02"),
        ("surface", APART, 0.0, ", ADJUST=0.02"),
        ("surface", APART, OVERLAP, f"\n*CLEARANCE, SLAVE=A, MASTER=B, VALUE={OVERLAP}"),
    ],
)
@pytest.mark.parametrize("lifted", [False, True])
def test_what_is_open_counts_from_the_mesh(kind, by, begins, said, lifted, standing_off, tmp_path):
    """Pairs that overlap are pressed, whatever way they moved; lifted ones are open by the distance in the end."""
    standing_off(by)
    named = KINDS[kind] + said if said.startswith(",") else KINDS[kind]
    text = static_step(kind, lifted).replace(KINDS[kind], named)
    text = text.replace("\nA, B\n", f"\nA, B{said}\n") if said.startswith("\n") else text
    results = ccx(tmp_path, "static", text).with_suffix(".frd")
    found, load = imported(tmp_path, results), pressures(lifted).sum() * (LENGTH / N) ** 2
    assert found["normal_load"].sum() == pytest.approx(load, rel=1e-3)
    opening = found["normal_load"] == 0
    assert opening.sum() == (N + 1 if lifted else 0)
    expected = np.where(opening, apart(results, found, begins), 0.0)
    assert found["gap"] == pytest.approx(expected, rel=1e-2)  # as ccx rounds and offsets them
    assert not lifted or found["gap"][opening].min() > 1e-5


def test_pairs_that_the_results_leave_out_are_open_by_their_places(standing_off, tmp_path):
    """ccx lists no contact at nodes along the edges; without the mesh's distance they would touch."""
    standing_off(APART)
    step = LENGTH / N
    tops = [f"{n}, 3, 3, {-0.013 + 0.006 * step * p[1] / LENGTH}" for p, n in blocks.UPPER.number.items() if p[2]]
    held = ["*BOUNDARY", "TOP, 1, 2", *tops, "*STATIC", "0.1, 1.", "*NODE FILE", "U", "*CONTACT FILE", "CDIS, CSTR"]
    text = blocks.deck(held, blocks.CONTACT.format(kind=KINDS["node"]))
    results = ccx(tmp_path, "static", text).with_suffix(".frd")
    found = imported(tmp_path, results)
    far = apart(results, found, APART)
    opening = far > 1e-4
    assert opening.sum() >= 2 * (N + 1)
    assert found["gap"][opening] == pytest.approx(far[opening], rel=1e-2)


@pytest.mark.parametrize("beyond", [False, True], ids=["alone", "with nodes beyond"])
def test_nodes_of_a_set_alone_begin_on_the_other_side(beyond, standing_off, tmp_path):
    """Those beside them began there as well; nodes of the set that are no dependent ones are not moved."""
    standing_off(APART)
    near = [n for (i, _, k), n in blocks.LOWER.number.items() if k and i <= N // 2]
    near += [int(n) for n in blocks.UPPER.layer(0)] if beyond else []
    text = static_step("node").replace(KINDS["node"], f"{KINDS['node']}, ADJUST=Near")
    text = text.replace("*SURFACE, NAME=A", "\n".join(["*NSET, NSET=NEAR", *map(str, near), "*SURFACE, NAME=A"]))
    results = ccx(tmp_path, "static", text).with_suffix(".frd")
    found = imported(tmp_path, results)
    far = apart(results, found, np.where(np.isin(found["node_a"], near), 0.0, APART))
    opening = found["normal_load"] == 0
    assert (far[opening] > 1e-5).all() and np.count_nonzero(opening) >= N
    assert found["gap"] == pytest.approx(np.where(opening, far, 0.0), rel=1e-2)


def test_what_a_deck_says_of_the_distance(tmp_path):
    """By the names of both sides, in whatever order; of a single contact whatever its names are."""
    deck = tmp_path / "static.inp"
    nodes = "*NODE\n" + "".join(f"{n}, {n}, 0, 0\n" for n in range(1, 7)) + "*NSET, NSET=NEAR\n1, 2, 5\n"
    nodes += "".join(f"*SURFACE, NAME={name}, TYPE=NODE\n{n}\n{n + 1}\n" for name, n in (("A", 1), ("E", 3)))
    deck.write_text(
        f"{nodes}*CONTACT PAIR, INTERACTION=DRY, ADJUST=Near\na, b\nE, F\n"
        "*CONTACT PAIR, INTERACTION=DRY, ADJUST=0.5\nC, D\n"
        "*CONTACT PAIR, INTERACTION=DRY\nG, H\n*CLEARANCE, SLAVE=G, MASTER=H, VALUE=0.25\n"
    )
    known, mesh = read_stand_off(deck), np.array([-1.0, 0.4, 0.6])
    pairs = np.array([[4, 1], [3, 9], [9, 2]])
    assert of_sides(known, ("B", "A")).of(mesh, pairs).tolist() == [0.0, 0.4, 0.0]
    assert of_sides(known, ("E", "F")).of(mesh, pairs).tolist() == mesh.tolist()
    assert of_sides(known, ("C", "D")).of(mesh, pairs).tolist() == [0.0, 0.0, 0.6]
    assert of_sides(known, ("G", "H")).of(mesh, pairs).tolist() == [0.25] * 3
    assert of_sides(known, ("I", "J")).of(mesh, pairs).tolist() == mesh.tolist()
    assert of_sides({("A", "B"): StandOff(0.5)}, ("I", "J")).of(mesh, pairs).tolist() == [0.0, 0.0, 0.6]
    assert not read_stand_off(tmp_path / "none.inp")
    deck.write_text(deck.read_text().replace("ADJUST=Near", "ADJUST=Nearest"))
    with pytest.raises(fw.InputError, match="(?s)no node set 'Nearest'.*fix:"):
        of_sides(read_stand_off(deck), ("A", "B")).of(mesh, pairs)


@pytest.mark.parametrize("other", ["\n*TRANSFORM, NSET=ALL\n1, 0, 0, 0, 1, 0", ""], ids=["turned", "no_set"])
def test_sets_are_looked_for_in_the_contact_that_is_asked_for_alone(other, tmp_path):
    """What the deck's other contacts need is not read, nor what a clearance replaces."""
    deck = tmp_path / "static.inp"
    deck.write_text(
        f"*NODE\n1, 0, 0, 0{other}\n*CONTACT PAIR, INTERACTION=DRY, ADJUST=NEAR\nA, B\nG, H\n"
        "*CONTACT PAIR, INTERACTION=DRY, ADJUST=0.5\nC, D\n*CLEARANCE, SLAVE=G, MASTER=H, VALUE=0.25\n"
    )
    known, mesh, pairs = read_stand_off(deck), np.array([0.4, 0.6]), np.array([[1, 2], [3, 4]])
    assert of_sides(known, ("C", "D")).of(mesh, pairs).tolist() == [0.0, 0.6]
    assert of_sides(known, ("G", "H")).of(mesh, pairs).tolist() == [0.25, 0.25]
    with pytest.raises(fw.InputError, match="fix:"):
        of_sides(known, ("A", "B")).of(mesh, pairs)
