"""Reduction of one sector of a wheel: contact and observation dofs, its two faces, and a few component modes.

The faces are kept whole, or move in interface modes: x_low = V a, x_high = R V b with the turn R of
`Sector.from_faces`. V spans what chosen travelling waves of the unreduced sector do on its low face, with the contact
stuck and sliding; a wave moves its high face alike, x_high = e^{-i theta} R x_low. So the reduced faces correspond as
they are, b_j = a_{j+1}, and waves that gave V lose nothing on the faces. Craig-Bampton then reduces the inner dofs.

References
----------
Castanier, M. P., Tan, Y.-C., Pierre, C., Characteristic constraint modes for component mode synthesis, AIAA J. 39(6),
2001 (modes of the whole structure in place of interface dofs).
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from mpi4py import MPI

from ..arrays import Array, Indices
from ..errors import InputError
from ..kinds import of_their_kinds
from ..model.contact import Contact
from ..model.frequency_error import RIGID_SHARE
from ..model.omitted import UNKNOWN
from ..model.reduction import Reduction, reduce
from ..model.sectors import Given, by_sector, check_number, check_wave, real_csr
from ..model.sizes import COMPARED_MODES, INTERFACE_TOLERANCE, INTERFACE_WAVES
from ..mpi.destroyable import Destroyable
from .interface import Interface
from .sector import Sector
from .waves import STATES, SectorWaves, WaveError


class SectorReduction(Destroyable):
    """x = P T x_r of one sector with both faces; made by `reduce_sector`.

    Reduced coordinates: kept dofs in ascending order, low face, high face, component modes.

    Attributes
    ----------
    M, K : (n_r, n_r)
        On every rank, symmetric, both faces free. C or None.
    low, high : (n_interface,)
        Matching coordinates of the faces, which correspond as they are.
    contacts : list of Contact
        B on the reduced coordinates.
    places : dict
        Reduced coordinate of each kept dof that is one: of the high face none when the wheel has an axis.
    unreduced : Sector
        Its faces tied.
    sectors : int
    diameters : tuple of int
        Nodal diameters that gave interface modes; empty when the faces are whole.
    omitted : OmittedModes
        Nothing is known of it where the faces are reduced too.
    component_hz : (n_modes,) [Hz]
        With kept dofs and faces held.
    wall_s : dict
        interface, total [s].
    """

    def __init__(self, full: Sector, P: sp.csc_matrix, faces: Interface, inner: Reduction, waves: SectorWaves) -> None:
        self._P, self._inner, self._waves = P, inner, waves
        self.unreduced, self.sectors, self.diameters = full, full.sectors, waves.diameters
        self.omitted = UNKNOWN if waves.diameters else inner.omitted
        self.M, self.K, self.C, self.component_hz = inner.M, inner.K, inner.C, inner.component_hz
        self.low: Indices = len(faces.kept) + np.arange(faces.n_interface)
        self.high: Indices = self.low + faces.n_interface
        self.places: dict[int, int] = faces.places()
        self.contacts = [self._on(contact) for contact in waves.contacts]
        self.wall_s: dict[str, float] = {}

    def __repr__(self) -> str:
        return f"SectorReduction({self.size} coordinates, {self.n_interface} a face, of {self.unreduced})"

    @property
    def size(self) -> int:
        """n_r, both faces included."""
        return len(self.K)

    @property
    def n_interface(self) -> int:
        """Coordinates of one face."""
        return len(self.low)

    @property
    def highest_component_hz(self) -> float:
        """Of the last component mode [Hz], 0 without one."""
        return self._inner.highest_component_hz

    def rows(self, B: Given) -> sp.csr_matrix:
        """B (n, n_r) on the reduced coordinates of rows (n, n_dof) that reach kept dofs alone.

        Raises
        ------
        InputError
            They reach another dof.
        """
        return self._inner.rows((real_csr(B) @ self._P).tocsc())

    def names(self, dofs: Sequence[str]) -> list[str]:
        """Names of the reduced coordinates: kept dofs keep theirs."""
        names = [""] * self.size
        for k in range(self.n_interface):
            names[self.low[k]], names[self.high[k]] = f"interface_{k + 1}", f"next_interface_{k + 1}"
        modes = len(self.component_hz)
        names[self.size - modes :] = [f"component_{k + 1}" for k in range(modes)]
        for dof, place in self.places.items():
            names[place] = dofs[dof]
        return names

    def faces(self) -> dict[str, Any]:
        """The faces of the reduced structure."""
        return {"low": self.low, "high": self.high}

    def sector(self) -> Sector:
        """The reduced sector, its faces tied; its `expand` gives the coordinates with both faces."""
        M, K, C = (None if A is None else sp.csr_matrix(A) for A in (self.M, self.K, self.C))
        return Sector.from_faces(M, K, self.low, self.high, self.sectors, C, self.contacts)

    def expand(self, x_r: npt.ArrayLike) -> Array:
        """Motion of all dofs, (n_dof,) or (n_dof, n), from coordinates (n_r,) or (n_r, n), real. Collective."""
        return np.asarray(self._P @ self._inner.expand(x_r))

    def project(self, f: npt.ArrayLike) -> Array:
        """Reduced load (n_r,) or (n_r, n) of forces on all dofs. Collective."""
        return self._inner.project(self._P.T @ np.asarray(f, dtype=float))

    def beyond(self, f: npt.ArrayLike) -> Array:
        """Static displacement of the inner dofs that no reduced coordinate has, as `Reduction.beyond`. Collective."""
        return np.asarray(self._P @ self._inner.beyond(self._P.T @ np.asarray(f, dtype=float)))

    def error(self, diameters: Iterable[int] | None = None, count: int = COMPARED_MODES) -> list[WaveError]:
        """Error of the lowest waves, stuck and sliding. Collective.

        Parameters
        ----------
        diameters : default: those that gave interface modes, and one far from them that gave none
        count : waves compared of each nodal diameter and state
        """
        chosen = self._compared() if diameters is None else [abs(d) for d in diameters]
        wanted = [(d, state) for d in dict.fromkeys(chosen) for state in STATES]
        small = SectorWaves(self.sector(), self._waves.comm, ())
        count = min(count, small.sector.n_dof)
        full, reduced = self._waves.hz(wanted, count), small.hz(wanted, count)
        found = {wave: self._relative(full[wave], reduced[wave]) for wave in wanted}
        gave = {d: d in self.diameters if self.diameters else None for d in chosen}
        return [WaveError(d, state, gave[d], *found[d, state]) for d, state in wanted]

    def destroy(self) -> None:
        """Free the component modes; the reduced matrices stay. Collective."""
        self._inner.destroy()

    def _on(self, contact: Contact) -> Contact:
        """The contact on reduced coordinates, which contain all that it touches."""
        rows = {k: self.rows(B) for k, B in by_sector(contact.B).items()}
        return replace(contact, pairs=replace(contact.pairs, B=rows))

    def _compared(self) -> list[int]:
        """Nodal diameters that gave interface modes, and the one farthest from all of them."""
        used = list(self.diameters)
        others = [d for d in range(self.sectors // 2 + 1) if d not in used]
        far = max(others, key=lambda d: min((abs(d - u) for u in used), default=0), default=None)
        return used if far is None else [*used, far]

    def _relative(self, full: Array, reduced: Array) -> tuple[Array, Array, Array]:
        reference = self.component_hz[0] if len(self.component_hz) else full[-1]
        rigid = reduced < RIGID_SHARE * reference
        return full, reduced, np.where(rigid, np.nan, reduced / np.where(full > 0, full, 1.0) - 1)


@of_their_kinds
def reduce_sector(
    M: Given,
    K: Given,
    low: npt.ArrayLike,
    high: npt.ArrayLike,
    sectors: int,
    C: Given | None = None,
    contacts: Sequence[Contact] = (),
    keep: npt.ArrayLike = (),
    axis: str | None = None,
    interface_diameters: Sequence[int] | None = None,
    interface_waves: int = INTERFACE_WAVES,
    interface_tolerance: float = INTERFACE_TOLERANCE,
    modes: int | None = None,
    highest_hz: float | None = None,
    comm: MPI.Comm | None = None,
) -> SectorReduction:
    """Reduce a sector cut out of a wheel. Collective.

    Parameters
    ----------
    M, K, C : (n_dof, n_dof) sparse or dense
        Of the sector alone, both faces free, the same on every rank.
    low, high, sectors, axis
        As `Sector.from_faces`.
    contacts : sequence of Contact
        B on the sector's n_dof dofs. What they touch is kept.
    keep : (n,) int
        Observation dofs.
    interface_diameters : sequence of int, optional
        Nodal diameters whose waves give the interface modes; without it the faces are kept whole.
    interface_waves : int
        Lowest waves of each of them, stuck and as many sliding.
    interface_tolerance : float
        Interface modes of singular values above this share of the largest are kept. Face dofs that a contact touches
        or that are to be kept stay coordinates of their own.
    modes, highest_hz
        Component modes, as in `reduce`.

    Raises
    ------
    InputError
        Faces that do not match, no such nodal diameter, or what `reduce` refuses.

    Notes
    -----
    Each wave is computed by one rank, waves side by side: the interface modes do not depend on the number of ranks.
    """
    start = time.perf_counter()
    comm = MPI.COMM_WORLD if comm is None else comm
    sectors = check_number(sectors)
    diameters = _checked(interface_diameters, sectors, interface_waves)
    full = Sector.from_faces(M, K, low, high, sectors, C, contacts, axis)
    waves = SectorWaves(full, comm, diameters, contacts)
    faces = Interface.of(sp.csr_matrix(M).shape[0], np.asarray(low), np.asarray(high), contacts, keep, axis)
    if interface_diameters is None:
        V = faces.whole()
    else:
        motions = waves.on(faces.low, interface_waves)
        V = comm.bcast(faces.basis(motions, interface_tolerance) if comm.rank == 0 else None)
    P, kept = faces.coordinates(V, sectors, axis)
    before = time.perf_counter() - start
    M_P, K_P, C_P = (None if A is None else sp.csr_matrix(P.T @ real_csr(A) @ P) for A in (M, K, C))
    inner = reduce(M_P, K_P, C_P, kept, modes, highest_hz, comm)
    found = SectorReduction(full, P, faces, inner, waves)
    found.wall_s = {"interface": before, "total": time.perf_counter() - start}
    return found


def _checked(diameters: Sequence[int] | None, sectors: int, waves: int) -> tuple[int, ...]:
    named = [] if diameters is None else list(diameters)
    given = tuple(dict.fromkeys(abs(check_wave(sectors, d)[1]) for d in named))
    if diameters is not None and (not given or max(given) > sectors // 2 or waves < 1):
        raise InputError(
            "there are no such waves for interface modes",
            None,
            f"{waves} of each of the nodal diameters {named}",
            f"1 or more, of nodal diameters from 0 to {sectors // 2}",
            "choose those that the motion has: the wave's, and its multiples by the harmonics",
        )
    return given
