"""A builder for tests: a steel cantilever along x in mm, t, s, a slider at its tip that no test lets slip."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp

from fretwave import Pairs, Structure, fe

LENGTH, WIDTH, HEIGHT = 300.0, 4.0, 3.0
STEEL = fe.Material(210e3, 0.3, 7.85e-9)


def build(cells: int = 50, cells_known: bool = True) -> Structure:
    """Held at x = 0, whose dofs are left out; `tip` is the middle of the end along z."""
    block = fe.Block("beam", (cells, 1, 2), lambda u: (u - [0, 0.5, 0.5]) * [LENGTH, WIDTH, HEIGHT])
    lattice = fe.join([block], 2)
    M, K = fe.assemble(lattice, STEEL)
    free = np.flatnonzero(np.repeat(lattice.nodes[:, 0] > 0, 3))
    dof = np.full(3 * len(lattice.nodes), -1)
    dof[free] = np.arange(len(free))
    end = int(np.argmin(np.linalg.norm(lattice.nodes - [LENGTH, 0, 0], axis=1)))
    tip = int(dof[3 * end + 2])
    rows = sp.csr_matrix(([1.0], ([0], [tip])), shape=(1, len(free)))
    load = np.zeros(len(free))
    load[tip] = 1.0
    given: dict[str, Any] = {"hexahedra": lattice.vtk_cells} if cells_known else {}
    return Structure(
        M=M[free][:, free],
        K=K[free][:, free],
        dofs={"tip": tip},
        pairs={"slider": Pairs(B=rows, components=1)},
        loads={"weight": load},
        coordinates=lattice.nodes,
        displacements=dof.reshape(-1, 3),
        node_numbers=np.arange(1, len(lattice.nodes) + 1),
        units="mm-t-s",
        **given,
    )
