"""Nodes, components and solid elements of Ansys: an archive (``CDWRITE,DB``), or a result file (``job.rst``).

Read by the packages mapdl-archive and ansys-mapdl-reader (both MIT). Layout (Ansys, Mechanical APDL Programmer's
Reference, "Coded Database File Commands"; Command Reference): NBLOCK of the nodes with the angles of their directions
(NROTAT), EBLOCK of elements, CMBLOCK of components, of which those of nodes are node sets. MPDATA of materials, D of
held dofs, CE and CP of constraint equations, which the package does not read, are read here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Protocol

import numpy as np

from ..arrays import Array, IntArray
from ..errors import InputError
from ..texts import display
from .ansys_elements import KINDS, blocks_of
from .cells import Elements
from .constraints import Constraints
from .extras import reader_of
from .keywords import number
from .nodes import Material, Nodes

DIRECTIONS = ("UX", "UY", "UZ", "ROTX", "ROTY", "ROTZ")
#: Of archives, without which their package reads none.
SUFFIXES = (".cdb", ".dat", ".inp")
QUANTITIES = {"EX": "modulus", "DENS": "density"}


class Mesh(Protocol):
    """What both packages give: (n,) numbers of nodes, (n, 3) coordinates, (n, 3) angles of their directions [degree], a
    row of integers an element, element types, members of node components."""

    nnum: IntArray
    nodes: Array
    node_angles: Array | None
    elem: Sequence[IntArray]
    etype: IntArray
    node_components: Mapping[str, IntArray]


def read_archive(path: Path) -> Nodes:
    """Nodes with their sets, elements, materials and what is held.

    Raises
    ------
    InputError
        There are no nodes, directions of nodes are turned, an element is of no known shape, or the name no archive's.
    """
    where = display(path)
    if path.suffix.lower() not in SUFFIXES:
        measured, fix = path.suffix or "no suffix", f"rename it to {path.stem}.cdb"
        raise InputError("an archive of Ansys has another name", where, measured, ", ".join(SUFFIXES), fix)
    package = reader_of("mapdl_archive", "mapdl-archive", where)
    nodes = _nodes(package.Archive(str(path), parse_vtk=False), where)
    nodes.materials, nodes.constraints = _lines(path, where)
    return nodes


def read_result(path: Path) -> Nodes:
    """Nodes with their sets and elements, as `read_archive`."""
    where = display(path)
    package = reader_of("ansys.mapdl.reader", "ansys-mapdl-reader", where)
    return _nodes(package.read_binary(str(path)).mesh, where)


def _nodes(mesh: Mesh, where: str) -> Nodes:
    """Of the mesh that either package gives."""
    numbers, coordinates = mesh.nnum.astype(np.int64), np.array(mesh.nodes, dtype=float)
    if not len(numbers):
        raise InputError("the file has no nodes", where, "0", "a mesh", "write it with nodes: CDWRITE,DB")
    if mesh.node_angles is not None:
        _check_angles(numbers, mesh.node_angles, where)
    types = np.asarray(mesh.etype) if len(mesh.elem) else np.zeros(0, dtype=np.int64)  # of none the package has none
    left_out = {str(kind) for kind in set(types.tolist()) - KINDS.keys()}
    elements = Elements(blocks_of(mesh.elem, types, where), left_out=left_out)
    elements.check_numbers(where)
    sets = {name.upper(): np.unique(members).astype(np.int64) for name, members in mesh.node_components.items()}
    return Nodes(numbers, coordinates, where, sets, elements)


def _check_angles(numbers: IntArray, angles: Array, where: str) -> None:
    turned = angles.any(axis=1)
    if turned.any():
        measured = f"node {numbers[turned][0]} by {angles[turned][0]} degrees, {turned.sum()} such"
        expected, fix = "directions x, y, z at every node", "take NROTAT out and write both files again"
        raise InputError("directions of nodes are turned", where, measured, expected, fix)


class Block:
    """Whether a block of nodes, elements or a component has been read to its end: ``-1``, or as many as are said."""

    PER_LINE = 8

    def __init__(self) -> None:
        self.open, self.lines = "", 0

    def take(self, keyword: str, words: Sequence[str]) -> None:
        """The next line."""
        if keyword in ("NBLOCK", "EBLOCK", "CMBLOCK"):
            count = int(words[2].split("!")[0]) if keyword == "CMBLOCK" else 0
            self.open, self.lines = keyword, 1 - count // -self.PER_LINE  # the format, and the members
        elif self.open == "CMBLOCK":
            self.lines -= 1
            self.open = self.open if self.lines else ""
        elif self.open and (keyword in ("-1", "N") or keyword.startswith("-1")):
            self.open = ""


def _lines(path: Path, where: str) -> tuple[list[Material], Constraints]:
    """What is said line by line: materials, what is held, and what is joined."""
    materials, constraints, block = dict[str, Material](), Constraints(), Block()
    with path.open(encoding="utf-8", errors="replace") as file:
        for count, line in enumerate(file, 1):
            keyword, *words = [word.strip().upper() for word in line.split(",")]
            block.take(keyword, words)
            if keyword == "MPDATA":
                _add_material(materials, words, f"{where}:{count}")
            elif keyword == "D" and len(words) > 1 and words[0].isdigit():
                _hold(constraints, *words[:2])
            elif keyword in ("CE", "CP"):
                constraints.joins = constraints.joins or keyword
    if block.open:
        raise InputError("the file is cut", where, f"it ends within {block.open}", "whole blocks", "write it again")
    return list(materials.values()), constraints


def _add_material(materials: dict[str, Material], words: Sequence[str], place: str) -> None:
    """``MPDATA,R5.0, 1,EX, 2, 1, 7.0E+10,``: the first value of a quantity of a material."""
    label, name, _, value = (*words[2:], *4 * [""])[:4]
    if label in QUANTITIES and value:
        material = materials.setdefault(name, Material(f"material {name}", place))
        if getattr(material, QUANTITIES[label]) is None:
            setattr(material, QUANTITIES[label], number(value))


def _hold(constraints: Constraints, node: str, label: str) -> None:
    direction = DIRECTIONS.index(label) + 1 if label in DIRECTIONS else 0
    if direction or label == "ALL":
        constraints.held.append((node, direction or 1, direction or 6))
