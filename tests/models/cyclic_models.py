"""Sectors of small wheels that the cyclic tests share."""

from __future__ import annotations

import numpy as np
from models.core_models import CoupledLaw, LinearLaw
from scipy.optimize import brentq

import fretwave as fw

#: Lumped blisk of Laxalde et al. 2007 [kg, N/m]: disk, blade root, blade tip.
SECTORS = 24
MASSES = [1.2, 0.35, 0.25]
GROUND, NEIGHBOUR, BLADE_1, BLADE_2 = 6e5, 5e7, 1e6, 2e6


class MixedLaw(LinearLaw):
    """f = k u + c v + 0.3 u^2 + u^2 v: even and odd in turn, uses both arguments."""

    odd = False

    def force(self, u, v):
        return self.k * u + self.c * v + 0.3 * u**2 + u**2 * v

    def tangent(self, u, v):
        return (self.k + 0.6 * u + 2 * u * v)[:, None], (self.c + u**2)[:, None]


def blisk_stiffness(nodal_diameter: int, sectors: int = SECTORS) -> np.ndarray:
    """Closed form: the stiffness that a wave of this many nodal diameters sees."""
    disk = GROUND + BLADE_1 + 4 * NEIGHBOUR * np.sin(np.pi * nodal_diameter / sectors) ** 2
    return np.array([[disk, -BLADE_1, 0], [-BLADE_1, BLADE_1 + BLADE_2, -BLADE_2], [0, -BLADE_2, BLADE_2]])


def lumped_blisk(sectors: int = SECTORS, contacts=()) -> fw.Sector:
    """Disk masses tied to their neighbours, blades of two masses."""
    tie = NEIGHBOUR * np.diag([1.0, 0.0, 0.0])
    return fw.Sector(np.diag(MASSES), {0: blisk_stiffness(0) + 2 * tie, 1: -tie, -1: -tie}, sectors, None, contacts)


def jenkins_chain(sectors: int, k=1.0, kt=1.0, limit=1.0) -> fw.Sector:
    """Equal masses on ground springs, Jenkins elements between neighbours."""
    between = fw.Contact(
        "jenkins", {0: [[-1.0]], 1: [[1.0]]}, {"tangential_stiffness": kt, "friction_limit": limit}, "between"
    )
    return fw.Sector([[1.0]], [[k]], sectors, None, [between])


def kappa(a: float) -> complex:
    """Complex stiffness of a Jenkins element (kt = R = 1) at relative amplitude a."""
    if a <= 1:
        return 1.0 + 0j
    th = np.arccos(1 - 2 / a)
    return complex((th - np.sin(2 * th) / 2) / np.pi, 4 / (np.pi * a) * (1 - 1 / a))


def chain_crossings(flow: fw.Aerodynamics, nodal_diameter: int, sectors: int) -> list[tuple[float, float]]:
    """(a, omega) at which a wave of `jenkins_chain` with one harmonic and the flow has no damping.

    k + 4 s^2 kappa(2 a s) - omega^2 - sum (Re L_k + i omega / omega_ref Im L_k) e^{-i k theta} = 0, s = |sin theta/2|.
    """
    theta = 2 * np.pi * nodal_diameter / sectors
    s = abs(np.sin(theta / 2))
    waves = [sum(part(L) * np.exp(-1j * k * theta) for k, L in flow.influence.items()) for part in (np.real, np.imag)]

    def equation(a: float, omega: float) -> complex:
        return 1 + 4 * s**2 * kappa(2 * a * s) - omega**2 - waves[0] - 1j * omega / flow.omega * waves[1]

    def omega_at(a: float) -> float:
        return brentq(lambda omega: equation(a, omega).real, 1e-3, 10, xtol=1e-15)

    def work(a: float) -> float:
        return equation(a, omega_at(a)).imag

    grid = np.geomspace(0.5 / s * 1.0001, 500 / s, 400)
    changes = np.flatnonzero(np.diff(np.sign([work(a) for a in grid])))
    places = [brentq(work, grid[i], grid[i + 1], xtol=1e-14) for i in changes]
    return [(a, omega_at(a)) for a in places]


def rich_sector(sectors: int = 7) -> fw.Sector:
    """Three dofs, all terms coupled to both neighbours, gyroscopic damping, contacts of 1 and 3 components ahead."""
    rng = np.random.default_rng(11)
    tie = {name: scale * rng.standard_normal((3, 3)) for name, scale in (("M", 0.05), ("K", 0.4), ("C", 0.1))}
    own = {"M": np.diag([1.0, 0.5, 2.0]), "K": 4 * np.eye(3) + np.ones((3, 3)), "C": 0.1 * np.eye(3)}
    terms = {name: {0: own[name], 1: tie[name], -1: tie[name].T} for name in "MKC"}
    terms["C"][-1] = -tie["C"].T  # forward and backward waves differ
    ahead = {0: [[-1.0, 0, 0], [0, 1, 0]], 1: [[1.0, 0, 0], [0, 0, -0.5]]}
    scalar = fw.Contact(MixedLaw(0.8, 0.1), ahead, name="mixed")
    B = {k: 0.5 * rng.standard_normal((3, 3)) for k in (0, 1, -2)}
    return fw.Sector(terms["M"], terms["K"], sectors, terms["C"], [scalar, fw.Contact(CoupledLaw(), B, name="coupled")])
