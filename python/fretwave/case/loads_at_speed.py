"""``[model] loads_at_speed``: static loads Omega^2 f2, through those of one to three speeds, at the case's speed."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from ..arrays import Array
from ..errors import InputError
from ..model.structure import SPIN, Structure
from ..results.missing_dof import missing_dof
from ..texts import nearest, toml
from .at_speed import least_squares, omega_squared, square_of
from .fields import LoadVector
from .pair_values import TABLE, ValueTable
from .reporter import Found
from .schema import ModelSection
from .toml.locate import Path as KeyPath
from .toml.source import Source


def with_loads(
    section: ModelSection,
    source: Source,
    structure: Structure,
    identity: Mapping[str, Any],
    notes: list[str],
    found: Found,
) -> tuple[Structure, Mapping[str, Any]]:
    """The structure with its loads at the speed of the case, and what identifies them.

    Of several speeds f2 is the least-squares fit, weighted as Omega^2 is; a note says what it leaves.
    """
    loads, known = dict(structure.loads), dict(identity)
    for name, given in (section.loads_at_speed or {}).items():
        squares, vectors = [], []
        loads[name] = np.zeros(structure.n_dof)  # of one that cannot be read: it is named, and its error told
        for text, vector in given.items():
            key = ("model", "loads_at_speed", name, text)
            square = square_of(text, key, source, found, f'{name} = {{ 3000 = "f3000{TABLE}" }}')
            read = _vector(vector, key, structure, source, found)
            if square is not None and read is not None:
                squares.append(square)
                vectors.append(read)
                known[".".join(key)] = "sha256:" + hashlib.sha256(read.tobytes()).hexdigest()[:16]
        if vectors:
            f2, left = least_squares(squares, vectors, np.linalg.norm)
            loads[name] = omega_squared(section.speed_rpm or 0.0) * f2
            if len(vectors) > 1:
                notes.append(f"load '{name}': Omega^2 f2 leaves {100 * left:.2g} % of it")
    return replace(structure, loads=loads), known


def check_speed(
    section: ModelSection, source: Source, structure: Structure, notes: list[str], found: Found
) -> dict[str, Any]:
    """The speed of the case, by address; that something asks for it, and that something depends on it."""
    if section.speed_rpm is None:
        if section.loads_at_speed is not None:
            what, where = "loads grow with a speed that is not given", source.where(("model", "loads_at_speed"))
            speed = next(iter(next(iter(section.loads_at_speed.values()))))
            found.append(InputError(what, where, None, "[model] speed_rpm", f"add `speed_rpm = {speed}` to [model]"))
        if section.at_speed is not None and any(one.get("type") != "linear" for one in source.entries("analysis")):
            notes.append("no [model] speed_rpm: all but linear analyses with speeds_rpm are at rest")
        return {}
    asked = [("contact", "load_rpm"), ("analysis", "force_rpm")]
    turns = section.at_speed is not None or section.loads_at_speed is not None or SPIN in structure.parts
    if not turns and not any(name in one for table, name in asked for one in source.entries(table)):
        what, expected = "nothing of the model depends on its speed", "at_speed, loads_at_speed, load_rpm or force_rpm"
        where, measured = source.where(("model", "speed_rpm")), f"speed_rpm = {section.speed_rpm:g}"
        found.append(InputError(what, where, measured, expected, "remove speed_rpm"))
    return {"model.speed_rpm": section.speed_rpm}


def _vector(given: LoadVector, key: KeyPath, structure: Structure, source: Source, found: Found) -> Array | None:
    """A load (n_dof,) [force]; None when something is wrong."""
    n = structure.n_dof
    if isinstance(given, list):
        if len(given) == n:
            return np.array(given, dtype=float)
        what, fix = "the load at speed is of another model", "give one number for each dof, in their order"
        found.append(InputError(what, source.where(key), f"{len(given)} numbers", f"{n}", fix))
        return None
    if given in structure.loads:
        return np.asarray(structure.loads[given], dtype=float)
    if not given.lower().endswith(TABLE):
        known = ", ".join(structure.loads) or "(the model brings none)"
        expected = f"numbers, a {TABLE} file of `dof,force`, or a load of the model: {known}"
        fix = nearest(given, list(structure.loads)) or f'write for example `3000 = "f3000{TABLE}"`'
        found.append(InputError("there is no such load", source.where(key), toml(given), expected, fix))
        return None
    table = DofTable(
        source.path.parent / given, "force", source.units("force"), source.where(key), -np.inf, False, "dof"
    )
    with suppress(_Told):
        return table.vector(structure, found)
    return None


class _Told(Exception):
    """What is wrong has been told."""


class DofTable(ValueTable):
    """One column of a CSV file, a row for each dof by its name; dofs without one have 0."""

    def vector(self, structure: Structure, found: Found) -> Array:
        """Values (n_dof,)."""
        names, seen = structure.dof_names, set[str]()
        places, out = {name: k for k, name in enumerate(names)}, np.zeros(len(names))
        try:
            for line, name, value in self._rows():
                name = name.strip()
                if name not in places:
                    fix = missing_dof(structure, name, names) or "take a name of the model's dofs"
                    self._wrong("is of no dof", line, name, f"one of {len(names)} dofs, as {names[0]}", fix)
                if name in seen:
                    self._wrong("has a dof again", line, name, "each dof once", "remove one of the lines")
                seen.add(name)
                out[places[name]] = self._number(line, value)
        except InputError as error:
            found.append(error)
            raise _Told from None
        return out
