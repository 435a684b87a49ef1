"""Pictures of the blisk: mesh, mode shape around the wheel, and families."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from fretwave import rotation
from fretwave.plots import solid, style
from fretwave.units import SI

Array = npt.NDArray[np.float64]
#: The sector as the groove shows, its ring alone from outside, and the wheel.
SECTOR, RING, WHEEL = solid.Camera(215.0, 15.0), solid.Camera(35.0, 55.0), solid.Camera(-70.0, 38.0)
#: Share of the picture by which the moved observed tip leaves its place.
DRAWN = 0.03


def quads(model: dict[str, Any]) -> npt.NDArray[np.int64]:
    """Corners (n, 4) of the boundary faces' nodes, counter-clockwise from outside."""
    faces = model["boundary_faces"]
    return np.stack([faces[:, 0, 0], faces[:, -1, 0], faces[:, -1, -1], faces[:, 0, -1]], axis=1)


def outward(points: Array, faces: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """The faces of a closed solid the way round that its volume is positive."""
    corners = points[faces]
    areas = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]) / 2
    volume = np.einsum("nx,nx->", areas, corners.mean(axis=1)) / 3
    return faces if volume > 0 else faces[:, ::-1]


def mesh(model: dict[str, Any], path: Path) -> None:
    """The sector, and its ring with the contact pairs, which the disk hides."""
    nodes = upright(model["coordinates"])
    faces = outward(nodes, quads(model))
    ring = (faces >= model["disk_nodes"]).all(axis=1)
    scale, unit = SI.of_faces
    with style.rules():
        figure, (left, right) = style.new_figure(5.4, columns=2, width_ratios=(1.0, 1.1))
        colours = np.where(ring, solid.RED, solid.STEEL)
        solid.draw(left, nodes, faces, SECTOR, colours)
        left.set_title(f"Sector, {model['M'].shape[0]:,} dofs; red: the ring")
        solid.draw(right, nodes, faces[ring], RING, solid.RED)
        places = RING.project(upright(model["points"]))
        look = {"color": style.INK, "markersize": 6.5, "markeredgecolor": "white", "linestyle": "", "zorder": 5}
        right.plot(*places.T, marker="o", **look)
        right.set_title(f"Ring, {len(places)} contact pairs on its outer side")
        for axes, camera, place in ((left, SECTOR, (0.88, 0.06)), (right, RING, (0.5, 0.0))):
            solid.ruler(axes, scale, unit)
            solid.compass(axes, camera, place, ("axial", "tangential", "radial"))
        figure.get_layout_engine().set(h_pad=0.1)
        figure.savefig(path, dpi=style.DPI)


def upright(points: Array) -> Array:
    """Coordinates (n, 3) with the radius upwards: z, -y, x."""
    return np.column_stack([points[:, 2], -points[:, 1], points[:, 0]])


def shape(o: Any, model: dict[str, Any], wave: Array, frequency: float, path: Path) -> None:
    """The whole wheel at one instant, coloured by the axial displacement."""
    moved = np.zeros((len(model["coordinates"]), 3), dtype=complex)
    moved[model["free"]] = wave.reshape(-1, 3) / abs(wave[model["tip"]])
    faces, theta = outward(model["coordinates"], quads(model)), 2 * np.pi / o.blades
    turns = [rotation(j * theta, "z") for j in range(o.blades)]
    still = np.concatenate([model["coordinates"] @ turn.T for turn in turns])
    motion = [(moved * np.exp(-4j * j * theta)).real for j in range(o.blades)]  # 4 nodal diameters
    around = np.concatenate([faces + j * len(moved) for j in range(o.blades)])
    around = around[solid.unshared(still[around])]
    reach = DRAWN * float(np.ptp(still[:, 0]))
    points = still + reach * np.concatenate([u @ turn.T for u, turn in zip(motion, turns)])
    values = np.concatenate([u[:, 2] for u in motion])
    scale, unit = SI.of_faces
    with style.rules():
        figure, axes = style.new_figure(6.0)
        look = {"cmap": "RdBu_r", "edgecolor": "face", "linewidth": 0.2}
        faces = solid.draw(axes, points, around, WHEEL, values=values, limits=(-1.0, 1.0), look=look)
        solid.ruler(axes, scale, unit)
        axes.set_title(f"Second bending, 4 nodal diameters, stuck ring, {frequency:.1f} Hz")
        text = f"Axial displacement, 1 at the observed tip, drawn as {scale * reach:.2g} {unit}"
        figure.colorbar(faces, ax=axes, shrink=0.8, label=text, pad=0.02)
        figure.savefig(path, dpi=style.DPI)


def families(table: Array, exact: dict[int, Array], path: Path) -> None:
    """Frequencies over nodal diameters; crosses: unreduced."""
    with style.rules():
        figure, axes = style.new_figure(4.8)
        for family in table.T / 1e3:
            axes.plot(range(len(table)), family, "-o", ms=3, lw=1.2, color=style.BLUE, label="reduced, contact stuck")
        for diameters, values in exact.items():
            places = np.full(len(values), diameters)
            axes.plot(places, values / 1e3, "x", ms=8, mew=1.8, color=style.RED, label="unreduced")
        axes.set(xlabel="Nodal diameters", ylim=(0, None), xticks=range(0, len(table), 2))
        axes.set_ylabel(style.label("Frequency", "kHz"))
        style.legend_outside(figure, axes)
        figure.savefig(path, dpi=style.DPI)
