"""Whether the normals of pairs point out of the first body, told by what K joins: it needs no elements.

What lies behind a node of the contact are the nodes that K joins it to and that are not in the contact.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from ..arrays import Array, IntArray
from ..errors import InputError
from ..model.pairs import Pairs
from ..model.structure import Structure

#: Mean cosine of normal and way out of the body below which the normal points into it: a right one has 0.5 and more.
INTO = -0.2
#: Cosine of a single pair below which its sign is in doubt: at a corner, or on a thin plate, it is 0 and more.
SINGLE = -0.5
#: Below which, and across which to the nodes' own plane, it lies along the face.
ALONG, ACROSS = 0.3, 0.5
#: Thickness of a plane set of nodes, and width of what is no line, over its length.
THIN, WIDE = 1e-3, 1e-3


def check_directions(model: Structure) -> list[str]:
    """The normals of all contacts point out of their first bodies; a warning where those of single pairs do not.

    Raises
    ------
    InputError
        They point into it, or lie along a plane face.
    """
    if model.labels is None or model.coordinates is None or model.node_numbers is None:
        return []
    known = {name: pairs for name, pairs in model.pairs.items() if pairs.nodes is not None and pairs.frames is not None}
    return [said for name, pairs in known.items() if (said := _check(name, pairs, model, model.labels))]


def _check(name: str, pairs: Pairs, model: Structure, labels: IntArray) -> str:
    numbers, normals = np.asarray(pairs.nodes)[:, 0], np.asarray(pairs.frames)[:, 0]
    outwards = _ways_out(model, labels, numbers)
    known = np.isfinite(outwards).all(axis=1)
    if not known.any():
        return ""
    cosines = np.einsum("nx,nx->n", normals, outwards)
    cosine = float(cosines[known].mean())
    angle = f"{np.degrees(np.arccos(np.clip(cosine, -1, 1))):.3g} degrees from the way out of the body, in the mean"
    if cosine < INTO:
        what, fix = "points into the first body", "turn it round, or give the two sets in the other order"
    elif cosine < ALONG and _along(normals, np.asarray(pairs.points)):
        what, fix = "lies along the face", "give the direction across the face"
    else:
        return _single(name, numbers, cosines)
    raise InputError(f"the normal {what}", f"contact '{name}'", angle, "less than 90 degrees", fix)


def _single(name: str, numbers: IntArray, cosines: Array) -> str:
    """Of a table's pairs some may have another sign than the rest; NaN is not known."""
    into = np.flatnonzero(cosines < SINGLE)
    if not len(into):
        return ""
    pair, angle = int(into[0]), np.degrees(np.arccos(max(cosines[into[0]], -1.0)))
    which = f"the first is pair {pair + 1} (node {numbers[pair]}), {angle:.3g} degrees from the way out of it"
    return f"contact '{name}': {len(into)} of {len(numbers)} normals point into the first body, {which}: a wrong sign?"


def _ways_out(model: Structure, labels: IntArray, numbers: IntArray) -> Array:
    """Unit vectors (n, 3) from the nodes that K joins to each node, those of the contact left out; NaN without any."""
    assert model.coordinates is not None and model.node_numbers is not None
    order = np.argsort(model.node_numbers)
    found = order[np.clip(np.searchsorted(model.node_numbers[order], labels[:, 0]), 0, len(order) - 1)]
    meshed = model.node_numbers[found] == labels[:, 0]
    dofs = np.flatnonzero(meshed & ~np.isin(labels[:, 0], numbers))
    behind = sp.csr_matrix((np.ones(len(dofs)), (dofs, found[dofs])), shape=(model.n_dof, len(order)))
    own, place = np.unique(numbers, return_inverse=True)
    mine = np.flatnonzero(np.isin(labels[:, 0], own))
    row = np.searchsorted(own, labels[mine, 0])
    rows = sp.csr_matrix((np.ones(len(mine)), (row, mine)), shape=(len(own), model.n_dof))
    joined = (rows @ abs(sp.csr_matrix(model.K)) @ behind).sign()
    count = np.asarray(joined.sum(axis=1)).ravel()
    places = model.coordinates[order[np.searchsorted(model.node_numbers[order], own)]]
    with np.errstate(invalid="ignore", divide="ignore"):
        away = places - (joined @ model.coordinates) / count[:, None]
        return np.asarray((away / np.linalg.norm(away, axis=1)[:, None])[place.ravel()])


def _along(normals: Array, points: Array) -> bool:
    """The nodes span a plane in which the normals lie."""
    _, size, axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
    plane = len(points) > 2 and size[2] < THIN * size[0] and size[1] > WIDE * size[0]
    return bool(plane and abs(normals @ axes[2]).mean() < ACROSS)
