"""Pictures of the blade: mesh with contact nodes, and the first bending with stuck contact.

``python cases/blade_root/figures.py [folder]`` writes them as PNG.
"""

import sys
from pathlib import Path
from typing import Any, Optional

import numpy as np
import numpy.typing as npt
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from fretwave.plots import solid, style
from fretwave.plots.solid import Camera, compass

Array = npt.NDArray[np.float64]
MM = 1e3  #: per metre
FLANK_COLOURS = (style.RED, style.BLUE)  #: left, right
#: The blade's right side, its bending, the left flank, the right flank.
BLADE, BENT, LEFT, RIGHT = Camera(55.0, 18.0), Camera(20.0, 12.0), Camera(-60.0, 32.0), Camera(60.0, 32.0)


def plot_mesh(model: dict[str, Any]) -> Figure:
    """Blade and both flanks with the contact nodes, the observed dof and the axial stop."""
    with style.rules():
        return _mesh(model)


def _mesh(model: dict[str, Any]) -> Figure:
    figure, grid = _grid(6.2)
    whole = figure.add_subplot(grid[:, 0])
    draw(whole, model, model["coordinates"], BLADE)
    mark_observed(whole, model)
    if (model["opposite_nodes"] < 0).all():  # lugs of an elastic slot hide the flanks
        mark_pairs(whole, model, 1, BLADE, size=9)
    title = f"{model['K'].shape[0]:,} dofs, {len(model['hexahedra']):,} elements"
    whole.set_title(title)
    compass(whole, BLADE, (0.9, 0.4))
    for row, (flank, camera) in enumerate([(0, LEFT), (1, RIGHT)]):
        axes = figure.add_subplot(grid[row, 1])
        draw(axes, model, model["coordinates"], camera, root_faces(model))
        mark_pairs(axes, model, flank, camera, size=22)
        compass(axes, camera)
        if flank == 0:
            mark_stop(axes, model, camera)
        axes.set_title(f"{model['flank_names'][flank]}: {np.sum(model['flank'] == flank)} contact pairs")
    return figure


def _grid(height: float) -> tuple[Figure, Any]:
    """A tall panel on the left, two on the right."""
    figure, _ = style.new_figure(height)
    figure.clear()
    return figure, figure.add_gridspec(2, 2, width_ratios=(1, 1.5))


def plot_bending(model: dict[str, Any], frequency: float, shape: Array) -> Figure:
    """A mode shape (n_dof,) scaled to 1 mm at the observed dof, and the motion of the contact pairs in it."""
    with style.rules():
        return _bending(model, frequency, shape)


def _bending(model: dict[str, Any], frequency: float, shape: Array) -> Figure:
    shape = shape * 1e-3 / shape[model["observation_dof"]]
    displacement = shape.reshape(-1, 3)
    scale = 12.0
    figure, grid = _grid(5.4)
    axes = figure.add_subplot(grid[:, 0])
    still = draw(axes, model, model["coordinates"], BENT)
    still.set(facecolor="none", edgecolor="0.8", linewidth=0.3)
    size = np.linalg.norm(displacement, axis=1) * MM
    faces = draw(axes, model, model["coordinates"] + scale * displacement, BENT, values=size, limits=(0.0, size.max()))
    compass(axes, BENT, (0.75, 0.3))
    axes.set_title(f"Stuck contact,\n{frequency:.1f} Hz, drawn × {scale:.0f}")
    figure.colorbar(faces, ax=axes, shrink=0.6, label="Displacement [mm], 1 mm at the observed dof")
    relative = (model["B"] @ shape).reshape(-1, 3) * 1e6
    limit = abs(relative[:, 0]).max()
    panels = [figure.add_subplot(grid[row, 1]) for row in (0, 1)]
    for flank, panel in enumerate(panels):
        dots = plot_flank(panel, model, relative, flank, limit)
    figure.colorbar(dots, ax=panels, shrink=0.6, label="Normal displacement [µm], > 0 closes")
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
    axes.set(xlabel="Axial position [mm]", ylabel="Up the flank [mm]", aspect="equal", xlim=(-26, 26), ylim=(-3, 12))
    axes.set_title(model["flank_names"][flank])
    return dots


def root_faces(model: dict[str, Any]) -> npt.NDArray[np.bool_]:
    """The blade's boundary faces below the aerofoil; an elastic slot would hide the flanks."""
    faces = model["boundary_faces"]
    height = model["coordinates"][faces][..., 2].max(axis=(1, 2))
    top = model["contact_points"][:, 2].max()
    return np.asarray((height < top + 0.014) & (faces.max(axis=(1, 2)) < model["blade_nodes"]))


def draw(
    axes: Any,
    model: dict[str, Any],
    points: Array,
    camera: Camera,
    keep: Optional[npt.NDArray[np.bool_]] = None,
    values: Optional[Array] = None,
    limits: tuple[float, float] = (0.0, 1.0),
) -> PolyCollection:
    """Element faces towards the eye, shaded by the light or coloured by nodal values (n_nodes,)."""
    lattice = model["boundary_faces"][keep] if keep is not None else model["boundary_faces"]
    sides = [lattice[:, :-1, 0], lattice[:, -1, :-1], lattice[:, :0:-1, -1], lattice[:, 0, :0:-1]]
    return solid.draw(axes, points, np.concatenate(sides, axis=1), camera, values=values, limits=limits)


def mark_pairs(axes: Any, model: dict[str, Any], flank: int, camera: Camera, size: float) -> None:
    mine = model["contact_points"][model["flank"] == flank]
    axes.scatter(
        *camera.project(mine).T, s=size, color=FLANK_COLOURS[flank], zorder=3, edgecolor="white", linewidth=0.4
    )


def mark_observed(axes: Any, model: dict[str, Any]) -> None:
    point = BLADE.project(model["coordinates"][model["observation_dof"] // 3])
    axes.scatter(*point, s=40, color=style.ORANGE, edgecolor="black", linewidth=0.6, zorder=3)
    axes.annotate("observed: y, trailing edge", point, (-4, 12), textcoords="offset points", fontsize=8)


def mark_stop(axes: Any, model: dict[str, Any], camera: Camera) -> None:
    """Nodes of the end face that the axial springs hold."""
    points = camera.project(model["coordinates"][model["stop_nodes"]])
    axes.scatter(*points.T, s=12, marker="s", facecolor=style.ORANGE, edgecolor="black", linewidth=0.3, zorder=3)
    axes.annotate("axial stop", points[np.argmax(points[:, 0])], (30, 12), textcoords="offset points", fontsize=8)


def main(folder: Path) -> None:
    """Build, solve and draw the default blade."""
    from model import blade, stuck_modes

    model = blade()
    frequencies, shapes = stuck_modes(model)
    folder.mkdir(parents=True, exist_ok=True)
    plot_mesh(model).savefig(folder / "mesh.png", dpi=style.DPI)
    plot_bending(model, frequencies[0], shapes[:, 0]).savefig(folder / "first_bending.png", dpi=style.DPI)
    print(f"stuck modes [Hz]: {np.round(frequencies, 2)}; pictures in {folder}")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "runs/blade_root"))
