"""``[[contact]]`` entries: laws and their parameters, pairs, and the map B from dofs to relative displacement."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse

from .errors import FretwaveError, InputError
from .schema import ContactSection
from .source import Source, nearest
from .validation import at, toml, validate


@dataclass
class ContactSpec:
    """A contact of the case, ready for ``fretwave.Contact``.

    Attributes
    ----------
    rows : (n_pairs, n_dof) sparse
        u = rows @ x.
    parameters : dict
        The law's parameters, a number or (n_pairs,) array each.
    """

    name: str
    law: str
    rows: Any
    parameters: dict[str, Any]
    pairs: list[list[str]]


def read_contacts(
    source: Source, dofs: Sequence[str] | None, laws: Mapping[str, Any], found: list[FretwaveError]
) -> list[ContactSpec]:
    """All contacts of a case; what is wrong is appended to `found`. Without `dofs` pairs are not checked."""
    contacts = []
    for number in range(len(source.entries("contact"))):
        section = validate(ContactSection, source, ("contact", number), found)
        if section is None:
            continue
        parameters = _parameters(source, number, section, laws, found)
        rows = _rows(source, number, section, dofs, found)
        if parameters is not None and rows is not None:
            pairs = [[pair] if isinstance(pair, str) else pair for pair in section.pairs]
            contacts.append(ContactSpec(section.name, section.law, rows, parameters, pairs))
    return contacts


def _parameters(
    source: Source,
    number: int,
    section: ContactSection,
    laws: Mapping[str, Any],
    found: list[FretwaveError],
) -> dict[str, Any] | None:
    path = ("contact", number)
    if section.law not in laws:
        found.append(
            InputError(
                f"unknown contact law '{section.law}'",
                where=source.where((*path, "law")),
                measured=f"law = {toml(section.law)}",
                expected=f"one of {', '.join(sorted(laws))}",
                fix=nearest(section.law, sorted(laws)) or f"write for example `law = {toml(sorted(laws)[0])}`",
            )
        )
        return None
    known = {parameter.name: parameter for parameter in laws[section.law].parameters}
    before = len(found)
    for key in section.model_extra or {}:
        if key not in known:
            found.append(_unknown_parameter(source, (*path, key), section.law, known))
    values = {
        name: _value(source, (*path, name), parameter, len(section.pairs), found) for name, parameter in known.items()
    }
    return values if len(found) == before else None


def _unknown_parameter(source: Source, path: tuple[Any, ...], law: str, known: Mapping[str, Any]) -> InputError:
    keys = [*ContactSection.model_fields, *known]
    return InputError(
        f"unknown key '{path[-1]}' in {source.name(path[:-1])}",
        where=source.where(path),
        measured=f"{path[-1]} = {toml(at(source.data, path))}",
        expected=f"a parameter of {law} ({', '.join(known)}) or one of {', '.join(ContactSection.model_fields)}",
        fix=nearest(str(path[-1]), keys) or "remove the key",
    )


def _value(source: Source, path: tuple[Any, ...], parameter: Any, n_pairs: int, found: list[FretwaveError]) -> Any:
    """A parameter as number or (n_pairs,) array."""
    value = at(source.data, path)
    sign = ">" if parameter.strict else ">="
    bounded = parameter.lower is not None and np.isfinite(parameter.lower)
    bound = f" {sign} {parameter.lower:g}" if bounded else ""
    expected = f"a number{bound}, or one per pair ({n_pairs}): {parameter.doc} [{parameter.unit}]"
    if value is None:
        if parameter.default is None:
            found.append(
                InputError(
                    f"the key '{parameter.name}' is missing in {source.name(path[:-1])}",
                    where=source.where(path[:-1]),
                    expected=expected,
                    fix=f"add a line `{parameter.name} = ...`",
                )
            )
        return parameter.default
    wrong = _wrong_number(value, parameter, n_pairs)
    if wrong:
        found.append(
            InputError(
                f"{source.name(path)} {wrong}",
                where=source.where(path),
                measured=toml(value),
                expected=expected,
                fix="correct the value",
            )
        )
        return None
    return float(value) if not isinstance(value, list) else np.array(value, dtype=float)


def _wrong_number(value: Any, parameter: Any, n_pairs: int) -> str | None:
    values = value if isinstance(value, list) else [value]
    if not all(isinstance(entry, (int, float)) and not isinstance(entry, bool) for entry in values):
        return "is not a number"
    if isinstance(value, list) and len(value) != n_pairs:
        return f"has {len(value)} values for {n_pairs} contact pairs"
    if not np.all(np.isfinite(values)):
        return "is not finite"
    lower = -np.inf if parameter.lower is None else parameter.lower
    below = min(values) < lower or (parameter.strict and min(values) == lower)
    return "is out of range" if below else None


def _rows(
    source: Source,
    number: int,
    section: ContactSection,
    dofs: Sequence[str] | None,
    found: list[FretwaveError],
) -> Any:
    """B of a contact with one component per pair: +1 at the dof (second dof), -1 at the first of two."""
    if dofs is None:
        return None
    before = len(found)
    rows = scipy.sparse.lil_matrix((len(section.pairs), len(dofs)))
    for row, pair in enumerate(section.pairs):
        path = ("contact", number, "pairs", row)
        ends = [pair] if isinstance(pair, str) else pair
        if len(ends) not in (1, 2) or len(set(ends)) != len(ends):
            found.append(
                InputError(
                    f"{source.name(path)} is not a pair",
                    where=source.where(path),
                    measured=toml(pair),
                    expected="a dof (against ground) or two different dofs [first, second]",
                    fix='write for example `pairs = ["m2"]` or `pairs = [["m1", "m2"]]`',
                )
            )
            continue
        for dof, sign in zip(reversed(ends), (1.0, -1.0)):
            if check_dof(source, path, dof, dofs, found):
                rows[row, list(dofs).index(dof)] = sign
    return rows.tocsr() if len(found) == before else None


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
            fix=nearest(dof, dofs) or "model.dofs names the dofs in the order of the matrices",
        )
    )
    return False
