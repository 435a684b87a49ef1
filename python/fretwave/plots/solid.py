"""Solids in parallel projection: outer faces that look at the eye, far ones first, in the light or by nodal values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.lines import Line2D
from matplotlib.transforms import ScaledTranslation, Transform

from ..arrays import Array, IntArray
from ..model.cells import normals

#: Where the light comes from: shares to the right, up and towards the eye; what of its colour a face away from it
#: keeps, and where that is a value.
LIGHT, DARK, DARK_VALUES = (0.45, 0.5, 0.74), 0.5, 0.7
#: Colours of bodies.
STEEL, RED = "#dee6f2", "#d1495b"
EDGE = "#444444"
#: Length of an axis of a compass [inch].
COMPASS = 0.35
#: Share of an axis to the side from which its name stands beside its end.
ASIDE = 0.3
#: Faces that two parts share have their middles within this share of the size.
SAME = 1e-6


@dataclass(frozen=True)
class Camera:
    """Azimuth and elevation of the eye about the z axis, which is upright [degrees]."""

    azimuth: float
    elevation: float

    @property
    def axes(self) -> tuple[Array, Array, Array]:
        """Unit vectors to the right, up and towards the eye."""
        a, e = np.radians([self.azimuth, self.elevation])
        eye = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        right = np.array([-np.sin(a), np.cos(a), 0.0])
        return right, np.cross(eye, right), eye

    def project(self, points: npt.ArrayLike) -> Array:
        """Points (.., 3) on the picture (.., 2)."""
        right, up, _ = self.axes
        return np.asarray(np.stack([np.asarray(points) @ right, np.asarray(points) @ up], axis=-1))

    def depth(self, points: npt.ArrayLike) -> Array:
        """How near to the eye points (.., 3) are (..)."""
        return np.asarray(np.asarray(points) @ self.axes[2])


def unshared(corners: Array) -> npt.NDArray[np.bool_]:
    """Which of the polygons (n, k, 3) no other lies on: faces between neighbouring sectors are inside."""
    middle = corners.mean(axis=1)
    size = SAME * float(np.ptp(middle, axis=0).max() or 1.0)
    _, number, count = np.unique(np.round(middle / size), axis=0, return_inverse=True, return_counts=True)
    return np.asarray(count[number.ravel()] == 1)


def draw(
    axes: Axes,
    points: npt.ArrayLike,
    faces: IntArray,
    camera: Camera,
    colour: str | Sequence[str] = STEEL,
    values: npt.ArrayLike | None = None,
    limits: tuple[float, float] = (0.0, 1.0),
    look: Mapping[str, Any] | None = None,
) -> PolyCollection:
    """Draw the outer faces of a solid; one that looks away from the eye is behind others.

    Parameters
    ----------
    points : (n_points, 3)
    faces : (n, k)
        Numbers of points around each face, counter-clockwise from outside.
    colour : of all, or of each face
    values : (n_points,), optional
        In place of the colour; `limits` are those of the colour map. A colour bar of the collection shows it unlit.
    look : of the collection: ``cmap``, ``edgecolor``, ``linewidth``
    """
    corners = np.asarray(points, dtype=float)[faces]
    outward = normals(corners)
    seen = np.flatnonzero(outward @ camera.axes[2] > 0)
    seen = seen[np.argsort(camera.depth(corners[seen]).mean(axis=1))]
    options = {"edgecolor": EDGE, "linewidth": 0.25, **(look or {})}
    drawn = PolyCollection(camera.project(corners[seen]), clim=limits, **options)
    if values is None:
        names = [colour] * len(faces) if isinstance(colour, str) else list(colour)
        colours, dark = np.array([to_rgb(name) for name in names]).reshape(-1, 3), DARK
    else:
        means = np.asarray(values, dtype=float)[faces].mean(axis=1)
        colours, dark = drawn.to_rgba(means)[:, :3], DARK_VALUES
    lit = (colours * _light(outward, camera, dark)[:, None])[seen]
    drawn.set(facecolor=lit, **({"edgecolor": lit} if options["edgecolor"] == "face" else {}))
    axes.add_collection(drawn)
    axes.set_aspect("equal")
    axes.autoscale_view()
    axes.set_axis_off()
    return drawn


def _light(outward: Array, camera: Camera, dark: float) -> Array:
    """Share (n,) of the light that faces with these normals have."""
    towards = np.array(LIGHT) @ np.stack(camera.axes)
    return np.asarray(dark + (1.0 - dark) * np.clip(outward @ towards, 0.0, 1.0))


def compass(
    axes: Axes,
    camera: Camera,
    place: tuple[float, float] = (0.1, 0.1),
    names: Sequence[str] = "xyz",
    of: Transform | None = None,
) -> None:
    """The three axes, foreshortened as seen, at a place given in shares of the picture, or of what `of` says.

    They are drawn in inches: in shares of a picture that is not square they would point elsewhere.
    """
    inches = axes.figure.dpi_scale_trans + ScaledTranslation(*place, of or axes.transAxes)
    for letter, end in zip(names, camera.project(np.eye(3))):
        stroke = Line2D(*zip((0.0, 0.0), COMPASS * end), color=EDGE, linewidth=1.0, transform=inches, clip_on=False)
        long = len(letter) > 1  # a word stands beside the end, a letter about its extension
        side = "left" if long and end[0] > ASIDE else "right" if long and end[0] < -ASIDE else "center"
        where = (1.15 if long else 1.4) * COMPASS * end
        text = axes.text(*where, letter, transform=inches, fontsize=9, ha=side, va="center")
        axes.add_artist(stroke)
        for artist in (stroke, text):
            artist.set_in_layout(False)


def ruler(axes: Axes, factor: float, unit: str, place: float = 0.0) -> None:
    """A bar of a round length about a quarter as long as the picture, below it.

    Parameters
    ----------
    factor : from the unit of the points to `unit`
    """
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    wanted = 0.25 * (right - left) * factor
    power = 10.0 ** np.floor(np.log10(wanted))
    length = max(step * power for step in (1.0, 2.0, 5.0) if step * power <= wanted)
    y, x = bottom - 0.04 * (top - bottom), left + place * (right - left)
    axes.plot([x, x + length / factor], [y, y], color=EDGE, linewidth=2.0, solid_capstyle="butt", clip_on=False)
    text = {"textcoords": "offset points", "ha": "center", "va": "top", "fontsize": 9.5, "annotation_clip": False}
    axes.annotate(f"{length:g} {unit}", (x + length / factor / 2, y), (0, -4), **text)
