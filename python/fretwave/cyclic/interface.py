"""The faces of a sector that is reduced: dofs that stay coordinates of their own, and interface modes of the others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from ..arrays import Array, Indices
from ..model.contact import Contact
from ..model.sectors import by_sector, real_csr, rotation


@dataclass
class Interface:
    """Dofs of a sector: inner ones, of these the kept ones, and the faces.

    Attributes
    ----------
    own : (n,) places in the faces that stay coordinates
    turned : the faces are Cartesian, the high one turned
    n_interface : coordinates of a face, once V is known
    """

    n: int
    low: Indices
    high: Indices
    inner: Indices
    kept: Indices
    own: Indices
    turned: bool
    n_interface: int = 0

    @classmethod
    def of(
        cls, n: int, low: Indices, high: Indices, contacts: Sequence[Contact], keep: npt.ArrayLike, axis: str | None
    ) -> Interface:
        touched = [real_csr(B).indices for contact in contacts for B in by_sector(contact.B).values()]
        wanted = np.unique(np.concatenate([np.asarray(keep, dtype=np.intp).ravel(), *touched]))
        own = np.nonzero(np.isin(low, wanted) | np.isin(high, wanted))[0]
        if axis is not None:  # a turn mixes the three components of a node
            own = (3 * np.unique(own // 3)[:, None] + np.arange(3)).ravel()
        inner = np.setdiff1d(np.arange(n), np.concatenate([low, high]))
        return cls(n, low, high, inner, np.intersect1d(wanted, inner), own, axis is not None)

    def whole(self) -> sp.csc_matrix:
        """V of faces that are kept as they are."""
        self.own = np.arange(len(self.low))
        return _unit(self.own, len(self.low))

    def basis(self, motions: Array, tolerance: float) -> sp.csc_matrix:
        """V (n_face, p): unit vectors of the dofs kept, then orthonormal motions of the others.

        Singular vectors have a sign of their own choice: the largest entry is made positive.
        """
        rest = np.setdiff1d(np.arange(len(self.low)), self.own)
        U, s, _ = np.linalg.svd(motions[rest], full_matrices=False)
        U = U[:, s > tolerance * s.max(initial=0.0)]
        U = U * np.sign(U[np.argmax(np.abs(U), axis=0), np.arange(U.shape[1])]) if U.size else U
        n_face = len(self.low)
        return sp.csc_matrix(sp.hstack([_unit(self.own, n_face), _unit(rest, n_face) @ sp.csc_matrix(U)]))

    def coordinates(self, V: sp.csc_matrix, sectors: int, axis: str | None) -> tuple[sp.csc_matrix, Indices]:
        """x = P y, y = (inner dofs, low, high), and which of y are kept: kept dofs, low, high."""
        self.n_interface = V.shape[1]
        turn = np.eye(1) if axis is None else rotation(2 * np.pi / sectors, axis)
        turned = sp.kron(sp.identity(V.shape[0] // len(turn)), turn) @ V
        parts = [_unit(self.inner, self.n), _unit(self.low, self.n) @ V, _unit(self.high, self.n) @ turned]
        faces = len(self.inner) + np.arange(2 * V.shape[1])
        return sp.csc_matrix(sp.hstack(parts)), np.concatenate([np.searchsorted(self.inner, self.kept), faces])

    def places(self) -> dict[int, int]:
        """Reduced coordinates of kept dofs."""
        found = {int(dof): k for k, dof in enumerate(self.kept)}
        for column, position in enumerate(self.own):
            found[int(self.low[position])] = len(self.kept) + column
            if not self.turned:
                found[int(self.high[position])] = len(self.kept) + self.n_interface + column
        return found


def _unit(places: Indices, n: int) -> sp.csc_matrix:
    """Unit vectors (n, len(places))."""
    return sp.csc_matrix((np.ones(len(places)), (places, np.arange(len(places)))), (n, len(places)))
