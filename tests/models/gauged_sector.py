"""A builder for tests: the meshed sector of `meshed_wheel`, a slider along the axis between shrouds."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from models.meshed_wheel import SECTORS, Wheel

from fretwave import Pairs, Structure


def build() -> Structure:
    """Held at the bore; `tip` is a shroud node along z, its slider reaches the next sector."""
    wheel = Wheel()
    nodes, free = wheel.sector.nodes, (3 * wheel.free[:, None] + np.arange(3)).ravel()
    dof = np.full(3 * len(nodes), -1)
    dof[free] = np.arange(len(free))

    def row(node: int, sign: float) -> sp.csr_matrix:
        return sp.csr_matrix(([sign], ([0], [dof[3 * node + 2]])), shape=(1, len(free)))

    def face(side: str) -> np.ndarray:
        nodes_of_face = wheel.face("rim", side)
        return dof.reshape(-1, 3)[nodes_of_face[np.isin(nodes_of_face, wheel.free)]].ravel()

    M, K = (A.tocsr()[free][:, free] for A in wheel.matrices)
    radial = 1e6 * wheel.matrices[0] @ (nodes * [1.0, 1.0, 0.0]).ravel()  # at 1000 rad/s
    ahead, behind = int(wheel.face("shroud", "high")[0]), int(wheel.face("shroud", "low")[0])
    return Structure(
        M=M,
        K=K,
        dofs={"tip": int(dof[3 * ahead + 2])},
        pairs={"shroud": Pairs(B={0: row(ahead, 1.0), 1: row(behind, -1.0)}, components=1)},
        coordinates=nodes,
        displacements=dof.reshape(-1, 3),
        hexahedra=wheel.sector.vtk_cells,
        sectors=SECTORS,
        low=face("low"),
        high=face("high"),
        axis="z",
        parts={"all": K},
        loads={"spin": radial[free]},
    )
