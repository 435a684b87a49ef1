"""What a deck says of nodes without a row in the matrices: those it holds, and those it joins to others.

A dof that depends on others (``*EQUATION``, ``*MPC``, ``*TIE``, ...) is no row either, and it moves: in a contact it
may not be taken as held. Which dofs depend is not read: those without a row that no ``*BOUNDARY`` holds.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from ..arrays import IntArray
from ..errors import InputError
from .keywords import Lines

#: Keywords that make dofs depend on others.
JOINS = ("EQUATION", "MPC", "TIE", "RIGID BODY", "COUPLING", "KINEMATIC COUPLING", "KINEMATIC", "DISTRIBUTING COUPLING")


@dataclass
class Constraints:
    """Lines of ``*BOUNDARY`` (node or set in capitals, first and last direction), and the first keyword that joins."""

    held: list[tuple[str, int, int]] = field(default_factory=list)
    joins: str = ""

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
        """No node of a contact depends on others.

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
        if not self.joins:
            return
        rows = {(node, direction) for node, direction in labels.tolist()} | self._held(sets)
        loose = [(node, axis) for node in numbers for axis in (1, 2, 3) if (node, axis) not in rows]
        if loose:
            measured = f"n{loose[0][0]}{'xyz'[loose[0][1] - 1]}, {len(loose)} such dofs; the deck has {self.joins}"
            expected = "each direction a row of the matrices, or held in the deck"
            fix = f"take {self.joins} off these nodes and export the matrices again"
            raise InputError(f"nodes of contact '{name}' depend on others", where, measured, expected, fix)

    def _held(self, sets: Mapping[str, IntArray]) -> set[tuple[int, int]]:
        nodes = {name: [int(name)] if name.isdigit() else sets.get(name, ()) for name, _, _ in self.held}
        return {(int(n), d) for name, first, last in self.held for n in nodes[name] for d in range(first, last + 1)}
