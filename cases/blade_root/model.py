"""A titanium blade held in the disk by a dovetail: two inclined flanks with 24 contact pairs each.

Coordinates [m]: x along the disk's axis, y tangential, z radial (the axis of rotation is y = z = 0). The root is a
prism along x: foot and shoulders carry the flanks, a fillet leads to the neck, which blends into a twisted aerofoil.
"""

from collections.abc import Callable
from dataclasses import asdict, dataclass, fields
from math import cos, sin
from pathlib import Path
from typing import Any, Union

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from scipy.sparse.linalg import LinearOperator, eigsh, splu

from fretwave import InputError, Pairs, Structure, fe, on_pair_coordinates
from fretwave.fe import cached, default_folder, model_key

Array = npt.NDArray[np.float64]
FLANKS = ("shoulder_left", "shoulder_right")
FLANK_NAMES = ("left flank (y < 0)", "right flank (y > 0)")


@dataclass(frozen=True)
class Options:
    """Lengths in m, angles in degrees. Defaults: a compressor blade with first bending near 270 Hz."""

    foot_radius: float = 0.28  #: radius of the foot's bottom
    root_length: float = 0.050  #: along the disk's axis
    foot_half_width: float = 0.013
    foot_height: float = 0.004  #: of the vertical side below the flank
    flank_angle: float = 50.0  #: between flank normal and radius
    flank_length: float = 0.009  #: up the flank
    fillet_radius: float = 0.004  #: from flank to neck
    shank_height: float = 0.006
    transition_height: float = 0.014  #: from neck to aerofoil
    aerofoil_length: float = 0.140
    chord: tuple[float, float] = (0.048, 0.042)  #: at hub and tip, as the next four
    thickness: tuple[float, float] = (0.0065, 0.0030)
    camber: tuple[float, float] = (0.0030, 0.0015)
    stagger: tuple[float, float] = (0.0, 20.0)
    edge_thickness: float = 0.3  #: of leading and trailing edge over the section's largest thickness
    contact_grid: tuple[int, int] = (6, 4)  #: pairs along the axis and up the flank, on each flank
    average: bool = False  #: a contact point is the mean over its cell instead of its centre node
    slot: str = "rigid"  #: or "elastic": disk lugs with a mesh of their own
    slot_half_width: float = 0.026
    slot_base: float = 0.010  #: radial depth of disk below the slot
    slot_gap: float = 0.001  #: clearance around the foot, away from the flanks
    foundation_depth: float = 0.050  #: the rest of the disk is an elastic foundation of modulus E / depth
    axial_stop: float = 1e7  #: retention of the root along the axis [N/m]
    retainer: float = 0.0  #: stiffness across the axis of the plate screwed to each end of the root [N/m]; 0 for none
    normal_stiffness: float = 5e13  #: of the contact, per area [N/m^3]
    tangential_stiffness: float = 4e13  #: [N/m^3]
    speed_rpm: float = 1500.0  #: gives the normal loads; 0 for none
    stiffening: bool = False  #: stress stiffening and spin softening at speed_rpm, without Coriolis forces
    seating_friction: float = 0.0  #: friction coefficient while the blade seats itself
    youngs_modulus: float = 114e9  #: Ti-6Al-4V [Pa]
    poisson_ratio: float = 0.33
    density: float = 4430.0  #: [kg/m^3]
    order: int = 2  #: 2 for hex27, 1 for hex8
    axial_cells: int = 12
    flank_cells: int = 4
    thickness_cells: int = 2
    radial_cells: tuple[int, int, int, int, int] = (3, 1, 1, 3, 22)  #: foot, fillet, shank, transition, aerofoil
    lug_cells: int = 3

    @property
    def material(self) -> fe.Material:
        return fe.Material(self.youngs_modulus, self.poisson_ratio, self.density)

    @property
    def angle(self) -> float:
        """Of the flank's normal against the radius [rad]."""
        return float(np.radians(self.flank_angle))

    @property
    def top_half_width(self) -> float:
        """Of the root at the flank's upper edge [m]."""
        return self.foot_half_width - self.flank_length * cos(self.angle)

    @property
    def heights(self) -> tuple[float, float, float]:
        """Radii of the foot's bottom, the flank's lower and its upper edge [m]."""
        lower = self.foot_radius + self.foot_height
        return self.foot_radius, lower, lower + self.flank_length * sin(self.angle)


def build(**options: Any) -> Structure:
    """The blade for a case file; options are the fields of `Options`."""
    b = blade(**options)
    law = {name: b[name] for name in ("normal_stiffness", "tangential_stiffness")}
    root = Pairs(
        B=b["B"],
        parameters={**law, "normal_load": b["normal_loads"]},
        areas=b["areas"],
        points=b["contact_points"],
        frames=b["contact_frames"],
        faces=b["flank_names"][b["flank"]].tolist(),
        positions=b["flank_positions"],
    )
    structure = Structure(
        M=b["M"],
        K=b["K"],
        dofs={"tip": b["observation_dof"]},
        pairs={"root": root},
        loads={"centrifugal": b["centrifugal_load"]},
        coordinates=b["coordinates"],
        hexahedra=b["hexahedra"],
    )
    return on_pair_coordinates(structure) if options.get("average") else structure


def blade(cache: Union[Path, str, None] = "default", **options: Any) -> dict[str, Any]:
    """Matrices and contact pairs of the blade, SI, dof = 3 * node + axis.

    Parameters
    ----------
    cache : path or None
        Folder of built models (default: the user's cache); None builds anew.
    **options
        Fields of `Options`.

    Returns
    -------
    dict
        M, K : (n_dof, n_dof) CSR, K with axial stop (and elastic slot) and without contact;
        B : (3 n_pairs, n_dof) CSR, rows (normal, axial tangent, tangent across) pair by pair, u_n > 0 closes;
        coordinates (n_nodes, 3); hexahedra (n, 27 or 8) in VTK's order; boundary_faces (n, m, m);
        contact_nodes, opposite_nodes (-1 if rigid), flank (0 left, 1 right; flank_names), areas, normal_loads,
        normal_stiffness, tangential_stiffness: (n_pairs,); contact_points (n_pairs, 3); flank_positions (n_pairs, 2);
        contact_frames (n_pairs, 3, 3);
        observation_dof: y at the trailing-edge tip; keep_dofs: contact and observation; stop_nodes;
        centrifugal_load (n_dof,) [N]; mass, volume, worst_jacobian, rigid_residual: of the blade alone, whose nodes
        come first (blade_nodes of them).
    """
    chosen = checked_options(options)
    if cache is None:
        return compute(chosen)
    folder = default_folder() if cache == "default" else Path(cache)
    key = model_key(asdict(chosen), [Path(__file__)])
    return cached(folder / f"blade_root_{key}.npz", lambda: compute(chosen))


def checked_options(options: dict[str, Any]) -> Options:
    """Options with known names and a root that can be drawn."""
    known = [field.name for field in fields(Options)]
    for name in options:
        if name not in known:
            raise InputError("unknown option of the blade root", None, name, ", ".join(known), "remove or rename it")
    chosen = Options(**options)
    if not 5 <= chosen.flank_angle <= 85:
        angle = f"{chosen.flank_angle} degrees"
        raise InputError("the flank is not inclined", None, angle, "5 to 85 degrees", "change flank_angle")
    neck = neck_half_width(chosen)
    if neck <= 0:
        width = f"neck half width {neck:.3g} m"
        raise InputError("the flanks meet", None, width, "> 0", "widen the foot or shorten the flank")
    if chosen.slot not in ("rigid", "elastic"):
        raise InputError("unknown slot", None, chosen.slot, "rigid or elastic", "change slot")
    return chosen


def compute(o: Options) -> dict[str, Any]:
    """Build without looking at the cache."""
    blade = fe.join(blade_blocks(o), o.order)
    worst = blade.check_quality()
    M, K = fe.assemble(blade, o.material)
    report = fe.check_matrices(blade, o.material, M, K)
    load = fe.centrifugal_load(M, blade.nodes, o.speed_rpm * np.pi / 30, (0, 0, 0), (1, 0, 0))
    stop = axial_stop(blade, o)
    K = K + stop + retainers(blade, o)
    model = dict(M=M, K=K, centrifugal_load=load, stop_nodes=np.nonzero(stop.diagonal())[0] // 3)
    model |= dict(coordinates=blade.nodes, hexahedra=blade.vtk_cells, boundary_faces=blade.boundary_faces)
    model |= dict(mass=report.mass, volume=report.volume, rigid_residual=report.rigid_residual)
    model |= dict(worst_jacobian=worst.ratio, observation_dof=observed_dof(blade), blade_nodes=len(blade.nodes))
    model = add_contact(model, blade, o)
    return add_rotation(model, blade, o) if o.stiffening else model


def add_rotation(model: dict[str, Any], blade: fe.Mesh, o: Options) -> dict[str, Any]:
    """The blade's stiffness in steady rotation, from the stress of the centrifugal load with stuck contact."""
    factor = factorised(stuck_stiffness(model).tocsc())
    displacement = factor.solve(model["centrifugal_load"])[: blade.n_dof]
    softening = fe.spin_softening(model["M"][: blade.n_dof, : blade.n_dof], o.speed_rpm * np.pi / 30, (1, 0, 0))
    extra = (fe.stress_stiffness(blade, o.material, displacement) + softening).tocsr()
    extra.resize(model["K"].shape)
    return model | dict(K=(model["K"] + extra).tocsr())


def observed_dof(blade: fe.Mesh) -> int:
    """Tangential displacement of the trailing edge's middle at the tip: close to the first bending's direction."""
    tip = blade.lattice["aerofoil"][-1, :, -1]
    return 3 * int(tip[len(tip) // 2]) + 1


def add_contact(model: dict[str, Any], blade: fe.Mesh, o: Options) -> dict[str, Any]:
    """The pairs, the disk's side of them, and what a reduction must keep."""
    pairs = contact_pairs(blade, o)
    weights, n = pairs.pop("weights"), len(pairs["areas"])
    radial_load = nodal_load(o, model["centrifugal_load"], n)
    model |= pairs | dict(opposite_nodes=np.full(n, -1), normal_loads=np.full(n, radial_load))
    if o.slot == "elastic":
        weights = add_slot(model, weights, o)
    B = fe.relative_rows(weights, model["contact_frames"])
    model |= dict(flank_names=np.array(FLANK_NAMES), flank_positions=flank_positions(model))
    return model | dict(B=B, keep_dofs=np.union1d(np.unique(B.indices), [model["observation_dof"]]))


def blade_blocks(o: Options) -> list[fe.Block]:
    """Foot between two shoulders, fillet, shank, transition and aerofoil, from the bottom up."""
    bottom, lower, upper = o.heights
    n, w = o.top_half_width, o.foot_half_width
    foot, fillet, shank, transition, aerofoil = o.radial_cells
    across = (o.axial_cells, o.thickness_cells)
    side = (o.axial_cells, o.flank_cells, foot)
    left = prism(o, [(-w, bottom), (-n, bottom), (-n, upper), (-w, lower)])
    right = prism(o, [(n, bottom), (w, bottom), (w, lower), (n, upper)])
    return [
        fe.Block("foot", (*across, foot), prism(o, [(-n, bottom), (n, bottom), (n, upper), (-n, upper)])),
        fe.Block("shoulder_left", side, left),
        fe.Block("shoulder_right", side, right),
        fe.Block("fillet", (*across, fillet), lambda u: in_space(*fillet_section(o, u))),
        fe.Block("shank", (*across, shank), lambda u: in_space(*neck(o, u), neck_radius(o) + u[:, 2] * o.shank_height)),
        fe.Block("transition", (*across, transition), lambda u: transition_points(o, u)),
        fe.Block("aerofoil", (*across, aerofoil), lambda u: aerofoil_points(o, u)),
    ]


def slot_blocks(o: Options) -> list[fe.Block]:
    """Disk around the root: two lugs on the flanks, two side walls and a base under the foot."""
    bottom, lower, upper = o.heights
    n, w, W = o.top_half_width, o.foot_half_width, o.slot_half_width
    g, top, base = w + o.slot_gap, bottom - o.slot_gap, bottom - o.slot_gap - o.slot_base
    side = (o.axial_cells, o.lug_cells)
    quads = {
        "lug": [(w, lower), (W, lower), (W, upper), (n, upper)],
        "wall": [(g, top), (W, top), (W, lower), (w, lower)],
        "corner": [(g, base), (W, base), (W, top), (g, top)],
    }
    cells = {"lug": o.flank_cells, "wall": o.radial_cells[0], "corner": o.lug_cells}
    blocks = []
    for name, quad in quads.items():
        mirrored = [(-quad[i][0], quad[i][1]) for i in (1, 0, 3, 2)]
        blocks.append(fe.Block(f"{name}_right", (*side, cells[name]), prism(o, quad)))
        blocks.append(fe.Block(f"{name}_left", (*side, cells[name]), prism(o, mirrored)))
    middle = prism(o, [(-g, base), (g, base), (g, top), (-g, top)])
    return [*blocks, fe.Block("base", (o.axial_cells, 2 * o.lug_cells, o.lug_cells), middle)]


def prism(o: Options, quad: list[tuple[float, float]]) -> Callable[[Array], Array]:
    """Quadrilateral with corners (y, z), counter-clockwise from the origin of its unit square, extruded along x."""
    p = np.array(quad)

    def points(u: Array) -> Array:
        a, b = u[:, 1:2], u[:, 2:3]
        section = (1 - a) * (1 - b) * p[0] + a * (1 - b) * p[1] + a * b * p[2] + (1 - a) * b * p[3]
        return np.column_stack([(u[:, 0] - 0.5) * o.root_length, section])

    return points


def in_space(x: Array, y: Array, z: Array) -> Array:
    return np.column_stack([x, y, z])


def neck_half_width(o: Options) -> float:
    return o.top_half_width - o.fillet_radius * (1 - sin(o.angle))


def neck_radius(o: Options) -> float:
    """Where the fillet ends."""
    return o.heights[2] + o.fillet_radius * cos(o.angle)


def tip_height(o: Options) -> float:
    return neck_radius(o) - o.foot_radius + o.shank_height + o.transition_height + o.aerofoil_length


def fillet_section(o: Options, u: Array) -> tuple[Array, Array, Array]:
    """An arc tangent to the flank below and to the radius above."""
    start = np.pi / 2 - o.angle
    turn = start * (1 - u[:, 2])
    half = o.top_half_width - o.fillet_radius * (np.cos(turn) - np.cos(start))
    z = o.heights[2] + o.fillet_radius * (np.sin(start) - np.sin(turn))
    return (u[:, 0] - 0.5) * o.root_length, (2 * u[:, 1] - 1) * half, z


def neck(o: Options, u: Array) -> tuple[Array, Array]:
    return (u[:, 0] - 0.5) * o.root_length, (2 * u[:, 1] - 1) * neck_half_width(o)


def profile(o: Options, u: Array, span: Array) -> tuple[Array, Array]:
    """Section (x, y) of the aerofoil at a share of its span: parabolic thickness and camber, turned by the stagger."""
    chord, thickness, camber, stagger = (a + (b - a) * span for a, b in (o.chord, o.thickness, o.camber, o.stagger))
    bulge = 4 * u[:, 0] * (1 - u[:, 0])
    half = thickness / 2 * (o.edge_thickness + (1 - o.edge_thickness) * bulge)
    along = chord * (u[:, 0] - 0.5)
    across = camber * (bulge - 2 / 3) + (2 * u[:, 1] - 1) * half
    c, s = np.cos(np.radians(stagger)), np.sin(np.radians(stagger))
    return c * along + s * across, -s * along + c * across


def transition_points(o: Options, u: Array) -> Array:
    share = (u[:, 2] ** 2 * (3 - 2 * u[:, 2]))[:, None]
    rectangle, section = np.column_stack(neck(o, u)), np.column_stack(profile(o, u, np.zeros(len(u))))
    z = neck_radius(o) + o.shank_height + u[:, 2] * o.transition_height
    return np.column_stack([(1 - share) * rectangle + share * section, z])


def aerofoil_points(o: Options, u: Array) -> Array:
    hub = o.foot_radius + tip_height(o) - o.aerofoil_length
    return in_space(*profile(o, u, u[:, 2]), hub + u[:, 2] * o.aerofoil_length)


def contact_pairs(blade: fe.Mesh, o: Options) -> dict[str, Any]:
    """The blade's side of the pairs, left flank first; along the axis, then across."""
    patches = [fe.contact_patch(blade, flank, 2, 1, o.contact_grid, o.average) for flank in FLANKS]
    areas = np.concatenate([patch.areas for patch in patches])
    return dict(
        weights=sp.vstack([patch.weights for patch in patches], format="csr"),
        contact_nodes=np.concatenate([patch.nodes for patch in patches]),
        contact_points=np.concatenate([patch.points for patch in patches]),
        contact_frames=fe.tangent_frames(np.concatenate([patch.normals for patch in patches]), (1, 0, 0)),
        flank=np.repeat([0, 1], [len(patch.nodes) for patch in patches]),
        areas=areas,
        normal_stiffness=o.normal_stiffness * areas,
        tangential_stiffness=o.tangential_stiffness * areas,
    )


def flank_positions(model: dict[str, Any]) -> Array:
    """Contact points (n_pairs, 2) on their flank [m]: along the axis, and up the flank from its lower edge."""
    points = model["contact_points"]
    slope = abs(model["contact_frames"][:, 2, 2])
    height = (points[:, 2] - points[:, 2].min()) / slope
    spacing = np.diff(np.unique(np.round(height, 9)))[0]
    return np.asarray(np.column_stack([points[:, 0], height + spacing / 2]))


def axial_stop(blade: fe.Mesh, o: Options) -> sp.csr_matrix:
    """Springs along the axis over the foot's downstream end: all that holds the blade there when every pair slips."""
    area = fe.nodal_areas(blade, blade.block_faces("foot", 0, 1))
    return sp.diags(np.kron(o.axial_stop * area / area.sum(), [1.0, 0.0, 0.0]), format="csr")


def retainers(blade: fe.Mesh, o: Options) -> sp.csr_matrix:
    """Springs across the axis over both end faces of the root: plates that carry moments its flanks cannot."""
    faces = [blade.block_faces(block, 0, end) for block in ("foot", *FLANKS) for end in (0, 1)]
    area = np.sum([fe.nodal_areas(blade, face) for face in faces], axis=0)
    return sp.diags(np.kron(2 * o.retainer * area / area.sum(), [0.0, 1.0, 1.0]), format="csr")


def nodal_load(o: Options, load: Array, pairs: int) -> float:
    """N0 = F_c / (n (cos alpha + mu sin alpha)): the radial balance of the blade on its flanks, uniform."""
    radial = float(load[2::3].sum())
    return radial / (pairs * (cos(o.angle) + o.seating_friction * sin(o.angle)))


def add_slot(model: dict[str, Any], weights: sp.csr_matrix, o: Options) -> sp.csr_matrix:
    """Append the disk's mesh and matrices to the model; relative weights (n_pairs, n_nodes) of both sides."""
    slot = fe.join(slot_blocks(o), o.order)
    slot.check_quality()
    M, K = fe.assemble(slot, o.material)
    K = K + foundation(slot, o)
    sides = [("lug_left", 1, 1), ("lug_right", 1, 0)]
    patches = [fe.contact_patch(slot, *side, o.contact_grid, o.average) for side in sides]
    points = np.concatenate([patch.points for patch in patches])
    match = np.array([int(np.argmin(np.linalg.norm(points - p, axis=1))) for p in model["contact_points"]])
    opposite = sp.vstack([patch.weights for patch in patches], format="csr")[match]
    n = len(model["coordinates"])
    model["opposite_nodes"] = n + np.concatenate([patch.nodes for patch in patches])[match]
    model["M"], model["K"] = (sp.block_diag(pair, format="csr") for pair in ((model["M"], M), (model["K"], K)))
    model["centrifugal_load"] = np.concatenate([model["centrifugal_load"], np.zeros(slot.n_dof)])
    model["coordinates"] = np.concatenate([model["coordinates"], slot.nodes])
    model["hexahedra"] = np.concatenate([model["hexahedra"], n + slot.vtk_cells])
    model["boundary_faces"] = np.concatenate([model["boundary_faces"], n + slot.boundary_faces])
    return sp.hstack([weights, -opposite], format="csr")


def foundation(slot: fe.Mesh, o: Options) -> sp.csr_matrix:
    """The disk beyond the modelled lugs: springs E / depth per area on its lateral and lower faces, all directions."""
    low = slot.nodes[:, 2].min()
    sides = slot.faces_where(lambda x: abs(abs(x[:, 1]) - o.slot_half_width) < 1e-9)
    bottom = slot.faces_where(lambda x: abs(x[:, 2] - low) < 1e-9)
    area = fe.nodal_areas(slot, sides) + fe.nodal_areas(slot, bottom)
    return sp.diags(np.repeat(o.youngs_modulus / o.foundation_depth * area, 3), format="csr")


def stuck_stiffness(model: dict[str, Any]) -> sp.csr_matrix:
    """K with every pair closed and sticking."""
    springs = np.column_stack([model["normal_stiffness"]] + 2 * [model["tangential_stiffness"]])
    return model["K"] + model["B"].T @ sp.diags(springs.ravel()) @ model["B"]


def stuck_modes(model: dict[str, Any], count: int = 6) -> tuple[Array, Array]:
    """Lowest frequencies (count,) [Hz] and mass-normalised shapes (n_dof, count) with stuck contact."""
    K = stuck_stiffness(model).tocsc()
    factor = factorised(K)
    inverse = LinearOperator(K.shape, matvec=factor.solve, dtype=float)
    squares, shapes = eigsh(K, k=count, M=model["M"], sigma=0.0, OPinv=inverse)
    return np.sqrt(squares) / 2 / np.pi, shapes


def factorised(K: sp.csc_matrix) -> Any:
    """Sparse factors of a symmetric positive definite matrix."""
    return splu(K, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=dict(SymmetricMode=True))
