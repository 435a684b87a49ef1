"""A builder for tests: one finite-element sector of a small bladed disk, held at its bore, rubbing under its rim."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.sparse as sp
from mpi4py import MPI

import fretwave as fw
from fretwave import fe

STEEL = fe.Material(youngs_modulus=210e9, poisson_ratio=0.3, density=7800.0)
BORE, RIM, TIP, HEIGHT = 0.1, 0.2, 0.26, 0.02


@dataclass(frozen=True)
class Options:
    """`on_face`: a pair stands on a face of the sector; `reduced`: by the builder, with all its component modes."""

    sectors: int = 6
    order: int = 1
    on_face: bool = False
    reduced: bool = False


def mesh_of(o: Options) -> fe.Mesh:
    """A skewed annulus (four layers of cells in radius, four around) with a blade on its two middle cells."""

    def curved(angles: tuple[float, float], radii: tuple[float, float]) -> Any:
        def place(u: np.ndarray) -> np.ndarray:
            angle = np.pi / o.sectors * (angles[0] + u[:, 0] * (angles[1] - angles[0])) + 0.2 * u[:, 1]
            r = radii[0] + u[:, 2] * (radii[1] - radii[0])
            return np.column_stack([r * np.cos(angle), r * np.sin(angle), HEIGHT * u[:, 1]])

        return place

    sides = {"left": (-1.0, -0.5, 1), "middle": (-0.5, 0.5, 2), "right": (0.5, 1.0, 1)}
    blocks = [fe.Block(name, (n, 1, 4), curved((a, b), (BORE, RIM))) for name, (a, b, n) in sides.items()]
    return fe.join([*blocks, fe.Block("blade", (2, 1, 1), curved((-0.5, 0.5), (RIM, TIP)))], o.order)


def build(**options: Any) -> fw.Structure:
    """The sector, or its reduction with the way back to the nodes."""
    o = Options(**options)
    return reduced(unreduced(o)) if o.reduced else unreduced(o)


def reduced(full: fw.Structure) -> fw.Structure:
    """On the pads, the tip, the faces and 80 component modes: nothing is left out."""
    pads = full.pairs["pads"]
    contact = fw.Contact("coulomb_3d", pads.B, {**pads.parameters, "friction_coefficient": 0.1})
    arguments = (full.M, full.K, full.low, full.high, full.sectors)
    options = dict(contacts=[contact], keep=[full.dofs["tip"]], axis="z", modes=80, comm=MPI.COMM_SELF)
    with fw.reduce_sector(*arguments, **options) as reduction:
        return replace(
            full,
            M=reduction.M,
            K=reduction.K,
            dofs={"tip": reduction.places[full.dofs["tip"]]},
            pairs={"pads": replace(pads, B=reduction.contacts[0].B[0])},
            loads={name: reduction.project(load) for name, load in full.loads.items()},
            low=reduction.low,
            high=reduction.high,
            expansion=reduction.expand(np.eye(reduction.size)),
        )


def unreduced(o: Options) -> fw.Structure:
    """Dofs 3 * node + axis of the nodes beyond the bore; nodes on it are drawn, and held."""
    mesh = mesh_of(o)
    radius = np.hypot(mesh.nodes[:, 0], mesh.nodes[:, 1])
    free = np.nonzero(radius > BORE * (1 + 1e-9))[0]
    place = np.full(len(mesh.nodes), -1)
    place[free] = np.arange(len(free))
    M, K = (sp.csr_matrix(A.tocsr()[dofs_of(free)][:, dofs_of(free)]) for A in fe.assemble(mesh, STEEL))
    faces = [np.intersect1d(mesh.block_side(*side).ravel(), free) for side in (("left", 0, 0), ("right", 0, 1))]
    low, high = fw.match_faces(mesh.nodes, *faces, o.sectors, "z")
    tip = mesh.lattice["blade"][mesh.lattice["blade"].shape[0] // 2, 0, -1]
    under = np.append(mesh.lattice["middle"][:, 0, -1], low[-1:] if o.on_face else low[:0])
    n = len(under)
    B = sp.csr_matrix((np.ones(3 * n), (np.arange(3 * n), contact_dofs(place[under]))), (3 * n, M.shape[0]))
    pads = fw.Pairs(
        B=sp.csr_matrix(-B),  # the rim moves down (-z) onto the pads
        parameters={"normal_stiffness": 2e8, "tangential_stiffness": 1e8, "normal_load": 1000.0},
        areas=np.full(n, 1e-4),
        points=mesh.nodes[under],
        frames=np.tile(-np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]]), (n, 1, 1)),
    )
    weight = np.zeros(M.shape[0])
    weight[2::3] = -9.81 * np.asarray(M.sum(axis=1)).ravel()[2::3]
    return fw.Structure(
        M,
        K,
        dofs={"tip": 3 * int(place[tip]) + 2},
        pairs={"pads": pads},
        loads={"weight": weight},
        coordinates=mesh.nodes,
        displacements=np.where(place[:, None] < 0, -1, 3 * place[:, None] + np.arange(3)),
        hexahedra=mesh.vtk_cells,
        sectors=o.sectors,
        low=dofs_of(place[low]),
        high=dofs_of(place[high]),
        axis="z",
    )


def dofs_of(nodes: Any) -> Any:
    """Three per node."""
    return (3 * np.asarray(nodes)[:, None] + np.arange(3)).ravel()


def contact_dofs(nodes: Any) -> Any:
    """Normal z, tangents x and y."""
    return (3 * np.asarray(nodes)[:, None] + np.array([2, 0, 1])).ravel()
