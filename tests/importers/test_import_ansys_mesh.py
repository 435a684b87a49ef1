"""Archives of Ansys (CDWRITE): examples of mapdl-archive that Ansys wrote, and small ones written here."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from models.two_bars import Two
from tolerances import LAST_DIGITS, ROUNDING

from fretwave.commands.main import main
from fretwave.errors import InputError
from fretwave.fe.solids import EDGES
from fretwave.importers.ansys_elements import HEAD, NUMBER, blocks_of
from fretwave.importers.ansys_mesh import Block
from fretwave.importers.cells import FACES
from fretwave.importers.node_files import read_node_file
from fretwave.importers.nodes import Nodes, cells_of
from fretwave.importers.surfaces import side_of
from fretwave.results import model_file

pytestmark = pytest.mark.ranks(1)
package = pytest.importorskip("mapdl_archive", reason="the extra [ansys] is not installed")

EXAMPLES = Path(package.__file__).parent / "examples"


def volume(nodes: Nodes) -> float:
    """Of elements with plane faces: the sum over all faces of area times distance from the origin, over 3."""
    total = 0.0
    for kind, block in nodes.elements.blocks.items():
        for face in FACES[kind]:
            corners = face[: len(face) // (2 if "quadratic" in kind else 1)]
            x = nodes.coordinates[nodes.places(block.nodes[:, corners].ravel())].reshape(-1, len(corners), 3)
            for k in range(1, len(corners) - 1):
                total += np.einsum("ij,ij->", x[:, 0], np.cross(x[:, k], x[:, k + 1])) / 6
    return total


def test_turned_directions_are_refused() -> None:
    """Three nodes of the example have angles."""
    with pytest.raises(
        InputError, match=r"(?s)directions of nodes are turned.*node 27 by \[1. 1. 5.\] degrees, 3 such"
    ):
        read_node_file(EXAMPLES / "HexBeam.cdb")


def test_a_beam_of_quadratic_bricks(tmp_path: Path) -> None:
    """1 x 1 x 5; two components of nodes; its faces give areas and normals. Without its angles, behind column 90."""
    lines = (EXAMPLES / "HexBeam.cdb").read_text().splitlines()
    straight = [line[:90] if "E+" in line[27:90] else line for line in lines]
    (tmp_path / "beam.cdb").write_text("\n".join(straight) + "\n")
    nodes = read_node_file(tmp_path / "beam.cdb")
    assert nodes.coordinates.shape == (321, 3) and nodes.elements.blocks["quadratic_hexahedron"].nodes.shape == (40, 20)
    assert {name: len(members) for name, members in nodes.sets.items()} == {"NCOMP2": 98, "NODE_SELECTION": 164}
    assert nodes.node_set("NCOMP2")[[0, 20, 21, -1]].tolist() == [1, 21, 43, 316]
    assert volume(nodes) == pytest.approx(5.0, rel=ROUNDING)
    nodes.sets["END"] = nodes.numbers[nodes.coordinates[:, 2] == 5.0]
    side = side_of(nodes, "END")
    assert side.areas.sum() == pytest.approx(1.0, rel=ROUNDING)
    np.testing.assert_allclose(side.normals, np.tile([0.0, 0.0, 1.0], (21, 1)), atol=LAST_DIGITS)
    (material,) = nodes.materials
    assert (material.modulus, material.density) == (7e10, 2700.0)


@pytest.mark.parametrize(
    "name, kinds", [("TetBeam", {"tetrahedron": 3913}), ("sector", {"hexahedron": 101, "wedge": 4})]
)
def test_linear_elements(name: str, kinds: dict[str, int]) -> None:
    """Cells are drawn; those of MESH200 are left out; none is turned inside out."""
    nodes = read_node_file(EXAMPLES / f"{name}.cdb")
    assert {kind: len(block.numbers) for kind, block in nodes.elements.blocks.items()} == kinds
    bricks, others = cells_of(nodes)
    assert sum(map(len, others.values())) + (0 if bricks is None else len(bricks)) == sum(kinds.values())
    assert volume(nodes) > 0


#: Corners of a brick (I, ..., P) as they fall together, and what it then is.
DEGENERATE = {
    "hexahedron": [1, 2, 3, 4, 5, 6, 7, 8],
    "wedge": [1, 2, 3, 3, 5, 6, 7, 7],
    "tetrahedron": [1, 2, 3, 3, 5, 5, 5, 5],
    "pyramid": [1, 2, 3, 4, 5, 5, 5, 5],
}
BRICK = EDGES["quadratic_hexahedron"]


def row_of(corners: list[int], quadratic: bool) -> np.ndarray:
    """A middle node is numbered by its edge's corners: 10 a + b; that of an edge without length is the corner."""
    ends = [sorted((corners[a], corners[b])) for a, b in BRICK]
    middle = [a if a == b else 10 * a + b for a, b in ends]
    row = np.array([0] * HEAD + corners + middle * quadratic)
    row[NUMBER] = 7
    return row


@pytest.mark.parametrize("quadratic", [False, True])
@pytest.mark.parametrize("kind", ["hexahedron", "wedge", "tetrahedron"])
def test_bricks_of_which_corners_fall_together(kind: str, quadratic: bool) -> None:
    (name,) = found = blocks_of([row_of(DEGENERATE[kind], quadratic)], np.array([186]), "here")
    assert name == "quadratic_" * quadratic + kind
    corners = list(dict.fromkeys(DEGENERATE[kind]))
    edges = [sorted((corners[a], corners[b])) for a, b in EDGES[f"quadratic_{kind}"]]
    middle = [10 * a + b for a, b in edges]
    assert found[name].nodes.tolist() == [corners + middle * quadratic] and found[name].numbers.tolist() == [7]


def test_elements_of_no_known_shape() -> None:
    """A pyramid, and a brick with some middle nodes."""
    with pytest.raises(InputError, match="element 7 has the shape of a pyramid"):
        blocks_of([row_of(DEGENERATE["pyramid"], True)], np.array([186]), "here")
    row = row_of(DEGENERATE["hexahedron"], True)
    row[-1] = 0
    with pytest.raises(InputError, match="some of its middle nodes, not all"):
        blocks_of([row], np.array([186]), "here")


def archive(two: Two, more: str = "") -> str:
    """Two bars as CDWRITE writes them, their ends as components; ranges of a component end in a negative number."""
    nodes = [f"{k:9d}{0:9d}{0:9d}" + "".join(f"{x:21.13E}" for x in place) for k, place in enumerate(two.nodes, 1)]
    heads = [f"{1:9d}" * 4 + f"{0:9d}" * 4 + f"{8:9d}{0:9d}{e:9d}" for e in range(1, len(two.cells) + 1)]
    rows = [head + "".join(f"{n:9d}" for n in cell) for head, cell in zip(heads, two.cells)]
    parts = [f"CMBLOCK,{name},NODE,2\n(8i10)\n{own.min():10d}{-own.max():10d}" for name, own in two.sets.items()]
    return "\n".join(
        ["/PREP7", "ET,1,185", f"NBLOCK,6,SOLID,{len(nodes)},{len(nodes)}", "(3i9,6e21.13e3)", *nodes]
        + ["N,R5.3,LOC,       -1,", f"EBLOCK,19,SOLID,{len(rows)},{len(rows)}", "(19i9)", *rows, f"{-1:9d}"]
        + [*parts, more, "FINISH", ""]
    )


def test_components_make_pairs(tmp_path: Path) -> None:
    """As the node sets of a deck with the same elements do: nodes, normals, areas."""
    two, found = Two(), []
    command = two.write(tmp_path, deck=True)
    (tmp_path / "n.cdb").write_text(archive(two))
    for path in ("n.inp", "n.cdb"):
        assert main([*command[:-1], str(tmp_path / path), "--pairs", "joint=LEFT", "RIGHT"]) == 0
        found.append(model_file.read_model(tmp_path / "m.h5"))
    deck, ansys = (model.pairs["joint"] for model in found)
    np.testing.assert_array_equal(ansys.nodes, deck.nodes)
    np.testing.assert_allclose(ansys.frames, deck.frames, atol=LAST_DIGITS)
    np.testing.assert_allclose(ansys.areas, deck.areas, rtol=ROUNDING)
    np.testing.assert_array_equal(found[1].hexahedra, found[0].hexahedra)


def test_what_is_held_and_joined(tmp_path: Path) -> None:
    (tmp_path / "n.cdb").write_text(
        archive(Two(), "D,      1,UX  ,  0.0\nD,3,ALL,0.\nD,4,TEMP,20.\nCP,R5.0,,1,UX\nCE,R5.0")
    )
    constraints = read_node_file(tmp_path / "n.cdb").constraints
    assert constraints.held == [("1", 1, 1), ("3", 1, 6)] and constraints.joins == "CP"


@pytest.mark.parametrize("block, share", [("NBLOCK", 0.5), ("EBLOCK", 0.3), ("EBLOCK", 0.97)])
def test_a_cut_archive_is_no_smaller_mesh(tmp_path: Path, block: str, share: float) -> None:
    """Before: 6 of 40 elements without a word, a tetrahedron that was half a brick."""
    text = (EXAMPLES / "HexBeam.cdb").read_text()
    begin = text.rindex(block)
    lines = text[begin:].split("\n")
    end = next(k for k, line in enumerate(lines) if line.strip().startswith(("-1", "N,")))
    (tmp_path / "mesh.cdb").write_text(text[:begin] + "\n".join(lines[: max(3, int(share * end))]) + "\n")
    with pytest.raises(InputError, match="(?s)cut|complete|no nodes"):
        read_node_file(tmp_path / "mesh.cdb")


def test_a_cut_component_is_an_open_block() -> None:
    """Twelve nodes, eight a line, behind the line of the format."""
    block = Block()
    for keyword, words in (("CMBLOCK", ["TIP", "NODE", "12"]), ("(8I10)", []), ("1 2 3 4 5 6 7 8", [])):
        block.take(keyword, words)
        assert block.open == "CMBLOCK"
    block.take("9 10 11 12", [])
    assert not block.open
