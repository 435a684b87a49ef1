"""Read a case file, check all of it, and report everything that is wrong at once."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from ..errors import CaseErrors, FretwaveError
from ..model.contact import Contact
from ..model.pairs import Pairs
from ..model.structure import Structure
from ..results.missing_dof import missing_dof
from . import checks
from .analysis import Analyses, AnalysisSection
from .at_speed import known_parts, with_speeds
from .case import Case, Tables, changed_keys
from .checks_tables import check_preload, check_reduction, implied_preload
from .contacts import read_contacts
from .damping import check_damping
from .facts import Facts
from .fields import Section
from .flow import check_aerodynamics
from .gauges import read_gauges
from .loads_at_speed import check_speed, with_loads
from .origin import check_physics, load_origin
from .plugins import Plugin, read_plugins
from .reduce import kept_dofs
from .schema import AerodynamicsSection, DampingSection, ModelSection, PreloadSection, ReductionSection, StudySection
from .sector import tie
from .toml.source import Source
from .toml.validation import validate
from .uncertainty import advise, draw_values
from .units import in_units

Table = TypeVar("Table", bound=Section)

__all__ = ["Case", "changed_keys", "load_case"]


def load_case(
    path: str | Path,
    overrides: Sequence[str] = (),
    quick: bool = False,
    laws: Mapping[str, Any] | None = None,
    text: str | None = None,
    plugins: Sequence[Mapping[str, str]] = (),
) -> Case:
    """Read and check a case file.

    Parameters
    ----------
    path : str or Path
        The TOML file.
    overrides : sequence of str
        ``key=value`` of ``--set``, applied in order, after `quick`.
    quick : bool
        Apply the overrides of the ``[quick]`` table.
    laws : mapping, optional
        Known contact laws; default those of the core.
    text : str, optional
        Text to use in place of the file's.
    plugins : sequence of mappings, optional
        `name` and `text` of plug-ins as a run's record keeps them, for those whose files are gone.

    Raises
    ------
    CaseErrors
        All that is wrong, each with file and line.
    InputError
        The file is missing or is not TOML.
    """
    source = Source(Path(path), text)
    if quick:
        source.apply_quick()
    for assignment in overrides:
        source.apply_set(assignment)
    uncertainty = draw_values(source)
    found: list[FretwaveError] = list(source.problems)
    loaded = read_plugins(source, found, plugins)
    if len(found) > len(source.problems):  # what they would have added is missing everywhere
        raise CaseErrors(_in_file_order(found), source.label)
    case = _build(source, _core_laws() if laws is None else laws, loaded, found)
    if found or case is None:
        advise(found, uncertainty)
        raise CaseErrors(_in_file_order(found), source.label)
    if uncertainty is None:
        return case
    return replace(case, uncertainty=uncertainty, resolved={**case.resolved, **uncertainty.resolved()})


def _core_laws() -> Mapping[str, Any]:
    from ..model.laws import laws

    return laws()


def _in_file_order(found: list[FretwaveError]) -> list[FretwaveError]:
    def line(problem: FretwaveError) -> int:
        digits = (problem.where or "").rpartition(":")[2].split(" ")[0]
        return int(digits) if re.fullmatch("[0-9]{1,9}", digits) else 0

    return sorted(found, key=line)


def _build(
    source: Source, laws: Mapping[str, Any], plugins: Sequence[Plugin], found: list[FretwaveError]
) -> Case | None:
    checks.check_top_level(source, found)
    analyses = checks.read_analyses(source, found)
    section = _table(ModelSection, "model", source, found)
    reduction = _table(ReductionSection, "reduction", source, found)
    preload = _table(PreloadSection, "preload", source, found)
    damping = _table(DampingSection, "damping", source, found)
    flow = _table(AerodynamicsSection, "aerodynamics", source, found)
    study = _table(StudySection, "study", source, found)
    given = load_origin(section, source, found) if section else None
    structure, places, identity = given or (None, {}, {})
    notes: list[str] = []
    if section and structure:
        source.dof_fix = partial(missing_dof, structure)
        structure, identity = in_units(section, source, structure, identity, notes, found)
        structure, identity = with_speeds(section, source, structure, identity, notes, found)
        structure, identity = with_loads(section, source, structure, identity, notes, found)
        identity = {**identity, **check_speed(section, source, structure, notes, found)}
        for analysis in analyses.values():
            analysis.read_in(structure.unit_system)
    dofs = structure.dof_names if structure else None
    built = structure.pairs if structure else {}
    contacts = read_contacts(source, dofs, laws, found, built)
    neighbours, tied = None, True
    if section and structure:
        structure = replace(
            structure,
            pairs={contact.name: contact.pairs for contact in contacts},
            stiffness_damping=section.stiffness_damping,
            mass_damping=section.mass_damping,
        )
        wrong = len(found)
        structure, contacts = tie(section, source, structure, contacts, notes, found)
        tied = len(found) == wrong
        source.dof_fix = partial(missing_dof, structure.cut or structure)
        neighbours = structure if structure.cut else None
        dofs = structure.dof_names if neighbours else dofs
        if tied:
            check_aerodynamics(source, flow, neighbours.sectors if neighbours else None, dofs or [], found)
    blade = flow.dof if flow else None
    keep = _kept(structure, analyses, blade) if structure and reduction else {}
    known = set(dofs or ())  # of a sector, dofs of the high face are kept, and left out
    facts = Facts(
        source=source,
        model_known=section is not None and structure is not None and tied,
        dofs=dofs,
        named=[name for name in keep.values() if name in known] if keep else dofs,
        least_dofs=len(keep) if reduction else len(dofs or ()),
        neighbours=neighbours,
        contacts=contacts,
        complete=len(contacts) == len(source.entries("contact")),
        laws=laws,
        loads=list(structure.loads) if structure else None,
        parts=known_parts(section, structure) if section and structure else None,
        preload=preload,
        flow=flow,
    )
    checks.complete_analyses(source, analyses, facts, found)
    checks.check_analyses(source, analyses, facts, found)
    check_reduction(source, reduction, analyses, facts.sectors, notes, found)
    check_preload(source, preload, facts.loads, found)
    check_damping(source, damping, structure, reduction, notes, found)
    gauges = read_gauges(source, (structure.cut or structure) if structure else None, found)
    if structure is not None and tied:
        rows = [contact.pairs.own for contact in contacts] if facts.complete else None
        check_physics(structure, places, rows, notes, found)
    if found or section is None or structure is None:
        return None
    preload = preload or implied_preload(source, contacts, notes)
    tables = {"reduction": reduction, "preload": preload, "damping": damping, "aerodynamics": flow}
    return Case(
        source=source,
        structure=structure,
        contacts=contacts,
        analyses=Analyses({analysis.name: analysis for analysis in analyses.values()}, plugins),
        resolved={
            **_resolve({**identity, **_faces(section, structure)}, source, section, contacts, analyses, tables),
            **{f"plugins.{plugin.name}": plugin.digest for plugin in plugins},
        },
        tables=Tables(reduction, preload, damping, flow, study or StudySection(), gauges),
        notes=[*notes, *_unused_contacts(built, contacts)],
        keep=list(keep),
    )


def _kept(structure: Structure, analyses: Mapping[int, AnalysisSection], blade: str | None) -> dict[int, str]:
    """Dofs that a reduction keeps, of a sector before its faces were tied, with their names.

    Parameters
    ----------
    blade : dof that the flow acts on
    """
    given = structure.cut or structure
    names = given.dof_names
    named = {names.index(blade)} if blade in names else set()
    return {k: names[k] for k in sorted(named.union(kept_dofs(given, analyses)))}


def _faces(section: ModelSection, structure: Structure) -> dict[str, Any]:
    """What says that the model is a sector, by address."""
    cut = structure.cut
    if cut is None or cut.low is None or cut.high is None:
        return {}
    names = cut.dof_names
    faces = {f"model.{name}": [names[k] for k in face] for name, face in (("low", cut.low), ("high", cut.high))}
    return {"model.sectors": cut.sectors, **faces, **({"model.axis": cut.axis} if section.axis else {})}


def _table(kind: type[Table], name: str, source: Source, found: list[FretwaveError]) -> Table | None:
    """The validated table of this name, None when there is none or something is wrong with it."""
    return validate(kind, source, (name,), found) if isinstance(source.data.get(name), dict) else None


def _unused_contacts(built: Mapping[str, Pairs], contacts: Sequence[Contact]) -> list[str]:
    used = [contact.name for contact in contacts]
    unused = [name for name in built if name not in used]
    return [f"the builder's contact '{name}' is not used: no [[contact]] has this name" for name in unused]


def _resolve(
    identity: Mapping[str, Any],
    source: Source,
    section: ModelSection,
    contacts: Sequence[Contact],
    analyses: Mapping[int, AnalysisSection],
    tables: Mapping[str, Section | None],
) -> dict[str, Any]:
    """All values that decide the results, flat, under the addresses that ``--set`` uses."""
    resolved = dict(identity)
    damping = {key: getattr(section, key) for key in ("stiffness_damping", "mass_damping")}
    resolved.update({f"model.{key}": value for key, value in damping.items() if value})
    for name, table in tables.items():
        given = table.model_dump(mode="json") if table else {}
        resolved.update({f"{name}.{key}": value for key, value in given.items()})
    for entry, contact in zip(source.entries("contact"), contacts):
        pairs = [[pair] if isinstance(pair, str) else pair for pair in entry.get("pairs", [])]
        values: dict[str, Any] = {"law": contact.law, "pairs": pairs}
        if entry.get("tangents") is not None:
            values["tangents"] = [[end] if isinstance(end, str) else end for end in entry["tangents"]]
        values.update({key: _plain(value) for key, value in contact.parameters.items()})
        resolved.update({f"contact.{contact.name}.{key}": value for key, value in values.items()})
    for analysis in analyses.values():
        dumped = analysis.model_dump(mode="json", exclude={"name"})
        resolved.update({f"{analysis.name}.{key}": value for key, value in dumped.items()})
    return resolved


def _plain(value: object) -> object:
    return value.tolist() if hasattr(value, "tolist") else value
