"""A builder for tests: a cantilever along x in mm, t, s of two halves, whose materials and further stiffness vary."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import eigsh

from fretwave import Pairs, Structure, fe

LENGTH, WIDTH, HEIGHT, CELLS = 100.0, 10.0, 4.0, (10, 2, 2)


def half(order: int, first: bool) -> fe.Mesh:
    """Of the beam, or the other one."""
    begin = 0.0 if first else 0.5
    cells = (CELLS[0] // 2, *CELLS[1:])

    def place(u: np.ndarray) -> np.ndarray:
        x, y, z = ((u * [0.5, 1, 1] + [begin, -0.5, -0.5]) * [LENGTH, WIDTH, HEIGHT]).T
        return np.column_stack([x, y + 0.002 * x**2, z + 0.002 * x * y])  # curved and twisted

    return fe.join([fe.Block("half", cells, place)], order)


def lower(x: np.ndarray) -> np.ndarray:
    """Height of the lower face at these places."""
    return 0.002 * x[:, 0] * (x[:, 1] - 0.002 * x[:, 0] ** 2) - HEIGHT / 2


def on_bed(nodes: np.ndarray, count: int) -> sp.csr_matrix:
    T = sp.csr_matrix((np.ones(len(nodes)), (np.arange(len(nodes)), nodes)), shape=(len(nodes), count))
    return T.T @ (np.eye(len(nodes)) + 1.0) @ T


def build(
    order: int = 2,
    moduli: tuple[float, float] = (210e3, 210e3),
    ratios: tuple[float, float] = (0.3, 0.3),
    retainer: float = 0.0,
    strut: float = 0.0,
    mount: float = 0.0,
    bed: float = 0.0,
    known: int = 20,
    spin: float = 0.0,
    modes: int = 0,
) -> Structure:
    """Held at x = 0; `tip` is the middle of the end along z.

    Parameters
    ----------
    retainer : stiffness across two nodes of the end that are not of one cell [N/mm]
    strut : the same across two nodes of one cell [N/mm]
    mount : stiffness of springs that hold all nodes of the end along z [N/mm]
    bed : stiffness of what every cell of the lower face lies on, of its nodes alone and together [N/mm]
    known : cells of the second half that the mesh keeps
    modes : with which the builder itself reduces the model; 0 for none
    spin : share of K that 3000 rev/min add, as a part "spin"
    """
    parts = [half(order, first) for first in (True, False)]
    nodes = np.concatenate([part.nodes for part in parts])
    places, number = np.unique(np.round(nodes, 9), axis=0, return_inverse=True)
    K = sp.csr_matrix((3 * len(places),) * 2)
    M, cells, count = K.copy(), [], 0
    for part, E, nu in zip(parts, moduli, ratios):
        own = number.ravel()[count : count + len(part.nodes)]
        dofs = (3 * own[:, None] + np.arange(3)).ravel()
        T = sp.csr_matrix((np.ones(len(dofs)), (np.arange(len(dofs)), dofs)), shape=(len(dofs), K.shape[0]))
        M_own, K_own = fe.assemble(part, fe.Material(E, nu, 7.85e-9))
        M, K, count = M + T.T @ M_own @ T, K + T.T @ K_own @ T, count + len(part.nodes)
        cells.append(own[part.vtk_cells])
    end = np.flatnonzero(np.isclose(places[:, 0], LENGTH))
    tip = int(end[np.argmin(np.linalg.norm(places[end, 1:] - places[end, 1:].mean(axis=0), axis=1))])
    K = K + sp.diags(np.where(np.isin(np.arange(K.shape[0]), 3 * end + 2), mount, 0.0))
    for stiffness, other in ((retainer, end[-1]), (strut, end[1])):
        columns = [3 * end[0] + 1, 3 * other + 1]
        spread = sp.csr_matrix(([1.0, -1.0], ([0, 0], columns)), shape=(1, K.shape[0]))
        K = K + stiffness * (spread.T @ spread)
    for cell in np.concatenate(cells):
        below = cell[np.isclose(places[cell, 2], lower(places[cell]))]
        K = K + sp.kron(on_bed(below, len(places)), bed * np.diag([0, 0, 1.0])) if bed and len(below) else K
    free = np.flatnonzero(np.repeat(places[:, 0] > 1e-9, 3))
    dof = np.full(K.shape[0], -1)
    dof[free] = np.arange(len(free))
    tip_dof = int(dof[3 * tip + 2])
    K = K.tocsr()[free][:, free]
    whole = Structure(
        M=M.tocsr()[free][:, free],
        K=K,
        dofs={"tip": tip_dof},
        pairs={"slider": Pairs(B=sp.csr_matrix(([1.0], ([0], [tip_dof])), shape=(1, len(free))), components=1)},
        coordinates=places,
        displacements=dof.reshape(-1, 3),
        hexahedra=np.concatenate([cells[0], cells[1][:known]]),
        node_numbers=np.arange(1, len(places) + 1),
        parts={"spin": spin * K / (100 * np.pi) ** 2} if spin else {},
        units="mm-t-s",
    )
    return by_modes(whole, modes) if modes else whole


def by_modes(whole: Structure, count: int) -> Structure:
    """On the displacement of the tip and all but the first of the lowest modes' coordinates."""
    _, shapes = eigsh(whole.K, count, whole.M, sigma=0.0)
    coordinates = np.eye(count)
    coordinates[0] = shapes[whole.dofs["tip"]]
    E = shapes @ np.linalg.inv(coordinates)
    return replace(
        whole,
        M=sp.csr_matrix(E.T @ (whole.M @ E)),
        K=sp.csr_matrix(E.T @ (whole.K @ E)),
        dofs={"tip": 0},
        pairs={"slider": Pairs(B=sp.csr_matrix(np.eye(count)[:1]), components=1)},
        expansion=sp.csr_matrix(E),
    )
