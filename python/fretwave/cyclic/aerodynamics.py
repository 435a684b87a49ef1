"""Aerodynamic influence coefficients: what the flow around the blades does to their vibration.

The blade of sector j feels the motion q of its neighbours as the force

    f_j = sum_k L_k q_{j+k}        (complex amplitudes of e^{i omega t}),

L_k the influence coefficient of the blade k places ahead. In a wave of ND nodal diameters, q_{j+k} = q_j e^{-i k theta}
(`fretwave.cyclic.sector`), this is f = L(theta) q with

    L(theta) = sum_k L_k e^{-i k theta},        L_k = 1/N sum_theta L(theta) e^{i k theta},

the travelling-wave coefficient (Hanamura, Tanaka & Yamaguchi 1980; Crawley 1988). In a period the flow works
pi Im L |q|^2 on the blade: Im L > 0 feeds the vibration. L_k holds at one frequency omega, where i x is x' / omega, so

    -L_k q  =  (-Re L_k) x + (-Im L_k / omega) x':

one term in K and one in C for each k, of real matrices, like any other coupling between sectors, valid for a wave on
one sector and for a wheel of any mistuning. They are not reciprocal (L_-k is not L_k): the flow is not at rest, and it
may feed a forward wave and damp the backward one. Higher harmonics, and the mean's way from a state at rest, feel the
same springs and dampers; the state at rest itself is that without them.

References
----------
Hanamura, Y., Tanaka, H., Yamaguchi, K., A simplified method to measure unsteady forces acting on the vibrating blades
in cascade, Bull. JSME 23, 1980. Crawley, E. F., in AGARD-AG-298 vol. 2, ch. 19, 1988.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from operator import index
from typing import Optional

import numpy as np
import scipy.sparse as sp

from ..errors import InputError
from ..given import numbers, real, whole
from ..model.sectors import Term, by_sector, check_number, check_wave, real_csr
from ..model.wheel_matrix import Matrix, as_matrix
from .engine_order import folded

#: {k: what the flow adds on the sector k places ahead}.
Added = dict[int, Matrix]

#: Coefficients below this share of the largest are rounding of the transform, not a coupling.
NOTHING = 1e-13


@dataclass(frozen=True)
class Aerodynamics:
    """Influence coefficients and what they act on.

    Attributes
    ----------
    influence : {k: complex}
        L_k, of the blade k places ahead.
    omega : float [rad/s]
        Frequency at which they hold.
    dof : int, optional
        Of a sector, which the force acts on and whose motion causes it: L_k [force/length]. Without it they are modal,
        L_k [1/s^2]: forces distributed like the inertia of the sector, L_k M x_{j+k}, so that L(theta) is the force on
        a mode of unit modal mass in unit modal motion, whatever its shape.
    """

    influence: Mapping[int, complex]
    omega: float
    dof: Optional[int] = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "omega", _frequency(self.omega))
        for k, L in self.influence.items():
            if whole(k) is None:
                what, fix = "an influence coefficient is of no blade", "give {0: own, 1: of the next blade, ...}"
                raise InputError(what, None, repr(k), "a whole number of places ahead", fix)
            numbers(f"influence coefficient {k}", [getattr(L, "real", L), getattr(L, "imag", 0.0)], (2,))

    def __repr__(self) -> str:
        acts = "modal" if self.dof is None else f"on dof {self.dof}"
        return f"Aerodynamics({len(self.influence)} coefficients, {acts}, at {self.omega:.6g} rad/s)"

    @classmethod
    def from_damping(cls, ratios: Mapping[int, float], sectors: int, omega: float) -> Aerodynamics:
        """Modal coefficients that give a wave of each nodal diameter its damping ratio at `omega`, and no stiffness.

        A modal viscous damper: L(theta) = -2 i zeta omega^2. Nodal diameters that are not named have none.
        """
        sectors, omega = check_number(sectors), _frequency(omega)
        wave = np.zeros(sectors, dtype=complex)
        for place, ratio in _by_wave(ratios, sectors).items():
            wave[place] = -2j * ratio * omega**2
        parts = np.fft.ifft(wave)  # 1/N sum_d L(theta_d) e^{+2 pi i k d / N}
        largest = np.abs(parts).max()
        kept = [k for k in range(sectors) if abs(parts[k]) > NOTHING * largest]
        return cls({folded(k, sectors): complex(parts[k]) for k in kept}, omega)

    def wave(self, nodal_diameter: int, sectors: int) -> complex:
        """L(theta) of a wave, [force/length] at a dof, [1/s^2] modal."""
        sectors, nodal_diameter = check_wave(sectors, nodal_diameter)
        theta = 2 * np.pi * nodal_diameter / sectors
        return complex(sum(L * np.exp(-1j * k * theta) for k, L in self.influence.items()))

    def damping(self, nodal_diameter: int, sectors: int, omega: float) -> float:
        """-Im L(theta) / (2 omega^2) of a wave that moves at another frequency omega [rad/s], where its terms hold L.

        The damping ratio of a mode of unit modal mass. What the flow does alike in both directions damps as 1 / omega,
        what it does unlike (Re L_k - Re L_-k) as 1 / omega^2.
        """
        moved = {k: complex(L.real, L.imag * omega / self.omega) for k, L in self.influence.items()}
        return -replace(self, influence=moved).wave(nodal_diameter, sectors).imag / (2 * omega**2)

    def terms(self, M: Term, period: int | None = None) -> dict[str, Added]:
        """{"K": {k: (n_dof, n_dof)}, "C": {k: ...}} to be added to those of a sector.

        Parameters
        ----------
        M : (n_dof, n_dof) or {k: ...}
            Mass of the sector.
        period : int, optional
            Of one wave: blades so many places apart move alike in all its harmonics, and their terms are one.
        """
        added: dict[str, Added] = {"K": {}, "C": {}}
        for k, L in ((index(k), L) for k, L in self.influence.items()):
            for ahead, shape in self._shape(M).items():
                place = k + ahead if period is None else folded(k + ahead, period)
                for letter, value in (("K", -L.real), ("C", -L.imag / self.omega)):
                    if value:
                        add_to(added[letter], place, value * shape)
        return added

    def _shape(self, M: Term) -> Added:
        """What the force is distributed like."""
        mass = {k: real_csr(part) for k, part in by_sector(M).items()}
        if self.dof is None:
            return mass
        n = mass[0].shape[0]
        dof = whole(self.dof)
        if dof is None or not 0 <= dof < n:
            raise InputError("no such dof for aerodynamic forces", None, self.dof, f"0 .. {n - 1}", "name a dof")
        return {0: sp.csr_matrix(([1.0], ([dof], [dof])), (n, n))}


def _frequency(given: object) -> float:
    """Above zero [rad/s]."""
    found = real(given)
    if found is None or found <= 0:
        raise InputError("influence coefficients need a frequency", None, repr(given), "> 0 rad/s", "give omega")
    return found


def _by_wave(ratios: Mapping[int, float], sectors: int) -> dict[int, float]:
    """Ratios by nodal diameters modulo N.

    Raises
    ------
    InputError
        A number of nodal diameters is not whole, a ratio is no number, or two of one wave differ.
    """
    found: dict[int, float] = {}
    for nodal_diameter, given in ratios.items():
        ratio = float(numbers("damping ratio", given))
        place = check_wave(sectors, nodal_diameter)[1] % sectors
        if found.get(place, ratio) != ratio:
            what, measured = "one wave has two damping ratios", f"{sorted(ratios)} of {sectors} sectors"
            raise InputError(what, None, measured, f"one of each {sectors} nodal diameters apart", "leave one out")
        found[place] = ratio
    return found


def period_of(nodal_diameter: int, sectors: int) -> int:
    """Sectors after which a wave repeats itself in phase, in every harmonic."""
    return sectors // math.gcd(nodal_diameter, sectors)


def add_to(parts: Added, k: int, matrix: sp.csr_matrix) -> None:
    """Add a matrix to the term of the sector k places ahead."""
    parts[k] = as_matrix(parts[k] + matrix) if k in parts else matrix


def with_terms(given: Term | None, added: Mapping[int, sp.csr_matrix]) -> Term | None:
    """A term as `fretwave.Model` takes it, plus further parts."""
    if not added:
        return given
    total = {k: as_matrix(part) for k, part in by_sector(given).items()}
    for k, part in added.items():
        add_to(total, k, part)
    total.setdefault(0, 0 * next(iter(total.values())))
    return total
