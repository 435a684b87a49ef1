"""One sector of a wheel in a mesh: its two faces, and pairs that reach the next sector."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import dataclass

import numpy as np

from ..arrays import Array, Indices, IntArray
from ..cyclic.faces import match_faces
from ..cyclic.frames import in_triples
from ..errors import InputError
from ..model.pairs import Pairs
from ..model.sectors import check_number, rotation
from ..model.structure import Structure
from ..results.model_file import dof_name
from ..texts import counted
from .nodes import Nodes

#: Nodes are on one plane through the axis to this share of their largest distance from it.
FLAT = 1e-6


@dataclass
class SectorFaces:
    """A sector of `sectors` about an axis, between two node sets."""

    sectors: int
    low: str
    high: str
    axis: str

    @property
    def turn(self) -> Array:
        """Rotation (3, 3) from a sector to the next one."""
        return rotation(2 * np.pi / self.sectors, self.axis)

    def dofs(self, nodes: Nodes, labels: IntArray, tolerance: float | None = None) -> tuple[Indices, Indices]:
        """Matching dofs (n_face,) of the low and high face, x, y, z of each node that is not held.

        Raises
        ------
        InputError
            The faces do not match, in space or in what is held.
        """
        where = f"{nodes.where}, sets {self.low} and {self.high}"
        low, high = (nodes.places(nodes.node_set(name)).astype(np.intp) for name in (self.low, self.high))
        try:
            low, high = match_faces(nodes.coordinates, low, high, self.sectors, self.axis, tolerance, nodes.numbers)
            faces = _matching(labels, nodes.numbers[low], nodes.numbers[high])
            return in_triples(labels, *faces, [dof_name(*label) for label in labels.tolist()])
        except InputError as error:
            place = f"{where}: {error.where}" if error.where else where
            raise InputError(error.what, place, error.measured, error.expected, error.fix) from None

    def circumferential(self, name: str, nodes: Nodes) -> Array:
        """Direction (3,) to the next sector at a node set that lies on one plane through the axis.

        Raises
        ------
        InputError
            It does not: the contact's normal is another.
        """
        points = nodes.coordinates[nodes.places(nodes.node_set(name))]
        along = np.eye(3)["xyz".index(self.axis)]
        radial = points - np.outer(points @ along, along)
        normal = np.cross(along, radial.sum(axis=0))
        size = float(np.linalg.norm(normal))
        off = float(abs(radial @ normal).max(initial=0.0)) / size if size else np.inf
        if off > FLAT * np.linalg.norm(radial, axis=1).max(initial=0.0):
            raise InputError(
                "the pairs have no normal",
                f"{nodes.where}, set {name}",
                f"nodes up to {off:.3g} from a plane through the axis {self.axis}",
                "a face on such a plane, whose normal is along the circumference",
                "give --normal X,Y,Z, from the first body to the second",
            )
        return np.asarray(normal / size)

    def check_apart(self, name: str, nodes: Nodes, pairs: Pairs) -> None:
        """No pair is of two nodes that the faces tie.

        Raises
        ------
        InputError
            They cannot move against each other.
        """
        assert pairs.nodes is not None
        ends = zip(pairs.nodes.T, (self.high, self.low))
        tied = np.all([np.isin(numbers, nodes.node_set(face)) for numbers, face in ends], axis=0)
        if tied.any():
            a, b = pairs.nodes[np.argmax(tied)]
            raise InputError(
                f"pairs of contact '{name}' are tied by the sector's faces",
                f"{nodes.where}, sets {self.low} and {self.high}",
                f"nodes {a} and {b}, {counted(int(tied.sum()), 'such pair')}",
                "nodes that move against each other",
                f"leave them out of {self.low} and {self.high}",
            )


def wheel_of(options: Namespace) -> SectorFaces | None:
    """What the options of an import say of a sector, None where they say nothing."""
    given = {f"--{key}": getattr(options, key) for key in ("sectors", "low", "high", "axis")}
    missing = [key for key, value in given.items() if value is None]
    if len(missing) == len(given):
        return None
    if missing:
        fix = f"add {' and '.join(missing)}"
        raise InputError("a sector of a wheel is not told in full", ", ".join(given), None, "all four", fix)
    check_number(options.sectors)
    return SectorFaces(options.sectors, options.low, options.high, options.axis)


def make_sector(model: Structure, wheel: SectorFaces, nodes: Nodes | None, tolerance: float | None) -> None:
    """Give a model its faces.

    Raises
    ------
    InputError
        Its nodes are not known, or the faces do not match.
    """
    if model.labels is None or nodes is None:
        fix = "give --coordinates FILE with the node sets, and --dofs FILE where the matrices do not name nodes"
        raise InputError("the faces of a sector are node sets", "--low and --high", None, "nodes and their dofs", fix)
    model.sectors, model.axis = wheel.sectors, wheel.axis
    model.low, model.high = wheel.dofs(nodes, model.labels, tolerance)


def said_of(wheel: SectorFaces, model: Structure) -> str:
    """A line of the report."""
    assert model.low is not None and model.labels is not None
    nodes = counted(len(np.unique(model.labels[model.low, 0])), "free node")
    return f"sector: one of {wheel.sectors} about {wheel.axis}, {nodes} on each face, {wheel.low} and {wheel.high}"


def _matching(labels: IntArray, low: IntArray, high: IntArray) -> tuple[Indices, Indices]:
    """Dofs of matching nodes, none where both are held."""
    place = {(node, direction): dof for dof, (node, direction) in enumerate(labels.tolist())}
    partner = dict(zip(low.tolist(), high.tolist()))
    wanted = {(node, direction): (partner[node], direction) for node, direction in place if node in partner}
    others, on_high = set(wanted.values()), set(high.tolist())
    missing = [other for other in wanted.values() if other not in place]
    alone = [own for own in place if own[0] in on_high and own not in others]
    if missing or alone:
        raise InputError(
            "a node is held on one face of the sector and free on the other",
            None,
            f"{dof_name(*(missing or alone)[0])} is {'held' if missing else 'free, its partner is held'}, "
            f"{len(missing) + len(alone)} such dofs",
            "the same directions held on both faces",
            "hold both, or none",
        )
    dofs = [(place[own], place[other]) for own, other in wanted.items()]
    if not dofs:
        raise InputError("no dof of the sector's faces is free", None, None, "nodes that move", "check the node sets")
    first, second = np.array(dofs, dtype=np.intp).T
    return first, second
