"""The static state under load: where the sliders start and what the dynamics move about."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import chain

import numpy as np
from petsc4py import PETSc

from .. import _core
from ..arrays import Array
from ..errors import InputError, NotConverged
from ..hb.harmonic_problem import HarmonicProblem
from ..hb.harmonics import Harmonics
from ..hb.suspects import NUMBER, numberless, suspects
from ..kinds import of_their_kinds
from ..model.laws import own_load
from ..model.model import Model
from ..model.modes import LinearMode, linear_modes
from ..model.rest import Rest
from ..mpi.destroyable import Owned
from ..mpi.gather import on_all_ranks
from .continuation import Continuation
from .point import Point
from .steps import StepControl

#: What is kept of each contact.
TOLD = ("u", "f", "status", "gap")
#: Load factor at which a structure held by contact alone starts.
FIRST_FACTOR = 1e-2


#: A tangent with less load than this (displacement and load are of one size) is a motion that nothing holds.
UNHELD = 1e-10
#: Of the reference mode's frequency: what is slower is a rigid motion.
RIGID = 1e-6
#: Of the reference mode's stiffness: what is softer than that is rounding of the stiff contact beside it.
SOFTEST = 1e-8
#: Shares of the sliders' way in which Newton goes with them.
WAYS_OF_SLIDERS = ([1.0], np.linspace(1, 0, 16, endpoint=False)[::-1].tolist())
#: Times the reference mode's displacement under the load: one that is larger at first is measured by itself, for a step
#: is at most half of what displacements are measured by.
FAR = 100.0


class StaticPreload(HarmonicProblem):
    """K x + B^T f(B x) = p P over the load factor p; the contact starts untouched. Collective.

    Parameters
    ----------
    load : (n_dof,) P
    reference : LinearMode
        Scales the unknowns.
    times : float
        What displacements are measured by, over the load's by the reference mode's stiffness.
    """

    core: _core.StaticPreload

    def __init__(
        self,
        model: Model,
        load: Array,
        reference: LinearMode,
        constant: Array | None = None,
        prefix: str = "static_",
        times: float = 1.0,
    ) -> None:
        if not reference.omega > 0:
            load_name = own_load(model.contacts)
            by = f" ({load_name})" if load_name else ""
            raise InputError(
                "the mode that forces are measured by is a rigid motion: nothing holds the structure at rest",
                None,
                f"{reference.omega:g} rad/s{suspects(model.contacts, None, model.units)}",
                "an elastic mode",
                f"load the contact{by}, hold the structure, or take a mode with closed contact",
            )
        self.stiffness = stiffness = reference.omega**2 / float(np.sum(reference.shape**2)) / times
        size = (float(np.linalg.norm(load)) or stiffness) / stiffness
        self.force_scale, self.size = stiffness * size, size
        with model.vectors(load) as (own,):
            core = _core.StaticPreload(model.core, own, size, stiffness)
        if constant is not None:
            with model.vectors(np.zeros(model.n_dof), constant) as preload:
                core.preload(*preload)
        super().__init__(model, Harmonics([0], 2), prefix, core)

    def at(self, displacement: Array, factor: float) -> PETSc.Vec:
        """Unknowns of a displacement (n_dof,) given whole on every rank, at a load factor. Collective."""
        y = self.core.initial()
        local = y.getArray().copy()
        n = self.model.core.local_dofs
        local[:n] = self.model.distribute(displacement) / self.size
        local[n:] = factor  # the last rank's last entry
        y.setArray(local)
        return y


@of_their_kinds
def balanced(model: Model, reference: LinearMode | None = None) -> Rest:
    """Normal loads given pair by pair are in balance as they are: no displacement, the load is B^T f(0). Collective.

    Parameters
    ----------
    reference : LinearMode, optional
        Scales the unknowns; by default the lowest one with stuck contact.
    """
    problem = StaticPreload(model, np.zeros(model.n_dof), reference or linear_modes(model, 1)[0])
    with Owned() as own:
        y = own(problem.core.initial())
        problem.core.settle(y)  # sliders of a state solved before must not act on this one
        return _settled(problem, y, np.zeros(model.n_dof))


@of_their_kinds
def static_preload(
    model: Model,
    load: Array,
    reference: LinearMode | None = None,
    steps: StepControl | None = None,
    closed: Array | None = None,
    sliders: Mapping[str, Array] | None = None,
    balance: bool = True,
    names: Sequence[str] | None = None,
) -> Rest:
    """Static equilibrium under `load` and the normal loads given pair by pair. Collective.

    By continuation in the load factor, from the unloaded state. The model's laws have it as their rest state.

    Parameters
    ----------
    load : (n_dof,) [force]
    reference : LinearMode, optional
        Scales the unknowns; by default the lowest one with stuck contact.
    sliders : dict, optional
        Contact name -> (n_pairs, n_tangents) [length], where the sliders stand before the load comes: a history. By
        default at zero.
    closed : (n_dof,), optional
        Displacement under the full load with all pairs closed: start from a small share of it. For pairs that just
        touch when unloaded: a structure that they alone hold has no stiffness there.
    balance : bool
        The normal loads given pair by pair are in balance as they are. False: they move the structure until the load
        alone balances them, on the way as it comes.
    names : sequence of str, optional
        Of the dofs, for the message about a body that is free.

    Raises
    ------
    NotConverged
        With the load factor that was reached.
    """
    load = model.numbers(load)
    reference = reference or linear_modes(model, 1)[0]
    rest = balanced(model, reference)
    load = load if balance else load - rest.load
    closed = None if closed is None else model.numbers(closed)
    history = None if sliders is None else model.local_sliders(sliders)
    control = steps or StepControl(initial=0.1, maximum=0.5)

    def begin(times: float) -> tuple[StaticPreload, Continuation, Point | None]:
        problem = StaticPreload(model, load, reference, rest.load, times=times)
        start = own(problem.core.initial() if closed is None else problem.at(FIRST_FACTOR * closed, FIRST_FACTOR))
        if history is not None:
            start = own(_moved_by(problem, history, start, control))
        branch = own(Continuation(problem, start, (-1.0, 1.0), control, upwards=True))
        return problem, branch, next(branch, None)

    with Owned() as own:
        problem, branch, first = begin(1.0)
        if first is not None and (times := _times(first, branch)) > FAR:
            first.destroy()
            branch.destroy()
            problem, branch, first = begin(times)
        last, reason = _end_of(first, branch, names)
        y = None if last is None else own(last).y
        if branch.converged and y is not None:
            free = _free_motion(problem, y)
            if free is None:
                return _settled(problem, y, rest.load + load, history)
            led = _led_by(free, names)
            if not led:
                problem.core.settle(y, history or [])
                led = _led_by(_slowest(model, reference), names)
            reason = f"it is not the only equilibrium: nothing holds the structure in a direction without load{led}"
        elif y is None and (led := _led_by(_slowest(model, reference), names)):
            reason = f"{branch.reason}: the structure moves without load{led}"
        raise NotConverged(
            "no static equilibrium under the full load",
            None,
            f"load factor {0.0 if last is None else last.parameter:.4g}: {reason or branch.reason}"
            + (told := numberless(model))
            + suspects(model.contacts, problem.stiffness, model.units),
            "1",
            NUMBER if told else "hold the structure where contact alone cannot (an axial stop), or lower the load",
        )


def _end_of(first: Point | None, branch: Continuation, names: Sequence[str] | None) -> tuple[Point | None, str]:
    """The last point of a way to the full load, and why it ends there if nothing holds the structure. Collective."""
    last = None
    for point in chain([] if first is None else [first], branch):
        if last is not None:
            last.destroy()
        last = point
        if point.event in ("", "start") and abs(branch.last_entry(point.tangent)) < UNHELD:
            led = _led_by(_of_dofs(branch.problem.model, point.tangent), names)
            return last, f"the structure moves without load{led}: nothing holds it in some direction"
    return last, ""


def _moved_by(problem: StaticPreload, history: list[list[float]], start: PETSc.Vec, control: StepControl) -> PETSc.Vec:
    """Where the structure begins with its sliders at a history, which moves it without load. Collective.

    Newton finds that from where no slider has moved, or as they go there in steps.
    """
    with Owned() as own:
        for shares in WAYS_OF_SLIDERS:
            y, point = start, None
            for share in shares:
                problem.core.stand([[share * w for w in sliders] for sliders in history])
                way = Continuation(problem, y, (-1.0, 1.0), control, upwards=True, way=True)
                point = next(way, None)
                way.destroy()
                if point is None:
                    break
                y = own(point).y
            if point is not None:
                return y.copy()
    problem.core.stand(history)
    return start.copy()


def _times(first: Point, branch: Continuation) -> float:
    """Displacement under the full load as it begins, over what displacements are measured by; 1 where nothing holds it.

    The reference mode may be one that the load does not move, and its length is none where a reduction's coordinates,
    lengths and square roots of mass, stand in one vector. Collective.
    """
    by_load = abs(branch.last_entry(first.tangent))
    return float(np.sqrt(max(1.0 - by_load**2, 0.0)) / by_load) if by_load >= UNHELD else 1.0


def _led_by(motion: Array, names: Sequence[str] | None) -> str:
    """The dof that moves most, in words; nothing where the motion is not known."""
    if not np.all(np.isfinite(motion)) or not np.any(motion):
        return ""
    dof = int(np.argmax(np.abs(motion)))
    return f", dof {dof if names is None else names[dof]} most"


def _slowest(model: Model, reference: LinearMode) -> Array:
    """The lowest mode (n_dof,) with contact as at rest, zero unless it is a rigid motion. Collective."""
    mode = linear_modes(model, 1)[0]
    return mode.shape * (mode.omega < RIGID * reference.omega)


def _free_motion(problem: StaticPreload, y: PETSc.Vec) -> Array | None:
    """A motion (n_dof,) that nothing holds, None where all are held. Collective.

    Asked of J^-1 b, b of a sign for each unknown: whether a singular J can be factorised differs by its pivots, and so
    by ranks.
    """
    newton = _core.Newton(problem.core, problem.prefix, past_kinks=False)
    with Owned() as own:
        load_factor, b, x = (own(y.duplicate()) for _ in range(3))
        load_factor.set(0.0)
        first, end = y.getOwnershipRange()
        b.setArray(1.0 - 2.0 * (np.arange(first, end) * 2654435761 % 2**32 // 2**31))
        if end == y.getSize():
            load_factor.setValue(end - 1, 1.0)
            b.setValue(end - 1, 0.0)
        for vector in (load_factor, b):
            vector.assemble()
        newton.system.close(load_factor, 0.0)
        if newton.linear(y, b, x) and b.norm() > SOFTEST * x.norm():
            return None
        return _of_dofs(problem.model, x)


def _settled(problem: StaticPreload, y: PETSc.Vec, load: Array, history: list[list[float]] | None = None) -> Rest:
    """The laws take the state at y as theirs; the load is what the state balances, Newton's rest included.

    That rest, small beside the load, would be large beside the forces of a small motion.
    """
    with Owned() as own:
        rest = _of_dofs(problem.model, own(problem.residual(y))) * problem.force_scale
        blocks = _of_dofs(problem.model, own(problem.core.coefficients(y)))
    size = float(np.linalg.norm(load)) or float(np.linalg.norm(load + rest)) or 1.0
    load = load + rest
    contact = problem.diagnostics(y)
    periods = problem.contact_history(y)
    on_first = problem.model.comm.rank == 0
    contacts = [{key: np.asarray(c[key])[0] for key in TOLD} for c in periods] if on_first else None
    problem.core.settle(y, history or [])
    imbalance = float(np.linalg.norm(rest)) / size
    sliders = problem.model.sliders()
    found = Rest(blocks, load, sliders, contact["stick"], contact["slip"], contact["open"], imbalance, contacts)
    problem.model.at_rest = found
    return found


def _of_dofs(model: Model, v: PETSc.Vec) -> Array:
    """The entries of the dofs, on every rank. Collective."""
    return on_all_ranks(model.comm, v.getArray(readonly=True)[: model.core.local_dofs].copy())
