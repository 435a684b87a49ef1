"""Input decks as other programs and people write them: what is read, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tolerances import ROUNDING

from fretwave.errors import InputError
from fretwave.importers.nodes import Nodes, read_nodes
from fretwave.importers.surfaces import side_of

pytestmark = pytest.mark.ranks(1)

#: A cube of one element, whose blank fields are zero.
NODES = "*NODE\n1\n2,1.D0,0,0\n3,1,1.,\n4, ,1d0, \n5,0,0,1\n6,.1E1,,1\n7,1,1,1\n8,,1.D+0,10.D-1\n"
CUBE = NODES + "*ELEMENT, TYPE=C3D8, ELSET=E\n1,1,2,3,4,5,6,7,8\n"
TOP = "*NSET, NSET=TOP\n5,6,7,8\n"
GOOD = {
    "set and surface of one name": TOP + "*SURFACE, TYPE=NODE, NAME=TOP\nTOP, 1.\n",
    "a face twice": "*SURFACE, NAME=TOP\nE, S2\n1, S2\n",
    "a surface twice": "*SURFACE, NAME=TOP\nE, S2\n*SURFACE, NAME=TOP\nE, S2\n",
    "lines of a set included": '*NSET, NSET=TOP\n5\n*INCLUDE, INPUT="more.txt"\n8\n',
    "lines of a set in a file": "*NSET, NSET=TOP, INPUT=more.txt\n*NSET, NSET=TOP\n5,8\n",
    "an element in a file": "*NODE, INPUT=nodes.txt\n*ELEMENT, TYPE=C3D8, INPUT=cell.txt\n*SURFACE, NAME=TOP\n2, S2\n",
    "a surface in a file": "*SURFACE, NAME=TOP, INPUT=faces.txt\n",
    "a system that ends": TOP + "*SYSTEM\n",
    "a system that turns nothing": "*SYSTEM\n0,0,0,2.,0,0\n0,1.,0\n" + TOP + "*SYSTEM\n,,\n*SYSTEM\n0,0,0,1\n",
    "a skin of shells": TOP + "*ELEMENT, TYPE=S4\n2,8,7,6,5\n",
    "a part that stands once": TOP + "*INSTANCE, NAME=P-1, PART=P\n*END INSTANCE\n",
}
WRONG = {
    "an element number stands twice": "*ELEMENT, TYPE=S3\n1,1,2,3\n",
    "a file includes itself": "*INCLUDE, INPUT=loop.txt\n",
    "names elements that are none": "*SURFACE, NAME=TOP\nE, S2\n77, S2\n",
    "both called 'TOP'": "*NSET, NSET=TOP\n1,2,3,4\n*SURFACE, NAME=TOP\nE, S2\n",
    "a side of the contact is empty": "*NSET, NSET=TOP\n",
    "this is no node set": "*NSET, NSET=TOP, GENERATE\n8,5\n",
    "5,8,1,7": "*NSET, NSET=TOP, GENERATE\n5,8,1,7\n",
    "directions of nodes are turned": TOP + "*TRANSFORM, NSET=TOP, TYPE=C\n0,0,0,0,0,1\n",
    "turned or moved": TOP + "*SYSTEM\n0,0,0,0,1,0\n",
    "coordinates of nodes are": TOP + "*SYSTEM\n0,0,1.,1.,0,1.\n",
    "are turned or": TOP + "*SYSTEM\n0,0,0,1.,0,0\n0,0,1.\n",
    "\\*NGEN": TOP + "*NGEN, NSET=TOP\n5,8,1\n",
    "\\*ELGEN": TOP + "*ELGEN, ELSET=E\n1,3,4,1\n",
    "a part has two instances": TOP + 2 * "*INSTANCE, NAME=P-1, PART=P\n*END INSTANCE\n",
}
#: Corners, then the middles of its edges.
TETRAHEDRON = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
TETRAHEDRON += [(0.5, 0, 0), (0.5, 0.5, 0), (0, 0.5, 0), (0, 0, 0.5), (0.5, 0, 0.5), (0, 0.5, 0.5)]


def read(folder: Path, text: str) -> Nodes:
    (folder / "more.txt").write_text("6\n7\n")
    (folder / "nodes.txt").write_text("9,0,0,-1\n10,1,0,-1\n11,1,1,-1\n12,0,1,-1\n")
    (folder / "cell.txt").write_text("2,9,10,11,12,5,6,7,8\n")
    (folder / "faces.txt").write_text("E, S2\n")
    (folder / "loop.txt").write_text("*INCLUDE, INPUT=loop.txt\n")
    (folder / "deck.inp").write_text(CUBE + text)
    return read_nodes(folder / "deck.inp")


def test_fields_of_nodes(tmp_path: Path) -> None:
    """Blank ones, and exponents of Fortran."""
    corners = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
    np.testing.assert_array_equal(read(tmp_path, "").coordinates, corners)


def test_nodes_in_a_file(tmp_path: Path) -> None:
    assert read(tmp_path, "*NODE, INPUT=nodes.txt\n").numbers.tolist() == list(range(1, 13))


@pytest.mark.parametrize("form", GOOD)
def test_a_side_of_one_face(form: str, tmp_path: Path) -> None:
    """The cube's top, whose area is 1, however it is written."""
    top = side_of(read(tmp_path, GOOD[form]), "TOP")
    assert top.numbers.tolist() == [5, 6, 7, 8]
    assert top.areas.sum() == pytest.approx(1, rel=ROUNDING)
    np.testing.assert_allclose(top.normals, [[0, 0, 1]] * 4, atol=ROUNDING)


def test_nodes_of_elements(tmp_path: Path) -> None:
    text = "*ELEMENT, TYPE=S3, ELSET=SKIN\n2,1,2,3\n*NSET, NSET=TOP, ELSET=SKIN\n"
    assert read(tmp_path, text).node_set("TOP").tolist() == [1, 2, 3]


@pytest.mark.parametrize("said", WRONG)
def test_a_wrong_deck(said: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=said) as caught:
        side_of(read(tmp_path, WRONG[said]), "TOP")
    assert caught.value.where and caught.value.fix


def test_a_skin_on_quadratic_solids(tmp_path: Path) -> None:
    """Its triangles are the corners of a C3D10's faces: the area is counted once."""
    nodes = "*NODE\n" + "".join(f"{k},{x},{y},{z}\n" for k, (x, y, z) in enumerate(TETRAHEDRON, 1))
    text = (
        nodes
        + "*ELEMENT, TYPE=C3D10\n1,1,2,3,4,5,6,7,8,9,10\n*ELEMENT, TYPE=S3\n2,1,2,3\n*NSET, NSET=FOOT\n1,2,3,5,6,7\n"
    )
    (tmp_path / "deck.inp").write_text(text)
    side = side_of(read_nodes(tmp_path / "deck.inp"), "FOOT")
    assert side.areas.sum() == pytest.approx(1 / 2, rel=ROUNDING)
    np.testing.assert_allclose(side.normals, [[0, 0, -1]] * 6, atol=ROUNDING)
