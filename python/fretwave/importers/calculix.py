"""CalculiX matrices of ``*FREQUENCY, SOLVER=MATRIXSTORAGE``: ``job.sti`` (K), ``job.mas`` (M) and ``job.dof``.

Layout (G. Dhondt, CalculiX CrunchiX User's Manual, keyword *FREQUENCY; its routine matrixstorage.c): one entry a line,
"row column value", indices from 1, row <= column (the upper triangle with the diagonal), 14 digits; ``job.dof`` has one
line "node.direction" for each row. Dofs that are held or depend on others by an equation are no rows. At nodes with
*TRANSFORM the directions may be local, which no file says: leave *TRANSFORM out. With cyclic symmetry the Hermitian
matrices of one nodal diameter are stored as [[R, -I], [I, R]] of twice the size.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..arrays import IntArray
from ..errors import InputError
from ..texts import display
from .entries import Entries
from .text import columns_of, doubt_of_end, triplets

SUFFIXES = (".sti", ".mas")


def beside(path: Path, suffix: str) -> Path:
    """The file of another suffix, which may stand in capitals."""
    small, large = path.with_suffix(suffix), path.with_suffix(suffix.upper())
    return large if large.is_file() and not small.is_file() else small


def read(path: Path) -> Entries:
    """A matrix with the node and direction of its rows, when ``job.dof`` stands beside it."""
    entries = triplets(columns_of(path, 3), display(path), "CalculiX")
    entries.doubt = doubt_of_end(path)
    table = beside(path, ".dof")
    if table.is_file():
        entries.labels = read_dofs(table)
        _check_size(entries, table)
    return entries


def read_dofs(path: Path) -> IntArray:
    """``job.dof``: (n_dof, 2) node and direction. As text: 12.10 is not 12.1."""
    words = path.read_text(encoding="utf-8-sig").split()
    parts = [word.partition(".") for word in words]
    if not all(node.lstrip("-").isdigit() and direction.isdigit() for node, _, direction in parts):
        wrong = next(w for w, (node, _, d) in zip(words, parts) if not (node.lstrip("-").isdigit() and d.isdigit()))
        raise InputError(
            "this is no table of dofs",
            display(path),
            wrong,
            "node.direction, one line for each row",
            "give the .dof file that CalculiX wrote beside the matrices",
        )
    labels = np.array([(int(node), int(direction)) for node, _, direction in parts], dtype=np.int64).reshape(-1, 2)
    check_once(labels, display(path), "mesh shells and beams as solids: CalculiX makes solids of them")
    return labels


def check_once(labels: IntArray, where: str, fix: str) -> None:
    """Each node and direction stands once among labels (n_dof, 2).

    Raises
    ------
    InputError
        One stands twice.
    """
    different, count = np.unique(labels, axis=0, return_counts=True)
    if count.max(initial=1) > 1:
        node, direction = different[np.argmax(count)]
        measured = f"node {node}, direction {direction}"
        raise InputError("a dof stands twice in the table", where, measured, "each dof once", fix)


def _check_size(entries: Entries, table: Path) -> None:
    rows, named = entries.shape[0], len(entries.labels) if entries.labels is not None else 0
    if rows == named:
        return
    cyclic = rows == 2 * named
    raise InputError(
        "the matrix is that of a nodal diameter" if cyclic else "the table of dofs does not fit the matrix",
        entries.where,
        f"{rows} rows, {named} dofs in {display(table)}",
        f"{named} rows",
        "export without *CYCLIC SYMMETRY MODEL"
        if cyclic
        else "export matrices and table in one run, or remove the .dof file",
    )
