"""A case of one sector of a wheel: its faces are tied to its neighbours before anything else looks at it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from .contacts import ContactSpec
from .errors import FretwaveError, InputError
from .origin import Origin
from .schema import AnalysisSection, ForcedAnalysis, HarmonicSection, ModelSection, TransientSection
from .source import Source, nearest
from .validation import at, toml

if TYPE_CHECKING:
    from .cyclic import Sector

Found = list[FretwaveError]

#: The part of K that a mistuning varies unless it names another: all that the sector's own elements put into it.
WHOLE = "sector"


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
    """

    sectors: int
    terms: Mapping[str, Mapping[int, Any]]
    contacts: Mapping[str, Mapping[int, Any]]
    ties: Mapping[int, Any]
    parts: Mapping[str, Any]

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
        sector = _sector(origin, contacts, faces, number)
    except InputError as error:
        key = "high" if section.high else "sectors" if section.sectors else "builder"
        found.append(InputError(error.what, source.where(("model", key)), error.measured, error.expected, error.fix))
        return origin, contacts, None
    return _folded(origin, contacts, sector, *faces)


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


def _sector(origin: Origin, contacts: Sequence[ContactSpec], faces: Sequence[Any], number: int) -> Sector:
    from .cyclic import Sector
    from .model import Contact

    loaded = {letter: matrix.values for letter, matrix in origin.matrices.items()}
    pairs = [Contact(c.law, c.rows, c.parameters, c.name) for c in contacts]
    axis = origin.built.axis if origin.built else None
    low, high = faces
    return Sector.from_faces(loaded["M"], loaded["K"], low, high, number, loaded.get("C"), pairs, axis)


def _folded(
    origin: Origin, contacts: Sequence[ContactSpec], sector: Sector, low: Any, high: Any
) -> tuple[Origin, list[ContactSpec], Neighbours]:
    from .model import by_sector

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
    neighbours = Neighbours(sector.sectors, terms, ahead, sector.ties, varied)
    resolved = {
        **origin.resolved,
        "model.sectors": sector.sectors,
        **{f"model.{name}": [origin.dofs[k] for k in face] for name, face in (("low", low), ("high", high))},
    }
    tied = Origin(own, [origin.dofs[k] for k in kept], built, resolved)
    return tied, [replace(c, rows=sp.csr_matrix(rows[c.name][0])) for c in contacts], neighbours


def _without_own(parts: Mapping[int, Any]) -> dict[int, Any]:
    return {k: part for k, part in parts.items() if k}


def check_waves(
    source: Source, analyses: Mapping[int, AnalysisSection], neighbours: Neighbours | None, reduced: bool, found: Found
) -> None:
    """Analyses of a sector say their nodal diameter; no others do; none integrates in time."""

    def wrong(number: int, key: str, what: str, expected: str, fix: str) -> None:
        path = ("analysis", number, key)
        measured = at(source.data, path)
        text = None if measured is None else f"{key} = {toml(measured)}"
        found.append(InputError(f"{source.name(path[:-1])} {what}", source.where(path), text, expected, fix))

    if neighbours is not None and reduced:
        where = source.where(("reduction",))
        fix = "remove [reduction]"
        found.append(InputError("a sector of a wheel cannot be reduced here", where, expected="the sector", fix=fix))
    for number, analysis in analyses.items():
        given = getattr(analysis, "nodal_diameter", None)
        if neighbours is None:
            if given is not None:
                fix = "remove the key, or give [model] its sectors"
                wrong(number, "nodal_diameter", "is of no sector of a wheel", "a model with sectors", fix)
            continue
        half = neighbours.sectors // 2
        integrates = isinstance(analysis, TransientSection) or (
            isinstance(analysis, ForcedAnalysis) and analysis.time_points > 0
        )
        if integrates:
            key = "type" if isinstance(analysis, TransientSection) else "time_points"
            wrong(number, key, "integrates in time, which one sector cannot", "harmonic balance", "remove it")
        elif isinstance(analysis, HarmonicSection) and (
            abs(given) > half if given is not None else analysis.mistuning is None
        ):
            what = "says no nodal diameter" if given is None else "has no such nodal diameter"
            expected = f"-{half} .. {half}, negative for backward waves"
            wrong(number, "nodal_diameter", what, expected, "add for example `nodal_diameter = 1`")


def nodal_diameter(analysis: Any) -> int:
    """Of an analysis; 0 where it has none."""
    return getattr(analysis, "nodal_diameter", None) or 0
