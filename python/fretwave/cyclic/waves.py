"""Linear waves of a sector, contact stuck and sliding: whence interface modes and errors of a reduction come."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Optional, Tuple

import numpy as np
from mpi4py import MPI

from ..arrays import Array, Complex, Indices
from ..model.compared import off_by
from ..model.contact import Contact, in_limit
from ..model.modes import linear_modes
from .sector import Sector

#: Nodal diameters, and the state of the contact.
Wave = Tuple[int, str]

STATES = ("stuck", "sliding")


@dataclass(frozen=True)
class WaveError:
    """Lowest frequencies of the reduced sector against those of the unreduced one.

    Attributes
    ----------
    nodal_diameter : int
    state : {"stuck", "sliding"}
        All pairs closed; sliding ones without tangential force (free, where the law has no normal direction).
    gave_interface_modes : bool or None
        This nodal diameter did; None where the faces are whole.
    full_hz, reduced_hz : (count,) [Hz]
    relative : (count,)
        reduced / full - 1, not negative beyond rounding (Rayleigh-Ritz); NaN of rigid motions.
    """

    nodal_diameter: int
    state: str
    gave_interface_modes: Optional[bool]
    full_hz: Array
    reduced_hz: Array
    relative: Array

    def __repr__(self) -> str:
        return f"WaveError({self.line()})"

    @property
    def largest(self) -> float:
        """Largest relative error in magnitude."""
        return float(np.nanmax(np.abs(self.relative), initial=0.0))

    def line(self) -> str:
        """For a log."""
        source = {None: "", True: " (gave interface modes)", False: " (gave no interface modes)"}
        off = off_by(self.full_hz.tolist(), self.relative.tolist())
        return f"{self.nodal_diameter} nodal diameters, {self.state}{source[self.gave_interface_modes]}: {off}"


class SectorWaves:
    """Linear waves of a sector, stuck and sliding; each is computed by one rank and kept."""

    def __init__(
        self, sector: Sector, comm: MPI.Comm, diameters: tuple[int, ...], contacts: Sequence[Contact] = ()
    ) -> None:
        self.sector, self.comm, self.diameters, self.contacts = sector, comm, diameters, list(contacts)
        self._hz: dict[Wave, Array] = {}

    def hz(self, wanted: Sequence[Wave], count: int) -> Mapping[Wave, Array]:
        """Frequencies (count,) [Hz] on every rank. Collective."""
        self._solve([w for w in wanted if len(self._hz.get(w, ())) < count], count, np.empty(0, dtype=np.intp))
        return {wave: self._hz[wave][:count] for wave in wanted}

    def on(self, dofs: Indices, count: int) -> Array:
        """Motions (n, 2 n_waves) of some dofs of the uncut sector: real and imaginary parts, together of length 1."""
        shapes = self._solve([(d, state) for d in self.diameters for state in STATES], count, dofs)
        columns = []
        for phi in shapes:
            columns += [part / np.linalg.norm(phi) for part in (phi.real, phi.imag)]
        return np.column_stack(columns)

    def _solve(self, wanted: Sequence[Wave], count: int, dofs: Indices) -> list[Complex]:
        """Solves each wave on one rank; shapes on the dofs, in the order wanted, on every rank. Collective."""
        mine = [self._one(wave, count, dofs) for wave in wanted[self.comm.rank :: self.comm.size]]
        parts = self.comm.allgather(mine)
        found = [parts[k % self.comm.size][k // self.comm.size] for k in range(len(wanted))]
        self._hz.update({wave: hz for wave, (hz, _) in zip(wanted, found)})
        return [phi for _, shapes in found for phi in shapes]

    def _one(self, wave: Wave, count: int, dofs: Indices) -> tuple[Array, list[Complex]]:
        diameter, state = wave
        sector = replace(self.sector, contacts=in_limit(self.sector.contacts, state))
        with sector.model(diameter, MPI.COMM_SELF) as model:
            modes = linear_modes(model, count, "stuck")
        shapes = [sector.expand(m.shape + 1j * m.imaginary, diameter)[dofs] for m in modes]
        return np.array([mode.frequency_hz for mode in modes]), shapes
