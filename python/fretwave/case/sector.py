"""A case of one sector of a wheel: its faces are tied to its neighbours before anything else looks at it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from ..errors import FretwaveError, InputError
from ..texts import nearest, toml
from .contacts import ContactSpec
from .origin import Origin
from .schema import ModelSection
from .toml.source import Source
from .toml.validation import at

if TYPE_CHECKING:
    from ..cyclic.sector import Sector

Found = list[FretwaveError]

#: The part of K that a mistuning varies unless it names another: all that the sector's own elements put into it.
WHOLE = "sector"


@dataclass(frozen=True)
class CutSector:
    """A sector as it was given, both faces free.

    Attributes
    ----------
    origin : Origin
        On all dofs of the sector.
    contacts : list of ContactSpec
    low, high : (n_face,) matching dofs
    """

    origin: Origin
    contacts: list[ContactSpec]
    low: Any
    high: Any

    @property
    def axis(self) -> str | None:
        """Of the wheel, where dofs of the faces are Cartesian components: not those that a builder has reduced."""
        built = self.origin.built
        return None if built is None or built.expansion is not None else built.axis


@dataclass(frozen=True)
class Neighbours:
    """What ties the sector of a case to the next ones.

    Attributes
    ----------
    sectors : int
    terms : {"M": {k: (n_dof, n_dof)}, ...}
        On the dofs of the sector k places ahead, k not 0.
    contacts : {name: {k: (components * n_pairs, n_dof)}}
    ties : {k: (n_full, n_dof)}
        As `fretwave.Sector` has them: dofs of the sector with both faces.
    parts : {name: (n_full, n_full)}
        Shares of K that a mistuning may vary, on the sector with both faces.
    cut : CutSector
        The sector with both faces.
    """

    sectors: int
    terms: Mapping[str, Mapping[int, Any]]
    contacts: Mapping[str, Mapping[int, Any]]
    ties: Mapping[int, Any]
    parts: Mapping[str, Any]
    cut: CutSector

    def with_own(self, letter: str, own: Any) -> dict[int, Any]:
        """The term as `fretwave.Model` takes it."""
        return {0: own, **self.terms.get(letter, {})}

    def rows(self, contact: ContactSpec) -> dict[int, Any]:
        """B of a contact with its parts on other sectors."""
        return {0: contact.rows, **self.contacts.get(contact.name, {})}


def tie(
    section: ModelSection, source: Source, origin: Origin, contacts: list[ContactSpec], found: Found
) -> tuple[Origin, list[ContactSpec], Neighbours | None]:
    """The model with its high face left out, when the case says that it is a sector; what is wrong goes to `found`."""
    built = origin.built
    number = section.sectors or (built.sectors if built else None)
    faces = [_face(name, section, source, origin, found) for name in ("low", "high")]
    if number is None:
        if any(face is not None for face in faces):
            _wrong(
                source, "low" if section.low else "high", "without a number of sectors", "add `sectors = ...`", found
            )
        return origin, contacts, None
    if any(face is None for face in faces):
        _wrong(source, "sectors", "needs both faces", 'add `low = ["..."]` and `high = ["..."]`', found)
        return origin, contacts, None
    try:
        return fold(CutSector(origin, contacts, *faces), number)
    except InputError as error:
        key = "high" if section.high else "sectors" if section.sectors else "builder"
        found.append(InputError(error.what, source.where(("model", key)), error.measured, error.expected, error.fix))
        return origin, contacts, None


def _wrong(source: Source, key: str, what: str, fix: str, found: Found) -> None:
    path = ("model", key)
    measured = at(source.data, path)
    text = None if measured is None else f"{key} = {toml(measured)}"
    found.append(InputError(f"a sector of a wheel {what}", source.where(path), text, "sectors, low and high", fix))


def _face(name: str, section: ModelSection, source: Source, origin: Origin, found: Found) -> Any:
    """Dofs of a face, by the names of the case or as the builder gave them."""
    names = getattr(section, name)
    if names is None:
        return None if origin.built is None else getattr(origin.built, name)
    known = {dof: number for number, dof in enumerate(origin.dofs)}
    for index, dof in enumerate(names):
        if dof not in known:
            where, fix = source.where(("model", name, index)), nearest(dof, origin.dofs) or "name a dof of the model"
            found.append(InputError(f"unknown dof '{dof}' of the {name} face", where, expected="a dof", fix=fix))
    return np.array([known[dof] for dof in names if dof in known], dtype=np.intp)


def _sector(cut: CutSector, number: int) -> Sector:
    from ..cyclic.sector import Sector
    from ..model.model import Contact

    loaded = {letter: matrix.values for letter, matrix in cut.origin.matrices.items()}
    pairs = [Contact(c.law, c.rows, c.parameters, c.name) for c in cut.contacts]
    return Sector.from_faces(loaded["M"], loaded["K"], cut.low, cut.high, number, loaded.get("C"), pairs, cut.axis)


def fold(cut: CutSector, number: int) -> tuple[Origin, list[ContactSpec], Neighbours]:
    """The high face tied to the low face of the next of so many sectors, and left out."""
    from ..model.model import by_sector

    sector, origin, contacts, low, high = _sector(cut, number), cut.origin, cut.contacts, cut.low, cut.high
    kept = np.setdiff1d(np.arange(len(origin.dofs)), high)
    parts = {letter: by_sector(getattr(sector, letter)) for letter in origin.matrices}
    rows = {contact.name: by_sector(contact.B) for contact in sector.contacts}
    own = {letter: replace(origin.matrices[letter], values=sp.csr_matrix(part[0])) for letter, part in parts.items()}
    built = origin.built
    if built is not None:
        place = {int(old): new for new, old in enumerate(kept)}
        loads = {name: sum(T.T @ load for T in sector.ties.values()) for name, load in built.loads.items()}
        named = {name: place[number] for name, number in built.dofs.items() if number in place}
        built = replace(built, dofs=named, loads=loads, coordinates=None, displacements=None, hexahedra=None)
    terms, ahead = ({name: _without_own(part) for name, part in given.items()} for given in (parts, rows))
    varied = {**(origin.built.parts if origin.built else {}), WHOLE: origin.matrices["K"].values}
    neighbours = Neighbours(sector.sectors, terms, ahead, sector.ties, varied, cut)
    resolved = {
        **origin.resolved,
        "model.sectors": sector.sectors,
        **{f"model.{name}": [origin.dofs[k] for k in face] for name, face in (("low", low), ("high", high))},
    }
    tied = Origin(own, [origin.dofs[k] for k in kept], built, resolved)
    return tied, [replace(c, rows=sp.csr_matrix(rows[c.name][0])) for c in contacts], neighbours


def _without_own(parts: Mapping[int, Any]) -> dict[int, Any]:
    return {k: part for k, part in parts.items() if k}
