"""``[[contact]]`` entries: laws and their parameters, pairs, and the map B from dofs to relative displacement."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse

from .built import BuiltContact
from .errors import FretwaveError, InputError
from .schema import ContactSection
from .source import Source, nearest
from .validation import at, missing_key, toml, validate

#: A parameter's name with this ending is given per area; the pair's area comes with the model.
PER_AREA = "_per_area"


@dataclass
class ContactSpec:
    """A contact of the case, ready for ``fretwave.Contact``.

    Attributes
    ----------
    rows : (components * n_pairs, n_dof) sparse
        u = rows @ x, pair by pair.
    parameters : dict
        The law's parameters, a number or (n_pairs,) array each.
    pairs : list of [dof] or [first, second]
        As the case names them; empty when a builder made the rows.
    components : int
        Rows of a pair.
    """

    name: str
    law: str
    rows: Any
    parameters: dict[str, Any]
    pairs: list[list[str]]
    components: int = 1

    @property
    def n_pairs(self) -> int:
        """Number of pairs."""
        return int(self.rows.shape[0]) // self.components


def read_contacts(
    source: Source,
    dofs: Sequence[str] | None,
    laws: Mapping[str, Any],
    found: list[FretwaveError],
    built: Mapping[str, BuiltContact] | None = None,
) -> list[ContactSpec]:
    """All contacts of a case; what is wrong is appended to `found`. Without `dofs` pairs are not checked."""
    contacts = []
    for number in range(len(source.entries("contact"))):
        section = validate(ContactSection, source, ("contact", number), found)
        if section is None:
            continue
        given = (built or {}).get(section.name)
        if section.pairs is None and given is None and dofs is None:
            continue  # a model that could not be read may have brought the pairs
        law = _law(source, number, section, laws, found)
        rows = _rows(source, number, section, dofs, built or {}, found)
        parameters = _parameters(source, number, section, law, given, found) if law else None
        if law is None or parameters is None or rows is None:
            continue
        if _fits(source, number, law, given, found):
            pairs = [[pair] if isinstance(pair, str) else pair for pair in section.pairs or []]
            components = given.components if given else 1
            contacts.append(ContactSpec(section.name, section.law, rows, parameters, pairs, components))
    return contacts


def _law(
    source: Source, number: int, section: ContactSection, laws: Mapping[str, Any], found: list[FretwaveError]
) -> Any:
    if section.law in laws:
        return laws[section.law]
    known = sorted(laws)
    found.append(
        InputError(
            f"unknown contact law '{section.law}'",
            where=source.where(("contact", number, "law")),
            measured=f"law = {toml(section.law)}",
            expected=f"one of {', '.join(known)}",
            fix=nearest(section.law, known) or f"write for example `law = {toml(known[0])}`",
        )
    )
    return None


def _fits(source: Source, number: int, law: Any, given: BuiltContact | None, found: list[FretwaveError]) -> bool:
    """Law and pairs have the same number of components."""
    here, wanted = given.components if given else 1, getattr(law, "components", 1)
    if here != wanted:
        text = "component" if here == 1 else "components"
        measured = f"{law.name} has {wanted}, the pairs have {here} {text}"
        fix = "choose another law" if given else "such contacts come with a model that is built or imported"
        where = source.where(("contact", number, "law"))
        found.append(InputError("the law does not fit the contact pairs", where, measured, "the same number", fix))
    return bool(here == wanted)


def _parameters(
    source: Source,
    number: int,
    section: ContactSection,
    law: Any,
    given: BuiltContact | None,
    found: list[FretwaveError],
) -> dict[str, Any] | None:
    """Each parameter from the case, per area or as it is, else from the builder, else the law's default."""
    path = ("contact", number)
    known = {parameter.name: parameter for parameter in law.parameters}
    areas = given.areas if given else None
    per_area = [] if areas is None else [name + PER_AREA for name, p in known.items() if p.unit.startswith("N")]
    before = len(found)
    for key in section.model_extra or {}:
        if key not in known and key not in per_area:
            found.append(_unknown_parameter(source, (*path, key), section.law, [*known, *per_area]))
    n_pairs = given.n_pairs if given and section.pairs is None else len(section.pairs or [])
    extra, values = section.model_extra or {}, {}
    for name, parameter in known.items():
        if name + PER_AREA in extra and name + PER_AREA in per_area:
            if name in extra:
                where, fix = source.where((*path, name + PER_AREA)), "keep one of them"
                found.append(InputError(f"'{name}' is given twice, once per area", where, fix=fix))
            value = _value(source, (*path, name + PER_AREA), parameter, n_pairs, found)
            values[name] = None if value is None else value * areas
        elif given and name not in extra and name in given.parameters:
            values[name] = _plain(given.parameters[name])
        else:
            values[name] = _value(source, (*path, name), parameter, n_pairs, found)
    return values if len(found) == before else None


def _plain(value: Any) -> Any:
    return float(value) if np.ndim(value) == 0 else np.asarray(value, dtype=float)


def _unknown_parameter(source: Source, path: tuple[Any, ...], law: str, known: Sequence[str]) -> InputError:
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
    built: Mapping[str, BuiltContact],
    found: list[FretwaveError],
) -> Any:
    """B of a contact: the builder's, or one row for each pair, +1 at the dof (second dof), -1 at the first of two."""
    if section.pairs is None or section.name in built:
        return _built_rows(source, number, section, built, found)
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


def _built_rows(
    source: Source,
    number: int,
    section: ContactSection,
    built: Mapping[str, BuiltContact],
    found: list[FretwaveError],
) -> Any:
    """B of a contact that comes with the model."""
    path = ("contact", number)
    if section.name in built and section.pairs is None:
        return built[section.name].B
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
            fix=nearest(dof, dofs) or "model.dofs names the dofs in the order of the matrices",
        )
    )
    return False
