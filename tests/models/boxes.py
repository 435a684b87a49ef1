"""Decks of boxes of any kind of element, their inner nodes displaced."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fretwave.fe.solids import EDGES
from fretwave.importers.nodes import Nodes

#: Corners of the elements that a unit box is cut into, by kind of element, on its corners in the order of C3D8.
CUTS = {
    "C3D8": [(0, 1, 2, 3, 4, 5, 6, 7)],
    "C3D6": [(0, 1, 2, 4, 5, 6), (0, 2, 3, 4, 6, 7)],
    "C3D4": [(0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)],
}
QUADRATIC = {"C3D8": ("C3D20", "quadratic_hexahedron"), "C3D6": ("C3D15", "quadratic_wedge")}
QUADRATIC["C3D4"] = ("C3D10", "quadratic_tetrahedron")
KINDS = [*CUTS, "C3D20", "C3D15", "C3D10"]


@dataclass
class Box:
    """A box of nx x ny x nz cells between two corners, cut into elements of one kind, with distorted inner nodes."""

    kind: str
    cells: tuple[int, int, int]
    low: tuple[float, float, float]
    high: tuple[float, float, float]

    def lines(self, first: int, elements: str) -> tuple[str, np.ndarray]:
        """``*NODE`` and ``*ELEMENT`` with numbers from first on, and the coordinates."""
        n = self.cells
        axes = [np.linspace(a, b, k + 1) for a, b, k in zip(self.low, self.high, n)]
        x = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
        size = np.subtract(self.high, self.low) / n
        rng = np.random.default_rng(first)
        x[1:-1, :, :, 0] += 0.2 * size[0] * rng.uniform(-1, 1, x[1:-1, :, :, 0].shape)
        x[:, 1:-1, :, 1] += 0.2 * size[1] * rng.uniform(-1, 1, x[:, 1:-1, :, 1].shape)
        number = np.arange(x[..., 0].size).reshape(x.shape[:3])
        points = list(x.reshape(-1, 3))
        corners = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
        linear = next((own for own, (name, _) in QUADRATIC.items() if name == self.kind), self.kind)
        table = [
            [int(number[i + corners[c][0], j + corners[c][1], k + corners[c][2]]) for c in cut]
            for i in range(n[0])
            for j in range(n[1])
            for k in range(n[2])
            for cut in CUTS[linear]
        ]
        middle: dict[frozenset[int], int] = {}
        for row in table if linear != self.kind else []:
            for a, b in [(row[i], row[j]) for i, j in EDGES[QUADRATIC[linear][1]]]:
                if frozenset((a, b)) not in middle:
                    middle[frozenset((a, b))] = len(points)
                    points.append((points[a] + points[b]) / 2)
                row.append(middle[frozenset((a, b))])
        text = "*NODE\n" + "".join(f"{first + k}, {', '.join(map(repr, p.tolist()))}\n" for k, p in enumerate(points))
        text += f"*ELEMENT, TYPE={self.kind}, ELSET={elements}\n"
        for k, row in enumerate(table):
            numbers = [", ".join(str(first + n) for n in part) for part in (row[:10], row[10:]) if part]
            text += f"{first + k}, " + ",\n".join(numbers) + "\n"
        return text, np.array(points)


def node_set(name: str, first: int, chosen: np.ndarray) -> str:
    return f"*NSET, NSET={name}\n" + "".join(f"{first + k}\n" for k in np.flatnonzero(chosen))


def labels_of(nodes: Nodes) -> np.ndarray:
    """x, y, z of each node (n_dof, 2)."""
    return np.column_stack([np.repeat(nodes.numbers, 3), np.tile([1, 2, 3], len(nodes.numbers))])
