"""A point of a branch, and a loop over points that frees them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from petsc4py import PETSc

from .trace import Knot


@dataclass
class Point:
    """A converged point of a branch. `y` and `tangent` are the caller's to keep or, once the next point is
    there, to `destroy` (`points_of` does).

    Attributes
    ----------
    parameter : amplitude (modes) or omega (forced response)
    event : "", start, stop, report, fold, zero_damping or peak_damping of a mode, peak of a response
    step : arclength from the last regular point
    wall_s : seconds since the point before; of a step with events inside, without theirs
    rounding : error of the residual that rounding leaves, expected
    accepted : 1 where the residual is below the tolerance, 0 where rounding let it fall no further
    knot : its scalars and their derivatives over the step, where they are traced
    errors : as `HarmonicProblem.errors` gives them, where the continuation has asked for them
    """

    index: int
    y: PETSc.Vec
    tangent: PETSc.Vec
    parameter: float
    step: float
    event: str
    newton: int
    linear: int
    residual: float
    wall_s: float
    rounding: float = 0.0
    accepted: int = 1
    knot: Knot | None = None
    errors: dict[str, float] | None = None

    def __repr__(self) -> str:
        what = f" {self.event}" if self.event else ""
        return f"Point({self.index}:{what} at {self.parameter:.6g}, residual {self.residual:.1e})"

    def destroy(self) -> None:
        """Free `y` and `tangent`. Collective."""
        self.y.destroy()
        self.tangent.destroy()


def points_of(branch: Iterable[Point]) -> Iterator[Point]:
    """Points of a branch; their vectors are freed a point later, for the branch may look back at its last one.

    The one at which a loop is left stays the caller's.
    """
    before = None
    try:
        for point in branch:
            yield point
            if before is not None:
                before.destroy()
            before = point
    finally:
        if before is not None:
            before.destroy()
