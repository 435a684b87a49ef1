"""Read a case file, check all of it, and report everything that is wrong at once."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import scipy.sparse

from . import checks, matrices
from .contacts import ContactSpec, read_contacts
from .errors import CaseErrors, FretwaveError, InputError
from .schema import AnalysisSection, ModelSection, StudySection
from .source import Source
from .validation import toml, validate


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
    analyses : dict
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
    analyses: dict[str, AnalysisSection]
    resolved: dict[str, Any]
    notes: list[str] = field(default_factory=list)
    has_quick: bool = False
    study: StudySection = field(default_factory=StudySection)

    @property
    def name(self) -> str:
        """Name of the case: that of its folder, or of the file if it is not ``case.toml``."""
        return self.path.resolve().parent.name if self.path.stem == "case" else self.path.stem

    @property
    def digest(self) -> str:
        """Hash of everything that decides the results."""
        return hashlib.sha256(json.dumps(self.resolved, sort_keys=True).encode()).hexdigest()

    def dof(self, name: str) -> int:
        """Index of a dof."""
        return self.dofs.index(name)

    def damping_with(self, dampers: Sequence[Any]) -> Any:
        """C with viscous dampers to ground added, None when there is no damping at all."""
        if not dampers:
            return self.C
        added = scipy.sparse.lil_matrix(self.M.shape)
        for damper in dampers:
            added[self.dof(damper.dof), self.dof(damper.dof)] += damper.c
        return added.tocsr() if self.C is None else (self.C + added).tocsr()


def load_case(
    path: str | Path,
    overrides: Sequence[str] = (),
    quick: bool = False,
    laws: Mapping[str, Any] | None = None,
    text: str | None = None,
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
    case = _build(source, _core_laws() if laws is None else laws, found)
    if found or case is None:
        raise CaseErrors(_in_file_order(found), source.label)
    return case


def _core_laws() -> Mapping[str, Any]:
    import fretwave

    laws: Mapping[str, Any] = fretwave.laws()
    return laws


def _in_file_order(found: list[FretwaveError]) -> list[FretwaveError]:
    def line(problem: FretwaveError) -> int:
        digits = (problem.where or "").rpartition(":")[2].split(" ")[0]
        return int(digits) if digits.isdigit() else 0

    return sorted(found, key=line)


def _build(source: Source, laws: Mapping[str, Any], found: list[FretwaveError]) -> Case | None:
    checks.check_top_level(source, found)
    analyses = checks.read_analyses(source, found)
    has_model = isinstance(source.data.get("model"), dict)
    section = validate(ModelSection, source, ("model",), found) if has_model else None
    loaded = _load_matrices(section, source, found) if section else {}
    dofs = _dof_names(section, loaded, source, found) if section else None
    contacts = read_contacts(source, dofs, laws, found)
    study = (
        validate(StudySection, source, ("study",), found)
        if isinstance(source.data.get("study"), dict)
        else StudySection()
    )
    checks.check_analyses(source, analyses, dofs, found)
    notes: list[str] = []
    if dofs is not None:
        _check_physics(loaded, dofs, contacts, notes, found)
    if found or section is None or dofs is None or study is None:
        return None
    return Case(
        path=source.path,
        text=source.text,
        title=str(source.data.get("title", "")),
        dofs=dofs,
        M=loaded["M"].values,
        K=loaded["K"].values,
        C=loaded["C"].values if "C" in loaded else None,
        contacts=contacts,
        analyses={analysis.name: analysis for analysis in analyses.values()},
        resolved=_resolve(dofs, loaded, section, contacts, analyses),
        notes=notes,
        has_quick="quick" in source.data,
        study=study,
    )


def _load_matrices(section: ModelSection, source: Source, found: list[FretwaveError]) -> dict[str, matrices.Matrix]:
    loaded = {}
    for letter in ("M", "K", "C"):
        given = getattr(section, letter)
        matrix = matrices.load(letter, given, source, found) if given is not None else None
        if matrix is not None:
            loaded[letter] = matrix
    return loaded


def _dof_names(
    section: ModelSection,
    loaded: dict[str, matrices.Matrix],
    source: Source,
    found: list[FretwaveError],
) -> list[str] | None:
    """Names of the dofs once names and matrices agree in number; None when they do not."""
    named = section.dofs
    if named is not None and len(set(named)) != len(named):
        twice = next(name for name in named if named.count(name) > 1)
        where = source.where(("model", "dofs"))
        found.append(InputError(f"two dofs have the name '{twice}'", where, toml(named), "unique names", "rename one"))
        return None
    if named is None and "M" not in loaded:
        return None
    size = len(named) if named is not None else loaded["M"].size
    told = f"model.dofs names {size} dofs" if named is not None else f"the mass matrix is {size} x {size}"
    wrong = [matrix for matrix in loaded.values() if matrix.size != size]
    for matrix in wrong:
        found.append(
            InputError(
                f"the {matrix.name} has the wrong size",
                where=matrix.where,
                measured=f"{matrix.size} x {matrix.size}",
                expected=f"{size} x {size}: {told}",
                fix="all matrices need one row and one column for each dof",
            )
        )
        del loaded[matrix.letter]
    return named if named is not None else [str(number) for number in range(size)]


def _check_physics(
    loaded: dict[str, matrices.Matrix],
    dofs: list[str],
    contacts: list[ContactSpec],
    notes: list[str],
    found: list[FretwaveError],
) -> None:
    for letter in ("M", "K"):
        matrix = loaded.get(letter)
        if matrix is None:
            continue
        problem = matrices.check_symmetric(matrix, dofs)
        if problem is None and letter == "M":
            problem = matrices.check_mass(matrix, dofs)
        elif problem is None:
            rows = [contact.rows for contact in contacts]
            stacked = scipy.sparse.vstack(rows) if rows else scipy.sparse.csr_matrix((0, len(dofs)))
            problem, note = matrices.check_stiffness(matrix, dofs, stacked)
            notes.extend([note] if note else [])
        if problem is not None:
            found.append(problem)


def _resolve(
    dofs: list[str],
    loaded: dict[str, matrices.Matrix],
    section: ModelSection,
    contacts: list[ContactSpec],
    analyses: dict[int, AnalysisSection],
) -> dict[str, Any]:
    """All values that decide the results, flat, under the addresses that ``--set`` uses."""
    resolved: dict[str, Any] = {"model.dofs": dofs}
    for letter, matrix in loaded.items():
        resolved[f"model.{letter}"] = matrix.digest or getattr(section, letter)
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
