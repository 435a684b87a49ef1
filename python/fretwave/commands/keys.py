"""``fretwave check --keys``: every key of a case file with its default, unit and meaning; ``--schema``: for editors."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from pathlib import Path
from typing import Literal, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from ..case.analysis import AnalysisSection
from ..case.analysis_tables import Damper, MistuningSection, StepSection
from ..case.contact_parameters import PER_AREA, has_per_area
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
from ..errors import CaseErrors, FretwaveError, InputError
from ..model.law_info import LawInfo
from ..registry import kinds
from ..results.model_file import read_sources
from ..units import SI, SYSTEMS

#: What stands at the top level and is no section with keys of its own.
LINES = ("title", "plugins", "quick")
#: Sections of a case by their titles.
SECTIONS: Mapping[str, type[BaseModel]] = {
    "[model]": ModelSection,
    "[reduction]": ReductionSection,
    "[preload]": PreloadSection,
    "[damping]": DampingSection,
    "[aerodynamics]": AerodynamicsSection,
    "[uncertainty]": UncertaintySection,
    "[[contact]] (and the parameters of its law: numbers, lists or .csv files, one value a pair)": ContactSection,
    "[material]": MaterialSection,
    "[[gauge]]": GaugeSection,
    "[[analysis]]": AnalysisSection,
}
#: Tables inside them, and what no run reads.
TABLES: Mapping[str, type[BaseModel]] = {
    "step = { ... }": StepSection,
    "mistuning = { ... }": MistuningSection,
    "dampers = [{ ... }]": Damper,
    "normalise = { ... }, observe = { ... }": ObservedTable,
    "values.KEY = { ... }, factors.KEY = { ... } of [uncertainty]": DistributionSection,
    "[study]": StudySection,
}


def key_lines(case: Path | None = None) -> Iterator[str]:
    """The reference, section by section; keys that all analyses share are said once.

    Parameters
    ----------
    case : whose plug-ins' analyses and laws are listed too, and in whose units; without it units are of quantities
    """
    if case is not None:
        _load_plugins(case)
    from ..model.laws import laws

    units = str if case is None else _symbols(Source(case))
    yield "top level"
    yield from (f"  {name:<18} {'':<12} {text}" for name, text in TOP_LEVEL.items() if name in LINES)
    for title, section in SECTIONS.items():
        yield from _titled(title, section, units)
        if section is ContactSection:
            for law in laws().values():
                yield from _law(law, units)
    for kind, analysis in kinds().items():
        yield from _titled(f'[[analysis]] with type = "{kind}"', analysis, units, AnalysisSection.model_fields)
    for title, table in TABLES.items():
        yield from _titled(title, table, units)


def schema_text(case: Path | None = None) -> str:
    """The JSON schema of case files; with the analyses and laws of a case's plug-ins."""
    if case is not None:
        _load_plugins(case)
    from ..model.laws import laws

    return json_text(laws())


def _symbols(source: Source) -> Callable[[str], str]:
    """The units that the case or its model file declares; quantities where they are not known."""
    model = source.data.get("model")
    model = model if isinstance(model, dict) else {}
    if "units" in model:
        return SYSTEMS.get(str(model["units"]), str)
    if not {"file", "builder"} & set(model):
        return source.units
    try:
        return SYSTEMS.get(read_sources(source.path.parent / str(model["file"]))[0], SI)
    except (KeyError, InputError):
        return str


def _load_plugins(case: Path) -> None:
    source, found = Source(case), list[FretwaveError]()
    read_plugins(source, found)
    if found:
        raise CaseErrors(found, source.label)


def _titled(
    title: str, section: type[BaseModel], units: Callable[[str], str], without: Collection[str] = ()
) -> Iterator[str]:
    """The title and a line for each key, but for some."""
    yield title
    for name, field in section.model_fields.items():
        if name not in without:
            yield f"  {name:<18} {_default(field):<12} {describe(field, units)}{_choices(field.annotation)}"


def _choices(annotation: object) -> str:
    """The words that a key takes, where it takes no others."""
    if get_origin(annotation) is Literal:
        return f" (one of {', '.join(map(str, get_args(annotation)))})"
    return next(filter(None, map(_choices, get_args(annotation))), "")


def _law(law: LawInfo, units: Callable[[str], str]) -> Iterator[str]:
    of = {1: "one direction", 2: "normal and tangent", 3: "normal and two tangents"}[law.components]
    said = f": {law.doc}" if law.doc else ""
    yield f'[[contact]] with law = "{law.name}" ({of}){said}'
    for parameter in law.parameters:
        default = "required" if parameter.default is None else str(parameter.default)
        also = f", or `{parameter.name}{PER_AREA}`" if has_per_area(parameter) else ""
        unit = "" if parameter.unit == "-" else f" [{units(parameter.unit)}]"
        yield f"  {parameter.name:<18} {default:<12} {parameter.doc}{unit}{also}"


def _default(field: FieldInfo) -> str:
    if field.is_required():
        return "required"
    value = field.get_default(call_default_factory=True)
    return "-" if value in (None, "", []) or isinstance(value, BaseModel) else str(value)
