"""Tables within an analysis: its steps along a branch, its dampers, the mistuning of its wheel."""

from __future__ import annotations

from typing import Optional, Union

from ..solve.steps import StepControl
from .fields import Deviations, Dof, Positive, Section, Whole, key


class StepSection(Section):
    """Step control of the continuation."""

    initial: Positive = key("length of the first arclength step", "-", "0.05", default=StepControl.initial)
    minimum: Positive = key("shortest step, but over a corner", "-", "1e-9", default=StepControl.minimum)
    maximum: Positive = key("longest step", "-", "0.3", default=StepControl.maximum)
    max_angle: Positive = key(
        "largest turn of the branch in one step", "rad", "0.6", default=StepControl.max_angle, le=3.2
    )
    max_error: Positive = key(
        "largest distance of the branch from the curve through its points", "-", "5e-4", default=StepControl.max_error
    )
    max_points: Whole = key(
        "largest number of points of the branch", example="5000", default=StepControl.max_points, ge=2
    )


class Damper(Section):
    """A viscous damper from one dof to ground, added in one analysis."""

    dof: Dof = key("dof the damper acts on", example='"m1"')
    c: float = key("damper constant, negative to destabilise", "force s/length", "-1.0", allow_inf_nan=False)


class MistuningSection(Section):
    """Relative deviations of a stiffness from sector to sector: drawn, or given one by one."""

    of: str = key(
        "part of the stiffness that varies: one of the builder's, or `sector`, all of it",
        example='"blade"',
        default="sector",
    )
    standard_deviation: Optional[Positive] = key(
        "of normally distributed deviations, less their mean", "-", "0.02", default=None, lt=0.3
    )
    seed: Whole = key(
        "of the deviations that are drawn; unless given that of [uncertainty], if there is one",
        example="1",
        default=1,
        ge=0,
    )
    deviations: Optional[Union[str, Deviations]] = key(
        "instead, one for each sector, or a .csv file with the columns `sector` (from 0) and `deviation`",
        "-",
        "[0.01, -0.02, 0.005]",
        default=None,
    )
