"""``fretwave view``: the motion of a run over a period, and its contact pairs, as VTKHDF for ParaView.

Two files: the grid at rest with its displacement at phases of the period, and the contact pairs as points. Several
points of a branch follow each other in time, a period each, on one grid. The displacement leaves out the factor
e^{-n beta t} of a decaying mode, as the results do. A run does not keep its reduction: it is made again from the case,
and is the same.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from .built import BuiltContact
from .casefile import Case
from .contact_history import OPEN, SLIP, STICK, ContactHistory
from .errors import InputError
from .fe.mesh import VTK_LATTICE
from .harmonic_motion import complex_amplitudes
from .reduced import reduction_of
from .results import open_results
from .run import reload_case
from .source import display
from .view_choice import Choice, ViewOptions, read_choice
from .vtkhdf import HEXAHEDRON, QUADRATIC_HEXAHEDRON, TRIQUADRATIC_HEXAHEDRON, VERTEX, GridFile, linear_cells
from .wear_view import view_wear, worn_analysis

Array = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.intp]

#: Highest harmonic shown as fields of its own.
SHOWN_HARMONICS = 3
#: Largest displacement as drawn, as a share of the model's size, where no scale is given.
DRAWN = 0.1
#: Relative difference of a frequency that rounding explains.
SAME = 1e-6
STATUS = {"stick": STICK, "slip": SLIP, "open": OPEN}


@dataclass(frozen=True)
class Shape:
    """The motion of all nodes.

    Attributes
    ----------
    nodes : (n_nodes, 3) [m]
    rest : (n_nodes, 3) displacement at rest [m]
    coefficients : (n_points, n_nodes, 3, m) [m]
    basis : (n_phases, m)
        Value of each coefficient's function of time.
    """

    nodes: Array
    rest: Array
    coefficients: Array
    basis: Array

    def displacements(self, chosen: Any = slice(None)) -> Iterator[Array]:
        """(n_chosen, 3) of some nodes in all steps, one after the other."""
        return (values[chosen] @ row for values in self.coefficients for row in self.basis)

    def natural_scale(self) -> float:
        """Draws the largest displacement from rest as a tenth of the model's size."""
        size = float(np.linalg.norm(np.ptp(self.nodes, axis=0)))
        largest = max(float(np.linalg.norm(x - self.rest, axis=1).max()) for x in self.displacements())
        return float(f"{DRAWN * size / largest:.2g}") if largest > 0 and size > 0 else 1.0


def view_run(folder: Path, options: ViewOptions, say: Callable[[str], None] = print) -> list[Path]:
    """Write the files; returns their paths. One rank only.

    Raises
    ------
    InputError
        The folder holds no run, its case has changed, the model has no nodes, or there is no such analysis or point.
    """
    case, _ = reload_case(folder, kept=True)
    worn = None if options.points else worn_analysis(folder, case, options)
    if worn is not None:
        return view_wear(folder, case, worn, options, say)
    nodes, cells = mesh_of(case, options.linear)
    with open_results(folder / "results.h5") as file:
        choice = read_choice(file, folder, case, options)
    for line in choice.lines():
        say(line)
    shape = expand(case, choice, nodes)
    scale = options.scale if options.scale is not None else shape.natural_scale()
    out = options.out or folder / f"{choice.name}.vtkhdf"
    write_grid(out, shape, cells, choice, scale)
    say(f"{display(out)}: {len(nodes)} nodes, {len(cells[0])} cells, {len(choice.times)} steps")
    placed = _placed(case, choice)
    for name in choice.contacts:
        if name not in placed:
            say(f"contact '{name}' is not shown: the model has no places of its pairs")
    pairs = out.with_name(f"{out.stem}_contact{out.suffix}")
    if placed:
        write_pairs(pairs, shape, placed, choice, scale)
        say(f"{display(pairs)}: {sum(contact.n_pairs for contact in placed.values())} contact pairs")
    else:
        pairs.unlink(missing_ok=True)  # of another point
    say(f"ParaView (5.12 or later): 'Warp By Vector' with the field warp draws displacements {scale:g} times as large")
    return [out, pairs] if placed else [out]


def mesh_of(case: Case, linear: bool = False) -> tuple[Array, tuple[IntArray, int]]:
    """Nodes (n_nodes, 3), and cells (n_cells, m) with VTK's number of their kind; points where there are no cells."""
    built = case.built
    if case.neighbours is not None:
        found, fix = f"a sector of {case.neighbours.sectors}", "`fretwave plot` draws its curves"
        raise InputError("sectors of wheels cannot be viewed yet", display(case.path), found, "a whole structure", fix)
    if built is None or built.coordinates is None:
        matrices = "only matrices" if built is None else "no coordinates of nodes with three displacements each"
        raise InputError(
            "the model cannot be drawn: it has no nodes",
            display(case.path),
            matrices,
            "a builder that gives coordinates (and hexahedra), or a model file with coordinates",
            "give BuiltModel its coordinates, or import with --coordinates; `fretwave plot` needs neither",
        )
    cells = built.hexahedra
    if cells is None:
        return built.coordinates, (np.arange(len(built.coordinates))[:, None], VERTEX)
    if cells.shape[1] == 27 and linear:
        return built.coordinates, (linear_cells(cells, VTK_LATTICE), HEXAHEDRON)
    return built.coordinates, (
        cells,
        {8: HEXAHEDRON, 20: QUADRATIC_HEXAHEDRON, 27: TRIQUADRATIC_HEXAHEDRON}[cells.shape[1]],
    )


def expand(case: Case, choice: Choice, nodes: Array) -> Shape:
    """Reduced coordinates back to all nodes (x = T x_r); as they are without reduction."""
    from mpi4py import MPI

    n_points, n, m = choice.coefficients.shape
    columns = np.column_stack([choice.rest, np.moveaxis(choice.coefficients, 1, 0).reshape(n, -1)])
    if case.reduction is not None:
        with reduction_of(case, case.reduction, MPI.COMM_SELF) as reduction:
            _check_same(choice, reduction, case)
            columns = reduction.expand(columns)
    if case.built is not None and case.built.displacements is not None:  # held dofs, -1, read the row of zeros
        columns = np.vstack([columns, np.zeros(columns.shape[1])])[case.built.displacements.ravel()]
    whole = columns[:, 1:].reshape(len(nodes), 3, n_points, m)
    return Shape(nodes, columns[:, 0].reshape(-1, 3), np.moveaxis(whole, 2, 0), choice.basis())


def _check_same(choice: Choice, reduction: Any, case: Case) -> None:
    """The last component mode tells whether this is the run's model: a builder may read what a case cannot tell."""
    then, now = choice.highest_component_hz, reduction.component_hz[-1:].sum()
    if reduction.size != len(choice.rest) or abs(now - then) > SAME * then:
        found = f"{reduction.size} coordinates, highest component mode {now:.9g} Hz"
        expected = f"{len(choice.rest)} coordinates, {then:.9g} Hz, as in the run"
        raise InputError("the model is no longer that of the run", display(case.path), found, expected, "run it again")


def write_grid(path: Path, shape: Shape, cells: tuple[IntArray, int], choice: Choice, scale: float) -> None:
    """The grid with its displacement, that at rest, and the complex amplitudes of the lowest harmonics."""
    with GridFile(path, choice.times) as grid:
        grid.part(shape.nodes, *cells)
        _write_motion(grid, shape, slice(None), scale)
        _write_states(grid, choice)
        grid.point_field("rest_displacement", [shape.rest])
        flat = shape.coefficients.reshape(len(shape.coefficients), -1, len(choice.labels))
        amplitudes = [complex_amplitudes(choice.labels, values) for values in flat]
        for order in (order for order in amplitudes[0] if order <= SHOWN_HARMONICS):
            for part in ("real", "imag") if order else ("real",):
                pieces = [getattr(q[order], part).reshape(-1, 3) for q in amplitudes]
                grid.point_field(f"harmonic_{order}_{part}" if order else "harmonic_0", pieces, choice.point_of_step)


def write_pairs(path: Path, shape: Shape, placed: Mapping[str, BuiltContact], choice: Choice, scale: float) -> None:
    """Contact pairs as points that move with the node next to them."""
    places = np.concatenate([np.asarray(contact.points) for contact in placed.values()])
    _, near = cKDTree(shape.nodes).query(places)
    with GridFile(path, choice.times) as grid:
        for contact in placed.values():
            grid.part(np.asarray(contact.points), np.arange(contact.n_pairs)[:, None], VERTEX)
        _write_motion(grid, shape, near, scale)
        _write_states(grid, choice)
        grid.point_field("contact", [np.full(c.n_pairs, float(k)) for k, c in enumerate(placed.values())])
        grid.point_field("pair", [np.arange(float(contact.n_pairs)) for contact in placed.values()])
        _write_statuses(grid, [choice.contacts[name] for name in placed], list(placed.values()), choice)


def _write_statuses(
    grid: GridFile, histories: Sequence[Sequence[ContactHistory]], given: Sequence[BuiltContact], choice: Choice
) -> None:
    """Of every step: forces, gap, status; of every period: shares of the status, dissipated work.

    Parameters
    ----------
    histories : per contact, per point
    """
    steps, period = np.arange(len(choice.times)), choice.point_of_step
    all_points = range(len(choice.points))

    def over_steps(name: str) -> Iterable[Any]:
        for point in all_points:
            rows = [getattr(contact[point], name)[choice.samples] for contact in histories]
            yield from (np.concatenate(parts) for parts in zip(*rows))

    def over_periods(values: Callable[[ContactHistory], Any]) -> Iterable[Any]:
        return (np.concatenate([values(contact[point]) for contact in histories]) for point in all_points)

    for name in ("normal_force", "tangential_force", "gap"):
        grid.point_field(name, over_steps(name), steps)
    if all(contact.frames is not None for contact in given) and all(h.is_3d for c in histories for h in c):
        frames = np.concatenate([np.asarray(contact.frames) for contact in given])
        grid.point_field("normal", [frames[:, 0]])
    grid.point_field("dissipated_work", over_periods(lambda history: history.work), period)
    if all(history.status is not None for contact in histories for history in contact):
        grid.point_field("status", over_steps("status"), steps, "i1")
        for word, number in STATUS.items():
            grid.point_field(f"share_{word}", over_periods(partial(ContactHistory.share, status=number)), period)


def _write_motion(grid: GridFile, shape: Shape, chosen: Any, scale: float) -> None:
    """True displacement, and the one from rest enlarged for the eye."""
    steps = np.arange(grid.steps)
    grid.point_field("displacement", shape.displacements(chosen), steps)
    warps = (scale * (x - shape.rest[chosen]) for x in shape.displacements(chosen))
    grid.point_field("warp", warps, steps, "f4")


def _write_states(grid: GridFile, choice: Choice) -> None:
    for name, values in choice.states.items():
        grid.field_data(name, values[choice.point_of_step])
    grid.field_data("phase", np.tile(choice.phases, len(choice.points)))


def _placed(case: Case, choice: Choice) -> dict[str, BuiltContact]:
    """Contacts with known places of their pairs."""
    built = case.built.contacts if case.built else {}
    return {name: built[name] for name in choice.contacts if name in built and built[name].points is not None}
