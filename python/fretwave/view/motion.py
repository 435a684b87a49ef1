"""Motion of the nodes that a run shows: of a structure, or of the sectors of a wheel one after the other.

A wave on one sector is that of sector 0 in sector j, turned by 2 pi j / N about the axis and delayed by j theta
(`fretwave.cyclic.sector`). A whole wheel's results have each sector's own motion, in the frame that is turned with it.
A reduced motion reaches the nodes by `expansion`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ..arrays import Array
from ..case.load import Case
from ..errors import InputError
from ..model.sectors import Parts, rotation
from ..model.structure import Structure
from ..texts import display
from .choice import Choice
from .expansion import Expand, beyond_basis, expansion_of, of_tuned_sector, without_rest
from .geometry import geometry
from .options import natural_scale

#: Motion (n_dof, n) of all the model's dofs, both faces of a sector free, from columns (n_solved, n) on those that are
#: solved, and the share (n,) of the static loads in each.
ToDofs = Callable[[Array, Array], Array]
#: Displacements (n_nodes, 3, n) of all nodes from that.
ToNodes = Callable[[Array], Array]


@dataclass(frozen=True)
class Shape:
    """The motion of all nodes of a structure or a sector.

    Attributes
    ----------
    nodes : (n_nodes, 3) [length]
    rest : (n_nodes, 3) displacement at rest [length]
    coefficients : (n_points, n_nodes, 3, m) [length]
    basis : (n_phases, m)
        Value of each coefficient's function of time.
    """

    nodes: Array
    rest: Array
    coefficients: Array
    basis: Array

    def displacements(self, chosen: slice | npt.NDArray[np.intp] = slice(None)) -> Iterator[Array]:
        """(n_chosen, 3) of some nodes in all steps, one after the other."""
        return (values[chosen] @ row for values in self.coefficients for row in self.basis)

    def largest(self) -> float:
        """Largest displacement from rest [length]."""
        return max(float(np.linalg.norm(x - self.rest, axis=1).max()) for x in self.displacements())


@dataclass(frozen=True)
class Scene:
    """What is shown, part by part: a structure (sector 0 alone), or sectors of a wheel.

    Attributes
    ----------
    nodes : (n_nodes, 3) of sector 0 [length]
    sectors : numbers of those shown
    ties : {k: (n_dof, n)}
        Dofs with both faces from those of the sector k places ahead, as solved; None for a structure.
    around : int
        Sectors of the wheel, 1 for a structure.
    axis : of the wheel
    note : what its nodes lack, in words, a line for each thing; empty for nothing
    """

    nodes: Array
    choice: Choice
    to_dofs: ToDofs
    to_nodes: ToNodes
    sectors: Sequence[int]
    ties: Parts | None = None
    around: int = 1
    axis: str = "z"
    note: str = ""

    def shape(self, sector: int) -> Shape:
        """Of one sector, in space."""
        if self.ties is None or not self.choice.wheel:
            columns = self._delayed(self._first, sector)
        else:
            columns = self._expanded(sector)
        columns = np.einsum("xy,nyc->nxc", self.turn(sector), columns)
        points, m = len(self.choice.points), len(self.choice.labels)
        coefficients = np.moveaxis(columns[..., 1:].reshape(len(self.nodes), 3, points, m), 2, 0)
        return Shape(self.nodes @ self.turn(sector).T, columns[..., 0], coefficients, self.choice.basis())

    def turn(self, sector: int) -> Array:
        """Rotation (3, 3) of a sector's frame."""
        return np.eye(3) if sector == 0 else rotation(2 * np.pi * sector / self.around, self.axis)

    def natural_scale(self) -> float:
        """Draws the largest displacement from rest as a tenth of the size of what is shown."""
        corners = np.concatenate([self.nodes @ self.turn(sector).T for sector in self.sectors])
        size = float(np.linalg.norm(np.ptp(corners, axis=0)))
        different = self.sectors if self.choice.wheel else self.sectors[:1]  # in a wave all sectors move alike
        largest = max(self.shape(sector).largest() for sector in different)
        return natural_scale(size, largest)

    @cached_property
    def _first(self) -> Array:
        """Columns of sector 0 in a wave, or of a structure."""
        return self._expanded(0)

    def _expanded(self, sector: int) -> Array:
        """Nodal columns (n_nodes, 3, 1 + n_points m): at rest, then the coefficients of every point."""
        return self.to_nodes(self.on_dofs(sector))

    def on_dofs(self, sector: int) -> Array:
        """The same on the model's dofs (n_dof, 1 + n_points m), in the sector's own frame."""
        if self.ties is None:
            return self.to_dofs(self._columns(0), self._loaded())
        total: Any = 0
        for k, T in self.ties.items():
            if self.choice.wheel:
                total = total + T @ self._columns((sector + k) % self.around)
            else:
                total = total + T @ self._delayed(self._columns(0), k)
        return self.to_dofs(total, self._loaded())

    def _loaded(self) -> Array:
        """(1 + n_points m,) 1 where the static loads act: at rest, and in harmonic 0 of every point."""
        still = [float(label == "0") for label in self.choice.labels]
        return np.array([1.0, *still * len(self.choice.points)])

    def _columns(self, sector: int) -> Array:
        """(n, 1 + n_points m) of one sector as solved."""
        n = len(self.choice.rest) // (self.around if self.choice.wheel else 1)
        rows = slice(sector * n, (sector + 1) * n)
        coefficients = np.moveaxis(self.choice.coefficients[:, rows], 1, 0).reshape(n, -1)
        return np.column_stack([self.choice.rest[rows], coefficients])

    def _delayed(self, columns: Array, sectors: int) -> Array:
        """The wave so many sectors ahead; what is at rest has no delay."""
        if sectors == 0:
            return columns
        D = np.stack([self.choice.delay(2 * np.pi * n * sectors / self.around) for n in self.choice.diameters])
        points = columns[..., 1:].reshape(*columns.shape[:-1], *D.shape[:2])
        moved = np.einsum("...pm,pmk->...pk", points, D)
        return np.concatenate([columns[..., :1], moved.reshape(*columns.shape[:-1], -1)], axis=-1)


@contextmanager
def scene_of(
    case: Case,
    choice: Choice,
    nodes: Array,
    folder: Path,
    sectors: Sequence[int] = (),
    moving: Structure | None = None,
) -> Iterator[Scene]:
    """The scene of a choice; reductions live as long as it does. One rank only.

    Parameters
    ----------
    folder : of the run
    sectors : those shown of a wheel; empty for all
    moving : whose `displacements` are those of the nodes, by default the case's model

    Raises
    ------
    InputError
        The model is not that of the run, there is no such sector, or a wheel without axis.
    """
    neighbours = case.neighbours
    around = neighbours.sectors if neighbours else 1
    ties = neighbours.ties if neighbours else None
    expand: Expand = _unchanged
    beyond, note = np.zeros(1), without_rest(case, choice)
    with ExitStack() as stack:
        if case.reduction is not None:
            basis = expansion_of(case, choice, folder, around, stack)
            expand, ties = basis.expand, basis.ties or ties
            beyond, missing = beyond_basis(basis, _loads(case, choice))
            note = "\n".join(filter(None, [note, missing, of_tuned_sector(case, choice, beyond)]))
        given, shown = moving or geometry(case), _shown(case, around, sectors)
        to_dofs, to_nodes = _to_dofs(expand, beyond), _to_nodes(given, len(nodes))
        yield Scene(nodes, choice, to_dofs, to_nodes, shown, ties, around, given.axis or "z", note)


def _loads(case: Case, choice: Choice) -> list[str]:
    """Names of the static loads about whose displacement an analysis moves."""
    preload = case.preload_of(case.analyses[choice.name]) if choice.loaded else None
    return preload.loads if preload is not None else []


def _unchanged(columns: npt.ArrayLike) -> Array:
    return np.asarray(columns)


def _to_dofs(expand: Expand, beyond: Array) -> ToDofs:
    """Through the case's reduction.

    Parameters
    ----------
    beyond : (n_dof,) static displacement under the loads that no reduced coordinate has, or (1,) zero [length]
    """

    def motion(columns: Array, loaded: Array) -> Array:
        return np.asarray(expand(np.ascontiguousarray(columns)) + np.multiply.outer(beyond, loaded))

    return motion


def _to_nodes(given: Structure, n_nodes: int) -> ToNodes:
    """Through the builder's own reduction."""

    def displacements(columns: Array) -> Array:
        if given.expansion is not None:
            columns = given.expansion @ columns
        if given.displacements is not None:  # held dofs, -1, read the row of zeros
            columns = np.vstack([columns, np.zeros(columns.shape[1])])[given.displacements.ravel()]
        return np.asarray(columns.reshape(n_nodes, 3, -1))

    return displacements


def _shown(case: Case, around: int, asked: Sequence[int]) -> list[int]:
    chosen = list(dict.fromkeys(asked)) or list(range(around))
    wrong = [sector for sector in chosen if not 0 <= sector < around]
    if wrong:
        expected = f"0 to {around - 1}" if around > 1 else "a model with sectors"
        raise InputError("there is no such sector", "--sectors", wrong[0], expected, "--sectors 0")
    if case.neighbours is not None and geometry(case).axis is None and chosen != [0]:
        fix = "give Structure its axis, or show one sector with --sectors 0"
        raise InputError("the wheel cannot be drawn: it has no axis", display(case.path), fix=fix)
    return chosen
