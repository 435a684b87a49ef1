"""What a run as a whole left out, and why: said at its end."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..case.analysis import AnalysisSection
from ..case.load import Case
from ..texts import toml


def left_out_lines(
    case: Case, names: Sequence[str], entries: Mapping[str, Mapping[str, Any]], plots: bool
) -> list[str]:
    """A line of what all analyses left out, and one for each set of them that left out more.

    Parameters
    ----------
    case : as it was solved, reduced where it asks for that
    names : the run's analyses
    entries : what run.json says of each
    """
    by_reason: dict[str, list[str]] = {}
    for name in names:
        own = entries.get(name, {}).get("left_out", [])
        for reason in [*own, *_of_an_analysis(case, case.analyses[name])]:
            by_reason.setdefault(reason, []).append(name)
    lines = {tuple(names): [reason for reason, found in by_reason.items() if found == list(names)]}
    for reason, found in by_reason.items():
        if found != list(names):
            lines.setdefault(tuple(found), []).append(reason)
    lines[tuple(names)] += _of_the_run(case, names, list(by_reason), plots)
    return [_line("" if found == tuple(names) else f" of {', '.join(found)}", told) for found, told in lines.items()]


def _line(where: str, reasons: Sequence[str]) -> str:
    return f"left out{where}: {'; '.join(reasons)}" if reasons else "nothing was left out"


def _of_an_analysis(case: Case, analysis: AnalysisSection) -> list[str]:
    """What it does not say itself."""
    harmonic = analysis.settings(case).harmonic()
    found = of_the_flow(case, analysis)
    if harmonic is None:
        return found
    if case.neighbours is not None and (analysis.wears or not harmonic.wheel):
        others, of_one = case.neighbours.sectors - 1, ": work and worn volumes are of one" if analysis.wears else ""
        found.append(f"{others} of {others + 1} sectors (a wave moves them as this one, each a phase later{of_one})")
    if not harmonic.errors:
        found.append("errors of the points (errors = false)")
    return found


def of_the_flow(case: Case, analysis: AnalysisSection) -> list[str]:
    """That a case has forces which this analysis does not take."""
    harmonic = analysis.settings(case).harmonic()
    if (
        case.aerodynamics is None
        or analysis.type == "sweep"
        or (harmonic is not None and (harmonic.aerodynamics or harmonic.follows_waves()))
    ):
        return []
    why = f"type = {toml(analysis.type)} has none" if harmonic is None else "aerodynamics = false"
    return [f"the forces of the flow ({why})"]


def _of_the_run(case: Case, names: Sequence[str], said: Sequence[str], plots: bool) -> list[str]:
    """What no analysis did."""
    unasked = []
    if case.reduced is None:
        unasked.append("reduction")
    if not any(case.analyses[name].wears for name in names):
        unasked.append("wear")
    if not any(case.analyses[name].integrates() for name in names) and not any(
        "time integration" in reason for reason in said
    ):
        unasked.append("time integration")
    found = [f"{', '.join(unasked)} (not asked for)"] if unasked else []
    return found if plots else [*found, "pictures (--no-plots)"]
