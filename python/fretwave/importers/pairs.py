"""Contact pairs: node to node, node to the other side's faces where meshes do not match, or node to ground.

The relative displacement of a pair is u = R (x_a - x_b), R the frame (normal, tangent, tangent), the normal pointing
from the first body to the second: u_n > 0 closes the contact. A direction that is no dof (held) does not move. A node b
of the next sector moves by T x_b in the frame of this one, T the turn by 2 pi / N: B = {0: R S_a, 1: -R T S_b}.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from ..arrays import Array, IntArray
from ..errors import InputError
from ..fe.interface import tangent_frames
from ..model.pairs import Pairs
from ..model.sectors import Term
from ..texts import display
from .nodes import Nodes
from .projection import project
from .surfaces import Side, check_facing, normals_of, side_of
from .text import first_data_line, whole

#: Nodes of a pair are this close, over the diagonal of the mesh, unless told.
TOLERANCE = 1e-6
#: What is this many tolerances apart was not meant as a pair.
FAR = 1e3
#: The second set of pairs with ground.
GROUND = "GROUND"
#: What follows the second set when it is the next sector's.
NEXT = "@next"
#: Unmatched nodes that a message names.
SHOWN = 8


@dataclass(frozen=True)
class Found:
    """Nodes of pairs (n_pairs, 2), 0 for ground, the weights of the second side's nodes, and what is to be said.

    Attributes
    ----------
    others : (n_others,)
        Nodes of the second side.
    weights : (n_pairs, n_others)
    """

    both: IntArray
    others: IntArray
    weights: sp.csr_matrix
    note: str = ""


def reach_of(nodes: Nodes, tolerance: float | None) -> float:
    """Largest distance of two nodes of a pair [length]."""
    return TOLERANCE * float(np.linalg.norm(np.ptp(nodes.coordinates, axis=0))) if tolerance is None else tolerance


def match(
    name: str,
    nodes: Nodes,
    first: str,
    second: str,
    normal: Array | None,
    labels: IntArray,
    tolerance: float | None = None,
    tangent: Array | None = None,
    notes: list[str] | None = None,
    turn: Array | None = None,
) -> Pairs:
    """Pairs of two sides: coincident nodes, or the first's nodes on the second's faces; or of one side with ``GROUND``.

    ``SET@next`` is the next sector's side.

    Parameters
    ----------
    name : of the contact
    first, second : surfaces of element faces, or node sets
    normal : (3,), optional
        From the first body to the second; default: those of the first side's faces.
    labels : (n_dof, 2)
        Node and direction of each dof.
    tangent : (3,), optional
        The first tangent is this direction made orthogonal to the normal; default: the axis most across it.
    tolerance : float, optional
        Largest distance of two nodes of a pair, or of a node and the other side's faces; default 1e-6 of the mesh's
        diagonal.
    notes : what was done is added
    turn : (3, 3), optional
        Rotation from a sector to the next one.

    Raises
    ------
    InputError
        A node has no partner, or two nodes share one; sides are far apart or do not look at each other.
    """
    where = f"{nodes.where}, sets {first} and {second}"
    second, ahead = _without_next(second, turn, where)
    a = side_of(nodes, first)
    normals = normals_of(a, normal)
    if second.upper() == GROUND and GROUND not in nodes.sets:
        both = np.column_stack([a.numbers, np.zeros_like(a.numbers)])
        found = Found(both, a.numbers[:0], sp.csr_matrix((len(both), 0)))
    else:
        b, reach = side_of(nodes, second), reach_of(nodes, tolerance)
        if ahead is not None:
            _check_ahead(a, b, ahead, reach, where)
            b = replace(b, points=b.points @ ahead.T)
        found = _pair(a, b, normals, where, nodes, reach)
    if notes is not None and found.note:
        notes.append(f"contact '{name}': {found.note}")
    return _joined(name, found, normals, a.areas, where, labels, nodes, tangent, ahead)


def _without_next(second: str, turn: Array | None, where: str) -> tuple[str, Array | None]:
    """The second set's name, and the turn when it is the next sector's."""
    if not second.lower().endswith(NEXT):
        return second, None
    if turn is None:
        fix = "give --sectors, --low, --high and --axis"
        raise InputError("there is no next sector", where, None, "one sector of a wheel", fix)
    return second[: -len(NEXT)], turn


def _check_ahead(a: Side, b: Side, turn: Array, reach: float, where: str) -> None:
    """The first side does not lie where the second one is of the sector before (of two sectors also the next)."""
    if np.allclose(turn, turn.T) or cKDTree(b.points @ turn).query(a.points)[0].max() > reach:
        return
    measured = f"{len(a.numbers)} nodes at the second side of the sector before"
    first, second = (side.where.rpartition(" ")[2] for side in (a, b))
    fix = f"write {second} {first}{NEXT}"
    raise InputError("the sides are of the wrong sectors", where, measured, "the high end, then the next low end", fix)


def _pair(a: Side, b: Side, normals: Array, where: str, nodes: Nodes, reach: float) -> Found:
    """Coincident nodes where all have a partner, else the first side's nodes on the second's faces."""
    common = np.intersect1d(a.numbers, b.numbers)
    if len(common):
        measured = f"{len(common)} nodes, the first is {common[0]}"
        raise InputError("a node is in both sets", where, measured, "two nodes at one place", "split the mesh there")
    distance, partner = cKDTree(b.points).query(a.points)
    _check_near(a, b, distance, partner, where, reach)
    both = np.column_stack([a.numbers, b.numbers[partner]])
    check_facing(normals, b, partner)
    alone = [f"{n} ({d:.3g} away)" for n, d in zip(a.numbers[distance > reach], distance[distance > reach])]
    left = np.setdiff1d(np.arange(len(b.numbers)), partner[distance <= reach])
    if not alone and not len(left) and len(both) == len(b.numbers):
        weights = sp.csr_matrix((np.ones(len(both)), (np.arange(len(both)), partner)), shape=(len(both),) * 2)
        wide = distance.max() > reach_of(nodes, None)
        return Found(both, b.numbers, weights, f"its nodes are up to {distance.max():.2g} apart" if wide else "")
    if b.faces:
        return _projected(a, b, both, where, reach)
    distance_b = cKDTree(a.points).query(b.points[left])[0] if len(left) else []
    alone += [f"{n} ({d:.3g} away)" for n, d in zip(b.numbers[left], distance_b)]
    raise InputError(
        "nodes of the contact have no partner" if alone else "two nodes share one partner",
        where,
        f"{len(alone)} of {len(a.numbers)} + {len(b.numbers)} nodes: {_shown(alone)}"
        if alone
        else f"{len(a.numbers)} and {len(b.numbers)} nodes",
        f"one node of the other set within {reach:.3g}, or faces of elements under the second set",
        "mesh both sides alike, name surfaces of the deck, widen --tolerance, or give a CSV of pairs",
    )


def _projected(a: Side, b: Side, both: IntArray, where: str, reach: float) -> Found:
    weights, distance = project(a.points, b)
    beside = distance > reach
    if beside.any():
        named = [f"{n} ({d:.3g} away)" for n, d in zip(a.numbers[beside], distance[beside])]
        named = [text.replace("inf away", "beside all faces") for text in named]
        raise InputError(
            "nodes of the first side do not lie on the second's faces",
            where,
            f"{len(named)} of {len(a.numbers)} nodes: {_shown(named)}",
            f"each within {reach:.3g} of a face of {b.where}",
            "name first the side that lies on the other all over, or widen --tolerance",
        )
    faces = sum(len(table) for table in b.faces)
    note = f"meshes do not match: {len(both)} nodes on {faces} faces, at most {distance.max():.2g} away"
    return Found(both, b.numbers, weights, note)


def _shown(named: list[str]) -> str:
    return ", ".join(named[:SHOWN]) + (f" and {len(named) - SHOWN} more" if len(named) > SHOWN else "")


def _check_near(a: Side, b: Side, distance: Array, partner: IntArray, where: str, reach: float) -> None:
    """Two sides are not far apart as a whole: the nearest nodes, or the nearest node and face."""
    least = int(np.argmin(distance))
    closest, nearest = distance[least], f"nodes {a.numbers[least]} and {b.numbers[partner[least]]} are nearest"
    if closest > FAR * reach and b.faces:
        onto = project(a.points, b)[1]
        if onto.min() < closest:
            least = int(np.argmin(onto))
            closest, nearest = onto[least], f"node {a.numbers[least]} and a face are nearest"
    if closest > FAR * reach:
        measured = f"{nearest}, {closest:.3g} apart"
        fix = "check the names of the sets, or that both bodies are in one unit and place; else widen --tolerance"
        raise InputError("the two sides are far apart", where, measured, f"at most {reach:.3g}", fix)


def read_pairs(
    name: str,
    path: Path,
    labels: IntArray,
    nodes: Nodes | None = None,
    tangent: Array | None = None,
    tolerance: float | None = None,
) -> Pairs:
    """A CSV of ``node_a, node_b, nx, ny, nz, area``; node_b empty or 0 is ground, the area may be left out.

    Parameters
    ----------
    name, labels, tangent
        As `match`, the default tangent being the axis most across all normals.
    tolerance
        As `match`: nodes of a pair may be a thousand of it apart, for what a CSV pairs need not coincide.

    Raises
    ------
    InputError
        A line is no pair, or its nodes are far apart.
    """
    where = display(path)
    if not path.is_file():
        raise InputError("the file of pairs does not exist", where, fix="check the path; two names are two node sets")
    rows = []
    for number, line in enumerate(path.read_text(encoding="utf-8-sig").splitlines(), 1):
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
    both = whole(table[:, :2], where)
    _check_table(table, where)
    if nodes is not None:
        _check_apart(both, nodes, where, reach_of(nodes, tolerance))
    second = both[:, 1]
    weights = sp.diags((second != 0).astype(float)).tocsr()
    return _joined(name, Found(both, second, weights), table[:, 2:5], areas, where, labels, nodes, tangent)


def _check_table(table: Array, where: str) -> None:
    """Each pair (n, 6) stands once, is of two nodes, and has no area below zero."""
    repeated = np.ones(len(table), dtype=bool)
    repeated[np.unique(table[:, :5], axis=0, return_index=True)[1]] = False
    for wrong, what, expected in (
        (repeated, "a pair stands twice", "each pair once"),
        (table[:, 0] == table[:, 1], "a pair is of one node with itself", "two nodes, or 0 for ground"),
        (table[:, 5] < 0, "a pair has an area below zero", "zero or more"),
    ):
        if wrong.any():
            measured = f"pair {np.argmax(wrong) + 1} ({', '.join(f'{x:g}' for x in table[np.argmax(wrong)])})"
            raise InputError(what, where, f"{measured}, {wrong.sum()} such", expected, "correct the table")


def _check_apart(both: IntArray, nodes: Nodes, where: str, reach: float) -> None:
    """No pair of nodes is a thousand tolerances apart."""
    rows = np.flatnonzero(both[:, 1])
    xa, xb = (nodes.coordinates[nodes.places(both[rows, k])] for k in (0, 1))
    apart = np.linalg.norm(xa - xb, axis=1)
    if (apart > FAR * reach).any():
        worst = int(np.argmax(apart))
        a, b = both[rows[worst]]
        measured = f"nodes {a} and {b} are {apart[worst]:.3g} apart; {int((apart > FAR * reach).sum())} such"
        fix = f"check the node numbers, or give --tolerance {1.1 * apart[worst] / FAR:.2g} where they are meant"
        raise InputError("nodes of a pair are far apart", where, measured, f"at most {FAR * reach:.3g}", fix)


def _joined(
    name: str,
    found: Found,
    normals: Array,
    areas: Array | None,
    where: str,
    labels: IntArray,
    nodes: Nodes | None,
    tangent: Array | None,
    ahead: Array | None = None,
) -> Pairs:
    """B and the geometry of pairs, with normals of any length.

    Parameters
    ----------
    ahead : (3, 3), optional
        Turn to the next sector, where the second nodes are that one's.
    """
    n, both = len(found.both), found.both
    length = np.linalg.norm(normals, axis=1)
    if not n or not (length > 0).all():
        measured = "no pair" if not n else f"pair {int(np.argmin(length)) + 1} has the normal (0, 0, 0)"
        raise InputError(
            f"contact '{name}' has no pairs or no normals", where, measured, "a direction each", "correct the pairs"
        )
    normals = normals / length[:, None]
    axis = np.eye(3)[np.argmin(abs(normals).max(axis=0))] if tangent is None else tangent
    try:
        frames = tangent_frames(normals, axis.tolist())
    except InputError as error:
        place = f"contact '{name}', {where}"
        raise InputError(error.what, place, error.measured, error.expected, "give another --tangent") from None
    own = _selection(both[:, 0], labels)
    other = (sp.kron(found.weights, sp.identity(3)) @ _selection(found.others, labels)).tocsr()
    if nodes is not None:
        numbers = np.union1d(both[:, 0], found.others[found.others > 0]).tolist()
        nodes.constraints.check(name, numbers, labels, nodes.sets, where)
    _check_dofs(name, both, where, abs(own) + abs(other), labels)
    R = sp.block_diag(list(frames))
    B: Term = _stored(R @ (own - other))
    if ahead is not None:
        B = {0: _stored(R @ own), 1: _stored(-R @ sp.kron(sp.identity(n), ahead) @ other)}
    points = None if nodes is None else nodes.coordinates[nodes.places(both[:, 0])]
    return Pairs(B, areas=areas, points=points, frames=frames, nodes=both)


def _stored(B: sp.spmatrix) -> sp.csr_matrix:
    rows = sp.csr_matrix(B)
    rows.eliminate_zeros()
    return rows


def _selection(numbers: IntArray, labels: IntArray) -> sp.csr_matrix:
    """(3 n, n_dof): displacement of each node along x, y, z; zero where it is held or ground."""
    place = {(node, direction): dof for dof, (node, direction) in enumerate(labels.tolist())}
    wanted = [place.get((node, axis), -1) for node in numbers.tolist() for axis in (1, 2, 3)]
    columns = np.array(wanted, dtype=np.int64)
    rows = np.flatnonzero(columns >= 0)
    return sp.csr_matrix((np.ones(len(rows)), (rows, columns[rows])), shape=(len(wanted), len(labels)))


def _check_dofs(name: str, both: IntArray, where: str, reached: sp.csr_matrix, labels: IntArray) -> None:
    entries = np.diff(reached.indptr).reshape(-1, 3).sum(axis=1)
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
