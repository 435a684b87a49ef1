"""How far the two sides of a contact stand apart before a static step of CalculiX begins.

Displacements alone do not say how far a pair is open in the end where its sides stand off, or overlap, in the mesh: a
joint with clearance, a shrink fit. The step's deck may change that (G. Dhondt, CalculiX CrunchiX User's Manual,
*CONTACT PAIR and *CLEARANCE): with ADJUST nodes that are no farther off begin on the other side, whereof the results
hold no displacement, or those of a node set however far they are, and *CLEARANCE puts its VALUE in place of the mesh's
distance.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Optional, TypeVar

import numpy as np

from ..arrays import Array, IntArray
from ..texts import number_in
from .keywords import Lines, blocks, number
from .nodes import Nodes, read_nodes
from .surfaces import side_of

#: Names of a contact's dependent and independent surface, capital letters.
Sides = tuple[str, str]
Known = TypeVar("Known")


@dataclass(frozen=True)
class StandOff:
    """What a deck says of the distance of two sides.

    Attributes
    ----------
    adjusted : what is as far apart begins at zero [length]
    node_set : deck, set and dependent surface, whose nodes in both begin at zero however far they are
    value : in place of the mesh's distance [length]
    of_nodes : the dependent surface is one of nodes (``*SURFACE, TYPE=NODE``)
    at_nodes : the contact is from node to surface
    """

    adjusted: float = -np.inf
    value: Optional[float] = None
    of_nodes: bool = False
    at_nodes: bool = False
    node_set: Optional[tuple[Path, str, str]] = None

    def of(self, clearance: Array, nodes: IntArray) -> Array:
        """The distances (n,) with which the step begins, from those of the mesh [length]; nodes (n, 2) of the pairs.

        Raises
        ------
        InputError
            There is no such node set, or the deck's nodes cannot be read.
        """
        if self.value is not None:
            return np.full(len(clearance), self.value)
        moved = (clearance <= self.adjusted) | np.isin(nodes, self._of_set()).any(axis=1)
        return np.where(moved, 0.0, clearance)

    def _of_set(self) -> list[int]:
        """Read for the contact that is asked for alone: others of the deck need not be readable."""
        if self.node_set is None:
            return []
        deck, node_set, dependent = self.node_set
        return _in_both(read_nodes(deck), node_set, dependent)


def read_stand_off(deck: Path) -> dict[Sides, StandOff]:
    """Of every contact pair in a deck; empty without one."""
    pairs: dict[Sides, Mapping[str, str]] = {}
    values: dict[Sides, float] = {}
    nodal = set[str]()
    for keyword, options, data in blocks(deck) if deck.is_file() else ():
        if keyword == "CONTACT PAIR":
            pairs.update(dict.fromkeys(_sides(data), options))
        elif keyword == "CLEARANCE":
            with suppress(ValueError):  # ccx would not have run with it
                sides = options.get("SLAVE", "").upper(), options.get("MASTER", "").upper()
                values[sides] = number_in(options["VALUE"])
        elif keyword == "SURFACE" and options.get("TYPE", "").upper() == "NODE":
            nodal.add(options.get("NAME", "").upper())
    return {
        sides: _stand_off(deck, sides[0], options, values.get(sides), sides[0] in nodal)
        for sides, options in pairs.items()
    }


def _stand_off(
    deck: Path, dependent: str, options: Mapping[str, str], value: Optional[float], of_nodes: bool
) -> StandOff:
    at_nodes, adjust = options.get("TYPE", "").upper().startswith("NODE"), options.get("ADJUST", "")
    try:
        return StandOff(number(adjust) if adjust else -np.inf, value, of_nodes, at_nodes)
    except ValueError:
        return StandOff(-np.inf, value, of_nodes, at_nodes, (deck, adjust, dependent))


def _in_both(mesh: Nodes, node_set: str, surface: str) -> list[int]:
    """Nodes of a set that lie on a surface: those beyond are not moved."""
    found: list[int] = np.intersect1d(mesh.node_set(node_set), side_of(mesh, surface).numbers).tolist()
    return found


def of_sides(known: Mapping[Sides, StandOff], sides: Sequence[str]) -> StandOff:
    """Of the contact between two sides, or where the deck has but one of that; else as the mesh has it."""
    found = between(known, sides, True)
    return StandOff() if found is None else found


def between(known: Mapping[Sides, Known], sides: Sequence[str], alone: bool) -> Optional[Known]:
    """What is known of the contact between two sides, or, if they are `alone`, of the only one."""
    found = next((one for pair, one in known.items() if set(pair) == set(sides)), None)
    only = next(iter(known.values())) if alone and len(known) == 1 else None
    return only if found is None else found


def _sides(data: Lines) -> list[Sides]:
    """Of the lines of a ``*CONTACT PAIR``: dependent, independent surface."""
    found = [[word.strip().upper() for word in text.split(",")] for _, text in data]
    return [(words[0], words[1]) for words in found if len(words) > 1]
