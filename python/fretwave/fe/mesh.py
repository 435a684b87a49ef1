"""Structured hexahedra: mapped blocks, joined where their nodes coincide.

A block is a grid of cells on the unit cube and a map of the cube into space. Elements carry a lattice of
(order + 1)^3 nodes: hex8 for order 1, hex27 for order 2, whose edges follow the map (isoparametric).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from ..arrays import Array, Indices
from ..errors import InputError
from .lagrange import lagrange, tensor, tensor_gauss

#: Nodes closer than this share of the shortest distance between neighbours of one block are one node.
MERGE_SHARE = 1e-3
#: Smallest Jacobian of an element over its largest that `Mesh.check_quality` accepts.
JACOBIAN_RATIO = 0.05

#: Positions of the nodes of VTK's triquadratic hexahedron on the lattice {0, 1, 2}^3; the first 8 are the hexahedron.
VTK_LATTICE = (
    [(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0), (0, 0, 2), (2, 0, 2), (2, 2, 2), (0, 2, 2)]
    + [(1, 0, 0), (2, 1, 0), (1, 2, 0), (0, 1, 0), (1, 0, 2), (2, 1, 2), (1, 2, 2), (0, 1, 2)]
    + [(0, 0, 1), (2, 0, 1), (2, 2, 1), (0, 2, 1)]
    + [(0, 1, 1), (2, 1, 1), (1, 0, 1), (1, 2, 1), (1, 1, 0), (1, 1, 2), (1, 1, 1)]
)


@dataclass(frozen=True)
class Block:
    """A unit cube of cells, mapped into space.

    Parameters
    ----------
    name : str
        Found again in `Mesh.lattice`.
    cells : (int, int, int)
        Number of elements along the three axes of the cube.
    mapping : callable (n, 3) -> (n, 3)
        Points of the unit cube to coordinates [length]; right-handed.
    """

    name: str
    cells: tuple[int, int, int]
    mapping: Callable[[Array], Array]

    def points(self, order: int) -> Array:
        """Coordinates (order n_1 + 1, order n_2 + 1, order n_3 + 1, 3) of the block's nodes [length]."""
        if len(self.cells) != 3 or min(self.cells) < 1:
            raise InputError(f"block '{self.name}' has no cells", None, self.cells, "three numbers >= 1", "give cells")
        axes = [np.linspace(0.0, 1.0, order * n + 1) for n in self.cells]
        cube = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
        return np.asarray(self.mapping(cube.reshape(-1, 3)), dtype=float).reshape(cube.shape)


@dataclass(frozen=True)
class Quality:
    """Smallest Jacobian over largest within one element: 1 for a parallelepiped, <= 0 if it is folded."""

    ratio: float  #: of the worst element
    element: int
    block: str
    centre: tuple[float, float, float]  #: [length]


@dataclass(frozen=True)
class Mesh:
    """Hexahedra with their nodes; dof = 3 * node + axis.

    Attributes
    ----------
    nodes : (n_nodes, 3)
        Coordinates [length].
    cells : (n_cells, m, m, m)
        Node numbers of each element on its lattice, m = order + 1.
    lattice : dict of (order n_1 + 1, order n_2 + 1, order n_3 + 1) arrays
        Node numbers of each block on its grid.
    """

    nodes: Array
    cells: Indices
    order: int
    lattice: Mapping[str, Indices] = field(repr=False)

    @property
    def n_dof(self) -> int:
        """Three per node."""
        return 3 * len(self.nodes)

    @property
    def vtk_cells(self) -> Indices:
        """Node numbers (n_cells, 8 or 27) in VTK's order: hexahedron or triquadratic hexahedron."""
        order = np.array(VTK_LATTICE if self.order == 2 else VTK_LATTICE[:8]) * self.order // 2
        return self.cells[:, order[:, 0], order[:, 1], order[:, 2]]

    def jacobians(self, points: Sequence[Array] | None = None) -> Array:
        """Determinants (n_cells, n_points) [length^3] at a grid of points of the unit cube, or at the Gauss points."""
        gradients = tensor(self.order, list(points))[1] if points else tensor_gauss(self.order, 3)[1]
        corners = self.nodes[self.cells.reshape(len(self.cells), -1)]
        return np.asarray(np.linalg.det(np.einsum("qni,enx->eqxi", gradients, corners, optimize=True)))

    @property
    def volume(self) -> float:
        """Of all elements [length^3], exact for the isoparametric map."""
        return float((self.jacobians() @ tensor_gauss(self.order, 3)[2]).sum())

    @cached_property
    def boundary_faces(self) -> Indices:
        """Node lattices (n_faces, m, m) of the faces that belong to one element, seen from outside."""
        faces = np.concatenate([side_faces(self.cells, axis, end) for axis in range(3) for end in (0, 1)])
        corners = np.sort(faces[:, :: self.order, :: self.order].reshape(len(faces), 4))
        _, which, count = np.unique(corners, axis=0, return_inverse=True, return_counts=True)
        return np.asarray(faces[count[which] == 1])

    def block_side(self, name: str, axis: int, end: int) -> Indices:
        """Node numbers on one side of a block, on the grid of its two other axes.

        Parameters
        ----------
        axis, end : int
            Axis 0, 1 or 2 of the unit cube, at its end 0 or 1.
        """
        if name not in self.lattice:
            raise InputError("the mesh has no such block", None, name, ", ".join(self.lattice), "name one of these")
        return np.asarray(np.take(self.lattice[name], -end, axis=axis))

    def block_faces(self, name: str, axis: int, end: int) -> Indices:
        """Faces (n_a, n_b, m, m) on one side of a block, each seen from outside; parameters as `block_side`."""
        windows = np.lib.stride_tricks.sliding_window_view(self.block_side(name, axis, end), (self.order + 1,) * 2)
        return _oriented(windows[:: self.order, :: self.order], axis, end)

    def faces_where(self, predicate: Callable[[Array], npt.NDArray[np.bool_]]) -> Indices:
        """Boundary faces (n, m, m) all of whose nodes have coordinates (n, 3) that satisfy the predicate."""
        inside = np.asarray(predicate(self.nodes))
        return np.asarray(self.boundary_faces[inside[self.boundary_faces].all(axis=(1, 2))])

    def nearest(self, point: Sequence[float]) -> int:
        """The node nearest to a point [length]."""
        return int(np.argmin(np.linalg.norm(self.nodes - np.asarray(point), axis=1)))

    def quality(self) -> Quality:
        """The worst element, its Jacobian taken at all nodes of its lattice."""
        lattice = np.linspace(0.0, 1.0, self.order + 1)
        determinants = self.jacobians([lattice] * 3)
        ratios = determinants.min(axis=1) / abs(determinants).max(axis=1)
        worst = int(np.argmin(ratios))
        centre = self.nodes[self.cells[worst].ravel()].mean(axis=0)
        return Quality(float(ratios[worst]), worst, self._home(worst), tuple(centre.tolist()))

    def check_quality(self, smallest: float = JACOBIAN_RATIO) -> Quality:
        """The worst element; an InputError if its Jacobian ratio is below `smallest`."""
        worst = self.quality()
        if worst.ratio < smallest:
            x, y, z = worst.centre
            raise InputError(
                "an element is folded" if worst.ratio <= 0 else "an element is badly distorted",
                f"block '{worst.block}', element {worst.element} at ({x:.4g}, {y:.4g}, {z:.4g})",
                f"smallest Jacobian {worst.ratio:.3g} of the element's largest",
                f">= {smallest:g}",
                "smooth the block's map, or swap two of its axes if the whole block is left-handed",
            )
        return worst

    def _home(self, element: int) -> str:
        """Block of an element; blocks come one after the other."""
        sizes = [np.prod([(n - 1) // self.order for n in grid.shape]) for grid in self.lattice.values()]
        return list(self.lattice)[int(np.searchsorted(np.cumsum(sizes), element, side="right"))]


def side_faces(cells: Indices, axis: int, end: int) -> Indices:
    """One face (n_cells, m, m) of each element, oriented so that first x second direction points outwards."""
    return _oriented(np.take(cells, -end, axis=axis + 1), axis, end)


def _oriented(faces: Indices, axis: int, end: int) -> Indices:
    return faces if (axis == 1) != (end == 1) else faces.swapaxes(-1, -2)


def join(blocks: Sequence[Block], order: int = 2, tolerance: float | None = None) -> Mesh:
    """Mesh of blocks whose nodes coincide on shared faces; coincident nodes become one.

    Parameters
    ----------
    order : int
        1 for hex8, 2 for hex27.
    tolerance : float, optional
        Distance [length] below which nodes are one. Default: 1e-3 of the shortest distance between neighbours.

    Raises
    ------
    InputError
        Order, names or cells are wrong, or two blocks touch without having the same nodes there.
    """
    names = [block.name for block in blocks]
    if order not in (1, 2) or not blocks or len(set(names)) < len(names):
        raise InputError(
            "blocks cannot be joined", None, f"order {order}, {names}", "order 1 or 2, own names", "see join"
        )
    grids = [block.points(order) for block in blocks]
    points = np.concatenate([grid.reshape(-1, 3) for grid in grids])
    tolerance = tolerance or MERGE_SHARE * min(_shortest(grid) for grid in grids)
    nodes, number = merge(points, tolerance)
    starts = np.cumsum([0] + [grid[..., 0].size for grid in grids])
    lattice = {n: number[s : s + g[..., 0].size].reshape(g.shape[:3]) for n, s, g in zip(names, starts, grids)}
    mesh = Mesh(nodes, np.concatenate([_cells(grid, order) for grid in lattice.values()]), order, lattice)
    _check_conforming(mesh, tolerance)
    return mesh


def merge(points: Array, tolerance: float) -> tuple[Array, Indices]:
    """Distinct points (n, 3) in order of first appearance, and the number (n_points,) of each given point."""
    pairs = cKDTree(points).query_pairs(tolerance, output_type="ndarray")
    graph = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(points),) * 2)
    _, label = connected_components(graph, directed=False)
    _, first, which = np.unique(label, return_index=True, return_inverse=True)
    rank = np.argsort(np.argsort(first))
    return points[np.sort(first)], np.asarray(rank[which], dtype=np.intp)


def _shortest(grid: Array) -> float:
    return min(float(np.linalg.norm(np.diff(grid, axis=axis), axis=-1).min()) for axis in range(3))


def _cells(grid: Indices, order: int) -> Indices:
    windows = np.lib.stride_tricks.sliding_window_view(grid, (order + 1,) * 3)
    return windows[::order, ::order, ::order].reshape(-1, order + 1, order + 1, order + 1)


def _check_conforming(mesh: Mesh, tolerance: float) -> None:
    """No node of the boundary may lie on an element edge that does not own it."""
    faces = mesh.boundary_faces
    edges = np.concatenate([faces[:, 0], faces[:, -1], faces[:, :, 0], faces[:, :, -1]])
    values = lagrange(mesh.order, np.array([1 / 4, 1 / 3, 1 / 2, 2 / 3, 3 / 4]))[0]
    samples = np.einsum("qn,enx->eqx", values, mesh.nodes[edges])
    boundary = np.unique(faces)
    distance, near = cKDTree(mesh.nodes[boundary]).query(samples)
    hanging = (distance < 2 * tolerance) & (boundary[near][..., None] != edges[:, None, :]).all(axis=-1)
    if hanging.any():
        x, y, z = samples[hanging][0]
        raise InputError(
            "two blocks touch without sharing their nodes",
            f"({x:.6g}, {y:.6g}, {z:.6g})",
            "a node on an element edge that does not own it",
            "the same number of cells and the same map on both sides of a joint",
            "give both blocks the same cells there, or leave a gap between them",
        )
