"""How long the steps of a branch are."""

from __future__ import annotations

from dataclasses import dataclass

from .. import _core


@dataclass(frozen=True)
class StepControl:
    """Arclength steps; 0.1 is about a tenth of the motion's own size, or of log amplitude.

    Attributes
    ----------
    minimum : shortest step before a branch is given up, but over the corner where a sample of contact changes state
    max_angle : largest turn [rad] of the branch in one step; longer steps are halved
    max_error : largest distance between the branch and the cubic through its points and tangents; likewise
    """

    initial: float = 0.05
    minimum: float = 1e-9
    maximum: float = 0.3
    max_angle: float = 0.6
    max_error: float = 5e-4
    max_points: int = 5000

    def core(self) -> _core.StepControl:
        """The compiled twin."""
        steps = _core.StepControl()
        for name, value in vars(self).items():
            setattr(steps, name, value)
        return steps
