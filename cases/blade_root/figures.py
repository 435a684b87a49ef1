"""Pictures of the blade: mesh with contact nodes, and the first bending with stuck contact.

``python cases/blade_root/figures.py [folder]`` writes them as PNG.
"""

import sys
from pathlib import Path
from typing import Any, Optional

import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from matplotlib.collections import PolyCollection

Array = npt.NDArray[np.float64]
MM = 1e3  #: per metre
FLANK_COLOURS = ("#d1495b", "#00798c")  #: left, right
#: Azimuth and elevation of the eye [degrees]: the blade's right side, the left flank, the right flank.
BLADE, LEFT, RIGHT = (55.0, 18.0), (-60.0, 32.0), (60.0, 32.0)


def plot_mesh(model: dict[str, Any]) -> plt.Figure:
    """Blade and both flanks with the contact nodes, the observed dof and the axial stop."""
    figure = plt.figure(figsize=(10, 6.6), constrained_layout=True)
    grid = figure.add_gridspec(2, 2, width_ratios=(1, 1.5))
    whole = figure.add_subplot(grid[:, 0])
    draw(whole, model, model["coordinates"], BLADE)
    mark_observed(whole, model)
    if (model["opposite_nodes"] < 0).all():  # lugs of an elastic slot hide the flanks
        mark_pairs(whole, model, 1, BLADE, size=9)
    title = f"{model['K'].shape[0]:,} dofs, {len(model['hexahedra']):,} elements"
    whole.set_title(title, fontsize=10)
    compass(whole, BLADE, (0.9, 0.4))
    for row, (flank, camera) in enumerate([(0, LEFT), (1, RIGHT)]):
        axes = figure.add_subplot(grid[row, 1])
        draw(axes, model, model["coordinates"], camera, root_faces(model))
        mark_pairs(axes, model, flank, camera, size=22)
        compass(axes, camera)
        if flank == 0:
            mark_stop(axes, model, camera)
        axes.set_title(f"{model['flank_names'][flank]}: {np.sum(model['flank'] == flank)} contact pairs", fontsize=10)
    return figure


def plot_bending(model: dict[str, Any], frequency: float, shape: Array) -> plt.Figure:
    """A mode shape (n_dof,) scaled to 1 mm at the observed dof, and the motion of the contact pairs in it."""
    shape = shape * 1e-3 / shape[model["observation_dof"]]
    displacement = shape.reshape(-1, 3)
    scale = 12.0
    figure = plt.figure(figsize=(10, 5.4), constrained_layout=True)
    grid = figure.add_gridspec(2, 2, width_ratios=(1, 1.4))
    axes = figure.add_subplot(grid[:, 0])
    still = draw(axes, model, model["coordinates"], (20.0, 12.0))
    still.set(facecolor="none", edgecolor="0.8", linewidth=0.3)
    size = np.linalg.norm(displacement, axis=1) * MM
    faces = draw(axes, model, model["coordinates"] + scale * displacement, (20.0, 12.0), values=size)
    compass(axes, (20.0, 12.0), (0.75, 0.3))
    axes.set_title(f"stuck contact, {frequency:.1f} Hz (drawn {scale:.0f} times)", fontsize=10)
    figure.colorbar(faces, ax=axes, shrink=0.6, label="displacement [mm], 1 mm at the observed dof")
    relative = (model["B"] @ shape).reshape(-1, 3) * 1e6
    limit = abs(relative[:, 0]).max()
    panels = [figure.add_subplot(grid[row, 1]) for row in (0, 1)]
    for flank, panel in enumerate(panels):
        dots = plot_flank(panel, model, relative, flank, limit)
    figure.colorbar(dots, ax=panels, shrink=0.6, label="normal displacement [µm], > 0 closes")
    return figure


def plot_flank(axes: Any, model: dict[str, Any], relative: Array, flank: int, limit: float) -> Any:
    """Normal (colour) and tangential (arrows) displacement [um] of one flank's pairs."""
    mine = model["flank"] == flank
    x, up = MM * model["flank_positions"][mine].T
    # The second tangent points up one flank and down the other.
    upward = np.sign(model["contact_frames"][mine, 2, 2])
    u = relative[mine]
    dots = axes.scatter(x, up, c=u[:, 0], cmap="RdBu", vmin=-limit, vmax=limit, s=90, edgecolor="0.4", linewidth=0.5)
    reach = np.linalg.norm(relative[:, 1:], axis=1).max()
    arrows = axes.quiver(x, up, u[:, 1], u[:, 2] * upward, angles="xy", scale_units="xy", scale=reach / 3, width=0.004)
    axes.quiverkey(arrows, 0.6, 1.12, reach, f"tangential, {reach:.3f} µm", labelpos="E", fontproperties={"size": 8})
    axes.set(xlabel="axial position [mm]", ylabel="up the flank [mm]", aspect="equal", xlim=(-26, 26), ylim=(-3, 12))
    axes.set_title(model["flank_names"][flank], fontsize=10, loc="left")
    return dots


def root_faces(model: dict[str, Any]) -> npt.NDArray[np.bool_]:
    """The blade's boundary faces below the aerofoil; an elastic slot would hide the flanks."""
    faces = model["boundary_faces"]
    height = model["coordinates"][faces][..., 2].max(axis=(1, 2))
    top = model["contact_points"][:, 2].max()
    return np.asarray((height < top + 0.014) & (faces.max(axis=(1, 2)) < model["blade_nodes"]))


def view(azimuth: float, elevation: float) -> tuple[Array, Array, Array]:
    """Unit vectors to the right, up and towards the eye, of an orthographic view [degrees]."""
    a, e = np.radians([azimuth, elevation])
    eye = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    right = np.array([-np.sin(a), np.cos(a), 0.0])
    return right, np.cross(eye, right), eye


def project(points: Array, camera: tuple[float, float]) -> Array:
    """Points (.., 3) [m] on the picture (.., 2) [mm]."""
    right, up, _ = view(*camera)
    return np.asarray(np.stack([points @ right, points @ up], axis=-1) * MM)


def draw(
    axes: Any,
    model: dict[str, Any],
    points: Array,
    camera: tuple[float, float],
    keep: Optional[npt.NDArray[np.bool_]] = None,
    values: Optional[Array] = None,
) -> PolyCollection:
    """Element faces towards the eye, far ones first, shaded by the light or coloured by nodal values (n_nodes,)."""
    lattice = model["boundary_faces"][keep] if keep is not None else model["boundary_faces"]
    outline = np.concatenate(
        [lattice[:, :-1, 0], lattice[:, -1, :-1], lattice[:, :0:-1, -1], lattice[:, 0, :0:-1]], axis=1
    )
    right, up, eye = view(*camera)
    p = points[outline]
    normal = np.cross(points[lattice[:, -1, -1]] - p[:, 0], points[lattice[:, 0, -1]] - points[lattice[:, -1, 0]])
    normal = normal / np.linalg.norm(normal, axis=1)[:, None]
    seen = np.flatnonzero(normal @ eye > 0)
    seen = seen[np.argsort(p[seen].mean(axis=1) @ eye)]
    faces = PolyCollection(project(p[seen], camera), edgecolor="0.25", linewidth=0.25)
    if values is None:
        light = 0.5 + 0.5 * np.clip(normal[seen] @ (0.45 * right + 0.5 * up + 0.74 * eye), 0, 1)
        faces.set_facecolor(light[:, None] * np.array([0.87, 0.90, 0.95]))
    else:
        faces.set_array(values[outline[seen]].mean(axis=1))
    axes.add_collection(faces)
    axes.set_aspect("equal")
    axes.autoscale_view()
    axes.set_axis_off()
    return faces


def mark_pairs(axes: Any, model: dict[str, Any], flank: int, camera: tuple[float, float], size: float) -> None:
    mine = model["contact_points"][model["flank"] == flank]
    axes.scatter(
        *project(mine, camera).T, s=size, color=FLANK_COLOURS[flank], zorder=3, edgecolor="white", linewidth=0.4
    )


def mark_observed(axes: Any, model: dict[str, Any]) -> None:
    point = project(model["coordinates"][model["observation_dof"] // 3], BLADE)
    axes.scatter(*point, s=40, color="#edae49", edgecolor="black", linewidth=0.6, zorder=3)
    axes.annotate("observed: y, trailing edge", point, (-4, 12), textcoords="offset points", fontsize=8)


def mark_stop(axes: Any, model: dict[str, Any], camera: tuple[float, float]) -> None:
    """Nodes of the end face that the axial springs hold."""
    points = project(model["coordinates"][model["stop_nodes"]], camera)
    axes.scatter(*points.T, s=12, marker="s", facecolor="#edae49", edgecolor="black", linewidth=0.3, zorder=3)
    axes.annotate("axial stop", points[np.argmax(points[:, 0])], (30, 12), textcoords="offset points", fontsize=8)


def compass(axes: Any, camera: tuple[float, float], place: tuple[float, float] = (0.1, 0.08)) -> None:
    """The three axes, foreshortened as seen, at a place given in shares of the picture."""
    for letter, ends in zip("xyz", project(np.eye(3), camera) / MM):
        start = np.array(place)
        tip = start + 0.07 * ends
        arrow = dict(arrowstyle="-", color="0.3", linewidth=1.0, shrinkA=0, shrinkB=0)
        axes.annotate("", tip, start, xycoords="axes fraction", arrowprops=arrow)
        axes.text(*(start + 0.09 * ends), letter, transform=axes.transAxes, fontsize=8, ha="center", va="center")


def main(folder: Path) -> None:
    """Build, solve and draw the default blade."""
    from model import blade, stuck_modes

    plt.switch_backend("Agg")
    model = blade()
    frequencies, shapes = stuck_modes(model)
    folder.mkdir(parents=True, exist_ok=True)
    plot_mesh(model).savefig(folder / "mesh.png", dpi=150)
    plot_bending(model, frequencies[0], shapes[:, 0]).savefig(folder / "first_bending.png", dpi=150)
    print(f"stuck modes [Hz]: {np.round(frequencies, 2)}; pictures in {folder}")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "runs/blade_root"))
