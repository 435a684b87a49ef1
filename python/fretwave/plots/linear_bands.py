"""What the diagrams of a linear analysis share: each mode's band from stuck to sliding, and where damping peaks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes

from ..arrays import AnyArray
from ..post.engine_orders import frequency_at
from ..results.analysis import Analysis, Table
from ..results.reader import Run
from ..results.stamp import of_one_model
from . import style
from .backbone import is_peak, peak_point

#: A nonlinear mode belongs to a linear one when their stuck frequencies agree to this relative difference.
SAME = 1e-3
PEAK_NAME = "largest damping of a nonlinear mode"
#: In none of the modes' colours, and beneath the crossings.
PEAK = {**style.PEAK, "color": "white", "markersize": 9, "zorder": 2.5}


@dataclass(frozen=True)
class Band:
    """A linear mode in one wave; of a structure in the only one.

    Attributes
    ----------
    number : of the mode, 1 is the lowest
    contact, other : limits of the contact that `hz` and `other_hz` belong to
    diameter : nodal diameters
    speeds : (S,) ascending [rev/min]; one where the frequencies do not depend on it
    hz, other_hz : (S,) [Hz]
        `other_hz` of the mode most like it in the other limit, or nan.
    like : (S,)
        Number of that mode, or nan.
    """

    number: int
    contact: str
    other: str
    diameter: int
    speeds: AnyArray
    hz: AnyArray
    other_hz: AnyArray
    like: AnyArray

    @property
    def colour(self) -> str:
        """Of its lines and its area."""
        return style.PALETTE[(self.number - 1) % len(style.PALETTE)]

    def at(self, speed: float | AnyArray) -> tuple[AnyArray, AnyArray]:
        """Both frequencies at other speeds."""
        return frequency_at(self.speeds, self.hz, speed), frequency_at(self.speeds, self.other_hz, speed)


@dataclass(frozen=True)
class Peak:
    """Frequency [Hz] at which the damping of a nonlinear mode is largest.

    Attributes
    ----------
    diameter : nodal diameters
    speed : at which its band has the mode's stuck frequency [rev/min]; None where the bands do not depend on it
    """

    diameter: int
    speed: float | None
    hz: float


def bands(linear: Analysis) -> list[Band]:
    """Of the modes with contact stuck, or where there are none in the first of the other limits; by mode and wave."""
    table, none = linear.columns, np.zeros(len(linear))
    waves, speeds = table.get("nodal_diameter", none), table.get("speed_rpm", none)
    limits, found = linear["contact"], []
    contact, other = str(limits[0]), "sliding" if "sliding" in limits else "free"
    own = limits == contact
    for number in np.unique(table["mode"][own]):
        for diameter in np.unique(waves[own & (table["mode"] == number)]):
            rows = own & (table["mode"] == number) & (waves == diameter)
            there = (limits == other) & (waves == diameter)
            like = np.array([_like(table, there & (speeds == speeds[row]), row) for row in np.flatnonzero(rows)])
            values = (speeds[rows], table["frequency_hz"][rows], table["other_hz"][rows], like)
            found.append(Band(int(number), contact, other, int(diameter), *values))
    return found


def _like(table: Table, there: AnyArray, row: int) -> float:
    """Number of the mode, among those in the other limit, that the `other_hz` of a row is of."""
    if not (there.any() and np.isfinite(table["other_hz"][row])):
        return np.nan
    return float(table["mode"][there][np.argmin(np.abs(table["frequency_hz"][there] - table["other_hz"][row]))])


def other_entry(axes: Axes, drawn: Sequence[Band]) -> None:
    """The legend's word on the other ends of the bands."""
    others = [band.other for band in drawn if np.isfinite(band.other_hz).any()]
    if others:
        axes.plot([], [], "--", color=style.GREY, linewidth=1.0, label=f"the mode most like it, {others[0]}")


def highest(drawn: Sequence[Band]) -> float:
    """The largest frequency [Hz] of all bands."""
    return float(np.nanmax([np.nanmax([band.hz, band.other_hz]) for band in drawn]))


def peaks(run: Run, linear: Analysis, drawn: Sequence[Band]) -> Iterator[Peak]:
    """Of the nonlinear modes of the same model in the folder that are done and begin in one of the bands."""
    for mode in (mode for mode in run.of_kind("mode") if of_one_model(linear, mode)):
        stuck, diameter = mode.asymptote("stuck"), abs(int(mode.attributes.get("nodal_diameter", 0)))
        point = peak_point(mode)
        if stuck is None or mode.attributes.get("wheel") or mode.attributes.get("status") != "done":
            continue
        if not is_peak(mode, point):
            continue
        for band in drawn:
            near = np.abs(band.hz - stuck / (2 * np.pi)) < SAME * band.hz
            if band.diameter == diameter and near.any():
                speed = float(band.speeds[near][0]) if len(band.speeds) > 1 else None
                yield Peak(diameter, speed, float(mode.columns["frequency_hz"][point]))
