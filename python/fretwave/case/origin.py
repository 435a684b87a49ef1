"""Where a model comes from: matrices in the case, a builder in Python, or a model file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Tuple

import scipy.sparse

from ..errors import InputError
from ..model import checks
from ..model.sectors import Sparse
from ..model.structure import Structure
from ..results import model_file
from ..results.source_file import digest
from ..texts import display, toml
from . import matrices
from .builder import builder_digest, run_builder
from .reporter import Found
from .schema import ModelSection
from .toml.locate import Path as KeyPath
from .toml.source import Source
from .toml.validation import missing_key

#: A structure as it is given, where each of its matrices stands, and what identifies it, by address.
Given = Tuple[Structure, Mapping[str, str], Mapping[str, Any]]


def load_origin(section: ModelSection, source: Source, notes: list[str], found: Found) -> Given | None:
    """The model of ``[model]``, from the one source that it names; None when something is wrong."""
    ways = {"builder": section.builder is not None, "file": section.file is not None}
    given = [way for way, is_given in ways.items() if is_given]
    inline = [letter for letter in ("M", "K", "C", "dofs") if getattr(section, letter) is not None]
    if given and (inline or len(given) > 1):
        more = [*given, *inline]
        found.append(
            InputError(
                f"the model comes from several places: {', '.join(more)}",
                where=source.where(("model", more[1])),
                expected="matrices M and K, or a builder, or a model file",
                fix=f"remove {' and '.join(more[1:])}",
            )
        )
        return None
    if section.options and section.builder is None:
        problem = "there are options but no builder"
        found.append(InputError(problem, source.where(("model", "options")), fix='add `builder = "model.py"`'))
    if not given:
        return _from_matrices(section, source, notes, found)
    return {"builder": _from_builder, "file": _from_file}[given[0]](section, source, found)


def _from_builder(section: ModelSection, source: Source, found: Found) -> Given | None:
    assert section.builder is not None
    built = run_builder(section.builder, section.options, source, found)
    if built is None:
        return None
    where = source.where(("model", "builder"))
    resolved = {"model.builder": f"{section.builder} {builder_digest(section.builder, source)}"}
    resolved.update({f"model.options.{name}": value for name, value in section.options.items()})
    return built, dict.fromkeys("MKC", where), resolved


def _from_file(section: ModelSection, source: Source, found: Found) -> Given | None:
    assert section.file is not None
    read = read_file(section.file, ("model", "file"), source, found)
    if read is None:
        return None
    structure, digest = read
    where = source.where(("model", "file"))
    return structure, {letter: f"{where}, {letter}" for letter in "MKC"}, {"model.file": digest}


def read_file(file: str, key: KeyPath, source: Source, found: Found) -> tuple[Structure, str] | None:
    """The structure of a model file that a key names, and what identifies it; None when something is wrong."""
    where, path = source.where(key), source.path.parent / file
    try:
        return model_file.read_model(path), f"{file} {digest(path)[:16]}"
    except InputError as error:
        place = f"{where}, {error.where}"
        found.append(InputError(error.what, place, error.measured, error.expected, error.fix))
    except OSError as error:
        problem = f"{display(path)}: {error.strerror}"
        found.append(InputError("the model file cannot be read", where, problem, "a file of `fretwave import`"))
    return None


def _from_matrices(section: ModelSection, source: Source, notes: list[str], found: Found) -> Given | None:
    loaded: dict[str, Sparse] = {}
    places: dict[str, str] = {}
    resolved: dict[str, Any] = {}
    for letter in ("M", "K", "C"):
        given = getattr(section, letter)
        if given is None:
            if letter != "C":
                found.append(missing_key(ModelSection, source, ("model",), letter))
            continue
        matrix = matrices.load(letter, given, source, notes, found)
        if matrix is not None:
            loaded[letter], places[letter], digest = matrix
            resolved[f"model.{letter}"] = digest or given
    dofs = _dof_names(section, loaded, places, source, found)
    if dofs is None:
        return None
    resolved = {key: value for key, value in resolved.items() if key.rpartition(".")[2] in loaded}
    structure = Structure(loaded.get("M"), loaded.get("K"), loaded.get("C"), names=dofs)
    return structure, places, {"model.dofs": dofs, **resolved}


def _dof_names(
    section: ModelSection, loaded: dict[str, Sparse], places: Mapping[str, str], source: Source, found: Found
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
    size = len(named) if named is not None else loaded["M"].shape[0]
    told = f"model.dofs names {size} dofs" if named is not None else f"the mass matrix is {size} x {size}"
    for letter in [letter for letter, A in loaded.items() if A.shape[0] != size]:
        wrong = loaded.pop(letter).shape[0]
        found.append(
            InputError(
                f"the {checks.NAMES[letter]} has the wrong size",
                where=places[letter],
                measured=f"{wrong} x {wrong}",
                expected=f"{size} x {size}: {told}",
                fix="all matrices need one row and one column for each dof",
            )
        )
    return named if named is not None else [str(number) for number in range(size)]


def check_physics(
    structure: Structure, places: Mapping[str, str], rows: Sequence[Sparse] | None, notes: list[str], found: Found
) -> None:
    """Symmetry, positive mass, and a structure that is held once the contact sticks.

    Parameters
    ----------
    places : where each matrix stands
    rows : B of every contact; None when some are wrong, and what holds the structure is not known.
    """
    dofs = structure.dof_names
    loaded = {letter: A for letter in "MKC" if (A := structure.own(letter)) is not None}
    bad = [problem for letter, A in loaded.items() if (problem := checks.check_entries(letter, A, places[letter]))]
    found.extend(bad)
    for letter in ("M", "K"):
        A = loaded.get(letter)
        if A is None or bad:
            continue
        problem = checks.check_symmetric(letter, A, places[letter], dofs)
        if problem is None and letter == "M":
            problem = checks.check_mass(A, places[letter], dofs)
        elif problem is None and rows is not None:
            stacked = scipy.sparse.vstack(rows) if rows else scipy.sparse.csr_matrix((0, len(dofs)))
            problem, note = checks.check_stiffness(A, places[letter], dofs, stacked)
            notes.extend([note] if note else [])
        if problem is not None:
            found.append(problem)
