"""Options of a view, and the factor that displacements are drawn with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError

#: The largest displacement or depth as drawn, as a share of what is shown, where no scale is given.
DRAWN = 0.1


@dataclass(frozen=True)
class ViewOptions:
    """What the command line says besides the run folder.

    Attributes
    ----------
    points : numbers of points of the branch
    amplitudes : modal amplitudes [length]; the nearest kept points are shown
    phases : number of steps of a period
    scale : factor on the displacement in the field ``warp``; None chooses one
    linear : eight linear hexahedra in place of a triquadratic one
    sectors : those shown of a wheel; empty for all
    how : a point is asked for, in messages
    png, gif : a picture, and an animation
    pvd : a series of files of the outer faces, in place of VTKHDF
    eye : azimuth and elevation of it in pictures [degrees]
    """

    analysis: str | None = None
    points: Sequence[int] = ()
    amplitudes: Sequence[float] = ()
    phases: int = 32
    scale: float | None = None
    linear: bool = False
    sectors: Sequence[int] = ()
    out: Path | None = None
    how: str = "--point {}"
    png: bool = False
    gif: bool = False
    pvd: bool = False
    eye: tuple[float, float] | None = None

    @property
    def skin(self) -> bool:
        """Nothing but the outer faces is needed."""
        return self.pvd or self.png or self.gif

    def refuse_pictures(self, name: str) -> None:
        """Of an analysis that shows something else than a motion, before anything is written.

        Raises
        ------
        InputError
            A picture or an animation is asked for.
        """
        if self.png or self.gif:
            expected = "the motion at a point, or a file for ParaView"
            raise InputError("this is no motion to draw", f"analysis '{name}'", None, expected, "--point N")

    @classmethod
    def checked(cls, scale: str, phases: int, **others: Any) -> ViewOptions:
        """From the words of the command line.

        Raises
        ------
        InputError
            The scale is neither ``auto`` nor a number, the eye is nowhere, or there are no phases.
        """
        if phases < 1:
            raise InputError("a period has no phases", "--phases", phases, ">= 1", "--phases 32")
        try:
            factor = None if scale == "auto" else float(scale)
        except ValueError:
            factor = np.nan
        if factor is not None and not np.isfinite(factor):
            raise InputError("the scale is no number", "--scale", scale, "auto or a number", "--scale auto")
        eye = others.get("eye")
        if eye is not None and not np.isfinite(eye).all():
            measured, fix = f"{eye[0]:g} {eye[1]:g}", "--eye -60 25"
            raise InputError("the eye is nowhere", "--eye", measured, "two angles in degrees", fix)
        return cls(scale=factor, phases=phases, **others)


def natural_scale(size: float, largest: float) -> float:
    """Factor that draws the largest displacement as a share of the size of what is shown [length]."""
    return float(f"{DRAWN * size / largest:.2g}") if largest > 0 and size > 0 else 1.0
