"""Contact surfaces of a mesh: nodal areas, contact points on a coarse grid, local frames and the matrix B."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from ..arrays import Array, Indices
from ..errors import InputError
from .lagrange import tensor_gauss
from .mesh import Mesh


@dataclass(frozen=True)
class ContactPatch:
    """Contact points of one surface, each standing for one cell of a coarse grid.

    Attributes
    ----------
    nodes : (n,)
        The mesh node at the centre of each cell.
    points : (n, 3)
        Its coordinates [length].
    normals : (n, 3)
        Outward unit normals, mean over the cell.
    areas : (n,)
        Area of the cell [length^2].
    weights : (n, n_nodes) CSR
        Displacement of the contact point = weights @ nodal displacements: the centre node, or the mean of the cell.
    """

    nodes: Indices
    points: Array
    normals: Array
    areas: Array
    weights: sp.csr_matrix


def surface_vectors(mesh: Mesh, faces: Indices) -> tuple[Array, Array]:
    """Integrals over each face (.., m, m).

    Returns
    -------
    shares : (n_faces, m^2)
        Of each shape function: the area that belongs to each node [length^2].
    vectors : (n_faces, 3)
        Of the outward unit normal [length^2].
    """
    values, gradients, weights = tensor_gauss(mesh.order, 2)
    corners = mesh.nodes[faces.reshape(-1, values.shape[1])]
    along = np.einsum("qni,fnx->fqix", gradients, corners)
    normal = np.cross(along[:, :, 0], along[:, :, 1])
    shares = np.einsum("q,fq,qn->fn", weights, np.linalg.norm(normal, axis=-1), values)
    return shares, np.einsum("q,fqx->fx", weights, normal)


def nodal_areas(mesh: Mesh, faces: Indices) -> Array:
    """Area that belongs to each node (n_nodes,) [length^2]: integral of its shape function over the faces."""
    shares, _ = surface_vectors(mesh, faces)
    return np.bincount(faces.ravel(), shares.ravel(), minlength=len(mesh.nodes)).astype(float)


def contact_patch(
    mesh: Mesh, block: str, axis: int, end: int, grid: tuple[int, int], average: bool = False
) -> ContactPatch:
    """Contact points at the centres of a coarse grid on one side of a block.

    Parameters
    ----------
    block, axis, end
        The side, as in `Mesh.block_faces`.
    grid : (int, int)
        Contact points along the two axes of that side.
    average : bool
        The displacement of a point is the mean over its cell instead of that of its centre node. The stiffness of
        the attachment then converges with the mesh; that of single nodes under point forces does not.
    """
    faces = mesh.block_faces(block, axis, end)
    size = [_share(mesh, faces.shape[i], grid[i], f"block '{block}', direction {i}") for i in (0, 1)]
    split = (grid[0], size[0], grid[1], size[1], -1)
    cells = faces.reshape(split).swapaxes(1, 2).reshape(grid[0] * grid[1], -1, *faces.shape[2:])
    shares, vectors = surface_vectors(mesh, cells)
    shares = shares.reshape(len(cells), -1)
    normals = vectors.reshape(len(cells), -1, 3).sum(axis=1)
    half = [mesh.order * n // 2 for n in size]
    nodes = mesh.block_side(block, axis, end)[half[0] :: 2 * half[0], half[1] :: 2 * half[1]].ravel()
    areas = shares.sum(axis=1)
    rows = np.repeat(np.arange(len(cells)), shares.shape[1])
    entries = (shares / areas[:, None]).ravel() if average else np.ones(len(cells))
    where = (rows, cells.ravel()) if average else (np.arange(len(cells)), nodes)
    weights = sp.csr_matrix((entries, where), shape=(len(cells), len(mesh.nodes)))
    return ContactPatch(nodes, mesh.nodes[nodes], normals / np.linalg.norm(normals, axis=1)[:, None], areas, weights)


def _share(mesh: Mesh, cells: int, points: int, where: str) -> int:
    if points < 1 or cells % points or (mesh.order * cells // points) % 2:
        least = 1 if mesh.order == 2 else 2
        raise InputError(
            "the contact grid does not fit the mesh",
            where,
            f"{points} contact points on {cells} elements",
            f"a multiple of {least * points} elements, so that a node stands at the centre of each contact cell",
            "change the number of elements or of contact points",
        )
    return cells // points


def tangent_frames(normals: Array, first_tangent: Sequence[float]) -> Array:
    """Right-handed orthonormal frames (n, 3, 3), rows (normal, tangent, tangent).

    Parameters
    ----------
    normals : (n, 3)
        Unit vectors.
    first_tangent : (3,)
        The first tangent is this direction made orthogonal to the normal.
    """
    hint = np.broadcast_to(np.asarray(first_tangent, dtype=float), normals.shape)
    tangent = hint - np.einsum("nx,nx->n", hint, normals)[:, None] * normals
    length = np.linalg.norm(tangent, axis=1)
    if (length < 1e-6 * np.linalg.norm(hint, axis=1)).any():
        raise InputError(
            "a contact normal is parallel to the first tangent",
            None,
            first_tangent,
            "another direction",
            "choose one in the surface",
        )
    tangent = tangent / length[:, None]
    return np.stack([normals, tangent, np.cross(normals, tangent)], axis=1)


def relative_rows(weights: sp.spmatrix, frames: Array) -> sp.csr_matrix:
    """B (3 n_pairs, 3 n_nodes), rows (normal, tangent, tangent) pair by pair.

    Parameters
    ----------
    weights : (n_pairs, n_nodes)
        Of the moving side, minus those of the opposite side if that is a body as well.
    frames : (n_pairs, 3, 3)
        Rows (normal, tangent, tangent); with the moving side's outward normal u_n > 0 closes the contact.
    """
    return (sp.block_diag(list(frames)) @ sp.kron(weights, sp.identity(3))).tocsr()
