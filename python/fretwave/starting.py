"""First points of branches that Newton does not find from the first guess: ways to them, chosen by themselves."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from petsc4py import PETSc

from . import _core
from .continuation import Continuation, StepControl
from .problems import ForcedResponse, HarmonicProblem, NonlinearMode

#: Amplitudes below the first one, each a hundredth of the one before, at which a mode is tried.
SMALLER = 5
#: Points of a way at the most: a sampled contact turns a corner wherever one of its samples begins to slip.
WAY_POINTS = 20000


class _Way(HarmonicProblem):
    """The homotopy to a response as a problem of its own."""

    def __init__(self, problem: HarmonicProblem, core: Any) -> None:
        super().__init__(problem.model, problem.harmonics, problem.prefix, core)


def starts(problem: HarmonicProblem, y0: PETSc.Vec, reasons: list[str]) -> Iterator[tuple[str, PETSc.Vec]]:
    """Guesses for the solution at the parameter of y0, each with how it was found. Collective.

    A forced response is led there by its excitation, raised from zero at the first frequency. A mode is followed from
    a smaller amplitude, where its contacts stick.

    Parameters
    ----------
    reasons : list of str
        Takes in why a way did not lead there.
    """
    if isinstance(problem, ForcedResponse):
        found = _raised(problem, y0, reasons)
    elif isinstance(problem, NonlinearMode):
        found = _grown(problem, y0, reasons)
    else:
        found = None
    if found is not None:
        yield found


def _raised(problem: ForcedResponse, y0: PETSc.Vec, reasons: list[str]) -> tuple[str, PETSc.Vec] | None:
    """The excitation grows from nothing to its full level."""
    way = _Way(problem, _core.ForcedStart(problem.core, y0))
    control = StepControl(initial=0.05, maximum=0.3, max_points=WAY_POINTS)
    branch = Continuation(way, way.core.initial(), (-1.0, 1.0), control, upwards=True, helped=False)
    last, count = _last(branch)
    if branch.converged and last is not None:
        y = way.core.response(last)
        branch.destroy()
        return f"the excitation was raised from zero in {count} steps", y
    reasons.append(f"raising the excitation from zero: {branch.reason}")
    branch.destroy()
    return None


def _grown(problem: NonlinearMode, y0: PETSc.Vec, reasons: list[str]) -> tuple[str, PETSc.Vec] | None:
    """The mode grows from an amplitude at which the linear one solves it."""
    amplitude = float(problem.core.parameter_value(problem.last_entry(y0)))
    for power in range(1, SMALLER + 1):
        small = amplitude / 100**power
        control = StepControl(maximum=1.0, max_points=WAY_POINTS)
        branch = Continuation(
            problem, problem.initial(small), (0.5 * small, amplitude), control, upwards=True, helped=False
        )
        last, count = _last(branch)
        converged, reason = branch.converged, branch.reason
        branch.destroy()
        if converged and last is not None:
            return f"the mode was followed from amplitude {small:.3g} in {count} steps", last
        if count:
            reasons.append(f"following the mode from amplitude {small:.3g}: {reason}")
            return None
    reasons.append(f"no mode was found at {SMALLER} smaller amplitudes down to {small:.3g}")
    return None


def _last(branch: Continuation) -> tuple[PETSc.Vec | None, int]:
    """Unknowns of the last point of a branch, and the number of its points. Collective."""
    last, count = None, 0
    for point in branch:
        if last is not None:
            last.destroy()
        point.tangent.destroy()
        last, count = point.y, count + 1
    return last, count
