"""Entries of matrices as files give them, brought to one numbering of the dofs and to both triangles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from ..arrays import IntArray
from ..errors import InputError
from ..files.compressed import check_compressed
from ..model.checks import check_symmetric
from ..model.sectors import Given
from ..results.model_file import dof_name
from ..texts import counted
from .repeated import check_once

#: Share of entries of the rarer triangle below which they count as strays beside the other triangle.
STRAY_SHARE = 0.5


@dataclass(repr=False)
class Entries:
    """One matrix as its file gives it.

    Attributes
    ----------
    rows, columns, values : (n_entries,)
        Indices from 0; entries at one place add up.
    shape : (int, int)
    where : str
        The file, as a user would name it.
    kind : str
        Its format.
    labels : (n_dof, 2) or None
        Node and direction of each row, when the file says.
    mirrored : str
        What the reader did to get both triangles, "" for nothing.
    held : (n_dof,) bool or None
        Dofs that the code held by a penalty, to be left out.
    half : bool
        One triangle in the code's own order of the dofs, moved to the lower one of ours.
    doubt : str
        A warning of its reader, "" for none.
    """

    rows: IntArray
    columns: IntArray
    values: npt.NDArray[Any]
    shape: tuple[int, int]
    where: str
    kind: str
    labels: IntArray | None = None
    mirrored: str = ""
    held: npt.NDArray[np.bool_] | None = None
    half: bool = False
    doubt: str = ""

    def __repr__(self) -> str:
        return f"Entries({self.shape[0]} x {self.shape[1]}, {len(self.values)} entries, {self.kind}, {self.where!r})"

    @classmethod
    def of(cls, matrix: Given, where: str, kind: str, mirrored: str = "") -> Entries:
        """From a dense or SciPy sparse matrix."""
        check_compressed(matrix)
        found = sp.coo_matrix(matrix)
        rows, columns = found.row.astype(np.int64), found.col.astype(np.int64)
        return cls(rows, columns, found.data, found.shape, where, kind, mirrored=mirrored)

    def added(self, letter: str) -> tuple[sp.csr_matrix, list[str]]:
        """What they add up to, real or complex as they are, and warnings of places that stand twice (`check_once`)."""
        values = self.values if np.iscomplexobj(self.values) else self.values.astype(float)
        matrix = sp.csr_matrix((values, (self.rows, self.columns)), shape=self.shape)
        return matrix, check_once(letter, self) if matrix.nnz < len(values) else []


@dataclass
class Assembled:
    """Matrices of one numbering, both triangles stored.

    Attributes
    ----------
    matrices : dict
        CSR by letter.
    labels : (n_dof, 2) or None
        Node and direction of each dof.
    symmetry : dict
        What was found of each matrix and done about it, by letter.
    notes : list of str
    rows : (n_dof,) or None
        Rows of the files that are left, when dofs held by a penalty are not.
    given_size : int
        Rows of the files.
    warnings : list of str
        What is likely to be wrong.
    """

    matrices: dict[str, sp.csr_matrix]
    labels: IntArray | None
    symmetry: dict[str, str]
    notes: list[str] = field(default_factory=list)
    rows: IntArray | None = None
    given_size: int = 0
    warnings: list[str] = field(default_factory=list)

    @property
    def size(self) -> int:
        return int(self.matrices["K"].shape[0])

    @property
    def names(self) -> list[str]:
        if self.labels is None:
            return [str(number) for number in range(self.size)]
        return [dof_name(int(node), int(direction)) for node, direction in self.labels]


def assemble(given: dict[str, Entries], symmetric: str = "auto") -> Assembled:
    """Bring matrices to one numbering and to both triangles.

    Parameters
    ----------
    given : dict
        Entries by letter (M, K, C).
    symmetric : {"auto", "lower", "upper", "full"}
        What the files hold; "auto" finds out.

    Raises
    ------
    InputError
        An entry is not a number, a matrix is not square or does not fit the others, or its symmetry is not clear.
    """
    for letter, entries in given.items():
        _check_entries(letter, entries)
    notes: list[str] = []
    labels = _one_numbering(given, notes)
    found = Assembled({}, labels, {}, notes, warnings=[entries.doubt for entries in given.values() if entries.doubt])
    for letter, entries in given.items():
        matrix, doubts = entries.added(letter)
        found.warnings += doubts
        matrix.eliminate_zeros()
        found.matrices[letter] = matrix
    found.given_size = found.size
    _leave_out_held(found, given)
    for letter, entries in given.items():
        matrix, said = _both_triangles(letter, found.matrices[letter], entries, symmetric, found.names)
        found.matrices[letter], found.symmetry[letter] = matrix, said
    return found


def _check_entries(letter: str, entries: Entries) -> None:
    if np.iscomplexobj(entries.values):
        fix = "put the imaginary part of a loss factor into C"
        raise InputError(f"{letter} is complex", entries.where, entries.values.dtype, "real entries", fix)
    rows, columns = entries.shape
    if rows != columns:
        fix = "give one row and one column for each dof"
        raise InputError(f"{letter} is not square", entries.where, f"{rows} x {columns}", "n x n", fix)
    bad = np.flatnonzero(~np.isfinite(entries.values))
    if len(bad):
        place = f"{letter}[{entries.rows[bad[0]]}][{entries.columns[bad[0]]}] = {entries.values[bad[0]]}"
        more = f", and {len(bad) - 1} more" if len(bad) > 1 else ""
        fix = "look at what wrote this entry"
        raise InputError(f"{letter} has an entry that is not a number", entries.where, place + more, "numbers", fix)


def _one_numbering(given: dict[str, Entries], notes: list[str]) -> IntArray | None:
    """Number all matrices by the union of their labels, if they have labels; sizes must agree otherwise."""
    labelled = {letter: entries for letter, entries in given.items() if entries.labels is not None}
    first = next(iter(labelled.values()), None)
    same = first is None or all(np.array_equal(e.labels, first.labels) for e in labelled.values())  # type: ignore[arg-type]
    if not same:
        if len(labelled) != len(given):
            odd = next(letter for letter in given if letter not in labelled)
            what = f"{odd} does not say which node its rows belong to, the others do, in different ways"
            raise InputError(what, given[odd].where, fix="write all matrices in one format")
        return _union(labelled, notes)
    sizes = {letter: entries.shape[0] for letter, entries in given.items()}
    for letter, size in sizes.items():
        if size != sizes["K"]:
            raise InputError(
                f"{letter} and K differ in size",
                given[letter].where,
                f"{size} x {size}",
                f"{sizes['K']} x {sizes['K']}, as K in {given['K'].where}",
                "export all matrices from one step of one model",
            )
    return None if first is None else first.labels


def _union(labelled: dict[str, Entries], notes: list[str]) -> IntArray:
    """Rows of all matrices by (node, direction); a dof absent from one matrix has no entries there."""
    tables = [entries.labels for entries in labelled.values() if entries.labels is not None]
    union: IntArray = np.unique(np.concatenate(tables), axis=0)
    union = union[order_of(union)]
    place = {tuple(label): number for number, label in enumerate(union.tolist())}
    for letter, entries in labelled.items():
        assert entries.labels is not None
        where = np.array([place[tuple(label)] for label in entries.labels.tolist()], dtype=np.int64)
        entries.rows, entries.columns = where[entries.rows], where[entries.columns]
        absent = np.setdiff1d(np.arange(len(union)), where)
        entries.shape = (len(union), len(union))
        if entries.held is not None:
            held = np.zeros(len(union), dtype=bool)
            held[where] = entries.held
            entries.held = held
        if len(absent):
            example = dof_name(*(int(part) for part in union[absent[0]]))
            notes.append(f"{counted(len(absent), 'dof')} without an entry in {letter}, the first is {example}")
    return union


def order_of(labels: IntArray) -> IntArray:
    """By node and direction, internal nodes (negative numbers) last."""
    return np.asarray(np.lexsort((labels[:, 1], abs(labels[:, 0]), labels[:, 0] < 0)))


def _leave_out_held(found: Assembled, given: dict[str, Entries]) -> None:
    held = [entries.held for entries in given.values() if entries.held is not None]
    if not held or not np.any(held):
        return
    free = np.flatnonzero(~np.any(held, axis=0))
    found.notes.append(f"left out: {counted(len(held[0]) - len(free), 'dof')} held by a penalty on the diagonal of K")
    found.rows = free
    found.matrices = {letter: matrix[free][:, free] for letter, matrix in found.matrices.items()}
    found.labels = None if found.labels is None else found.labels[free]


def _both_triangles(
    letter: str, A: sp.csr_matrix, entries: Entries, symmetric: str, names: Sequence[str]
) -> tuple[sp.csr_matrix, str]:
    counts = {"lower": sp.tril(A, -1).nnz, "upper": sp.triu(A, 1).nnz}
    if entries.half and symmetric != "full":
        return _mirror(A), "one triangle, mirrored"
    if symmetric == "full" and any(counts.values()) and not all(counts.values()):
        measured = f"{max(counts.values())} entries in one triangle, none in the other"
        raise InputError(f"{letter} is not full", entries.where, measured, "both triangles", "use --symmetric auto")
    if symmetric in counts:
        other = "upper" if symmetric == "lower" else "lower"
        if counts[other]:
            raise _stray(letter, A, entries, symmetric, counts[other])
        return _mirror(A), f"{symmetric} triangle, mirrored"
    if symmetric == "auto" and not all(counts.values()):
        if not any(counts.values()):
            return A, "diagonal"
        one = "lower" if counts["lower"] else "upper"
        return _mirror(A), f"{one} triangle, mirrored"
    problem = check_symmetric(letter, A, entries.where, names)
    if problem is None:
        return A, entries.mirrored or f"full, symmetric {_asymmetry(A)}"
    if min(counts.values()) < STRAY_SHARE * max(counts.values()):
        one = max(counts, key=lambda side: counts[side])
        raise _stray(letter, A, entries, one, min(counts.values()))
    if letter != "C":
        raise problem
    return A, f"full, not symmetric {_asymmetry(A)}: taken as it is"


def _mirror(A: sp.csr_matrix) -> sp.csr_matrix:
    return (A + A.T - sp.diags(A.diagonal())).tocsr()  # exact: one triangle is empty, and 2 d - d rounds nowhere


def _asymmetry(A: sp.csr_matrix) -> str:
    difference = abs(A - A.T).max()
    return "(exactly)" if difference == 0 else f"(within {difference / abs(A).max():.1e} of the largest entry)"


def _stray(letter: str, A: sp.csr_matrix, entries: Entries, one: str, count: int) -> InputError:
    found = (sp.triu(A, 1) if one == "lower" else sp.tril(A, -1)).tocoo()
    i, j, value = int(found.row[0]), int(found.col[0]), found.data[0]
    total = (sp.tril(A, -1) if one == "lower" else sp.triu(A, 1)).nnz
    return InputError(
        f"{letter} holds the {one} triangle and {count} stray entries beyond it",
        entries.where,
        f"{total} entries in the {one} triangle, {count} in the other, the first {letter}[{i}][{j}] = {value:g}",
        "one triangle alone, or both and equal",
        "write the matrix again; `--symmetric full` takes both triangles only if they agree",
    )
