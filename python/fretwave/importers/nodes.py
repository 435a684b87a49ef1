"""Node coordinates and node sets: CSV, NPZ, or the ``*NODE`` and ``*NSET`` of an Abaqus or CalculiX input deck.

CSV: lines "node, x, y, z". NPZ: ``coordinates`` (n_nodes, 3), optionally ``nodes`` (n_nodes,) with their numbers (1, 2,
... otherwise); every other array of whole numbers is a node set of its name.
Deck (SIMULIA, Abaqus Keywords Reference, *NODE, *NSET, *INCLUDE; G. Dhondt, CalculiX CrunchiX User's Manual): names and
keywords in any case; ``*NSET, GENERATE`` gives first, last, step; a set may name other sets. ``*ELEMENT`` and
``*SURFACE`` give cells and faces (`cells`); ``*ELASTIC`` and ``*DENSITY`` of a ``*MATERIAL`` tell its units.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..arrays import Array, IntArray
from ..errors import InputError
from ..texts import display, nearest, whole_in
from .cells import Elements
from .constraints import Constraints
from .keywords import Lines, blocks, number, turns_nothing
from .text import columns_of, head_of, whole

_FLAT = "write the deck flat, with every node and element in it where it is"
_MADE = ("nodes or elements are made of others", "each in a *NODE or *ELEMENT", _FLAT)
#: Keywords that are not followed, and without which the mesh would be another: what they do, expected, what to do.
REFUSED = {
    "TRANSFORM": (
        "directions of nodes are turned",
        "directions x, y, z at every node",
        "take *TRANSFORM out and export the matrices again",
    ),
    "SYSTEM": ("coordinates of nodes are turned or moved", "those of the whole model", _FLAT),
    "NMAP": ("coordinates of nodes are turned or moved", "those of the whole model", _FLAT),
    **dict.fromkeys(("NGEN", "NFILL", "NCOPY", "ELGEN", "ELCOPY", "SYMMETRIC MODEL GENERATION"), _MADE),
}


@dataclass
class Material:
    """The first numbers of a material, None where the deck has none: Young's modulus and density."""

    name: str
    where: str
    modulus: float | None = None
    density: float | None = None


@dataclass
class Nodes:
    """Nodes of a mesh.

    Attributes
    ----------
    numbers : (n_nodes,)
    coordinates : (n_nodes, 3)
    sets : dict
        Node numbers by the set's name in capitals.
    where : str
        The file, as a user would name it.
    elements : Elements
        Of a deck, with their sets and surfaces.
    materials : list of Material
        With a modulus or a density.
    constraints : Constraints
        Of a deck.
    """

    numbers: IntArray
    coordinates: Array
    where: str
    sets: dict[str, IntArray] = field(default_factory=dict)
    elements: Elements = field(default_factory=Elements)
    materials: list[Material] = field(default_factory=list)
    constraints: Constraints = field(default_factory=Constraints)

    def __post_init__(self) -> None:
        different, count = np.unique(self.numbers, return_counts=True)
        if len(different) != len(self.numbers):
            twice = int(different[count > 1][0])
            fix = "give one flat list of nodes (write the deck without parts and instances)"
            raise InputError("a node number stands twice", self.where, twice, "each node once", fix)
        if self.coordinates.shape != (len(self.numbers), 3) or not np.isfinite(self.coordinates).all():
            raise InputError(
                "the coordinates are not usable",
                self.where,
                f"shape {self.coordinates.shape}, {len(self.numbers)} nodes",
                "three finite numbers for each node",
                "write node, x, y, z",
            )

    def places(self, numbers: IntArray) -> IntArray:
        """Rows of nodes by number.

        Raises
        ------
        InputError
            A node is not there.
        """
        order = np.argsort(self.numbers)
        found = np.clip(np.searchsorted(self.numbers[order], numbers), 0, len(order) - 1)
        rows = order[found]
        missing = self.numbers[rows] != numbers
        if missing.any():
            fix = "give the coordinates of all nodes of the pairs"
            measured = f"{missing.sum()} of {len(numbers)} nodes, the first is {numbers[missing][0]}"
            raise InputError("a node has no coordinates", self.where, measured, "all nodes of the pairs", fix)
        return np.asarray(rows, dtype=np.int64)

    def node_set(self, name: str) -> IntArray:
        """Node numbers of a set."""
        if name.upper() not in self.sets:
            known = sorted(self.sets)
            raise InputError(
                f"there is no node set '{name}'",
                self.where,
                None,
                f"one of {', '.join(known)}" if known else "a file with node sets (*NSET, or arrays in a .npz)",
                nearest(name.upper(), known) or "check the name",
            )
        return self.sets[name.upper()]


def read_nodes(path: Path) -> Nodes:
    """Coordinates and sets from a file of any of the forms."""
    if not path.is_file():
        raise InputError("the file of coordinates does not exist", display(path), fix="check the path")
    head = head_of(path, 4096)
    if head.startswith(b"PK\x03\x04"):
        return _from_npz(path)
    if head.lstrip().startswith(b"*"):
        return Deck(path).nodes()
    table = columns_of(path, 4, names=("node", "x", "y", "z"))
    return Nodes(whole(table[:, 0], display(path)), table[:, 1:], display(path))


def cells_of(nodes: Nodes) -> tuple[IntArray | None, dict[str, IntArray]]:
    """Hexahedra of one kind, and the other cells by kind: places of their nodes (n_cells, m) in VTK's order."""
    found = {
        kind: nodes.places(numbers.ravel()).reshape(numbers.shape) for kind, numbers in nodes.elements.vtk().items()
    }
    kind = "hexahedron" if "hexahedron" in found else "quadratic_hexahedron"
    return found.pop(kind, None), found


def _from_npz(path: Path) -> Nodes:
    where = display(path)
    with np.load(path) as archive:
        if "coordinates" not in archive.files:
            measured = f"it holds {', '.join(archive.files)}"
            raise InputError("there are no coordinates", where, measured, "an array 'coordinates' (n_nodes, 3)")
        coordinates = np.atleast_2d(np.asarray(archive["coordinates"], dtype=float))
        numbers = archive["nodes"] if "nodes" in archive.files else np.arange(1, len(coordinates) + 1)
        others = {name.upper(): archive[name] for name in archive.files if name not in ("coordinates", "nodes")}
    sets = {name: _once(values.ravel()) for name, values in others.items() if values.dtype.kind in "iu"}
    return Nodes(whole(numbers, where), coordinates, where, sets)


def _once(values: IntArray) -> IntArray:
    """Different values, in the order in which they come first."""
    return values[np.sort(np.unique(values, return_index=True)[1])].astype(np.int64)


class Deck:
    """Nodes, elements, their sets and surfaces of an input deck; every other keyword is passed over."""

    def __init__(self, path: Path) -> None:
        self.where = display(path)
        self.rows: list[tuple[int, float, float, float]] = []
        self.members: dict[str, list[int | str]] = {}
        self.surfaces: dict[str, list[int | str]] = {}
        self.of_elements: list[tuple[str, str]] = []
        self.parts: set[str] = set()
        self.constraints = Constraints()
        self.elements = Elements()
        self.materials: list[Material] = []
        for keyword, options, data in blocks(path):
            self.constraints.add(keyword, data)
            if keyword == "NODE":
                self._add_nodes(options, data)
            elif keyword == "NSET":
                self._add_set(self.members, "NSET", options, data)
                if "ELSET" in options:
                    self.of_elements.append((options.get("NSET", "").upper(), options["ELSET"].upper()))
            elif keyword == "ELSET":
                self._add_set(self.elements.sets, "ELSET", options, data)
            elif keyword == "ELEMENT":
                self.elements.add(options, data)
            elif keyword == "SURFACE":
                self._add_surface(options, data)
            elif keyword in ("MATERIAL", "ELASTIC", "DENSITY"):
                self._add_material(keyword, options, data)
            elif keyword == "INSTANCE":
                self._add_instance(options, data)
            elif keyword in REFUSED and not (keyword == "SYSTEM" and turns_nothing(data)):
                what, expected, fix = REFUSED[keyword]
                raise InputError(what, self.where, f"*{keyword}", expected, fix)

    def _add_instance(self, options: dict[str, str], data: Lines) -> None:
        part = options.get("PART", "").upper()
        if data or part in self.parts:
            what = "an instance is moved" if data else "a part has two instances"
            place, text = data[0] if data else (self.where, part)
            fix = "write the deck flat (Abaqus/CAE: do not use parts and assemblies in input files)"
            raise InputError(what, place, text, "each part once, where it is", fix)
        self.parts.add(part)

    def _add_nodes(self, options: dict[str, str], data: Lines) -> None:
        if options.get("SYSTEM", "R").upper() != "R":
            fix = "write rectangular coordinates"
            raise InputError("coordinates are not rectangular", self.where, f"SYSTEM={options['SYSTEM']}", "R", fix)
        before = len(self.rows)
        for place, text in data:
            words = [word.strip() for word in text.split(",")]
            try:
                x, y, z = [number(word) for word in (words[1:4] + ["", "", ""])[:3]]
                self.rows.append((whole_in(words[0]), x, y, z))
            except ValueError:
                fix = "correct the line"
                raise InputError("this is no node", place, text, "node, x, y, z", fix) from None
        if "NSET" in options:
            self.members.setdefault(options["NSET"].upper(), []).extend(row[0] for row in self.rows[before:])

    def _add_surface(self, options: dict[str, str], data: Lines) -> None:
        """Faces of elements, or nodes: a node set of its name."""
        if options.get("TYPE", "ELEMENT").upper() == "NODE":
            lines = [(line, text.partition(",")[0]) for line, text in data]  # without the areas that may follow
            self._add_set(self.surfaces, "NAME", options, lines)
        elif (how := options.get("COMBINE", "UNION").upper()) != "UNION":
            what, fix = "a surface is no union of others", "name the faces of its elements"
            raise InputError(what, self.where, f"*SURFACE, COMBINE={how}", "COMBINE=UNION", fix)
        elif "COMBINE" in options:
            self.elements.unite(options.get("NAME", ""), data)
        else:
            self.elements.add_surface(options.get("NAME", ""), data)

    def _add_set(self, sets: dict[str, list[int | str]], key: str, options: dict[str, str], data: Lines) -> None:
        members = sets.setdefault(options.get(key, "").upper(), [])
        for place, text in data:
            words = [word.strip().strip('"') for word in text.split(",") if word.strip()]
            try:
                if "GENERATE" in options:
                    members.extend(_generated(*words))
                else:
                    members.extend(int(word) if word.lstrip("-").isdigit() else word.upper() for word in words)
            except (TypeError, ValueError):
                expected = "first, last, step" if "GENERATE" in options else "numbers or names of sets"
                fix, kind = "correct the line", "element" if key == "ELSET" else "node"
                raise InputError(f"this is no {kind} set", place, text, expected, fix) from None

    def _add_material(self, keyword: str, options: dict[str, str], data: Lines) -> None:
        """A material's name, or its first modulus or density, as far as it is a number."""
        if keyword == "MATERIAL":
            self.materials.append(Material(options.get("NAME", "a material"), self.where))
            return
        try:
            value = number(data[0][1].partition(",")[0].strip())
        except (IndexError, ValueError):
            return
        if self.materials and value > 0:
            now = self.materials[-1]
            now.where = data[0][0]
            setattr(now, "modulus" if keyword == "ELASTIC" else "density", value)

    def _expand(self, members: list[int | str], above: tuple[str, ...] = ()) -> list[int]:
        found: list[int] = []
        for member in members:
            if isinstance(member, int):
                found.append(member)
            elif member in self.members and member not in above:
                found.extend(self._expand(self.members[member], (*above, member)))
            else:
                known = ", ".join(sorted(self.members))
                what, fix = f"a node set names '{member}', which is none", "correct the set"
                raise InputError(what, self.where, None, f"one of {known}", fix)
        return found

    def _sets(self) -> dict[str, IntArray]:
        """Node numbers of sets, and of surfaces of nodes, which may have the name of a set."""
        for name, elements in self.of_elements:
            self.members[name] += self.elements.nodes_of(elements, self.where).tolist()
        sets, surfaces = (
            {name: np.unique(np.array(self._expand(members), dtype=np.int64)) for name, members in table.items()}
            for table in (self.members, self.surfaces)
        )
        for name in sets.keys() & surfaces.keys():
            check_alike(name, sets[name], surfaces[name], self.where)
        return {**sets, **surfaces}

    def nodes(self) -> Nodes:
        """What the deck holds."""
        if not self.rows:
            raise InputError("the deck has no nodes", self.where, None, "*NODE", "give the deck with the mesh")
        table = np.array([row[1:] for row in self.rows])
        numbers = np.array([row[0] for row in self.rows], dtype=np.int64)
        materials = [one for one in self.materials if one.modulus is not None or one.density is not None]
        found = Nodes(numbers, table, self.where, self._sets(), self.elements, materials, self.constraints)
        self.elements.check_numbers(self.where)
        return found


def check_alike(name: str, one: IntArray, other: IntArray, where: str) -> None:
    """A node set and a surface of one name have the same nodes.

    Raises
    ------
    InputError
        They have not: which is meant is not known.
    """
    if not np.array_equal(np.unique(one), np.unique(other)):
        measured = f"{len(one)} nodes in the set, {len(other)} on the surface"
        what, fix = f"a node set and a surface are both called '{name}'", "give one of them another name"
        raise InputError(what, where, measured, "the same nodes", fix)


def _generated(first: str, last: str, step: str = "1") -> range:
    """Of a line "first, last, step".

    Raises
    ------
    ValueError
        It has no members, or a step that does not go upwards.
    """
    begin, end, by = (whole_in(word) for word in (first, last, step))
    if end < begin or by < 1:
        raise ValueError
    return range(begin, end + 1, by)
