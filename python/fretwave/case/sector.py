"""A case of one sector of a wheel: its faces are tied to its neighbours before anything else looks at it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..arrays import Indices
from ..errors import InputError
from ..model.contact import Contact
from ..model.structure import Structure
from ..texts import toml
from .contacts import on
from .face_moves import labels_by_name, said_of_faces
from .reporter import Found
from .schema import ModelSection
from .toml.source import Source
from .toml.validation import at


def tie(
    section: ModelSection,
    source: Source,
    structure: Structure,
    contacts: list[Contact],
    notes: list[str],
    found: Found,
) -> tuple[Structure, list[Contact]]:
    """The model with its high face left out, when the case says that it is a sector; what is wrong goes to `found`."""
    number = section.sectors or structure.sectors
    axis, wrong = section.axis or structure.axis, len(found)
    faces = [_face(name, section, source, structure, found) for name in ("low", "high")]
    if not number:
        if section.axis or any(face is not None for face in faces):
            key = "low" if section.low else "high" if section.high else "axis"
            _wrong(source, key, "without a number of sectors", "add `sectors = ...`", found)
        return structure, contacts
    if len(found) > wrong:
        return structure, contacts
    low, high = faces
    if low is None or high is None:
        _wrong(source, "sectors", "needs both faces", 'add `low = ["..."]` and `high = ["..."]`', found)
        return structure, contacts
    if structure.M is None or structure.K is None:
        return structure, contacts
    try:
        if any(getattr(section, key) is not None for key in ("sectors", "low", "high", "axis")):
            low, high, axis = _framed(section, structure, low, high, number, axis, notes)
        tied = replace(structure, sectors=number, low=low, high=high, axis=axis).tied()
        return tied, on(contacts, tied)
    except InputError as error:
        keys = ("high", "sectors", "axis", "file")
        key = next((key for key in keys if getattr(section, key) is not None), "builder")
        where = ", ".join(filter(None, (source.where(("model", key)), error.where)))
        found.append(InputError(error.what, where, error.measured, error.expected, error.fix))
        return structure, contacts


def _framed(
    section: ModelSection,
    structure: Structure,
    low: Indices,
    high: Indices,
    sectors: int,
    axis: str | None,
    notes: list[str],
) -> tuple[Indices, Indices, str | None]:
    """Faces of a case that says something of them; a builder's own that correspond as they are stay so."""
    from ..cyclic.frames import framed

    if axis is None and section.low is None and section.high is None:
        return low, high, None
    if structure.coordinates is None and structure.labels is None:
        structure = replace(structure, labels=labels_by_name(structure, low, high, axis))
    notes += [note] if (note := said_of_faces(structure, axis)) else []
    return framed(structure, low, high, sectors, axis)


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
            where, fix = source.where(("model", name, index)), source.dof_fix(dof, dofs) or "name a dof of the model"
            found.append(InputError(f"unknown dof '{dof}' of the {name} face", where, expected="a dof", fix=fix))
    return np.array([known[dof] for dof in names if dof in known], dtype=np.intp)
