"""Contact from node to surface between quadratic elements: forces by the areas that CalculiX itself takes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import test_import_at_rest as blocks
from models.boxes import KINDS, Box, node_set
from test_import_at_rest import call, ccx, table

import fretwave as fw
from fretwave.importers.cells import FACES
from fretwave.importers.contact_results import read_step
from fretwave.importers.nodes import Nodes, read_nodes
from fretwave.importers.shapes import corners_of
from fretwave.importers.spring_areas import shares

pytestmark = blocks.pytestmark

#: Number of the upper box's first node and element, and the pressure on it.
UPPER, PRESSURE = 5001, 60.0


def faces(nodes: Nodes, z: float, low: int, high: int) -> list[tuple[int, int, np.ndarray]]:
    """Element, number of the face and places of its nodes, of faces on a plane z."""
    found = []
    for kind, block in nodes.elements.blocks.items():
        for element, row in zip(block.numbers.tolist(), block.nodes):
            for number, face in enumerate(FACES[kind], 1):
                x = nodes.coordinates[nodes.places(row[face])]
                if low <= element < high and np.allclose(x[:, 2], z):
                    found.append((element, number, x))
    return found


def area(x: np.ndarray) -> float:
    """Of a plane face along x and y, of its corners."""
    x = x[: corners_of(len(x)), :2]
    return abs(np.sum(x[:, 0] * np.roll(x[:, 1], -1) - x[:, 1] * np.roll(x[:, 0], -1))) / 2


def mesh(folder: Path, kind: str, cells: tuple[int, int, int]) -> tuple[str, Nodes]:
    """Two boxes of 10 x 10 x 5, the upper one's top free to sink, with their surfaces."""
    below, x = Box(kind, (3, 3, 1), (0, 0, 0), (10, 10, 5)).lines(1, "LOWER")
    above, y = Box(kind, cells, (0, 0, 5), (10, 10, 10)).lines(UPPER, "UPPER")
    text = below + above + node_set("BOTTOM", 1, x[:, 2] == 0) + node_set("TOP", UPPER, y[:, 2] == 10)
    (folder / "mesh.inp").write_text(text)
    nodes = read_nodes(folder / "mesh.inp")
    for name, low, high in (("A", 1, UPPER), ("B", UPPER, 2 * UPPER)):
        lines = [f"{element}, S{number}\n" for element, number, _ in faces(nodes, 5.0, low, high)]
        text += f"*SURFACE, NAME={name}, TYPE=ELEMENT\n{''.join(lines)}"
    return text + blocks.MATERIAL + "\n", nodes


def pressed(folder: Path, kind: str, cells: tuple[int, int, int]) -> tuple[Path, float]:
    """Results of the static step, and the load; matrices beside."""
    text, nodes = mesh(folder, kind, cells)
    top = faces(nodes, 10.0, UPPER, 2 * UPPER)
    by_face = [PRESSURE * (1 + 0.05 * x[:, 1].mean()) for _, _, x in top]
    loads = [f"{element}, P{number}, {p}" for (element, number, _), p in zip(top, by_face)]
    step = ["*BOUNDARY", "TOP, 1, 2", "*STATIC", "1., 1.", "*DLOAD", *loads, "*NODE FILE", "U"]
    step = ["*STEP", *step, "*CONTACT FILE", "CDIS, CSTR", "*END STEP"]
    contact = blocks.CONTACT.format(kind="NODE TO SURFACE")
    results = ccx(folder, "static", text + "\n".join([contact, *step]) + "\n").with_suffix(".frd")
    matrices = ccx(folder, "boxes", text + "*STEP\n*FREQUENCY, SOLVER=MATRIXSTORAGE\n6\n*END STEP\n")
    given = ("--pairs", "face=A", "B", "--units", "mm-t-s", "--at-rest", results)
    assert call("import", matrices.with_suffix(".inp"), *given) == 0
    return results, sum(p * area(x) for p, (_, _, x) in zip(by_face, top))


@pytest.mark.parametrize("cells", [(3, 3, 1), (2, 2, 1)])
@pytest.mark.parametrize("kind", KINDS)
def test_the_forces_are_the_load_and_those_of_the_stiffness(kind, cells, tmp_path):
    """In all and node by node: K u of the lower box is what presses on its nodes."""
    results, load = pressed(tmp_path, kind, cells)
    found = table(tmp_path / "boxes_face.csv")
    assert found["normal_load"].sum() == pytest.approx(load, rel=1e-3)
    model, step = fw.read_model(tmp_path / "boxes.h5"), read_step(results)
    u = np.nan_to_num(step.displacement.at(model.labels[:, 0]))[np.arange(model.n_dof), model.labels[:, 1] - 1]
    force = {int(n): -f for (n, axis), f in zip(model.labels, model.K @ u) if axis == 3}
    own = np.array([force[int(n)] for n in found["node_a"]])
    np.testing.assert_allclose(found["normal_load"], own, atol=1e-3 * own.max())


@pytest.mark.parametrize("kind", ["C3D8", "C3D10"])
def test_pressures_of_the_second_side_need_meshes_that_match(kind, tmp_path, capsys):
    """Those of the nearest nodes are not the load; the other way round they are."""
    results, load = pressed(tmp_path, kind, (2, 2, 1))
    capsys.readouterr()
    given = ("--units", "mm-t-s", "--at-rest", results)
    assert call("import", tmp_path / "boxes.inp", "--pairs", "face=B", "A", *given) == 2
    said = capsys.readouterr().err
    assert "the pressures are at nodes of the second side" in said and "fix:      write A B" in said
    assert said.count("fix:") == 1
    assert call("import", tmp_path / "boxes.inp", "--pairs", "face=A", "B", *given) == 0
    assert table(tmp_path / "boxes_face.csv")["normal_load"].sum() == pytest.approx(load, rel=1e-3)


@pytest.mark.parametrize("kind", ["C3D8", "C3D10", "C3D20"])
def test_a_table_of_pairs_has_the_forces_of_the_surfaces(kind, tmp_path):
    """Its own areas are those of shape functions: they made 7 % too much of C3D10, 12 % too little of C3D20."""
    results, load = pressed(tmp_path, kind, (3, 3, 1))
    pairs = fw.read_model(tmp_path / "boxes.h5").pairs["face"]
    lines = [f"{a},{b},0,0,1,{area}" for (a, b), area in zip(pairs.nodes, pairs.areas)]
    (tmp_path / "pairs.csv").write_text("\n".join(["node_a,node_b,nx,ny,nz,area", *lines, ""]))
    given = ("--pairs", f"face={tmp_path / 'pairs.csv'}", "--units", "mm-t-s", "--tolerance", "0.01")
    assert call("import", tmp_path / "boxes.inp", *given, "--at-rest", results) == 0
    assert table(tmp_path / "boxes_face.csv")["normal_load"].sum() == pytest.approx(load, rel=1e-3)


@pytest.mark.parametrize("kind", ["C3D8", "C3D20"])
def test_a_dependent_surface_of_nodes_is_refused(kind, tmp_path, capsys):
    """Its springs have the outer faces around the corner too: the sum would be a quarter, or half, of the load less."""
    results, _ = pressed(tmp_path, kind, (3, 3, 1))
    deck = results.with_suffix(".inp")
    deck.write_text(deck.read_text() + "*SURFACE, NAME=A, TYPE=NODE\nTOP\n")
    capsys.readouterr()
    given = ("--pairs", "face=A", "B", "--units", "mm-t-s", "--at-rest", results)
    assert call("import", tmp_path / "boxes.inp", *given) == 2
    said = capsys.readouterr().err
    assert "the dependent side is a surface of nodes" in said and said.count("fix:") == 1


@pytest.mark.parametrize("count", [3, 4, 6, 8])
def test_shares_of_a_face_are_all_of_it(count):
    assert shares(count).sum() == pytest.approx(1.0, rel=1e-14)
    assert shares(count).min() > 0
