"""Checks of mass, damping and stiffness matrices: finite entries, symmetry and definiteness."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp

from ..arrays import Array
from ..errors import InputError
from ..given import LARGEST
from .sectors import Given, Sparse, real_csr

#: Largest entry of A - A^T over the largest entry of A that still counts as rounding.
SYMMETRY_TOLERANCE = 1e-10


#: Eigenvalues of the diagonally scaled matrix below this (over the largest) count as zero.
SINGULAR_TOLERANCE = 1e-13


#: Up to this size definiteness is decided by a dense eigenvalue problem.
DENSE_LIMIT = 600
#: Asymmetry of M that is rounding, of single precision too.
SINGLE = 1e-6


NAMES = {"M": "mass matrix", "K": "stiffness matrix", "C": "damping matrix", "B": "contact map"}


def checked_csr(given: Given, letter: str, where: str | None = None) -> sp.csr_matrix:
    """In CSR form, all of it numbers.

    Raises
    ------
    InputError
        An entry is none.
    """
    where = where or letter
    matrix = real_csr(given, where)
    wrong = check_entries(letter, matrix, where)
    if wrong:
        raise wrong
    return matrix


def check_entries(letter: str, A: Sparse, where: str) -> InputError | None:
    """Every entry is a number whose square is one."""
    if max(A.data.max(initial=0.0), -A.data.min(initial=0.0)) <= LARGEST:
        return None
    entries = A.tocoo()
    bad = np.flatnonzero(~(abs(entries.data) <= LARGEST))
    if not len(bad):
        return None
    row, column, value = int(entries.row[bad[0]]), int(entries.col[bad[0]]), float(entries.data[bad[0]])
    finite = bool(np.isfinite(value))
    return InputError(
        f"the {NAMES[letter]} has an entry that is {'too large' if finite else 'not a number'}",
        where=where,
        measured=f"{letter}[{row}][{column}] = {value}" + (f", and {len(bad) - 1} more" if len(bad) > 1 else ""),
        expected=f"at most {LARGEST:g}, whose square is a number" if finite else "finite entries",
        fix="choose other units" if finite else "look at what wrote this entry",
    )


def check_symmetric(
    letter: str, A: Sparse, where: str, dofs: Sequence[object], tolerance: float = SYMMETRY_TOLERANCE
) -> InputError | None:
    """Measured asymmetry and the worst pair of entries."""
    difference = (A - A.T).tocoo()
    scale = abs(A).max()
    if not difference.nnz or abs(difference.data).max() <= tolerance * scale:
        return None
    worst = int(np.argmax(abs(difference.data)))
    i, j = sorted((int(difference.row[worst]), int(difference.col[worst])))
    return InputError(
        f"the {NAMES[letter]} is not symmetric",
        where=where,
        measured=f"{letter}[{i}][{j}] = {A[i, j]:g} and {letter}[{j}][{i}] = {A[j, i]:g}"
        f" (dofs {dofs[i]}, {dofs[j]}); largest difference {abs(difference.data[worst]) / scale:.3g}"
        " of the largest entry",
        expected=f"{letter} = transpose of {letter} within {tolerance:g} of the largest entry",
        fix=f"correct the entry, or use ({letter} + transpose)/2 if this is rounding",
    )


def check_inertia(M: Sparse) -> None:
    """Flow and rotation leave K and C unsymmetric, nothing leaves inertia so: one triangle of M was given.

    Raises
    ------
    InputError
    """
    wrong = check_symmetric("M", M, "M", range(M.shape[0]), SINGLE)
    if wrong:
        raise wrong


def check_mass(M: Sparse, where: str, dofs: Sequence[str]) -> InputError | None:
    """Mass must be positive for every motion: a positive diagonal first, then the smallest eigenvalue."""
    diagonal = M.diagonal()
    worst = int(np.argmin(diagonal))
    fix = "give every dof a mass, or remove massless dofs by static condensation"
    if diagonal[worst] <= 0:
        kind = "negative" if diagonal[worst] < 0 else "zero"
        return InputError(
            f"the mass matrix has a {kind} diagonal entry",
            where=where,
            measured=f"M[{worst}][{worst}] = {diagonal[worst]:g} (dof {dofs[worst]})",
            expected="> 0 for every dof",
            fix="correct the sign" if diagonal[worst] < 0 else fix,
        )
    if diagonal[worst] < 1 / LARGEST:
        return InputError(
            "the mass matrix has a diagonal entry that is too small",
            where=where,
            measured=f"M[{worst}][{worst}] = {diagonal[worst]:g} (dof {dofs[worst]})",
            expected=f"at least {1 / LARGEST:g}, whose square is a number",
            fix="choose other units",
        )
    smallest, shape = smallest_eigenvalue(M)
    if smallest > SINGULAR_TOLERANCE:
        return None
    dof = int(np.argmax(abs(shape)))
    return InputError(
        "the mass matrix is singular" if smallest > -1e-10 else "the mass matrix is not positive definite",
        where=where,
        measured=f"smallest eigenvalue {smallest:.3g} of the largest, in a motion led by dof {dofs[dof]}",
        expected="all eigenvalues > 0",
        fix=fix,
    )


def check_stiffness(
    K: Sparse, where: str, dofs: Sequence[str], contact_rows: Sparse
) -> tuple[InputError | None, str | None]:
    """Stiffness with the contact stuck must be positive definite.

    Returns
    -------
    problem : InputError or None
    note : str or None
        Said when only the contact holds the structure.
    """
    if 0 < abs(K).max() < 1 / LARGEST:
        return (
            InputError(
                "the stiffness matrix is too small",
                where=where,
                measured=f"its largest entry is {abs(K).max():g}",
                expected=f"at least {1 / LARGEST:g}, whose square is a number",
                fix="choose other units",
            ),
            None,
        )
    free, _ = smallest_eigenvalue(K)
    if free > SINGULAR_TOLERANCE:
        return None, None
    # Stuck contact holds relative motion; any stiffness of the matrix' own size shows whether that is enough.
    stiffness = max(abs(K).max(), np.finfo(float).tiny)
    stuck, shape = smallest_eigenvalue(K + stiffness * (contact_rows.T @ contact_rows))
    if stuck > SINGULAR_TOLERANCE:
        kind = "singular" if free > -1e-10 else "not positive definite"
        return None, f"K is {kind} without contact: no free asymptote, contact alone holds the structure"
    dof = int(np.argmax(abs(shape)))
    indefinite = stuck < -1e-10
    return (
        InputError(
            "the stiffness matrix is negative for some motion"
            if indefinite
            else "the stiffness matrix is singular, also with the contact stuck",
            where=where,
            measured=f"smallest eigenvalue {stuck:.3g} of the largest, in a motion led by dof {dofs[dof]}",
            expected="all eigenvalues of K with stuck contact > 0",
            fix="the structure is statically unstable: check the signs"
            if indefinite
            else f"hold the structure (a spring to ground at {dofs[dof]}), or add a contact that does",
        ),
        None,
    )


def smallest_eigenvalue(values: Sparse) -> tuple[float, Array]:
    """Smallest eigenvalue of D^-1/2 A D^-1/2, D the size of A's diagonal, over the largest; and its vector.

    The scaling makes the answer independent of units. Large matrices are judged by their diagonal and, if that is
    positive, taken to be definite: the linear modes that analyses start from report otherwise, by their factors.
    """
    diagonal = np.asarray(values.diagonal())
    size = np.sqrt(np.where(diagonal == 0, 1.0, abs(diagonal)))
    if values.shape[0] > DENSE_LIMIT:
        lowest = int(np.argmin(diagonal))
        unit = np.zeros(values.shape[0])
        unit[lowest] = 1.0
        return float(np.sign(diagonal[lowest])), unit
    scaled = values.toarray() / size[:, None] / size
    if not np.all(np.isfinite(scaled)):
        return -1.0, np.asarray(~np.isfinite(scaled).all(axis=1), dtype=float)
    eigenvalues, vectors = np.linalg.eigh(scaled)
    largest = max(abs(eigenvalues).max(), np.finfo(float).tiny)
    return float(eigenvalues[0] / largest), vectors[:, 0]
