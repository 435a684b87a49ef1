"""A bar of equal 8-node hexahedra, assembled with NumPy alone: a three-dimensional model for tests and measurements."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

YOUNG, POISSON, DENSITY = 114e9, 0.32, 4430.0  # titanium [Pa, -, kg/m^3]


@dataclass(frozen=True)
class Bar:
    """Matrices [kg, N/m], node coordinates (n_nodes, 3) [m]; dof 3 * node + direction, nodes layer by layer along x."""

    M: sp.csr_matrix
    K: sp.csr_matrix
    nodes: np.ndarray

    def layer(self, x: float) -> np.ndarray:
        """Dofs of the nodes at x."""
        where = np.flatnonzero(np.isclose(self.nodes[:, 0], x))
        return (3 * where[:, None] + np.arange(3)).ravel()

    def rigid_motions(self) -> np.ndarray:
        """Three translations and three small rotations (n_dof, 6)."""
        motions = np.zeros((len(self.nodes), 3, 6))
        for axis in range(3):
            motions[:, axis, axis] = 1.0
            motions[:, :, 3 + axis] = np.cross(np.eye(3)[axis], self.nodes)
        return motions.reshape(-1, 6)


def bar(cells: tuple[int, int, int], size: tuple[float, float, float]) -> Bar:
    """Free bar of nx x ny x nz elements and the given size [m]."""
    nx, ny, nz = cells
    number = np.arange((nx + 1) * (ny + 1) * (nz + 1)).reshape(nx + 1, ny + 1, nz + 1)
    axes = [np.linspace(0.0, length, n + 1) for n, length in zip(cells, size)]
    nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    corners = [(i, j, k) for i in (0, 1) for j in (0, 1) for k in (0, 1)]
    cell_nodes = np.stack([number[i : nx + i, j : ny + j, k : nz + k].ravel() for i, j, k in corners], axis=1)
    dofs = (3 * cell_nodes[:, :, None] + np.arange(3)).reshape(len(cell_nodes), 24)
    M, K = element(np.array(size) / cells)
    return Bar(assemble(M, dofs, 3 * len(nodes)), assemble(K, dofs, 3 * len(nodes)), nodes)


def assemble(element_matrix: np.ndarray, dofs: np.ndarray, n: int) -> sp.csr_matrix:
    rows = np.repeat(dofs, 24, axis=1).ravel()
    columns = np.tile(dofs, (1, 24)).ravel()
    return sp.csr_matrix((np.tile(element_matrix.ravel(), len(dofs)), (rows, columns)), shape=(n, n))


def element(edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mass and stiffness (24, 24) of a box, 2 x 2 x 2 Gauss points."""
    signs = np.array([(i, j, k) for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)], dtype=float)
    D, volume = elasticity(), np.prod(edges)
    M, K = np.zeros((24, 24)), np.zeros((24, 24))
    for point in signs / np.sqrt(3.0):
        factors = 1 + signs * point
        N = factors.prod(axis=1) / 8
        gradient = np.stack(
            [signs[:, a] * np.delete(factors, a, axis=1).prod(axis=1) / 4 / edges[a] for a in range(3)], axis=1
        )
        B = strain(gradient)
        K += B.T @ D @ B * volume / 8
        M += np.kron(np.outer(N, N), np.eye(3)) * DENSITY * volume / 8
    return M, K


def strain(gradient: np.ndarray) -> np.ndarray:
    """(6, 24): xx, yy, zz, xy, yz, zx of shape function gradients (8, 3)."""
    B = np.zeros((6, 8, 3))
    for a in range(3):
        B[a, :, a] = gradient[:, a]
    for row, (a, b) in zip((3, 4, 5), ((0, 1), (1, 2), (2, 0))):
        B[row, :, a], B[row, :, b] = gradient[:, b], gradient[:, a]
    return B.reshape(6, 24)


def elasticity() -> np.ndarray:
    lame = YOUNG * POISSON / (1 + POISSON) / (1 - 2 * POISSON)
    shear = YOUNG / 2 / (1 + POISSON)
    D = np.diag([2 * shear] * 3 + [shear] * 3)
    D[:3, :3] += lame
    return D
