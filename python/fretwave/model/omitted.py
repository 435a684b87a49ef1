"""What a reduction leaves out: the component modes next to those that it keeps."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Optional

import numpy as np

from ..arrays import Array, Complex
from .sectors import Parts


@dataclass(frozen=True)
class OmittedModes:
    """Component modes that are no coordinates of a reduced model, of unit modal mass.

    With x the reduced coordinates of a harmonic of exponent s, one of them moves by eta and pulls at them:

        (omega^2 + s c + s^2) eta + (s^2 M + s C_from) x = 0,    f = (s^2 M^T + s C_onto^T) eta,

    for Craig and Bampton's stiffness couples no mode to anything. M decreases as fast as what the modes change, so
    that as many again as are kept stand for all.

    Attributes
    ----------
    omega : (p,) [rad/s]
    M : (p, n) [sqrt(mass)]
        What couples each to the n reduced coordinates.
    C_from, C_onto : (p, n) or None
        The same of the damping, of the mode's row and of its column.
    C : (p,) [1/s]
        Their own.
    ties : {k: (n, n_tied)}
        Of a sector tied to its neighbours, in a wave: n coordinates with both faces, x = sum_k ties[k] x_{j+k}.
    known : bool
        False: something is left out of which nothing is known.
    """

    omega: Array = field(default_factory=lambda: np.zeros(0))
    M: Array = field(default_factory=lambda: np.zeros((0, 0)))
    C_from: Optional[Array] = None
    C_onto: Optional[Array] = None
    C: Optional[Array] = None
    ties: Parts = field(default_factory=dict)
    known: bool = True

    def tied(self, ties: Parts) -> OmittedModes:
        """Those of a sector whose faces are tied."""
        return replace(self, ties=ties)

    def damped(self, stiffness: float, mass: float) -> OmittedModes:
        """With shares of the stiffness [s] and of the mass [1/s] added to the damping, as those of a structure."""
        if not self.known or not (stiffness or mass):
            return self
        own = stiffness * self.omega**2 + mass
        given = (self.C, self.C_from, self.C_onto)
        C, C_from, C_onto = (0.0 if A is None else A for A in given)
        return replace(self, C=C + own, C_from=C_from + mass * self.M, C_onto=C_onto + mass * self.M)

    def forces(self, s: complex, inertia: complex, x: Complex, turn: float = 0.0) -> Complex:
        """f (n,) at one harmonic.

        Parameters
        ----------
        inertia : what M is multiplied by, s^2 but for EPMC
        turn : angle between the motions of neighbouring sectors at this harmonic
        """
        motion = x
        if self.ties:
            motion = np.sum([np.exp(-1j * k * turn) * (T @ x) for k, T in self.ties.items()], axis=0)
        come = go = inertia * self.M
        own: Complex = self.omega**2 + inertia
        if self.C is not None and self.C_from is not None and self.C_onto is not None:
            come, go, own = come + s * self.C_from, go + s * self.C_onto, own + s * self.C
        f: Complex = go.T @ (-(come @ motion) / own)
        if not self.ties:
            return f
        tied: Complex = np.sum([np.exp(1j * k * turn) * (T.T @ f) for k, T in self.ties.items()], axis=0)
        return tied


#: Of a sector whose faces are reduced too, and of a whole wheel.
UNKNOWN = OmittedModes(known=False)
