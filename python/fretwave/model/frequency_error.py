"""Lowest elastic frequencies of a reduced model against the unreduced one."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy.linalg
import scipy.sparse as sp

from .. import _core
from ..arrays import Array
from ..errors import InputError
from .model import Model
from .sectors import Given, real_csr

if TYPE_CHECKING:
    from .reduction import Reduction

#: Frequencies below this share of the lowest component frequency are rigid motions, without a relative error.
RIGID_SHARE = 1e-3


@dataclass(frozen=True)
class FrequencyError:
    """Lowest elastic frequencies of a reduced model against the unreduced one.

    Attributes
    ----------
    full_hz, reduced_hz : (count,) [Hz]
    relative : (count,)
        reduced / full - 1; not negative beyond rounding, as the reduction is a Rayleigh-Ritz method.
    wall_s : float [s]
        Time spent, nearly all on the unreduced modes.
    """

    full_hz: Array
    reduced_hz: Array
    relative: Array
    wall_s: float

    def __repr__(self) -> str:
        return f"FrequencyError({len(self.relative)} modes, largest {self.largest:.2g})"

    @property
    def largest(self) -> float:
        """Largest relative error in magnitude."""
        return float(np.abs(self.relative).max())


def frequency_error(reduction: Reduction, model: Model, count: int, K_contact: Given | None) -> FrequencyError:
    """`Reduction.error` of a reduction of this model. Collective."""
    start = time.perf_counter()
    extra = _contact_stiffness(reduction, model.n_dof, K_contact)
    stiffness = reduction.K + _on_kept(reduction, extra)
    square = scipy.linalg.eigh(stiffness, reduction.M, eigvals_only=True)
    reduced = np.sqrt(np.maximum(square, 0.0)) / (2 * np.pi)
    rigid = int(np.count_nonzero(reduced < RIGID_SHARE * _reference_hz(reduction)))
    if not 1 <= count <= reduction.size - rigid:
        expected = f"1 .. {reduction.size - rigid}"
        raise InputError("the reduced model has not as many elastic modes", None, count, expected, "ask for fewer")
    full = _full_hz(model, extra, rigid + count)[rigid:]
    reduced = reduced[rigid : rigid + count]
    return FrequencyError(full, reduced, reduced / full - 1, time.perf_counter() - start)


def _reference_hz(reduction: Reduction) -> float:
    """A frequency of elastic motion: of the internal dofs, or of the kept ones."""
    if len(reduction.component_hz):
        return float(reduction.component_hz[0])
    n = len(reduction.keep)
    return float(np.sqrt(np.trace(reduction.K[:n, :n]) / np.trace(reduction.M[:n, :n])) / (2 * np.pi))


def _contact_stiffness(reduction: Reduction, n: int, K_contact: Given | None) -> sp.csr_matrix:
    extra = sp.csr_matrix((n, n)) if K_contact is None else real_csr(K_contact, "K_contact")
    if extra.shape != (n, n):
        raise InputError("K_contact does not fit the model", None, extra.shape, (n, n), "give it on all dofs")
    entries = extra.tocoo()
    reached = np.union1d(entries.row[entries.data != 0], entries.col[entries.data != 0])
    outside = np.setdiff1d(reached, reduction.keep)
    if len(outside):
        raise InputError(
            "K_contact reaches dofs that are not kept",
            None,
            f"{len(outside)}, the first {outside[0]}",
            "kept dofs only",
            "keep them",
        )
    return extra


def _on_kept(reduction: Reduction, extra: sp.csr_matrix) -> Array:
    out = np.zeros((reduction.size, reduction.size))
    n = len(reduction.keep)
    out[:n, :n] = extra[reduction.keep][:, reduction.keep].toarray()
    return out


def _full_hz(model: Model, extra: sp.csr_matrix, count: int) -> Array:
    K, M = model._matrices[0], model._matrices[-1]
    stiff = model._matrix(extra, "K")
    stiffness = K.copy()
    stiffness.axpy(1.0, stiff)
    core = _core.Model([(stiffness, 0, 0), (M, 2, 0)], [], 0.0)
    modes = _core.linear_modes(core, count, _core.ContactState.free, None, False)
    for mat in (stiff, stiffness):
        mat.destroy()
    return np.array([omega for omega, *_ in modes]) / (2 * np.pi)
