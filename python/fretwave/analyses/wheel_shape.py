"""What a motion of a whole wheel looks like around the wheel, in numbers.

Of the fundamental amplitudes a_j (complex) of one dof in all sectors j = 0 .. N - 1, and the fundamental q of all:

* wave content c_n = (1/N) sum_j a_j e^{2 pi i n j / N}, as a wave of n nodal diameters is a_j = c_n e^{-2 pi i n j / N}
  (`fretwave.cyclic`); sum_n |c_n|^2 is the mean of |a_j|^2;
* participation ratio (sum |a_j|^2)^2 / (N sum |a_j|^4): 1 for a travelling wave, 2/3 for a standing one, 1/N when one
  sector moves alone (Bell and Dean, Discuss. Faraday Soc. 50, 1970);
* amplification max |a_j| / b, with b the same in the tuned travelling linear wave that has the modal energy of this
  motion, q^H M q: 1 for that wave, sqrt(2) for a standing one, at most sqrt(N) when a_j carries all of the energy.
  (For the *forced* response to an engine order Whitehead, J. Mech. Eng. Sci. 8, 1966, has (1 + sqrt(N)) / 2.)
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from ..columns import Column
from ..harmonic_motion import complex_amplitudes
from .context import AnalysisContext

Complex = npt.NDArray[np.complex128]

WHEEL = (
    Column("amplification", "1", "largest amplitude of a sector over that of the tuned wave of the same energy"),
    Column("participation", "1", "participation ratio of the sectors"),
    Column("largest_sector", "1", "sector that moves most", "i"),
    Column("diameters", "1", "nodal diameters of the largest wave, negative backward", "i"),
    Column("diameters_share", "1", "share of the largest wave in the sum of squares"),
    Column("unfolding", "1", "force on the avoided mode of a double one, of the inertia force"),
)


def wave_content(a: Complex) -> Complex:
    """c_n of n = 0 .. N - 1, of sectors' amplitudes along the last axis."""
    return np.asarray(np.fft.ifft(a))


def signed(n: int, sectors: int) -> int:
    """Nodal diameters of the wave with spatial index n: backward ones negative, N/2 positive."""
    return n - sectors if 2 * n > sectors else n


def participation(a: Complex) -> float:
    """Participation ratio."""
    square = np.abs(a) ** 2
    return float(square.sum() ** 2 / (len(a) * (square**2).sum()))


class WheelShape:
    """The columns :data:`WHEEL` of a table.

    Parameters
    ----------
    context
        Of an analysis on a wheel.
    dof : str
        Observed in each sector.
    tuned_amplitude : float
        Of that dof in each sector, in the tuned travelling wave of unit modal mass.
    """

    def __init__(self, context: AnalysisContext, dof: str, tuned_amplitude: float) -> None:
        assert context.case.wheel is not None
        self.wheel, self.M, self.tuned = context.case.wheel, context.case.M, tuned_amplitude
        self.dof = self.wheel.sector.dof(dof)

    def row(self, problem: Any, y: Any, coefficients: Any) -> dict[str, Any]:
        """Of one point; on ranks without coefficients nothing. Collective."""
        unfolding = problem.unfolding(y)
        if coefficients is None:
            return {}
        q = complex_amplitudes(problem.harmonics.labels, coefficients)[1]
        a = self.wheel.by_sector(q)[:, self.dof]
        content = np.abs(wave_content(a)) ** 2
        most = int(np.argmax(content))
        return {
            "amplification": float(np.abs(a).max() / (self.tuned * np.sqrt(np.real(q.conj() @ (self.M @ q))))),
            "participation": participation(a),
            "largest_sector": int(np.argmax(np.abs(a))),
            "diameters": signed(most, self.wheel.sectors),
            "diameters_share": float(content[most] / content.sum()),
            "unfolding": float(np.max(np.abs(unfolding), initial=0.0)),
        }
