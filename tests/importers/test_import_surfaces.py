"""Contact from faces of a deck: areas, normals, and nodes on faces of a mesh that does not match."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp
from models.boxes import KINDS, Box, labels_of, node_set
from tolerances import LAST_BIT, ROUNDING

from fretwave.errors import InputError
from fretwave.importers.nodes import read_nodes
from fretwave.importers.pairs import match
from fretwave.importers.surfaces import side_of
from fretwave.model.pairs import Pairs

pytestmark = pytest.mark.ranks(1)

#: The largest error that the issue allows a patch test.
PATCH = 1e-10


class Stack:
    """A box A whose top, on z = 1, lies on the underside of a box B with another mesh; a rigid turn puts both askew."""

    def __init__(self, folder: Path, kind: str, other: str, fine: tuple[int, int, int] = (3, 2, 1)) -> None:
        below, above = Box(kind, fine, (0, 0, 0), (2, 1, 1)), Box(other, (2, 3, 1), (-0.5, 0, 1), (2.5, 1, 2))
        first, second = below.lines(1, "BELOW"), above.lines(1001, "ABOVE")
        top, under = first[1][:, 2] == 1, second[1][:, 2] == 1
        text = first[0] + second[0] + node_set("A", 1, top) + node_set("B", 1001, under)
        (folder / "stack.inp").write_text(text)
        self.nodes = read_nodes(folder / "stack.inp")
        turn = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
        self.turn = turn * np.linalg.det(turn)
        self.nodes.coordinates = self.nodes.coordinates @ self.turn.T + [3.0, -2.0, 7.0]
        self.labels = labels_of(self.nodes)
        self.notes: list[str] = []

    def pairs(self) -> Pairs:
        return match("joint", self.nodes, "A", "B", None, self.labels, notes=self.notes)


@pytest.mark.parametrize("kind", KINDS)
def test_areas_are_positive_and_add_up(kind: str, tmp_path: Path) -> None:
    """To 2 x 1, for every kind of face; normals point out of them."""
    stack = Stack(tmp_path, kind, "C3D8")
    side = side_of(stack.nodes, "A")
    assert side.areas.min() > 0
    assert side.areas.sum() == pytest.approx(2.0, rel=ROUNDING)
    np.testing.assert_allclose(side.normals, np.broadcast_to(stack.turn[:, 2], side.normals.shape), atol=ROUNDING)


def test_a_node_on_no_face_is_named(tmp_path: Path) -> None:
    """One inside the body beside all of the top: it takes areas and normals from the whole side."""
    stack = Stack(tmp_path, "C3D8", "C3D8")
    top, z = stack.nodes.sets["A"], (stack.nodes.coordinates - [3.0, -2.0, 7.0]) @ stack.turn[:, 2]
    below = int(stack.nodes.numbers[np.argmin(z)])
    stack.nodes.sets["A"] = np.append(top, below)
    with pytest.raises(InputError, match="no normal") as caught:
        stack.pairs()
    assert caught.value.measured == f"node {below} is on no face, 1 of {len(top) + 1} such"


@pytest.mark.parametrize("other", KINDS)
@pytest.mark.parametrize("kind", KINDS)
def test_patch_of_meshes_that_do_not_match(kind: str, other: str, tmp_path: Path) -> None:
    """A linear displacement common to both bodies, a rigid motion among them, gives no relative displacement."""
    stack = Stack(tmp_path, kind, other)
    joint = stack.pairs()
    assert "meshes do not match" in stack.notes[0]
    x = stack.nodes.coordinates
    rng = np.random.default_rng(1)
    for gradient in (rng.normal(size=(3, 3)), np.cross(np.eye(3), [0.3, -0.5, 0.7])):
        assert abs(joint.B @ (x @ gradient + rng.normal(size=3)).ravel()).max() < PATCH
    apart = np.zeros_like(x)
    apart[stack.nodes.numbers < 1000] = stack.turn[:, 2]
    u = (joint.B @ apart.ravel()).reshape(-1, 3)
    np.testing.assert_allclose(u, np.broadcast_to([1.0, 0, 0], u.shape), atol=ROUNDING)  # closes the contact
    assert np.diff(sp.csr_matrix(joint.B).indptr).max() > 6  # a row of several nodes of the other side


@pytest.mark.parametrize("apart", [0.01, -0.01])
def test_sides_that_stand_off_touch(apart: float, tmp_path: Path) -> None:
    """Their distance along the normals is said, of either sign, whichever way they look; it is no gap."""
    stack = Stack(tmp_path, "C3D8", "C3D8")
    stack.nodes.coordinates[stack.nodes.numbers > 1000] += apart * stack.turn[:, 2]
    joint = match("joint", stack.nodes, "A", "B", None, stack.labels, 0.02, notes=stack.notes)
    assert f"; along the normals {apart:g} to {apart:g} (below zero they overlap)" in stack.notes[0]
    assert "gap" not in joint.parameters


def test_projection_of_a_matching_mesh_is_node_to_node(tmp_path: Path) -> None:
    """Where the second side has more nodes, those under the first ones take all the weight."""
    below, above = Box("C3D8", (2, 2, 1), (0, 0, 0), (2, 1, 1)), Box("C3D8", (3, 2, 1), (0, 0, 1), (3, 1, 2))
    (first, x), (second, y) = below.lines(1, "BELOW"), above.lines(1001, "ABOVE")
    y[:, 0] = np.round(y[:, 0])
    x[:, :2], y[:, 1] = np.round(2 * x[:, :2]) / 2, np.round(2 * y[:, 1]) / 2
    text = first + second + node_set("A", 1, x[:, 2] == 1) + node_set("B", 1001, y[:, 2] == 1)
    (tmp_path / "deck.inp").write_text(text)
    nodes = read_nodes(tmp_path / "deck.inp")
    nodes.coordinates = np.vstack([x, y])
    labels = labels_of(nodes)
    joint = match("joint", nodes, "A", "B", np.array([0, 0, 1.0]), labels)
    assert joint.n_pairs == 9
    assert sorted(abs(joint.B.data - np.sign(joint.B.data)).tolist())[-1] < LAST_BIT
    assert np.diff(joint.B.indptr).tolist() == [2] * 27
    places = nodes.coordinates[nodes.places(joint.nodes.ravel())].reshape(-1, 2, 3)
    np.testing.assert_array_equal(places[:, 0], places[:, 1])


def test_a_surface_names_faces(tmp_path: Path) -> None:
    """The same pairs from surfaces as from the node sets; by element numbers, by an element set, by nodes."""
    below, above = Box("C3D8", (2, 2, 1), (0, 0, 0), (2, 1, 1)), Box("C3D8", (3, 2, 1), (0, 0, 1), (2, 1, 2))
    (first, x), (second, y) = below.lines(1, "BELOW"), above.lines(1001, "ABOVE")
    text = first + second + node_set("A", 1, x[:, 2] == 1) + node_set("B", 1001, y[:, 2] == 1)
    text += "*SURFACE, NAME=Top, TYPE=ELEMENT\n1, S2\n2, S2\n3, S2\n4, S2\n*SURFACE, NAME=UNDER\nABOVE, S1\n"
    text += "*SURFACE, NAME=NODES, TYPE=NODE\nA, 1.\n*SURFACE, NAME=SIDE\nBELOW, S7\n"
    text += "*SURFACE, NAME=OVER\nABOVE, S2\n*SURFACE, NAME=BOTH, COMBINE=UNION\nFRONT, BACK\n"
    text += "*SURFACE, NAME=FRONT\n1, S2\n2, S2\n*SURFACE, NAME=BACK\n2, S2\n3, S2\n4, S2\n"
    text += "*SURFACE, NAME=ROUND, COMBINE=UNION\nROUND\n"
    (tmp_path / "deck.inp").write_text(text)
    nodes = read_nodes(tmp_path / "deck.inp")
    labels = labels_of(nodes)
    by_sets = match("joint", nodes, "A", "B", None, labels)
    for first_name in ("top", "NODES", "BOTH"):
        by_faces = match("joint", nodes, first_name, "UNDER", None, labels)
        assert abs(by_faces.B - by_sets.B).max() == 0
        np.testing.assert_array_equal(by_faces.areas, by_sets.areas)
    with pytest.raises(InputError, match="do not look at each other"):
        match("joint", nodes, "TOP", "OVER", None, labels, tolerance=2.0)
    with pytest.raises(InputError, match="has no face 'S7'"):
        side_of(nodes, "SIDE")
    with pytest.raises(InputError, match="there is no surface 'ROUND'"):
        side_of(nodes, "ROUND")
    with pytest.raises(InputError, match=r"there is no set or surface 'TOPP'"):
        side_of(nodes, "TOPP")


def test_sides_of_shells(tmp_path: Path) -> None:
    """S3 and S4 in one surface: SPOS is along the elements' own normal, SNEG against it, a node set as SPOS."""
    corners = "1, 0, 0, 0\n2, 1, 0, 0\n3, 1, 2, 0\n4, 0, 2, 0\n5, 2, 0, 0\n"
    text = f"*NODE\n{corners}*ELEMENT, TYPE=S4R, ELSET=ALL\n1, 1, 2, 3, 4\n*ELEMENT, TYPE=S3, ELSET=ALL\n2, 2, 5, 3\n"
    text += "*SURFACE, NAME=OVER\nALL, SPOS\n*SURFACE, NAME=UNDER\nALL, SNEG\n*NSET, NSET=NODES, GENERATE\n1, 5\n"
    (tmp_path / "deck.inp").write_text(text)
    nodes = read_nodes(tmp_path / "deck.inp")
    for name, up in (("OVER", 1.0), ("UNDER", -1.0), ("NODES", 1.0)):
        side = side_of(nodes, name)
        np.testing.assert_allclose(side.areas, [1 / 2, 1 / 2 + 1 / 3, 1 / 2 + 1 / 3, 1 / 2, 1 / 3], rtol=ROUNDING)
        np.testing.assert_allclose(side.normals, np.broadcast_to([0, 0, up], (5, 3)), atol=LAST_BIT)


def test_pairs_keep_the_order_of_an_npz(tmp_path: Path) -> None:
    """As parameters given pair by pair have it."""
    np.savez(tmp_path / "n.npz", coordinates=np.eye(3), nodes=[7, 3, 5], wall=[5, 7, 3])
    nodes = read_nodes(tmp_path / "n.npz")
    labels = np.column_stack([np.repeat([3, 5, 7], 3), np.tile([1, 2, 3], 3)])
    wall = match("wall", nodes, "wall", "ground", np.array([1.0, 1, 1]), labels)
    assert wall.nodes[:, 0].tolist() == [5, 7, 3] and wall.points.tolist() == np.eye(3)[[2, 0, 1]].tolist()


def test_faces_whose_corners_coincide(tmp_path: Path) -> None:
    """C3D8 collapsed to wedges about a middle node, with a node of the other side on it: no tangents there."""
    corners = [(0, 0), (2, 0), (2, 2), (0, 2)]
    places = [(x, y, z) for z in (1, 2) for x, y in [(1, 1), *corners]]
    text = "*NODE\n" + "".join(f"{k},{x},{y},{z}\n" for k, (x, y, z) in enumerate(places, 1))
    cells = [(1, 2 + k, 2 + (k + 1) % 4, 1, 6, 7 + k, 7 + (k + 1) % 4, 6) for k in range(4)]
    text += "*ELEMENT, TYPE=C3D8\n" + "".join(f"{k},{','.join(map(str, c))}\n" for k, c in enumerate(cells, 1))
    text += "*NODE\n11,1,1,1\n12,1.5,1,1\n13,1.5,1.5,1\n14,1,1.5,1\n*NSET,NSET=B,GENERATE\n1,5\n"
    text += "*ELEMENT, TYPE=S4\n5,11,12,13,14\n*NSET,NSET=A,GENERATE\n11,14\n"
    (tmp_path / "deck.inp").write_text(text)
    nodes = read_nodes(tmp_path / "deck.inp")
    labels = labels_of(nodes)
    joint = match("joint", nodes, "A", "B", None, labels)
    gradient = np.random.default_rng(1).normal(size=(3, 3))
    assert abs(joint.B @ (nodes.coordinates @ gradient).ravel()).max() < PATCH


def test_curved_faces(tmp_path: Path) -> None:
    """Two meshes of a cylinder's quarter: normals along the radius, the area within the chords' error."""
    below, above = Box("C3D20", (2, 6, 1), (0, 0, 0.8), (1, 1, 1)), Box("C3D20", (2, 5, 1), (0, 0, 1), (1, 1, 1.2))
    (first, x), (second, y) = below.lines(1, "BELOW"), above.lines(1001, "ABOVE")
    text = first + second + node_set("A", 1, x[:, 2] == 1) + node_set("B", 1001, y[:, 2] == 1)
    (tmp_path / "deck.inp").write_text(text)
    nodes = read_nodes(tmp_path / "deck.inp")
    axial, angle, radius = nodes.coordinates.T
    angle = np.pi / 2 * angle
    nodes.coordinates = np.column_stack([axial, -radius * np.cos(angle), radius * np.sin(angle)])
    labels = labels_of(nodes)
    joint = match("joint", nodes, "A", "B", None, labels, tolerance=1e-3)
    outwards = joint.points * [0, 1, 1]
    assert np.einsum("nx,nx->n", joint.frames[:, 0], outwards).min() > 1 - 1e-3
    assert joint.areas.sum() == pytest.approx(np.pi / 2, rel=1e-3)
    turned = np.cross([1.0, 0, 0], nodes.coordinates).ravel()  # about the axis: what is off the face by its sagitta
    assert abs(joint.B @ turned).max() < 1e-3


@pytest.mark.parametrize("kind", ["C3D20", "C3D15", "C3D10"])
def test_a_set_that_lacks_a_middle_node_is_said(kind: str, tmp_path: Path) -> None:
    """Whichever it is: the faces that are lost with it, by their number and the node; sets without corners are not."""
    (text, x), corners = Box(kind, (3, 3, 2), (0, 0, 0), (2, 1, 1)).lines(1, "BODY"), (3 + 1) * (3 + 1) * (2 + 1)
    top, faces = x[:, 2] == 1, 9 * (1 if kind == "C3D20" else 2)
    for k in np.flatnonzero(top):
        (tmp_path / "deck.inp").write_text(text + node_set("A", 1, top & (np.arange(len(x)) != k)))
        side = side_of(read_nodes(tmp_path / "deck.inp"), "A")
        lost = faces - sum(map(len, side.faces))
        if k < corners:
            assert not side.note
        elif side.faces:
            assert side.areas.sum() < 2.0 - 1e-2
            assert side.note.startswith(f"{lost} face") and f"1 middle node ({1 + k})" in side.note
        else:
            assert f"1 middle node ({1 + k})" in side.note
    (tmp_path / "deck.inp").write_text(text + node_set("A", 1, top))
    assert not side_of(read_nodes(tmp_path / "deck.inp"), "A").note
    (tmp_path / "deck.inp").write_text(text + node_set("A", 1, top & (np.arange(len(x)) < corners)))
    nodes, notes = read_nodes(tmp_path / "deck.inp"), list[str]()
    with pytest.raises(InputError, match="no normal") as caught:
        match("foot", nodes, "A", "GROUND", None, labels_of(nodes))
    assert f"{faces} faces of which all corners are in the set A are left out" in str(caught.value.measured)
    match("foot", nodes, "A", "GROUND", np.array([0, 0, 1.0]), labels_of(nodes), notes=notes)
    assert len(notes) == 1 and notes[0].startswith(f"contact 'foot': {faces} faces")
