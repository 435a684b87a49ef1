"""Entries that stand twice: a file that was appended to itself, or a symmetric matrix that was mirrored twice.

Of U + U^T, U the upper triangle with the diagonal, the diagonal is doubled. A body that moves as a whole feels no
force: sum_j K_ij = 0 over the dofs along one direction, apart from held nodes. Doubled, that is half of the diagonal.

Entries at one place add up, as those of unassembled elements should, and equal springs look like either slip: in a
chain each mass has two, two in parallel make every place twice. Only codes that assemble write each place once. No
matrix was mirrored whose own diagonal, half of what the entries add up to, would leave it negative for a motion.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from ..errors import InputError
from ..model.structure import Structure

if TYPE_CHECKING:
    from .entries import Entries

#: Formats of codes that write assembled matrices, as their kinds begin; any program writes triplets without nodes.
ASSEMBLED = ("CalculiX", "Abaqus, matrix input")
#: Sum of a matrix's entries over that of their sizes that is rounding.
ROUND = 1e-9
#: Share of the rows that say that the diagonal is doubled, how closely, and the entries in a row that make it a mesh:
#: in a chain a row's sum may be half its diagonal beside what is held.
HALF, CLOSE, MESH = 0.5, 1e-6, 20


def check_once(letter: str, entries: Entries) -> list[str]:
    """No place of an assembled matrix stands twice; a warning of others that look as if they were doubled.

    Raises
    ------
    InputError
        An assembled one does.
    """
    order = np.lexsort((entries.values, entries.columns, entries.rows))
    rows, columns, values = entries.rows[order], entries.columns[order], entries.values[order]
    starts = np.flatnonzero(np.append(True, (rows[1:] != rows[:-1]) | (columns[1:] != columns[:-1])))
    count = np.diff(np.append(starts, len(rows)))
    alike = (count > 1) & (values[starts] == values[starts + count - 1])
    beside = rows[starts] != columns[starts]
    assembled = entries.kind.startswith(ASSEMBLED)
    mirrored = beside.any() and alike[~beside].all() and (~beside).any() and (count[beside] == 1).all()
    doubled = beside.any() and alike[beside].all()
    if not (assembled or doubled or (mirrored and _may_be_mirrored(values[starts]))):
        return []
    first = int(starts[np.argmax(count > 1)])
    measured = f"{int((count > 1).sum())} of {len(count)} places, the first {letter}[{rows[first]}][{columns[first]}]"
    if assembled:
        fix = "write each entry once: the file may hold the matrix twice, or both triangles where it says one"
        raise InputError(f"entries of {letter} stand twice", entries.where, measured, "each place once", fix)
    fix = "the diagonal once: A + A.T - diag(A) of a triangle A" if mirrored else "each entry once"
    said = f"entries of {letter} stand twice and are added up ({entries.where}: {measured}): if they are elements'"
    return [f"{said}, write A.tocsr() to be rid of this warning; else write {fix}"]


def _may_be_mirrored(once: npt.NDArray[Any]) -> bool:
    """Entries of the matrix whose diagonal was not doubled: not negative for a motion of all dofs alike."""
    return bool(once.sum() >= -ROUND * abs(once).sum())


def check_diagonal(model: Structure, where: str) -> None:
    """The diagonal of K is not doubled, as far as nodes and directions are known.

    Raises
    ------
    InputError
        It is.
    """
    K = sp.csr_matrix(model.K)
    if model.labels is None or np.median(np.diff(K.indptr)) < MESH:
        return
    rows = doubled = 0
    for direction in (1, 2, 3):
        along = (model.labels[:, 1] == direction).astype(float)
        own, diagonal = along > 0, K.diagonal()
        doubled += int((abs((K @ along)[own] - diagonal[own] / 2) <= CLOSE * diagonal[own]).sum())
        rows += int(own.sum())
    if doubled >= HALF * rows > 0:
        measured, expected = (
            f"the sum of {doubled} of {rows} rows along x, y, z is half of it",
            "0 away from held nodes",
        )
        raise InputError("the diagonal of K is doubled", where, measured, expected, "write A + A.T - diag(A)")
