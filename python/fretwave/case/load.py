"""Read a case file, check all of it, and report everything that is wrong at once."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from ..errors import CaseErrors, FretwaveError
from ..kinds import of_their_kinds
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
from .key_units import key_units
from .loads_at_speed import check_speed, with_loads
from .origin import check_physics, load_origin
from .plugins import Plugin, read_plugins
from .reduce import kept_dofs
from .resolved import faces_by_address, resolved_values
from .schema import AerodynamicsSection, DampingSection, ModelSection, PreloadSection, ReductionSection, StudySection
from .sector import tie
from .toml.source import Source
from .toml.validation import validate
from .uncertainty import advise, draw_values
from .units import in_units

Table = TypeVar("Table", bound=Section)

__all__ = ["Case", "changed_keys", "load_case"]


@of_their_kinds
def load_case(
    path: str | Path,
    overrides: Sequence[str] | str = (),
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
    overrides : sequence of str, or one
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
    for assignment in [overrides] if isinstance(overrides, str) else overrides:
        source.apply_set(assignment)
    uncertainty = draw_values(source)
    found: list[FretwaveError] = list(source.problems)
    loaded = read_plugins(source, found, plugins)
    if len(found) > len(source.problems):  # what they would have added is missing everywhere
        raise CaseErrors(_in_file_order(found), source.label)
    laws = _core_laws() if laws is None else laws
    case = _build(source, laws, loaded, found)
    if found or case is None:
        advise(found, uncertainty)
        raise CaseErrors(_in_file_order(found), source.label)
    if uncertainty is None:
        return case
    uncertainty = uncertainty.in_units(key_units(source, [one.key for one in uncertainty.draws], laws, case.units))
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
    section, tables = _table(ModelSection, "model", source, found), _tables(source, found)
    notes: list[str] = []
    structure, places, identity = _structure(section, source, analyses, notes, found)
    built = structure.pairs if structure else {}
    contacts = read_contacts(source, structure.dof_names if structure else None, laws, found, built)
    tied = structure is not None
    if section and structure:
        wrong = len(found)
        structure, contacts = _tied(section, source, structure, contacts, notes, found)
        tied = len(found) == wrong and (structure.cut is not None or not (section.sectors or structure.sectors))
    keep = _kept(structure, analyses, tables) if structure else {}
    facts = _facts(source, section, structure, tied, contacts, laws, keep, tables)
    if tied:
        check_aerodynamics(source, tables.aerodynamics, facts.sectors, facts.dofs or [], found)
    _check(source, structure, facts, analyses, tables, notes, found)
    tables = replace(tables, gauges=read_gauges(source, (structure.cut or structure) if structure else None, found))
    if structure is not None and tied:
        rows = [contact.pairs.own for contact in contacts] if facts.complete else None
        check_physics(structure, places, rows, notes, found)
    if found or section is None or structure is None:
        return None
    tables = replace(tables, preload=tables.preload or implied_preload(source, contacts, notes))
    identity = {**identity, **faces_by_address(section, structure)}
    resolved = resolved_values(identity, source, section, contacts, analyses, tables)
    return Case(
        source=source,
        structure=structure,
        contacts=contacts,
        analyses=Analyses({analysis.name: analysis for analysis in analyses.values()}, plugins),
        resolved={**resolved, **{f"plugins.{plugin.name}": plugin.digest for plugin in plugins}},
        tables=tables,
        notes=[*notes, *_unused_contacts(built, contacts)],
        keep=list(keep),
    )


def _tables(source: Source, found: list[FretwaveError]) -> Tables:
    """All that need nothing of the model to be read."""
    return Tables(
        _table(ReductionSection, "reduction", source, found),
        _table(PreloadSection, "preload", source, found),
        _table(DampingSection, "damping", source, found),
        _table(AerodynamicsSection, "aerodynamics", source, found),
        _table(StudySection, "study", source, found) or StudySection(),
    )


def _structure(
    section: ModelSection | None,
    source: Source,
    analyses: Mapping[int, AnalysisSection],
    notes: list[str],
    found: list[FretwaveError],
) -> tuple[Structure | None, Mapping[str, str], Mapping[str, Any]]:
    """The model in the case's units and at its speed, the places of its parts, and what tells it by address."""
    given = load_origin(section, source, notes, found) if section else None
    structure, places, identity = given or (None, {}, {})
    if section and structure:
        source.dof_fix = partial(missing_dof, structure)
        structure, identity = in_units(section, source, structure, identity, notes, found)
        structure, identity = with_speeds(section, source, structure, identity, notes, found)
        structure, identity = with_loads(section, source, structure, identity, notes, found)
        identity = {**identity, **check_speed(section, source, structure, notes, found)}
        for analysis in analyses.values():
            analysis.read_in(structure.unit_system)
    return structure, places, identity


def _tied(
    section: ModelSection,
    source: Source,
    structure: Structure,
    contacts: list[Contact],
    notes: list[str],
    found: list[FretwaveError],
) -> tuple[Structure, list[Contact]]:
    """The model with the pairs of its contacts; a sector tied to its neighbours, if nothing is wrong with its faces."""
    with_pairs = replace(
        structure,
        pairs={contact.name: contact.pairs for contact in contacts},
        stiffness_damping=section.stiffness_damping,
        mass_damping=section.mass_damping,
    )
    structure, contacts = tie(section, source, with_pairs, contacts, notes, found)
    source.dof_fix = partial(missing_dof, structure.cut or structure)
    return structure, contacts


def _facts(
    source: Source,
    section: ModelSection | None,
    structure: Structure | None,
    tied: bool,
    contacts: Sequence[Contact],
    laws: Mapping[str, Any],
    keep: Mapping[int, str],
    tables: Tables,
) -> Facts:
    dofs = structure.dof_names if structure else None
    known = set(dofs or ())  # of a sector, dofs of the high face are kept, and left out
    return Facts(
        source=source,
        model_known=tied,
        dofs=dofs,
        named=[name for name in keep.values() if name in known] if keep else dofs,
        least_dofs=len(keep) if tables.reduction else len(dofs or ()),
        neighbours=structure if structure and structure.cut else None,
        contacts=contacts,
        complete=len(contacts) == len(source.entries("contact")),
        laws=laws,
        loads=list(structure.loads) if structure else None,
        parts=known_parts(section, structure) if section and structure else None,
        preload=tables.preload,
        flow=tables.aerodynamics,
    )


def _check(
    source: Source,
    structure: Structure | None,
    facts: Facts,
    analyses: dict[int, AnalysisSection],
    tables: Tables,
    notes: list[str],
    found: list[FretwaveError],
) -> None:
    """Analyses and tables against the rest of the case."""
    checks.complete_analyses(source, analyses, facts, found)
    checks.check_analyses(source, analyses, facts, found)
    check_reduction(source, tables.reduction, analyses, facts, notes, found)
    check_preload(source, tables.preload, facts.loads, found)
    check_damping(source, tables.damping, structure, tables.reduction, notes, found)


def _kept(structure: Structure, analyses: Mapping[int, AnalysisSection], tables: Tables) -> dict[int, str]:
    """Dofs that a reduction keeps, of a sector before its faces were tied, with their names; none without one."""
    if tables.reduction is None:
        return {}
    given, blade = structure.cut or structure, tables.aerodynamics and tables.aerodynamics.dof
    names = given.dof_names
    named = {names.index(blade)} if blade in names else set()
    return {k: names[k] for k in sorted(named.union(kept_dofs(given, analyses)))}


def _table(kind: type[Table], name: str, source: Source, found: list[FretwaveError]) -> Table | None:
    """The validated table of this name, None when there is none or something is wrong with it."""
    return validate(kind, source, (name,), found) if isinstance(source.data.get(name), dict) else None


def _unused_contacts(built: Mapping[str, Pairs], contacts: Sequence[Contact]) -> list[str]:
    used = [contact.name for contact in contacts]
    unused = [name for name in built if name not in used]
    return [f"the builder's contact '{name}' is not used: no [[contact]] has this name" for name in unused]
