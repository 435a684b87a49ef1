"""The unit system of a case: what it declares, what its model says, and that they agree."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from ..errors import FretwaveError, InputError
from ..model.structure import Structure
from ..results.model_file import read_sources
from ..units import SI, SYSTEMS, unit_system, unknown
from .schema import ModelSection
from .toml.source import Source

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
    elif section.file and not of_model:
        notes += _note(section.file, source, declared or SI.name)
    name = of_model or (declared if declared in SYSTEMS else None) or SI.name
    source.units_of_model = unit_system(name)
    return replace(structure, units=name), identity if name == SI.name else {**identity, "model.units": name}


def _note(file: str, source: Source, name: str) -> list[str]:
    """A note of an earlier version's import in place of a system, where there is one."""
    text = read_sources(source.path.parent / file)[0]
    return [f"the model file's note on its units, '{text}', names no unit system: read as {name}"] if text else []
