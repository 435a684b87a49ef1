"""Geometry of the blisk: disk with rim and groove, blade, ring, as mapped blocks in (angle, z, radius)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fretwave import fe

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.intp]
SIDES = ("left", "middle", "right")
#: Columns of the rim along the axis, from its front edge; the groove is open in clear_front, ring and clear_back.
AXIAL = ("front", "clear_front", "ring", "clear_back", "lip", "web", "back", "edge")
GROOVE = AXIAL[1:4]


@dataclass(frozen=True)
class Options:
    """Lengths in m, angles in degrees. Titanium blisk, steel ring."""

    blades: int = 36
    bore_radius: float = 0.190  #: held there
    lip_radius: float = 0.238  #: of the rim's lower side
    groove_radius: float = 0.242  #: of the groove's ceiling
    rim_radius: float = 0.250
    axial: tuple[float, ...] = (-0.018, -0.0125, -0.012, -0.004, -0.0035, -0.003, 0.003, 0.015, 0.018)  #: of AXIAL
    span: float = 0.053  #: of the blade
    hub_thickness: float = 0.0060  #: along the circumference, as tip_thickness
    tip_thickness: float = 0.0030
    tip_chord: float = 0.8  #: along the axis, as a share of the hub's
    edge_thickness: float = 0.4  #: of leading and trailing edge over the section's largest thickness
    stagger: tuple[float, float] = (45.0, 60.0)  #: at hub and tip
    camber: float = 0.002
    ring_height: float = 0.008  #: radial; its width is that of the column "ring"
    ring_hold: float = 3142.0  #: springs that hold the ring along the groove, as its own frequency on them [rad/s]
    speed_rpm: float = 3000.0  #: gives the normal loads
    friction: float = 0.3  #: coefficient of friction
    normal: str = "variable"  #: load on the pairs, with lift-off (law coulomb_3d); or "constant" (law jenkins)
    normal_stiffness: float = 5e13  #: of the contact, per area [N/m^3]
    tangential_stiffness: float = 4e13  #: [N/m^3]
    youngs_modulus: float = 114e9  #: of the blisk (Ti-6Al-4V) [Pa]
    poisson_ratio: float = 0.33
    density: float = 4430.0  #: [kg/m^3]
    ring_youngs_modulus: float = 210e9  #: steel
    ring_poisson_ratio: float = 0.3
    ring_density: float = 7800.0
    order: int = 2  #: 2 for hex27, 1 for hex8 (contact then wants an even number of cells)
    axial_cells: tuple[int, ...] = (2, 1, 3, 1, 1, 2, 4, 1)
    circumferential_cells: tuple[int, int, int] = (3, 1, 3)
    radial_cells: tuple[int, int, int] = (9, 2, 2)  #: web, lip, rim
    span_cells: int = 12
    ring_cells: int = 2
    reduced: bool = True  #: onto contact, tip, interface and component modes; if not, all finite elements
    interface_diameters: tuple[int, ...] = (0, 4, 18)  #: whose waves give the interface modes
    interface_waves: int = 7  #: of each, stuck and sliding
    interface_tolerance: float = 1e-5  #: singular values kept, over the largest
    component_modes: int = 40

    @property
    def material(self) -> fe.Material:
        return fe.Material(self.youngs_modulus, self.poisson_ratio, self.density)

    @property
    def ring_material(self) -> fe.Material:
        return fe.Material(self.ring_youngs_modulus, self.ring_poisson_ratio, self.ring_density)

    @property
    def speed(self) -> float:
        """[rad/s]"""
        return self.speed_rpm * np.pi / 30

    @property
    def angles(self) -> Array:
        """Edges of the three columns of a sector at z = 0 [rad]."""
        half, blade = np.pi / self.blades, self.hub_thickness / 2 / self.rim_radius
        return np.array([-half, -blade, blade, half])


def disk_blocks(o: Options) -> list[fe.Block]:
    """Web, lips beside the groove, rim and blade."""
    web, lip, rim = o.radial_cells
    blocks = cut(o, "web", ["web"], (o.bore_radius, o.lip_radius), web)
    blocks += cut(o, "lip", [name for name in AXIAL if name not in GROOVE], (o.lip_radius, o.groove_radius), lip)
    blocks += cut(o, "rim", AXIAL, (o.groove_radius, o.rim_radius), rim)
    for name in AXIAL[1:-1]:
        cells = (o.circumferential_cells[1], o.axial_cells[AXIAL.index(name)], o.span_cells)
        blocks.append(fe.Block(f"blade_{name}", cells, aerofoil(o, name)))
    return blocks


def ring_blocks(o: Options) -> list[fe.Block]:
    """The ring's sector, its outer side on the groove's ceiling."""
    return cut(o, "", ["ring"], (o.groove_radius - o.ring_height, o.groove_radius), o.ring_cells)


def cut(
    o: Options, layer: str, columns: list[str] | tuple[str, ...], radii: tuple[float, float], cells: int
) -> list[fe.Block]:
    """A layer between two radii: for each column along the axis three blocks along the circumference."""
    blocks = []
    for name in columns:
        i = AXIAL.index(name)
        for side, number, angles in zip(SIDES, o.circumferential_cells, zip(o.angles[:-1], o.angles[1:])):
            box = np.array([angles, o.axial[i : i + 2], radii])
            label = "_".join(part for part in (layer, name, side) if part)
            blocks.append(fe.Block(label, (number, o.axial_cells[i], cells), sheared(o, box)))
    return blocks


def sheared(o: Options, box: Array) -> Callable[[Array], Array]:
    """A box (3, 2) in (angle, z, radius), turned with z as the hub's stagger wants it."""

    def points(u: Array) -> Array:
        angle, z, r = (box[:, 0] + u * (box[:, 1] - box[:, 0])).T
        return cylindrical(angle + np.tan(np.radians(o.stagger[0])) * z / o.rim_radius, z, r)

    return points


def cylindrical(angle: Array, z: Array, r: Array) -> Array:
    return np.column_stack([r * np.cos(angle), r * np.sin(angle), z])


def aerofoil(o: Options, name: str) -> Callable[[Array], Array]:
    """The blade above one axial column: a plate at the hub, thinner edges, camber and more stagger further out."""
    i, first, last = AXIAL.index(name), o.axial[1], o.axial[-2]

    def points(u: Array) -> Array:
        along = (o.axial[i] + u[:, 1] * (o.axial[i + 1] - o.axial[i]) - first) / (last - first)
        s = u[:, 2]
        blend = np.minimum(s / 0.15, 1.0)
        blend = blend**2 * (3 - 2 * blend)
        bulge = 4 * along * (1 - along)
        profile = 1 - blend * (1 - o.edge_thickness) * (1 - bulge)
        thickness = (o.hub_thickness + (o.tip_thickness - o.hub_thickness) * s) * profile
        z = (first + along * (last - first)) * (1 + (o.tip_chord - 1) * s)
        slope = np.tan(np.radians(o.stagger[0] + (o.stagger[1] - o.stagger[0]) * s))
        arc = slope * z + o.camber * blend * (bulge - 2 / 3) + (u[:, 0] - 0.5) * thickness
        return cylindrical(arc / o.rim_radius, z, o.rim_radius + s * o.span)

    return points


def low_and_high(mesh: fe.Mesh) -> tuple[Indices, Indices]:
    """Nodes of a sector's two faces: on the outer sides of the columns left and right."""
    ends = [
        [mesh.block_side(n, 0, e).ravel() for n in mesh.lattice if n.endswith(s)]
        for s, e in (("left", 0), ("right", 1))
    ]
    return np.unique(np.concatenate(ends[0])), np.unique(np.concatenate(ends[1]))


def tip_node(disk: fe.Mesh) -> int:
    """The blade's tip at mid-chord, middle of the thickness."""
    return int(blade_lines(disk)[1, -1])


def rooted(disk: fe.Mesh) -> Indices:
    """Nodes of the blade on the rim."""
    return np.unique(np.concatenate([disk.block_side(f"blade_{name}", 2, 0).ravel() for name in AXIAL[1:-1]]))


def blade_lines(disk: fe.Mesh) -> Indices:
    """Nodes (3, n) from root to tip along leading edge, mid-chord and trailing edge, middle of the thickness."""
    front, web, back = (disk.lattice[f"blade_{name}"] for name in (AXIAL[1], "web", AXIAL[-2]))
    half = front.shape[0] // 2
    return np.stack([front[half, 0], web[half, web.shape[1] // 2], back[half, -1]])
