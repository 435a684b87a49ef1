"""``fretwave view --png`` and ``--gif``: the moved structure as a picture and as an animation, by matplotlib alone."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Array, IntArray
from ..errors import InputError
from ..files.whole import replaced
from ..plots import scales, solid, style
from ..results.overview import amplitude_column, whose_amplitude
from .motion import Scene
from .skin import numbered, skin
from .vtkhdf import Cells

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Eye beside a structure and above a wheel: azimuth and elevation [degrees].
BESIDE, ABOVE = (-60.0, 25.0), (-70.0, 38.0)
#: Where the three axes are drawn, in shares of the picture.
CORNER = (0.06, 0.09)
#: Duration of a period in an animation [s].
PERIOD = 1.6
#: Directions in space that become x, y and z of the picture, so that a wheel's axis is upright.
UPRIGHT = {"x": [1, 2, 0], "y": [2, 0, 1], "z": [0, 1, 2]}


class Still:
    """The outer faces of a scene at the phases of the first of its points.

    Parameters
    ----------
    scale : factor on the displacement from rest
    eye : azimuth and elevation of it [degrees]; None chooses them
    """

    def __init__(self, scene: Scene, cells: Sequence[Cells], scale: float, eye: tuple[float, float] | None) -> None:
        self.scene, self.scale = scene, scale
        outer = skin(scene.nodes, cells)
        if not outer:
            fix = "give Structure its cells; without --png and --gif the nodes are written for ParaView"
            raise InputError("the model has no faces to draw", f"analysis '{scene.choice.name}'", None, "cells", fix)
        used, faces = numbered(outer)
        order = self._order()
        shapes = [scene.shape(sector) for sector in scene.sectors]
        count = len(scene.choice.phases)
        still = [shape.nodes[used][:, order] for shape in shapes]
        moved = [np.stack([x[:, order] for x, _ in zip(shape.displacements(used), range(count))]) for shape in shapes]
        rest = [shape.rest[used][:, order] for shape in shapes]
        self.points = np.concatenate(still)
        self.moved = np.concatenate([x - r for x, r in zip(moved, rest)], axis=1)
        widest = max(face.shape[1] for face in faces)
        padded = [np.pad(face, ((0, 0), (0, widest - face.shape[1])), mode="edge") for face in faces]
        self.faces = self._around(np.concatenate(padded), len(used))
        self.camera = solid.Camera(*(eye or (ABOVE if scene.around > 1 else BESIDE)))

    def _around(self, faces: IntArray, n: int) -> IntArray:
        """Of all sectors, without those between two neighbours."""
        everywhere = np.concatenate([faces + k * n for k in range(len(self.scene.sectors))])
        if len(self.scene.sectors) == 1:
            return np.asarray(everywhere)
        return np.asarray(everywhere[solid.unshared(self.points[everywhere])])

    @property
    def sizes(self) -> Array:
        """(n_phases, n_points) of the displacements from rest [length]."""
        return np.asarray(np.linalg.norm(self.moved, axis=2))

    def png(self, path: Path) -> None:
        """The phase at which the displacement is largest."""
        with style.rules():
            figure, show = self._figure()
            show(int(np.argmax(self.sizes.max(axis=1))))
            style.save(figure, path, style.VIEW)

    def gif(self, path: Path) -> None:
        """All phases one after the other, again and again."""
        from PIL import Image

        with style.rules():
            figure, show = self._figure()
            frames = []
            for phase in range(len(self.moved)):
                show(phase)
                figure.canvas.draw()
                frames.append(Image.fromarray(np.asarray(figure.canvas.buffer_rgba())[..., :3]).quantize(128))
        first, *others = frames
        wait = max(20, round(1000.0 * PERIOD / len(frames)))
        with replaced(path, own=True, keep_suffix=True) as fresh:
            first.save(fresh, format="GIF", save_all=True, append_images=others, duration=wait, loop=0)

    def _figure(self) -> tuple[Figure, Any]:
        """A picture with room for all phases, and what draws one of them."""
        figure, axes = style.new_figure(6.0)
        figure.set_layout_engine("compressed")  # the colour bar beside what is drawn, both in the middle
        unit, sizes = self.scene.choice.units, self.sizes
        shown = scales.linear(unit, unit("length"), sizes)
        largest = float(shown(sizes.max())) or 1.0
        ends = self.camera.project(self.points + self.scale * self.moved).reshape(-1, 2)
        look = {"cmap": "viridis", "linewidth": 0.2, "edgecolor": "face"}
        drawn: list[Any] = []

        def show(phase: int) -> None:
            for collection in drawn:
                collection.remove()
            points = self.points + self.scale * self.moved[phase]
            values, limits = shown(sizes[phase]), (0.0, largest)
            drawn[:] = [solid.draw(axes, points, self.faces, self.camera, values=values, limits=limits, look=look)]
            axes.set(xlim=_wide(ends[:, 0]), ylim=_wide(ends[:, 1]))

        show(0)
        figure.suptitle(self._title())
        bar = figure.colorbar(drawn[0], ax=axes, shrink=0.8, pad=0.02)
        bar.set_label(shown.label("Displacement from rest"))
        names = "".join("xyz"[k] for k in self._order())
        solid.compass(axes, self.camera, CORNER, names, figure.transFigure)
        return figure, show

    def _order(self) -> list[int]:
        return UPRIGHT[self.scene.axis if self.scene.around > 1 else "z"]

    def _title(self) -> str:
        choice = self.scene.choice
        amplitude, hertz = choice.states[amplitude_column(choice.states)][0], choice.states["frequency_hz"][0]
        shown = scales.linear(choice.units, choice.unit, amplitude).text(float(amplitude))
        of = whose_amplitude(choice.states)
        return f"{choice.name}: amplitude{of} {shown}, {hertz:.6g} Hz, drawn × {self.scale:g}"


def _wide(values: Array) -> tuple[float, float]:
    room = 0.03 * float(np.ptp(values))
    return float(values.min()) - room, float(values.max()) + room
