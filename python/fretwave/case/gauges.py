"""``[material]`` and ``[[gauge]]``: what `fretwave stress` makes of the motion of a run; no result depends on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from ..arrays import Array, Indices
from ..errors import CaseErrors, FretwaveError
from ..fe.solids import MODES, PLACES
from ..fe.strain import Solids, cells_around, interpolation
from ..model.structure import Structure
from .odd_material import odd_material
from .reporter import Reporter
from .schema import GaugeSection, MaterialSection
from .toml.source import Source
from .toml.validation import validate

#: Nodes of hexahedra by their kind.
_HEXAHEDRA = {len(places): kind for kind, places in PLACES.items() if kind.endswith("hexahedron")} | {11: MODES}
#: Keys of [material] that are given together.
_TOGETHER = (("youngs_modulus", "poisson_ratio"), ("endurance_limit", "ultimate_strength"))


@dataclass(frozen=True)
class Gauges:
    """The tables of a case.

    Attributes
    ----------
    material : empty where the case has none
    gauges : in the order of the case
    """

    material: MaterialSection
    gauges: Sequence[GaugeSection] = ()

    @property
    def elastic(self) -> tuple[float, float] | None:
        """Young's modulus [pressure] and Poisson's ratio; None where they are not known."""
        E, nu = self.material.youngs_modulus, self.material.poisson_ratio
        return None if E is None or nu is None else (E, nu)

    @property
    def limits(self) -> tuple[float, float] | None:
        """Endurance limit and ultimate strength [pressure]; None where they are not known."""
        endurance, ultimate = self.material.endurance_limit, self.material.ultimate_strength
        return None if endurance is None or ultimate is None else (endurance, ultimate)

    @property
    def directions(self) -> Array:
        """(n_gauges, 3) unit vectors."""
        given = np.array([gauge.direction for gauge in self.gauges]).reshape(-1, 3)
        return np.asarray(given / np.linalg.norm(given, axis=1, keepdims=True))

    def weights(self, structure: Structure) -> sp.csr_matrix:
        """Of the nodes at each gauge (n_gauges, n_nodes)."""
        solids = solids_of(structure)
        rows = [_weights(gauge, structure, solids) for gauge in self.gauges]
        none = sp.csr_matrix((0, len(np.asarray(structure.coordinates))))
        return sp.csr_matrix(sp.vstack([none, *(row for row in rows if row is not None)], format="csr"))

    def lines(self) -> list[str]:
        """For `fretwave check`."""
        return [f"gauge '{gauge.name}': {_place(gauge)} along {_vector(gauge.direction)}" for gauge in self.gauges]


def gauges_now(source: Source, structure: Structure) -> Gauges:
    """Of a case file as it is now, on the model of a run.

    Raises
    ------
    CaseErrors
        The tables are wrong, or the material is no solid's.
    """
    found: list[FretwaveError] = []
    gauges = read_gauges(source, structure, found)
    found += odd_material(gauges.material, source, structure)
    if found:
        raise CaseErrors(found, source.label)
    return gauges


def read_gauges(source: Source, structure: Structure | None, found: list[FretwaveError]) -> Gauges:
    """Both tables, checked; what is wrong is appended.

    Parameters
    ----------
    structure : of a sector as it was before its faces were tied; None where it could not be read
    """
    material = validate(MaterialSection, source, ("material",), found) if "material" in source.data else None
    sections = [validate(GaugeSection, source, ("gauge", k), found) for k in range(len(source.entries("gauge")))]
    if material is not None:
        _check_material(Reporter(source, ("material",), found), material)
    for k, gauge in enumerate(sections):
        if gauge is not None:
            _check_gauge(Reporter(source, ("gauge", k), found), gauge, structure)
    return Gauges(material or MaterialSection(), [gauge for gauge in sections if gauge is not None])


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


def _check_material(report: Reporter, material: MaterialSection) -> None:
    for pair in _TOGETHER:
        for one, other in (pair, pair[::-1]):
            if getattr(material, one) is not None and getattr(material, other) is None:
                report.wrong((one,), f"is given without {other}", "both or none", f"add `{other}`, or remove {one}")
    if material.endurance_limit is not None and material.youngs_modulus is None:
        fix = "add `youngs_modulus` and `poisson_ratio`"
        report.wrong(("endurance_limit",), "is a limit of a stress that is not known", "the elastic constants", fix)


def _check_gauge(report: Reporter, gauge: GaugeSection, structure: Structure | None) -> None:
    if (gauge.node is None) == (gauge.point is None):
        report.wrong((), "has no place, or two", "`node` or `point`", "give one of them")
    elif structure is not None:
        _check_place(report, gauge, structure)
    if not np.linalg.norm(gauge.direction) > 0 or not np.isfinite(gauge.direction).all():
        report.wrong(("direction",), "is none", "a vector of some length", "write for example `[1.0, 0.0, 0.0]`")
    sectors = max(structure.sectors, 1) if structure is not None else gauge.sector + 1
    if gauge.sector >= sectors:
        report.wrong(("sector",), "is none of the model", f"0 to {sectors - 1}", "correct the key, or remove it")


def _check_place(report: Reporter, gauge: GaugeSection, structure: Structure) -> None:
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


def _weights(gauge: GaugeSection, structure: Structure, solids: Solids) -> sp.csr_matrix | None:
    """Of the nodes (1, n_nodes) at a gauge; None where no solid is."""
    nodes = np.asarray(structure.coordinates)
    if gauge.point is not None:
        return interpolation(nodes, solids, np.asarray(gauge.point))
    row = row_of_node(structure, gauge.node if gauge.node is not None else -1)
    if row is None or not cells_around(len(nodes), solids)[row]:
        return None
    return sp.csr_matrix(([1.0], ([0], [row])), shape=(1, len(nodes)))


def _place(gauge: GaugeSection) -> str:
    where = f"node {gauge.node}" if gauge.point is None else f"point {_vector(gauge.point)}"
    return where + (f" of sector {gauge.sector}" if gauge.sector else "")


def _vector(values: Sequence[float]) -> str:
    return "(" + ", ".join(f"{x:g}" for x in values) + ")"
