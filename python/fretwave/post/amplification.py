"""Largest forced response over frequency, from linear modes. NumPy alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Array, Complex

#: Points about each natural frequency, out to so many half-power widths; rounds of a finer search about the largest.
POINTS, WIDTHS, ROUNDS, FINE = 33, 3.0, 6, 11
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


def largest_response(family: Family, force: Complex, between: Array) -> Largest:
    """Over all places and the frequencies between two [rad/s], near the natural ones there and at both ends."""
    own = np.real(np.diagonal(family.damping))
    inside = (family.omega >= between[0]) & (family.omega <= between[1])
    about, half = family.omega[inside], 0.5 * own[inside]
    grid = (about[:, None] + half[:, None] * np.linspace(-WIDTHS, WIDTHS, POINTS)).ravel()
    grid = np.unique(np.concatenate([np.clip(grid, *between), between]))
    for _ in range(ROUNDS):
        size = np.abs(family.response(force, grid))
        top, place = divmod(int(np.argmax(size)), size.shape[1])
        ends = grid[max(top - 1, 0)], grid[min(top + 1, len(grid) - 1)]
        best = Largest(float(size[top, place]), float(grid[top] / (2 * np.pi)), place)
        grid = np.linspace(*ends, FINE)
    return best
