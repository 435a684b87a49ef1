"""What a deck says of nodes without a row in the matrices: those it holds, and those it joins to others.

A dof that depends on others (``*EQUATION``, ``*MPC``, ``*TIE``, ...) is no row either, and it moves: in a contact it
may not be taken as held. Which dofs depend is not read: those without a row that no ``*BOUNDARY`` holds. Where the deck
has none of these keywords, but says what it holds, such dofs are taken as held, with a warning.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from ..arrays import IntArray
from ..errors import InputError
from .keywords import Lines

#: Keywords that make dofs depend on others.
JOINS = (
    *("EQUATION", "MPC", "TIE", "RIGID BODY", "COUPLING", "KINEMATIC COUPLING", "KINEMATIC", "DISTRIBUTING COUPLING"),
    *("PRE-TENSION SECTION", "SHELL TO SOLID COUPLING", "EMBEDDED ELEMENT"),
)


@dataclass
class Constraints:
    """Lines of ``*BOUNDARY`` (node or set in capitals, first and last direction), and the first keyword that joins.

    Attributes
    ----------
    doubts : warnings of contacts that were checked
    """

    held: list[tuple[str, int, int]] = field(default_factory=list)
    joins: str = ""
    doubts: list[str] = field(default_factory=list)

    def add(self, keyword: str, data: Lines) -> None:
        """A keyword of the deck; Abaqus' named conditions (ENCASTRE) hold all directions."""
        if keyword in JOINS:
            self.joins = self.joins or f"*{keyword}"
        for _, text in data if keyword == "BOUNDARY" else ():
            name, first, last, *_ = [word.strip().upper() for word in text.split(",")] + ["", ""]
            directions = (int(first), int(last) if last.isdigit() else int(first)) if first.isdigit() else (1, 6)
            self.held.append((name, *directions))

    def check(
        self, name: str, numbers: Iterable[int], labels: IntArray, sets: Mapping[str, IntArray], where: str
    ) -> None:
        """No node of a contact depends on others; a doubt where nothing tells why one has no row.

        Parameters
        ----------
        name : of the contact
        numbers : of its nodes
        labels : (n_dof, 2) node and direction of each dof

        Raises
        ------
        InputError
            A direction of a node is no row, and nothing holds it.
        """
        told = all(held.isdigit() or held in sets for held, _, _ in self.held)
        if not self.joins and not (self.held and told):
            return
        rows = {(node, direction) for node, direction in labels.tolist()} | self._held(sets)
        known = [axis for axis in (1, 2, 3) if self.joins or axis in labels[:, 1]]  # a plane model has no third
        loose = [(node, axis) for node in numbers for axis in known if (node, axis) not in rows]
        first = f"n{loose[0][0]}{'xyz'[loose[0][1] - 1]}, {len(loose)} such dofs" if loose else ""
        if loose and not self.joins:
            said = f"nodes have no row in the matrices, and no *BOUNDARY holds them ({first}): taken as held"
            self.doubts.append(f"contact '{name}': {said}")
        elif loose:
            measured = f"{first}; the deck has {self.joins}"
            expected = "each direction a row of the matrices, or held in the deck"
            fix = f"take {self.joins} off these nodes and export the matrices again"
            raise InputError(f"nodes of contact '{name}' depend on others", where, measured, expected, fix)

    def _held(self, sets: Mapping[str, IntArray]) -> set[tuple[int, int]]:
        nodes = {name: [int(name)] if name.isdigit() else sets.get(name, ()) for name, _, _ in self.held}
        return {(int(n), d) for name, first, last in self.held for n in nodes[name] for d in range(first, last + 1)}
