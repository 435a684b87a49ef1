"""``fretwave check --keys``: every key of a case file with its default, unit and meaning; ``--schema``: for editors."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from pathlib import Path

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from ..case.analysis import AnalysisSection
from ..case.analysis_tables import Damper, MistuningSection, StepSection
from ..case.json_schema import json_text
from ..case.observed import ObservedTable
from ..case.plugins import read_plugins
from ..case.schema import (
    TOP_LEVEL,
    AerodynamicsSection,
    ContactSection,
    DampingSection,
    DistributionSection,
    GaugeSection,
    MaterialSection,
    ModelSection,
    PreloadSection,
    ReductionSection,
    StudySection,
    UncertaintySection,
)
from ..case.toml.source import Source
from ..case.toml.validation import describe
from ..errors import CaseErrors, FretwaveError
from ..registry import kinds


def key_lines(case: Path | None = None) -> Iterator[str]:
    """The reference, section by section; keys that all analyses share are said once.

    Parameters
    ----------
    case : whose plug-ins' analyses are listed too, and in whose units; without it units are of quantities
    """
    if case is not None:
        _load_plugins(case)
    units = str if case is None else Source(case).units
    yield "top level"
    yield from (f"  {name:<18} {'':<12} {text}" for name, text in TOP_LEVEL.items() if name in ("title", "plugins"))
    sections: dict[str, type[BaseModel]] = {
        "[model]": ModelSection,
        "[reduction]": ReductionSection,
        "[preload]": PreloadSection,
        "[damping]": DampingSection,
        "[aerodynamics]": AerodynamicsSection,
        "[uncertainty]": UncertaintySection,
        "[[contact]] (and the parameters of its law)": ContactSection,
        "[material]": MaterialSection,
        "[[gauge]]": GaugeSection,
        "[[analysis]]": AnalysisSection,
    }
    for title, section in sections.items():
        yield title
        yield from _section(section, units)
    for kind, analysis in kinds().items():
        yield f'[[analysis]] with type = "{kind}"'
        yield from _section(analysis, units, without=set(AnalysisSection.model_fields))
    tables: dict[str, type[BaseModel]] = {
        "step = { ... }": StepSection,
        "mistuning = { ... }": MistuningSection,
        "dampers = [{ ... }]": Damper,
        "normalise = { ... }, observe = { ... }": ObservedTable,
        "values.KEY = { ... }, factors.KEY = { ... } of [uncertainty]": DistributionSection,
        "[study]": StudySection,
    }
    for title, nested in tables.items():
        yield title
        yield from _section(nested, units)


def schema_text(case: Path | None = None) -> str:
    """The JSON schema of case files; with the analyses and laws of a case's plug-ins."""
    if case is not None:
        _load_plugins(case)
    from ..model.laws import laws

    return json_text(laws())


def _load_plugins(case: Path) -> None:
    source, found = Source(case), list[FretwaveError]()
    read_plugins(source, found)
    if found:
        raise CaseErrors(found, source.label)


def _section(section: type[BaseModel], units: Callable[[str], str], without: Collection[str] = ()) -> Iterator[str]:
    for name, field in section.model_fields.items():
        if name not in without:
            yield f"  {name:<18} {_default(field):<12} {describe(field, units)}"


def _default(field: FieldInfo) -> str:
    if field.is_required():
        return "required"
    value = field.get_default(call_default_factory=True)
    return "-" if value in (None, "", []) or isinstance(value, BaseModel) else str(value)
