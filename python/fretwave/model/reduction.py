"""Craig-Bampton reduction: contact and observation dofs, and a few component modes."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from petsc4py import PETSc

from .. import _core
from ..arrays import Array
from ..errors import InputError
from ..given import whole
from ..kinds import of_their_kinds
from ..mpi.destroyable import Destroyable, Destroyed
from ..mpi.gather import on_all_ranks
from .frequency_error import FrequencyError, frequency_error
from .model import Model
from .omitted import OmittedModes
from .residual_statics import held_displacement
from .sectors import Given, Sparse, real_csr
from .sizes import COMPARED_MODES, COMPONENT_MODES

if TYPE_CHECKING:
    from mpi4py import MPI


class Reduction(Destroyable):
    """x = T x_r with T = [I 0; Psi Phi] over (kept, internal) dofs; made by `reduce`.

    Reduced coordinates are the kept dofs in the order given, then the component modes (unit modal mass). Signs and
    double modes are fixed by a rule, so that reduced coordinates mean the same on any number of ranks.

    Attributes
    ----------
    M, K : (n_r, n_r)
        On every rank, symmetric. K is block diagonal: the statically condensed stiffness and omega_j^2 [1/s^2].
    C : (n_r, n_r) or None
    keep : (n_kept,)
    omitted : OmittedModes
        As many component modes again, 10 at least, which are no coordinates.
    component_hz : (n_modes,)
        Frequencies with the kept dofs held [Hz], ascending.
    wall_s : dict
        factorisation, component_modes, constraint_modes, projection, total [s].
    """

    def __init__(
        self, model: Model, core: _core.Reduction, keep: npt.NDArray[np.intp], owned: Sequence[PETSc.Mat], wall: float
    ) -> None:
        self._model, self._core, self._owned = model, core, list(owned)
        self.keep = keep
        self.M: Array = np.asarray(core.M)
        self.K: Array = np.asarray(core.K)
        damping, left = core.C, core.omitted
        self.C: Array | None = None if damping is None else np.asarray(damping)
        C_from, C_onto, own = (None if damping is None else np.asarray(left[n]) for n in ("C_from", "C_onto", "C"))
        self.omitted = OmittedModes(np.asarray(left["omega"]), np.asarray(left["M"]), C_from, C_onto, own)
        self.component_hz: Array = np.asarray(core.component_omega) / (2 * np.pi)
        self.wall_s: dict[str, float] = {**core.times, "total": wall}

    def __repr__(self) -> str:
        return f"Reduction({len(self.keep)} kept dofs and {self.size - len(self.keep)} modes, of {self._model})"

    @property
    def size(self) -> int:
        """n_r = n_kept + n_modes."""
        return len(self.K)

    @property
    def highest_component_hz(self) -> float:
        """Of the last component mode [Hz], 0 without one."""
        return float(self.component_hz[-1]) if len(self.component_hz) else 0.0

    @property
    def places(self) -> dict[int, int]:
        """Reduced coordinate of each kept dof."""
        return {int(dof): place for place, dof in enumerate(self.keep)}

    def rows(self, B: Sparse | npt.ArrayLike) -> Sparse:
        """B (n, n_r) on the reduced coordinates of rows (n, n_dof) that reach kept dofs alone.

        Raises
        ------
        InputError
            They reach another dof.
        """
        full = real_csr(B)
        kept = sp.csr_matrix(full[:, self.keep])
        _check_all_kept(full, kept)
        return sp.csr_matrix(sp.hstack([kept, sp.csr_matrix((kept.shape[0], len(self.component_hz)))]))

    def names(self, dofs: Sequence[str]) -> list[str]:
        """Names of the reduced coordinates: kept dofs keep theirs."""
        return [*(dofs[k] for k in self.keep), *(f"component_{k + 1}" for k in range(len(self.component_hz)))]

    def faces(self) -> dict[str, Any]:
        """None: of a component."""
        return {}

    def expand(self, x_r: npt.ArrayLike) -> Array:
        """Displacement of all dofs, on every rank. Collective.

        Parameters
        ----------
        x_r : (n_r,) or (n_r, n)
            The same on every rank.

        Returns
        -------
        (n_dof,) or (n_dof, n)
        """
        rows = self._rows(x_r, self.size)
        local = self._core.expand(rows)
        full: Array = on_all_ranks(self._model.comm, local)
        return full if np.ndim(x_r) == 2 else full[:, 0]

    def project(self, f: npt.ArrayLike) -> Array:
        """T^T f: reduced load of forces on all dofs, on every rank. Collective.

        Parameters
        ----------
        f : (n_dof,) or (n_dof, n)
            The same on every rank.

        Returns
        -------
        (n_r,) or (n_r, n)
        """
        rows = self._rows(f, self._model.n_dof)
        reduced: Array = self._core.project(np.ascontiguousarray(self._model.distribute(rows)))
        return reduced if np.ndim(f) == 2 else reduced[:, 0]

    def beyond(self, f: npt.ArrayLike) -> Array:
        """Static displacement under forces that no reduced coordinate has, on every rank. Collective.

        With it `expand` of the reduced static displacement is that of the unreduced model: it moves internal dofs
        alone, and no coordinate feels it.

        Parameters
        ----------
        f : (n_dof,) or (n_dof, n)
            The same on every rank.

        Returns
        -------
        (n_dof,) or (n_dof, n)
        """
        forces = self._rows(f, self._model.n_dof)
        n, local = len(self.keep), np.ascontiguousarray(self._model.distribute(forces))
        modes = self.project(forces)
        modes[:n] = 0.0
        modes[n:] /= np.square(2 * np.pi * self.component_hz)[:, None]
        held = on_all_ranks(self._model.comm, held_displacement(self._model._matrices[0], self.keep, local))
        left: Array = held - self.expand(modes)
        return left if np.ndim(f) == 2 else left[:, 0]

    def error(self, count: int = COMPARED_MODES, K_contact: Given | None = None) -> FrequencyError:
        """Relative error of the lowest elastic frequencies. Collective.

        Parameters
        ----------
        count : int
        K_contact : (n_dof, n_dof) sparse or dense, optional
            Stiffness added on kept dofs in both models, as of stuck contact; the same on every rank.

        Raises
        ------
        InputError
            K_contact reaches a dof that is not kept; count exceeds what the reduced model has.
        """
        return frequency_error(self, self._model, count, K_contact)

    def destroy(self) -> None:
        """Free matrices and modes; the reduced matrices stay. Collective."""
        self._core = Destroyed("the reduction")  # type: ignore[assignment]
        self._model = Destroyed("the reduction")  # type: ignore[assignment]
        for mat in self._owned:
            mat.destroy()
        self._owned = []

    def _rows(self, values: npt.ArrayLike, expected: int) -> Array:
        rows = np.asarray(values, dtype=float)
        if rows.ndim not in (1, 2) or len(rows) != expected:
            raise InputError(
                "an array does not fit the reduction", None, rows.shape, f"({expected},)", "give one row per coordinate"
            )
        return np.ascontiguousarray(rows.reshape(expected, -1))


@of_their_kinds
def reduce(
    M: Given,
    K: Given,
    C: Given | None = None,
    keep: npt.ArrayLike = (),
    modes: int | None = None,
    highest_hz: float | None = None,
    comm: MPI.Comm | None = None,
) -> Reduction:
    """Craig-Bampton reduction. Collective.

    Parameters
    ----------
    M, K, C : (n_dof, n_dof)
        SciPy sparse or dense, the same on every rank, or distributed petsc4py matrices (AIJ) of one row layout.
        M and K symmetric, both triangles given. Any consistent set of units with time in seconds.
    keep : (n_kept,) int
        Dofs to keep: contact and observation. They must stop every rigid motion when held. The same on every rank.
    modes : int, optional
        Number of component modes, the lowest first (default 10, or all where they are fewer; 0: static condensation).
    highest_hz : float, optional
        Instead of `modes`: all component modes up to this frequency [Hz], counted by Sylvester's inertia.
    comm : mpi4py communicator, optional
        Default: of the petsc4py matrices, or COMM_WORLD.

    Raises
    ------
    InputError
        Kept dofs repeated, missing or out of range; too many modes; K or M not symmetric; structure not held.

    Notes
    -----
    One factorisation of K_ii (MUMPS, L D L^T) serves constraint modes and shift-invert; options prefix ``-component_``.
    Beside it the modes take 8 n_dof n_r bytes over all ranks.

    References
    ----------
    Craig, R. R. and Bampton, M. C. C., Coupling of substructures for dynamic analyses, AIAA J. 6(7), 1968.
    """
    start = time.perf_counter()
    kept, count, highest = _kept(keep), _count(modes, highest_hz), 2 * np.pi * (highest_hz or 0.0)
    model = Model(M, K, C, comm=comm)
    if modes is None:
        count = min(count, max(model.n_dof - len(kept), 0))
    stiffness, mass = model._matrices[0], model._matrices[-1]
    damping = None if C is None else model._matrices[1]
    owned = [mat for mat, given in zip(model._matrices, (A for A in (K, C, M) if A is not None)) if mat is not given]
    core = _core.Reduction(stiffness, mass, damping, kept.tolist(), count, highest)
    return Reduction(model, core, kept, owned, time.perf_counter() - start)


def _check_all_kept(B: Sparse, kept: Sparse) -> None:
    """No entry of B has been left out."""
    if abs(B).sum() > abs(kept).sum() * (1 + 1e-9):
        raise InputError(
            "contact pairs reach dofs that the reduction has not kept",
            None,
            f"{B.nnz - kept.nnz} of {B.nnz} entries of B",
            "none",
            "keep them (`Structure.kept`)",
        )


def _kept(keep: npt.ArrayLike) -> npt.NDArray[np.intp]:
    given = np.asarray(keep).ravel()
    if given.size and not np.issubdtype(given.dtype, np.integer):
        raise InputError(
            "kept dofs are not whole numbers", None, given.dtype, "integers", "give dof numbers, not a mask"
        )
    return given.astype(np.intp)


def _count(modes: int | None, highest_hz: float | None) -> int:
    if modes is not None and highest_hz is not None:
        raise InputError(
            "component modes are chosen twice",
            None,
            f"modes = {modes}, highest_hz = {highest_hz}",
            "one of them",
            "remove one",
        )
    if highest_hz is not None and not highest_hz > 0:
        raise InputError(
            "highest_hz is no frequency", None, highest_hz, "> 0 Hz", "give a frequency, or a number of modes"
        )
    count = COMPONENT_MODES if modes is None else whole(modes)
    if count is None:
        raise InputError("component modes are counted", "modes", repr(modes), "a whole number", "give their number")
    return count
