"""Small meshes of every kind of solid cell, with curved edges, and their decks for CalculiX."""

from __future__ import annotations

from itertools import permutations

import numpy as np

from fretwave.fe.solids import EDGES, PLACES
from fretwave.fe.strain import Solids

CUBE = ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1))
#: Corners of the cells that a cube is cut into, in VTK's order.
CUT = {
    "hexahedron": [CUBE],
    "wedge": [tuple(CUBE[k] for k in (4, 5, 6, 0, 1, 2)), tuple(CUBE[k] for k in (4, 6, 7, 0, 2, 3))],
    "tetrahedron": [],
}
for order in permutations(np.eye(3, dtype=int)):
    path = [np.zeros(3, dtype=int), *np.cumsum(order, axis=0)]
    turned = np.linalg.det(np.array(order)) < 0
    corners = [path[k] for k in ((0, 2, 1, 3) if turned else (0, 1, 2, 3))]
    CUT["tetrahedron"].append(tuple(tuple(int(x) for x in corner) for corner in corners))


def mesh(kind: str, cells: tuple[int, int, int], mapping=lambda u: u) -> tuple[np.ndarray, Solids]:
    """Nodes and cells of a kind over a grid of cubes, mapped from their own coordinates."""
    linear = kind.replace("quadratic_", "").replace("tri", "")
    boxes = np.stack(np.meshgrid(*map(np.arange, cells), indexing="ij"), axis=-1).reshape(-1, 3)
    corners = np.concatenate([boxes[:, None] + np.array(cut) for cut in CUT[linear]]).astype(float)
    if kind == "triquadratic_hexahedron":
        shares = (PLACES[kind] + 1) / 2
        points = corners[:, :1] + shares
    else:
        middles = [(corners[:, a] + corners[:, b]) / 2 for a, b in EDGES.get(kind, ())]
        points = np.concatenate([corners, *(middle[:, None] for middle in middles)], axis=1)
    places, number = np.unique(np.rint(2 * points).reshape(-1, 3), axis=0, return_inverse=True)
    return mapping(places / 2), {kind: number.reshape(points.shape[:2])}


def bent(u: np.ndarray) -> np.ndarray:
    """A twisted, curved block without a symmetry."""
    x, y, z = u.T
    return np.column_stack([2.0 * x + 0.1 * y * z, 1.5 * y + 0.08 * x**2, z + 0.1 * x + 0.05 * x * y])


def deck(element: str, nodes: np.ndarray, solids: Solids, step: str) -> str:
    """Held at x = 0 of the own coordinates (the nodes of set HELD), with a step."""
    ((kind, cells),) = solids.items()
    to_deck = {6: [3, 4, 5, 0, 1, 2], 15: [3, 4, 5, 0, 1, 2, 9, 10, 11, 6, 7, 8, 12, 13, 14]}.get(cells.shape[1])
    table = cells if to_deck is None else cells[:, to_deck]
    held = [k + 1 for k, x in enumerate(nodes) if x[0] < 0.1 * (x[1] * x[2]) / 1.5 + 0.05]
    rows = [f"{k}, {x:.15g}, {y:.15g}, {z:.15g}" for k, (x, y, z) in enumerate(nodes, 1)]
    text = ["*NODE, NSET=ALL", *rows, f"*ELEMENT, TYPE={element}, ELSET=BODY"]
    for k, row in enumerate(table + 1, 1):
        words = [str(k), *map(str, row)]
        text += [", ".join(words[:11]) + ("," if len(words) > 11 else "")]
        text += [", ".join(words[11:])] if len(words) > 11 else []
    text += ["*NSET, NSET=HELD", *(str(k) for k in held), "*MATERIAL, NAME=STEEL", "*ELASTIC", "210000., 0.3"]
    text += ["*DENSITY", "7.85e-9", "*SOLID SECTION, ELSET=BODY, MATERIAL=STEEL", "*BOUNDARY", "HELD, 1, 3"]
    return "\n".join([*text, "*STEP", step, "*END STEP", ""])
