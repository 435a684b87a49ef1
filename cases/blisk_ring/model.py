"""A blisk of 36 blades with a friction ring in a groove under its rim: one elastic sector, reduced.

Coordinates [m]: z is the axis of rotation, x the radius through the middle of the sector. Blocks are drawn in
(angle, z, radius); the angle grows with z as the blade's stagger wants it, so that a sector's faces are not plane.
Geometry is in `geometry.py`; here are matrices, contact pairs and the reduction.
"""

from __future__ import annotations

import sys
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Any, Union

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from mpi4py import MPI

import fretwave as fw
from fretwave import InputError, by_sector, fe
from fretwave.fe import cached, default_folder, model_key

sys.path.insert(0, str(Path(__file__).parent))
from geometry import Options, blade_lines, disk_blocks, low_and_high, ring_blocks, rooted, tip_node  # noqa: E402

Array = npt.NDArray[np.float64]
COLUMNS = ("left", "middle", "right")


def build(**options: Any) -> fw.Structure:
    """The sector for a case file, reduced or not; options are the fields of `geometry.Options`."""
    o = checked_options(options)
    r = reduced(**options) if o.reduced else {**full(**options), "expand": None}
    K, groove = groove_contact(o, r)
    return fw.Structure(
        M=r["M"],
        K=K,
        dofs={"tip": int(r["tip"])},
        pairs={"groove": groove},
        sectors=o.blades,
        low=r["low"],
        high=r["high"],
        axis="z",
        coordinates=r["coordinates"],
        displacements=displacements(r),
        hexahedra=r["hexahedra"],
        expansion=r["expand"],
        parts={"blade": r["K_blade"]},
    )


def displacements(model: dict[str, Any]) -> Any:
    """Dofs (n_nodes, 3) of all nodes in `full`, -1 where the bore holds them."""
    number = np.full((len(model["coordinates"]), 3), -1)
    number[model["free"]] = np.arange(3 * len(model["free"])).reshape(-1, 3)
    return number


def groove_contact(o: Options, model: dict[str, Any]) -> tuple[sp.csr_matrix, fw.Pairs]:
    """K and the pairs for the chosen law.

    With constant normal load the pairs stay closed on their normal stiffness, which K then has, and each tangent is a
    Jenkins slider of limit mu N: a motion of other mu or N is the same motion scaled by mu N.
    """
    parameters, n = contact_parameters(o, model), len(model["areas"])
    if o.normal == "variable":
        given = {**parameters, "friction_coefficient": o.friction}
        where = {key: model[key] for key in ("areas", "points", "frames", "positions")}
        return model["K"], fw.Pairs(model["B"], 3, given, faces=["groove"] * n, **where)
    tangents = np.arange(3 * n) % 3 > 0
    given = {
        "tangential_stiffness": np.repeat(parameters["tangential_stiffness"], 2),
        "friction_limit": o.friction * np.repeat(parameters["normal_load"], 2),
    }
    points = np.repeat(model["points"], 2, axis=0)
    return stiffened(o, model, False), fw.Pairs(model["B"][tangents], 1, given, points=points)


def checked_options(options: dict[str, Any]) -> Options:
    """Options with known names."""
    known = [field.name for field in fields(Options)]
    for name in options:
        if name not in known:
            raise InputError("unknown option of the blisk", None, name, ", ".join(known), "remove or rename it")
    chosen = Options(**options)
    if chosen.normal not in ("constant", "variable"):
        raise InputError("unknown normal load", None, chosen.normal, "constant or variable", "change normal")
    return chosen


def contact_parameters(o: Options, model: dict[str, Any]) -> dict[str, Array]:
    """Stiffness and normal load of the pairs: the ring's centrifugal force m r Omega^2 is spread by area."""
    share = model["areas"] / model["areas"].sum()
    return {
        "normal_stiffness": o.normal_stiffness * model["areas"],
        "tangential_stiffness": o.tangential_stiffness * model["areas"],
        "normal_load": model["ring_mass"] * model["ring_radius"] * o.speed**2 * share,
    }


def full(**options: Any) -> dict[str, Any]:
    """The sector before reduction, SI, dof = 3 * node + axis on the nodes that the bore does not hold.

    Returns
    -------
    dict
        M, K : (n_dof, n_dof) CSR, without contact, both faces free; K_blade : the blade's share of K; B : (3 n_pairs,
        n_dof), rows (normal, axial, circumferential) of ring minus groove pair by pair, u_n > 0 closes; low, high :
        (n_face,) matching dofs;
        areas, points, frames, positions of the pairs; tip : dof; free : (n_free,) nodes of the mesh that are not held;
        coordinates (n_nodes, 3), hexahedra and boundary_faces of the whole mesh; disk_nodes, blade_nodes, blade_root;
        ring_mass [kg], ring_radius [m]; mass, rigid_residual : (disk with blade, ring).
    """
    o = checked_options(options)
    disk, ring = fe.join(disk_blocks(o), o.order), fe.join(ring_blocks(o), o.order)
    worst = [mesh.check_quality().ratio for mesh in (disk, ring)]
    parts = [fe.assemble(mesh, material) for mesh, material in ((disk, o.material), (ring, o.ring_material))]
    reports = [
        fe.check_matrices(*given, *part) for given, part in zip(((disk, o.material), (ring, o.ring_material)), parts)
    ]
    nodes = np.concatenate([disk.nodes, ring.nodes])
    (M_disk, K_disk), (M_ring, K_ring) = parts
    pairs = contact_pairs(o, disk, ring)
    K = sp.block_diag([K_disk, K_ring]) + ring_springs(o, pairs, reports[1].mass)
    free = np.nonzero(np.hypot(nodes[:, 0], nodes[:, 1]) > o.bore_radius * (1 + 1e-9))[0]
    dofs = dofs_of(free)
    low, high = matched_faces(o, disk, ring, free)
    place = np.full(len(nodes), -1)
    place[free] = np.arange(len(free))
    return dict(
        M=sp.csr_matrix(sp.block_diag([M_disk, M_ring]).tocsr()[dofs][:, dofs]),
        K=sp.csr_matrix(K.tocsr()[dofs][:, dofs]),
        K_blade=blade_stiffness(o, disk, len(nodes))[dofs][:, dofs],
        low=dofs_of(place[low]),
        high=dofs_of(place[high]),
        tip=3 * int(place[tip_node(disk)]) + 2,
        free=free,
        coordinates=nodes,
        hexahedra=np.concatenate([disk.vtk_cells, len(disk.nodes) + ring.vtk_cells]),
        boundary_faces=np.concatenate([disk.boundary_faces, len(disk.nodes) + ring.boundary_faces]),
        disk_nodes=len(disk.nodes),
        blade_nodes=np.unique(
            np.concatenate([disk.lattice[name].ravel() for name in disk.lattice if name.startswith("blade")])
        ),
        blade_root=rooted(disk),
        blade_lines=blade_lines(disk),
        ring_mass=reports[1].mass,
        ring_radius=o.groove_radius - o.ring_height / 2,
        mass=np.array([report.mass for report in reports]),
        rigid_residual=np.array([report.rigid_residual for report in reports]),
        worst_jacobian=min(worst),
        **{**pairs, "B": pairs["B"][:, dofs]},
    )


def blade_stiffness(o: Options, disk: fe.Mesh, n_nodes: int) -> sp.csr_matrix:
    """What the blade's elements put into K (3 n_nodes, 3 n_nodes), before any node is held."""
    blade = fe.join([block for block in disk_blocks(o) if block.name.startswith("blade")], o.order)
    number = np.empty(len(blade.nodes), dtype=int)
    for name, lattice in blade.lattice.items():
        number[lattice] = disk.lattice[name]
    K, dofs = fe.assemble(blade, o.material)[1].tocoo(), dofs_of(number)
    return sp.csr_matrix((K.data, (dofs[K.row], dofs[K.col])), (3 * n_nodes, 3 * n_nodes))


def ring_springs(o: Options, pairs: dict[str, Any], ring_mass: float) -> sp.csr_matrix:
    """Springs between ring and groove along both tangents, spread by area, on all dofs.

    They stand for the tabs that keep a ring in its groove. Friction alone does not: where the normal load changes with
    the motion, a travelling wave drags the ring along, as the rotor of an ultrasonic motor.
    """
    k = o.ring_hold**2 * ring_mass * pairs["areas"] / pairs["areas"].sum()
    return sp.csr_matrix(pairs["B"].T @ sp.diags(np.column_stack([0 * k, k, k]).ravel()) @ pairs["B"])


def matched_faces(o: Options, disk: fe.Mesh, ring: fe.Mesh, free: Any) -> tuple[Any, Any]:
    """Matching free nodes of the sector's faces; body by body, as the contact nodes of both coincide."""
    found = []
    for mesh, start in ((disk, 0), (ring, len(disk.nodes))):
        faces = (np.intersect1d(face, free - start) for face in low_and_high(mesh))
        found.append(np.add(fw.match_faces(mesh.nodes, *faces, o.blades, "z"), start))
    return tuple(np.concatenate(found, axis=1))


def dofs_of(nodes: Any) -> Any:
    """Three per node, (3 n,)."""
    return (3 * np.asarray(nodes)[:, None] + np.arange(3)).ravel()


def contact_pairs(o: Options, disk: fe.Mesh, ring: fe.Mesh) -> dict[str, Any]:
    """Pairs at the centres of the element faces in which ring and groove touch, none on a face of the sector."""
    sides = []
    for mesh, name, end in ((ring, "ring", 1), (disk, "rim_ring", 0)):
        grids = [mesh.block_faces(f"{name}_{column}", 2, end).shape[:2] for column in COLUMNS]
        sides.append([fe.contact_patch(mesh, f"{name}_{c}", 2, end, g) for c, g in zip(COLUMNS, grids)])
    mine, other = (np.concatenate([patch.points for patch in patches]) for patches in sides)
    if not np.allclose(mine, other, rtol=0, atol=1e-9):
        gap = float(np.linalg.norm(mine - other, axis=1).max())
        raise InputError("ring and groove have no common contact nodes", None, f"{gap:.3g} m apart", "0", "mesh alike")
    weights = [sp.vstack([patch.weights for patch in patches]) for patches in sides]
    frames = fe.tangent_frames(np.concatenate([patch.normals for patch in sides[0]]), (0, 0, 1))
    arc = np.arctan2(mine[:, 1], mine[:, 0]) * o.groove_radius
    return dict(
        B=fe.relative_rows(sp.hstack([-weights[1], weights[0]], format="csr"), frames),
        areas=np.concatenate([patch.areas for patch in sides[0]]),
        points=mine,
        frames=frames,
        positions=np.column_stack([arc, mine[:, 2]]),
    )


def stiffened(o: Options, model: dict[str, Any], tangential: bool) -> sp.csr_matrix:
    """K with all pairs closed, and sticking if `tangential`."""
    p, B = contact_parameters(o, model), model["B"]
    kt = p["tangential_stiffness"] * tangential
    return sp.csr_matrix(model["K"] + B.T @ sp.diags(np.column_stack([p["normal_stiffness"], kt, kt]).ravel()) @ B)


def waves(o: Options, model: dict[str, Any], nodal_diameter: int, count: int, tangential: bool = True) -> list[Any]:
    """Lowest linear waves of the unreduced sector, all pairs closed; shapes on its low face's side (`Sector`)."""
    K = stiffened(o, model, tangential)
    sector = fw.Sector.from_faces(model["M"], K, model["low"], model["high"], o.blades, axis="z")
    with sector.model(nodal_diameter, MPI.COMM_SELF) as linear:
        return fw.linear_modes(linear, count, "free")


def reduced(cache: Union[Path, str, None] = "default", **options: Any) -> dict[str, Any]:
    """The sector on contact dofs, tip, amplitudes of interface modes on both faces, and component modes.

    As `full`, with M, K, B, low, high and tip in reduced coordinates, and expand (n_dof, n_r): the unreduced motion.
    The faces' coordinates correspond as they are (the high face's modes are turned with it).
    """
    o = checked_options(options)
    if cache is None:
        return compute(o)
    folder = default_folder() if cache == "default" else Path(cache)
    here = Path(__file__)
    same = replace(o, speed_rpm=0.0, friction=0.0, normal="", reduced=True)
    key = model_key(asdict(same), [here, here.with_name("geometry.py")])
    return cached(folder / f"blisk_ring_{key}.npz", lambda: compute(o))


def compute(o: Options) -> dict[str, Any]:
    """Interface modes and Craig-Bampton (`fretwave.reduce_sector`).

    Of the contact only relative displacements are kept, half as many as dofs: the component modes are those of the
    sector whose ring sticks.
    """
    model = full(**asdict(o))
    T = relative_coordinates(model)
    M, K, B = T.T @ model["M"] @ T, T.T @ model["K"] @ T, sp.csr_matrix(model["B"] @ T)
    B.data[abs(B.data) < 1e-12] = 0
    B.eliminate_zeros()
    given = {
        **contact_parameters(replace(o, speed_rpm=1.0), model),
        "friction_coefficient": 1.0,
    }  # only stiffness counts
    with fw.reduce_sector(
        M,
        K,
        model["low"],
        model["high"],
        o.blades,
        contacts=[fw.Contact("coulomb_3d", B, given)],
        keep=[model["tip"]],
        axis="z",
        interface_diameters=o.interface_diameters,
        interface_waves=o.interface_waves,
        interface_tolerance=o.interface_tolerance,
        modes=o.component_modes,
        comm=MPI.COMM_SELF,
    ) as reduction:
        expand = T @ reduction.expand(np.eye(reduction.size))
    small = {letter: sp.csr_matrix(getattr(reduction, letter)) for letter in "MK"}
    small |= dict(
        B=by_sector(reduction.contacts[0].B)[0], K_blade=sp.csr_matrix(expand.T @ (model["K_blade"] @ expand))
    )
    small |= dict(low=reduction.low, high=reduction.high, tip=reduction.places[model["tip"]], expand=expand)
    return {**model, **small, "unreduced": model["M"].shape[0]}


def relative_coordinates(model: dict[str, Any]) -> sp.csr_matrix:
    """x = T z: in place of the ring's dofs at the pairs their displacements against the groove, in the pairs' frames.

    B x = frame (x_ring - x_groove), node to node, hence x_ring = x_groove + frame^T u.
    """
    B = model["B"].tocoo()
    ring = np.repeat(model["free"] >= model["disk_nodes"], 3)[B.col]
    mine = sp.csr_matrix((B.data[ring], (B.row[ring], B.col[ring])), B.shape)
    other = sp.csr_matrix((B.data[~ring], (B.row[~ring], B.col[~ring])), B.shape)
    contact = np.unique(B.col[ring])
    unit = sp.csr_matrix((np.ones(len(contact)), (contact, np.arange(len(contact)))), (B.shape[1], len(contact)))
    own = sp.identity(B.shape[1]) - unit @ unit.T
    return sp.csr_matrix(own + mine.T @ (unit[:, : B.shape[0]].T - other))


def blade_modes(model: dict[str, Any], count: int = 6) -> tuple[Array, Array, Any]:
    """Frequencies [Hz] and shapes (n, count) of the blade held at its root, and its n dofs in `full`."""
    free = np.setdiff1d(model["blade_nodes"], model["blade_root"])
    dofs = dofs_of(np.searchsorted(model["free"], free))
    M, K = (model[name][dofs][:, dofs] for name in "MK")
    with fw.Model(M, K, comm=MPI.COMM_SELF) as blade:
        found = fw.linear_modes(blade, count, "free")
    return np.array([mode.frequency_hz for mode in found]), np.column_stack([mode.shape for mode in found]), dofs


def second_bending(o: Options, model: dict[str, Any]) -> tuple[float, Array, Any]:
    """The held blade's mode that bends along the mid-chord line with one node: frequency, shape, dofs.

    A bending moves both edges alike, a torsion against each other.
    """
    frequencies, shapes, dofs = blade_modes(model)
    number = np.full(3 * len(model["free"]), -1)
    number[dofs] = np.arange(len(dofs))
    lines = np.searchsorted(model["free"], model["blade_lines"][:, 1:])
    span = np.linspace(0, 1, lines.shape[1] + 1)[1:]
    stagger = np.radians(o.stagger[0] + (o.stagger[1] - o.stagger[0]) * span)
    for frequency, shape in zip(frequencies, shapes.T):
        y, z = (shape[number[3 * lines + axis]] for axis in (1, 2))
        front, middle, back = np.cos(stagger) * y - np.sin(stagger) * z
        bends = np.linalg.norm(front + back) > np.linalg.norm(front - back)
        if bends and np.count_nonzero(np.diff(np.sign(middle))) == 1:
            return float(frequency), shape, dofs
    raise InputError("the blade has no second bending among its lowest modes", None, frequencies, "one", "change blade")


def likeness(model: dict[str, Any], wave: Array, shape: Array, dofs: Any) -> float:
    """Share of a wave's kinetic energy that moves the blade like the held blade's mode.

    Parameters
    ----------
    wave : (n_dof,) complex
        On the unreduced sector with both faces.
    shape, dofs
        As `second_bending` gives them.
    """
    M = model["M"]
    along = shape @ (M[dofs][:, dofs] @ wave[dofs])
    return float(abs(along) ** 2 / (shape @ (M[dofs][:, dofs] @ shape)) / (wave.conj() @ (M @ wave)).real)
