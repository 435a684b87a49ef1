"""Wrong case files from right ones: keys taken out, put in, renamed, of another type, or with extreme values.

All choices come from the random generator that is given, so that a case is found again by its number, and hypothesis
can shrink it.
"""

from __future__ import annotations

import copy
import json
from collections.abc import Iterator
from random import Random
from typing import Any

#: Values that stand where they do not belong.
ODD: tuple[Any, ...] = (
    *(0, -1, 1, 2, 3, 7, 10**9, 2**31, 2**31 - 1, -(2**31) - 1, 2**40, 2**63, 2**64, 10**30, -(10**30), 10**399),
    *(0.0, -0.0, 0.5, -1.0, 1e-300, 5e-324, 1e-12, 1e12, 1e30, 1e300, 1.7e308, -1e300, 1.0000000000000002),
    *(float("inf"), float("-inf"), float("nan")),
    *(True, False, "", " ", "m1", "mode", "disk", "CNM", "jenkins", "a.b", "a/b", "../x", ".", "/", "~", "x" * 5000),
    *(
        "line\nbreak",
        "\t",
        "\u00b2",
        "\u0661\u0662",
        "\u00e9t\u00e9",
        "\U0001f600",
        "\x00",
        "\x7f",
        "--help",
        "=",
        "[",
        '"',
        "'",
        "%s",
        "{0}",
    ),
    *(
        [],
        [[]],
        {},
        [{}],
        {"": 0},
        ["mode"],
        [1, "a"],
        [[1.0, 2.0], [3.0]],
        {"a": {"b": [1]}},
        [1e300, 1e300],
        [0.0, 0.0],
    ),
    *(
        [1.0, 1.0],
        [1e-300, 2e-300],
        [2.0, 1.0],
        [1.0, 1.0000000000000002],
        [1e-10, 1e10],
        [float("nan")] * 2,
        [10**30] * 2,
    ),
)
#: Keys that are put in, besides those of other tables.
KEYS = (
    "",
    "\u00b2",
    "mode",
    "x" * 5000,
    "a.b",
    "a b",
    "\n",
    "\x00",
    "name",
    "type",
    "0",
    "-1",
    "1",
    "\u0661",
    "\U0001f600",
    "petsc",
)
#: PETSc options, right and wrong.
PETSC = (
    *(
        "-snes_max_it 3",
        "-snes_max_it -5",
        "-snes_max_it abc",
        "-ksp_rtol abc",
        "-ksp_type nonsense",
        "-pc_type nonsense",
    ),
    *("-snes_rtoll 1", "-snes_rtol", "-snes_rtol -1", "-snes_rtol nan", "-snes_rtol 1e400", "-ksp_max_it 99999999999"),
    *(
        "-",
        "--",
        "- -",
        "-snes_type nonsense",
        "-snes_type shell",
        "-snes_linesearch_type x",
        "-pc_type none",
        "-ts_type x",
    ),
    *("-mat_type nonsense", "-log_view", "-help", "-malloc_dump", "-snes_monitor :/nonsense/file", "x y", "\u00b2"),
    *(
        "-snes_lag_jacobian 0",
        "-eps_nev -3",
        "-eps_type nonsense",
        "-st_type nonsense",
        "-options_left",
        "-ts_rk_type x",
    ),
)
Place = tuple[Any, ...]


def mutated(random: Random, case: dict[str, Any]) -> dict[str, Any]:
    """A copy with one to three things changed."""
    case = copy.deepcopy(case)
    for _ in range(random.choice((1, 1, 1, 2, 3))):
        places = list(_places(case))
        if places:
            _change(random, case, places)
    return case


def _places(value: Any, place: Place = ()) -> Iterator[Place]:
    """Of all values but the outermost."""
    if place:
        yield place
    inside = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, part in inside:
        yield from _places(part, (*place, key))


def _at(value: Any, place: Place) -> Any:
    for part in place:
        value = value[part]
    return value


def _change(random: Random, case: dict[str, Any], places: list[Place]) -> None:
    place = random.choice(places)
    holder, key = _at(case, place[:-1]), place[-1]
    random.choice((_replace, _replace, _replace, _scale, _remove, _rename, _insert, _copy, _repeat, _wrap, _petsc))(
        random, case, holder, key, places
    )


def _replace(random: Random, case: Any, holder: Any, key: Any, places: list[Place]) -> None:
    holder[key] = copy.deepcopy(random.choice(ODD))


def _scale(random: Random, case: Any, holder: Any, key: Any, places: list[Place]) -> None:
    value, power = holder[key], random.choice((-300, -30, -12, -6, -2, 2, 6, 12, 30, 300))
    if isinstance(value, float):
        holder[key] = random.choice((1, -1)) * value * 10.0**power
    elif isinstance(value, int):
        holder[key] = random.choice((1, -1)) * value * 10 ** abs(power)
    elif isinstance(value, (list, str)):
        holder[key] = value[: random.randrange(len(value) + 1)]


def _remove(random: Random, case: Any, holder: Any, key: Any, places: list[Place]) -> None:
    del holder[key]


def _rename(random: Random, case: Any, holder: Any, key: Any, places: list[Place]) -> None:
    if isinstance(holder, dict):
        known = [place[-1] for place in places if isinstance(place[-1], str)]
        holder[random.choice((*KEYS, *known))] = holder.pop(key)


def _insert(random: Random, case: Any, holder: Any, key: Any, places: list[Place]) -> None:
    """A key of another table (with its value, or an odd one), or an odd key."""
    if isinstance(holder, dict):
        other = random.choice([place for place in places if isinstance(place[-1], str)] or [()])
        name = random.choice((*KEYS, *other[-1:], *other[-1:], *other[-1:] * 14))
        value = _at(case, other) if other and random.random() < 0.5 else random.choice(ODD)
        holder[name] = copy.deepcopy(value)
    else:
        holder.insert(key, copy.deepcopy(random.choice(ODD)))


def _copy(random: Random, case: Any, holder: Any, key: Any, places: list[Place]) -> None:
    """The value of another place."""
    holder[key] = copy.deepcopy(_at(case, random.choice(places)))


def _repeat(random: Random, case: Any, holder: Any, key: Any, places: list[Place]) -> None:
    if isinstance(holder, list):
        holder.append(copy.deepcopy(holder[key]))


def _wrap(random: Random, case: Any, holder: Any, key: Any, places: list[Place]) -> None:
    value = holder[key]
    holder[key] = random.choice(([value], {"a": value}, str(value), [[value]]))


def _petsc(random: Random, case: Any, holder: Any, key: Any, places: list[Place]) -> None:
    entries = [entry for entry in _tables(case.get("analysis")) if isinstance(entry, dict)]
    if entries:
        random.choice(entries)["petsc"] = random.choice(PETSC)


def _tables(value: Any) -> list[Any]:
    return value if isinstance(value, list) else []


def as_toml(case: dict[str, Any]) -> str:
    """TOML of a case; tables and arrays of tables under headers where they can stand so."""
    lines = [f"{_key(key)} = {_value(value)}" for key, value in case.items() if not _headed(value)]
    for key, value in case.items():
        if _headed(value):
            for table in value if isinstance(value, list) else [value]:
                lines.append(f"[[{_key(key)}]]" if isinstance(value, list) else f"[{_key(key)}]")
                lines += [f"{_key(name)} = {_value(entry)}" for name, entry in table.items()]
    return "\n".join(lines) + "\n"


def _headed(value: Any) -> bool:
    entries = value if isinstance(value, list) and value else [value]
    return all(isinstance(entry, dict) for entry in entries)


def _key(key: Any) -> str:
    return _value(str(key))


def _value(value: Any) -> str:
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_key(key)} = {_value(part)}" for key, part in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_value, value)) + "]"
    return repr(value)


def garbled(random: Random, text: str) -> str:
    """Text with a piece cut out, repeated, or other characters put in."""
    start, length = random.randrange(len(text) + 1), random.choice((1, 1, 2, 5, 40, 400))
    piece = random.choice(
        ("", text[start : start + length] * 2, "\x00", '"', "]", "[[", "=", "\n", "\ufeff", "9" * 400, "{", "'''", "#")
    )
    return text[:start] + piece + text[start + random.choice((0, length)) :]
