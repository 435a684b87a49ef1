"""The unit system of a case: what it declares, what its model says, and that they agree."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from ..errors import FretwaveError, InputError
from ..model.structure import Structure
from ..results.model_file import read_sources
from ..units import SI, SYSTEMS, unit_system, unknown
from .schema import ModelSection
from .toml.source import Source

if TYPE_CHECKING:
    from ..importers.units import Evidence

#: What identifies a model, by address.
Identity = Mapping[str, Any]


def in_units(
    section: ModelSection,
    source: Source,
    structure: Structure,
    identity: Identity,
    notes: list[str],
    found: list[FretwaveError],
) -> tuple[Structure, Identity]:
    """The structure in the system that the case or its model declares, SI where neither does, and what identifies it.

    SI adds nothing to what identifies the model, so that runs of earlier versions are still of their case.
    """
    declared, of_model = section.units, structure.units
    where = source.where(("model", "units"))
    if declared is not None and declared not in SYSTEMS:
        found.append(unknown(declared, where))
    elif declared and of_model and declared != of_model:
        origin = "model file" if section.file else "builder"
        fix = f'write `units = "{of_model}"` or remove the key, or make the model in {declared}'
        what = f"the case and its {origin} declare different unit systems"
        found.append(InputError(what, where, f'units = "{declared}"', f'"{of_model}", as the {origin} says', fix))
    elif section.file:
        from ..importers.units import check_declared, evidence_of

        evidence = evidence_of(structure)
        try:
            check_declared(declared or of_model or SI.name, evidence if declared else [], where, _fix)
        except InputError as error:
            found.append(error)
        if not of_model:
            notes += _notes(section.file, source, declared, evidence)
    name = of_model or (declared if declared in SYSTEMS else None) or SI.name
    source.units_of_model = unit_system(name)
    return replace(structure, units=name), identity if name == SI.name else {**identity, "model.units": name}


def _fix(name: str) -> str:
    return f'write `units = "{name}"`'


def _notes(file: str, source: Source, declared: str | None, evidence: Sequence[Evidence]) -> list[str]:
    """Of a model file without a unit system: what it was read as, where that may be wrong."""
    name, text = declared or SI.name, read_sources(source.path.parent / file)[0]
    notes = [f"the model file's note on its units, '{text}', names no unit system: read as {name}"] if text else []
    others = [one for one in evidence if one.contradicts(name)]
    notes += [
        f"units: read as {name}, but like {' or '.join(one.fits)} ({one.text}): {_fix(one.fits[0])}" for one in others
    ]
    return notes
