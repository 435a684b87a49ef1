"""Two bars end to end that nothing joins: matrices, and nodes with sets in an NPZ, or with their elements in a deck."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import scipy.sparse as sp
from models import hexahedra
from models.matrix_files import write_npz


class Two:
    """The first one's end (set LEFT) and the second one's begin (RIGHT) coincide at x = 0.04 m."""

    def __init__(self) -> None:
        self.first = hexahedra.bar((2, 2, 1), (0.04, 0.02, 0.01))
        self.whole = hexahedra.bar((4, 2, 1), (0.08, 0.02, 0.01))
        self.nodes = np.vstack([self.first.nodes, self.first.nodes + [0.04, 0, 0]])
        self.ends = np.flatnonzero(np.isclose(self.nodes[:, 0], 0.04)) + 1
        self.M, self.K = (sp.block_diag([A, A], format="csr") for A in (self.first.M, self.first.K))

    @property
    def sets(self) -> dict[str, np.ndarray]:
        mine = self.ends <= len(self.first.nodes)
        return {"LEFT": self.ends[mine], "RIGHT": np.flip(self.ends[~mine])}

    @property
    def cells(self) -> list[list[int]]:
        """Node numbers of each C3D8."""
        number = np.arange(1, len(self.nodes) + 1).reshape(2, 3, 3, 2)
        square = ((0, 0), (1, 0), (1, 1), (0, 1))
        boxes = [(bar, i, j) for bar in (0, 1) for i in (0, 1) for j in (0, 1)]
        return [[number[bar, i + a, j + b, k] for k in (0, 1) for a, b in square] for bar, i, j in boxes]

    def write(self, folder: Path, deck: bool = False) -> list[str]:
        """The command without pairs."""
        parts = [write_npz(folder, A, letter, np.zeros(0)) for letter, A in (("M", self.M), ("K", self.K))]
        np.savez(folder / "n.npz", coordinates=self.nodes, **self.sets)
        (folder / "n.inp").write_text(self.deck())
        coordinates = ["--coordinates", str(folder / ("n.inp" if deck else "n.npz"))]
        return ["import", str(folder / "m.h5"), "--mass", parts[0], "--stiffness", parts[1], *coordinates]

    def deck(self) -> str:
        """Nodes, C3D8 elements and node sets."""
        text = "*NODE\n" + "".join(f"{k}, {', '.join(map(repr, x))}\n" for k, x in enumerate(self.nodes.tolist(), 1))
        rows = "".join(f"{e}, {', '.join(map(str, cell))}\n" for e, cell in enumerate(self.cells, 1))
        named = [f"*NSET, NSET={name}\n" + "".join(f"{n}\n" for n in own) for name, own in self.sets.items()]
        return f"{text}*ELEMENT, TYPE=C3D8\n{rows}{''.join(named)}"
