"""Forces at nodes and energy of the stress in solid cells: what a stiffness of the same cells and material has too.

Stress is that of an isotropic, linear elastic material at points of integration (`fretwave.fe.solids`); forces are its
integral with the gradients of the shape functions, f = int B^T sigma dV, energy is int eps : sigma dV / 2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from ..arrays import Array, Indices
from .solids import MODES, points_of_integration, shape_functions
from .strain import COMPONENTS, Solids, StrainRows, gradients, stress_of


@dataclass(frozen=True)
class StressPoints:
    """Points in all cells: those at which strain is best, or those of full integration.

    Attributes
    ----------
    strain : at the points
    volumes : (n_points,) [length^3]
    elastic : Young's modulus [pressure] and Poisson's ratio
    """

    strain: StrainRows
    volumes: Array
    elastic: tuple[float, float]

    @classmethod
    def of(cls, nodes: Array, solids: Solids, elastic: tuple[float, float], full: bool = False) -> StressPoints:
        """Of nodes (n_nodes, 3) and cells (n_cells, n_nodes_of_a_cell) by kind."""
        parts = [_of_cells(nodes, kind, cells, full) for kind, cells in solids.items()]
        gradient, volumes = sp.vstack([rows for rows, _ in parts], format="csr"), [volume for _, volume in parts]
        return cls(StrainRows(gradient), np.concatenate(volumes), elastic)

    def forces(self, displacement: Array) -> Array:
        """(n_nodes, 3, c) [force] of displacements (n_nodes, 3, c) [length]."""
        return self.forces_of(displacement, self.elastic)

    def forces_of(self, displacement: Array, elastic: tuple[float, float]) -> Array:
        """The same of other constants."""
        stress = stress_of(self.strain(displacement), *elastic) * self.volumes[:, None, None]
        count = displacement.shape[2]
        full = np.empty((len(stress), 3, 3, count))  # by the derivative, then the force
        for k, (a, b) in enumerate(COMPONENTS):
            full[:, a, b] = full[:, b, a] = stress[:, k]
        return np.asarray((self.strain.gradient.T @ full.reshape(-1, 3 * count)).reshape(-1, 3, count))

    def sizes(self) -> Array:
        """(n_nodes,) what each node's force is at most for a stress of 1 in every cell [length^2]."""
        return np.asarray(abs(self.strain.gradient).T @ np.repeat(self.volumes, 3))

    def energies(self, displacement: Array) -> Array:
        """(n_points, c) of displacements (n_nodes, 3, c) [energy]."""
        strain = self.strain(displacement)
        weights = np.array([1.0 if a == b else 2.0 for a, b in COMPONENTS])
        density = np.einsum("k,nkc,nkc->nc", weights, strain, stress_of(strain, *self.elastic))
        return np.asarray(density * self.volumes[:, None] / 2)

    def touching(self, nodes: Indices) -> npt.NDArray[np.bool_]:
        """(n_points,) whether a point's cell has one of these nodes."""
        chosen = np.zeros(self.strain.gradient.shape[1])
        chosen[nodes] = 1.0
        return np.asarray((abs(self.strain.gradient) @ chosen).reshape(-1, 3).sum(axis=1) > 0)


def uniform_strains(nodes: Array) -> Array:
    """(n_nodes, 3, 6) displacements of a unit of each strain component, of shear of both that make it."""
    fields = np.zeros((len(nodes), 3, 6))
    for k, (a, b) in enumerate(COMPONENTS):
        fields[:, a, k] += nodes[:, b] / 2
        fields[:, b, k] += nodes[:, a] / 2
    return fields


def _of_cells(nodes: Array, kind: str, cells: Indices, full: bool) -> tuple[sp.csr_matrix, Array]:
    """Derivatives along x, y, z point by point (3 n_points, n_nodes), and the points' volumes."""
    points, own = points_of_integration(kind, full)
    found = gradients(kind, nodes[cells], points)
    rows = np.arange(found.shape[0] * found.shape[1] * 3).reshape(found.shape[:3])[..., None]
    rows, columns = (np.broadcast_to(part, found.shape) for part in (rows, cells[:, None, None, :]))
    shape = (3 * found.shape[0] * found.shape[1], len(nodes))
    gradient = sp.csr_matrix((found.ravel(), (rows.ravel(), columns.ravel())), shape=shape)
    kind, cells = ("hexahedron", cells[:, :8]) if kind == MODES else (kind, cells)
    _, local = shape_functions(kind, points)
    size = abs(np.linalg.det(np.einsum("qin,enx->eqix", local, nodes[cells], optimize=True)))
    return gradient, (size * own).ravel()
