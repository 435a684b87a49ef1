"""Contact pairs of matching meshes: node to node, or node to ground.

The relative displacement of a pair is u = R (x_a - x_b), R the frame (normal, tangent, tangent), the normal pointing
from the first body to the second: u_n > 0 closes the contact. A direction that is no dof (held) does not move.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from ..arrays import Array, IntArray
from ..errors import InputError
from ..fe.interface import tangent_frames
from ..model.pairs import Pairs
from ..texts import display
from .nodes import Nodes
from .text import first_data_line

#: Nodes of a pair are this close, over the diagonal of the mesh, unless told.
TOLERANCE = 1e-6
#: The second set of pairs with ground.
GROUND = "GROUND"
#: Unmatched nodes that a message names.
SHOWN = 8


def match(
    name: str,
    nodes: Nodes,
    first: str,
    second: str,
    normal: Array | None,
    labels: IntArray,
    tolerance: float | None = None,
    tangent: Array | None = None,
) -> Pairs:
    """Pairs of coincident nodes of two sets, or of one set with ``GROUND``.

    Parameters
    ----------
    name : of the contact
    normal : (3,)
        From the first body to the second.
    labels : (n_dof, 2)
        Node and direction of each dof.
    tangent : (3,), optional
        The first tangent is this direction made orthogonal to the normal; default: the axis most across it.
    tolerance : float, optional
        Largest distance of two nodes of a pair; default 1e-6 of the mesh's diagonal.

    Raises
    ------
    InputError
        A node has no partner, or two nodes share one.
    """
    where = f"{nodes.where}, sets {first} and {second}"
    if normal is None:
        fix = "give --normal X,Y,Z, from the first body to the second, or a CSV of pairs with normals"
        raise InputError("the pairs have no normal", where, None, "a direction", fix)
    if second.upper() == GROUND and GROUND not in nodes.sets:
        a = nodes.node_set(first)
        grounded = np.column_stack([a, np.zeros_like(a)])
        return _joined(name, grounded, np.broadcast_to(normal, (len(a), 3)), None, where, labels, nodes, tangent)
    a, b = nodes.node_set(first), nodes.node_set(second)
    both = np.intersect1d(a, b)
    if len(both):
        measured = f"{len(both)} nodes, the first is {both[0]}"
        raise InputError("a node is in both sets", where, measured, "two nodes at one place", "split the mesh there")
    xa, xb = (nodes.coordinates[nodes.places(numbers)] for numbers in (a, b))
    reach = TOLERANCE * float(np.linalg.norm(np.ptp(nodes.coordinates, axis=0))) if tolerance is None else tolerance
    distance, partner = cKDTree(xb).query(xa)
    alone = [f"{n} ({d:.3g} away)" for n, d in zip(a[distance > reach], distance[distance > reach])]
    left = np.setdiff1d(np.arange(len(b)), partner[distance <= reach])
    distance_b = cKDTree(xa).query(xb[left])[0] if len(left) else []
    alone += [f"{n} ({d:.3g} away)" for n, d in zip(b[left], distance_b)]
    if alone or len(np.unique(partner)) != len(a):
        shown = ", ".join(alone[:SHOWN]) + (f" and {len(alone) - SHOWN} more" if len(alone) > SHOWN else "")
        raise InputError(
            "nodes of the contact have no partner" if alone else "two nodes share one partner",
            where,
            f"{len(alone)} of {len(a)} + {len(b)} nodes: {shown}" if alone else f"{len(a)} and {len(b)} nodes",
            f"one node of the other set within {reach:.3g}",
            "mesh both sides alike, widen --tolerance, or give a CSV of pairs",
        )
    both = np.column_stack([a, b[partner]])
    return _joined(name, both, np.broadcast_to(normal, (len(a), 3)), None, where, labels, nodes, tangent)


def read_pairs(
    name: str, path: Path, labels: IntArray, nodes: Nodes | None = None, tangent: Array | None = None
) -> Pairs:
    """A CSV of ``node_a, node_b, nx, ny, nz, area``; node_b empty or 0 is ground, the area may be left out.

    Parameters
    ----------
    name, labels, tangent
        As `match`, the default tangent being the axis most across all normals.
    """
    where = display(path)
    if not path.is_file():
        raise InputError("the file of pairs does not exist", where, fix="check the path; two names are two node sets")
    rows = []
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        if not first_data_line(line.encode()) or line.lower().lstrip().startswith("node"):
            continue  # blank, comment or heading
        words = [word.strip() for word in line.split(",")]
        try:
            rows.append([float(word or 0) for word in words] + [np.nan] * (6 - len(words)))
            if len(words) not in (5, 6) or not words[0]:
                raise ValueError
        except ValueError:
            expected = "node_a, node_b, nx, ny, nz, area"
            raise InputError("this is no pair", f"{where}:{number}", line, expected, "correct the line") from None
    table = np.array(rows, dtype=float).reshape(-1, 6)
    areas = None if np.isnan(table[:, 5]).any() else table[:, 5]
    return _joined(name, table[:, :2].astype(np.int64), table[:, 2:5], areas, where, labels, nodes, tangent)


def _joined(
    name: str,
    both: IntArray,
    normals: Array,
    areas: Array | None,
    where: str,
    labels: IntArray,
    nodes: Nodes | None,
    tangent: Array | None,
) -> Pairs:
    """B and the geometry of pairs of nodes (n_pairs, 2), 0 for ground, with normals of any length."""
    n = len(both)
    length = np.linalg.norm(normals, axis=1)
    if not n or not (length > 0).all():
        measured = "no pair" if not n else f"pair {int(np.argmin(length)) + 1} has the normal (0, 0, 0)"
        raise InputError(f"contact '{name}' has no pairs or no normals", where, measured, "a direction each")
    normals = normals / length[:, None]
    axis = np.eye(3)[np.argmin(abs(normals).max(axis=0))] if tangent is None else tangent
    try:
        frames = tangent_frames(normals, axis.tolist())
    except InputError as error:
        place = f"contact '{name}', {where}"
        raise InputError(error.what, place, error.measured, error.expected, "give another --tangent") from None
    difference = (_selection(both[:, 0], labels) - _selection(both[:, 1], labels)).tocsr()
    _check_dofs(name, both, where, difference, labels)
    B = (sp.block_diag(list(frames)) @ difference).tocsr()
    B.eliminate_zeros()
    points = None if nodes is None else nodes.coordinates[nodes.places(both[:, 0])]
    return Pairs(B, areas=areas, points=points, frames=frames, nodes=both)


def _selection(numbers: IntArray, labels: IntArray) -> sp.csr_matrix:
    """(3 n, n_dof): displacement of each node along x, y, z; zero where it is held or ground."""
    place = {(node, direction): dof for dof, (node, direction) in enumerate(labels.tolist())}
    wanted = [place.get((node, axis), -1) for node in numbers.tolist() for axis in (1, 2, 3)]
    columns = np.array(wanted, dtype=np.int64)
    rows = np.flatnonzero(columns >= 0)
    return sp.csr_matrix((np.ones(len(rows)), (rows, columns[rows])), shape=(len(wanted), len(labels)))


def _check_dofs(name: str, both: IntArray, where: str, difference: sp.csr_matrix, labels: IntArray) -> None:
    entries = np.diff(difference.indptr).reshape(-1, 3).sum(axis=1)
    dead = np.flatnonzero(entries == 0)
    if len(dead):
        a, b = both[dead[0]]
        raise InputError(
            f"a pair of contact '{name}' cannot move",
            where,
            f"nodes {a} and {b or 'ground'} have no dof among the {len(labels)} of the matrices; {len(dead)} such",
            "a free dof on one side at least",
            "check the node numbers; nodes that are held are no rows of the matrices",
        )
