"""Pictures of the blisk: mesh, mode shape around the wheel, and families."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import numpy as np
import numpy.typing as npt
from matplotlib import pyplot as plt
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from fretwave import rotation

Array = npt.NDArray[np.float64]
DISK, RING = "#8fb3cf", "#d1495b"


def quads(model: dict[str, Any]) -> Array:
    """Corners (n, 4) of the boundary faces' nodes."""
    faces = model["boundary_faces"]
    return np.stack([faces[:, 0, 0], faces[:, -1, 0], faces[:, -1, -1], faces[:, 0, -1]], axis=1)


def show(axes: Any, points: Array, elevation: float, azimuth: float, zoom: float = 1.3) -> None:
    """Equal scales around the points, no frame."""
    middle, half = (points.max(axis=0) + points.min(axis=0)) / 2, np.ptp(points, axis=0) / 2
    axes.set(**{f"{name}lim": (c - h, c + h) for name, c, h in zip("xyz", middle, half)})
    axes.set_box_aspect(half, zoom=zoom)
    axes.view_init(elevation, azimuth)
    axes.set_axis_off()


def mesh(model: dict[str, Any], path: Path) -> None:
    """The sector, and its section at the groove with ring and contact pairs."""
    figure = plt.figure(figsize=(10, 5.2), constrained_layout=True)
    nodes, faces = upright(model["coordinates"]), quads(model)
    colours = np.where((faces >= model["disk_nodes"]).all(axis=1), RING, DISK)
    axes = figure.add_subplot(1, 2, 1, projection="3d")
    axes.add_collection3d(Poly3DCollection(nodes[faces], facecolors=colours, edgecolors="0.25", linewidths=0.25))
    show(axes, nodes, 15, 215, 1.15)
    axes.set_title(f"sector, {model['M'].shape[0]:,} dofs", fontsize=10)
    ring, points = faces[colours == RING], upright(model["points"])
    axes = figure.add_subplot(1, 2, 2, projection="3d")
    axes.add_collection3d(Poly3DCollection(nodes[ring], facecolors=RING, edgecolors="0.25", linewidths=0.4, alpha=0.35))
    axes.scatter(*points.T, color="k", s=14, depthshade=False)
    show(axes, nodes[np.unique(ring)], 35, 35, 1.0)
    axes.set_title(f"ring with {len(points)} contact pairs on its outer side", fontsize=10)
    figure.savefig(path, dpi=130)
    plt.close(figure)


def upright(points: Array) -> Array:
    """Coordinates (n, 3) with the radius upwards: z, -y, x."""
    return np.column_stack([points[:, 2], -points[:, 1], points[:, 0]])


def shape(o: Any, model: dict[str, Any], wave: Array, frequency: float, path: Path) -> None:
    """The whole wheel at one instant, coloured by the axial displacement."""
    moved = np.zeros((len(model["coordinates"]), 3), dtype=complex)
    moved[model["free"]] = wave.reshape(-1, 3) / abs(wave[model["tip"]])
    faces, theta = quads(model), 2 * np.pi / o.blades
    polygons, values = [], []
    for j in range(o.blades):
        turn = rotation(j * theta, "z")
        motion = (moved * np.exp(-4j * j * theta)).real  # 4 nodal diameters
        polygons.append(((model["coordinates"] + 0.012 * motion) @ turn.T)[faces])
        values.append(motion[faces][:, :, 2].mean(axis=1))
    figure = plt.figure(figsize=(7.6, 6.6), constrained_layout=True)
    axes = figure.add_subplot(projection="3d")
    shade = np.concatenate(values)
    collection = Poly3DCollection(np.concatenate(polygons), cmap="RdBu_r", linewidths=0)
    collection.set_array(shade)
    collection.set_clim(-1, 1)
    axes.add_collection3d(collection)
    show(axes, np.concatenate(polygons).reshape(-1, 3), 55, -70, 1.25)
    axes.set_title(f"second bending at 4 nodal diameters, stuck ring, {frequency:.1f} Hz", fontsize=10)
    figure.colorbar(collection, ax=axes, shrink=0.6, label="axial displacement, 1 at the blade's observed tip")
    figure.savefig(path, dpi=130)
    plt.close(figure)


def families(table: Array, exact: dict[int, Array], path: Path) -> None:
    """Frequencies over nodal diameters; crosses: unreduced."""
    figure, axes = plt.subplots(figsize=(7.5, 4.8), constrained_layout=True)
    for number, family in enumerate(table.T):
        label = "reduced, contact stuck" if number == 0 else None
        axes.plot(range(len(table)), family / 1e3, "-o", ms=3, lw=1, color="#00798c", label=label)
    for number, (diameters, values) in enumerate(exact.items()):
        label = "unreduced" if number == 0 else None
        axes.plot([diameters] * len(values), values / 1e3, "x", ms=8, color="#d1495b", label=label)
    axes.set(xlabel="nodal diameters", ylabel="frequency [kHz]", ylim=(0, None), xticks=range(0, len(table), 2))
    axes.legend(frameon=False, loc="upper left")
    figure.savefig(path, dpi=130)
    plt.close(figure)
