"""Motion of the nodes that a run shows: of a structure, or of the sectors of a wheel one after the other.

A wave on one sector is that of sector 0 in sector j, turned by 2 pi j / N about the axis and delayed by j theta
(`fretwave.cyclic.sector`). A whole wheel's results have each sector's own motion, in the frame that is turned with it.
A reduced motion reaches the nodes by the basis that the run keeps; a basis too large for that is made again from the
case, and is the same.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from ..arrays import Array
from ..case.load import Case
from ..errors import InputError
from ..fe.mesh import VTK_LATTICE
from ..model.cells import HEXAHEDRA, KINDS
from ..model.sectors import Parts, rotation
from ..model.structure import Structure
from ..results.basis_file import NAME, marks_of, read_basis
from ..texts import display
from .choice import Choice, natural_scale
from .vtkhdf import HEXAHEDRON, VERTEX, Cells, linear_cells

#: Displacements (n_nodes, 3, n) of all nodes from columns (n_dof, n) on the model's dofs, both faces of a sector free,
#: and the share (n,) of the static loads in each.
ToNodes = Callable[[Array, Array], Array]
Expand = Callable[[npt.ArrayLike], Array]

#: Relative difference of a frequency that rounding explains.
SAME = 1e-6


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
    note : what its nodes lack, in words; empty for nothing
    """

    nodes: Array
    choice: Choice
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
        if self.ties is None:
            return self.to_nodes(self._columns(0), self._loaded())
        total: Any = 0
        for k, T in self.ties.items():
            if self.choice.wheel:
                total = total + T @ self._columns((sector + k) % self.around)
            else:
                total = total + T @ self._delayed(self._columns(0), k)
        return self.to_nodes(total, self._loaded())

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
    beyond, note = np.zeros(1), ""
    with ExitStack() as stack:
        if case.reduction is not None:
            kept = read_basis(folder / NAME)
            if kept is not None:
                _check_model(case, kept.model)
            basis = made_again(case, stack) if kept is None else kept
            expand, ties = basis.expand, basis.ties or ties
            beyond, note = _beyond(basis, _loads(case, choice))
            _check_same(case, choice, basis, around)
        given, shown = moving or geometry(case), _shown(case, around, sectors)
        to_nodes = _to_nodes(given, len(nodes), expand, beyond)
        yield Scene(nodes, choice, to_nodes, shown, ties, around, given.axis or "z", note)


def _loads(case: Case, choice: Choice) -> list[str]:
    """Names of the static loads about whose displacement an analysis moves."""
    preload = case.preload_of(case.analyses[choice.name]) if choice.loaded else None
    return preload.loads if preload is not None else []


def _beyond(basis: Expansion, loads: Sequence[str]) -> tuple[Array, str]:
    """Static displacement that no coordinate has, and a note on what is not known of it: of an older run all."""
    known = [name for name in loads if name in basis.loads]
    left = [name for name in loads if name not in basis.loads]
    note = (
        f"note: the displacement at rest under {', '.join(left)} is that of the component modes alone: an earlier"
        " version made the run; run it again for the exact one"
    )
    return basis.beyond(known) if known else np.zeros(1), note if left else ""


class Expansion(Protocol):
    """What is used of a reduction, made again or kept."""

    @property
    def size(self) -> int: ...

    @property
    def n_interface(self) -> int: ...

    @property
    def highest_component_hz(self) -> float: ...

    @property
    def ties(self) -> Parts: ...

    @property
    def loads(self) -> Mapping[str, Array]: ...

    def expand(self, x_r: npt.ArrayLike, /) -> Array: ...

    def beyond(self, names: Sequence[str]) -> Array: ...


@dataclass(frozen=True)
class MadeAgain:
    """The reduction of a run, from its case, with the model's loads."""

    reduction: Any
    loads: Mapping[str, Array]
    size: int
    n_interface: int
    highest_component_hz: float
    ties: Parts

    def expand(self, x_r: npt.ArrayLike, /) -> Array:
        """Motion of all dofs."""
        return np.asarray(self.reduction.expand(x_r))

    def beyond(self, names: Sequence[str]) -> Array:
        """Static displacement under these loads together that no coordinate has."""
        return np.asarray(self.reduction.beyond(np.sum([self.loads[name] for name in names], axis=0)))


def made_again(case: Case, stack: ExitStack) -> Expansion:
    """Of a run that does not keep the basis of its reduction; it lives as long as the stack.

    Raises
    ------
    InputError
        There is neither MPI nor PETSc.
    """
    try:
        from mpi4py import MPI

        from ..case.reduce import reduction_of
        from ..cyclic.reduction import SectorReduction
    except ImportError as error:
        raise InputError(
            "the motion of a reduced model cannot be shown here",
            display(case.path),
            f"no {error.name or 'solver'}, and no {NAME} in the folder of the run",
            "mpi4py and PETSc: the reduction is made again to reach the nodes that the run does not keep",
            "view it where the case was run; `fretwave show` and `fretwave plot` need neither",
        ) from None
    reduction = reduction_of(case, MPI.COMM_SELF)
    stack.callback(reduction.destroy)
    hz, loads = reduction.highest_component_hz, (case.structure.cut or case.structure).loads
    if isinstance(reduction, SectorReduction):
        return MadeAgain(reduction, loads, reduction.size, reduction.n_interface, hz, reduction.sector().ties)
    return MadeAgain(reduction, loads, reduction.size, 0, hz, {})


def geometry(case: Case) -> Structure:
    """Nodes, cells and pairs of the model as it was given: of a sector, with both its faces.

    Raises
    ------
    InputError
        There are no nodes.
    """
    given = case.structure.cut or case.structure
    if given.coordinates is None:
        raise InputError(
            "the model cannot be drawn: it has no nodes",
            display(case.path),
            "no coordinates of nodes with three displacements each",
            "a builder that gives coordinates (and hexahedra), or a model file with coordinates",
            "give Structure its coordinates, or import with --coordinates; `fretwave plot` needs neither",
        )
    return given


def mesh_of(case: Case, linear: bool = False) -> tuple[Array, list[Cells]]:
    """Nodes (n_nodes, 3), and cells (n_cells, m) with VTK's number of their kind; points where there are no cells."""
    given = geometry(case)
    nodes, cells = np.asarray(given.coordinates), given.hexahedra
    found: list[Cells] = [(table, KINDS[kind].vtk) for kind, table in given.cells.items() if len(table)]
    if cells is not None:
        cut = linear and cells.shape[1] == 27
        first = (linear_cells(cells, VTK_LATTICE), HEXAHEDRON) if cut else (cells, HEXAHEDRA[cells.shape[1]])
        found.insert(0, first)
    return nodes, found or [(np.arange(len(nodes))[:, None], VERTEX)]


def _unchanged(columns: npt.ArrayLike) -> Array:
    return np.asarray(columns)


def _to_nodes(given: Structure, n_nodes: int, expand: Expand, beyond: Array) -> ToNodes:
    """Through the case's reduction and the builder's own.

    Parameters
    ----------
    beyond : (n_dof,) static displacement under the loads that no reduced coordinate has, or (1,) zero [length]
    """

    def displacements(columns: Array, loaded: Array) -> Array:
        columns = expand(np.ascontiguousarray(columns)) + np.multiply.outer(beyond, loaded)
        if given.expansion is not None:
            columns = given.expansion @ columns
        if given.displacements is not None:  # held dofs, -1, read the row of zeros
            columns = np.vstack([columns, np.zeros(columns.shape[1])])[given.displacements.ravel()]
        return np.asarray(columns.reshape(n_nodes, 3, -1))

    return displacements


def _shown(case: Case, around: int, asked: Sequence[int]) -> list[int]:
    chosen = list(asked) or list(range(around))
    wrong = [sector for sector in chosen if not 0 <= sector < around]
    if wrong:
        expected = f"0 to {around - 1}" if around > 1 else "a model with sectors"
        raise InputError("there is no such sector", "--sectors", wrong[0], expected, "--sectors 0")
    if case.neighbours is not None and geometry(case).axis is None and chosen != [0]:
        fix = "give Structure its axis, or show one sector with --sectors 0"
        raise InputError("the wheel cannot be drawn: it has no axis", display(case.path), fix=fix)
    return chosen


def _check_model(case: Case, then: Array) -> None:
    """The model is that which was reduced: its motion is the run's own, its nodes are the case's."""
    now = marks_of(geometry(case))
    if not np.allclose(now, then, rtol=SAME, atol=0):
        unit = case.units("force/length")
        found, expected = (f"{m[0]:.0f} dofs, sum of |K| {m[1]:.9g} {unit}" for m in (now, then))
        raise InputError(
            "the model is no longer that of the run",
            display(case.path),
            found,
            f"{expected}, as in the run",
            "run it again",
        )


def _check_same(case: Case, choice: Choice, basis: Expansion, around: int) -> None:
    """The last component mode tells whether this is the run's model: a builder may read what a case cannot tell."""
    size = (basis.size - basis.n_interface) * (around if choice.wheel else 1)
    then, now = choice.highest_component_hz, basis.highest_component_hz
    if size != len(choice.rest) or abs(now - then) > SAME * then:
        found = f"{size} coordinates, highest component mode {now:.9g} Hz"
        expected = f"{len(choice.rest)} coordinates, {then:.9g} Hz, as in the run"
        raise InputError("the model is no longer that of the run", display(case.path), found, expected, "run it again")
