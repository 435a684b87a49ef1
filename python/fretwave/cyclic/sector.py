"""One sector that stands for a wheel of N equal ones, and the wheel itself.

Convention, the only place where it is written:

* Sectors are numbered j = 0 .. N - 1 in the positive sense about the axis; each describes its motion in a frame turned
  with it, so that all have the same matrices.
* A term K_k acts on the dofs of the sector k places ahead: sum_k K_k x_{j+k} is the elastic force on sector j.
* A wave of ND nodal diameters, theta = 2 pi ND / N, repeats the motion of sector 0 with a delay in time:
  x_j(t) = x_0(t - j theta / omega). Harmonic n, q_n e^{i n omega t} in sector 0, is q_n e^{-i n j theta} in sector j
  (spatial index n ND mod N), hence Z_n = sum s_n^p e^{-i k n theta} A_k.
* 0 < ND < N/2 is a forward wave: crests move to higher j, with the speed omega / ND. N - ND, or -ND, is the backward
  wave. ND = 0 and N/2 (N even) stand still: neighbours move alike, or against each other.

References
----------
Thomas, D. L., Dynamics of rotationally periodic structures, Int. J. Numer. Methods Eng. 14, 1979.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from ..errors import InputError
from ..model.model import Contact, Model, by_sector
from ..model.modes import LinearMode
from .aerodynamics import Aerodynamics, period_of, with_terms
from .faces import rotation

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.intp]
Parts = Mapping[int, Any]


@dataclass(frozen=True)
class Sector:
    """A sector of a wheel with the terms that tie it to its neighbours.

    Attributes
    ----------
    M, K, C : {k: (n_dof, n_dof)}
        Terms on the sector k places ahead; a plain matrix where a sector is not coupled. C may be None.
    sectors : int
        N.
    contacts : sequence of Contact
        B of pairs that reach the next sector as {0: B_0, 1: B_1}.
    ties : {k: (n_full, n_dof)}
        Dofs of the sector as it was before its high face was tied to the next one, x_full = sum_k ties[k] x_{j+k};
        {0: identity} where nothing was tied.
    aerodynamics : Aerodynamics, optional
        Forces of the flow between the blades; they alone need not be balanced.
    """

    M: Any
    K: Any
    sectors: int
    C: Any = None
    contacts: Sequence[Contact] = ()
    ties: Parts = field(default_factory=dict)
    aerodynamics: Aerodynamics | None = None

    def __post_init__(self) -> None:
        if self.sectors < 2:
            raise InputError("a wheel has two sectors or more", None, self.sectors, ">= 2", "give their number")
        for name in ("K", "M", "C"):
            check_balanced({k: sp.csr_matrix(A) for k, A in by_sector(getattr(self, name)).items()}, name)

    def __repr__(self) -> str:
        flow = ", with aerodynamics" if self.aerodynamics else ""
        contacts = [contact.name for contact in self.contacts]
        return f"Sector({self.n_dof} dofs, one of {self.sectors} sectors, contacts {contacts}{flow})"

    @property
    def n_dof(self) -> int:
        """Dofs of one sector."""
        return int(np.shape(by_sector(self.M)[0])[1])

    @classmethod
    def from_faces(
        cls,
        M: Any,
        K: Any,
        low: npt.ArrayLike,
        high: npt.ArrayLike,
        sectors: int,
        C: Any = None,
        contacts: Sequence[Contact] = (),
        axis: str | None = None,
    ) -> Sector:
        """A sector cut out of a wheel, its high face tied to the low face of the next one.

        The high face's dofs are left out; those that remain keep their order.

        Parameters
        ----------
        M, K, C : (n_full, n_full) sparse or dense
            Of the sector alone, both faces free.
        low, high : (n_face,)
            Matching dofs of the two faces (`match_faces` finds them from coordinates).
        contacts : sequence of Contact
            B on the sector's n_full dofs.
        axis : {"x", "y", "z"}, optional
            Dofs of the faces come in triples of Cartesian components, and the sectors lie about this axis: the high
            face moves like the low one turned by 2 pi / N. Without it dofs correspond as they are (scalars, or
            components that are radial, circumferential and axial already).
        """
        low, high, n = _indices("low", low), _indices("high", high), sp.csr_matrix(K).shape[0]
        _check_faces(low, high, n, axis is not None)
        ties = _ties(low, high, n, rotation(2 * np.pi / sectors, axis) if axis else np.eye(1))
        tied = [replace(c, B=combine({0: sp.identity(_row_count(c))}, by_sector(c.B), ties, +1)) for c in contacts]
        terms = [None if A is None else combine(ties, {0: sp.csr_matrix(A, dtype=float)}, ties, -1) for A in (M, K, C)]
        return cls(terms[0], terms[1], sectors, terms[2], tied, ties)

    def model(self, nodal_diameter: int, comm: Any = None) -> Model:
        """The equations of one sector in a wave of this many nodal diameters (negative: backward). Collective."""
        terms = self._terms(period_of(nodal_diameter, self.sectors))
        return Model(terms["M"], terms["K"], terms["C"], self.contacts, comm, self.sectors, nodal_diameter)

    def wheel(self, comm: Any = None, changes: Mapping[str, Sequence[Any]] | None = None) -> Model:
        """The whole wheel, sector after sector, N n_dof dofs; ranks take whole sectors. Collective.

        Parameters
        ----------
        changes : {"K": N matrices (n_dof, n_dof), ...}, optional
            Added to a term of each sector in turn: a mistuned wheel.
        """
        around = {letter: self._around(A) for letter, A in self._terms().items() if A is not None}
        for letter, own in (changes or {}).items():
            _check_changes(letter, own, self.sectors, self.n_dof)
            added = sp.csr_matrix(sp.block_diag([sp.csr_matrix(A) for A in own]))
            around[letter] = around[letter] + added if letter in around else added
        contacts = [
            replace(contact, B=self._around(contact.B), parameters=self._repeated(contact)) for contact in self.contacts
        ]
        return Model(around["M"], around["K"], around.get("C"), contacts, comm, unit=self.n_dof)

    def _terms(self, period: int | None = None) -> dict[str, Any]:
        """M, K and C with what the flow adds."""
        terms = {letter: getattr(self, letter) for letter in "MKC"}
        added = self.aerodynamics.terms(self.M, period) if self.aerodynamics else {}
        return {letter: with_terms(A, added.get(letter, {})) for letter, A in terms.items()}

    def wave(self, q: npt.ArrayLike, nodal_diameter: int, order: int = 1) -> npt.NDArray[np.complex128]:
        """Complex amplitudes (N, n_dof) of harmonic `order` in all sectors from those of sector 0, (n_dof,)."""
        return wave(q, nodal_diameter * order, self.sectors)

    def around(self, mode: LinearMode, nodal_diameter: int) -> LinearMode:
        """A wave of one sector as a mode of the wheel (unit modal mass of the wheel when undamped)."""
        return wave_mode(mode, nodal_diameter, self.sectors)

    def expand(self, q: npt.ArrayLike, nodal_diameter: int, order: int = 1) -> npt.NDArray[np.complex128]:
        """Complex amplitudes (n_full,) of harmonic `order` on the dofs with both faces, from those (n_dof,)."""
        if not self.ties:
            return np.asarray(q, dtype=complex)
        theta = 2 * np.pi * order * nodal_diameter / self.sectors
        return np.asarray(sum(np.exp(-1j * k * theta) * (T @ np.asarray(q)) for k, T in self.ties.items()))

    def _around(self, given: Any) -> sp.csr_matrix:
        return around(given, self.sectors)

    def _repeated(self, contact: Contact) -> dict[str, Any]:
        return {k: np.tile(v, self.sectors) if np.size(v) > 1 else v for k, v in contact.parameters.items()}


def wave(q: npt.ArrayLike, index: int, sectors: int) -> npt.NDArray[np.complex128]:
    """Complex amplitudes (N, n_dof) in all sectors of a wave with this spatial index, from those of sector 0."""
    turns = np.arange(sectors) * index % sectors
    return np.asarray(np.exp(-2j * np.pi * turns / sectors)[:, None] * np.asarray(q, dtype=complex))


def wave_mode(mode: LinearMode, nodal_diameter: int, sectors: int) -> LinearMode:
    """A wave of one sector as a mode of the wheel (unit modal mass of the wheel when undamped)."""
    phi = wave(mode.shape + 1j * mode.imaginary, nodal_diameter, sectors).ravel() / np.sqrt(sectors)
    return LinearMode(mode.omega, mode.beta, phi.real.copy(), phi.imag.copy())


def around(given: Any, sectors: int) -> sp.csr_matrix:
    """Block-circulant matrix of the wheel, from the own part of a sector and those on the sectors k places ahead."""
    ahead = sp.csr_matrix(np.roll(np.eye(sectors), 1, axis=1))  # row j has its 1 in column j + 1
    behind = sp.csr_matrix(ahead.T)
    parts = by_sector(given).items()
    return sp.csr_matrix(sum(sp.kron((ahead if k > 0 else behind) ** abs(k), sp.csr_matrix(A)) for k, A in parts))


def combine(left: Parts, middle: Parts, right: Parts, sign: int) -> dict[int, sp.csr_matrix]:
    """Sum of left_a^T middle_b right_c by the sector c + b + sign a it acts on."""
    out: dict[int, sp.csr_matrix] = {}
    for a, L in left.items():
        for b, A in middle.items():
            for c, R in right.items():
                part = sp.csr_matrix(L.T @ sp.csr_matrix(A) @ R)
                k = c + b + sign * a
                if part.nnz or k == 0:
                    out[k] = out[k] + part if k in out else part
    return out


def check_balanced(parts: Parts, name: str) -> None:
    """Action and reaction: what the next sector does to this one, this one does to the next (K_-k = K_k^T).

    C may have an unsymmetric (gyroscopic) part, but no one-sided coupling.
    """
    for k, A in parts.items():
        other = parts.get(-k)
        wrong = other is None or (name != "C" and abs(A - other.T).max() > 1e-9 * max(abs(A).max(), abs(other).max()))
        if wrong:
            raise InputError(
                f"the coupling of {name} between sectors is one-sided",
                f"{name}[{k}]",
                "no counterpart" if other is None else f"{name}[{k}] - {name}[{-k}].T is not zero",
                f"{name}[{-k}] = {name}[{k}].T",
                f"give {{0: {name}_0, {k}: {name}_k, {-k}: {name}_k.T}}",
            )


def _row_count(contact: Contact) -> int:
    """Rows of a contact's B."""
    return int(np.shape(by_sector(contact.B)[0])[0])


def _check_changes(letter: str, own: Sequence[Any], sectors: int, n_dof: int) -> None:
    shapes = {np.shape(A) for A in own}
    if letter not in "MKC" or len(own) != sectors or shapes != {(n_dof, n_dof)}:
        raise InputError(
            "the changes of a mistuned wheel do not fit its sectors",
            letter,
            f"{len(own)} matrices of {', '.join(map(str, shapes))}",
            f"M, K or C: {sectors} matrices of ({n_dof}, {n_dof})",
            "give one matrix for each sector",
        )


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


def _ties(low: Indices, high: Indices, n: int, turn: Array) -> dict[int, sp.csr_matrix]:
    """x_full = ties[0] x_j + ties[1] x_{j+1}: the high face is the next sector's low face, turned."""
    kept = np.setdiff1d(np.arange(n), high)
    place = np.full(n, -1, dtype=np.intp)
    place[kept] = np.arange(len(kept))
    own = sp.csr_matrix((np.ones(len(kept)), (kept, place[kept])), (n, len(kept)))
    face = sp.csr_matrix(sp.kron(sp.identity(len(low) // len(turn)), turn))
    pick = sp.csr_matrix((np.ones(len(high)), (high, np.arange(len(high)))), (n, len(high)))
    take = sp.csr_matrix((np.ones(len(low)), (np.arange(len(low)), place[low])), (len(low), len(kept)))
    return {0: own, 1: sp.csr_matrix(pick @ face @ take)}
