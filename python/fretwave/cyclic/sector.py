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
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from ..errors import InputError
from ..given import whole
from ..model.contact import Contact
from ..model.model import Model
from ..model.modes import LinearMode
from ..model.sectors import Given, Parts, Term, by_sector, check_balanced, check_number, check_square, in_wave, real_csr
from ..model.structure import Structure
from .aerodynamics import Aerodynamics, period_of, with_terms

if TYPE_CHECKING:
    from mpi4py import MPI


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

    M: Term
    K: Term
    sectors: int
    C: Term | None = None
    contacts: Sequence[Contact] = ()
    ties: Parts = field(default_factory=dict)
    aerodynamics: Aerodynamics | None = None
    units: str | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "sectors", check_number(self.sectors))
        check_square({"K": self.K, "M": self.M, "C": self.C})
        for name in ("K", "M", "C"):
            check_balanced(getattr(self, name), name)

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
        M: Given,
        K: Given,
        low: npt.ArrayLike,
        high: npt.ArrayLike,
        sectors: int,
        C: Given | None = None,
        contacts: Sequence[Contact] = (),
        axis: str | None = None,
        units: str | None = None,
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
        units : str, optional
            Name of the system of units (`fretwave.units`); without it SI.
        """
        cut = Structure(M, K, C, sectors=sectors, low=np.asarray(low), high=np.asarray(high), axis=axis, units=units)
        tied = cut.tied()
        return cls.of(tied, [replace(contact, pairs=contact.pairs.tied(tied.ties)) for contact in contacts])

    @classmethod
    def of(
        cls, structure: Structure, contacts: Sequence[Contact] = (), aerodynamics: Aerodynamics | None = None
    ) -> Sector:
        """Of a structure that is a tied sector (`fretwave.Structure.tied`), with contacts on its dofs."""
        M, K, C = structure.M, structure.K, structure.damped().C
        return cls(M, K, structure.sectors, C, contacts, structure.ties, aerodynamics, structure.units)

    @property
    def structure(self) -> Structure:
        """Its terms with those of the flow, and the ties."""
        terms = self._terms()
        return Structure(terms["M"], terms["K"], terms["C"], sectors=self.sectors, ties=self.ties, units=self.units)

    def model(self, nodal_diameter: int, comm: MPI.Comm | None = None) -> Model:
        """The equations of one sector in a wave of this many nodal diameters (negative: backward). Collective."""
        terms = self._terms(period_of(_index(nodal_diameter), self.sectors))
        units = self.structure.unit_system
        return Model(terms["M"], terms["K"], terms["C"], self.contacts, comm, self.sectors, nodal_diameter, units=units)

    def wheel(self, comm: MPI.Comm | None = None, changes: Mapping[str, Sequence[Any]] | None = None) -> Model:
        """The whole wheel, sector after sector, N n_dof dofs; ranks take whole sectors. Collective.

        Parameters
        ----------
        changes : {"K": N matrices (n_dof, n_dof), ...}, optional
            Added to a term of each sector in turn: a mistuned wheel.
        """
        for letter, own in (changes or {}).items():
            _check_changes(letter, own, self.sectors, self.n_dof)
        added = {
            letter: sp.csr_matrix(sp.block_diag([real_csr(A) for A in own])) for letter, own in (changes or {}).items()
        }
        around = [contact.around(self.sectors) for contact in self.contacts]
        return self.structure.around(added=added).model(around, comm)

    def _terms(self, period: int | None = None) -> dict[str, Any]:
        """M, K and C with what the flow adds."""
        terms = {letter: getattr(self, letter) for letter in "MKC"}
        added = self.aerodynamics.terms(self.M, period) if self.aerodynamics else {}
        return {letter: with_terms(A, added.get(letter, {})) for letter, A in terms.items()}

    def wave(self, q: npt.ArrayLike, nodal_diameter: int, order: int = 1) -> npt.NDArray[np.complex128]:
        """Complex amplitudes (N, n_dof) of harmonic `order` in all sectors from those of sector 0, (n_dof,)."""
        return wave(self._motion(q), _index(nodal_diameter, order), self.sectors)

    def around(self, mode: LinearMode, nodal_diameter: int) -> LinearMode:
        """A wave of one sector as a mode of the wheel (unit modal mass of the wheel when undamped)."""
        self._motion(mode.shape)
        return wave_mode(mode, _index(nodal_diameter), self.sectors)

    def expand(self, q: npt.ArrayLike, nodal_diameter: int, order: int = 1) -> npt.NDArray[np.complex128]:
        """Complex amplitudes (n_full,) of harmonic `order` on the dofs with both faces, from those (n_dof,)."""
        motion, theta = self._motion(q), 2 * np.pi * _index(nodal_diameter, order) / self.sectors
        return in_wave(self.ties, motion, theta) if self.ties else motion

    def _motion(self, q: npt.ArrayLike) -> npt.NDArray[np.complex128]:
        """Complex amplitudes (n_dof,) of sector 0."""
        try:
            motion = np.asarray(q, dtype=complex)
        except (TypeError, ValueError):
            motion = np.full((), np.nan + 0j)
        if motion.shape != (self.n_dof,) or not np.isfinite(motion).all():
            given = f"{np.shape(q)}{'' if np.isfinite(motion).all() else ', not finite'}"
            fix = "give one number for each dof of one sector"
            raise InputError("the amplitudes do not fit the sector", None, given, f"({self.n_dof},), finite", fix)
        return motion


def wave(q: npt.ArrayLike, index: int, sectors: int) -> npt.NDArray[np.complex128]:
    """Complex amplitudes (N, n_dof) in all sectors of a wave with this spatial index, from those of sector 0."""
    turns = np.arange(sectors) * index % sectors
    return np.asarray(np.exp(-2j * np.pi * turns / sectors)[:, None] * np.asarray(q, dtype=complex))


def wave_mode(mode: LinearMode, nodal_diameter: int, sectors: int) -> LinearMode:
    """A wave of one sector as a mode of the wheel (unit modal mass of the wheel when undamped)."""
    phi = wave(mode.shape + 1j * mode.imaginary, nodal_diameter, sectors).ravel() / np.sqrt(sectors)
    return LinearMode(mode.omega, mode.beta, phi.real.copy(), phi.imag.copy())


def _index(nodal_diameter: int, order: int = 1) -> int:
    """Spatial index of a harmonic of a wave."""
    diameters, harmonic = whole(nodal_diameter), whole(order)
    if diameters is None or harmonic is None:
        given, expected = f"nodal_diameter={nodal_diameter!r}, order={order!r}", "a whole number each"
        raise InputError("a wave has a whole number of nodal diameters", None, given, expected, "round them")
    return diameters * harmonic


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
