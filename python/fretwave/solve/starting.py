"""First points of branches that Newton does not find from the first guess: ways to them, chosen by themselves."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, Union

import numpy as np
from petsc4py import PETSc

from .. import _core
from ..hb.forced_response import ForcedResponse
from ..hb.harmonic_problem import HarmonicProblem
from ..hb.nonlinear_mode import NonlinearMode
from ..model.law_info import Role
from ..mpi.destroyable import Owned
from .steps import StepControl

if TYPE_CHECKING:
    from .continuation import Continuation

    #: A homotopy of the core.
    Start = Union[_core.ForcedStart, _core.ModeStart]

#: Amplitudes below the first one, each a hundredth of the one before, at which a mode is tried; and above it.
AFAR = 5
#: Points of a way at the most: it turns a corner wherever a pair opens or closes.
WAY_POINTS = 20000
#: Points of a way that come no nearer to its end, after which it is given up: a tangle where samples change states.
STALLED = 300
#: Steps of a mode that grows, at first in proportion: where such long ones lose their way, those of any branch.
GROWTH = (
    StepControl(initial=1.5, maximum=3.0, max_error=1e-2, max_points=WAY_POINTS),
    StepControl(max_points=WAY_POINTS),
)
#: Relative distance in frequency from the linear mode beyond which a first point may be of another mode.
FAR = 0.02
#: Relative: a first point so near to its guess was given.
GIVEN = 1e-6
CLOSING = "closing the gaps from where nothing touches"


#: Follows a branch, as `Continuation` does.
Follow = Callable[..., Any]


class Way(HarmonicProblem):
    """The homotopy to a first point as a problem of its own."""

    def __init__(self, problem: HarmonicProblem, core: Start) -> None:
        super().__init__(problem.model, problem.harmonics, problem.prefix, core)


def given(y0: PETSc.Vec, y: PETSc.Vec) -> bool:
    """Whether a first point y is what was given as y0: a solution that the caller goes on from. Collective."""
    step = y - y0
    near = bool(step.norm() <= GIVEN * y0.norm())
    step.destroy()
    return near


def far_from_start(problem: HarmonicProblem, y: PETSc.Vec) -> bool:
    """Whether a first point of a mode stands so far from the linear one that it may be of another. Collective."""
    if not isinstance(problem, NonlinearMode):
        return False
    return bool(abs(problem.state(y)["omega0"] / problem.start.omega - 1.0) > FAR)


def starts(
    follow: Follow, problem: HarmonicProblem, y0: PETSc.Vec, reasons: list[str], far: bool = False
) -> Iterator[tuple[str, PETSc.Vec]]:
    """Guesses for the solution at the parameter of y0, each with how it was found. Collective.

    A forced response is led there by its excitation, raised from zero at the first frequency; a mode is followed from
    a smaller amplitude, where its contacts stick. Either is led there by gaps that close from where nothing touches,
    a mode with regularised friction from a larger amplitude, beside which that is small.

    Parameters
    ----------
    follow : Continuation, or what else follows a branch
    reasons : list of str
        Takes in why a way did not lead there.
    far : bool
        Newton found a mode, but far from the linear one: only the mode that grows out of the linear one is looked for.
        Without a reason in the end there is none at smaller amplitudes either (a stop without gap has no linear limit).
    """
    gaps = _has(problem, Role.GAP)
    if isinstance(problem, ForcedResponse):
        yield from _raised(follow, problem, y0, reasons)
        yield from _closed(follow, problem, _core.ForcedStart(problem.core, y0, True), reasons) if gaps else ()
    elif isinstance(problem, NonlinearMode):
        yield from _grown(follow, problem, y0, reasons, far)
        if far:
            return
        yield from _closed(follow, problem, mode_start(problem, y0), reasons) if gaps else ()
        yield from _shrunk(follow, problem, y0, reasons) if _has(problem, Role.REGULARISATION) else ()


def _has(problem: HarmonicProblem, role: Role) -> bool:
    """Whether a contact has a parameter of this role."""
    return any(contact.info.named(role) in contact.parameters for contact in problem.model.contacts)


def _raised(
    follow: Follow, problem: ForcedResponse, y0: PETSc.Vec, reasons: list[str]
) -> Iterator[tuple[str, PETSc.Vec]]:
    """The excitation grows from nothing to its full level."""
    way = _core.ForcedStart(problem.core, y0, False)
    yield from _led(follow, problem, way, "raising the excitation from zero", reasons)


def _closed(
    follow: Follow, problem: HarmonicProblem, way: Start, reasons: list[str]
) -> Iterator[tuple[str, PETSc.Vec]]:
    """Gaps close that were too wide to touch."""
    yield from _led(follow, problem, way, CLOSING, reasons)


def mode_start(problem: NonlinearMode, y0: PETSc.Vec) -> _core.ModeStart:
    """The way with closing gaps at the amplitude of y0. Collective."""
    method, amplitude = getattr(_core.Method, problem.method), problem.parameter(y0)
    model, harmonics, start = problem.model.core, problem.harmonics.core, problem.start
    with problem.model.vectors(start.shape, start.imaginary) as (re, im):
        way = _core.ModeStart(model, harmonics, method, problem.row, start.omega, re, im, amplitude)
    way.keep_loads(problem.core)
    return way


def _led(
    follow: Follow, problem: HarmonicProblem, core: Start, how: str, reasons: list[str]
) -> Iterator[tuple[str, PETSc.Vec]]:
    """The solution at the end of a homotopy: an excitation that is whole (t = 1), or gaps that are no wider (t = 0)."""
    way = Way(problem, core)
    control = StepControl(initial=0.05, maximum=0.3, max_points=WAY_POINTS)
    closing = how == CLOSING
    with Owned() as own:
        begin = own(core.initial())
        stop = (0.0, 2 * way.last_entry(begin)) if closing else (-1.0, 1.0)
        branch = own(follow(way, begin, stop, control, upwards=not closing, way=True))
        last, count, reason = _last(branch, stop[0 if closing else 1])
        end = own(last) if last is not None else None
        if not branch.converged or end is None:
            reasons.append(f"{how}: {reason}")
            return
        y = core.response(end) if isinstance(core, _core.ForcedStart) else core.mode(end)
    yield f"by {how} in {count} steps", y


def _grown(
    follow: Follow, problem: NonlinearMode, y0: PETSc.Vec, reasons: list[str], far: bool
) -> Iterator[tuple[str, PETSc.Vec]]:
    """The mode grows from an amplitude at which the linear one solves it."""
    yield from _from_afar(follow, problem, y0, reasons, far, 0.01)


def _shrunk(
    follow: Follow, problem: NonlinearMode, y0: PETSc.Vec, reasons: list[str]
) -> Iterator[tuple[str, PETSc.Vec]]:
    """The mode comes down from an amplitude beside which friction, a bounded force, is small.

    Regularised friction is viscous at small amplitudes, and may leave none of them that oscillates.
    """
    yield from _from_afar(follow, problem, y0, reasons, False, 100.0)


def _from_afar(
    follow: Follow, problem: NonlinearMode, y0: PETSc.Vec, reasons: list[str], far: bool, ratio: float
) -> Iterator[tuple[str, PETSc.Vec]]:
    """The mode followed to the amplitude of y0 from the nearest one, of those a ratio apart, that has a mode."""
    amplitude, upwards = problem.parameter(y0), ratio < 1
    for power in range(1, AFAR + 1):
        begin = amplitude * ratio**power
        span = (0.5 * begin, amplitude) if upwards else (amplitude, 2 * begin)
        for control in GROWTH:
            with Owned() as own:
                branch = own(follow(problem, own(problem.initial(begin)), span, control, upwards=upwards, way=True))
                last, count, reason = _last(branch, amplitude, nearby=True)
                converged = branch.converged
            if converged and last is not None:
                yield f"the mode was followed from amplitude {begin:.3g} in {count} steps", last
                return
            end = ""
            if last is not None:
                end = f" to {problem.parameter(last):.3g}"
                last.destroy()
            if not count:
                break
        if count:
            reasons.append(f"following the mode from amplitude {begin:.3g}{end}: {reason}")
            return
    if not far:
        which = "smaller" if upwards else "larger"
        reasons.append(f"no mode was found at {AFAR} {which} amplitudes, to {begin:.3g}")


def _last(branch: Continuation, goal: float, nearby: bool = False) -> tuple[PETSc.Vec | None, int, str]:
    """Unknowns of the last point of a branch, the number of its points, and why it ended. Collective.

    Parameters
    ----------
    goal : parameter that it is to reach
    nearby : nothing is followed from a first point far from the linear mode
    """
    last, count, nearest, since = None, 0, np.inf, 0
    for point in branch:
        if last is not None:
            last.destroy()
        point.tangent.destroy()
        last, count = point.y, count + 1
        if nearby and count == 1 and far_from_start(branch.problem, last):
            last.destroy()
            return None, 0, branch.reason
        if (left := abs(point.parameter - goal)) < nearest:
            nearest, since = left, count
        if count - since >= STALLED:
            return last, count, f"it comes no nearer in {STALLED} points"
    return last, count, branch.reason
