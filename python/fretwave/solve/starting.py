"""First points of branches that Newton does not find from the first guess: ways to them, chosen by themselves."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Union

from petsc4py import PETSc

from .. import _core
from ..hb.forced_response import ForcedResponse
from ..hb.harmonic_problem import HarmonicProblem
from ..hb.nonlinear_mode import NonlinearMode
from ..model.law_info import Role
from ..mpi.destroyable import Owned
from .afar import WAY_POINTS, Follow, grown, last_of, shrunk
from .steps import StepControl

if TYPE_CHECKING:
    #: A homotopy of the core.
    Start = Union[_core.ForcedStart, _core.ModeStart]

#: Relative: a first point so near to its guess was given.
GIVEN = 1e-6
CLOSING = "closing the gaps from where nothing touches"


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


def starts(
    follow: Follow, problem: HarmonicProblem, y0: PETSc.Vec, reasons: list[str], far: bool = False
) -> Iterator[tuple[str, PETSc.Vec]]:
    """Guesses for the solution at the parameter of y0, each with how it was found. Collective.

    A forced response is led there by its excitation, raised from zero at the first frequency; a mode is followed from
    a smaller amplitude, where its contacts stick. Either is led there by gaps that close from where nothing touches,
    a mode with regularised friction from a larger amplitude, beside which that is small, or from the linear mode
    without contact.

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
        yield from grown(follow, problem, y0, reasons, far)
        if far:
            return
        yield from _closed(follow, problem, mode_start(problem, y0), reasons) if gaps else ()
        yield from shrunk(follow, problem, y0, reasons) if _has(problem, Role.REGULARISATION) else ()


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
        last, count, reason = last_of(branch, stop[0 if closing else 1])
        end = own(last) if last is not None else None
        if not branch.converged or end is None:
            reasons.append(f"{how}: {reason}")
            return
        y = core.response(end) if isinstance(core, _core.ForcedStart) else core.mode(end)
    yield f"by {how} in {count} steps", y
