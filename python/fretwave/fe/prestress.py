"""What steady rotation adds to the stiffness: stress stiffening and spin softening."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp

from ..arrays import Array
from ..errors import InputError
from .elasticity import Material
from .lagrange import tensor_gauss
from .mesh import Mesh


def stresses(mesh: Mesh, material: Material, displacement: Array) -> Array:
    """Cauchy stress of a small displacement (n_dof,) at the Gauss points, (n_cells, n_points, 3, 3) [pressure]."""
    gradients, _ = _gradients(mesh)
    u = np.asarray(displacement, dtype=float).reshape(-1, 3)
    if len(u) != len(mesh.nodes):
        raise InputError("the displacement does not fit the mesh", None, 3 * len(u), mesh.n_dof, "one value per dof")
    slope = np.einsum("eqna,enb->eqab", gradients, u[mesh.cells.reshape(len(mesh.cells), -1)], optimize=True)
    strain = (slope + slope.swapaxes(2, 3)) / 2
    first, shear = material.lame
    spherical = first * np.trace(strain, axis1=2, axis2=3)
    return np.asarray(spherical[..., None, None] * np.eye(3) + 2 * shear * strain)


def stress_stiffness(mesh: Mesh, material: Material, displacement: Array) -> sp.csr_matrix:
    """Geometric stiffness (n_dof, n_dof) [force/length] of the stress in a statically displaced body.

    K_G = integral of dN_i/dx_a sigma_ab dN_j/dx_b dV, the same for the three directions of motion (Zienkiewicz and
    Taylor, The Finite Element Method, vol. 2, section on initial stress). To be added to the elastic stiffness.

    Parameters
    ----------
    displacement : (n_dof,) static displacement [length], small
    """
    gradients, volume = _gradients(mesh)
    stress = stresses(mesh, material, displacement)
    blocks = np.einsum("eqna,eqab,eqmb,eq->enm", gradients, stress, gradients, volume, optimize=True)
    nodes = mesh.cells.reshape(len(mesh.cells), -1)
    rows, columns = (np.broadcast_to(part, blocks.shape) for part in (nodes[:, :, None], nodes[:, None, :]))
    size = (len(mesh.nodes), len(mesh.nodes))
    scalar = sp.csr_matrix((blocks.ravel(), (rows.ravel(), columns.ravel())), shape=size)
    return sp.kron(scalar, sp.identity(3), format="csr")


def spin_softening(M: sp.spmatrix, speed: float, direction: Sequence[float]) -> sp.csr_matrix:
    """Change of stiffness (n_dof, n_dof) [force/length], -Omega^2 M in the plane of rotation: the load follows.

    Parameters
    ----------
    speed : Omega [rad/s]
    direction : (3,) axis of rotation, of any length
    """
    axis = np.asarray(direction, dtype=float) / np.linalg.norm(direction)
    plane = np.eye(3) - np.outer(axis, axis)
    turned = sp.kron(sp.identity(M.shape[0] // 3), plane)
    return sp.csr_matrix(-(speed**2) * (turned @ M @ turned))


def _gradients(mesh: Mesh) -> tuple[Array, Array]:
    """dN/dx (n_cells, n_points, n_nodes, 3) [1/length] and volumes (n_cells, n_points) [length^3] of Gauss points."""
    _, local, weights = tensor_gauss(mesh.order, 3)
    corners = mesh.nodes[mesh.cells.reshape(len(mesh.cells), -1)]
    jacobian = np.einsum("qni,enx->eqxi", local, corners, optimize=True)  # dx / d(unit cube)
    gradients = np.einsum("qni,eqix->eqnx", local, np.linalg.inv(jacobian), optimize=True)
    return np.asarray(gradients), np.asarray(np.linalg.det(jacobian) * weights)
