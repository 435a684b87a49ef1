"""Matrices of one sector by the sector they act on, {k: A_k} for the one k places ahead: tied, and put round a wheel.

Scipy alone; `fretwave.cyclic.sector` says what a wave on such terms is.
"""

from __future__ import annotations

from collections.abc import Mapping
from operator import index
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from ..arrays import Array, Indices
from ..errors import InputError
from ..given import masked, numbers, whole

if TYPE_CHECKING:
    from typing import TypeAlias

Sparse: TypeAlias = sp.csr_matrix
#: A matrix as users may give it: sparse, dense, rows of numbers, or petsc4py's.
Given: TypeAlias = sp.spmatrix
#: A matrix, or {k: that on the sector k places ahead}.
Term: TypeAlias = sp.spmatrix
Parts = Mapping[int, Given]
#: Numbers of sectors and of nodal diameters are below it.
LARGEST_NUMBER = 2**31


def real_csr(given: Given, where: str | None = None) -> Sparse:
    """A matrix in CSR form of float, its entries of one place added up; what was given stays as it is.

    Raises
    ------
    InputError
        It is complex (of which SciPy would keep the real part), masked, or no matrix of numbers.
    """
    given = given.tocsr() if sp.issparse(given) else _dense(given, where)
    if np.iscomplexobj(given):
        imaginary = given.data.imag if sp.issparse(given) else given.imag
        if np.any(imaginary != 0):  # nan too
            fix = "put the imaginary part of a loss factor into C, or take fw.modal_damping"
            raise InputError("a matrix is complex", where, f"entries of type {given.dtype}", "real entries", fix)
        given = given.real
    matrix = sp.csr_matrix(given, dtype=float)
    if not matrix.has_canonical_format:  # PETSc would keep one of several entries of a place
        matrix = matrix.copy()
        matrix.sum_duplicates()
    return matrix


def _dense(given: npt.ArrayLike, where: str | None) -> npt.NDArray[Any]:
    """Rows of numbers as an array."""
    try:
        array = np.asarray(given)
        array = array.astype(float) if array.dtype.kind == "O" else array
    except (TypeError, ValueError, OverflowError):  # rows of different lengths, None among them
        array = np.asarray(type(given).__name__)
    hidden = masked(given)
    if array.dtype.kind not in "biufc" or array.ndim > 2 or hidden:
        kind = "entries are masked" if hidden else f"{array.ndim} dimensions of {array.dtype}"
        measured = f"{type(given).__name__}: {kind}" if array.dtype.kind != "U" or array.ndim else str(array)
        expected, fix = "rows of real numbers, all as long, or a sparse matrix", "give a NumPy array (n, m)"
        raise InputError("this is no matrix", where, measured, expected, fix)
    return array


def is_by_sector(given: Term | None) -> bool:
    """Whether a matrix is given as {k: matrix on the sector k places ahead}; SciPy's DOK is a dict as well."""
    return isinstance(given, Mapping) and not sp.issparse(given)


def check_wave(sectors: int, nodal_diameter: int) -> tuple[int, int]:
    """A wave closes around the wheel: both numbers as Python's own, which do not overflow as NumPy's short ones do.

    Raises
    ------
    InputError
    """
    number, diameters = whole(sectors) or 0, whole(nodal_diameter)
    if not 1 <= number < LARGEST_NUMBER or diameters is None or abs(diameters) >= LARGEST_NUMBER:
        what, measured = (
            "a wave goes a whole number of times around a wheel",
            f"sectors={sectors!r}, nodal_diameter={nodal_diameter!r}",
        )
        raise InputError(what, None, measured, "whole numbers, one sector or more", "round them")
    return number, diameters


def by_sector(given: Term | None) -> Parts:
    """{k: matrix on the sector k places ahead}, the own sector first; a plain matrix stands for {0: matrix}."""
    if given is None:
        return {}
    if not is_by_sector(given):
        return {0: given}
    wrong = [k for k in given if whole(k) is None]
    if wrong:
        measured, fix = ", ".join(map(repr, wrong)), "give {0: own, 1: on the next sector, ...}"
        raise InputError("a matrix acts on no sector", None, measured, "whole numbers of sectors ahead", fix)
    if 0 not in given:
        raise InputError("the own sector's matrix is missing", None, sorted(given), "0 among them", "give {0: ...}")
    return {index(k): given[k] for k in sorted(given, key=lambda k: (k != 0, k))}


def in_wave(given: Term | None, q: npt.ArrayLike, theta: float) -> npt.NDArray[np.complex128]:
    """sum_k A_k q e^{-i k theta}: terms on the complex amplitudes of a wave, theta later from sector to sector."""
    parts = by_sector(given).items()
    return np.asarray(sum(np.exp(-1j * k * theta) * (A @ np.asarray(q)) for k, A in parts))


def around(given: Term, sectors: int, first: int = 0, end: int | None = None) -> Sparse:
    """Block-circulant matrix of the wheel, from the own part of a sector and those on the sectors k places ahead.

    Parameters
    ----------
    first, end : int
        The rows of these sectors alone; all without them.
    """
    parts, sectors = {k: real_csr(A) for k, A in by_sector(given).items()}, index(sectors)
    side_by_side = sp.hstack(list(parts.values()), format="csr")
    n, own = parts[0].shape[1], range(first, sectors if end is None else end)
    block, column = np.divmod(side_by_side.indices, n)
    ahead, nnz = np.array(list(parts))[block], side_by_side.nnz
    kind = np.int32 if max(sectors * n, len(own) * nnz) < 2**31 else np.int64
    columns = np.empty((len(own), nnz), kind)
    for row, j in enumerate(own):
        columns[row] = (j + ahead) % sectors * n + column
    starts = np.append(np.add.outer(np.arange(len(own)) * nnz, side_by_side.indptr[:-1]), len(own) * nnz).astype(kind)
    shape = (len(own) * parts[0].shape[0], sectors * n)
    out = sp.csr_matrix((np.tile(side_by_side.data, len(own)), columns.ravel(), starts), shape)
    out.sum_duplicates()
    return out


def combine(left: Parts, middle: Parts, right: Parts, sign: int) -> dict[int, Sparse]:
    """Sum of left_a^T middle_b right_c by the sector c + b + sign a it acts on."""
    out: dict[int, Sparse] = {}
    for a, L in left.items():
        for b, A in middle.items():
            for c, R in right.items():
                part = sp.csr_matrix(L.T @ real_csr(A) @ R)
                k = c + b + sign * a
                if part.nnz or k == 0:
                    out[k] = out[k] + part if k in out else part
    return out


def check_number(sectors: int) -> int:
    """A wheel has neighbours: their number as Python's own (a root of NumPy's int8 is of half precision)."""
    number = whole(sectors) or 0
    if number < 2:
        raise InputError("a wheel has two sectors or more", None, sectors, "a whole number >= 2", "give their number")
    return number


def check_square(given: Mapping[str, Term | None]) -> int:
    """Rows of the matrices of these names, by sector or not, which are all square, of one size and finite.

    Raises
    ------
    InputError
        There is none, or one is not so.
    """
    parts = {
        f"{name}[{k}]" if is_by_sector(term) else name: real_csr(A, name)
        for name, term in given.items()
        for k, A in by_sector(term).items()
    }
    n = next((A.shape[0] for A in parts.values()), 0)
    for where, A in parts.items():
        if A.shape != (n, n) or not n or not np.isfinite(A.data).all():
            measured, expected = f"{A.shape[0]} x {A.shape[1]} entries", f"{n or 1} x {n or 1} finite numbers"
            raise InputError("a matrix cannot be used", where, measured, expected, "give square ones of one size")
    return n


def check_balanced(given: Term | None, name: str) -> None:
    """Action and reaction: what the next sector does to this one, this one does to the next (K_-k = K_k^T).

    C may have an unsymmetric (gyroscopic) part, but no one-sided coupling.
    """
    parts = {k: real_csr(A, f"{name}[{k}]") for k, A in by_sector(given).items()}
    for k, A in parts.items():
        other = parts.get(-k)
        wrong = other is None or (name != "C" and abs(A - other.T).max() > 1e-9 * max(abs(A).max(), abs(other).max()))
        if wrong and k == 0:
            difference = abs(A - A.T).max() / abs(A).max()
            raise InputError(
                f"{name} of the sector itself is not symmetric",
                f"{name}[0]",
                f"{name}[0] - {name}[0].T up to {difference:.3g} of the largest entry",
                f"{name}[0] = {name}[0].T within 1e-9",
                f"correct the entry, or use ({name} + transpose)/2 if this is rounding"
                + ("; forces of the flow are aerodynamics" if name == "K" else ""),
            )
        if wrong:
            raise InputError(
                f"the coupling of {name} between sectors is one-sided",
                f"{name}[{k}]",
                "no counterpart" if other is None else f"{name}[{k}] - {name}[{-k}].T is not zero",
                f"{name}[{-k}] = {name}[{k}].T",
                f"give {{0: {name}_0, {k}: {name}_k, {-k}: {name}_k.T}}",
            )


def rotation(angle: float, axis: str = "z") -> Array:
    """Rotation (3, 3) by `angle` [rad] about a Cartesian axis, positive by the right-hand rule."""
    if axis not in ("x", "y", "z"):
        raise InputError("unknown axis of rotation", None, axis, "x, y or z", 'use axis="z"')
    turned = float(numbers("angle", angle))
    i, c, s = "xyz".index(axis), np.cos(turned), np.sin(turned)
    turn = np.zeros((3, 3))
    turn[i, i] = 1.0
    j, k = (i + 1) % 3, (i + 2) % 3
    turn[[j, j, k, k], [j, k, j, k]] = [c, -s, s, c]
    return turn


def ties(low: npt.ArrayLike, high: npt.ArrayLike, n: int, sectors: int, axis: str | None) -> dict[int, Sparse]:
    """x_full = ties[0] x_j + ties[1] x_{j+1}: the high face is the next sector's low face, turned about the axis.

    Parameters
    ----------
    n : dofs of the sector with both its faces
    """
    low, high = _indices("low", low), _indices("high", high)
    _check_faces(low, high, n, axis is not None)
    turn = rotation(2 * np.pi / sectors, axis) if axis else np.eye(1)
    kept = np.setdiff1d(np.arange(n), high)
    place = np.full(n, -1, dtype=np.intp)
    place[kept] = np.arange(len(kept))
    own = sp.csr_matrix((np.ones(len(kept)), (kept, place[kept])), (n, len(kept)))
    face = sp.csr_matrix(sp.kron(sp.identity(len(low) // len(turn)), turn))
    pick = sp.csr_matrix((np.ones(len(high)), (high, np.arange(len(high)))), (n, len(high)))
    take = sp.csr_matrix((np.ones(len(low)), (np.arange(len(low)), place[low])), (len(low), len(kept)))
    return {0: own, 1: sp.csr_matrix(pick @ face @ take)}


def _indices(name: str, dofs: npt.ArrayLike) -> Indices:
    given = np.asarray(dofs).ravel()
    if not np.issubdtype(given.dtype, np.integer):
        raise InputError(
            f"dofs of the {name} face are not whole numbers", None, given.dtype, "integers", "give dof numbers"
        )
    return given.astype(np.intp)


def _check_faces(low: Indices, high: Indices, n: int, triples: bool) -> None:
    """Matching lists of different dofs of the sector."""
    both = np.concatenate([low, high])
    values, counts = np.unique(both, return_counts=True)
    problem = None
    if len(low) != len(high):
        problem = (f"{len(low)} low and {len(high)} high dofs", "as many on both")
    elif len(both) and (both.min() < 0 or both.max() >= n):
        problem = (f"dof {both.min() if both.min() < 0 else both.max()}", f"0 .. {n - 1}")
    elif counts.max(initial=0) > 1:
        problem = (f"dof {values[np.argmax(counts)]} stands {counts.max()} times", "each dof once, on one face")
    elif triples and len(low) % 3:
        problem = (f"{len(low)} dofs a face", "three Cartesian components a node")
    if problem:
        raise InputError("the faces of the sector do not match", None, *problem, "give matching dofs of both faces")
