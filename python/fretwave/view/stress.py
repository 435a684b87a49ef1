"""Strain of gauges and the worst stress of a solid at every point of a branch, and where Goodman's limit is reached.

The motion of the nodes is that of ``fretwave view``: through the basis of the reduction, of the builder, and of a
sector's wave, all harmonics. Nothing is solved. What loads at rest displace is in harmonic 0, and so in the mean
stress; stress that the case's loads do not make (of assembly, of heat) is in neither.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Array
from ..case.gauge_places import node_numbers, solids_of, weights_of
from ..case.gauges import Gauges, gauges_now
from ..case.kept import reload_case
from ..case.load import Case
from ..case.toml.source import Source
from ..columns import COLUMNS, Column
from ..errors import InputError
from ..fe.strain import StrainRows, along, nodal_strain, stress_of
from ..model.structure import Structure
from ..post.fatigue import EQUAL, goodman, mean_stress, stress_amplitude, swing
from ..post.largest import largest
from ..results.parts import PARTS
from ..results.results import open_results
from ..texts import display
from .agreement import WARNING, Own
from .choice import Choice, analyses_that_move, analysis_name, at_point, read_choice
from .geometry import geometry
from .inner_nodes import with_inner_nodes
from .motion import Scene, scene_of
from .options import ViewOptions
from .places import of_linear_modes
from .run import learn_kept_laws

if TYPE_CHECKING:
    import h5py

#: Columns of the branch that lead a row, where it has them.
LEAD = ("point", *PARTS, "cycles", "amplitude", "largest_amplitude", "frequency_hz")
NODE = Column("worst_node", "1", "node of the largest Goodman factor, or of the largest stress amplitude", "i")
SECTOR = Column("worst_sector", "1", "sector that it is in", "i")
STRESS = (
    Column("stress_amplitude", "pressure", "largest von Mises stress there about the mean, over the period"),
    Column("mean_stress", "pressure", "von Mises stress of the mean there, with the sign of its trace, of shear +"),
)
#: In the row of the largest stress, where there is any: what `agreement` warns of.
DOUBT = Column("warning", "", "why the stress is not that of the model's stiffness", "s")
#: Of a mistuned wheel.
DEVIATES = (
    "note: stress has the modulus of [material] in every sector: where a sector's stiffness deviates by its modulus,"
    " its stress is off by as much"
)
GOODMAN = Column("goodman", "1", "Goodman's factor there: amplitude / endurance limit + mean / ultimate strength")


@dataclass(frozen=True)
class StressTable:
    """Of one analysis: a row for each point, and notes on what they lack and whether the stress is the model's own."""

    name: str
    columns: list[Column]
    rows: list[dict[str, Any]]
    notes: Sequence[str] = ()

    def __getitem__(self, column: str) -> Array:
        """(n_points,)"""
        return np.array([row[column] for row in self.rows])

    def __contains__(self, column: object) -> bool:
        return any(one.name == column for one in self.columns)


@dataclass(frozen=True)
class Reader:
    """Strain and stress from the motion of a part's nodes.

    Attributes
    ----------
    structure : the model with the inner nodes of its cells
    own : the model's stiffness, to compare; None where the material is not known
    strain : of all nodes
    at_gauges : of the gauges
    """

    gauges: Gauges
    structure: Structure
    own: Own | None
    strain: StrainRows
    at_gauges: StrainRows

    @classmethod
    def of(cls, gauges: Gauges, case: Case) -> Reader:
        """Of a model with solid cells."""
        meshed = geometry(case)
        structure = with_inner_nodes(meshed, display(case.path))
        own = Own.of(case, structure, gauges.elastic) if gauges.elastic else None
        strain = nodal_strain(np.asarray(structure.coordinates), solids_of(structure))
        weights = weights_of(gauges.gauges, meshed)
        weights.resize(len(gauges.gauges), strain.gradient.shape[1])
        return cls(gauges, structure, own, strain, strain.mean(weights))

    def strains(self, labels: Sequence[str], motion: Array) -> Iterator[dict[str, float]]:
        """Amplitude and mean of each gauge, by the names of its columns, from (n_nodes, 3, m) [length]."""
        if self.gauges.gauges:
            read = swing(labels, along(self.at_gauges(motion), self.gauges.directions))
            for gauge, amplitude, mean in zip(self.gauges.gauges, *read):
                yield {f"{gauge.name}_strain": float(amplitude), f"{gauge.name}_mean": float(mean)}

    def worst(self, labels: Sequence[str], motion: Array) -> dict[str, Any]:
        """Stress at the node that is worst; nothing where the material is not known."""
        if self.gauges.elastic is None:
            return {}
        stress = stress_of(self.strain(motion), *self.gauges.elastic)
        amplitude, mean = stress_amplitude(labels, stress), mean_stress(labels, stress)
        factor = None if self.gauges.limits is None else goodman(amplitude, mean, *self.gauges.limits)
        k = largest(amplitude if factor is None else factor, EQUAL)
        found = {
            "worst_node": int(node_numbers(self.structure)[k]),
            "stress_amplitude": amplitude[k],
            "mean_stress": mean[k],
        }
        return found if factor is None else {**found, "goodman": factor[k]}

    def columns(self, wheel: bool) -> Iterator[Column]:
        """Of what it reads."""
        for gauge in self.gauges.gauges:
            yield Column(
                f"{gauge.name}_strain", "1", f"gauge {gauge.name}: half the range of its strain over the period"
            )
            yield Column(f"{gauge.name}_mean", "1", f"gauge {gauge.name}: mean of its strain over the period")
        if self.gauges.elastic is not None:
            yield from (NODE, *([SECTOR] if wheel else []), *STRESS)
            yield from [] if self.gauges.limits is None else [GOODMAN]


def stress_tables(folder: Path, asked: str | None = None) -> Iterator[StressTable]:
    """Of an analysis, or of all that keep their motion, in the order of the case. One rank only.

    Raises
    ------
    InputError
        The case has neither gauges nor a material, its model no solid cells, or there is no such analysis.
    """
    learn_kept_laws(folder)
    case, _ = reload_case(folder, kept=True)
    reader = Reader.of(_gauges(case), case)
    with open_results(folder / "results.h5") as file:
        found = [analysis_name(file, folder, case, asked)]
        for name in found if asked else _with_amplitudes(file, analyses_that_move(file, case)):
            _check_amplitudes(file, name, case)
            yield _table(file, folder, case, name, reader)


def _with_amplitudes(file: Mapping[str, Any], names: Sequence[str]) -> Sequence[str]:
    """Without linear modes, unless there is nothing else."""
    return [name for name in names if not of_linear_modes(file[name])] or names[:1]


def _check_amplitudes(file: Mapping[str, Any], name: str, case: Case) -> None:
    """The stress of a shape at a unit modal mass is no stress of the structure."""
    if of_linear_modes(file[name]):
        others = [one for one in analyses_that_move(file, case) if not of_linear_modes(file[one])]
        what, expected = "linear modes have no amplitude, and so no stress", "a mode or forced response of this run"
        fix = f"--analysis {others[0]}" if others else "run such an analysis"
        raise InputError(what, f"analysis '{name}'", None, expected, fix)


def _gauges(case: Case) -> Gauges:
    """Of the case file as it is now, of a model that has stress."""
    given = case.structure.cut or case.structure
    gauges = gauges_now(Source(case.path) if case.path.is_file() else case.source, given)
    if not gauges.gauges and gauges.elastic is None:
        expected = "[material] with youngs_modulus and poisson_ratio, [[gauge]], or both"
        fix = "add them to the case file; the run stays as it is (`fretwave check --keys` lists the keys)"
        raise InputError("the case has neither gauges nor a material", display(case.path), None, expected, fix)
    if given.coordinates is None or not solids_of(given):
        kinds = ", ".join(given.cells) or "none"
        fix = "give the builder's Structure its cells, or import with the input deck (--coordinates model.inp)"
        what = "the model has no solid cells: it has no stress"
        raise InputError(what, display(case.path), f"cells: {kinds}", "nodes and tetrahedra, wedges or hexahedra", fix)
    return gauges


def _table(file: h5py.File, folder: Path, case: Case, name: str, reader: Reader) -> StressTable:
    group, options = file[name], ViewOptions(analysis=name, points=[0])
    choice, points = read_choice(file, folder, case, options), group["points"]
    lead = [column for column in LEAD if column in points]
    nodes, sectors = np.asarray(reader.structure.coordinates), [] if choice.wheel else [0]
    with scene_of(case, choice, nodes, folder, sectors, reader.structure) as scene:
        rows = [
            {**{key: points[key][k].item() for key in lead}, **_row(reader, scene, at_point(choice, group, case, k))}
            for k in range(len(group["coefficients"]))
        ]
        notes = [*scene.note.splitlines(), *(_of_deviations(case, choice) if reader.own is not None else [])]
        warnings: list[str] = []
        if rows and reader.own is not None:
            k = largest(_sizes(rows), EQUAL)
            told = _agreement(reader.own, replace(scene, choice=at_point(choice, group, case, k)), rows[k])
            warnings = [line[len(WARNING) :] for line in told if line.startswith(WARNING)]
            rows[k][DOUBT.name] = "; ".join(warnings)
            notes += told
    columns = [*_lead_columns(group, lead), *reader.columns(choice.wheel), *([DOUBT] if warnings else [])]
    rows = [{DOUBT.name: "", **row} for row in rows]
    return StressTable(name, [column.in_units(choice.units) for column in columns], rows, notes)


def _of_deviations(case: Case, choice: Choice) -> list[str]:
    """A note on a mistuned wheel, whose sectors move with their own stiffness and have the stress of one material."""
    mistuned = choice.wheel and case.analyses[choice.name].whole_wheel()[1] is not None
    return [DEVIATES] if mistuned else []


def _lead_columns(group: h5py.Group, names: Sequence[str]) -> Iterator[Column]:
    """As the branch's own table has them; an amplitude that is of no dof has a unit of its own."""
    for name in names:
        known, attributes = COLUMNS.get(name), group["points"][name].attrs
        kind = known.kind if known else "f"
        yield Column(name, str(attributes.get("units", "1")), str(attributes.get("long_name", name)), kind)


def _row(reader: Reader, scene: Scene, choice: Choice) -> dict[str, Any]:
    """What one point of the branch says."""
    now = replace(scene, choice=choice)
    strains: dict[str, float] = {}
    worst: list[dict[str, Any]] = []
    for sector in scene.sectors:
        labels, motion = _motion(now, sector)
        worst.append({**reader.worst(labels, motion), **({"worst_sector": sector} if choice.wheel else {})})
        for gauge, read in zip(reader.gauges.gauges, reader.strains(labels, motion)):
            strains.update(read if not choice.wheel or gauge.sector == sector else {})
    return {**strains, **worst[largest(_sizes(worst), EQUAL)]}


def _sizes(rows: Sequence[Mapping[str, Any]]) -> Array:
    """(n,) Goodman's factors, or stress amplitudes."""
    return np.array([float(one.get("goodman", one.get("stress_amplitude", 0.0))) for one in rows])


def _agreement(own: Own, scene: Scene, row: Mapping[str, Any]) -> list[str]:
    """Of the motion that a row is of, in its worst sector."""
    motion = scene.on_dofs(row.get("worst_sector", 0))
    return list(own.compare(scene.choice.labels, motion, scene.to_nodes(motion), row["worst_node"]))


def _motion(scene: Scene, sector: int) -> tuple[list[str], Array]:
    """Labels and coefficients (n_nodes, 3, m) [length] of a sector in its own frame, harmonic 0 among them."""
    shape, turn, labels = scene.shape(sector), scene.turn(sector), scene.choice.labels
    own = np.einsum("xy,nxm->nym", turn, shape.coefficients[0])
    if "0" in labels:
        return labels, own
    return ["0", *labels], np.concatenate([(shape.rest @ turn)[..., None], own], axis=2)
