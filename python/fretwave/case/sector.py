"""A case of one sector of a wheel: its faces are tied to its neighbours before anything else looks at it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..arrays import Indices
from ..errors import FretwaveError, InputError
from ..model.contact import Contact
from ..model.structure import Structure
from ..texts import nearest, toml
from .contacts import on
from .schema import ModelSection
from .toml.source import Source
from .toml.validation import at

Found = list[FretwaveError]


def tie(
    section: ModelSection, source: Source, structure: Structure, contacts: list[Contact], found: Found
) -> tuple[Structure, list[Contact]]:
    """The model with its high face left out, when the case says that it is a sector; what is wrong goes to `found`."""
    number = section.sectors or structure.sectors
    faces = [_face(name, section, source, structure, found) for name in ("low", "high")]
    if not number:
        if any(face is not None for face in faces):
            _wrong(
                source, "low" if section.low else "high", "without a number of sectors", "add `sectors = ...`", found
            )
        return structure, contacts
    if any(face is None for face in faces):
        _wrong(source, "sectors", "needs both faces", 'add `low = ["..."]` and `high = ["..."]`', found)
        return structure, contacts
    if structure.M is None or structure.K is None:
        return structure, contacts
    try:
        tied = replace(structure, sectors=number, low=faces[0], high=faces[1]).tied()
        return tied, on(contacts, tied)
    except InputError as error:
        key = "high" if section.high else "sectors" if section.sectors else "builder"
        found.append(InputError(error.what, source.where(("model", key)), error.measured, error.expected, error.fix))
        return structure, contacts


def _wrong(source: Source, key: str, what: str, fix: str, found: Found) -> None:
    path = ("model", key)
    measured = at(source.data, path)
    text = None if measured is None else f"{key} = {toml(measured)}"
    found.append(InputError(f"a sector of a wheel {what}", source.where(path), text, "sectors, low and high", fix))


def _face(name: str, section: ModelSection, source: Source, structure: Structure, found: Found) -> Indices | None:
    """Dofs of a face, by the names of the case or as the builder gave them."""
    names = getattr(section, name)
    if names is None:
        given: Indices | None = getattr(structure, name)
        return given
    dofs = structure.dof_names
    known = {dof: number for number, dof in enumerate(dofs)}
    for index, dof in enumerate(names):
        if dof not in known:
            where, fix = source.where(("model", name, index)), nearest(dof, dofs) or "name a dof of the model"
            found.append(InputError(f"unknown dof '{dof}' of the {name} face", where, expected="a dof", fix=fix))
    return np.array([known[dof] for dof in names if dof in known], dtype=np.intp)
