"""Checks between entries of a case: names that must exist, ranges, counts. All before anything runs."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING

from ..errors import CaseErrors, InputError
from ..registry import kind_named, kinds
from ..texts import display, nearest, toml
from .analysis import AnalysisSection
from .checks_wheel import with_measured
from .facts import Facts
from .reporter import Found, Reporter
from .schema import TOP_LEVEL
from .toml.source import Source
from .toml.validation import unknown_key, validate

if TYPE_CHECKING:
    from .load import Case


def read_analyses(source: Source, found: Found) -> dict[int, AnalysisSection]:
    """Validated ``[[analysis]]`` entries by their number in the file."""
    analyses: dict[int, AnalysisSection] = {}
    for number, entry in enumerate(source.entries("analysis")):
        name = entry.get("type")
        kind = kind_named(name) if isinstance(name, str) else None
        if kind is None:
            found.append(_unknown_type(source, number, name, list(kinds())))
            continue
        section = validate(kind, source, ("analysis", number), found)
        if section is not None:
            analyses[number] = section
    _check_names(source, found)
    return analyses


def check_top_level(source: Source, found: Found) -> None:
    """Known tables of the right shape, and at least one analysis."""
    for key in source.data:
        if key not in TOP_LEVEL:
            found.append(unknown_key(source, (key,), list(TOP_LEVEL)))
    names = ("model", "reduction", "preload", "damping", "aerodynamics", "material", "uncertainty", "quick", "study")
    tables = dict.fromkeys(names, dict)
    arrays = dict.fromkeys(("contact", "gauge", "analysis"), list)
    shapes = {**tables, **arrays, "title": str}
    writing = {**{name: f"[{name}]" for name in tables}, **{name: f"[[{name}]]" for name in arrays}}
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


def _unknown_type(source: Source, number: int, kind: object, known: list[str]) -> InputError:
    path = ("analysis", number)
    if kind is None:
        return InputError(
            f"the key 'type' is missing in {source.name(path)}",
            where=source.where(path),
            expected=f"one of {', '.join(known)}",
            fix='add for example `type = "mode"`',
        )
    return InputError(
        f"unknown type of analysis in {source.name(path)}",
        where=source.where((*path, "type")),
        measured=f"type = {toml(kind)}",
        expected=f"one of {', '.join(known)}",
        fix=nearest(str(kind), known) or "choose one of these",
    )


def _check_names(source: Source, found: Found) -> None:
    """Names are addresses of ``--set`` and file names: unique, and none of the top-level keys."""
    for kind in ("analysis", "contact", "gauge"):
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


def check_analyses(source: Source, analyses: dict[int, AnalysisSection], facts: Facts, found: Found) -> None:
    """Everything about the analyses that involves more than one key."""
    for number, analysis in analyses.items():
        analysis.check(Reporter(source, ("analysis", number), found), facts)


def complete_analyses(source: Source, analyses: dict[int, AnalysisSection], facts: Facts, found: Found) -> None:
    """Give every analysis what follows from the model."""
    for number, analysis in list(analyses.items()):
        report = Reporter(source, ("analysis", number), found)
        analyses[number] = with_measured(report, analysis, facts).completed(report, facts)


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


def check_chosen(analyses: Iterable[AnalysisSection], case: Case) -> None:
    """Of analyses that are to run, what is wrong beside those that they read.

    Raises
    ------
    CaseErrors
        All of it.
    """
    found = [error for analysis in analyses for error in analysis.check_chosen(case)]
    if found:
        raise CaseErrors(found, display(case.path))
