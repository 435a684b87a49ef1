"""Lengths of steps along a branch, over wear cycles and in time.

Their defaults stand here alone; case files take them from here.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..errors import InputError
from ..given import positive, relative_tolerance, whole

if TYPE_CHECKING:
    from .. import _core

#: Relative tolerance of integrations in time.
TIME_TOLERANCE = 1e-10
#: Coarsest of a motion whose cycles are looked at: at 1e-2 a cycle of an undamped oscillator is off by 2 %, as much as
#: damping does, and a limit cycle of dry friction wanders by tens of percent.
COARSEST_TOLERANCE = 1e-3


@dataclass(frozen=True)
class StepControl:
    """Arclength steps; 0.1 is about a tenth of the motion's own size, or of log amplitude.

    Attributes
    ----------
    minimum : shortest step before a branch is given up, but over a corner where a pair changes its state
    max_angle : largest turn [rad] of the branch in one step; longer steps are halved
    max_error : largest distance between the branch and the cubic through its points and tangents; likewise

    Raises
    ------
    InputError
        A value is not a positive number.
    """

    initial: float = 0.05
    minimum: float = 1e-9
    maximum: float = 0.3
    max_angle: float = 0.6
    max_error: float = 5e-4
    max_points: int = 5000

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            positive(f"step.{name}", value)
        if (whole(self.max_points) or 0) < 2:
            expected = "a whole number >= 2"
            raise InputError("a branch needs two points", "step.max_points", self.max_points, expected, "allow more")

    def core(self) -> _core.StepControl:
        """The compiled twin."""
        from .. import _core

        steps = _core.StepControl()
        for name, value in vars(self).items():
            setattr(steps, name, value)
        return steps


#: Why a step over wear cycles becomes too short, and why a march with many ends.
TOO_FAST, TOO_MANY = "the contact changes too fast", "largest number of points"


@dataclass(frozen=True)
class WearControl:
    """How long the steps over wear cycles are.

    Attributes
    ----------
    stepper : name in `fretwave.solve.steppers.STEPPERS`
    tolerance : largest estimated error of a step's depths, relative to a pair's own and the one that takes the mean
        normal load at the start away
    pressure_change : largest change of a pair's mean normal force in a step, relative to that load
    first, fixed : length of the first step [cycles]; `fixed` for all steps, without control
    max_points : of a march, which ends there

    Raises
    ------
    InputError
        A value is not a positive number, the tolerance not below one, or there is no such stepper.
    """

    stepper: str = "bogacki_shampine"
    tolerance: float = 1e-3
    pressure_change: float = 0.2
    first: float | None = None
    fixed: bool = False
    max_points: int = 5000

    def __post_init__(self) -> None:
        from .steppers import STEPPERS

        relative_tolerance("wear.tolerance", self.tolerance)
        positive("wear.pressure_change", self.pressure_change)
        if self.first is not None:
            positive("wear.first", self.first)
        if (whole(self.max_points) or 0) < 2:
            expected = "a whole number >= 2"
            raise InputError("a march needs two points", "wear.max_points", self.max_points, expected, "allow more")
        if self.stepper not in list(STEPPERS):
            raise InputError("unknown stepper", None, self.stepper, ", ".join(STEPPERS), "choose one of these")
