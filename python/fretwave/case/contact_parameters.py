"""Law and parameters of a contact: from the case, per area or as they are, from the builder, or by default."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any, Optional

import numpy as np
import numpy.typing as npt

from ..arrays import Array
from ..errors import FretwaveError, InputError
from ..model.law_info import LawInfo, ParameterInfo, Role
from ..model.pairs import Pairs
from ..texts import nearest, toml
from ..units import quantity
from .fields import FASTEST
from .pair_values import TABLE, ValueTable
from .schema import ContactSection
from .toml.locate import Path as KeyPath
from .toml.source import Source
from .toml.validation import at

#: A parameter's name with this ending is given per area; the pair's area comes with the model.
PER_AREA = "_per_area"
LARGEST = float(np.finfo(float).max)
LONGEST_SYMBOL = 4


def has_per_area(parameter: ParameterInfo) -> bool:
    """Forces and stiffnesses may be given per area; coefficients and gaps may not."""
    return quantity(parameter.unit).startswith("force")


def unit_of_key(key: str, parameter: ParameterInfo) -> str:
    """Quantity of a parameter that a case gives by this key: as it is, or per area."""
    given = quantity(parameter.unit)
    return given if key == parameter.name else given.replace("force", "pressure", 1)


def law_of(
    source: Source, number: int, section: ContactSection, laws: Mapping[str, LawInfo], found: list[FretwaveError]
) -> LawInfo | None:
    """The law that a contact names; None when there is no such law."""
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


#: How a contact of so many components is given.
_FIX = {2: "give the key `tangents` beside `pairs`", 3: "such contacts come with a model that is built or imported"}


def fits(source: Source, number: int, law: LawInfo, here: int, given: Pairs | None, found: list[FretwaveError]) -> bool:
    """Law and pairs have the same number of components (`here` of the pairs)."""
    wanted = law.components
    if here != wanted:
        text = "component" if here == 1 else "components"
        measured = f"{law.name} has {wanted}, the pairs have {here} {text}"
        fix = "choose another law" if given else _FIX.get(wanted, "leave out the key `tangents`")
        where = source.where(("contact", number, "law"))
        found.append(InputError("the law does not fit the contact pairs", where, measured, "the same number", fix))
    return here == wanted


def parameters_of(
    source: Source,
    number: int,
    section: ContactSection,
    law: LawInfo,
    given: Pairs | None,
    found: list[FretwaveError],
) -> dict[str, Any] | None:
    """Each parameter from the case, per area or as it is, else from the builder, else the law's default."""
    path = ("contact", number)
    known = {parameter.name: parameter for parameter in law.parameters}
    areas = given.areas if given else None
    per_area = [] if areas is None else [name + PER_AREA for name, p in known.items() if has_per_area(p)]
    before, meant = len(found), set[Optional[str]]()
    for key in section.model_extra or {}:
        if key not in known and key not in per_area:
            found.append(_unknown_parameter(source, (*path, key), section.law, known, per_area))
            meant.add(_meant(key, known))
    n_pairs = given.n_pairs if given and section.pairs is None else len(section.pairs or [])
    extra = section.model_extra or {}
    values: dict[str, float | Array | None] = {}
    for name, parameter in known.items():
        if areas is not None and name + PER_AREA in extra and name + PER_AREA in per_area:
            if name in extra:
                where, fix = source.where((*path, name + PER_AREA)), "keep one of them"
                found.append(InputError(f"'{name}' is given twice, once per area", where, fix=fix))
            value = _value(source, (*path, name + PER_AREA), parameter, n_pairs, found)
            values[name] = None if value is None else value * areas
        elif name in meant and name not in extra:
            values[name] = None  # one message is enough
        elif given and name not in extra and name in given.parameters:
            values[name] = _plain(given.parameters[name])
        else:
            values[name] = _value(source, (*path, name), parameter, n_pairs, found)
    _multiply(source, path, values, found)
    _turn(source, path, section, law, values, found)
    return values if len(found) == before else None


def _multiply(
    source: Source, path: KeyPath, values: dict[str, float | Array | None], found: list[FretwaveError]
) -> None:
    """Take the factors of ``[uncertainty]``, wherever the parameters come from."""
    for place, (factor, where) in source.factors.items():
        name = str(place[-1])
        value = values.get(name) if place[:-1] == path else None
        if value is not None:
            values[name] = value * factor
        elif place[:-1] == path and name not in values:
            what, expected = f"a factor is drawn on no parameter of {source.name(path)}", f"one of {', '.join(values)}"
            fix = nearest(name, list(values)) or "name a parameter of the law"
            found.append(InputError(what, where, name, expected, fix))


def _turn(
    source: Source,
    path: KeyPath,
    section: ContactSection,
    law: LawInfo,
    values: dict[str, float | Array | None],
    found: list[FretwaveError],
) -> None:
    """Loads that are given at one speed, at that of the model."""
    if section.load_rpm is None:
        return
    speed, where = at(source.data, ("model", "speed_rpm")), source.where((*path, "load_rpm"))
    names = [name for role in (Role.LOAD, Role.FRICTION_LIMIT) if (name := law.named(role)) is not None]
    if not names:
        what = f"contact '{section.name}' has no load that could grow with the speed"
        found.append(InputError(what, where, f"law = {toml(law.name)}", "a law with a load", "remove load_rpm"))
    elif not isinstance(speed, (int, float)):
        what, fix = (
            "the load grows with a speed that is not given",
            f"add `speed_rpm = {section.load_rpm:g}` to [model]",
        )
        found.append(InputError(what, where, f"load_rpm = {section.load_rpm:g}", "[model] speed_rpm", fix))
    elif abs(speed) <= FASTEST:  # beyond it is told at its place
        for name in names:
            value = values.get(name)
            values[name] = None if value is None else value * (speed / section.load_rpm) ** 2


def _plain(value: npt.ArrayLike) -> float | Array:
    return float(np.asarray(value).item()) if np.ndim(value) == 0 else np.asarray(value, dtype=float)


def _meant(key: str, known: Mapping[str, ParameterInfo], others: Sequence[str] = ()) -> str | None:
    """The parameter whose symbol this is, as its doc has it (kn, "sliding force mu N"), or is spelt so."""
    symbol = key.lower().replace("_", "")
    for name, parameter in known.items():
        words = re.findall(r"[a-z]\w*", parameter.doc.lower())
        if len(symbol) <= LONGEST_SYMBOL and symbol in {*words, *map("".join, zip(words, words[1:]))}:
            return name
    return nearest(key, [*others, *known], str)


def _unknown_parameter(
    source: Source, path: tuple[Any, ...], law: str, known: Mapping[str, ParameterInfo], per_area: Sequence[str]
) -> InputError:
    own = [*known, *per_area]
    near = _meant(str(path[-1]), known, [*ContactSection.model_fields, *per_area])
    said = f" ({known[near].doc} [{source.units(known[near].unit)}])" if near is not None and near in known else ""
    return InputError(
        f"unknown key '{path[-1]}' in {source.name(path[:-1])}",
        where=source.where(path),
        measured=f"{path[-1]} = {toml(at(source.data, path))}",
        expected=f"a parameter of {law} ({', '.join(own)}) or one of {', '.join(ContactSection.model_fields)}",
        fix=f"did you mean `{near}`?{said}" if near else "remove the key",
    )


def _value(
    source: Source, path: tuple[Any, ...], parameter: ParameterInfo, n_pairs: int, found: list[FretwaveError]
) -> float | Array | None:
    """A parameter as number or (n_pairs,) array."""
    value = at(source.data, path)
    sign = ">" if parameter.strict else ">="
    bounded = parameter.lower is not None and np.isfinite(parameter.lower)
    bound = f" {sign} {parameter.lower:g}" if bounded else ""
    unit = source.units(unit_of_key(str(path[-1]), parameter))
    expected = f"a number{bound}, or one per pair ({n_pairs}), or a {TABLE} file of them: {parameter.doc} [{unit}]"
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
    if isinstance(value, str) and value.lower().endswith(TABLE):
        given, key = source.path.parent / value, str(path[-1])
        table = ValueTable(given, key, unit, source.where(path), parameter.lower, parameter.strict)
        try:
            return np.array(table.values(n_pairs))
        except InputError as error:
            found.append(error)
            return None
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


def _wrong_number(value: Any, parameter: ParameterInfo, n_pairs: int) -> str | None:
    values = value if isinstance(value, list) else [value]
    if not all(isinstance(entry, (int, float)) and not isinstance(entry, bool) for entry in values):
        return "is not a number"
    if isinstance(value, list) and len(value) != n_pairs:
        return f"has {len(value)} values for {n_pairs} contact pairs"
    if not all(-LARGEST <= entry <= LARGEST for entry in values):  # integers may be larger than any float
        return "is not finite"
    lower = -np.inf if parameter.lower is None else parameter.lower
    below = min(values) < lower or (parameter.strict and min(values) == lower)
    return "is out of range" if below else None
