"""Read a case file, check all of it, and report everything that is wrong at once."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import scipy.sparse

from ..errors import CaseErrors, FretwaveError
from ..model.structure import BuiltModel
from ..texts import toml
from . import checks
from .analysis import Analyses, AnalysisSection
from .checks_tables import check_preload, check_reduction
from .contacts import ContactSpec, read_contacts
from .facts import Facts
from .flow import check_aerodynamics
from .origin import Origin, check_physics, load_origin
from .plugins import Plugin, read_plugins
from .reduce import kept_dofs
from .reduction_report import ReductionReport
from .schema import (
    AerodynamicsSection,
    ModelSection,
    PreloadSection,
    ReductionSection,
    Section,
    StudySection,
)
from .sector import Neighbours, tie
from .toml.source import Source
from .toml.validation import validate

if TYPE_CHECKING:
    from .wheel import Wheel

Table = TypeVar("Table", bound=Section)


@dataclass
class Case:
    """A case that passed every check.

    Attributes
    ----------
    path, text
        The case file and its text as read.
    dofs : list of str
        Names of the dofs, in the order of the matrices.
    M, K, C : (n_dof, n_dof) sparse CSR [kg], [N/m], [N s/m]; C may be None
    damping : (float, float)
        Shares of K [s] and M [1/s] that are added to C.
    loads : dict
        Static loads (n_dof,) [N] by name.
    built : BuiltModel
        What came with a built model, in its own dofs.
    reduction : ReductionSection
        How to reduce, None for not at all.
    reduced : ReductionReport
        What a reduction did; None for the model as given.
    unreduced : Case
        The case before its reduction, where the reduction's error is asked for.
    keep : list of int
        Dofs that a reduction keeps; of a sector with both its faces.
    preload : PreloadSection
        The static state of all analyses without one of their own; None for none.
    neighbours : Neighbours
        What ties a sector of a wheel to the next ones; None for a whole structure.
    aerodynamics : AerodynamicsSection
        Forces of the flow on a sector's blades; None for none.
    wheel : Wheel
        Of a case put on its whole wheel (`fretwave.case.wheel.on_wheel`), the sector it is made of.
    analyses : Analyses
        Validated analyses by name, in the order of the file.
    resolved : dict
        Every value that decides the results, defaults included, by its address (``mode.harmonics``).
    notes : list of str
        What a user should know although nothing is wrong.
    has_quick : bool
        The case has a short form.
    study : StudySection
        What ``fretwave study`` sweeps.
    """

    path: Path
    text: str
    title: str
    dofs: list[str]
    M: Any
    K: Any
    C: Any
    contacts: list[ContactSpec]
    analyses: Analyses
    resolved: dict[str, Any]
    notes: list[str] = field(default_factory=list)
    has_quick: bool = False
    study: StudySection = field(default_factory=StudySection)
    damping: tuple[float, float] = (0.0, 0.0)
    loads: dict[str, Any] = field(default_factory=dict)
    built: BuiltModel | None = None
    reduction: ReductionSection | None = None
    keep: list[int] = field(default_factory=list)
    reduced: ReductionReport | None = None
    unreduced: Case | None = None
    preload: PreloadSection | None = None
    neighbours: Neighbours | None = None
    aerodynamics: AerodynamicsSection | None = None
    wheel: Wheel | None = None

    @property
    def name(self) -> str:
        """Name of the case: that of its folder, or of the file if it is not ``case.toml``."""
        return self.path.resolve().parent.name if self.path.stem == "case" else self.path.stem

    @property
    def digest(self) -> str:
        """Hash of everything that decides the results."""
        return hashlib.sha256(json.dumps(self.resolved, sort_keys=True).encode()).hexdigest()

    def dof(self, name: str, sector: int = 0) -> int:
        """Index of a dof; on a wheel the case's names are those of a sector's dofs."""
        return self.dofs.index(name) if self.wheel is None else self.wheel.dof(name, sector)

    def places(self, name: str) -> list[int]:
        """Indices of a dof in all sectors of a wheel; of a structure or of one sector that of `dof` alone."""
        return [self.dof(name, j) for j in range(self.wheel.sectors if self.wheel else 1)]

    def damping_with(self, dampers: Sequence[Any]) -> Any:
        """C with its shares of K and M and viscous dampers to ground, None when there is no damping at all."""
        parts = [] if self.C is None else [self.C]
        parts += [share * matrix for share, matrix in zip(self.damping, (self.K, self.M)) if share]
        if dampers:
            places = [place for damper in dampers for place in self.places(damper.dof)]
            values = [damper.c for damper in dampers for _ in self.places(damper.dof)]
            parts.append(scipy.sparse.csr_matrix((values, (places, places)), shape=self.M.shape))
        return sum(parts[1:], parts[0]).tocsr() if parts else None

    def ahead_damping(self, own: Any) -> dict[int, Any] | None:
        """C of a sector with its parts on other sectors; `own` is what `damping_with` gives."""
        if self.neighbours is None or own is None:
            return None if own is None else {0: own}
        shares = zip("CKM", (1.0, *self.damping))
        total = {0: own}
        for letter, share in shares:
            for k, part in self.neighbours.terms.get(letter, {}).items() if share else ():
                total[k] = total[k] + share * part if k in total else share * part
        return total

    def preload_of(self, analysis: AnalysisSection) -> PreloadSection | None:
        """The preload of an analysis: its own, or that of the case."""
        return analysis.settings(self).own_preload() or self.preload


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
    found: list[FretwaveError] = list(source.problems)
    loaded = read_plugins(source, found, plugins)
    if len(found) > len(source.problems):  # what they would have added is missing everywhere
        raise CaseErrors(_in_file_order(found), source.label)
    case = _build(source, _core_laws() if laws is None else laws, loaded, found)
    if found or case is None:
        raise CaseErrors(_in_file_order(found), source.label)
    return case


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
    flow = _table(AerodynamicsSection, "aerodynamics", source, found)
    study = _table(StudySection, "study", source, found)
    origin = load_origin(section, source, found) if section else None
    dofs = origin.dofs if origin else None
    built = origin.built if origin else None
    contacts = read_contacts(source, dofs, laws, found, built.contacts if built else {})
    neighbours = None
    if section and origin:
        origin, contacts, neighbours = tie(section, source, origin, contacts, found)
        dofs, built = origin.dofs, origin.built
        check_aerodynamics(source, flow, neighbours.sectors if neighbours else None, origin.dofs, found)
    blade = flow.dof if flow else None
    keep = _kept(origin, contacts, analyses, neighbours, blade) if origin and reduction else {}
    known = set(dofs or ())  # of a sector, dofs of the high face are kept, and left out
    facts = Facts(
        source=source,
        model_known=section is not None and origin is not None,
        dofs=dofs,
        named=[name for name in keep.values() if name in known] if keep else dofs,
        least_dofs=len(keep) if reduction else len(dofs or ()),
        neighbours=neighbours,
        contacts=contacts,
        complete=len(contacts) == len(source.entries("contact")),
        laws=laws,
        built=built.contacts if built else {},
        loads=list(built.loads) if built else () if origin else None,
        preload=preload,
        flow=flow,
    )
    checks.complete_analyses(source, analyses, facts, found)
    checks.check_analyses(source, analyses, facts, found)
    check_reduction(source, reduction, analyses, facts.sectors, found)
    check_preload(source, preload, facts.loads, found)
    notes: list[str] = []
    if origin is not None:
        check_physics(origin, [contact.rows for contact in contacts] if facts.complete else None, notes, found)
    if found or section is None or origin is None:
        return None
    loaded = {letter: matrix.values for letter, matrix in origin.matrices.items()}
    tables = {"reduction": reduction, "preload": preload, "aerodynamics": flow}
    return Case(
        path=source.path,
        text=source.text,
        title=str(source.data.get("title", "")),
        dofs=origin.dofs,
        M=loaded["M"],
        K=loaded["K"],
        C=loaded.get("C"),
        contacts=contacts,
        analyses=Analyses({analysis.name: analysis for analysis in analyses.values()}, plugins),
        resolved={
            **_resolve(origin, section, contacts, analyses, tables),
            **{f"plugins.{plugin.name}": plugin.digest for plugin in plugins},
        },
        notes=[*notes, *_unused_contacts(built, contacts)],
        has_quick="quick" in source.data,
        study=study or StudySection(),
        damping=(section.stiffness_damping, section.mass_damping),
        loads=dict(built.loads) if built else {},
        built=built,
        reduction=reduction,
        keep=list(keep),
        preload=preload,
        neighbours=neighbours,
        aerodynamics=flow,
    )


def _kept(
    origin: Origin,
    contacts: Sequence[ContactSpec],
    analyses: Mapping[int, AnalysisSection],
    neighbours: Neighbours | None,
    blade: str | None,
) -> dict[int, str]:
    """Dofs that a reduction keeps, of a sector before its faces were tied, with their names.

    Parameters
    ----------
    blade : dof that the flow acts on
    """
    if neighbours is not None:
        origin, contacts = neighbours.cut.origin, neighbours.cut.contacts
    named = {**origin.named, **({blade: origin.dofs.index(blade)} if blade in origin.dofs else {})}
    return {k: origin.dofs[k] for k in kept_dofs(named, contacts, analyses, origin.dofs)}


def _table(kind: type[Table], name: str, source: Source, found: list[FretwaveError]) -> Table | None:
    """The validated table of this name, None when there is none or something is wrong with it."""
    return validate(kind, source, (name,), found) if isinstance(source.data.get(name), dict) else None


def _unused_contacts(built: BuiltModel | None, contacts: Sequence[ContactSpec]) -> list[str]:
    used = [contact.name for contact in contacts]
    unused = [name for name in (built.contacts if built else {}) if name not in used]
    return [f"the builder's contact '{name}' is not used: no [[contact]] has this name" for name in unused]


def _resolve(
    origin: Origin,
    section: ModelSection,
    contacts: list[ContactSpec],
    analyses: dict[int, AnalysisSection],
    tables: dict[str, Any],
) -> dict[str, Any]:
    """All values that decide the results, flat, under the addresses that ``--set`` uses."""
    resolved = dict(origin.resolved)
    damping = {key: getattr(section, key) for key in ("stiffness_damping", "mass_damping")}
    resolved.update({f"model.{key}": value for key, value in damping.items() if value})
    for name, table in tables.items():
        given = table.model_dump(mode="json") if table else {}
        resolved.update({f"{name}.{key}": value for key, value in given.items()})
    for contact in contacts:
        values = {"law": contact.law, "pairs": contact.pairs}
        values.update({key: _plain(value) for key, value in contact.parameters.items()})
        resolved.update({f"contact.{contact.name}.{key}": value for key, value in values.items()})
    for analysis in analyses.values():
        dumped = analysis.model_dump(mode="json", exclude={"name"})
        resolved.update({f"{analysis.name}.{key}": value for key, value in dumped.items()})
    return resolved


def _plain(value: Any) -> Any:
    return value.tolist() if hasattr(value, "tolist") else value


def changed_keys(then: Mapping[str, Any], now: Mapping[str, Any]) -> list[str]:
    """``key: then -> now`` for every value that differs between two resolved cases."""
    lines = []
    for key in [*now, *(key for key in then if key not in now)]:
        before, after = then.get(key), now.get(key)
        if before != after:
            shown = [toml(value) if value is not None else "(absent)" for value in (before, after)]
            lines.append(f"{key}: {shown[0]} then, {shown[1]} now")
    return lines
