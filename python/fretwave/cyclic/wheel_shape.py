"""What a motion of a whole wheel looks like around the wheel, in numbers.

Of the fundamental amplitudes a_j (complex) of one dof in all sectors j = 0 .. N - 1, and the fundamental q of all:

* wave content c_n = (1/N) sum_j a_j e^{2 pi i n j / N}, as a wave of n nodal diameters is a_j = c_n e^{-2 pi i n j / N}
  (`fretwave.cyclic.sector`); sum_n |c_n|^2 is the mean of |a_j|^2;
* participation ratio (sum |a_j|^2)^2 / (N sum |a_j|^4): 1 for a travelling wave, 2/3 for a standing one, 1/N when one
  sector moves alone (Bell and Dean, Discuss. Faraday Soc. 50, 1970);
* amplification max |a_j| / b, with b the same in the tuned travelling linear wave that has the modal energy of this
  motion, q^H M q: 1 for that wave, sqrt(2) for a standing one, at most sqrt(N) when a_j carries all of the energy.
  (For the *forced* response to an engine order Whitehead, J. Mech. Eng. Sci. 8, 1966, has (1 + sqrt(N)) / 2.)
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ..arrays import Complex
from ..given import place
from ..model.sectors import Given, check_number
from ..model.wheel_matrix import WheelMatrix, as_matrix
from ..post.largest import largest
from ..post.wave_content import participation, wave_content
from .engine_order import folded

if TYPE_CHECKING:
    from ..model.modes import LinearMode
    from .sector import Sector


class WheelShape:
    """Reads wheels' fundamentals; see this module.

    Parameters
    ----------
    M : (N n_dof, N n_dof) sparse
        Mass of the wheel [mass].
    sectors : int
        N.
    dof : int
        Of a sector; observed in each.
    tuned_amplitude : float
        Of that dof in each sector, in the tuned travelling wave of unit modal mass.

    Examples
    --------
    >>> shape = WheelShape(np.eye(6), 6, 0, 1 / np.sqrt(6))
    >>> told = shape(np.cos(2 * np.pi * np.arange(6) / 6))  # a standing wave of one nodal diameter
    >>> round(told["participation"], 12), told["diameters"], round(told["amplification"], 12)
    (0.666666666667, 1, 1.414213562373)
    """

    def __init__(self, M: Given | WheelMatrix, sectors: int, dof: int, tuned_amplitude: float) -> None:
        self.M, self.sectors = as_matrix(M), check_number(sectors)
        self.dof = place("dof", dof, self.M.shape[0] // self.sectors)
        self.tuned_amplitude = tuned_amplitude

    @classmethod
    def of(cls, sector: Sector, dof: int, wave: LinearMode) -> WheelShape:
        """Against a linear wave of the tuned sector."""
        dof = place("dof", dof, len(wave.shape))
        size = abs(wave.shape[dof] + 1j * wave.imaginary[dof])
        return cls(WheelMatrix(sector.M, sector.sectors), sector.sectors, dof, float(size / np.sqrt(sector.sectors)))

    def amplitudes(self, q: npt.ArrayLike) -> Complex:
        """Of the observed dof in all sectors (N,), from the fundamental q (N n_dof,)."""
        return np.asarray(np.asarray(q).reshape(self.sectors, -1)[:, self.dof], dtype=complex)

    def __call__(self, q: npt.ArrayLike) -> dict[str, Any]:
        """amplification, participation, largest_sector, diameters (negative backward), diameters_share."""
        given = np.asarray(q)
        return self.told(self.amplitudes(q), float(np.real(given.conj() @ (self.M @ given))))

    def told(self, a: Complex, energy: float) -> dict[str, Any]:
        """The same of the observed dof's amplitudes (N,) and q^H M q."""
        content = np.abs(wave_content(a)) ** 2
        share = content / content.sum()
        most = largest(share)  # of a real shape forward and backward waves have equal shares
        return {
            "amplification": float(np.abs(a).max() / (self.tuned_amplitude * np.sqrt(energy))),
            "participation": participation(a),
            "largest_sector": largest(np.abs(a)),
            "diameters": folded(most, self.sectors),
            "diameters_share": float(share[most]),
        }

    def __repr__(self) -> str:
        return f"WheelShape(dof {self.dof} of {self.sectors} sectors, tuned amplitude {self.tuned_amplitude:.4g})"
