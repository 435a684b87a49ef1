"""Lumped blisk of 24 sectors (Laxalde et al. 2007) with a friction ring under the rim: one sector, or the wheel.

Dofs of a sector: disk, blade, tip, ring. `sector(**options)` makes the `fretwave.Sector`.
"""

from dataclasses import dataclass

import numpy as np

import fretwave as fw

SECTORS = 24
DOFS = ["disk", "blade", "tip", "ring"]
#: Masses [kg] of disk, blade and tip; stiffnesses [N/m] of disk to ground, to its neighbours, of blade and tip.
DISK, BLADE, TIP = 1.2, 0.35, 0.25
GROUND, NEIGHBOUR, ROOT, AEROFOIL = 6e5, 5e7, 1e6, 2e6
#: Of the blade alone, between these dofs.
BLADE_SPRINGS = {(0, 1): ROOT, (1, 2): AEROFOIL}


@dataclass(frozen=True)
class Options:
    """What may be chosen; the structure itself is that of the paper.

    Attributes
    ----------
    ring_radius, ring_side : float [m]
        Mean radius and side of the ring's square section.
    ring_young, ring_density, ring_poisson : float [Pa], [kg/m^3]
    ring_diameters : int
        Nodal diameters at which the lumped ring has the bending stiffness of the real one.
    speed_rpm : float
        Centrifugal force presses the ring into its groove.
    friction : float
        Coefficient of friction.
    contact_stiffness : float [N/m]
        Tangential, of a sector's share of the groove.
    """

    ring_radius: float = 0.25
    ring_side: float = 8e-3
    ring_young: float = 2.1e11
    ring_density: float = 7800.0
    ring_poisson: float = 0.3
    ring_diameters: int = 4
    speed_rpm: float = 3000.0
    friction: float = 0.3
    contact_stiffness: float = 1e7

    @property
    def ring_mass(self) -> float:
        """Of a sector's share [kg]."""
        return self.ring_density * self.ring_side**2 * 2 * np.pi * self.ring_radius / SECTORS

    @property
    def ring_omega(self) -> float:
        """Free bending of the ring out of its plane in n nodal diameters [rad/s].

        omega^2 = E I / (rho A R^4) n^2 (n^2 - 1)^2 / (n^2 + E I / G J) (Love; Blevins 1979, Table 9-2).
        """
        side, n = self.ring_side, self.ring_diameters
        inertia, torsion = side**4 / 12, 0.1406 * side**4
        ratio = 2 * (1 + self.ring_poisson) * inertia / torsion
        scale = self.ring_young * inertia / (self.ring_density * side**2 * self.ring_radius**4)
        return float(np.sqrt(scale * n**2 * (n**2 - 1) ** 2 / (n**2 + ratio)))

    @property
    def ring_coupling(self) -> float:
        """Spring between neighbouring ring masses [N/m]: 4 sin^2(pi n / N) of it is m_r omega_r^2."""
        return self.ring_mass * self.ring_omega**2 / (4 * np.sin(np.pi * self.ring_diameters / SECTORS) ** 2)

    @property
    def normal_load(self) -> float:
        """Centrifugal force of a sector's share of the ring [N]."""
        return self.ring_mass * self.ring_radius * (self.speed_rpm * np.pi / 30) ** 2


def sector(**options: float) -> fw.Sector:
    """The sector with its ties to both neighbours and the friction between disk and ring."""
    chosen = Options(**options)  # type: ignore[arg-type]
    ties = np.diag([NEIGHBOUR, 0.0, 0.0, chosen.ring_coupling])
    K = np.zeros((4, 4))
    K[0, 0] = GROUND
    for (first, second), stiffness in BLADE_SPRINGS.items():
        K[np.ix_([first, second], [first, second])] += stiffness * np.array([[1, -1], [-1, 1]])
    groove = fw.Contact(
        "jenkins",
        [[1.0, 0.0, 0.0, -1.0]],
        {"tangential_stiffness": chosen.contact_stiffness, "friction_limit": chosen.friction * chosen.normal_load},
        name="groove",
    )
    M = np.diag([DISK, BLADE, TIP, chosen.ring_mass])
    return fw.Sector(M, {0: K + 2 * ties, 1: -ties, -1: -ties}, SECTORS, None, [groove])


def build(**options: float) -> fw.Structure:
    """The sector for the case file: with the disk and the ring of the next one as its high face.

    A face's dof belongs to both sectors; its mass and ground spring are given once, on the low face.
    """
    one = sector(**options)
    M, K = np.zeros((6, 6)), np.zeros((6, 6))
    M[:4, :4], K[:4, :4] = one.M, one.K[0] + 2 * one.K[1]
    for low, high in ((0, 4), (3, 5)):
        K[np.ix_([low, high], [low, high])] += one.K[1][low, low] * np.array([[-1, 1], [1, -1]])
    blade = np.zeros((6, 6))
    for (first, second), stiffness in BLADE_SPRINGS.items():
        blade[np.ix_([first, second], [first, second])] += stiffness * np.array([[1, -1], [-1, 1]])
    groove = one.contacts[0]
    contact = fw.Pairs(np.hstack([groove.B, np.zeros((1, 2))]), 1, groove.parameters)
    return fw.Structure(
        M,
        K,
        dofs={name: number for number, name in enumerate([*DOFS, "next_disk", "next_ring"])},
        pairs={"groove": contact},
        sectors=SECTORS,
        low=np.array([0, 3]),
        high=np.array([4, 5]),
        parts={"blade": blade},
    )


def ring_stiffness(options: Options, omega: float, nodal_diameter: int) -> float:
    """k_r - m_r omega^2 of the ring in a wave [N/m]: negative where its inertia outweighs its stiffness."""
    bending = 4 * options.ring_coupling * np.sin(np.pi * nodal_diameter / SECTORS) ** 2
    return float(bending - options.ring_mass * omega**2)


def slip_threshold(options: Options, omega: float, nodal_diameter: int) -> float:
    """Amplitude of the disk [m] at which the stuck ring needs the whole friction force to be dragged along."""
    kt, ring = options.contact_stiffness, ring_stiffness(options, omega, nodal_diameter)
    return float(options.friction * options.normal_load * abs((kt + ring) / (kt * ring)))
