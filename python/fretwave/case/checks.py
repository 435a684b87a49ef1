"""Checks between entries of a case: names that must exist, ranges, counts. All before anything runs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from ..errors import FretwaveError, InputError
from ..mpi.petsc_options import parse
from ..texts import nearest, toml
from .checks_sweep import complaint
from .reporter import Reporter
from .schema import (
    ANALYSES,
    TOP_LEVEL,
    AnalysisSection,
    FlutterAnalysis,
    ForcedAnalysis,
    HarmonicSection,
    ModeAnalysis,
    SweepAnalysis,
    TransientSection,
    WearAnalysis,
)
from .toml.source import Source, nested_leaves
from .toml.validation import unknown_key, validate

Found = list[FretwaveError]


def read_analyses(source: Source, found: Found) -> dict[int, AnalysisSection]:
    """Validated ``[[analysis]]`` entries by their number in the file."""
    analyses: dict[int, AnalysisSection] = {}
    for number, entry in enumerate(source.entries("analysis")):
        kind = entry.get("type")
        if not isinstance(kind, str) or kind not in ANALYSES:
            found.append(_unknown_type(source, number, kind))
            continue
        section = validate(ANALYSES[kind], source, ("analysis", number), found)
        if section is not None:
            analyses[number] = section
    _check_names(source, found)
    return analyses


def check_top_level(source: Source, found: Found) -> None:
    """Known tables of the right shape, and at least one analysis."""
    for key in source.data:
        if key not in TOP_LEVEL:
            found.append(unknown_key(source, (key,), list(TOP_LEVEL)))
    tables = dict.fromkeys(("model", "reduction", "preload", "aerodynamics", "quick", "study"), dict)
    shapes = {**tables, "contact": list, "analysis": list, "title": str}
    writing = {**{name: f"[{name}]" for name in tables}, "contact": "[[contact]]", "analysis": "[[analysis]]"}
    for key, shape in shapes.items():
        value = source.data.get(key)
        bad = value is not None and not isinstance(value, shape)
        bad = bad or (shape is list and value is not None and not source.entries(key) and value != [])
        if bad or (value is None and key in ("model", "analysis")) or (key == "analysis" and value == []):
            header = writing.get(key, 'title = "..."')
            found.append(
                InputError(
                    f"'{key}' is missing" if not bad else f"'{key}' is not written as {header}",
                    where=source.where((key,)),
                    measured=None if value is None else toml(value),
                    expected=TOP_LEVEL[key],
                    fix=f"write {header}",
                )
            )


def _unknown_type(source: Source, number: int, kind: Any) -> InputError:
    path = ("analysis", number)
    if kind is None:
        return InputError(
            f"the key 'type' is missing in {source.name(path)}",
            where=source.where(path),
            expected=f"one of {', '.join(ANALYSES)}",
            fix='add for example `type = "mode"`',
        )
    return InputError(
        f"unknown type of analysis in {source.name(path)}",
        where=source.where((*path, "type")),
        measured=f"type = {toml(kind)}",
        expected=f"one of {', '.join(ANALYSES)}",
        fix=nearest(str(kind), list(ANALYSES)) or "choose one of these",
    )


def _check_names(source: Source, found: Found) -> None:
    """Names are addresses of ``--set`` and file names: unique, and none of the top-level keys."""
    for kind in ("analysis", "contact"):
        seen: dict[str, int] = {}
        for number in range(len(source.entries(kind))):
            name = source.entry_name(kind, number)
            path = (kind, number, "name")
            if name is None:
                continue
            if name in seen:
                first = source.where((kind, seen[name], "name")).split(" (")[0]
                problem = f"two entries of [[{kind}]] have the name '{name}'"
                found.append(
                    InputError(problem, source.where(path), f"first used at {first}", "unique names", "rename one")
                )
            elif kind == "analysis" and name in TOP_LEVEL:
                found.append(
                    InputError(
                        f"an analysis cannot have the name '{name}'",
                        source.where(path),
                        expected=f"any name but {', '.join(TOP_LEVEL)}",
                        fix=f'write for example `name = "{name}_1"`',
                    )
                )
            seen.setdefault(name, number)


def check_analyses(
    source: Source, analyses: dict[int, AnalysisSection], dofs: Sequence[str] | None, found: Found
) -> None:
    """Everything about the analyses that involves more than one key."""
    modes = [str(entry.get("name")) for entry in source.entries("analysis") if entry.get("type") == "mode"]
    for number, analysis in analyses.items():
        report = Reporter(source, ("analysis", number), found)
        for index, damper in enumerate(analysis.dampers):
            report.dof(("dampers", index, "dof"), damper.dof, dofs)
        _check_petsc(report, analysis)
        if isinstance(analysis, HarmonicSection):
            _check_harmonics(report, analysis, dofs)
        if isinstance(analysis, (ModeAnalysis, FlutterAnalysis)):
            report.dof(("normalise",), analysis.normalise, dofs)
            _check_range(report, "amplitude", analysis.amplitude, analysis.report_at)
        if isinstance(analysis, ForcedAnalysis):
            _check_forced(report, analysis, dofs, modes)
        if isinstance(analysis, TransientSection):
            report.mode(("mode",), analysis.mode, modes)
        if isinstance(analysis, SweepAnalysis):
            _check_sweep(report, analysis)
        if isinstance(analysis, WearAnalysis):
            _check_wear(report, analysis, modes)


def _check_sweep(report: Reporter, analysis: SweepAnalysis) -> None:
    """The values themselves are checked by loading the case with each, before anything runs."""
    entries = report.source.entries("analysis")
    swept = [str(entry.get("name")) for entry in entries if entry.get("type") != "sweep"]
    if analysis.of not in swept:
        expected = f"one of {', '.join(swept) or '(there is none)'}"
        report.wrong(("of",), "is no analysis to sweep", expected, nearest(analysis.of, swept) or "choose another")
    for path, values in nested_leaves(analysis.over):
        problem = complaint(values)
        if problem is not None:
            report.wrong(("over", *path), *problem, "write for example `over = { mode.harmonics = [3, 5, 7] }`")
    if analysis.dampers:
        report.wrong(("dampers",), "are not those of the analysis swept", "none", f"give them to '{analysis.of}'")


def _check_wear(report: Reporter, analysis: WearAnalysis, modes: list[str]) -> None:
    report.mode(("mode",), analysis.mode, modes)
    for index, value in enumerate(analysis.report_at):
        if value > analysis.cycles:
            expected = f"at most cycles = {analysis.cycles:g}"
            report.wrong(("report_at", index), "is beyond the last cycle", expected, "move it, or raise cycles")


def _check_harmonics(report: Reporter, analysis: HarmonicSection, dofs: Sequence[str] | None) -> None:
    least = 2 * analysis.harmonics + 2
    if analysis.samples is not None and analysis.samples % 2:
        report.wrong(("samples",), "is odd", "an even number", f"write `samples = {analysis.samples + 1}`")
    elif analysis.samples is not None and analysis.samples < least:
        report.wrong(
            ("samples",),
            "is too small",
            f"at least 2 H + 2 = {least} for harmonics = {analysis.harmonics}",
            f"write `samples = {_samples(analysis.harmonics)}`, or leave the key out",
        )
    by_wave = analysis.mistuning is None or analysis.nodal_diameter is not None  # else of the whole wheel
    if dofs is not None and by_wave and analysis.linear_mode > len(dofs):
        report.wrong(
            ("linear_mode",), "does not exist", f"1 to {len(dofs)}, the number of dofs", "write `linear_mode = 1`"
        )
    step = analysis.step
    if not step.minimum <= step.initial <= step.maximum:
        report.wrong(
            ("step",),
            "is out of order",
            f"minimum <= initial <= maximum, not {step.minimum:g}, {step.initial:g}, {step.maximum:g}",
            "for example `step = { minimum = 1e-8, initial = 0.05, maximum = 0.3 }`",
        )


def _samples(harmonics: int) -> int:
    """A power of two with room above the highest harmonic."""
    return int(2 ** max(6, (8 * harmonics).bit_length()))


def _check_range(report: Reporter, key: str, ends: list[float], inside: list[float]) -> None:
    if not ends[0] < ends[1]:
        report.wrong(
            (key,), "is not a range", "first value < last value", f"write `{key} = [{min(ends)}, {2 * max(ends)}]`"
        )
        return
    for index, value in enumerate(inside):
        if not ends[0] <= value <= ends[1]:
            report.wrong(
                ("report_at", index),
                "is outside the branch",
                f"a value within {key} = {toml(ends)}",
                "move it, or widen the range",
            )


def _check_forced(report: Reporter, analysis: ForcedAnalysis, dofs: Sequence[str] | None, modes: list[str]) -> None:
    _check_range(report, "frequency", analysis.frequency, analysis.report_at)
    report.dof(("observe",), analysis.observe, dofs)
    for dof in analysis.force:
        report.dof(("force", dof), dof, dofs)
    if not any(analysis.force.values()):
        report.wrong(
            ("force",), "is zero", "a force amplitude other than 0", "write for example `force = { m1 = 1.0 }`"
        )
    listed = isinstance(analysis.backbone, list)
    for index, name in enumerate(analysis.backbone if listed else [str(analysis.backbone)]):
        report.mode(("backbone", index) if listed else ("backbone",), name, modes)


def _check_petsc(report: Reporter, analysis: AnalysisSection) -> None:
    try:
        parse(analysis.petsc)
    except InputError as error:
        report.wrong(("petsc",), f"cannot be used: {error.what}", str(error.expected), str(error.fix))


def choose(names: Sequence[str], only: Sequence[str], origin: str = "--only") -> list[str]:
    """Names selected by ``--only``, in the order of the file.

    Raises
    ------
    InputError
        A name is not an analysis of the case.
    """
    for name in only:
        if name not in names:
            raise InputError(
                f"there is no analysis '{name}'",
                where=origin,
                expected=f"one of {', '.join(names)}",
                fix=nearest(name, names) or "choose from these names",
            )
    selected: Callable[[str], bool] = lambda name: not only or name in only  # noqa: E731
    return [name for name in names if selected(name)]
