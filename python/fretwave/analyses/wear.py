"""``type = "wear"``: fretting wear of a mode at fixed amplitudes over wear cycles, a line for each amplitude.

The mode's unworn branch gives the starts; the lines are independent of each other and share the ranks in groups. Each
keeps its own table in a hidden folder, from which it goes on after a kill; all are put together at the end.
"""

from __future__ import annotations

import math
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np

from ..case.schema import ModeAnalysis, WearAnalysis
from ..errors import FretwaveError, NotConverged
from ..files.dimensions import names_of_data
from ..mpi import groups
from ..mpi.guard import on_first_rank
from ..results.results import AnalysisWriter, has_results, open_results
from .parts.branch import mode_problem, points_of, step_control
from .parts.context import AnalysisContext, Outcome
from .parts.rest import keep_pairs, retained, start_mode
from .wear_line import LINE, Line, columns, fields, wear_areas


def run_wear(context: AnalysisContext) -> Outcome:
    """March all amplitudes. Collective."""
    analysis = context.analysis
    assert isinstance(analysis, WearAnalysis)
    settings = cast(ModeAnalysis, context.case.settings(analysis))
    folder = context.folder / f".{context.name}_lines"
    kept = groups.Kept(folder, str(context.attributes["run_id"]))
    starts = on_first_rank(context.comm, lambda: kept.load(0))
    if starts is None:
        starts = unworn_starts(replace(context, analysis=settings), analysis)
        context.before_first()
        if context.comm.rank == 0:
            kept.save(0, starts)
    lines = [
        Line(number, amplitude, starts[f"y_{number}"], starts[f"outcome_{number}"], folder / f"line_{number:03d}")
        for number, amplitude in enumerate(analysis.amplitude)
        if f"y_{number}" in starts
    ]
    unit = float(starts["cycle_unit"])
    context.console.line(f"{context.name}: a normalised cycle is {unit:.6g} vibration cycles")
    march = LineRunner(context, settings, unit)
    results = groups.run(context.comm, lines, march)
    return _collect(context, analysis, lines, results, unit, folder)


class LineRunner:
    """Does a line on a group of ranks."""

    def __init__(self, context: AnalysisContext, settings: ModeAnalysis, unit: float) -> None:
        self.context, self.settings, self.unit = context, settings, unit

    def __call__(self, line: Line, group: Any) -> dict[str, Any]:
        from .wear_line import march_line

        return march_line(self.context, self.settings, self.unit, line, group)


def unworn_starts(context: AnalysisContext, analysis: WearAnalysis) -> dict[str, Any]:
    """Unknowns at each amplitude by its number, from the mode's branch, and the normalised cycle. Collective."""
    from ..solve.continuation import Continuation
    from ..solve.worn_mode import WornMode

    settings = cast(ModeAnalysis, context.analysis)
    stuck, rest = start_mode(context, settings.linear_mode)
    harmonics = retained(context)
    context.leave_out(harmonics.left_out)
    problem = mode_problem(context, harmonics, stuck, rest)
    low, high = min(settings.amplitude[0], *analysis.amplitude), max(settings.amplitude[1], *analysis.amplitude)
    branch = Continuation(
        problem, problem.initial(low), (low, high), step_control(settings.step), sorted(analysis.amplitude)
    )
    found: dict[str, Any] = {}
    areas = wear_areas(context.case)
    with WornMode(problem, analysis.coefficient, areas) as mode, context.console.progress(context.name):
        for point in points_of(branch):
            if "cycle_unit" not in found:
                load = mode.measure(point.y, np.zeros(len(mode.areas))).load
                found["cycle_unit"] = analysis.cycle_unit or mode.normal_cycle(load)
            _take(context, analysis, point, found)
            if len(found) == 1 + 2 * len(analysis.amplitude):
                break
    if len(found) < 1 + 2 * len(analysis.amplitude):
        context.console.line(f"{context.name}: the mode ends early: {branch.reason}")
    branch.destroy()
    problem.destroy()
    if len(found) < 2:
        raise NotConverged(
            "the mode reaches none of the amplitudes of wear", None, "no start", analysis.amplitude, "lower amplitudes"
        )
    return found


def _take(context: AnalysisContext, analysis: WearAnalysis, point: Any, found: dict[str, Any]) -> None:
    """Keep the unknowns of a point that lies on an amplitude, the first on a branch that folds. Collective."""
    if point.event == "":
        return
    whole = np.concatenate(context.comm.allgather(point.y.getArray(readonly=True).copy()))
    for number, amplitude in enumerate(analysis.amplitude):
        if math.isclose(point.parameter, amplitude, rel_tol=1e-9) and f"y_{number}" not in found:
            found[f"y_{number}"] = whole
            found[f"outcome_{number}"] = np.array([point.newton, point.linear, point.residual])


def _collect(
    context: AnalysisContext, analysis: WearAnalysis, lines: list[Line], results: list[Any], unit: float, folder: Path
) -> Outcome:
    """All lines as one table. Collective."""
    marched = [result for result in results if isinstance(result, dict)]
    failures = _failures(analysis, lines, results)
    reason = "; ".join(failures or sorted({result["reason"] for result in marched}))
    writer = _writer(context, analysis, unit, marched[0] if marched else {})
    try:
        for line in lines:
            _copy(context, writer, line)
        if writer.rows and writer.active:
            keep_pairs(context, writer)
            for name, areas in wear_areas(context.case).items():
                if f"pairs_{name}" in writer.group:
                    writer.dataset(f"pairs_{name}/area", areas, units="m^2", long_name="nodal area")
        writer.close("stopped" if failures else "done", reason)
    finally:
        writer.abandon()
    if writer.rows:
        context.afterwards.append(lambda: shutil.rmtree(folder, ignore_errors=True))
    goal = f"{analysis.cycles:g} normalised cycles at every amplitude, or wear that stops"
    return Outcome(writer.rows, reason, not failures, [result["summary"] for result in marched], goal)


def _failures(analysis: WearAnalysis, lines: list[Line], results: list[Any]) -> list[str]:
    """Amplitudes whose line did not end as it should, with the reason."""
    why = {line.number: _why(result) for line, result in zip(lines, results)}
    reasons = [why.get(number, "not reached by the mode") for number in range(len(analysis.amplitude))]
    return [f"a = {amplitude:g} m: {text}" for amplitude, text in zip(analysis.amplitude, reasons) if text]


def _writer(context: AnalysisContext, analysis: WearAnalysis, unit: float, marched: dict[str, Any]) -> AnalysisWriter:
    """The common table. The run folder is open since the starts were found."""
    context = replace(context, before_first=lambda: None, fields=fields(context.case))
    return context.writer(
        columns(context.case),
        labels=str(marched.get("labels", "")).split(),
        cycle_unit=unit,
        wear_coefficient=analysis.coefficient,
        samples=marched.get("samples"),
        load_scale=marched.get("load_scale"),
    )


def _why(result: Any) -> str:
    """Why a line did not end as it should; empty when it did."""
    if isinstance(result, FretwaveError):
        return str(result)
    return "" if result["status"] == "done" else str(result["reason"])


def _copy(context: AnalysisContext, writer: AnalysisWriter, line: Line) -> None:
    """The rows of a line into the table of all. Collective."""
    active = context.comm.rank == 0
    path = line.folder / "results.h5"
    rows = on_first_rank(context.comm, lambda: _rows_of(path))
    file = open_results(path) if active and rows else None
    for row in range(rows):
        if file is None:
            writer.append({}, None)
        else:
            writer.append(*_row(writer, file[LINE], row))
    if file is not None:
        file.close()


def _rows_of(path: Path) -> int:
    if not has_results(path.parent):
        return 0
    with open_results(path) as file:
        return len(file[LINE]["points"]["point"]) if LINE in file else 0


def _row(writer: AnalysisWriter, group: Any, row: int) -> tuple[Any, ...]:
    """What `AnalysisWriter.append` takes, read back."""
    values = {column.name: column.loaded(group["points"][column.name][row]) for column in writer.columns}
    values["point"] = writer.rows
    reported = np.flatnonzero(group["reported"][()] == row)
    motions = None
    if len(reported):
        names = [name for name in group if name.startswith("contact_")]
        motions = {
            name[len("contact_") :]: {k: group[name][k][reported[0]] for k in names_of_data(group[name])}
            for name in names
        }
    kept = {name: group[name][row] for name in writer.fields}
    return values, group["coefficients"][row], motions, None, kept
