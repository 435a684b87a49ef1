"""What the case is: its model, contacts and reduction, from the case where it can be read again, else from run.json."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Array
from ..case.kept import reload_case
from ..case.load import Case
from ..errors import FretwaveError
from ..importers.report import masses, rigid_motions
from ..model.contact import Contact, span
from ..model.structure import Structure
from ..results.reader import Run
from ..texts import counted, toml
from ..units import SI, UnitSystem
from ..view.run import learn_kept_laws
from . import page

Fact = tuple[str, object]
#: Longest text of a value.
LONGEST = 400
#: Keys of [model] that say where it comes from.
ORIGIN = ("builder", "file", "M", "K", "C", "options")


def read_case(folder: Path, record: Mapping[str, Any]) -> tuple[Case | None, str]:
    """The case of a run, of a sweep that of its first value, or why it cannot be read again."""
    if "sweep" in record:
        folder = folder / record.get("values", [{}])[0].get("folder", "values/0000")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            learn_kept_laws(folder)
            return reload_case(folder, kept=True)[0], ""
    except FretwaveError as error:
        told = "" if error.measured is None else f" ({error.measured})"
        return None, f"the model cannot be read again: {error.what}{told}"


def model_part(run: Run, record: Mapping[str, Any], case: Case | None, problem: str) -> str:
    """Tables of the model and its contacts."""
    resolved = record["case"]["resolved"]
    units = case.units if case else _units(run)
    parts = [page.box([problem] if problem else []), page.facts(_facts(run, record, case, units))]
    parts.append(page.titled("Contact", _contacts(case, resolved, units)))
    parts.append(page.titled("Reduction", _reduction(record.get("reduction"))))
    return "\n".join(part for part in parts if part)


def _units(run: Run) -> UnitSystem:
    """Of the results."""
    return next((analysis.unit_system for analysis in run.analyses.values()), SI)


def _facts(run: Run, record: Mapping[str, Any], case: Case | None, units: UnitSystem) -> Iterator[Fact]:
    resolved = record["case"]["resolved"]
    for name in ORIGIN:
        found = {k: v for k, v in resolved.items() if k == f"model.{name}" or k.startswith(f"model.{name}.")}
        yield name, ", ".join(_origin(key, value) for key, value in found.items())
    for key, values in record.get("sweep", {}).get("over", {}).items():
        yield "swept", f"{key} = {toml(values, LONGEST)}; what is said here is of the first value"
    yield "units", units.described()
    yield "dofs", _dofs(run, record, case)
    if case is not None:
        yield "mass", _mass(case, units)
        yield "named dofs", _named(case)
    sectors = resolved.get("model.sectors")
    yield "sectors", f"{sectors} of a wheel, of which the model is one" if sectors else ""
    for name, unit in (("stiffness_damping", "s"), ("mass_damping", "1/s")):
        value = resolved.get(f"model.{name}")
        yield name.replace("_", " "), f"{value:g} {unit}" if value else ""
    for name in ("preload", "damping", "aerodynamics"):
        told = {key.partition(".")[2]: value for key, value in resolved.items() if key.startswith(f"{name}.")}
        yield name, ", ".join(f"{key} = {toml(value, LONGEST)}" for key, value in told.items() if value is not None)


def _origin(key: str, value: object) -> str:
    """What the case says of its model; a matrix in rows is not written out."""
    name = key.split(".")[-1]
    if isinstance(value, list) and ".options." not in key:
        return f"{len(value)} x {len(value)} in the case"
    return f"{name} = {toml(value, LONGEST)}" if ".options." in key else str(value)


def _dofs(run: Run, record: Mapping[str, Any], case: Case | None) -> str:
    solved = next((len(analysis.dofs) for analysis in run.analyses.values() if analysis.dofs), 0)
    before = record.get("reduction", {}).get("unreduced") or (len(case.dofs) if case else solved)
    return f"{before}, reduced to {solved}" if solved and solved < before else str(before or "")


def _named(case: Case, most: int = 12) -> str:
    """Names of dofs that are no plain numbers."""
    names = [name for name in case.structure.dofs or case.dofs if not str(name).isdigit()]
    return ", ".join(names[:most]) + (f", ... ({len(names)} in all)" if len(names) > most else "")


def _mass(case: Case, units: UnitSystem) -> str:
    """Along x, y and z where nodes are known, else what stands on the diagonal."""
    given = case.structure.cut or case.structure
    M, moved = given.own("M"), translations(given)
    assert M is not None
    unit = units("mass")
    if moved is None:
        diagonal = M.diagonal()
        return f"not known without nodes; diagonal of M {diagonal.min():.6g} to {diagonal.max():.6g} {unit}"
    found = ", ".join(f"{mass:.6g} along {axis}" for mass, axis in zip(masses(M, moved), "xyz"))
    return f"{found} {unit}, of what can move" + (" (one sector)" if given.sectors else "")


def translations(given: Structure) -> Array | None:
    """(n_dof, 3) unit motions along x, y, z; None where it is not known which dof moves along which."""
    if given.labels is not None:
        motions = rigid_motions(given)
        return None if motions is None else motions[:, :3]
    if given.coordinates is None or given.expansion is not None:
        return None
    places = given.dofs_of_nodes
    moved = np.zeros((given.n_dof + 1, 3))  # the last row takes what is held
    for axis in range(3):
        moved[places[:, axis], axis] = 1.0
    return moved[:-1]


def _contacts(case: Case | None, resolved: Mapping[str, Any], units: UnitSystem) -> str:
    rows = [_contact(contact, units) for contact in case.contacts] if case else list(_kept_contacts(resolved))
    return page.table(["name", "law", "pairs", "parameters"], rows) if rows else ""


def _contact(contact: Contact, units: UnitSystem) -> list[object]:
    symbol = {parameter.name: units(parameter.unit) for parameter in contact.info.parameters}
    told = [f"{name} {span(value)} {_symbol(symbol.get(name, ''))}" for name, value in contact.parameters.items()]
    areas = contact.pairs.areas
    told += [] if areas is None else [f"area {np.sum(areas):.6g} {units('length^2')} in all"]
    return [contact.name, contact.info.name, str(contact.n_pairs), "; ".join(one.strip() for one in told)]


def _symbol(unit: str) -> str:
    return "" if unit in ("1", "-") else unit


def _kept_contacts(resolved: Mapping[str, Any]) -> Iterator[list[object]]:
    """As run.json has them."""
    names = dict.fromkeys(key.split(".")[1] for key in resolved if key.startswith("contact."))
    for name in names:
        own = {key.split(".", 2)[2]: value for key, value in resolved.items() if key.startswith(f"contact.{name}.")}
        told = [f"{key} {_spanned(value)}" for key, value in own.items() if key not in ("law", "pairs", "tangents")]
        yield [name, str(own["law"]), str(len(own["pairs"]) or ""), "; ".join(told)]


def _spanned(value: object) -> str:
    return span(value) if isinstance(value, (int, float, list)) and np.size(value) else toml(value)


def _reduction(found: Mapping[str, Any] | None) -> str:
    """What it kept, and how far frequencies are off."""
    if not found:
        return ""
    faces = f", {found['interface']} of each face" if found.get("interface") else ""
    highest = found["highest_component_hz"]
    said = (
        f"{counted(found['unreduced'], 'dof')} to {found['kept']} kept{faces} and {found['component_modes']}"
        f" component modes, up to {highest:.6g} Hz"
    )
    stuck = {"contact": "stuck", "full_hz": found["full_hz"], "reduced_hz": found["reduced_hz"]}
    waves = found.get("waves") or [stuck, *([found["sliding"]] if found.get("sliding") else [])]
    rows = [row for wave in (*waves, *found.get("speeds", ())) for row in _compared(wave)]
    head = ["", "linear frequency [Hz]", "reduced [Hz]", "relative difference"]
    return page.facts([("Craig-Bampton", said)]) + (page.table(head, rows) if rows else "")


def _compared(wave: Mapping[str, Any]) -> Iterator[list[object]]:
    """Frequencies without and with reduction."""
    where = (
        f"nodal diameter {wave['nodal_diameter']}, {wave['contact']}" if "nodal_diameter" in wave else wave["contact"]
    )
    where = f"{wave['speed_rpm']:g} rev/min, {where}" if "speed_rpm" in wave else where
    for number, (full, small) in enumerate(zip(wave["full_hz"], wave["reduced_hz"]), 1):
        relative = f"{small / full - 1:.1e}" if full else "–"
        yield [f"{where}, {number}", f"{full:.6g}", f"{small:.6g}", relative]
