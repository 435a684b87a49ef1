"""``[[contact]]`` entries: laws and their parameters, pairs, and the map B from dofs to relative displacement."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import scipy.sparse

from ..arrays import Array
from ..errors import FretwaveError, InputError
from ..model.contact import Contact
from ..model.law_info import LawInfo
from ..model.laws import no_wear
from ..model.pairs import Pairs
from ..model.sectors import Sparse
from ..model.structure import Structure
from ..texts import nearest, toml
from .contact_parameters import fits, law_of, parameters_of
from .schema import ContactSection
from .toml.source import Source
from .toml.validation import at, missing_key, validate


def on(contacts: Sequence[Contact], structure: Structure) -> list[Contact]:
    """The contacts on the dofs of a structure that has their pairs."""
    return [replace(contact, pairs=structure.pairs[contact.name]) for contact in contacts]


def wear_areas(contacts: Sequence[Contact]) -> dict[str, Array]:
    """Nodal areas (n_pairs,) [length^2] of the contacts that can wear: those whose law has a normal direction.

    Raises
    ------
    InputError
        There are none, or their areas are not known.
    """
    found = {}
    for contact in contacts:
        if not contact.info.wears:
            continue
        if contact.pairs.areas is None:
            fix = "give the contact its areas (Pairs(areas=...))"
            raise InputError("the areas of the pairs are not known", f"contact '{contact.name}'", None, "areas", fix)
        areas = np.asarray(contact.pairs.areas, dtype=float)
        if bad := [f"{areas[pair]:g} (pair {pair})" for pair in np.flatnonzero(~(np.isfinite(areas) & (areas > 0)))]:
            more = f" and {len(bad) - 3} more" if len(bad) > 3 else ""
            fix = "give each pair its share of the face (of quadratic faces not the consistent weights of corners)"
            where, measured = f"contact '{contact.name}'", ", ".join(bad[:3]) + more
            raise InputError("the areas of some pairs are no areas", where, measured, "finite and > 0", fix)
        found[contact.name] = areas
    if not found:
        given_laws = ", ".join(str(contact.law) for contact in contacts) or "no contact"
        raise no_wear("no contact can wear", None, given_laws)
    return found


def read_contacts(
    source: Source,
    dofs: Sequence[str] | None,
    laws: Mapping[str, LawInfo],
    found: list[FretwaveError],
    built: Mapping[str, Pairs] | None = None,
) -> list[Contact]:
    """All contacts of a case; what is wrong is appended to `found`. Without `dofs` pairs are not checked."""
    contacts = []
    for number in range(len(source.entries("contact"))):
        section = validate(ContactSection, source, ("contact", number), found)
        if section is None:
            continue
        given = (built or {}).get(section.name)
        if section.pairs is None and given is None and dofs is None:
            continue  # a model that could not be read may have brought the pairs
        law = law_of(source, number, section, laws, found)
        pairs = _pairs(source, number, section, dofs, built or {}, found)
        parameters = parameters_of(source, number, section, law, given, found) if law else None
        if law is None or parameters is None or pairs is None:
            continue
        if fits(source, number, law, pairs.components, given, found):
            contacts.append(Contact(section.law, pairs, parameters, section.name))
    return contacts


def _pairs(
    source: Source,
    number: int,
    section: ContactSection,
    dofs: Sequence[str] | None,
    built: Mapping[str, Pairs],
    found: list[FretwaveError],
) -> Pairs | None:
    """The builder's, or a row for each pair, +1 at the dof (second dof), -1 at the first of two.

    With tangents two rows a pair, normal and tangent.
    """
    if section.pairs is None or section.name in built:
        return _built_pairs(source, number, section, built, found)
    if dofs is None:
        return None
    rows = [_rows_of(source, number, "pairs", section.pairs, dofs, found)]
    if section.tangents is not None:
        if len(section.tangents) != len(section.pairs):
            where, fix = source.where(("contact", number, "tangents")), "give one tangent for each pair"
            measured = f"{len(section.tangents)} tangents, {len(section.pairs)} pairs"
            found.append(InputError("tangents do not match the pairs", where, measured, "as many of both", fix))
            return None
        rows.append(_rows_of(source, number, "tangents", section.tangents, dofs, found))
    if any(part is None for part in rows):
        return None
    # pair by pair: normal, tangent
    order = np.arange(len(rows) * len(section.pairs)).reshape(len(rows), -1).T.ravel()
    return Pairs(scipy.sparse.csr_matrix(scipy.sparse.vstack(rows))[order], len(rows))


def _rows_of(
    source: Source,
    number: int,
    key: str,
    pairs: Sequence[str | list[str]],
    dofs: Sequence[str],
    found: list[FretwaveError],
) -> Sparse | None:
    """A row of B for each pair; None when one is wrong."""
    before = len(found)
    rows = scipy.sparse.lil_matrix((len(pairs), len(dofs)))
    for row, pair in enumerate(pairs):
        path = ("contact", number, key, row)
        ends = [pair] if isinstance(pair, str) else pair
        if len(ends) not in (1, 2) or len(set(ends)) != len(ends):
            found.append(
                InputError(
                    f"{source.name(path)} is not a pair",
                    where=source.where(path),
                    measured=toml(pair),
                    expected="a dof (against ground) or two different dofs [first, second]",
                    fix=f'write for example `{key} = ["m2"]` or `{key} = [["m1", "m2"]]`',
                )
            )
            continue
        for dof, sign in zip(reversed(ends), (1.0, -1.0)):
            if check_dof(source, path, dof, dofs, found):
                rows[row, list(dofs).index(dof)] = sign
    return rows.tocsr() if len(found) == before else None


def _built_pairs(
    source: Source,
    number: int,
    section: ContactSection,
    built: Mapping[str, Pairs],
    found: list[FretwaveError],
) -> Pairs | None:
    """Pairs that come with the model."""
    path = ("contact", number)
    if section.tangents is not None and (section.pairs is None or section.name in built):
        where, fix = source.where((*path, "tangents")), "give `pairs`, or leave the key out"
        found.append(InputError("tangents belong to pairs that the case names", where, fix=fix))
        return None
    if section.name in built and section.pairs is None:
        return built[section.name]
    if section.pairs is not None:
        problem, fix = f"the model brings the pairs of '{section.name}'", "remove the key, or choose another name"
        found.append(InputError(problem, source.where((*path, "pairs")), fix=fix))
    elif built:
        near = nearest(section.name, list(built)) or "choose one of these, or give pairs"
        problem = f"the model has no contact '{section.name}'"
        found.append(InputError(problem, source.where((*path, "name")), None, f"one of {', '.join(built)}", near))
    else:
        found.append(missing_key(ContactSection, source, path, "pairs"))
    return None


def check_dof(
    source: Source,
    path: tuple[Any, ...],
    dof: str,
    dofs: Sequence[str] | None,
    found: list[FretwaveError],
) -> bool:
    """True when a dof is known; otherwise the problem is appended to `found`."""
    if dofs is None or dof in dofs:
        return True
    shown = ", ".join(dofs[:12]) + (f", ... ({len(dofs)} in all)" if len(dofs) > 12 else "")
    found.append(
        InputError(
            f"unknown dof '{dof}'",
            where=source.where(path),
            measured=toml(at(source.data, path)),
            expected=f"one of {shown}",
            fix=source.dof_fix(dof, dofs) or "model.dofs names the dofs in the order of the matrices",
        )
    )
    return False
