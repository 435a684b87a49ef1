"""What every analysis is asked: its dampers, its PETSc options, time integration, its preload, its size."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Optional

from ..errors import InputError
from ..files.memory import machine_memory, size
from ..model.laws import law_like
from ..mpi.petsc_values import parse
from ..texts import nearest, toml
from .observed import given_to
from .reporter import Reporter
from .schema import PreloadSection
from .toml.validation import at

if TYPE_CHECKING:
    from .analysis import AnalysisSection
    from .facts import Facts


#: Keys whose numbers name branches, states or points: one that stands twice makes two of one name.
EACH_ONCE = ("levels", "factors", "nodal_diameters", "speeds_rpm", "engine_orders", "report_at")


def check_once(report: Reporter, key: str, values: Sequence[float]) -> None:
    """Each value of a key stands there once."""
    for index, value in enumerate(values):
        if value in values[:index]:
            report.wrong((key, index), f"is {value:g} again", "each value once", "remove it")


def check_common(report: Reporter, analysis: AnalysisSection, facts: Facts) -> None:
    """All that is wrong whatever the kind."""
    for index, damper in enumerate(analysis.dampers):
        report.dof(("dampers", index, "dof"), damper.dof, facts.named)
    _check_petsc(report, analysis)
    for key in EACH_ONCE:
        check_once(report, key, getattr(analysis, key, None) or ())
    if facts.loads is not None:
        own = Reporter(report.source, (*report.path, "preload"), report.found)
        check_loads(own, analysis.own_preload(), facts.loads)
    if analysis.integrates():
        _check_time_integration(report, analysis, analysis.integrates(), facts)
    if facts.model_known:
        _check_size(report, analysis, facts)


def _check_petsc(report: Reporter, analysis: AnalysisSection) -> None:
    try:
        parse(analysis.petsc)
    except InputError as error:
        report.wrong(("petsc",), f"cannot be used: {error.what}", str(error.expected), str(error.fix))


def check_loads(report: Reporter, section: Optional[PreloadSection], known: Sequence[str]) -> None:
    """Loads come with the model; each acts once."""
    given = section.loads if section else []
    for index, name in enumerate(given):
        if name in given[:index]:
            report.wrong(("loads", index), "is named twice, and would act twice", "each load once", "leave it out")
        if name not in known:
            fix = nearest(name, list(known)) or "static loads come with a model that is built"
            named = ", ".join(known) or "(there is none)"
            report.wrong(("loads", index), "is no load of the model", f"one of {named}", fix)


def _loaded_by(analysis: AnalysisSection, facts: Facts) -> str:
    """What gives an analysis a static state: its own key, that of the mode it starts from, the case; empty if none."""
    for name in (analysis.name, *analysis.decided_by()):
        if _acts(given_to(facts, name, "preload")):
            return f"the preload of '{name}'"
    replaced = given_to(facts, analysis.name, "preload") is not None
    return "[preload]" if facts.preload is not None and not replaced else ""


def _acts(preload: object) -> bool:
    """As it stands in the case; without loads, and pairs in balance as they are, it is as none."""
    if not isinstance(preload, dict):
        return preload is not None
    as_they_are = all(preload.get(key, True) is True for key in ("pair_loads", "balanced"))
    return bool(preload.get("loads")) or not as_they_are


def _check_time_integration(report: Reporter, analysis: AnalysisSection, key: str, facts: Facts) -> None:
    """It sees the present motion of a whole structure alone: no wave, no preload, no place of a slider."""
    whole = key == "type"
    loaded = _loaded_by(analysis, facts)
    if loaded:
        what, expected = "needs time integration, which does not know a preload", "analyses of harmonic balance"
        report.wrong((key,), what, expected, f"remove the analysis, or {loaded}" if whole else f"write `{key} = 0`")
    if facts.model_known and facts.neighbours is not None:
        what = "integrates in time, which a model of sectors cannot, be it one sector or the whole wheel"
        about(report, key, what, "harmonic balance", "remove the analysis" if whole else f"write `{key} = 0`")
    named = next((c for c in facts.contacts if getattr(facts.laws.get(str(c.law)), "memory", False)), None)
    if named is not None:
        report.wrong(
            (key,),
            f"needs time integration, which does not know the law '{named.law}' of contact '{named.name}'",
            f"a law of the present motion, such as {law_like(lambda law: not law.memory)}",
            "remove the analysis, or take such a law" if whole else f"write `{key} = 0`",
        )


def about(report: Reporter, key: str, what: str, expected: str, fix: str) -> None:
    """A problem of the whole analysis that a key of it shows."""
    path = (*report.path, key)
    measured = at(report.source.data, path)
    text = None if measured is None else f"{key} = {toml(measured)}"
    name = report.source.name(report.path)
    report.found.append(InputError(f"{name} {what}", report.source.where(path), text, expected, fix))


def _check_size(report: Reporter, analysis: AnalysisSection, facts: Facts) -> None:
    """It fits into memory by the least that it can need."""
    parts, available = analysis.least_memory(facts), machine_memory()
    least = sum(parts.values())
    if least > available:
        key, shown = max(parts.items(), key=lambda part: part[1])[0].split(": ", 1)
        report.wrong(
            (key,),
            f"takes at least {size(least)} of memory: {shown}",
            f"at most the {size(available)} that there is",
            "lower it, or take a machine with more memory",
        )
