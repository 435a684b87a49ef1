"""Where strain gauges are on the solids of a model: at a node, or at a point in a cell."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp

from ..arrays import Indices
from ..fe.solids import MODES, PLACES
from ..fe.strain import Solids, cells_around, interpolation
from ..model.structure import Structure
from .reporter import Reporter
from .schema import GaugeSection

#: Nodes of hexahedra by their kind.
_HEXAHEDRA = {len(places): kind for kind, places in PLACES.items() if kind.endswith("hexahedron")} | {11: MODES}


def weights_of(gauges: Sequence[GaugeSection], structure: Structure) -> sp.csr_matrix:
    """Of the nodes at each gauge (n_gauges, n_nodes)."""
    solids = solids_of(structure)
    rows = [_weights(gauge, structure, solids) for gauge in gauges]
    none = sp.csr_matrix((0, len(np.asarray(structure.coordinates))))
    return sp.csr_matrix(sp.vstack([none, *(row for row in rows if row is not None)], format="csr"))


def check_place(report: Reporter, gauge: GaugeSection, structure: Structure) -> None:
    """Refuse a gauge that is on no solid."""
    solids, key = solids_of(structure), "point" if gauge.node is None else "node"
    if structure.coordinates is None or not solids:
        fix = "give the builder's Structure its cells, or import with the input deck (--coordinates model.inp)"
        report.wrong((key,), "is on no solid: the model has no solid cells", "nodes and solid cells", fix)
        return
    if _weights(gauge, structure, solids) is not None:
        return
    numbers, around = node_numbers(structure), cells_around(len(structure.coordinates), solids) > 0
    numbers, nodes = numbers[around], np.asarray(structure.coordinates)[around]
    place = np.asarray(gauge.point if gauge.node is None else [0.0, 0.0, 0.0])
    off = np.linalg.norm(nodes - place, axis=1) if gauge.node is None else abs(numbers - gauge.node)
    near = int(numbers[np.argmin(off)])
    if gauge.node is None:
        report.wrong(
            (key,),
            f"lies beside all solid cells, {off.min():.4g} off the nearest node",
            "a point on a solid, in the model's units",
            f"`node = {near}`, or correct the point",
        )
    else:
        expected = f"one of {len(numbers)} nodes of solid cells, {numbers.min()} to {numbers.max()}"
        report.wrong((key,), "is no node of a solid cell", expected, f"the nearest number is `node = {near}`")


def solids_of(structure: Structure) -> Solids:
    """Nodes of the solid cells (n_cells, n_nodes_of_a_cell) by kind; shells are none."""
    found: dict[str, Indices] = {kind: np.asarray(c) for kind, c in structure.cells.items() if kind in PLACES}
    if structure.hexahedra is not None:
        cells = np.asarray(structure.hexahedra)
        kind = _HEXAHEDRA[cells.shape[1]]
        found[kind] = np.vstack([cells, found[kind]]) if kind in found else cells
    return {kind: cells for kind, cells in found.items() if len(cells)}


def row_of_node(structure: Structure, number: int) -> int | None:
    """Place of a node among the coordinates; None where there is no such node."""
    found = np.flatnonzero(node_numbers(structure) == number)
    return int(found[0]) if len(found) else None


def node_numbers(structure: Structure) -> Indices:
    """(n_nodes,) in the mesh's own numbers, else counted from 0."""
    count = 0 if structure.coordinates is None else len(structure.coordinates)
    return np.arange(count) if structure.node_numbers is None else np.asarray(structure.node_numbers)


def _weights(gauge: GaugeSection, structure: Structure, solids: Solids) -> sp.csr_matrix | None:
    """Of the nodes (1, n_nodes) at a gauge; None where no solid is."""
    nodes = np.asarray(structure.coordinates)
    if gauge.point is not None:
        return interpolation(nodes, solids, np.asarray(gauge.point))
    row = row_of_node(structure, gauge.node if gauge.node is not None else -1)
    if row is None or not cells_around(len(nodes), solids)[row]:
        return None
    return sp.csr_matrix(([1.0], ([0], [row])), shape=(1, len(nodes)))
