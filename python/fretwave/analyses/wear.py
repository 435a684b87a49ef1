"""``type = "wear"``: fretting wear of a mode at fixed amplitudes over wear cycles, a line for each amplitude.

The mode's unworn branch gives the starts; the lines are independent of each other and share the ranks in groups. Each
keeps its own table in a hidden folder, from which it goes on after a kill; all are put together at the end.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Optional

import numpy as np

from ..case.analysis import AnalysisSection, register_analysis
from ..case.checks_common import check_once
from ..case.checks_size import harmonic_memory
from ..case.contacts import wear_areas as areas_of
from ..case.fields import Positive, Size, Whole, key
from ..case.observed import check_displaced, label_of
from ..errors import FretwaveError, InputError
from ..files.dimensions import names_of_data
from ..mpi import groups
from ..mpi.guard import on_first_rank
from ..results.file import ENDED
from ..results.results import AnalysisWriter, has_results, open_results
from ..results.summaries import WEAR_LINES
from ..solve.steps import TOO_FAST, TOO_MANY, WearControl
from .mode import ModeAnalysis
from .parts.context import AnalysisContext, Outcome
from .parts.rest import keep_pairs
from .parts.wear_line import LINE, Line, columns, fields, march_line
from .parts.wear_start import unworn_starts

if TYPE_CHECKING:
    import h5py
    from mpi4py import MPI

    from ..case.facts import Facts
    from ..case.load import Case
    from ..case.reporter import Reporter
    from ..view.options import ViewOptions


@register_analysis
class WearAnalysis(AnalysisSection):
    """``type = "wear"``: fretting wear of a mode at fixed amplitudes over wear cycles."""

    pictures = ("wear", "wear_pairs")
    summary = WEAR_LINES
    wears = True

    type: Literal["wear"]
    mode: str = key("mode analysis whose settings and branch this one takes", example='"mode"')
    amplitude: list[Size] = key("fixed modal amplitudes, one or a grid", "length", "[1.2e-3]", min_length=1)
    cycles: Positive = key("normalised wear cycles to march", "-", "40.0")
    coefficient: float = key("wear coefficient k_w", "1/pressure", "1e-14", ge=0, allow_inf_nan=False)
    cycle_unit: Optional[Positive] = key(
        "vibration cycles in a normalised one (by default: in which sliding 4 mu N0/kt a cycle leaves 1/e of the load)",
        "-",
        "1e6",
        default=None,
    )
    stepper: Literal["heun", "bogacki_shampine", "trapezoidal", "tr_bdf2"] = key(
        "step over wear cycles: explicit of order 2 or 3, implicit of order 2 (two)",
        example='"tr_bdf2"',
        default=WearControl.stepper,
    )
    tolerance: Positive = key(
        "estimated error of a step's depths, relative to a pair's own and the one that takes the mean load away",
        "-",
        "1e-4",
        default=WearControl.tolerance,
        lt=1,
    )
    pressure_change: Positive = key(
        "largest change of a pair's contact pressure in a step, relative to the mean",
        "-",
        "0.1",
        default=WearControl.pressure_change,
    )
    max_points: Whole = key(
        "largest number of points at an amplitude", example="5000", default=WearControl.max_points, ge=2
    )
    report_at: list[Positive] = key(
        "normalised cycles at which the motion of a period is kept", "-", "[10.0, 40.0]", default_factory=list
    )
    harmonics: Optional[Whole] = key("highest harmonic, in place of the mode's", example="5", default=None, ge=1)
    samples: Optional[Whole] = key(
        "time samples of a period, in place of the mode's", example="256", default=None, ge=4
    )
    errors: Optional[bool] = key(
        "estimate the errors of the mode at the depths of every point, or of none (by default, where the mode "
        "estimates its own, at the first point, those of `report_at` and the last)",
        example="true",
        default=None,
    )

    def settings(self, case: Case) -> ModeAnalysis:
        """Its mode, with what it gives in place of the mode's."""
        mode = case.analyses.of(ModeAnalysis)[self.mode]
        names = ("harmonics", "samples", "errors")
        own = {name: getattr(self, name) for name in names if getattr(self, name) is not None}
        own |= {"name": self.name, "dampers": self.dampers or mode.dampers, "accuracy": None}
        return mode.model_copy(update=own)

    def decided_by(self) -> list[str]:
        return [self.mode]

    def check(self, report: Reporter, facts: Facts) -> None:
        super().check(report, facts)
        report.mode(("mode",), self.mode, facts.analyses_of("mode"))
        check_once(report, "amplitude", self.amplitude)
        check_displaced(report, "mode", self.mode, facts)
        self._check_motion(report, facts)
        by_accuracy = {str(entry.get("name")) for entry in facts.source.entries("analysis") if "accuracy" in entry}
        if self.harmonics is None and self.mode in by_accuracy:
            expected, fix = "a set for all cycles: the mode chooses its own", "add for example `harmonics = 7`"
            report.wrong(("harmonics",), "is missing beside a mode with `accuracy`", expected, fix)
        for index, value in enumerate(self.report_at):
            if value > self.cycles:
                expected = f"at most cycles = {self.cycles:g}"
                report.wrong(("report_at", index), "is beyond the last cycle", expected, "move it, or raise cycles")
        if facts.model_known and facts.complete:
            self._check_contacts(report, facts)

    def _check_motion(self, report: Reporter, facts: Facts) -> None:
        """One sector is marched for all: they wear alike in a travelling wave alone. Worn depth moves the mean."""
        mode = next((entry for entry in facts.source.entries("analysis") if entry.get("name") == self.mode), {})
        if mode.get("wheel") and (mode.get("mistuning") is not None or mode.get("wave") == "standing"):
            fix = "add a mode of one sector with its nodal_diameter, and name that"
            what = "moves the sectors of a wheel differently, which is not marched"
            report.wrong(("mode",), what, "a travelling wave of equal sectors, which wear alike", fix)
        if mode.get("retain") == "odd":
            fix = f"give '{self.mode}' retain = \"all\", or leave retain out"
            report.wrong(("mode",), "retains odd harmonics alone", "the mean among them, which worn depth moves", fix)

    def _check_contacts(self, report: Reporter, facts: Facts) -> None:
        """A contact with a normal direction, and the areas of its pairs."""
        try:
            areas_of(facts.contacts)
        except InputError as error:
            where = report.source.where((*report.path, "type"))
            measured = ": ".join(str(part) for part in (error.where, error.measured) if part)
            report.found.append(InputError(error.what, where, measured, error.expected, error.fix))

    def least_memory(self, facts: Facts) -> Mapping[str, float]:
        return harmonic_memory(self.harmonics, self.samples, 1, facts) if self.harmonics else {}

    def headline(self) -> str:
        amplitudes = ", ".join(f"{amplitude:g}" for amplitude in self.amplitude)
        return (
            f"wear of '{self.mode}' at a = {amplitudes} {self.units('length')} over {self.cycles:g} normalised cycles"
        )

    def run(self, context: AnalysisContext[WearAnalysis]) -> Outcome:
        """March all amplitudes. Collective."""
        settings = self.settings(context.case)
        folder = context.folder / f".{context.name}_lines"
        kept = groups.Kept(folder, str(context.attributes["run_id"]))
        starts = on_first_rank(context.comm, lambda: kept.load(0))
        if starts is None:
            starts = unworn_starts(context.of(settings), self)
            context.before_first()
            found = {**starts, **context.arrays}
            on_first_rank(context.comm, lambda: kept.save(0, found))
        elif "rest_displacement" in starts:  # of a run that is gone on with
            context.arrays["rest_displacement"] = starts["rest_displacement"]
        lines = [
            Line(number, amplitude, starts[f"y_{number}"], starts[f"outcome_{number}"], folder / f"line_{number:03d}")
            for number, amplitude in enumerate(self.amplitude)
            if f"y_{number}" in starts
        ]
        unit = float(starts["cycle_unit"])
        if settings.errors and self.errors is None:
            context.leave_out(["errors of the points between those of report_at (errors = true)"])
        context.console.line(f"{context.name}: a normalised cycle is {unit:.6g} vibration cycles")
        march = LineRunner(context, settings, unit)
        apart = None if groups.seen_by_all(context.comm, kept.file(0)) else 1  # their files are to meet in one folder
        results = groups.run(context.comm, lines, march, apart)
        return _collect(context, lines, results, unit, folder)

    def view(
        self, folder: Path, case: Case, options: ViewOptions, say: Callable[[str], None]
    ) -> Optional[Sequence[Path]]:
        """The pairs over wear cycles, unless points are asked for."""
        from ..view.wear import view_wear

        return None if options.points else view_wear(folder, case, self.name, options, say)


class LineRunner:
    """Does a line on a group of ranks."""

    def __init__(self, context: AnalysisContext[WearAnalysis], settings: ModeAnalysis, unit: float) -> None:
        self.context, self.settings, self.unit = context, settings, unit

    def __call__(self, line: Line, group: MPI.Comm) -> dict[str, Any]:
        return march_line(self.context, self.settings, self.unit, line, group)


def _collect(
    context: AnalysisContext[WearAnalysis], lines: list[Line], results: list[Any], unit: float, folder: Path
) -> Outcome:
    """All lines as one table. Collective."""
    analysis = context.analysis
    marched = [result for result in results if isinstance(result, dict)]
    failures = _failures(analysis, lines, results)
    reason = "; ".join(failures or sorted({result["reason"] for result in marched}))
    writer = _writer(context, unit, marched[0] if marched else {})
    try:
        for line in lines:
            _copy(context, writer, line)
        if writer.rows and writer.active:
            keep_pairs(context, writer)
        ended = [line.number for line, result in zip(lines, results) if not _why(result)]
        writer.close("stopped" if failures else "done", reason, **{ENDED: json.dumps(ended)})
    finally:
        writer.abandon()
    if writer.rows:
        context.afterwards.append(lambda: shutil.rmtree(folder, ignore_errors=True))
    goal = f"{analysis.cycles:g} normalised cycles at every amplitude, or wear that stops"
    advice = march_advice(context.name, reason) if failures else ""
    summary = [line for result in marched for line in (result["summary"], *result["missed"])]
    return Outcome(writer.rows, reason, not failures, summary, goal, advice)


def march_advice(name: str, reason: str) -> str:
    """What helps a march that stopped before its goal."""
    if TOO_MANY in reason:
        return f"--set {name}.max_points=20000, a larger `tolerance` or `pressure_change`, or fewer cycles"
    if TOO_FAST in reason or "stage" in reason:
        return f"--set {name}.pressure_change=0.05, another stepper (--set {name}.stepper=tr_bdf2), or fewer cycles"
    return f"fewer cycles (what wore until then is kept), or other amplitudes (--set '{name}.amplitude=[...]')"


def _failures(analysis: WearAnalysis, lines: list[Line], results: list[Any]) -> list[str]:
    """Amplitudes whose line did not end as it should, with the reason."""
    why = {line.number: _why(result) for line, result in zip(lines, results)}
    reasons = [why.get(number, "not reached by the mode") for number in range(len(analysis.amplitude))]
    unit = analysis.units("length")
    return [f"a = {amplitude:g} {unit}: {text}" for amplitude, text in zip(analysis.amplitude, reasons) if text]


def _writer(context: AnalysisContext[WearAnalysis], unit: float, marched: dict[str, Any]) -> AnalysisWriter:
    """The common table. The run folder is open since the starts were found."""
    context = replace(context, before_first=lambda: None, fields=fields(context.case))
    return context.writer(
        columns(context.case),
        labels=str(marched.get("labels", "")).split(),
        normalise=label_of(context.analysis.settings(context.case).normalise),
        cycle_unit=unit,
        wear_coefficient=context.analysis.coefficient,
        samples=marched.get("samples"),
        load_scale=marched.get("load_scale"),
    )


def _why(result: FretwaveError | dict[str, Any]) -> str:
    """Why a line did not end as it should; empty when it did."""
    if isinstance(result, FretwaveError):
        return str(result)
    return "" if result["status"] == "done" else str(result["reason"])


def _copy(context: AnalysisContext[WearAnalysis], writer: AnalysisWriter, line: Line) -> None:
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


def _row(writer: AnalysisWriter, group: h5py.Group, row: int) -> tuple[Any, ...]:
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
