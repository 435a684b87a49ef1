"""Largest peak of a forced response over frequency, from linear modes. NumPy alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Optional

import numpy as np
import numpy.typing as npt

from ..arrays import Array, Complex
from .largest import largest

#: Points about each natural frequency, out to so many half-power widths; rounds of a finer search about the largest.
POINTS, WIDTHS, ROUNDS, FINE = 33, 3.0, 6, 11
#: Points nearer to each other than this share of the narrowest half-power width differ by rounding.
APART = 0.01
#: Peaks on the first grid below this share of the largest are lower than it.
NEAR = 0.98
#: Frequencies solved at once.
AT_ONCE = 64


@dataclass(frozen=True)
class Family:
    """Modes of unit modal mass.

    Attributes
    ----------
    omega : (R,) [rad/s]
    places : (R, n)
        Shapes at the places where the force acts and the response is sought.
    damping : (R, R) [1/s]
        phi_r^H C phi_s: modes near each other are coupled by it.
    """

    omega: Array
    places: Complex
    damping: Complex

    def response(self, force: Complex, omega: Array) -> Complex:
        """Amplitudes (n_omega, n) [length] of forces (n,) at frequencies [rad/s]."""
        drive = self.places.conj() @ force
        found = []
        for w in np.array_split(np.asarray(omega), -(-len(omega) // AT_ONCE)):
            Z = 1j * w[:, None, None] * self.damping
            diagonal = np.arange(len(self.omega))
            Z[:, diagonal, diagonal] += self.omega**2 - w[:, None] ** 2
            found.append(np.linalg.solve(Z, np.broadcast_to(drive, (len(w), len(drive)))[..., None])[..., 0])
        return np.asarray(np.concatenate(found) @ self.places)


@dataclass(frozen=True)
class Largest:
    """The largest amplitude [length], where and at which frequency [Hz]."""

    amplitude: float
    hz: float
    place: int


def largest_peak(family: Family, force: Complex, between: Array) -> Optional[Largest]:
    """Of all places, a maximum over frequency between two [rad/s]; None where the responses have none there.

    The flank of a peak beyond them is none, however high it is at the end.
    """
    grid = _grid(family, between)
    size = np.abs(family.response(force, grid))
    inner = (size[1:-1] > size[:-2]) & (size[1:-1] >= size[2:])
    tops = np.where(inner, size[1:-1], 0.0).max(axis=1)
    if not inner.any():
        return None
    found = [_refined(family, force, grid[k : k + 3], inner[k]) for k in np.flatnonzero(tops > NEAR * tops.max())]
    return max(found, key=lambda peak: peak.amplitude)


def _grid(family: Family, between: Array) -> Array:
    """Both ends, and frequencies about the natural ones between them or near them [rad/s]."""
    half = 0.5 * np.real(np.diagonal(family.damping))
    near = (family.omega + WIDTHS * half >= between[0]) & (family.omega - WIDTHS * half <= between[1])
    grid = (family.omega[near, None] + half[near, None] * np.linspace(-WIDTHS, WIDTHS, POINTS)).ravel()
    grid = np.unique(grid[(grid > between[0]) & (grid < between[1])])
    least = APART * half[near].min(initial=np.inf)
    steps = np.floor((grid - between[0]) / least) if len(grid) else grid
    return np.concatenate([between[:1], grid[np.unique(steps, return_index=True)[1]], between[1:]])


def _refined(family: Family, force: Complex, around: Array, places: npt.NDArray[np.bool_]) -> Largest:
    """The largest response of places (n,) with a maximum in the midst of three frequencies [rad/s]."""
    grid = around
    for _ in range(ROUNDS):
        size = np.where(places, np.abs(family.response(force, grid)), 0.0)
        top = int(np.argmax(size.max(axis=1)))
        place = largest(size[top])
        best = Largest(float(size[top, place]), float(grid[top] / (2 * np.pi)), place)
        grid = np.linspace(grid[max(top - 1, 0)], grid[min(top + 1, len(grid) - 1)], FINE)
    return best
