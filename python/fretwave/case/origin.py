"""Where a model comes from: matrices in the case, a builder in Python, or a model file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import scipy.sparse

from ..errors import FretwaveError, InputError
from ..model import checks
from ..model.checks import Matrix
from ..model.structure import BuiltModel
from ..results import model_file
from ..texts import display, toml
from . import matrices
from .builder import builder_digest, run_builder
from .schema import ModelSection
from .toml.source import Source
from .toml.validation import missing_key

Found = list[FretwaveError]


@dataclass
class Origin:
    """A model as it is given, before any reduction.

    Attributes
    ----------
    matrices : dict
        M, K and maybe C.
    dofs : list of str
        Names of all dofs.
    built : BuiltModel
        Contacts and loads that came with the matrices; empty for inline matrices.
    resolved : dict
        What identifies the model, by address.
    """

    matrices: dict[str, Matrix]
    dofs: list[str]
    built: BuiltModel | None = None
    resolved: dict[str, Any] = field(default_factory=dict)

    @property
    def named(self) -> Mapping[str, int]:
        """Dofs that a builder gave a name."""
        return self.built.dofs if self.built else {}


def load_origin(section: ModelSection, source: Source, found: Found) -> Origin | None:
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
    readers = {"builder": _from_builder, "file": _from_file}
    return readers.get(given[0] if given else "", _from_matrices)(section, source, found)


def _from_builder(section: ModelSection, source: Source, found: Found) -> Origin | None:
    assert section.builder is not None
    built = run_builder(section.builder, section.options, source, found)
    if built is None:
        return None
    where = source.where(("model", "builder"))
    loaded = {
        name: Matrix(name, A, where) for name, A in (("M", built.M), ("K", built.K), ("C", built.C)) if A is not None
    }
    dofs = [str(number) for number in range(built.M.shape[0])]
    for name, number in built.dofs.items():
        dofs[number] = name
    resolved = {"model.builder": f"{section.builder} {builder_digest(section.builder, source)}"}
    resolved.update({f"model.options.{name}": value for name, value in section.options.items()})
    return Origin(loaded, dofs, built, resolved)


def _from_file(section: ModelSection, source: Source, found: Found) -> Origin | None:
    assert section.file is not None
    where = source.where(("model", "file"))
    path = source.path.parent / section.file
    try:
        model = model_file.read(path)
    except InputError as error:
        place = f"{where}, {error.where}"
        found.append(InputError(error.what, place, error.measured, error.expected, error.fix))
        return None
    except OSError as error:
        problem = f"{display(path)}: {error.strerror}"
        found.append(InputError("the model file cannot be read", where, problem, "a file of `fretwave import`"))
        return None
    loaded = {
        letter: Matrix(letter, getattr(model, letter), f"{where}, {letter}")
        for letter in ("M", "K", "C")
        if getattr(model, letter) is not None
    }
    resolved = {"model.file": f"{section.file} {model_file.digest(path)[:16]}"}
    return Origin(loaded, model.names, model.built(), resolved)


def _from_matrices(section: ModelSection, source: Source, found: Found) -> Origin | None:
    loaded = {}
    for letter in ("M", "K", "C"):
        given = getattr(section, letter)
        if given is None:
            if letter != "C":
                found.append(missing_key(ModelSection, source, ("model",), letter))
            continue
        matrix = matrices.load(letter, given, source, found)
        if matrix is not None:
            loaded[letter] = matrix
    dofs = _dof_names(section, loaded, source, found)
    if dofs is None:
        return None
    resolved = {f"model.{letter}": matrix.digest or getattr(section, letter) for letter, matrix in loaded.items()}
    return Origin(loaded, dofs, resolved={"model.dofs": dofs, **resolved})


def _dof_names(section: ModelSection, loaded: dict[str, Matrix], source: Source, found: Found) -> list[str] | None:
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


def check_physics(origin: Origin, rows: Sequence[Any] | None, notes: list[str], found: Found) -> None:
    """Symmetry, positive mass, and a structure that is held once the contact sticks.

    Parameters
    ----------
    rows : B of every contact; None when some are wrong, and what holds the structure is not known.
    """
    loaded, dofs = origin.matrices, origin.dofs
    bad = [problem for matrix in loaded.values() if (problem := checks.check_entries(matrix))]
    found.extend(bad)
    for letter in ("M", "K"):
        matrix = loaded.get(letter)
        if matrix is None or bad:
            continue
        problem = checks.check_symmetric(matrix, dofs)
        if problem is None and letter == "M":
            problem = checks.check_mass(matrix, dofs)
        elif problem is None and rows is not None:
            stacked = scipy.sparse.vstack(rows) if rows else scipy.sparse.csr_matrix((0, len(dofs)))
            problem, note = checks.check_stiffness(matrix, dofs, stacked)
            notes.extend([note] if note else [])
        if problem is not None:
            found.append(problem)
