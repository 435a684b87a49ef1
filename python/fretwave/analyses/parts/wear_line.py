"""One line of wear: a mode at one amplitude, marched over wear cycles by a group of ranks."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...case import contacts
from ...case.load import Case
from ...columns import COLUMNS, MODAL, Column, Value
from ...console import Console
from ...mpi.spread import Spread, fill
from ...results.results import AnalysisWriter, Field
from ...texts import counted
from ...units import ATTRIBUTE
from .branch import error_text, finished_table, largest_error, mode_problem, open_branch
from .context import AnalysisContext
from .rest import retained, start_mode

if TYPE_CHECKING:
    from mpi4py import MPI

    from ...hb.nonlinear_mode import NonlinearMode
    from ...solve.wear import Wear, WearPoint
    from ...solve.worn_mode import WornMode, WornState
    from ..mode import ModeAnalysis
    from ..wear import WearAnalysis

#: Name of a line's table in its own folder.
LINE = "line"
SHARED = (*MODAL, "stick", "slip", "open", "work", "energy_error")
SOLVER = ("step_error", "force_outside", "residual", "newton", "linear", "wall_s", "event")


@dataclass(frozen=True)
class Line:
    """An amplitude with its unworn unknowns y (all of them, on every rank), how they were found (Newton and linear
    iterations, residual), and where its table is."""

    number: int
    amplitude: float
    y: Any
    outcome: Any
    folder: Path


def wear_areas(case: Case) -> dict[str, Any]:
    """Nodal areas (n_pairs,) [length^2] of the contacts that wear."""
    return contacts.wear_areas(case.contacts)


def faces_of(case: Case) -> list[tuple[str, str, Any]]:
    """(name of the face, contact, which of its pairs (n_pairs,) bool) of all faces that wear."""
    out = []
    for name, areas in wear_areas(case).items():
        given = case.structure.pairs[name].faces
        faces = np.array([name] * len(areas) if given is None else list(given))
        out += [(str(face), name, faces == face) for face in dict.fromkeys(faces.tolist())]
    return out


def columns(case: Case) -> list[Column]:
    """The table: one worn volume for each face."""
    worn = [
        Column(f"worn_{number}", "length^3", f"worn volume of {face}")
        for number, (face, _, _) in enumerate(faces_of(case), 1)
    ]
    first = [COLUMNS[name] for name in ("point", "line", "amplitude", "cycles", "vibrations", "step")]
    return [*first, *(COLUMNS[name] for name in SHARED), *worn, *(COLUMNS[name] for name in SOLVER)]


def fields(case: Case) -> dict[str, Field]:
    """Arrays of each point."""
    out = {}
    for name, areas in wear_areas(case).items():
        shape = (len(areas),)
        out[f"depth_{name}"] = Field(shape, "length", "worn depth")
        out[f"rate_{name}"] = Field(shape, "length", "growth of the worn depth in a vibration cycle")
        out[f"load_{name}"] = Field(shape, "force", "mean normal force of a period")
        out[f"slip_{name}"] = Field(shape, "1", "share of the period in slip")
        out[f"open_{name}"] = Field(shape, "1", "share of the period without contact")
    return out


def march_line(
    context: AnalysisContext[WearAnalysis], settings: ModeAnalysis, unit: float, line: Line, group: MPI.Comm
) -> dict[str, Any]:
    """Build the model on the group's ranks and march. Collective on the group.

    Returns
    -------
    dict
        status, reason, summary and what else the common table needs.
    """
    from ...case.build import model_of

    with model_of(context.case, context.analysis, group) as model:
        quiet = Console(False)
        own = context.of(settings, model=model, comm=group, console=quiet, arrays={}, left_out=[])
        stuck, rest = start_mode(own, settings.linear_mode)
        problem = mode_problem(own, retained(own), stuck, rest)
        with problem:
            return _Marcher(context, own, problem, unit, line).run()


class _Marcher:
    """Writes the points of a line."""

    def __init__(
        self,
        context: AnalysisContext[WearAnalysis],
        own: AnalysisContext[ModeAnalysis],
        problem: NonlinearMode,
        unit: float,
        line: Line,
    ) -> None:
        self.context, self.own, self.problem, self.unit, self.line = context, own, problem, unit, line
        self.analysis, self.comm, self.case = context.analysis, own.comm, own.case
        self.faces = faces_of(own.case)
        self.writer = AnalysisWriter(
            line.folder,
            LINE,
            columns(own.case),
            {"run_id": context.attributes["run_id"], ATTRIBUTE: context.units.name},
            dofs=own.case.dofs,
            labels=problem.harmonics.labels,
            active=self.comm.rank == 0,
            fields=fields(own.case),
        )

    def run(self) -> dict[str, Any]:
        from ...solve.worn_mode import WornMode

        with WornMode(self.problem, self.analysis.coefficient, wear_areas(self.case)) as mode:
            self.mode = mode
            march, points = self._open(mode)
            clock = time.perf_counter()
            for point in points:
                row = self._record(march, point, time.perf_counter() - clock)
                self._say(row)
                clock = time.perf_counter()
            closed = self._close(march)
            march.state.y.destroy()
            return closed

    def _open(self, mode: WornMode) -> tuple[Wear, Iterator[WearPoint]]:
        """The march from its start, or from where a killed run left it."""
        from ...solve.steps import WearControl
        from ...solve.wear import Wear

        a, unit = self.analysis, self.unit
        control = WearControl(a.stepper, a.tolerance, a.pressure_change, max_points=a.max_points)
        reports = [unit * value for value in a.report_at]
        state, _, found = open_branch(self.comm, self.writer, True)
        y = self.problem.core.unknowns()
        if found:
            fill(y, None if state is None else state["y"])
            names = ("depth", "at", "step", "load_scale", "growth")
            kept = state and {key: np.asarray(state[key]) for key in names if key in state}
            going: dict[str, Any] = {**self.comm.bcast(kept), "points": self.writer.rows}
        else:
            y.setArray(self.line.y[slice(*y.getOwnershipRange())])
            newton, linear, residual = self.line.outcome
            going = {"outcome": (int(newton), int(linear), float(residual))}
        march = Wear(mode, y, unit * a.cycles, control, reports, **going)
        y.destroy()
        return march, march.go_on() if found else iter(march)

    def _record(self, march: Wear, point: WearPoint, wall: float) -> dict[str, Any]:
        """One row. Collective."""
        from ...solve.wear_march import wear_row

        y, state = point.state.y, point.state
        per_contact = self._per_contact(state)
        row: dict[str, Value] = {
            **wear_row(self.mode, point, self.unit, self.analysis.errors if self.own.analysis.errors else False),
            "point": self.writer.rows,
            "line": self.line.number,
            "wall_s": wall,
        }
        areas = wear_areas(self.case)
        for number, (_, name, mask) in enumerate(self.faces, 1):
            row[f"worn_{number}"] = float(per_contact[f"depth_{name}"][mask] @ areas[name][mask])
        motions = None
        if point.event:
            names = [contact.name for contact in self.problem.model.contacts]
            motions = dict(zip(names, self.problem.contact_history(y)))
        kept = {"y": Spread(self.comm, y), "depth": state.depth, "at": point.cycles, "step": march.step}
        kept |= {"load_scale": march.load_scale, "growth": march.growth}
        coefficients = Spread(self.comm, self.problem.local_coefficients(y))
        self.writer.append(row, coefficients, motions if self.writer.active else None, kept, per_contact)
        return row

    def _per_contact(self, state: WornState) -> dict[str, Any]:
        names = [self.problem.model.contacts[k].name for k in self.mode.contacts]
        return {
            f"{key}_{name}": getattr(state, key)[part]
            for name, part in zip(names, self.mode.slices)
            for key in ("depth", "rate", "load", "slip", "open")
        }

    def _say(self, row: dict[str, Any]) -> None:
        if self.comm.rank:
            return
        units = self.context.units
        worn = " ".join(f"{row[f'worn_{number}']:.3e}" for number in range(1, len(self.faces) + 1))
        self.context.console.detail(
            f"{self.context.name} a {row['amplitude']:.4g} {units('length')}  {row['cycles']:8.4g} cycles"
            f"  f {row['frequency_hz']:9.6g} Hz  zeta {100 * row['zeta']:7.4f} %"
            f"{error_text(100 * row['zeta_error'])}"
            f"  slip {100 * row['slip']:3.0f} %  open {100 * row['open']:3.0f} %"
            f"  worn {worn} {units('length^3')}  newton {row['newton']:2d}  {row['wall_s']:.2f} s"
        )

    def _close(self, march: Wear) -> dict[str, Any]:
        status = "done" if march.converged else "stopped"
        told = _told(finished_table(self.writer))
        if self.mode.errors_left_out:
            told += f"; errors are not estimated: {self.mode.errors_left_out}"
        self.writer.abandon()  # its journal stays until the common table is done: a resumed run finds the line there
        end, length = march.eta / self.unit, self.context.units("length")
        place = f"a = {self.line.amplitude:g} {length}"
        return {
            "status": status,
            "reason": march.reason,
            "summary": f"{self.context.name}: {place}: {counted(self.writer.rows, 'point')} to"
            f" {end:.4g} normalised cycles, {march.reason}{told}",
            "missed": [f"{self.context.name}: missed: {place}: {text}" for text in march.missed(self.unit)],
            "labels": " ".join(self.problem.harmonics.labels),
            "samples": self.problem.harmonics.samples,
            "load_scale": march.load_scale,
        }


def _told(table: dict[str, Any]) -> str:
    """The damping over wear, in words."""
    if not table:
        return ""
    zeta, top = np.round(100 * table["zeta"], 4) + 0.0, int(np.argmax(table["zeta"]))
    error = largest_error("zeta", table, "zeta_error", "%", 100).rstrip(",")
    jumps = sum("jump" in event.split() for event in table["event"])
    return (
        f"; zeta {zeta[0]:.4f} % when new, largest {zeta[top]:.4f} % at {table['cycles'][top]:.3g}, {zeta[-1]:.4f} %"
        f" at the end{',' * bool(error)}{error}"
        + (f"; {counted(jumps, 'jump')} to another sheet of the mode" if jumps else "")
    )
