"""Contact of sides that lie on each other in part: which nodes are taken, and areas that add up to the overlap."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from models.boxes import KINDS, Box, labels_of, node_set
from models.two_bars import Two
from tolerances import ROUNDING

import fretwave as fw
from fretwave.commands.main import main
from fretwave.importers.nodes import Nodes, read_nodes
from fretwave.importers.pairs import match
from fretwave.importers.surfaces import side_of

pytestmark = pytest.mark.ranks(1)

#: The largest error of a patch test.
PATCH = 1e-10
#: Above a box of 4 x 2: corners of another one, and what they have in common.
OVER = {
    "corner": ((1.3, -0.5), (6.0, 1.1), 2.7 * 1.1),
    "half": ((2.0, 0.0), (6.0, 2.0), 2.0 * 2.0),
    "strip": ((1.1, -1.0), (2.9, 3.0), 1.8 * 2.0),
    "within": ((0.7, 0.3), (3.1, 1.9), 2.4 * 1.6),
}


def deck(folder: Path, below: Box, *above: Box, turned: float = 0.0) -> Nodes:
    """The top A of a box and the undersides B of others, which are turned about (4, 1) in their plane."""
    text, points = below.lines(1, "BELOW")
    text += node_set("A", 1, points[:, 2] == 1)
    for k, box in enumerate(above, 1):
        lines, points = box.lines(1000 * k, f"ABOVE_{k}")
        text += lines + node_set("B", 1000 * k, points[:, 2] == 1)
    (folder / "deck.inp").write_text(text)
    nodes = read_nodes(folder / "deck.inp")
    upper, (c, s) = nodes.numbers >= 1000, (np.cos(turned), np.sin(turned))
    nodes.coordinates[upper, :2] = (nodes.coordinates[upper, :2] - [4, 1]) @ [[c, s], [-s, c]] + [4, 1]
    return nodes


def askew(nodes: Nodes) -> Nodes:
    turn = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
    nodes.coordinates = nodes.coordinates @ (turn * np.linalg.det(turn)).T + [3.0, -2.0, 7.0]
    return nodes


@pytest.mark.parametrize("over", OVER)
@pytest.mark.parametrize("sides", ["AB", "BA"])
@pytest.mark.parametrize("kind", KINDS)
def test_areas_add_up_to_the_overlap(kind: str, sides: str, over: str, tmp_path: Path) -> None:
    """Of any faces, whichever side is first, wherever; a linear motion of both bodies moves no pair."""
    low, high, area = OVER[over]
    other = KINDS[KINDS.index(kind) - 1]
    nodes = deck(tmp_path, Box(kind, (8, 5, 1), (0, 0, 0), (4, 2, 1)), Box(other, (9, 7, 1), (*low, 1), (*high, 2)))
    own = side_of(nodes, sides[0])
    (x0, y0), (x1, y1) = (low, high) if sides == "AB" else ((0, 0), (4, 2))
    x, y = own.points[:, 0], own.points[:, 1]
    inside = own.numbers[(x0 <= x) & (x <= x1) & (y0 <= y) & (y <= y1)]
    notes: list[str] = []
    joint = match("joint", askew(nodes), *sides, None, labels_of(nodes), notes=notes)
    assert joint.areas.sum() == pytest.approx(area, rel=ROUNDING) and joint.areas.min() > 0
    assert set(inside) <= set(joint.nodes[:, 0]) and len(joint.nodes) < 1.2 * len(inside)
    left = len(own.numbers) - len(joint.nodes)
    assert (f"{left} of {len(own.numbers)} nodes lie beside them and are left out" in notes[0]) == (left > 0)
    moved = nodes.coordinates @ np.random.default_rng(1).normal(size=(3, 3))
    assert abs(joint.B @ moved.ravel()).max() < PATCH


@pytest.mark.parametrize("sides", ["AB", "BA"])
def test_a_diamond_that_hangs_over(sides: str, tmp_path: Path) -> None:
    """A square turned by 45 degrees about the middle of an edge: half of it, the square of half its diagonal."""
    half = 0.9 / np.sqrt(2)
    above = Box("C3D8", (7, 6, 1), (4 - half, 1 - half, 1), (4 + half, 1 + half, 2))
    nodes = deck(tmp_path, Box("C3D8", (20, 12, 1), (0, 0, 0), (4, 2, 1)), above, turned=np.pi / 4)
    joint = match("joint", nodes, *sides, None, labels_of(nodes))
    assert joint.areas.sum() == pytest.approx(0.9**2, rel=ROUNDING)


def test_what_lies_beyond_a_gap_is_no_part_of_it(tmp_path: Path) -> None:
    """Faces that look the same way, or that stand off by an element's size, cover nothing."""
    nodes = deck(tmp_path, Box("C3D8", (8, 5, 1), (0, 0, 0), (4, 2, 1)), Box("C3D8", (5, 4, 2), (2, 0, 1), (6, 2, 2)))
    upper = nodes.numbers[(nodes.numbers >= 1000) & (nodes.coordinates[:, 2] == 2)]
    nodes.sets["B"] = np.append(nodes.sets["B"], upper)  # its other side too
    joint = match("joint", nodes, "A", "B", None, labels_of(nodes))
    assert joint.areas.sum() == pytest.approx(4.0, rel=ROUNDING)


#: Cells of the lower box, corners of those above it, what is said and to be done.
WRONG = {
    "few": ((8, 5, 1), [((3.9, 1.9, 1), (8, 4, 2))], "do not lie on the second's faces", "lies on the other all over"),
    "none": ((4, 2, 1), [((1.1, 0.1, 1), (1.9, 0.9, 2))], "the two sides are far apart", "write B first"),
    "between": (
        (4, 2, 1),
        [((-1, -1, 1), (5, 0.6, 2)), ((2.1, 1.1, 1), (2.9, 1.9, 2))],
        "between the first side's nodes",
        "write B first",
    ),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_overlaps_that_are_refused(wrong: str, tmp_path: Path) -> None:
    """What is to be done helps."""
    cells, boxes, said, fix = WRONG[wrong]
    nodes = deck(tmp_path, Box("C3D8", cells, (0, 0, 0), (4, 2, 1)), *[Box("C3D8", (6, 6, 1), *ends) for ends in boxes])
    grid = nodes.numbers < 1000
    nodes.coordinates[grid] = np.round(nodes.coordinates[grid] * [cells[0] / 4, cells[1] / 2, 1])  # no distortion
    nodes.coordinates[grid] /= [cells[0] / 4, cells[1] / 2, 1]
    with pytest.raises(fw.InputError, match=said) as caught:
        match("joint", nodes, "A", "B", None, labels_of(nodes))
    assert fix in (caught.value.fix or "")
    if wrong != "few":
        areas = [(min(x1, 4) - max(x0, 0)) * (min(y1, 2) - max(y0, 0)) for (x0, y0, _), (x1, y1, _) in boxes]
        joint = match("joint", nodes, "B", "A", None, labels_of(nodes))
        assert joint.areas.sum() == pytest.approx(sum(areas), rel=ROUNDING)


def test_the_import_says_what_it_left_out(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """The second bar moved by a quarter of its width: one row of nodes hangs over, 15 of 20 mm meet."""
    two = Two()
    two.nodes[len(two.first.nodes) :, 1] += 0.005
    assert main([*two.write(tmp_path, True), "--pairs", "joint=LEFT", "RIGHT"]) == 0
    said = capfd.readouterr().out
    assert "2 of 6 nodes lie beside them and are left out, the overlap is 0.00015\n" in said
    assert "contact 'joint': 4 pairs, area 0.00015 in all" in said
    joint = fw.read_model(tmp_path / "m.h5").pairs["joint"]
    assert joint.areas == pytest.approx([0.00005, 0.00005, 0.000025, 0.000025], rel=ROUNDING)


def test_faces_whose_corners_coincide(tmp_path: Path) -> None:
    """Quads collapsed to triangles, at whichever corner: a square of 2 x 2 of which half is covered."""
    corners = "1,0,0,1\n2,2,0,1\n3,2,2,1\n4,0,2,1\n11,1,-1,1\n12,1,3,1\n13,5,3,1\n14,5,-1,1\n"
    sets = "*NSET,NSET=A,GENERATE\n1,4\n*NSET,NSET=B,GENERATE\n11,14\n"
    for row in ("1,1,2,3", "1,2,3,3"):
        elements = f"*ELEMENT, TYPE=S4\n1,{row}\n3,11,12,13,14\n*ELEMENT, TYPE=S3\n2,1,3,4\n"
        (tmp_path / "deck.inp").write_text(f"*NODE\n{corners}{elements}{sets}")
        nodes = read_nodes(tmp_path / "deck.inp")
        joint = match("joint", nodes, "A", "B", None, labels_of(nodes))
        assert joint.areas.sum() == pytest.approx(2.0, rel=ROUNDING)
