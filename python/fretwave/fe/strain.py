"""Strain at the nodes of solid cells from their displacements, and stress of an isotropic, linear elastic material.

Strain is taken where it is best in each cell, extrapolated to the cell's nodes and averaged over the cells around a
node (E. Hinton and J. S. Campbell, Int. J. Numer. Methods Eng. 8 (1974)). Six components stand in the order xx, yy, zz,
xy, xz, yz; shear strains are those of the tensor, half the engineer's.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from ..arrays import Array, Indices
from ..errors import InputError
from .solids import MODES, PLACES, best_points, extrapolation, outside, shape_functions

#: Axes of the six components.
COMPONENTS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
#: A place this share of a cell's size beside it is on its surface.
BESIDE = 0.02

Solids = Mapping[str, Indices]


@dataclass(frozen=True)
class StrainRows:
    """Strain at some places from displacements of nodes.

    Attributes
    ----------
    gradient : (3 n_places, n_nodes) CSR
        Derivatives along x, y, z [1/length], place by place.
    """

    gradient: sp.csr_matrix

    def __call__(self, displacement: Array) -> Array:
        """(n_places, 6, c) of displacements (n_nodes, 3, c) [length]."""
        count = displacement.shape[2]
        slope = (self.gradient @ displacement.reshape(len(displacement), -1)).reshape(-1, 3, 3, count)
        return np.stack([(slope[:, a, b] + slope[:, b, a]) / 2 for a, b in COMPONENTS], axis=1)

    def mean(self, weights: sp.spmatrix) -> StrainRows:
        """At other places, means of these with weights (n_others, n_places)."""
        return StrainRows(sp.csr_matrix(sp.kron(weights, sp.identity(3)) @ self.gradient))


def gradients(kind: str, corners: Array, points: Array) -> Array:
    """Derivatives dN/dx (n_cells, n_points, 3, n_nodes) [1/length] of the shape functions at points of each cell.

    Those of incompatible modes go by the map of the cell's middle, as CalculiX' do.

    Parameters
    ----------
    corners : (n_cells, n_nodes, 3) coordinates [length], of inner nodes any
    points : (n_points, 3) in the cell's own coordinates

    Raises
    ------
    InputError
        A cell is folded or flat.
    """
    if kind == MODES:
        own = [gradients("hexahedron", corners[:, :8], u) for u in (points, np.zeros((1, 3)))]
        # Coordinates of the cell are the shape functions' sum with their places, so are their derivatives.
        of_modes = (own[1] @ PLACES["hexahedron"]) * (-2 * points)[:, None, :]
        return np.asarray(np.concatenate([own[0], of_modes], axis=3))
    _, local = shape_functions(kind, points)
    jacobian = np.einsum("qin,enx->eqix", local, corners, optimize=True)
    size = np.linalg.det(jacobian)
    bad = np.flatnonzero(size.min(axis=1) * size.max(axis=1) <= 0)
    if len(bad):
        place = ", ".join(f"{x:.6g}" for x in corners[bad[0]].mean(axis=0))
        measured, fix = f"{len(bad)} of {len(corners)} cells '{kind}'", "correct the mesh, or the order of their nodes"
        raise InputError("a cell is folded or flat", f"cell at ({place})", measured, "a volume of one sign", fix)
    return np.asarray(np.linalg.inv(jacobian) @ local)


def nodal_strain(nodes: Array, solids: Solids) -> StrainRows:
    """Rows of all nodes (n_nodes, 3) from solid cells (n_cells, n_nodes_of_a_cell) by kind; zero at nodes of none."""
    n = len(nodes)
    total = sum((_of_cells(nodes, kind, cells) for kind, cells in solids.items()), sp.csr_matrix((3 * n, n)))
    return StrainRows(total).mean(sp.diags(1 / np.maximum(cells_around(n, solids), 1)))


def cells_around(n_nodes: int, solids: Solids) -> Indices:
    """(n_nodes,) number of solid cells that have each node."""
    found = [np.bincount(cells.ravel(), minlength=n_nodes) for cells in solids.values()]
    return np.asarray(np.sum([np.zeros(n_nodes, dtype=np.intp), *found], axis=0))


def _of_cells(nodes: Array, kind: str, cells: Indices) -> sp.csr_matrix:
    """Sum over cells of the derivatives at their nodes."""
    n = len(nodes)
    at_points = gradients(kind, nodes[cells], best_points(kind))
    at_nodes = np.einsum("pq,eqxn->epxn", extrapolation(kind), at_points, optimize=True)
    rows = 3 * cells[:, : at_nodes.shape[1], None, None] + np.arange(3)[:, None]
    rows, columns = (np.broadcast_to(part, at_nodes.shape) for part in (rows, cells[:, None, None, :]))
    return sp.csr_matrix((at_nodes.ravel(), (rows.ravel(), columns.ravel())), shape=(3 * n, n))


def interpolation(nodes: Array, solids: Solids, place: Array) -> sp.csr_matrix | None:
    """Weights (1, n_nodes) of the nodes at a place (3,) in or on a cell; None where there is none."""
    found = list(_cells_at(nodes, solids, place))
    if not found:
        return None
    kind, cell, u = min(found, key=lambda one: float(outside(one[0], one[2])[0]))
    values, _ = shape_functions(kind, u)
    return sp.csr_matrix((values[0], (np.zeros(len(cell), dtype=int), cell)), shape=(1, len(nodes)))


def _cells_at(nodes: Array, solids: Solids, place: Array) -> Iterator[tuple[str, Indices, Array]]:
    """Kind, nodes and own coordinates (1, 3) of the cells that the place lies in or on."""
    for kind, cells in solids.items():
        corners = nodes[cells]
        low, high = corners.min(axis=1), corners.max(axis=1)
        room = 0.1 * np.linalg.norm(high - low, axis=1)[:, None]
        for cell in cells[((place > low - room) & (place < high + room)).all(axis=1)]:
            u = _own_coordinates(kind, nodes[cell], place)
            if outside(kind, u)[0] < BESIDE:
                yield kind, cell, u


def _own_coordinates(kind: str, corners: Array, place: Array) -> Array:
    """(1, 3) of a place, by Newton's method from the middle; far outside where there are none."""
    u = PLACES[kind].mean(axis=0)[None]
    for _ in range(20):
        values, local = shape_functions(kind, u)
        step = np.linalg.lstsq((local[0] @ corners).T, place - values[0] @ corners, rcond=None)[0]
        u = np.clip(u + step, -3.0, 3.0)
    return np.asarray(u)


def stress_of(strain: Array, youngs_modulus: float, poisson_ratio: float) -> Array:
    """Stress (n, 6, ...) [pressure] of a strain (n, 6, ...), Hooke's law."""
    shear = youngs_modulus / (1 + poisson_ratio)  # twice the shear modulus, of the tensor's components
    stress = shear * strain
    stress[:, :3] += shear * poisson_ratio / (1 - 2 * poisson_ratio) * strain[:, :3].sum(axis=1, keepdims=True)
    return np.asarray(stress)


def along(strain: Array, direction: Array) -> Array:
    """Strain (n, ...) along unit vectors (n, 3) of strains (n, 6, ...): what a gauge reads."""
    weights = [(1 if a == b else 2) * direction[:, a] * direction[:, b] for a, b in COMPONENTS]
    return np.asarray(np.einsum("nk,nk...->n...", np.stack(weights, axis=1), strain))
