"""Linear modes of a whole wheel to start from: waves of the tuned one, and modes of a mistuned one that are like them.

Of a double mode of a tuned wheel, motions A phi + B conj(phi) with any A and B solve the linear equations. A travelling
wave has B = 0, a standing one A = B e^{i alpha}. Nonlinear modes lose rank there at small amplitude unless the other
one of the pair is avoided (`fretwave.NonlinearMode`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Optional

import numpy as np

from ..arrays import Array, Complex
from ..errors import InputError
from ..given import not_negative, place, whole
from ..kinds import of_their_kinds
from ..model.modes import LinearMode
from ..model.sectors import check_number, check_wave
from ..model.wheel_matrix import Matrix, WheelMatrix
from ..post.largest import largest
from .sector import Sector, wave_mode

#: Modes of a mistuned wheel whose shares in a tuned wave differ by less are alike in it: the lower one is taken.
ALIKE = 1e-3


@of_their_kinds
def travelling_wave(mode: LinearMode, nodal_diameter: int, sectors: int) -> tuple[LinearMode, Optional[Complex]]:
    """A wave of a tuned sector as a mode of the wheel, and the one that runs the other way, to be avoided.

    Parameters
    ----------
    mode : LinearMode
        Of one sector in this wave.

    Returns
    -------
    LinearMode, (N n_dof,) complex or None
        None where the wave is no double mode (0 and N/2 nodal diameters).
    """
    sectors, nodal_diameter = check_wave(check_number(sectors), nodal_diameter)
    phi = wave_mode(mode, nodal_diameter, sectors)
    return phi, None if _single(nodal_diameter, sectors) else phi.shape - 1j * phi.imaginary


@of_their_kinds
def standing_wave(
    mode: LinearMode, nodal_diameter: int, sectors: int, dof: int, crest: int = 0
) -> tuple[LinearMode, Optional[Complex]]:
    """The standing wave with the crest of a dof in one sector, and the one a quarter of its length off, to be avoided.

    Parameters
    ----------
    mode : LinearMode
        Of one sector in this wave.
    dof : int
        Of a sector.
    crest : int
        The sector.

    Raises
    ------
    InputError
        There is no such dof or sector, or the dof does not move.
    """
    sectors, nodal_diameter = check_wave(check_number(sectors), nodal_diameter)
    dof, crest = place("dof", dof, len(mode.shape)), place("sector", crest, sectors)
    wave = wave_mode(mode, nodal_diameter, sectors)
    if _single(nodal_diameter, sectors):
        return wave, None
    phi = wave.shape + 1j * wave.imaginary
    there = phi[crest * len(mode.shape) + dof]
    if not there:
        raise InputError("the dof has no crest", f"dof {dof}", 0.0, "a motion in this wave", "choose one that moves")
    phi *= np.sqrt(2) * abs(there) / there  # real where its crest shall be
    return LinearMode(mode.omega, mode.beta, phi.real.copy(), np.zeros(len(phi))), phi.imag + 0j


def most_alike(modes: Sequence[LinearMode], wave: LinearMode, M: Matrix | Sector) -> LinearMode:
    """Of modes of a mistuned wheel the one with the largest share in a tuned wave (`Sector.around`) and its pair.

    Parameters
    ----------
    M : (N n_dof, N n_dof) sparse, or Sector
        Mass of the wheel [mass].
    """
    if isinstance(M, Sector):
        M = WheelMatrix(M.M, M.sectors)
    phi = wave.shape + 1j * wave.imaginary
    shares = np.array([abs(phi.conj() @ (M @ mode.shape)) ** 2 for mode in modes])
    return modes[largest(shares, ALIKE)]


def deviations(sectors: int, standard_deviation: float, seed: int = 1) -> Array:
    """Relative deviations (N,) of the sectors: normally distributed (PCG64), less their mean.

    Without its mean a pattern leaves the family's mean frequency, to first order, where it was.

    Raises
    ------
    InputError
        Fewer than two sectors, a negative standard deviation or seed.
    """
    sectors = check_number(sectors)
    standard_deviation, number = not_negative("standard_deviation", standard_deviation), whole(seed)
    if number is None or number < 0:
        raise InputError("there is no such seed", None, repr(seed), "a whole number >= 0", "choose one of these")
    drawn = np.random.Generator(np.random.PCG64(number)).standard_normal(sectors)
    return np.asarray(standard_deviation * (drawn - drawn.mean()))


def _single(nodal_diameter: int, sectors: int) -> bool:
    return 2 * nodal_diameter % sectors == 0
