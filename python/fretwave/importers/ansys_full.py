"""Assembled matrices of Ansys Mechanical APDL, ``job.full``, through the package ansys-mapdl-reader (MIT).

Layout (Ansys, Programmer's Reference, "Description of the Full Stiffness-Mass File", fdfull.inc): a record of 100
integers about the file; the header, from word 103 on; the kinds of dofs (UX, UY, UZ, ROTX, ROTY, ROTZ are 1 to 6); the
upper triangle of K and M in the solver's order; how many dofs each node has, then the kind of each dof, negative where
it is held. Held dofs have rows without entries, which are left out here. Entries are in the nodes' own directions
(NROTAT), and those before constraint equations (CE, CP) are applied.
"""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

import numpy as np
import scipy.sparse as sp

from ..arrays import IntArray
from ..errors import InputError
from ..texts import display
from .entries import Entries
from .extras import reader_of

#: Word at which the header begins.
HEADER = 103
#: Items of the header, from 0: a file of the symbolic assembly is -4, a frontal one 4; lumped M; unsymmetric K; how
#: many CE and CP; where the dofs stand, in two halves.
SYMBOLIC, LUMPED, UNSYMMETRIC, CONSTRAINTS, DOFS = 0, 10, 13, 20, 35
#: Words before and after the content of a record.
FRAME = 3


class Records(Protocol):
    """A file of the package."""

    def read_record(self, pointer: int) -> IntArray:
        """The content of the record that begins at this word."""


def head_of(kind: int) -> bytes:
    """First bytes of a binary file of Ansys: length and mark of a record of integers, number of the kind of file."""
    return np.array([100, -(2**31), kind], dtype="<i4").tobytes()


def read(path: Path, letter: str) -> Entries:
    """The upper triangle of M or K with node and direction of each free dof, in the file's order."""
    where = display(path)
    if letter == "C":
        fix = "give C in another format, or damping as zeta in the case"
        raise InputError("damping is not read from a .full file", where, None, "--mass or --stiffness", fix)
    package = reader_of("ansys.mapdl.reader.full", "ansys-mapdl-reader", where)
    header = _header(path)
    _check_header(header, where)
    file = package.FullFile(str(path))
    labels, K, M = file.load_km(as_sparse=True, sort=False)
    matrix = K if letter == "K" else M
    if matrix is None:
        fix = "write it in a modal analysis: ANTYPE,MODAL, MODOPT,LANB and WRFULL,1"
        raise InputError(f"the file has no {letter}", where, None, "mass and stiffness", fix)
    dofs = _dofs(file, header, where)
    found = Entries.of(sp.csr_matrix(matrix)[dofs > 0][:, dofs > 0], where, "Ansys .full")
    found.labels = np.column_stack([labels[:, 0], dofs])[dofs > 0].astype(np.int64)
    return found


def _header(path: Path) -> IntArray:
    words = np.fromfile(path, dtype="<i4", count=HEADER + 2 + DOFS + 2)[HEADER + 2 :]
    if len(words) < DOFS + 2:
        raise ValueError("the file ends in its header")
    return words.astype(np.int64)


def _check_header(header: IntArray, where: str) -> None:
    """Symbolic assembly, a consistent mass, symmetric, and no constraint equation."""
    expected = "K and M of the symbolic assembly, symmetric, M not lumped, without CE and CP"
    modal = "in a modal analysis with MODOPT,LANB"
    wrong = {
        "it is of the frontal solver": (header[SYMBOLIC] > 0, f"write it {modal}"),
        "its mass is lumped": (header[LUMPED] != 0, f"write it {modal} and LUMPM,OFF"),
        "it is not symmetric": (header[UNSYMMETRIC] != 0, f"write it {modal} and NROPT,FULL"),
        f"{header[CONSTRAINTS]} constraint equations": (
            header[CONSTRAINTS] != 0,
            "take CE, CP, CYCLIC and bonded contact out: K and M are written without them",
        ),
    }
    for measured, (found, fix) in wrong.items():
        if found:
            raise InputError("a .full file of this kind is not read", where, measured, expected, fix)


def _dofs(file: Records, header: IntArray, where: str) -> IntArray:
    """(n_equations,) direction 1 to 6 of each dof, negative where it is held.

    Displacements alone, or with all rotations: whether the numbers count these kinds or all is then the same.
    """
    kinds = file.read_record(HEADER + len(file.read_record(HEADER)) + FRAME).tolist()
    if kinds not in ([1, 2, 3], [1, 2, 3, 4, 5, 6]):
        expected, fix = "UX, UY, UZ, or these and ROTX, ROTY, ROTZ (1 to 6)", "leave the elements of other fields out"
        raise InputError("dofs are no displacements in space", where, f"kinds {kinds}", expected, fix)
    place = int(header[DOFS] % 2**32 + (header[DOFS + 1] << 32))
    return np.asarray(file.read_record(place + len(file.read_record(place)) + FRAME), dtype=np.int64)
