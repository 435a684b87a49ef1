"""Fretting wear of a mode in two time scales (Laxalde et al. 2008, section 4): the mode is a function of worn depths,
which grow over the slow time of wear cycles.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from . import _core
from .continuation import Continuation, StepControl
from .errors import InputError
from .problems import HarmonicProblem
from .steppers import STEPPERS, StageFailed, take

Array = npt.NDArray[np.float64]

#: The law's normal stiffness makes worn depth a loss of normal load.
STIFFNESS = "normal_stiffness"
#: Shortest step as a share of all cycles.
SHORTEST = 1e-10
#: A step without a solution is cut to this share of a first step before the mode is taken to end there and to jump.
LAST_TRY = 1e-2
#: Changes of log amplitude from which a solution on another sheet is looked for, and points to reach it by.
DETOURS, DETOUR_POINTS = (1e-3, -1e-3, 1e-2, -1e-2, 3e-2, -3e-2), 40
#: The corrector's tolerance over that of the branch: depths add up its errors.
SHARPER = 1e-2
#: A step grows and shrinks by no more than this, and aims at this share of what is allowed.
GROWTH, SHRINKING, SAFETY = 3.0, 0.1, 0.85


@dataclass
class WornState:
    """The mode at some worn depths. `y` is the owner's to destroy.

    Attributes
    ----------
    depth, load : (n_pairs,)
        Worn depth [m] and mean normal force [N] of the pairs of all wearing contacts, one after the other.
    rate : (n_pairs,)
        Growth of the depth in a cycle [m], k_w / I times the integral of |P_N| |d slider| (eq. 13).
    slip, open : (n_pairs,)
        Shares of the period.
    """

    y: PETSc.Vec
    depth: Array
    rate: Array
    load: Array
    slip: Array
    open: Array
    newton: int = 0
    linear: int = 0
    residual: float = 0.0


class WornMode:
    """A mode at fixed amplitude as a function of worn depths. Collective, as all methods.

    Parameters
    ----------
    problem : NonlinearMode
        With contacts that have a normal direction, whose depths it takes over.
    coefficient : float
        k_w [1/Pa].
    areas : dict
        Contact name -> nodal areas I (n_pairs,) [m^2]; contacts without an entry do not wear.
    """

    def __init__(self, problem: HarmonicProblem, coefficient: float, areas: Mapping[str, Array]) -> None:
        self.problem, self.model, self.coefficient = problem, problem.model, coefficient
        names = [contact.name for contact in self.model.contacts]
        for name in areas:
            self._check(name, names)
        self.contacts = [k for k, name in enumerate(names) if name in areas]
        self.areas = np.concatenate([np.asarray(areas[names[k]], dtype=float) for k in self.contacts])
        sizes = [len(areas[names[k]]) for k in self.contacts]
        self.slices = [slice(end - size, end) for size, end in zip(sizes, np.cumsum(sizes))]
        self.stiffness = np.concatenate(
            [
                np.broadcast_to(np.asarray(self.model.contacts[k].parameters[STIFFNESS], dtype=float), (size,))
                for k, size in zip(self.contacts, sizes)
            ]
        )
        self._newton = _core.Newton(problem.core, problem.prefix)
        rtol, atol, stol, most = self._newton.snes.getTolerances()
        self._newton.snes.setTolerances(rtol, SHARPER * atol, stol, most)
        self._row = problem.core.unknowns()
        self._row.set(0.0)
        self._set_last(self._row, 1.0)

    def _check(self, name: str, names: list[str]) -> None:
        if name not in names:
            raise InputError("there is no such contact", None, name, ", ".join(names), "name one of these")
        contact = self.model.contacts[names.index(name)]
        if STIFFNESS not in contact.parameters:
            where, fix = f"contact '{name}'", 'use law = "coulomb_3d"'
            raise InputError("a contact cannot wear", where, contact.law, "a law with a normal direction", fix)

    def _set_last(self, v: PETSc.Vec, value: float) -> None:
        local = v.getArray()
        if self.model.comm.rank == self.model.comm.size - 1:
            local[-1] = value

    def _local(self, values: Array) -> list[list[float]]:
        """Of all pairs, those on this rank, contact by contact."""
        out: list[list[float]] = [[] for _ in self.model.contacts]
        for k, part in zip(self.contacts, self.slices):
            out[k] = values[part][self.model.pairs_of(k)].tolist()
        return out

    def wear(self, depth: Array) -> None:
        """The contacts have these depths (n_pairs,) from now on."""
        self.problem.core.wear(self._local(depth))

    def measure(self, y: PETSc.Vec, depth: Array, outcome: Sequence[Any] = (0, 0, 0.0)) -> WornState:
        """Rates and loads of a converged motion at these depths."""
        found = self.problem.core.wearing(y)
        archard, load, slip, opened = (
            np.concatenate([self.model.share_pairs(k, np.asarray(found[k][which])) for k in self.contacts])
            for which in range(4)
        )
        return WornState(y, depth, self.coefficient / self.areas * archard, load, slip, opened, *outcome)

    def solve(self, depth: Array, guess: PETSc.Vec) -> WornState:
        """The mode at these depths and the amplitude of the guess, which is kept.

        Raises
        ------
        StageFailed
            Newton does not converge.
        """
        self.wear(depth)
        y = guess.copy()
        return self.measure(y, depth, self._correct(y))

    def _correct(self, y: PETSc.Vec) -> tuple[int, int, float]:
        """Newton at the amplitude of y, in place."""
        self._newton.system.close(self._row, self.log_amplitude(y))
        converged, newton, linear, residual, reason = self._newton.solve(y)
        if not converged:
            y.destroy()
            raise StageFailed(reason)
        return newton, linear, residual

    def elsewhere(self, depth: Array, guess: PETSc.Vec) -> WornState:
        """The mode at these depths on whatever sheet is near: by arclength from an amplitude above or below.

        At a fixed amplitude a sheet may end while depths grow, as a branch that folds does in amplitude.

        Raises
        ------
        StageFailed
            None of the detours comes back to the amplitude.
        """
        self.wear(depth)
        target = float(self.problem.core.parameter_value(self.log_amplitude(guess)))
        for change in DETOURS:
            y = guess.copy()
            self._set_last(y, self.log_amplitude(guess) + change)
            try:
                self._correct(y)
            except StageFailed:
                continue
            found = self._come_back(y, target, change)
            y.destroy()
            if found is not None:
                return self.measure(found, depth, self._correct(found))
        raise StageFailed("the mode ends here, and no other sheet of it was found at this amplitude")

    def _come_back(self, y: PETSc.Vec, target: float, change: float) -> PETSc.Vec | None:
        """The first point of the branch from y that lies on the target amplitude."""
        length = abs(change)
        ends = (target * float(np.exp(-2 * length)), target * float(np.exp(2 * length)))
        steps = StepControl(initial=length / 8, minimum=1e-4 * length, maximum=length, max_points=DETOUR_POINTS)
        branch = Continuation(self.problem, y, ends, steps, [target], upwards=change < 0)
        found = None
        for point in branch:
            point.tangent.destroy()
            if point.event == "report":
                found = point.y
                break
        branch.destroy()
        return found

    def log_amplitude(self, y: PETSc.Vec) -> float:
        """The parameter's entry, on every rank."""
        comm = self.model.comm
        local = y.getArray(readonly=True)
        return float(comm.bcast(local[-1] if comm.rank == comm.size - 1 else None, root=comm.size - 1))

    def gap_product(self, y: PETSc.Vec, change: Array) -> PETSc.Vec:
        """dr/dw times a change of the depths (n_pairs,) at the present depths: worn depth is gap."""
        return self.problem.core.gap_product(y, self._local(change))

    def tangent(self, state: WornState, change: Array) -> PETSc.Vec:
        """dy for a change of the depths at fixed amplitude: one solve with the bordered Jacobian, zero if it fails."""
        self.wear(state.depth)
        r = self.gap_product(state.y, change)
        b, t = self.problem.core.unknowns(), self.problem.core.unknowns()
        local = b.getArray()
        local[:] = 0.0
        local[: r.getLocalSize()] = -r.getArray(readonly=True)
        r.destroy()
        self._newton.system.close(self._row, 0.0)
        t.set(0.0)
        if not self._newton.linear(state.y, b, t):
            t.set(0.0)
        b.destroy()
        return t

    def destroy(self) -> None:
        """Free the solver; the contacts are as new again."""
        self.wear(np.zeros(len(self.areas)))
        self._newton = None
        self._row.destroy()

    def __enter__(self) -> WornMode:
        return self

    def __exit__(self, *_: object) -> None:
        self.destroy()


@dataclass(frozen=True)
class WearControl:
    """How long the steps over wear cycles are.

    Attributes
    ----------
    stepper : name in `fretwave.steppers.STEPPERS`
    tolerance : largest estimated error of a step's depths, as loss of normal load relative to the mean at the start
    pressure_change : largest change of a pair's mean normal force in a step, relative to the same
    first, fixed : length of the first step [cycles]; `fixed` for all steps, without control
    """

    stepper: str = "bogacki_shampine"
    tolerance: float = 1e-4
    pressure_change: float = 0.2
    first: float | None = None
    fixed: bool = False


@dataclass
class WearPoint:
    """A point of the march. `state.y` is freed when the next point is asked for."""

    cycles: float
    step: float
    state: WornState
    error: float
    event: str
    newton: int
    linear: int


class Wear:
    """Marches dw/d eta = (k_w / I) g(y(w)) over wear cycles eta at fixed amplitude (eqs. 13 and 14). Collective.

    Iterating gives the start and every accepted step; no depth ever falls, for no stepper has a negative weight.

    Parameters
    ----------
    mode : WornMode
    y : Vec
        The mode at `depth`, kept as a copy.
    cycles : float
        Where to stop.
    report_at : cycles that are met exactly
    depth, at, step, load_scale : (n_pairs,), cycles, length, [N]
        To go on from an earlier march's point; by default the surfaces are new.
    outcome : Newton and linear iterations and residual that y was found with
    """

    def __init__(
        self,
        mode: WornMode,
        y: PETSc.Vec,
        cycles: float,
        control: WearControl | None = None,
        report_at: Sequence[float] = (),
        depth: Array | None = None,
        at: float = 0.0,
        step: float | None = None,
        load_scale: float | None = None,
        outcome: Sequence[Any] = (0, 0, 0.0),
    ) -> None:
        self.mode, self.control, self.cycles = mode, control or WearControl(), cycles
        if self.control.stepper not in STEPPERS:
            raise InputError("unknown stepper", None, self.control.stepper, ", ".join(STEPPERS), "choose one of these")
        self.tableau = STEPPERS[self.control.stepper]
        self.reports = sorted({*(value for value in report_at if value > at), cycles})
        self.eta, self.reason, self.converged = at, "", False
        start = np.zeros(len(mode.areas)) if depth is None else np.asarray(depth, dtype=float)
        mode.wear(start)
        self.state = mode.measure(y.copy(), start, outcome)
        closed = self.state.load[self.state.load > 0]
        self.load_scale = load_scale or (float(closed.mean()) if len(closed) else 1.0)
        self.depth_scale = self.load_scale / mode.stiffness
        self.step = step or self.control.first or self._first_step()
        self._spent = [0, 0]

    def _first_step(self) -> float:
        """A tenth of the allowed change at the present rates."""
        fastest = float((self.state.rate / self.depth_scale).max(initial=0.0))
        return 0.1 * self.control.pressure_change / fastest if fastest else self.cycles

    def __iter__(self) -> Iterator[WearPoint]:
        yield WearPoint(self.eta, 0.0, self.state, 0.0, "start", self.state.newton, self.state.linear)
        yield from self.go_on()

    def go_on(self) -> Iterator[WearPoint]:
        """The points after the present one."""
        while not self._finished():
            point = self._advance()
            if point is None:
                return
            if self._finished():
                point.event = "stop"
            yield point

    def _finished(self) -> bool:
        """Stop rules: cycles done, contact lost, wear stopped."""
        remaining = self.cycles - self.eta
        if remaining <= 0:
            self.reason = "cycles done"
        elif (self.state.load <= 0).all():
            self.reason = "contact lost: all pairs are open"
        elif (self.state.rate * remaining <= self.control.tolerance * self.depth_scale).all():
            self.reason = "wear has stopped: to the last cycle it changes nothing beyond the tolerance"
        self.converged = bool(self.reason)
        return self.converged

    def _advance(self) -> WearPoint | None:
        """One accepted step, shortened as often as needed; None when it becomes too short."""
        self._spent = [0, 0]
        target = next(value for value in self.reports if value > self.eta)
        tangent = self.mode.tangent(self.state, self.state.rate)
        why, least = "", LAST_TRY * self._first_step()
        while self.step >= SHORTEST * self.cycles:
            meets = self.eta + self.step * (1 + 1e-12) >= target
            h = target - self.eta if meets else self.step
            try:
                found, state = self._try(h, tangent)
            except StageFailed as failure:
                if h < least:
                    tangent.destroy()
                    return self._jump(h)
                why, self.step = str(failure), h / 4
                continue
            error = float((np.abs(found) / (self.depth_scale + state.depth)).max(initial=0.0))
            change = float(np.abs(state.load - self.state.load).max(initial=0.0)) / self.load_scale
            by_error = (error / self.control.tolerance) ** (1 / self.tableau.error_order)
            share = max(by_error, change / self.control.pressure_change)
            if self.control.fixed or share <= 1:
                tangent.destroy()
                return self._accept(h, target if meets else self.eta + h, state, error, share)
            why = "the contact changes too fast"
            state.y.destroy()
            self.step = h * max(SHRINKING, SAFETY / share)
        tangent.destroy()
        self.reason = f"step too small: {why}"
        return None

    def _accept(self, h: float, eta: float, state: WornState, error: float, share: float) -> WearPoint:
        self.state.y.destroy()
        self.state, self.eta = state, eta
        if not self.control.fixed:
            longer = h * min(GROWTH, max(SHRINKING, SAFETY / max(share, 1e-12)))
            # a step cut short to meet a report says little about the next one
            self.step = max(longer, self.step) if h < self.step else longer
        event = "report" if eta in self.reports else ""
        return WearPoint(eta, h, state, error, event, *self._spent)

    def _jump(self, h: float) -> WearPoint | None:
        """The sheet ends within a short step h: go on from another one there, as the motion would."""
        try:
            state = self.mode.elsewhere(self.state.depth + h * self.state.rate, self.state.y)
        except StageFailed as failure:
            self.reason = str(failure)
            return None
        self.state.y.destroy()
        self.state, self.eta = state, self.eta + h
        self.step = self._first_step()
        return WearPoint(self.eta, h, state, 0.0, "jump", state.newton, state.linear)

    def _try(self, h: float, tangent: PETSc.Vec) -> tuple[Array, WornState]:
        """The error's estimate and the mode at the end; each stage is predicted from the last along the tangent."""
        last, place = self.state, 0.0

        def rate(x: Array, stage: float) -> Array:
            nonlocal last, place
            guess = last.y.copy()
            guess.axpy((stage - place) * h, tangent)
            try:
                now = self.mode.solve(x, guess)
            finally:
                guess.destroy()
            if last is not self.state:
                last.y.destroy()
            last, place = now, stage
            self._spent[0] += now.newton
            self._spent[1] += now.linear
            return now.rate

        stage_tolerance = 1e-2 * self.control.tolerance * self.depth_scale
        try:
            step = take(self.tableau, rate, self.state.depth, self.state.rate, h, stage_tolerance)
        except StageFailed:
            if last is not self.state:
                last.y.destroy()
            raise
        return step.error, last
