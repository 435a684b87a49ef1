"""``fretwave check --keys``: every key of a case file with its default, unit and meaning."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import Any

from pydantic import BaseModel

from ..case.schema import (
    ANALYSES,
    AerodynamicsSection,
    AnalysisSection,
    ContactSection,
    Damper,
    MistuningSection,
    ModelSection,
    PreloadSection,
    ReductionSection,
    StepSection,
    StudySection,
)
from ..case.toml.validation import describe


def key_lines() -> Iterator[str]:
    """The reference, section by section; keys that all analyses share are said once."""
    sections: dict[str, type[BaseModel]] = {
        "[model]": ModelSection,
        "[reduction]": ReductionSection,
        "[preload]": PreloadSection,
        "[aerodynamics]": AerodynamicsSection,
        "[[contact]] (and the parameters of its law)": ContactSection,
        "[[analysis]]": AnalysisSection,
    }
    for title, section in sections.items():
        yield title
        yield from _section(section)
    for kind, analysis in ANALYSES.items():
        yield f'[[analysis]] with type = "{kind}"'
        yield from _section(analysis, without=set(AnalysisSection.model_fields))
    tables: dict[str, type[BaseModel]] = {
        "step = { ... }": StepSection,
        "mistuning = { ... }": MistuningSection,
        "dampers = [{ ... }]": Damper,
        "[study]": StudySection,
    }
    for title, nested in tables.items():
        yield title
        yield from _section(nested)


def _section(section: type[BaseModel], without: Collection[str] = ()) -> Iterator[str]:
    for name, field in section.model_fields.items():
        if name not in without:
            yield f"  {name:<18} {_default(field):<12} {describe(field)}"


def _default(field: Any) -> str:
    if field.is_required():
        return "required"
    value = field.get_default(call_default_factory=True)
    return "-" if value in (None, "", []) or isinstance(value, BaseModel) else str(value)
