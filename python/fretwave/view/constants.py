"""Elastic constants that a model's stiffness has at the surface of its solids.

Elements of any formulation that passes the patch test (B. M. Irons and A. Razzaque, 1972) have the same nodal forces in
uniform strain. These vanish inside a body and are tractions on its surface: there they are linear in Lame's constants.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from ..arrays import Array, Indices
from ..case.gauge_places import node_numbers, solids_of
from ..fe.internal_forces import StressPoints, uniform_strains
from ..fe.solids import MODES, PLACES
from ..fe.strain import Solids
from ..model.structure import Structure

Mask = npt.NDArray[np.bool_]

#: Share of the forces by which elements of one material differ: measured up to 2.4e-4, of reduced integration.
SAME = 0.02
#: Forces below this share of those of single cells are of nodes inside, where they vanish: measured above 0.1 outside.
INSIDE = 0.05
#: Entries of K below this share of their row's diagonal join nothing.
NOTHING = 1e-9
#: Forces of springs to the ground above this share of a node's stiffness spoil it; centrifugal softening has 1e-8.
SPRING = 1e-4


@dataclass(frozen=True)
class Constants:
    """At nodes on the surface, of cells that are wholly free and joined to nothing else.

    Attributes
    ----------
    rows : (n,) places of the nodes among all
    numbers : (n,) theirs in the mesh
    off : (n,) share by which K's forces in uniform strain differ from those of the constants that are compared
    factor : (n,) K's Young's modulus over that
    together : Young's modulus [pressure] and Poisson's ratio that fit all of them best
    left : share of their forces that these leave
    others : (n_points,) whether a point's cell has nodes of other constants, and none that agrees
    """

    rows: Indices
    numbers: Indices
    off: Array
    factor: Array
    together: tuple[float, float]
    left: float
    others: Mask

    @property
    def wrong(self) -> Indices:
        """Places in these tables of the nodes that have other constants."""
        return np.flatnonzero(self.off > SAME)

    @property
    def one(self) -> bool:
        """Whether it is one material, and another one."""
        return self.left < SAME and 2 * len(self.wrong) > len(self.off)


def constants_of(structure: Structure, K: sp.csr_matrix, points: StressPoints) -> Constants | None:
    """Beside those of the points; None where no node tells, and of a model that its builder has reduced."""
    solids, nodes = solids_of(structure), np.asarray(structure.coordinates)
    if structure.expansion is not None:
        return None
    table = structure.dofs_of_nodes
    fields = uniform_strains(nodes - nodes.mean(axis=0)) * _own(solids, len(nodes))[:, None, None]
    E, nu = points.elastic
    both = points.forces_of(fields, (2.5, 0.25))  # both of Lame's constants are 1
    shear = points.forces_of(fields, (2.0, 0.0))  # the second one alone
    first, second = E * nu / (1 + nu) / (1 - 2 * nu), E / 2 / (1 + nu)
    units = np.stack([both - shear, shear], axis=-1).reshape(len(nodes), -1, 2)
    size = np.linalg.norm(points.forces_of(fields, (1.0, 0.0)).reshape(len(nodes), -1), axis=1)
    told = np.flatnonzero(_free(structure, K, table, solids) & (size > INSIDE * points.sizes()))
    if not len(told):
        return None
    given = _forces(K, table, fields).reshape(len(nodes), -1)[told]
    units = units[told]
    expected = units @ [first, second]
    off = np.linalg.norm(given - expected, axis=1) / np.linalg.norm(expected, axis=1)
    factor = _modulus(_fit(units, given)) / E
    scaled = 1 / np.linalg.norm(expected, axis=1)  # every node counts alike, however large its cells are
    A, b = (units * scaled[:, None, None]).reshape(-1, 2), (given * scaled[:, None]).ravel()
    best = _fit(A, b)
    left = float(np.linalg.norm(A @ best - b) / np.linalg.norm(b))
    together = float(_modulus(best)), float(best[0] / 2 / best.sum())
    others = points.touching(told[off > SAME]) & ~points.touching(told[off <= SAME])
    return Constants(told, node_numbers(structure)[told], off, factor, together, left, others)


def _fit(units: Array, forces: Array) -> Array:
    """(..., 2) Lame's constants [pressure] of forces (..., n) from those (..., n, 2) of a unit of each."""
    return np.asarray((np.linalg.pinv(units) @ forces[..., None])[..., 0])


def _modulus(lame: Array) -> Array:
    first, second = lame[..., 0], lame[..., 1]
    return np.asarray(second * (3 * first + 2 * second) / (first + second))


def _own(solids: Solids, count: int) -> Array:
    """(n_nodes,) 0 at the inner nodes of cells, at rest in uniform strain, and 1 elsewhere."""
    own = np.ones(count)
    own[solids[MODES][:, 8:] if MODES in solids else []] = 0.0
    return own


def _forces(K: sp.csr_matrix, table: Indices, fields: Array) -> Array:
    """(n_nodes, 3, c) of K for displacements of the nodes."""
    full = np.zeros((K.shape[0] + 1, fields.shape[2]))
    full[table.ravel()] = fields.reshape(-1, fields.shape[2])  # what is not there goes to the last row
    return at_nodes(K @ full[:-1], table)


def at_nodes(values: Array, table: Indices) -> Array:
    """(n_nodes, 3, c) from (n_dof, c) by the dofs of the nodes, 0 where these are held."""
    return np.asarray(np.vstack([values, np.zeros(values.shape[1])])[table.ravel()].reshape(*table.shape, -1))


def _grounded(K: sp.csr_matrix, table: Indices, own: Array) -> Mask:
    """(n_nodes,) whether forces are on a node where all move alike: springs hold it."""
    forces = np.linalg.norm(_forces(K, table, np.multiply.outer(own, np.eye(3))), axis=(1, 2))
    return np.asarray(forces > SPRING * np.append(abs(K.diagonal()), 0.0)[table].max(axis=1))


def _free(structure: Structure, K: sp.csr_matrix, table: Indices, solids: Solids) -> Mask:
    """(n_nodes,) whether a node and all of its neighbours in solid cells move, and K joins it to nothing else."""
    count = len(table)
    cells = sp.vstack([_incidence(nodes, count) for nodes in solids.values()])
    near = sp.csr_matrix(cells.T @ cells)
    free = (near.diagonal() > 0) & (_own(solids, count) > 0)
    free &= near @ (table < 0).any(axis=1).astype(float) == 0
    for kind, nodes in structure.cells.items():
        if kind not in PLACES:
            free[nodes] = False
    return np.asarray(free & ~_joined_beyond(K, table, near) & ~_grounded(K, table, _own(solids, count)))


def _incidence(cells: Indices, count: int) -> sp.csr_matrix:
    """(n_cells, n_nodes) 1 where a cell has a node."""
    rows = np.repeat(np.arange(len(cells)), cells.shape[1])
    return sp.csr_matrix((np.ones(cells.size), (rows, cells.ravel())), shape=(len(cells), count))


def _joined_beyond(K: sp.csr_matrix, table: Indices, near: sp.csr_matrix) -> Mask:
    """(n_nodes,) whether K joins a node to one in none of its cells, or to a dof that is of no node."""
    count, entries = len(table), K.tocoo()
    node = np.full(K.shape[0] + 1, count)
    node[table.ravel()] = np.repeat(np.arange(count), 3)
    kept = abs(entries.data) > NOTHING * abs(K.diagonal())[entries.row]
    rows, columns = node[entries.row[kept]], node[entries.col[kept]]
    joined = sp.csr_matrix((np.ones(len(rows)), (rows, columns)), shape=(count + 1, count + 1)) > 0
    near = sp.csr_matrix((near.data, near.indices, np.append(near.indptr, near.nnz)), shape=joined.shape)
    beyond = joined.astype(float) - joined.multiply(near > 0).astype(float)
    return np.asarray(abs(beyond).sum(axis=1)).ravel()[:count] > 0
