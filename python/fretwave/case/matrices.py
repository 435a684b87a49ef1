"""Matrices of a case: inline rows or files, checked for shape, finite entries, symmetry and definiteness."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any, Union

import numpy as np
import scipy.sparse

from ..errors import FretwaveError, InputError
from ..model.checks import NAMES
from ..model.sectors import Sparse
from ..results.model_file import read_sources
from ..texts import display, is_there, names_beside, nearest, shortened
from .toml.locate import Path as KeyPath
from .toml.source import Source

#: Endings of files that a case reads without a plug-in.
READ = (".npz", ".mtx")
MODEL_FILE = ".h5"


def load(
    letter: str,
    given: Union[str, list[list[float]]],
    source: Source,
    notes: list[str],
    found: list[FretwaveError],
    key: KeyPath | None = None,
) -> tuple[Sparse, str, str] | None:
    """A matrix of ``[model]``, square with finite entries, with its place and its hash, "" for rows.

    None (and an entry in `found`) when something is wrong; what only looks so is added to the notes.

    Parameters
    ----------
    key : where it stands, unless under its letter
    """
    key = key or ("model", letter)
    where, digest = source.where(key), ""
    try:
        if isinstance(given, str):
            path = source.path.parent / given
            values, place = _read(path, letter, where, key, notes), f"{where}, {display(path)}"
            digest = "sha256:" + hashlib.sha256(path.read_bytes()).hexdigest()
        else:
            values, place = _from_rows(letter, given, source, key), where
        _check_square(letter, values, place)
    except InputError as problem:
        found.append(problem)
        return None
    return values, place, digest


def _from_rows(letter: str, rows: list[list[float]], source: Source, key: KeyPath) -> Sparse:
    lengths = [len(row) for row in rows]
    if len(set(lengths)) != 1 or not lengths[0]:
        odd = next((i for i, length in enumerate(lengths) if length != len(rows)), 0)
        raise InputError(
            f"the rows of the {NAMES[letter]} differ in length",
            where=source.where((*key, odd)),
            measured=f"row {odd} has {lengths[odd] if lengths else 0} entries",
            expected=f"{len(rows)} entries in each of the {len(rows)} rows",
            fix="give every row as many entries as there are rows",
        )
    return scipy.sparse.csr_matrix(np.array(rows, dtype=float))


def _read(path: Path, letter: str, where: str, key: KeyPath, notes: list[str]) -> Sparse:
    if not is_there(path):
        names = [name for name in names_beside(path) if name.lower().endswith(READ)]
        raise InputError(
            f"the file of the {NAMES[letter]} does not exist",
            where=where,
            measured=display(path),
            expected="a .npz or .mtx file, path relative to the case file",
            fix=nearest(path.name, names) or "check the path",
        )
    try:
        values = _read_known(path, letter, notes)
        sparse = scipy.sparse.csr_matrix(values)
        if not (np.issubdtype(sparse.dtype, np.number) or sparse.dtype == bool):
            raise ValueError(f"entries of type {sparse.dtype}")
    except InputError as error:
        measured = f"{display(path)}: {error.measured or error.where}"
        raise InputError(error.what, where, measured, error.expected, error.fix) from None
    except Exception as error:  # whatever the readers raise on a damaged file
        expected = f".npz of scipy.sparse.save_npz, .npz of numpy.savez with an array '{letter}', or .mtx"
        told, fix = shortened(str(error) or type(error).__name__), _another_way(path, letter, key)
        if _of_plugin(path):
            expected, fix = f"a {path.suffix} file that its reader reads", "write it again, or correct the plug-in"
            told = f"{type(error).__name__}: {shortened(str(error))}"
        what = f"the file of the {NAMES[letter]} cannot be read"
        raise InputError(what, where, f"{display(path)}: {told}", expected, fix) from None
    if np.iscomplexobj(sparse):
        raise InputError(
            f"the {NAMES[letter]} is complex",
            where=f"{where}, {display(path)}",
            expected="real entries",
            fix="put the imaginary part of a loss factor into C",
        )
    return sparse.astype(float)


def _of_plugin(path: Path) -> bool:
    from ..importers.formats import registered

    return registered(path) is not None


def _another_way(path: Path, letter: str, key: KeyPath) -> str:
    """To the matrix of a file that a case does not read."""
    from ..importers.formats import format_of

    name = key[-1] if len(key) > 2 else "file"
    if name == "file" and _is_model(path):
        return f'{name} = "{display(path)}" alone, in place of M, K and C: it is a model file'
    written = f"write it with scipy.sparse.save_npz('{path.with_suffix('.npz').name}', {letter})"
    if path.suffix.lower() in READ or not path.is_file() or format_of(path) is None:
        return written
    model = display(path.with_suffix(MODEL_FILE))
    return f'`fretwave import` brings it into a model file, {name} = "{model}"; or {written}'


def _is_model(path: Path) -> bool:
    try:
        read_sources(path)
    except InputError:
        return False
    return True


def _read_known(path: Path, letter: str, notes: list[str]) -> Any:
    from ..importers import formats, matrix_market
    from ..importers.entries import Entries

    if (format := formats.registered(path)) is not None:
        return _as_given(format.read(path, letter, None), letter, notes)
    if path.suffix.lower() == ".mtx":
        return _as_given(matrix_market.read(path), letter, notes)
    if path.suffix.lower() != ".npz":
        raise ValueError(f"unknown file type '{path.suffix}'")
    with np.load(path) as archive:
        if "format" not in archive.files:
            return archive[letter]
    stored = Entries.of(scipy.sparse.load_npz(path), display(path), "SciPy sparse archive")
    return _as_given(stored, letter, notes)


def _as_given(found: object, letter: str, notes: list[str]) -> Any:
    """The matrix of a reader, whose entries add up; what has to be put in order is the importer's."""
    from ..importers.entries import Entries

    if not isinstance(found, Entries):
        return found
    if found.labels is not None or found.held is not None or found.half:
        raise ValueError("it numbers its dofs by nodes; bring it into a model file with `fretwave import`")
    matrix, doubts = found.added(letter)
    notes += doubts
    return matrix


def _check_square(letter: str, values: Sparse, where: str) -> None:
    rows, columns = values.shape
    if rows != columns:
        raise InputError(
            f"the {NAMES[letter]} is not square",
            where=where,
            measured=f"{rows} x {columns}",
            expected="n x n",
            fix="give one row and one column for each dof",
        )
