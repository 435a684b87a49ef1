"""python deck.py FILE.inp: the deck of one of 24 sectors of a shrouded titanium wheel, as a mesher would write it.

C3D20R in cylindrical blocks about z; mm, t, s. The step writes the matrices of the sector, both faces free.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

SECTORS = 24
EDGE, BLADE = 360 / SECTORS / 2, 2.4  #: angles [degrees] of the sector's faces and of the blade's sides
HEIGHTS = np.linspace(-12, 12, 5)
#: Layers from the bore outwards: radii [mm] between elements, angles between elements.
LAYERS = [
    (np.linspace(120, 150, 3), [-EDGE, -4.95, -BLADE, BLADE, 4.95, EDGE]),  # rim
    (np.linspace(150, 200, 6), [-BLADE, BLADE]),  # blade
    (np.array([200, 206]), [-EDGE, -BLADE, BLADE, EDGE]),  # shroud
    (np.linspace(206, 250, 5), [-BLADE, BLADE]),  # blade
]
#: A C3D20's corners, and the edges of its middle nodes.
CORNERS = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
EDGES = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]


def elements() -> Iterator[np.ndarray]:
    """Radius, angle and height (20, 3) of each element's nodes."""
    for radii, angles in LAYERS:
        for r in zip(radii, radii[1:]):
            for theta in zip(angles, angles[1:]):
                for z in zip(HEIGHTS, HEIGHTS[1:]):
                    corners = np.array([(r[a], theta[b], z[c]) for a, b, c in CORNERS])
                    yield np.vstack([corners, [corners[list(edge)].mean(axis=0) for edge in EDGES]])


def mesh() -> tuple[np.ndarray, list[list[int]]]:
    """Radius, angle and height (n, 3) of the nodes, and the elements' node numbers, from 1."""
    numbers: dict[tuple[float, ...], int] = {}
    cells = [[numbers.setdefault(tuple(np.round(p, 9)), len(numbers) + 1) for p in nodes] for nodes in elements()]
    return np.array(list(numbers)), cells


def sets(nodes: np.ndarray) -> dict[str, np.ndarray]:
    """Node numbers by the set's name."""
    r, theta, _ = nodes.T
    rim, shroud = r <= 150, (r >= 200) & (r <= 206)
    places = {
        "BORE": r == 120,
        "LOW": rim & (theta == -EDGE),
        "HIGH": rim & (theta == EDGE),
        "SHLOW": shroud & (theta == -EDGE),
        "SHHIGH": shroud & (theta == EDGE),
    }
    return {name: np.flatnonzero(there) + 1 for name, there in places.items()}


def cartesian(nodes: np.ndarray) -> np.ndarray:
    """x, y, z (n, 3) [mm]."""
    r, theta, z = nodes.T
    return np.column_stack([r * np.cos(np.radians(theta)), r * np.sin(np.radians(theta)), z])


def listed(numbers: Iterable[int]) -> list[str]:
    """Twelve a line."""
    words = [str(number) for number in numbers]
    return [", ".join(words[k : k + 12]) for k in range(0, len(words), 12)]


def model() -> str:
    """The deck without a step."""
    nodes, cells = mesh()
    lines = ["** One of 24 sectors of a shrouded wheel; mm, t, s", "*NODE, NSET=ALL"]
    lines += [f"{k}, {x:.12g}, {y:.12g}, {z:g}" for k, (x, y, z) in enumerate(cartesian(nodes), 1)]
    lines.append("*ELEMENT, TYPE=C3D20R, ELSET=SECTOR")
    for number, cell in enumerate(cells, 1):
        lines += [", ".join(map(str, [number, *cell[:10]])) + ",", ", ".join(map(str, cell[10:]))]
    for name, members in sets(nodes).items():
        lines += [f"*NSET, NSET={name}", *listed(members)]
    lines += ["*MATERIAL, NAME=TITANIUM", "*ELASTIC", "114000, 0.33", "*DENSITY", "4.43E-9"]
    lines += ["*SOLID SECTION, ELSET=SECTOR, MATERIAL=TITANIUM", "*BOUNDARY", "BORE, 1, 3"]
    return "\n".join(lines) + "\n"


STEP = "*STEP\n*FREQUENCY, SOLVER=MATRIXSTORAGE\n10\n*END STEP\n"

if __name__ == "__main__":
    Path(sys.argv[1]).write_text(model() + STEP, encoding="utf-8")
