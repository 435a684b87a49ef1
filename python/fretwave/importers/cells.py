"""Elements, element sets and surfaces of an input deck, and the faces of its elements.

Node orders and face numbers of C3D4 to C3D20 (SIMULIA, Abaqus Elements Guide, "Three-dimensional solid element
library"; G. Dhondt, CalculiX CrunchiX User's Manual, "Element types" and *SURFACE). VTK's orders (vtkCellType.h and the
classes of each cell) are the same but for wedges, whose first triangle looks outwards there and inwards here.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field

import numpy as np

from ..arrays import IntArray
from ..errors import InputError
from ..fe.solids import EDGES
from ..texts import nearest
from .keywords import Lines
from .shapes import corners_of

_SOLID = re.compile(r"C3D(4|6|8|10|15|20)[A-Z]*", re.IGNORECASE)
_SHELL = re.compile(r"S([34])([A-Z][A-Z0-9]*)?", re.IGNORECASE)
#: Kinds of cells (`fretwave.model.cells`) by the nodes of solids and of shells.
SOLIDS = {
    4: "tetrahedron",
    6: "wedge",
    8: "hexahedron",
    10: "quadratic_tetrahedron",
    15: "quadratic_wedge",
    20: "quadratic_hexahedron",
}
#: In place of a face: the faces of another surface.
ALL_OF = "*"
_SHELLS = {3: "triangle", 4: "quadrilateral"}
#: Places of the deck's nodes in VTK's order, where it is another.
_TO_VTK = {"wedge": [3, 4, 5, 0, 1, 2], "quadratic_wedge": [3, 4, 5, 0, 1, 2, 9, 10, 11, 6, 7, 8, 12, 13, 14]}

#: Corners of the faces S1, S2, ... (from 1, as in the manuals, seen from inside).
_TETRAHEDRON = ((1, 2, 3), (1, 4, 2), (2, 4, 3), (3, 4, 1))
_WEDGE = ((1, 2, 3), (4, 6, 5), (1, 4, 5, 2), (2, 5, 6, 3), (3, 6, 4, 1))
_HEXAHEDRON = ((1, 2, 3, 4), (5, 8, 7, 6), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 8, 4), (4, 8, 5, 1))


def _faces(kind: str, corners: tuple[tuple[int, ...], ...]) -> list[list[int]]:
    """Places of the nodes of each face, seen from outside: corners, then the middle nodes of the edges between them."""
    edges = EDGES.get(kind, ())
    middle = {frozenset((a + 1, b + 1)): max(map(max, corners)) + k for k, (a, b) in enumerate(edges)}
    found = []
    for face in corners:
        outside = face[::-1]
        around = zip(outside, (*outside[1:], outside[0])) if edges else ()
        found.append([corner - 1 for corner in outside] + [middle[frozenset(edge)] for edge in around])
    return found


#: Faces of each kind, places of their nodes seen from outside; a shell's own side first.
FACES = {
    **{kind: _faces(kind, _TETRAHEDRON) for kind in ("tetrahedron", "quadratic_tetrahedron")},
    **{kind: _faces(kind, _WEDGE) for kind in ("wedge", "quadratic_wedge")},
    **{kind: _faces(kind, _HEXAHEDRON) for kind in ("hexahedron", "quadratic_hexahedron")},
    "triangle": [[0, 1, 2], [2, 1, 0]],
    "quadrilateral": [[0, 1, 2, 3], [3, 2, 1, 0]],
}
#: Faces of a shell by what decks call them.
SHELL_SIDES = {"SPOS": 0, "POS": 0, "S2": 0, "SNEG": 1, "NEG": 1, "S1": 1}


@dataclass
class Block:
    """Elements of one kind.

    Attributes
    ----------
    numbers : (n,)
    nodes : (n, m)
        Node numbers in the deck's order.
    """

    numbers: IntArray
    nodes: IntArray


@dataclass
class Elements:
    """Elements by kind, element sets, and surfaces.

    Attributes
    ----------
    blocks : dict
        `Block` by kind (`fretwave.model.cells`).
    sets : dict
        Element numbers and names of sets by the set's name in capitals.
    surfaces : dict
        Lines (element number or set, face) by the surface's name in capitals.
    left_out : set
        Types of elements that are not read.
    """

    blocks: dict[str, Block] = field(default_factory=dict)
    sets: dict[str, list[int | str]] = field(default_factory=dict)
    surfaces: dict[str, list[tuple[str, str]]] = field(default_factory=dict)
    left_out: set[str] = field(default_factory=set)

    def add(self, options: dict[str, str], data: Lines) -> None:
        """The lines of an ``*ELEMENT``: number and nodes; an element may go over several lines. Others are left out."""
        kind, count = _kind(options.get("TYPE", ""))
        if not kind:
            self.left_out.add(options.get("TYPE", "").upper())
            return
        words = [(place, word.strip()) for place, text in data for word in text.split(",") if word.strip()]
        wrong = next((place for place, word in words if not word.isdigit()), None)
        if wrong is None and len(words) % (1 + count):
            wrong = data[-1][0]
        if wrong is not None:
            expected = f"element, {count} nodes"
            raise InputError("this is no element", wrong, None, expected, "correct the line")
        table = np.array([int(word) for _, word in words], dtype=np.int64).reshape(-1, 1 + count)
        was = self.blocks.get(kind, Block(table[:0, 0], table[:0, 1:]))
        self.blocks[kind] = Block(np.append(was.numbers, table[:, 0]), np.vstack([was.nodes, table[:, 1:]]))
        if "ELSET" in options:
            self.sets.setdefault(options["ELSET"].upper(), []).extend(table[:, 0].tolist())

    def add_surface(self, name: str, data: Lines) -> None:
        """The lines of a ``*SURFACE, TYPE=ELEMENT``: element or set, face."""
        lines = self.surfaces.setdefault(name.upper(), [])
        for _, text in data:
            first, _, face = text.partition(",")
            lines.append((first.strip().upper(), face.strip().strip(",").upper()))

    def unite(self, name: str, data: Lines) -> None:
        """The lines of a ``*SURFACE, COMBINE=UNION``: names of others, which may come later."""
        names = [word.strip().upper() for _, text in data for word in text.split(",") if word.strip()]
        self.surfaces.setdefault(name.upper(), []).extend((one, ALL_OF) for one in names)

    def vtk(self) -> dict[str, IntArray]:
        """Node numbers (n, m) in VTK's order by kind, cells in the order of their numbers."""
        ordered = {kind: block.nodes[np.argsort(block.numbers)] for kind, block in self.blocks.items()}
        return {kind: nodes[:, _TO_VTK.get(kind, slice(None))] for kind, nodes in ordered.items()}

    def members(self, name: str, where: str, above: tuple[str, ...] = ()) -> IntArray:
        """Element numbers of a set, of sets that it names too."""
        if name not in self.sets or name in above:
            fix = nearest(name, list(self.sets)) or "check the name"
            raise InputError(f"there is no element set '{name}'", where, None, ", ".join(sorted(self.sets)), fix)
        own = [member for member in self.sets[name] if isinstance(member, int)]
        others = [self.members(str(m), where, (*above, name)) for m in self.sets[name] if not isinstance(m, int)]
        return np.asarray(np.unique(np.concatenate([np.array(own, dtype=np.int64), *others])))

    def nodes_of(self, name: str, where: str) -> IntArray:
        """Node numbers of an element set's elements."""
        chosen = self.members(name, where)
        tables = [block.nodes[np.isin(block.numbers, chosen)].ravel() for block in self.blocks.values()]
        return np.asarray(np.unique(np.concatenate(tables)))

    def check_numbers(self, where: str) -> None:
        """Each element stands once.

        Raises
        ------
        InputError
            A number stands twice.
        """
        numbers = [block.numbers for block in self.blocks.values()]
        different, count = np.unique(np.concatenate([*numbers, np.zeros(0, np.int64)]), return_counts=True)
        if (count > 1).any():
            measured, fix = int(different[np.argmax(count)]), "number the elements through"
            raise InputError("an element number stands twice", where, measured, "each element once", fix)

    def faces(self, name: str, where: str, above: tuple[str, ...] = ()) -> list[IntArray]:
        """Node numbers (n_faces, m) of the faces of a surface, each once, seen from outside, by kind of face."""
        if name not in self.surfaces or name in above:
            fix = nearest(name, list(self.surfaces)) or "check the name"
            raise InputError(f"there is no surface '{name}'", where, None, ", ".join(sorted(self.surfaces)), fix)
        found = []
        for first, face in self.surfaces[name]:
            if face == ALL_OF:
                found += self.faces(first, f"{where}, surface {name}", (*above, name))
                continue
            numbers = np.array([int(first)]) if first.isdigit() else self.members(first, where)
            self._check_there(numbers, f"{where}, surface {name}")
            for kind, block in self.blocks.items():
                chosen = np.isin(block.numbers, numbers)
                if chosen.any():
                    found.append(block.nodes[chosen][:, _face_of(kind, face, f"{where}, surface {name}")])
        return [np.unique(table, axis=0) for table in _by_nodes(found)]

    def _check_there(self, numbers: IntArray, where: str) -> None:
        missing = np.setdiff1d(
            numbers, np.concatenate([np.zeros(0, np.int64), *(b.numbers for b in self.blocks.values())])
        )
        if len(missing):
            measured, fix = (
                f"{len(missing)} of them, the first is {missing[0]}",
                "correct the surface or its element sets",
            )
            raise InputError("a surface names elements that are none", where, measured, "C3D or S elements", fix)

    def free_faces(self, nodes: IntArray) -> list[IntArray]:
        """Faces of one element alone whose nodes are all in a set, as `faces`; of solids where shells lie on them."""
        solids, shells = list[IntArray](), list[IntArray]()
        for kind, block in self.blocks.items():
            skin = kind in _SHELLS.values()
            for face in FACES[kind][: 1 if skin else None]:
                table = block.nodes[:, face]
                (shells if skin else solids).append(table[np.isin(table, nodes).all(axis=1)])
        bodies = _by_nodes(solids)
        return _by_nodes([*map(_alone, bodies), *(_beside(_alone(table), bodies) for table in _by_nodes(shells))])

    def lacking_middles(self, nodes: IntArray) -> tuple[int, IntArray]:
        """Free faces with all corners in a set but not all middle nodes: how many, and the nodes that it lacks."""
        found = []
        for kind, block in self.blocks.items():
            for face in FACES[kind] if kind not in _SHELLS.values() else ():
                table = block.nodes[:, face]
                inside = np.isin(table, nodes)
                corners = corners_of(len(face))
                found.append(table[inside[:, :corners].all(axis=1) & ~inside.all(axis=1)])
        tables = [_alone(table) for table in _by_nodes(found)]
        reached = np.concatenate([np.zeros(0, dtype=np.int64), *(table.ravel() for table in tables)])
        return sum(map(len, tables)), np.setdiff1d(reached, nodes)


def _kind(name: str) -> tuple[str, int]:
    solid, shell = _SOLID.fullmatch(name), _SHELL.fullmatch(name)
    count = int((solid or shell).group(1)) if solid or shell else 0  # type: ignore[union-attr]
    return (SOLIDS[count] if solid else _SHELLS[count] if shell else ""), count


def _face_of(kind: str, face: str, where: str) -> list[int]:
    if kind in _SHELLS.values():
        known = SHELL_SIDES
    else:
        known = {f"S{number}": number - 1 for number in range(1, len(FACES[kind]) + 1)}
    if face not in known:
        fix = "name the face that lies on the other body"
        raise InputError(f"a {kind} has no face '{face}'", where, face or "none", ", ".join(known), fix)
    return FACES[kind][known[face]]


def _by_nodes(tables: list[IntArray]) -> list[IntArray]:
    """Tables of equal width joined, without empty ones."""
    widths = sorted({table.shape[1] for table in tables if len(table)})
    return [np.vstack([table for table in tables if table.shape[1] == width]) for width in widths]


def _alone(table: IntArray) -> IntArray:
    """Without the faces that two elements share: those lie inside a body."""
    _, place, count = np.unique(np.sort(table, axis=1), axis=0, return_inverse=True, return_counts=True)
    return np.asarray(table[count[place.ravel()] == 1])


def _beside(table: IntArray, others: list[IntArray]) -> IntArray:
    """Without the faces whose corners are those of others."""
    known = {row for other in others for row in _corners(other)}
    return np.asarray(table[np.array([row not in known for row in _corners(table)], dtype=bool)])


def _corners(table: IntArray) -> list[tuple[int, ...]]:
    return [tuple(row) for row in np.sort(table[:, : corners_of(table.shape[1])], axis=1).tolist()]
