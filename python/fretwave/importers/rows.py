"""Whether the rows of the matrices are those of the nodes that are named.

A body that turns as a whole has no stress: sum_j K_ij omega x (x_j - x_i) = 0 at every node i that moves with all of
its neighbours (T. Belytschko et al., Nonlinear Finite Elements for Continua and Structures, 2nd ed., Wiley 2014:
rigid motions are in the null space of an element's stiffness). Turned about the node itself this also holds beside
springs to the ground and of K - Omega^2 M. Rows that are given to other nodes or directions break it by a tenth and
more of what the entries add up to, and nothing else would tell of them in a body that is held.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from scipy.spatial import cKDTree

from ..arrays import Array, IntArray
from ..errors import InputError
from ..model.structure import Structure
from ..texts import counted
from .internal import internal_dofs
from .nodes import Nodes

#: (n_nodes,)
Which = npt.NDArray[np.bool_]

#: Share of its entries' sum that a node's force may have: prestress gives stress over modulus, below 0.01 of metals.
ROUND = 0.03
#: Share of the nodes with free neighbours that may break it, and of all nodes where what is held is not known.
FEW, HALF = 0.1, 0.5
#: Where no cells tell, nodes this many times as far from nodes without dofs as most are joined are joined to none.
APART = 2.0
#: Nodes that are looked at.
MOST = 4000


def check_rows(model: Structure, nodes: Nodes, where: str) -> list[str]:
    """K lets the body turn about its nodes; a warning where some break that, or where what holds them is not known.

    Parameters
    ----------
    nodes : of the mesh, with what else than cells joins them
    where : the files of the matrices

    Raises
    ------
    InputError
        It does not: rows or coordinates are of other nodes.
    """
    if model.labels is None:
        return []
    rows = _rows_of(model, model.labels, nodes)
    tables = [np.asarray(table) for table in (model.hexahedra, *model.cells.values()) if table is not None]
    if not tables:
        return _doubt(rows)
    share = rows.turned(_inner(rows.whole, tables))
    broken = int((share > ROUND).sum())
    if not broken:
        return []
    measured = f"K resists a turn of the whole body at {broken} of {counted(len(share), 'node')} among free ones"
    measured += f" that were looked at, by up to {share.max():.0%}"
    if broken <= FEW * len(share) or nodes.constraints.joins or nodes.elements.left_out or rows.beyond(tables):
        return [measured]
    what = "rows of the matrices are not of the nodes that are named"
    fix = "give --dofs FILE as the matrices were written, and the coordinates of the same model"
    raise InputError(what, f"{where}, {nodes.where}", measured, "no force there", fix)


@dataclass(frozen=True)
class _Rows:
    """K of the dofs at nodes of the mesh, places of the nodes (n_dof,), and directions from 0.

    Attributes
    ----------
    points : (n_nodes, 3) [length]
    whole : (n_nodes,) nodes that are free along x, y, z and joined to nodes of the mesh alone
    """

    K: sp.csr_matrix
    node: IntArray
    direction: IntArray
    points: Array
    whole: Which

    def some(self, chosen: Which) -> IntArray:
        """Places of nodes, not more than are looked at."""
        places = np.flatnonzero(chosen)
        return places[:: max(1, -(-len(places) // MOST))]

    def entries(self, chosen: IntArray, moves: int = 6) -> tuple[IntArray, sp.coo_matrix]:
        """Node of each row of nodes along the first directions, and the rows."""
        rows = np.flatnonzero(np.isin(self.node, chosen) & (self.direction < moves))
        return self.node[rows], self.K[rows].tocoo()

    def turned(self, chosen: Which) -> Array:
        """Of some nodes: |sum_j K_ij omega x (x_j - x_i)| / sum_j |K_ij omega x (x_j - x_i)|, over three axes omega."""
        places = self.some(chosen)
        of, part = self.entries(places, 3)
        along, entry, sums = self.direction[part.col], np.arange(part.nnz), np.zeros((2, len(self.points)))
        way = self.points[self.node[part.col]] - self.points[of[part.row]]
        for axis in np.eye(3):
            force = part.data * np.where(along < 3, np.cross(axis, way)[entry, along % 3], axis[along % 3])
            for k, values in enumerate((force, abs(force))):
                sums[k] += np.bincount(of, np.bincount(part.row, values, len(of)) ** 2, len(self.points))
        with np.errstate(invalid="ignore"):
            return np.asarray(np.nan_to_num(np.sqrt(sums[0] / sums[1]))[places])

    def beyond(self, tables: list[IntArray]) -> bool:
        """The cells are some of those of K: it joins all that they join and more, or a node without dofs is in none."""
        count = len(self.points)
        within, meshed = _joined_by(tables, count), np.zeros(count, dtype=bool)
        meshed[np.concatenate([table.ravel() for table in tables])] = True
        known = np.bincount(self.node, minlength=count) > 0
        K, keep = self.K.tocoo(), sp.diags(known.astype(float))
        stored = K.data != 0
        ends = self.node[K.row[stored]], self.node[K.col[stored]]
        by_K = sp.csr_matrix((np.ones(len(ends[0])), ends), (count, count)).sign()
        within = keep @ within @ keep
        both = by_K.multiply(within).nnz
        lacks = within.nnz - both
        return lacks <= FEW * within.nnz and bool(by_K.nnz > both or (~known & ~meshed).any())

    def apart(self) -> Which:
        """Whole nodes apart from those without dofs, which may be held, by how far most nodes are joined."""
        absent, places = np.setdiff1d(np.arange(len(self.points)), self.node), self.some(self.whole)
        if not len(absent) or not len(places):
            return np.zeros(len(self.points), dtype=bool)
        of, part = self.entries(places)
        own, reach = of[part.row], np.zeros(len(self.points))
        np.maximum.at(reach, own, np.linalg.norm(self.points[own] - self.points[self.node[part.col]], axis=1))
        away = cKDTree(self.points[absent]).query(self.points)[0]
        return np.asarray(self.whole & (away > APART * np.median(reach[places])))


def _rows_of(model: Structure, labels: IntArray, nodes: Nodes) -> _Rows:
    inside, order = internal_dofs(model), np.argsort(nodes.numbers)
    place = order[np.clip(np.searchsorted(nodes.numbers[order], labels[:, 0]), 0, len(order) - 1)]
    meshed = ~inside & (nodes.numbers[place] == labels[:, 0]) & np.isin(labels[:, 1], range(1, 7))
    known, K = np.flatnonzero(meshed), sp.csr_matrix(model.K)
    node, direction = place[known], labels[known, 1] - 1
    free, moves = np.zeros((len(order), 3), dtype=bool), direction < 3
    free[node[moves], direction[moves]] = True
    whole = free.all(axis=1)
    whole[node[np.diff(K[known][:, np.flatnonzero(~meshed & ~inside)].indptr) > 0]] = False
    return _Rows(K[known][:, known], node, direction, nodes.coordinates, whole)


def _joined_by(tables: list[IntArray], count: int) -> sp.csr_matrix:
    """1 for each two nodes of one cell (count, count)."""
    found = sp.csr_matrix((count, count))
    for table in tables:
        cells = np.repeat(np.arange(len(table)), table.shape[1])
        inside = sp.csr_matrix((np.ones(table.size), (cells, table.ravel())), (len(table), count))
        found = found + inside.T @ inside
    return found.sign()


def _inner(whole: Which, tables: list[IntArray]) -> Which:
    """Nodes of cells whose nodes are all whole."""
    meshed, beside = np.zeros_like(whole), np.zeros_like(whole)
    for table in tables:
        meshed[table] = True
        beside[table[~whole[table].all(axis=1)]] = True
    return np.asarray(meshed & ~beside)


def _doubt(rows: _Rows) -> list[str]:
    """A warning without cells: the nodes beside held ones, and those of a reduced model, are not known."""
    for chosen, few in ((rows.whole, HALF), (rows.apart(), FEW)):
        share = rows.turned(chosen)
        broken = int((share > ROUND).sum())
        if broken > few * len(share):
            measured = f"at {broken} of {counted(len(share), 'node')} that were looked at, by up to {share.max():.0%}"
            doubt = "are these the nodes and directions of its rows? (Those of a reduced model do so.)"
            return [f"K resists a turn of the whole body {measured}: {doubt}"]
    return []
