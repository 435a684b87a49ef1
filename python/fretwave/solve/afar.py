"""A mode's first point by way of other amplitudes, where the mode is next to a linear one."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from petsc4py import PETSc

from ..errors import InputError
from ..hb.harmonic_problem import HarmonicProblem
from ..hb.nonlinear_mode import NonlinearMode
from ..model.model import Model
from ..model.modes import LinearMode, linear_modes
from ..mpi.destroyable import Owned
from .steps import StepControl

if TYPE_CHECKING:
    from .continuation import Continuation

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
#: Lowest modes without contact among which the likest one is looked for.
FREE_MODES = 24
#: Of its shape, in inertia: less is another mode's.
ALIKE = 0.6


#: Follows a branch, as `Continuation` does.
Follow = Callable[..., Any]


def far_from_start(problem: HarmonicProblem, y: PETSc.Vec, linear: LinearMode | None = None) -> bool:
    """Whether a first point of a mode stands so far from the linear one that it may be of another. Collective.

    Parameters
    ----------
    linear : by default that of the problem
    """
    if not isinstance(problem, NonlinearMode):
        return False
    return bool(abs(problem.state(y)["omega0"] / (linear or problem.start).omega - 1.0) > FAR)


def grown(
    follow: Follow, problem: NonlinearMode, y0: PETSc.Vec, reasons: list[str], far: bool
) -> Iterator[tuple[str, PETSc.Vec]]:
    """The mode grows from an amplitude at which the linear one solves it."""
    yield from _from_afar(follow, problem, y0, reasons, far, 0.01)


def shrunk(
    follow: Follow, problem: NonlinearMode, y0: PETSc.Vec, reasons: list[str]
) -> Iterator[tuple[str, PETSc.Vec]]:
    """The mode comes down from an amplitude beside which friction, a bounded force, is small.

    Regularised friction is viscous at small amplitudes, and may leave none of them that oscillates. At large ones it
    is the linear mode without contact, far from the stuck one where much hangs on that.
    """
    yield from _from_afar(follow, problem, y0, reasons, False, 100.0)
    if len(problem.unfolding(y0)) == 0 and (free := _without_contact(problem)) is not None:
        yield from _beside(follow, problem, y0, free)
        yield from _from_afar(follow, problem, y0, reasons, False, 100.0, free)


def _beside(
    follow: Follow, problem: NonlinearMode, y0: PETSc.Vec, free: NonlinearMode
) -> Iterator[tuple[str, PETSc.Vec]]:
    """The mode at the amplitude of y0, if it is near to the linear one without contact there."""
    amplitude = problem.parameter(y0)
    with Owned() as own:
        guess = own(_guess(problem, amplitude, free))
        branch = own(follow(problem, guess, (0.5 * amplitude, 2 * amplitude), upwards=True, way=True))
        if (point := next(branch, None)) is None:
            return
        point = own(point)
        if far_from_start(problem, point.y, free.start):
            return
        y = point.y.copy()
    yield f"from the linear mode without contact ({free.start.frequency_hz:.6g} Hz)", y


def _without_contact(problem: NonlinearMode) -> NonlinearMode | None:
    """The problem from that of its lowest modes without contact that is alike to its own; None without. Collective."""
    model = problem.model
    try:
        modes = linear_modes(model, min(FREE_MODES, model.n_dof), "free")
        likeness = _alike(model, problem.start, modes)
        alike, mode = max(zip(likeness, modes), key=lambda pair: pair[0])
        if alike < ALIKE:
            return None
        return NonlinearMode(model, problem.harmonics, problem.method, problem.dof, mode, problem.prefix)
    except InputError:  # on all ranks: there are none, or it does not move what is normalised
        return None


def _alike(model: Model, one: LinearMode, others: Sequence[LinearMode]) -> list[float]:
    """|phi^H M psi| of modes of unit modal mass: 1 for the same shape, 0 for another mode's. Collective."""
    inertia = model.inertia(one.shape) + 1j * model.inertia(one.imaginary)
    mass = abs(np.vdot(one.shape + 1j * one.imaginary, inertia))
    return [abs(np.vdot(psi.shape + 1j * psi.imaginary, inertia)) / np.sqrt(mass) for psi in others]


def _guess(problem: NonlinearMode, amplitude: float, free: NonlinearMode | None) -> PETSc.Vec:
    """The problem's linear mode at an amplitude, or that without contact. Collective."""
    if free is None:
        return problem.initial(amplitude)
    y = free.initial(amplitude)
    first, end = y.getOwnershipRange()
    if end == y.getSize():  # beta, omega over that of the linear mode, and the amplitude are the last entries
        y.setValue(end - 2, free.start.omega / problem.start.omega)
    y.assemble()
    return y


def _from_afar(
    follow: Follow,
    problem: NonlinearMode,
    y0: PETSc.Vec,
    reasons: list[str],
    far: bool,
    ratio: float,
    free: NonlinearMode | None = None,
) -> Iterator[tuple[str, PETSc.Vec]]:
    """The mode followed to the amplitude of y0 from the nearest one, of those a ratio apart, that has a mode.

    Parameters
    ----------
    free : whose linear mode it starts from, by default the problem's
    """
    of = "" if free is None else f" of the linear one without contact ({free.start.frequency_hz:.6g} Hz)"
    amplitude, upwards = problem.parameter(y0), ratio < 1
    for power in range(1, AFAR + 1):
        begin = amplitude * ratio**power
        span = (0.5 * begin, amplitude) if upwards else (amplitude, 2 * begin)
        for control in GROWTH:
            with Owned() as own:
                guess = own(_guess(problem, begin, free))
                branch = own(follow(problem, guess, span, control, upwards=upwards, way=True))
                last, count, reason = last_of(branch, amplitude, (free or problem).start)
                converged = branch.converged
            if converged and last is not None:
                yield f"the mode was followed from amplitude {begin:.3g}{of} in {count} steps", last
                return
            end = ""
            if last is not None:
                end = f" to {problem.parameter(last):.3g}"
                last.destroy()
            if not count:
                break
        if count:
            reasons.append(f"following the mode from amplitude {begin:.3g}{of}{end}: {reason}")
            return
    if not far:
        which = "smaller" if upwards else "larger"
        reasons.append(f"no mode was found at {AFAR} {which} amplitudes{of}, to {begin:.3g}")


def last_of(branch: Continuation, goal: float, linear: LinearMode | None = None) -> tuple[PETSc.Vec | None, int, str]:
    """Unknowns of the last point of a branch, the number of its points, and why it ended. Collective.

    Parameters
    ----------
    goal : parameter that it is to reach
    linear : nothing is followed from a first point far from this mode
    """
    last, count, nearest, since = None, 0, np.inf, 0
    for point in branch:
        if last is not None:
            last.destroy()
        point.tangent.destroy()
        last, count = point.y, count + 1
        if linear and count == 1 and far_from_start(branch.problem, last, linear):
            last.destroy()
            return None, 0, branch.reason
        if (left := abs(point.parameter - goal)) < nearest:
            nearest, since = left, count
        if count - since >= STALLED:
            return last, count, f"it comes no nearer in {STALLED} points"
    return last, count, branch.reason
