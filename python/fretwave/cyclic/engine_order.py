"""Excitation by engine orders: which wave a distortion of the flow drives.

A distortion that stands still with r maxima around the wheel, cos(r phi), is met by sector j at
phi = j alpha - Omega t, alpha = 2 pi / N, where the rotor turns against the sectors' numbers. The force on sector j is
then cos(r Omega t - r j alpha): of frequency r Omega and, as `fretwave.cyclic.sector` counts waves, of spatial index r.
It cannot be told from that of r - N, r - 2 N, ... nodal diameters: r up to N/2 drives the forward wave of r nodal
diameters, r from N/2 to N the backward wave of N - r, and so on. Where the rotor turns with the numbers,
phi = j alpha + Omega t, all waves are mirrored: the engine order is given as negative.
"""

from __future__ import annotations

import math
from operator import index


def folded(number: int, sectors: int) -> int:
    """Nodal diameters -N/2 < ND <= N/2 of the wave with this spatial index, negative for a backward wave."""
    around = index(sectors)
    place = index(number) % around
    return place - around if 2 * place > around else place


def waves_of(sectors: int) -> list[int]:
    """Nodal diameters of all waves of a wheel, -N/2 < ND <= N/2, ascending."""
    return list(range(-((sectors - 1) // 2), sectors // 2 + 1))


def speed_rpm(omega: float, order: int) -> float:
    """Speed [rev/min] at which the engine order excites the angular frequency [rad/s]."""
    return 30 * omega / (math.pi * abs(order))
