"""Contact at the end of a static step of CalculiX, brought to the contact pairs of a model.

``*CONTACT FILE`` with CDIS, CSTR writes the block CONTACT of a .frd file: at the nodes of the dependent (slave) side
COPEN [length] (> 0 open), CSLIP1, CSLIP2 [length], CPRESS, CSHEAR1, CSHEAR2 [pressure]. A pair's forces are its area
times those. Of contact from node to surface they are the nodes' own, with areas of their own (`spring_areas`); nodes
that are far open may be left out: the block DISP tells their gaps, with the distance in the mesh (`stand_off`). Of that
from surface to surface they are extrapolated from inside of the faces, and to nodes that DISP shows apart as well,
which are open; ``*CONTACT PRINT, SLAVE=.., MASTER=..`` with CF then writes the exact force of the whole contact into
the .dat file beside, to which the pairs' forces are scaled. Which it is the step's deck tells when it stands beside;
without it a node that is listed as open, which only contact from node to surface does. A .dat file alone will do where
``*CONTACT PRINT`` with CDIS, CSTR wrote the slave nodes into it (node to surface). The last step of a file counts.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from ..arrays import Array, IntArray
from ..errors import InputError
from ..model.law_info import Role
from ..model.laws import usual_name
from ..model.pairs import Pairs
from ..model.sectors import by_sector
from ..texts import counted, display, shortened
from .calculix import beside
from .stand_off import Sides, StandOff, between, of_sides, read_stand_off

#: Components of the two blocks, 12 characters each behind the node's number.
BLOCKS, WIDTH = {"CONTACT": 6, "DISP": 3}, 12
OPENING, PRESSURE, SHEAR = 0, 3, slice(4, 6)
#: Forces of pairs are not scaled by more than this: another contact would be meant. Nor is more of them taken as open.
MOST_SCALED = 0.1
_STATISTICS = re.compile(
    r"statistics for slave set (\S+), master set (\S+) and time.*?normal force[^\n]*\n\s*(\S+)\s+(\S+)\s+\S+", re.DOTALL
)

_SLAVE_NODES = re.compile(
    r"(relative contact displacement|contact stress) \(slave node[^\n]*\n\s*\n((?: +\d+(?: +-?\d\.\d+E[+-]\d+){3}\n)+)"
)


@dataclass(frozen=True)
class Nodal:
    """Values (n, m) at nodes (n,), ascending."""

    numbers: IntArray
    values: Array

    def at(self, nodes: IntArray) -> Array:
        """Values (n_nodes, m), nan at nodes that have none."""
        place = np.clip(np.searchsorted(self.numbers, nodes), 0, len(self.numbers) - 1)
        return np.where((self.numbers[place] == nodes)[:, None], self.values[place], np.nan)


@dataclass(frozen=True)
class StaticStep:
    """What is read of a static step.

    Attributes
    ----------
    contact : (n, 6) values in the order of the block CONTACT
    displacement : (n, 3), or None
    forces : compressive normal force [force] of a contact by its dependent and independent surface, capital letters
    where : the file
    at_nodes : the contact is the nodes' own (node to surface), not extrapolated to them
    stand_off : what the deck says of the distance with which the step begins
    """

    contact: Nodal
    displacement: Nodal | None
    forces: Mapping[tuple[str, str], float]
    where: str
    at_nodes: bool
    stand_off: Mapping[Sides, StandOff]

    def force(self, sides: Sequence[str], alone: bool) -> float | None:
        """Of the contact between two sides, or where there is but one in model and file (`alone`) of that."""
        return between(self.forces, surfaces(sides), alone)

    def begins_at(self, pairs: Pairs, sides: Sequence[str]) -> Array:
        """How far the sides of each pair are apart as the step begins (n_pairs,) [length], below zero they overlap."""
        mesh = np.zeros(pairs.n_pairs) if pairs.clearance is None else np.asarray(pairs.clearance)
        return self._told(sides).of(mesh, np.asarray(pairs.nodes))

    def springs_of_nodes(self, sides: Sequence[str]) -> bool:
        """The pressures are those of springs at nodes that the deck names without faces."""
        return self.at_nodes and self._told(sides).of_nodes

    def _told(self, sides: Sequence[str]) -> StandOff:
        return of_sides(self.stand_off, surfaces(sides))


def surfaces(sides: Sequence[str]) -> tuple[str, ...]:
    """Names of the sides of a contact as a deck has them."""
    return tuple(side.partition("@")[0].upper() for side in sides)


def read_step(path: Path) -> StaticStep:
    """Contact, displacements and forces of a .frd file and the .dat file beside it.

    Raises
    ------
    InputError
        There is no contact, or a line of it is no line of values.
    """
    printed = beside(path, ".dat")
    text = printed.read_text(encoding="utf-8", errors="replace") if printed.is_file() else ""
    found = _blocks(path) if path != printed else _printed(text)
    if "CONTACT" not in found:
        fix = "add `*CONTACT FILE` with a line `CDIS, CSTR` to the static step, run ccx again and give its .frd file"
        expected = "a block CONTACT of a .frd file written as text, or slave nodes in a .dat file"
        raise InputError("there is no contact in the results", display(path), "none", expected, fix)
    forces = {(one[1].upper(), one[2].upper()): -float(one[4]) for one in _STATISTICS.finditer(text)}
    stand_off = read_stand_off(beside(path, ".inp"))
    at_nodes = path == printed or (not forces and _at_nodes(stand_off, found["CONTACT"].values))
    return StaticStep(found["CONTACT"], found.get("DISP"), forces, display(path), at_nodes, stand_off)


def _at_nodes(deck: Mapping[Sides, StandOff], contact: Array) -> bool:
    """By the deck beside where all of its contact is of one kind, else by a node that is listed as open."""
    kinds = {pair.at_nodes for pair in deck.values()}
    listed = bool(((contact[:, OPENING] > 0) & (contact[:, PRESSURE] <= 0)).any())
    return kinds.pop() if len(kinds) == 1 else listed


def _blocks(path: Path) -> dict[str, Nodal]:
    """The last block of each name.

    Raises
    ------
    InputError
        A line of them is no line of values, or the file has no end.
    """
    found: dict[str, list[tuple[int, list[float]]]] = {}
    name = end = ""
    with path.open(encoding="utf-8", errors="replace") as file:
        for number, line in enumerate(file, 1):
            end = line if line.strip() else end
            if line.startswith(" -4"):
                name = (line[3:].split() or [""])[0]
                found[name] = []
            elif line.startswith(" -3"):
                name = ""
            elif name in BLOCKS and line.startswith(" -1"):
                found[name].append(_values(line, BLOCKS[name], f"{display(path)}:{number}"))
    if not end.startswith(" 9999"):
        measured = f"it ends within the block {name}" if name else f"its last line is `{shortened(end.strip(), 40)}`"
        fix = "run the step to its end, or copy the whole file"
        raise InputError("the file of results is cut", display(path), measured, "a last line ` 9999`", fix)
    rows = {name: sorted(found[name]) for name in BLOCKS if found.get(name)}
    return {name: Nodal(np.array([n for n, _ in r]), np.array([v for _, v in r])) for name, r in rows.items()}


def _printed(text: str) -> dict[str, Nodal]:
    """The last tables of slave nodes in a .dat file, as the block CONTACT."""
    tables = {}
    for name, rows in _SLAVE_NODES.findall(text):
        lines = [row.split() for row in rows.splitlines()]
        tables[name] = {int(row[0]): [float(value) for value in row[1:]] for row in lines}
    opening, stress = (tables.get(name, {}) for name in ("relative contact displacement", "contact stress"))
    numbers = sorted(opening.keys() & stress.keys())
    if not numbers:
        return {}
    return {"CONTACT": Nodal(np.array(numbers), np.array([opening[n] + stress[n] for n in numbers]))}


def _values(line: str, count: int, where: str) -> tuple[int, list[float]]:
    try:
        return int(line[3:13]), [float(line[13 + WIDTH * k : 13 + WIDTH * (k + 1)]) for k in range(count)]
    except ValueError:
        fix = "is the file complete, and written as text?"
        raise InputError("a line of results is wrong", where, line.strip(), f"a node and {count} values", fix) from None


@dataclass(frozen=True)
class PairsAtRest:
    """Contact pairs at rest.

    Attributes
    ----------
    normal, shear : (n_pairs,) [force]
        Compressive normal force, and magnitude of that along the face.
    gap : (n_pairs,) [length]
        Of open pairs, 0 of closed ones.
    scaled : float
        By which the forces were multiplied to be in all what the file says.
    opened : str
        What is said of pairs with a pressure that were taken as open.
    """

    normal: Array
    shear: Array
    gap: Array
    scaled: float = 1.0
    opened: str = ""

    def said(self, name: str, pairs: Pairs) -> str:
        """What came of it, for the report of an import."""
        closed = self.normal > 0
        text = f"contact '{name}' at rest: {closed.sum()} of {counted(len(closed), 'pair')} pressed, "
        text += f"{self.normal[closed].min():.5g} to {self.normal.max():.5g}, in all {self.normal.sum():.7g}"
        text += f" (scaled by {self.scaled:.5f} to the force printed)" if self.scaled != 1.0 else ""
        text += f"; along the face up to {(self.shear[closed] / self.normal[closed]).max():.3g} of it"
        if pairs.frames is not None:
            total = np.einsum("k,kx->x", self.normal, np.asarray(pairs.frames)[:, 0])
            text += f"; the first side presses with ({', '.join(f'{value:.6g}' for value in total)})"
        return text + self.opened

    def columns(self, pairs: Pairs) -> dict[str, Array | IntArray]:
        """Of a table that a case takes its loads and gaps from."""
        nodes = {} if pairs.nodes is None else {"node_a": pairs.nodes[:, 0], "node_b": pairs.nodes[:, 1]}
        numbers = np.arange(len(self.normal))
        loads = {usual_name(Role.LOAD): self.normal, usual_name(Role.GAP): self.gap}
        return {"pair": numbers, **nodes, **loads, "tangential_force": self.shear}


def at_rest(
    name: str,
    pairs: Pairs,
    step: StaticStep,
    labels: IntArray,
    sides: Sequence[str] = (),
    alone: bool = True,
    springs: Sequence[Nodal] = (),
) -> PairsAtRest:
    """Forces and gaps of the pairs, from the side that has results.

    Parameters
    ----------
    labels : (n_dof, 2) node and direction of each dof
    sides : names of both sides, as the model was given them
    alone : the model has no other contact
    springs : areas (n, 1) of the nodes of each side by which ccx makes forces from node to surface, where known

    Raises
    ------
    InputError
        No pair is pressed, areas or gaps are not known, the forces are far from what the file says in all, or too much
        of them is of pairs that are apart.
    """
    where = f"{step.where}, contact '{name}'"
    if pairs.nodes is None or pairs.areas is None:
        fix = "give sets on faces of the mesh to --pairs, or a CSV with areas"
        raise InputError("forces need the areas of the pairs", where, None, "areas and nodes of the pairs", fix)
    found = [step.contact.at(np.asarray(side)) for side in np.transpose(pairs.nodes)]
    told = int(np.argmax([np.count_nonzero(side[:, PRESSURE] > 0) for side in found]))
    printed, opened = step.force(sides, alone), ""
    _check_side(pairs, told, springs, step, alone, sides, where)
    values, areas = found[told], _areas(pairs, told, springs if step.at_nodes else ())
    pressed = values[:, PRESSURE] > 0
    if not pressed.any():
        known = int(np.count_nonzero(~np.isnan([side[:, PRESSURE] for side in found]).all(axis=0)))
        measured = f"results at the nodes of {known} of {counted(len(areas), 'pair')}, none with a pressure"
        fix = "check the sets of --pairs, and that the step presses them together"
        raise InputError("no pair of the contact is pressed", where, measured, "a pressure above 0 at some node", fix)
    apart = step.begins_at(pairs, sides) + _apart(pairs, step, labels)
    if not step.at_nodes:
        open_ = pressed & (apart > 0)  # a pressure there is extrapolated from beside
        opened = _opened(open_, np.where(pressed, areas * values[:, PRESSURE], 0.0), printed, where)
        pressed &= ~open_
    normal = np.where(pressed, areas * np.nan_to_num(values[:, PRESSURE]), 0.0)
    shear = np.where(pressed, areas * np.hypot(*np.nan_to_num(values[:, SHEAR]).T), 0.0)
    scale = _scale(normal.sum(), printed, where)
    first, other = (values[:, OPENING], apart) if step.at_nodes else (apart, values[:, OPENING])
    gap = np.where(pressed, 0.0, _gaps(np.where(np.isnan(first), other, first), where, ~pressed))
    return PairsAtRest(scale * normal, scale * shear, gap, scale, opened)


def _check_side(
    pairs: Pairs, told: int, springs: Sequence[Nodal], step: StaticStep, alone: bool, sides: Sequence[str], where: str
) -> None:
    """Pressures of the second side are those of the pairs node by node, or the whole force is known.

    Raises
    ------
    InputError
        The meshes of both sides do not match: the nearest nodes' pressures do not make the load. Or the dependent side
        is named node by node: ccx then takes areas of all outer faces at each node, those around the corner too, and
        of quadratic elements others still, by which the pressures are too low.
    """
    if step.springs_of_nodes(sides):
        fix = "give *SURFACE, TYPE=ELEMENT with the faces to the dependent side, and run ccx again"
        what, expected = "the dependent side is a surface of nodes", "faces, whose areas make forces of pressures"
        raise InputError(what, where, "*SURFACE, TYPE=NODE in the step's deck", expected, fix)
    if told == 0 or step.force(sides, alone) is not None or len(springs) < 2 or len(sides) < 2:
        return
    partners, known = np.asarray(pairs.nodes)[:, 1], springs[1].numbers
    if len(known) and sorted(partners.tolist()) != known.tolist():
        measured = f"{counted(len(np.unique(partners)), 'node')} of {len(known)} of {sides[1]} beside a pair"
        fix = f"write {sides[1]} {sides[0]}: the dependent side of *CONTACT PAIR first"
        what, expected = "the pressures are at nodes of the second side", "one pair at each of them, where it tells"
        raise InputError(what, where, measured, expected, fix)


def _areas(pairs: Pairs, told: int, springs: Sequence[Nodal]) -> Array:
    """What the pressures of one side, first or second, are to be multiplied by (n_pairs,) [length^2]."""
    own, nodes = np.asarray(pairs.areas), np.asarray(pairs.nodes)[:, told]
    if len(springs) <= told or not len(springs[told].numbers) or len(np.unique(nodes)) < len(nodes):
        return own
    known = springs[told].at(nodes)[:, 0]
    return np.where(np.isnan(known), own, known)


def _opened(open_: npt.NDArray[np.bool_], forces: Array, printed: float | None, where: str) -> str:
    """What is said of pairs that are pressed by their pressures and apart by their displacements.

    Raises
    ------
    InputError
        They are all that press, or have too much of the force, and the contact's whole force is not known.
    """
    if not open_.any():
        return ""
    lost = float(forces[open_].sum())
    said = f"{counted(int(open_.sum()), 'pair')} with {lost:.6g} of {forces.sum():.6g} apart by the displacements"
    if open_[forces > 0].all() or (printed is None and lost > MOST_SCALED * forces.sum()):
        expected = f"at most {MOST_SCALED:.0%}, as pressures from surface to surface are extrapolated"
        fix = "put the step's deck beside (node to surface), or add `*CONTACT PRINT, SLAVE=.., MASTER=..` with CF to it"
        raise InputError("pressed pairs are apart", where, said, expected, fix)
    return f"; {said}: taken as open"


def _scale(total: float, printed: float | None, where: str) -> float:
    """What makes the sum of the pairs' forces the one that is printed."""
    if printed is None:
        return 1.0
    if abs(printed / total - 1) > MOST_SCALED:
        measured, expected = f"{total:.6g} in all by the nodes' pressures", f"{printed:.6g} of CF in the .dat file"
        fix = "name in --pairs the surfaces of *CONTACT PAIR, and all of their nodes"
        raise InputError("the forces of the pairs are not those of the contact", where, measured, expected, fix)
    return float(printed / total)


def _apart(pairs: Pairs, step: StaticStep, labels: IntArray) -> Array:
    """How far the sides of each pair moved apart along the normal, nan where it is not known; held dofs do not move."""
    if step.displacement is None:
        return np.full(pairs.n_pairs, np.nan)
    u, moved = step.displacement.at(labels[:, 0]), labels[:, 1] <= 3
    x = np.where(moved, u[np.arange(len(u)), np.where(moved, labels[:, 1], 1) - 1], 0.0)
    rows = sum(sp.csr_matrix(B) @ np.nan_to_num(x) for B in by_sector(pairs.B).values())
    return np.asarray(-rows[:: pairs.components])


def _gaps(found: Array, where: str, wanted: npt.NDArray[np.bool_]) -> Array:
    """Of the open pairs, which are not below zero."""
    gap = np.maximum(found, 0.0)
    lacking = int(np.count_nonzero(wanted & ~(gap >= 0)))
    if lacking:
        measured, expected = f"{lacking} open pairs without one", "displacements, or COPEN at every node"
        fix = "add `*NODE FILE` with a line `U` to the step"
        raise InputError("gaps are not known", where, measured, expected, fix)
    return gap
