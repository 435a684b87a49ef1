"""One side of a contact: its nodes with their faces, areas and normals, from a surface or from a node set of a deck."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ..arrays import Array, IntArray
from ..errors import InputError
from ..texts import counted, nearest
from .nodes import Nodes, check_alike
from .shapes import centre, gauss, node_places, shape_functions

#: Cosine of the largest angle between a node's faces and its normal, and between two sides that look at each other.
ALIKE = 0.5
#: Share of the middle's area element below which a corner has no normal of its own.
SMALL = 1e-6
#: Nodes that a message names.
SHOWN = 8


@dataclass(frozen=True)
class Side:
    """Nodes of one body in a contact.

    Attributes
    ----------
    where : the file and the set, as a user would name them
    numbers : (n,)
    points : (n, 3) [length]
    faces : list of (n_faces, m)
        Places of their nodes among those of the side, seen from outside; empty unless every node is on one.
    bare : (n_bare,)
        Nodes on no face, beside others that are.
    note : what is to be said of it, if anything
    """

    where: str
    numbers: IntArray
    points: Array
    faces: list[IntArray]
    bare: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    note: str = ""

    @property
    def name(self) -> str:
        """Of the set."""
        return self.where.rpartition(" ")[2]

    @cached_property
    def _integrals(self) -> tuple[Array, Array]:
        """Area (n,) and outward normal times area (n, 3) of each node."""
        areas, vectors = np.zeros(len(self.numbers)), np.zeros((len(self.numbers), 3))
        for table in self.faces:
            x = self.points[table]
            shares = nodal_areas(x)
            np.add.at(areas, table, shares)
            np.add.at(vectors, table, shares[:, :, None] * nodal_normals(x))
        return areas, vectors

    @property
    def areas(self) -> Array | None:
        """Of each node (n,) [length^2], None without faces; they add up to that of the faces."""
        return self._integrals[0] if self.faces else None

    @cached_property
    def normals(self) -> Array | None:
        """Outward unit normals (n, 3), the mean over the faces of a node; None without faces."""
        if not self.faces:
            return None
        vectors = self._integrals[1]
        length = np.linalg.norm(vectors, axis=1)
        folded = np.flatnonzero(length < ALIKE * self._integrals[0])
        if len(folded):
            measured = f"node {self.numbers[folded[0]]}, {len(folded)} such"
            fix = "take the faces of one side only into the set"
            raise InputError("faces of a node look away from each other", self.where, measured, "one side", fix)
        return np.asarray(vectors / length[:, None])


def side_of(nodes: Nodes, name: str) -> Side:
    """A surface of element faces, or a node set and the free faces that it covers.

    Raises
    ------
    InputError
        There is neither of this name, or a surface names an element or face that is none.
    """
    if name.upper() in nodes.elements.surfaces:
        where, note = f"{nodes.where}, surface {name}", ""
        tables = nodes.elements.faces(name.upper(), nodes.where)
        numbers = np.unique(np.concatenate([table.ravel() for table in tables] or [np.zeros(0, dtype=np.int64)]))
        if name.upper() in nodes.sets:
            check_alike(name, nodes.node_set(name), numbers, nodes.where)
    else:
        where = f"{nodes.where}, set {name}"
        numbers = _node_set(nodes, name)
        tables, note = nodes.elements.free_faces(numbers), _lacking(nodes, name, numbers)
    if not len(numbers):
        expected, fix = "faces of C3D or S elements, or nodes", "check the set in the deck"
        raise InputError("a side of the contact is empty", where, "no nodes", expected, fix)
    bare = np.setdiff1d(numbers, np.concatenate([table.ravel() for table in tables])) if tables else numbers
    order = np.argsort(numbers)
    places = [order[np.searchsorted(numbers, table, sorter=order)] for table in tables] if not len(bare) else []
    points = nodes.coordinates[nodes.places(numbers)]
    return Side(where, numbers, points, places, bare if tables else bare[:0], note)


def _lacking(nodes: Nodes, name: str, numbers: IntArray) -> str:
    """Said of a node set that has the corners of faces without their middle nodes: their area is lost."""
    count, middles = nodes.elements.lacking_middles(numbers)
    if not count:
        return ""
    shown = ", ".join(map(str, middles[:SHOWN])) + (", ..." if len(middles) > SHOWN else "")
    faces = f"{counted(count, 'face')} of which all corners are in the set {name} {'is' if count == 1 else 'are'}"
    return f"{faces} left out, for it lacks {counted(len(middles), 'middle node')} ({shown}): name a *SURFACE instead"


def has_faces(nodes: Nodes, name: str) -> bool:
    """A side's normals are known from elements."""
    return bool(side_of(nodes, name).faces)


def _node_set(nodes: Nodes, name: str) -> IntArray:
    if name.upper() not in nodes.sets and nodes.elements.surfaces:
        known = sorted({*nodes.sets, *nodes.elements.surfaces})
        fix = nearest(name.upper(), known) or "check the name"
        raise InputError(f"there is no set or surface '{name}'", nodes.where, None, f"one of {', '.join(known)}", fix)
    return nodes.node_set(name)


def nodal_areas(x: Array) -> Array:
    """Area (n_faces, m) that belongs to each node of faces (n_faces, m, 3) [length^2].

    The integral of its shape function on faces of 3 and 4 nodes. On those of 6 and 8 nodes that is zero or negative at
    corners, and no pair may press with a negative area. There the integral of its square, scaled to the face's area, is
    taken: it is positive everywhere (the diagonal scaling of E. Hinton, T. Rock and O. C. Zienkiewicz, A note on mass
    lumping and related processes in the finite element method, Earthquake Eng. Struct. Dyn. 4, 1976). On a flat face
    a corner has 1/19 or 3/76 of it, a middle node 16/57 or 4/19.
    """
    m = x.shape[1]
    points, weights = gauss(m)
    values, gradients = shape_functions(m, points)
    size = weights * np.linalg.norm(_normals(x, gradients), axis=-1)
    areas = size @ (values if m < 5 else values**2)
    return np.asarray(areas * (size.sum(axis=1) / areas.sum(axis=1))[:, None])


def nodal_normals(x: Array) -> Array:
    """Unit normals (n_faces, m, 3) of faces (n_faces, m, 3) at their nodes, of the middle where corners coincide."""
    m = x.shape[1]
    places = np.vstack([node_places(m), centre(m)])
    normals = _normals(x, shape_functions(m, places)[1])
    length = np.linalg.norm(normals, axis=-1, keepdims=True)
    flat = length[:, :-1] < SMALL * length[:, -1:]
    found = np.where(flat, normals[:, -1:], normals[:, :-1])
    return np.asarray(found / np.linalg.norm(found, axis=-1, keepdims=True))


def _normals(x: Array, gradients: Array) -> Array:
    """Cross product (n_faces, q, 3) of the tangents of faces (n_faces, m, 3) by gradients (q, 2, m)."""
    along = np.einsum("qim,fmx->fqix", gradients, x)
    return np.asarray(np.cross(along[:, :, 0], along[:, :, 1]))


def normals_of(side: Side, given: Array | None) -> Array:
    """Normals (n, 3) from a side outwards: a given one for all, or those of its faces.

    Raises
    ------
    InputError
        There is neither, or the given one does not point out of the faces.
    """
    own = side.normals
    if given is None and own is None:
        expected = "a direction, or faces of C3D or S elements under every node of the set"
        fix = "give --normal X,Y,Z from the first body to the second, a *SURFACE, or a CSV of pairs with normals"
        bare = len(side.bare)
        measured = f"node {side.bare[0]} is on no face, {bare} of {len(side.numbers)} such" if bare else None
        measured = "; ".join(filter(None, [measured, side.note])) or None
        raise InputError("the pairs have no normal", side.where, measured, expected, fix)
    if given is None or own is None:
        return np.broadcast_to(given, (len(side.numbers), 3)) if own is None else own  # type: ignore[arg-type]
    check_outwards(given / np.linalg.norm(given), own, side.where)
    return np.broadcast_to(given, own.shape)


def check_outwards(given: Array, own: Array, where: str) -> None:
    """A given unit normal points out of faces whose outward normals are (n, 3)."""
    cosine = float((own @ given).mean())
    if cosine >= ALIKE:
        return
    angle, mean = np.degrees(np.arccos(np.clip(cosine, -1, 1))), ", ".join(f"{x:.3g}" for x in own.mean(axis=0))
    measured = f"{angle:.3g} degrees from the faces' own outward normal ({mean})"
    what, fix = "the normal lies along the face", "leave --normal out: the faces have it"
    if cosine <= -ALIKE:
        what, fix = "the normal points into the first body", "turn it round, or give the two sets in the other order"
    raise InputError(what, where, measured, f"at most {np.degrees(np.arccos(ALIKE)):.0f} degrees", fix)


def check_facing(first: Array, second: Side, places: IntArray) -> None:
    """Faces of the second side look against normals (n, 3) of the first, node by node at places of the second."""
    if second.normals is None:
        return
    cosine = float(np.einsum("nx,nx->n", first, second.normals[places]).mean())
    if cosine > -ALIKE:
        measured = f"their outward normals are {np.degrees(np.arccos(np.clip(cosine, -1, 1))):.3g} degrees apart"
        fix = "check which faces (S1 to S6, SPOS, SNEG) the surfaces name"
        raise InputError("the two sides do not look at each other", second.where, measured, "about 180 degrees", fix)
