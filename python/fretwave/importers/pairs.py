"""Contact pairs: node to node, node to the other side's faces where meshes do not match, or node to ground.

The relative displacement of a pair is u = R (x_a - x_b), R the frame (normal, tangent, tangent), the normal pointing
from the first body to the second: u_n > 0 closes the contact. A direction that is no dof (held) does not move. A node b
of the next sector moves by T x_b in the frame of this one, T the turn by 2 pi / N: B = {0: R S_a, 1: -R T S_b}.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from ..arrays import Array, IntArray
from ..errors import InputError
from ..fe.interface import tangent_frames
from ..model.pairs import Pairs
from ..model.sectors import Term
from ..texts import counted
from .nodes import Nodes
from .overlap import overlap
from .projection import project
from .surfaces import SHOWN, Side, check_facing, normals_of, side_of

#: Nodes of a pair are this close, over the diagonal of the mesh, unless told.
TOLERANCE = 1e-6
#: What is this many tolerances apart was not meant as a pair.
FAR = 1e3
#: The second set of pairs with ground.
GROUND = "GROUND"
#: What follows the second set when it is the next sector's.
NEXT = "@next"
#: Share of the first side's nodes that lie on the second's faces at least: else it is another side that was meant.
LEAST = 0.05


@dataclass(frozen=True)
class Found:
    """Nodes of pairs (n_pairs, 2), 0 for ground, the weights of the second side's nodes, and what is to be said.

    Attributes
    ----------
    others : (n_others,)
        Nodes of the second side.
    weights : (n_pairs, n_others)
    kept : of the first side's nodes, None for all
    areas : (n_pairs,), where they are not those of the first side's nodes
    """

    both: IntArray
    others: IntArray
    weights: sp.csr_matrix
    note: str = ""
    kept: IntArray | None = None
    areas: Array | None = None


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
        A node has no partner, two nodes share one, or hardly any lies on the other side; sides are far apart or do not
        look at each other.
    """
    where = f"{nodes.where}, sets {first} and {second}"
    second, ahead = _without_next(second, turn, where)
    a, reach = side_of(nodes, first), reach_of(nodes, tolerance)
    said = [a.note]
    if second.upper() == GROUND and GROUND not in nodes.sets:
        normals, both = normals_of(a, normal), np.column_stack([a.numbers, np.zeros_like(a.numbers)])
        found = Found(both, a.numbers[:0], sp.csr_matrix((len(both), 0)))
    else:
        b = _placed(a, side_of(nodes, second), turn, ahead, reach, where)
        said.append(b.note)
        normals = normals_of(a, normal)
        found = _pair(a, b, normals, where, nodes, reach)
    areas = a.areas if found.areas is None else found.areas
    normals = normals if found.kept is None else normals[found.kept]
    pairs = joined(name, found, normals, areas, where, labels, nodes, tangent, ahead)
    said.insert(0, found.note + _said(pairs.clearance))
    if notes is not None:
        notes += [f"contact '{name}': {note}" for note in said if note]
    return pairs


def _without_next(second: str, turn: Array | None, where: str) -> tuple[str, Array | None]:
    """The second set's name, and the turn when it is the next sector's."""
    if not second.lower().endswith(NEXT):
        return second, None
    if turn is None:
        fix = "give --sectors, --low, --high and --axis"
        raise InputError("there is no next sector", where, None, "one sector of a wheel", fix)
    return second[: -len(NEXT)], turn


def _placed(a: Side, b: Side, turn: Array | None, ahead: Array | None, reach: float, where: str) -> Side:
    """The second side where it is, or as the next sector's."""
    if ahead is not None:
        _check_ahead(a, b, ahead, reach, where)
        return replace(b, points=b.points @ ahead.T)
    if turn is not None:
        _check_here(a, b, turn, reach, where)
    return b


def _check_ahead(a: Side, b: Side, turn: Array, reach: float, where: str) -> None:
    """The first side does not lie where the second one is of the sector before (of two sectors also the next)."""
    if np.allclose(turn, turn.T) or cKDTree(b.points @ turn).query(a.points)[0].max() > reach:
        return
    measured = f"{len(a.numbers)} nodes at the second side of the sector before"
    fix = f"write {b.name} {a.name}{NEXT}"
    raise InputError("the sides are of the wrong sectors", where, measured, "the high end, then the next low end", fix)


def _check_here(a: Side, b: Side, turn: Array, reach: float, where: str) -> None:
    """Two sides of one sector that are far apart are not those that meet where one is turned to the next sector."""
    apart = _apart(a, b)
    for first, second in ((a, b), (b, a)) if apart > FAR * reach else ():
        moved = _apart(first, replace(second, points=second.points @ turn.T))
        if moved <= reach:
            measured = f"{apart:.3g} apart, and {moved:.2g} with {second.name} turned to the next sector"
            fix = f"write {first.name} {second.name}{NEXT}"
            raise InputError("the sides meet across the boundary", where, measured, f"{NEXT} for the next one's", fix)


def _apart(a: Side, b: Side) -> float:
    """Distance of the nearest nodes, or of the nearest node and face."""
    nodes = float(cKDTree(b.points).query(a.points)[0].min())
    return min(nodes, float(project(a.points, b)[1].min())) if b.faces else nodes


def _pair(a: Side, b: Side, normals: Array, where: str, nodes: Nodes, reach: float) -> Found:
    """Coincident nodes where all have a partner, else the first side's nodes on the second's faces."""
    common = np.intersect1d(a.numbers, b.numbers)
    if len(common):
        measured = f"{len(common)} nodes, the first is {common[0]}"
        raise InputError("a node is in both sets", where, measured, "two nodes at one place", "split the mesh there")
    distance, partner = cKDTree(b.points).query(a.points)
    _check_near(a, b, distance, partner, where, reach)
    both = np.column_stack([a.numbers, b.numbers[partner]])
    alone = [f"{n} ({d:.3g} away)" for n, d in zip(a.numbers[distance > reach], distance[distance > reach])]
    left = np.setdiff1d(np.arange(len(b.numbers)), partner[distance <= reach])
    if not alone and not len(left) and len(both) == len(b.numbers):
        weights = sp.csr_matrix((np.ones(len(both)), (np.arange(len(both)), partner)), shape=(len(both),) * 2)
        check_facing(normals, b, partner)
        usual = reach_of(nodes, None)
        note = f"its nodes are up to {distance.max():.2g} apart" if distance.max() > usual else ""
        return Found(both, b.numbers, weights, note)
    if b.faces:
        return _projected(a, b, both, (normals, partner), where, reach)
    distance_b = cKDTree(a.points).query(b.points[left])[0] if len(left) else []
    alone += [f"{n} ({d:.3g} away)" for n, d in zip(b.numbers[left], distance_b)]
    raise InputError(
        "nodes of the contact have no partner" if alone else "two nodes share one partner",
        where,
        f"{len(alone)} of {len(a.numbers)} + {len(b.numbers)} nodes: {listed(alone)}"
        if alone
        else f"{len(a.numbers)} and {len(b.numbers)} nodes",
        f"one node of the other set within {reach:.3g}, or faces of elements under the second set",
        "mesh both sides alike, name surfaces of the deck, widen --tolerance, or give a CSV of pairs",
    )


def _clearance(found: Found, normals: Array, nodes: Nodes, ahead: Array | None) -> Array | None:
    """How far the second side of each pair stands off along the unit normal, None where all touch."""
    with_body, there = found.both[:, 1] > 0, found.others > 0
    second = np.zeros((len(found.others), 3))
    second[there] = nodes.coordinates[nodes.places(found.others[there])]
    if ahead is not None:
        second = second @ ahead.T
    way = found.weights @ second - nodes.coordinates[nodes.places(found.both[:, 0])]
    along = np.where(with_body, np.einsum("nx,nx->n", normals, way), 0.0)
    return along if abs(along).max(initial=0.0) > reach_of(nodes, None) else None


def _said(clearance: Array | None) -> str:
    """That pairs which stand off touch all the same."""
    if clearance is None:
        return ""
    which = f"along the normals {clearance.min():.3g} to {clearance.max():.3g} (below zero they overlap)"
    return f"; {which}: the pairs touch all the same, unless the contact in the case has a `gap`"


def _projected(a: Side, b: Side, both: IntArray, looks: tuple[Array, IntArray], where: str, reach: float) -> Found:
    """The first side's nodes on the second's faces; where the sides overlap in part those that lie on them.

    Parameters
    ----------
    looks : normals (n, 3) of the first side, and the nearest node of the second
    """
    weights, distance = project(a.points, b)
    near = np.isfinite(distance)
    chosen = near if near.any() else slice(None)
    check_facing(looks[0][chosen], b, looks[1][chosen])
    _check_on(a, b, distance, where, reach)
    faces = sum(len(table) for table in b.faces)
    note = f"meshes do not match: {near.sum()} nodes on {faces} faces, at most {distance[near].max():.2g} away"
    if near.all():
        return Found(both, b.numbers, weights, note)
    areas = None if not a.faces else overlap(a, b, near, where)[near]
    note += f"; {(~near).sum()} of {counted(len(near), 'node')} lie beside them and are left out"
    note += "" if areas is None else f", the overlap is {areas.sum():.6g}"
    return Found(both[near], b.numbers, weights[near], note, np.flatnonzero(near), areas)


def _check_on(a: Side, b: Side, distance: Array, where: str, reach: float) -> None:
    """No node is off the faces that it lies over, and more than a few lie over some."""
    off, beside = np.isfinite(distance) & (distance > reach), np.isinf(distance)
    few = np.isfinite(distance).sum() < LEAST * len(distance)
    if off.any() or few:
        wrong = off | beside if few else off
        named = [f"{n} ({d:.3g} away)" for n, d in zip(a.numbers[wrong], distance[wrong])]
        named = [text.replace("inf away", "beside all faces") for text in named]
        raise InputError(
            "nodes of the first side do not lie on the second's faces",
            where,
            f"{len(named)} of {len(a.numbers)} nodes: {listed(named)}",
            f"each within {reach:.3g} of a face of {b.where}"
            + (f", or beside them; {LEAST:.0%} on them" if few else ""),
            "name first the side that lies on the other all over" if few else "widen --tolerance, or check the sets",
        )


def listed(named: list[str]) -> str:
    """The first of them, and how many more there are."""
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
        if a.faces and project(b.points, a)[1].min() <= reach:
            fix = f"write {b.name} first: its nodes lie on the faces of {a.name}, between the nodes"
        raise InputError("the two sides are far apart", where, measured, f"at most {reach:.3g}", fix)


def joined(
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
    clearance = None if nodes is None else _clearance(found, normals, nodes, ahead)
    return Pairs(B, areas=areas, points=points, frames=frames, nodes=both, clearance=clearance)


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
