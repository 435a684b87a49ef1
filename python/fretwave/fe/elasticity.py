"""Linear elasticity on hexahedra: stiffness and mass (assembled by scikit-fem), centrifugal load, checks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from ..arrays import Array
from ..errors import InputError
from .mesh import Mesh

if TYPE_CHECKING:
    import skfem


@dataclass(frozen=True)
class Material:
    """Isotropic, linear elastic."""

    youngs_modulus: float  #: [pressure]
    poisson_ratio: float
    density: float  #: [mass/length^3]

    def __post_init__(self) -> None:
        if self.youngs_modulus <= 0 or self.density <= 0 or not -1 < self.poisson_ratio < 0.5:
            raise InputError(
                "the material is not physical",
                None,
                self,
                "E > 0, rho > 0, -1 < nu < 0.5",
                "use one consistent system of units",
            )

    @property
    def lame(self) -> tuple[float, float]:
        """lambda and mu [pressure]."""
        E, nu = self.youngs_modulus, self.poisson_ratio
        return E * nu / (1 + nu) / (1 - 2 * nu), E / 2 / (1 + nu)


#: Ti-6Al-4V at room temperature.
TITANIUM = Material(youngs_modulus=114e9, poisson_ratio=0.33, density=4430.0)


@dataclass(frozen=True)
class MatrixReport:
    """What `check_matrices` measured; all shares are relative to the largest entry."""

    mass: float  #: [mass], from M
    volume: float  #: [length^3], from the mesh
    mass_error: float  #: |mass - rho V| / (rho V)
    asymmetry: float  #: of K and M
    rigid_residual: float  #: largest |K r| over the largest sum of |K| |r| over a row, six rigid modes


def assemble(mesh: Mesh, material: Material) -> tuple[sp.csr_matrix, sp.csr_matrix]:
    """Consistent mass and stiffness of an unconstrained body.

    Returns
    -------
    M, K : (n_dof, n_dof) CSR
        [mass] and [force/length], dof = 3 * node + axis.

    Raises
    ------
    InputError
        scikit-fem is not installed, or an element is folded.
    """
    mesh.check_quality(smallest=1e-6)
    m, S = _scalar_matrices(mesh)
    first, shear = material.lame
    laplacian = shear * (S[0, 0] + S[1, 1] + S[2, 2])
    K = sp.csr_matrix((mesh.n_dof, mesh.n_dof))
    for a, b in ((0, 0), (1, 1), (2, 2)):
        K = K + sp.kron((first + shear) * S[a, b] + laplacian, _unit(a, b), format="csr")
    for a, b in ((0, 1), (0, 2), (1, 2)):
        part = sp.kron(first * S[a, b] + shear * S[a, b].T, _unit(a, b), format="csr")
        K = K + part + part.T
    return sp.kron(material.density * m, sp.identity(3), format="csr"), K.tocsr()


def _unit(a: int, b: int) -> sp.coo_matrix:
    return sp.coo_matrix(([1.0], ([a], [b])), shape=(3, 3))


def _scalar_matrices(mesh: Mesh) -> tuple[sp.csr_matrix, dict[tuple[int, int], sp.csr_matrix]]:
    """Integrals of N_i N_j and of dN_i/dx_a dN_j/dx_b (a <= b), each (n_nodes, n_nodes).

    Elasticity needs no more, and six scalar forms take a small part of the time of one vector form.
    """
    library = _skfem()
    basis, number = _basis(library, mesh)

    def assembled(form: Callable[..., Array]) -> sp.csr_matrix:
        A = library.BilinearForm(form).assemble(basis).tocoo()
        return sp.csr_matrix((A.data, (number[A.row], number[A.col])), shape=A.shape)

    stiffness = {
        (a, b): assembled(lambda u, v, w, a=a, b=b: v.grad[a] * u.grad[b]) for a in range(3) for b in range(a, 3)
    }
    return assembled(lambda u, v, w: u * v), stiffness


def _basis(library: ModuleType, mesh: Mesh) -> tuple[skfem.Basis, npt.NDArray[np.intp]]:
    """scikit-fem's basis on this mesh, and our node of each of its dofs."""
    corners, t = np.unique(mesh.cells[:, :: mesh.order, :: mesh.order, :: mesh.order], return_inverse=True)
    element = library.ElementHex2() if mesh.order == 2 else library.ElementHex1()
    t = t.reshape(len(mesh.cells), 8).T[_positions(library.ElementHex1(), 1)]
    t = np.ascontiguousarray(t)
    linear = library.MeshHex(np.ascontiguousarray(mesh.nodes[corners].T), t)
    dofs = library.assembly.Dofs(linear, element).element_dofs
    number = np.empty(len(mesh.nodes), dtype=np.intp)
    number[dofs] = mesh.cells.reshape(len(mesh.cells), -1).T[_positions(element, mesh.order)]
    curved = library.MeshHex2(np.ascontiguousarray(mesh.nodes[number].T), t) if mesh.order == 2 else linear
    # Two points per axis for trilinear, three for triquadratic elements: exact on parallelepipeds.
    return library.Basis(curved, element, intorder=2 * mesh.order + 1), number


def _positions(element: skfem.Element, order: int) -> npt.NDArray[np.intp]:
    """Place of each of scikit-fem's local dofs on our lattice, in C order."""
    lattice = np.rint(element.doflocs * order).astype(np.intp)
    return np.asarray(np.ravel_multi_index(tuple(lattice.T), (order + 1,) * 3))


def _skfem() -> ModuleType:
    try:
        import skfem
        import skfem.assembly
    except ImportError:
        raise InputError(
            "building a finite-element model needs scikit-fem",
            None,
            "not installed",
            "the optional package scikit-fem",
            "pip install scikit-fem",
        ) from None
    library: ModuleType = skfem
    return library


def centrifugal_load(
    M: sp.spmatrix, nodes: Array, speed: float, point: Sequence[float], direction: Sequence[float]
) -> Array:
    """Consistent nodal forces (n_dof,) [force] of the body load rho Omega^2 r.

    Parameters
    ----------
    M : (n_dof, n_dof)
        Consistent mass [mass]. M r is exact, because r lies in the space of an isoparametric element.
    nodes : (n_nodes, 3)
        [length]
    speed : float
        Omega [rad/s].
    point, direction : (3,)
        The axis of rotation passes through the point [length] along the direction (any length).
    """
    axis = np.asarray(direction, dtype=float)
    if not np.linalg.norm(axis) > 0:
        raise InputError("the axis of rotation has no direction", None, direction, "a vector != 0", "give an axis")
    axis = axis / np.linalg.norm(axis)
    arm = nodes - np.asarray(point, dtype=float)
    radius = arm - np.outer(arm @ axis, axis)
    return np.asarray(speed**2 * (M @ radius.ravel()))


def rigid_modes(nodes: Array) -> Array:
    """Three unit translations and three rotations of 1 rad about the centre, (n_dof, 6)."""
    modes = np.zeros((len(nodes), 3, 6))
    arm = nodes - nodes.mean(axis=0)
    for axis in range(3):
        unit = np.eye(3)[axis]
        modes[:, axis, axis] = 1.0
        modes[:, :, 3 + axis] = np.cross(unit, arm)
    return modes.reshape(-1, 6)


def check_matrices(mesh: Mesh, material: Material, M: sp.spmatrix, K: sp.spmatrix) -> MatrixReport:
    """Measure symmetry, total mass and the forces of the six rigid motions of an unconstrained body."""
    volume = mesh.volume
    ones = np.zeros(mesh.n_dof)
    ones[::3] = 1.0
    mass = float(ones @ (M @ ones))
    expected = material.density * volume
    rigid = rigid_modes(mesh.nodes)
    residual = abs(K @ rigid).max(axis=0) / (abs(K) @ abs(rigid)).max(axis=0)
    asymmetry = max(float(abs(A - A.T).max() / abs(A).max()) for A in (M, K))
    return MatrixReport(mass, volume, abs(mass - expected) / expected, asymmetry, float(residual.max()))
