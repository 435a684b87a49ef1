"""The motion of a node or a dof at a point of a branch: amplitude and phase of its harmonics, and over the period.

A dof that the results keep is read from them. A node's motion is that of ``fretwave view``: through the basis of the
reduction, of the builder, and of a sector's wave.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Array, Complex
from ..case.gauge_places import node_numbers, row_of_node
from ..case.kept import reload_case
from ..case.load import Case
from ..columns import Column
from ..errors import FretwaveError, InputError
from ..model.structure import Structure
from ..post.motion import complex_amplitudes, motion
from ..results.missing_dof import missing_dof
from ..results.results import open_results
from ..texts import display, nearest
from ..units import UnitSystem, units_of
from .choice import read_choice
from .geometry import geometry, mesh_of
from .motion import scene_of
from .options import ViewOptions
from .run import learn_kept_laws

if TYPE_CHECKING:
    import h5py

#: Names in a message.
NAMED = 8


@dataclass(frozen=True)
class NodeMotion:
    """Motion along some directions: x = Re sum_n q_n e^{i n tau}, without the decay of a mode.

    Attributes
    ----------
    what : it is of, in words
    directions : names
    labels : of the m coefficients
    coefficients : (n_directions, m) [length]
    frequency_hz : of the fundamental
    note : what it lacks, in words; empty for nothing
    """

    what: str
    directions: Sequence[str]
    labels: Sequence[str]
    coefficients: Array
    frequency_hz: float
    units: UnitSystem
    note: str = ""

    @property
    def amplitudes(self) -> dict[int, Complex]:
        """q_n (n_directions,) [length] by harmonic."""
        return complex_amplitudes(self.labels, self.coefficients)

    def columns(self) -> list[Column]:
        """Of `rows`."""
        lead = [Column("harmonic", "1", "number of the harmonic", "i"), Column("frequency_hz", "Hz", "its frequency")]
        for name in self.directions:
            lead.append(Column(f"{name}_amplitude", "length", f"amplitude along {name}, of harmonic 0 the mean"))
            lead.append(Column(f"{name}_phase_deg", "deg", "of a cosine; 0 where the mode's or the force's one is"))
        return [column.in_units(self.units) for column in lead]

    def rows(self) -> list[dict[str, float]]:
        """Amplitude and phase along each direction, harmonic by harmonic."""
        return [self._row(order, q) for order, q in sorted(self.amplitudes.items())]

    def _row(self, order: int, q: Complex) -> dict[str, float]:
        row: dict[str, float] = {"harmonic": order, "frequency_hz": order * self.frequency_hz}
        for name, value in zip(self.directions, q):
            row[f"{name}_amplitude"] = float(abs(value) if order else value.real)
            row[f"{name}_phase_deg"] = float(np.degrees(np.angle(value))) if order else 0.0
        return row

    def over_period(self, n: int) -> Array:
        """Displacement (n, n_directions) [length] at n instants of the period."""
        return motion(self.labels, self.coefficients, 0.0, 0.0, n)[0][:-1]


def of_dof(group: h5py.Group, folder: Path, name: str, point: int) -> NodeMotion:
    """A dof as it was solved.

    Raises
    ------
    InputError
        The results have no such dof.
    """
    dofs = [text.decode() for text in group["dof"][()]]
    if name not in dofs:
        listed = ", ".join(dofs[:NAMED]) + (f", ... ({len(dofs)} in all)" if len(dofs) > NAMED else "")
        first = next((dof for dof in dofs if dof.startswith(f"{name}@")), dofs[0])
        near = _meant(folder, name, dofs) or f"--dof {first}, or --node for a node of the mesh"
        raise InputError("the results keep no such dof", display(folder), name, listed, near)
    rows = np.asarray(group["coefficients"][point])[[dofs.index(name)]]
    hz = float(group["points/frequency_hz"][point])
    labels = [text.decode() for text in group["harmonic"][()]]
    return NodeMotion(f"dof {name}", [name], labels, rows, hz, units_of(group.attrs))


def _meant(folder: Path, name: str, dofs: Sequence[str]) -> str | None:
    """A fix line for a dof that is not kept, by the model where that can still be read."""
    try:
        learn_kept_laws(folder)
        given = reload_case(folder, kept=True)[0].structure
    except FretwaveError:
        return nearest(name, dofs, "--dof {}".format)
    return missing_dof(given.cut or given, name, dofs, "--dof {}".format)


def of_node(folder: Path, analysis: str, number: int, point: int, sector: int = 0) -> NodeMotion:
    """A node of the mesh, in space: the reduction is expanded. One rank only.

    Parameters
    ----------
    number : in the mesh's own numbers, of a model without them its place from 0
    sector : of a wheel

    Raises
    ------
    InputError
        There is no such node or sector, or the model is not that of the run.
    """
    learn_kept_laws(folder)
    case, _ = reload_case(folder, kept=True)
    given, (nodes, _) = geometry(case), mesh_of(case)
    _check_sector(case, sector)
    row = _row_of(given, len(nodes), number, folder)
    held = _held_along(given, row)
    with open_results(folder / "results.h5") as file:
        choice = read_choice(file, folder, case, ViewOptions(analysis=analysis, points=[point]))
    with scene_of(case, choice, nodes, folder, [sector]) as scene:
        shape = scene.shape(sector)
    place = ", ".join(f"{x:.6g}" for x in shape.nodes[row])
    of = f" of sector {sector}" if scene.around > 1 else ""
    what = f"node {number}{of} at ({place}) {choice.units('length')}{held}"
    hz = float(choice.states["frequency_hz"][0])
    return NodeMotion(what, "xyz", choice.labels, shape.coefficients[0, row], hz, choice.units, scene.note)


def _check_sector(case: Case, sector: int) -> None:
    around = case.neighbours.sectors if case.neighbours else 1
    if not 0 <= sector < around:
        expected = f"0 to {around - 1}" if around > 1 else "a model with sectors"
        raise InputError("there is no such sector", "--sector", sector, expected, "--sector 0")


def _row_of(given: Structure, count: int, number: int, folder: Path) -> int:
    """Place of a node among the coordinates."""
    row, numbers = row_of_node(given, number), node_numbers(given)
    if row is not None:
        return row
    near = numbers[np.argmin(np.abs(numbers - number))]
    kind = "counted from 0" if given.node_numbers is None else "in the mesh's own numbers"
    expected = f"one of {count} nodes, {numbers.min()} to {numbers.max()}, {kind}"
    raise InputError("there is no such node", display(folder), number, expected, f"--node {near}")


def _held_along(given: Structure, row: int) -> str:
    """In words, along which directions the model holds a node; empty where it is free."""
    if given.displacements is None:
        return ""
    ways = [way for way, dof in zip("xyz", given.displacements[row]) if dof < 0]
    return f", held along {', '.join(ways)} (no dof of the model)" if ways else ""
