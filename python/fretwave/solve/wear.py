"""Fretting wear of a mode in two time scales (Laxalde et al. 2008, section 4): the mode is a function of worn depths,
which grow over the slow time of wear cycles.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from petsc4py import PETSc

from ..arrays import Array
from ..errors import InputError
from ..given import array_of, not_negative, numbers, positive
from ..kinds import of_their_kinds
from .steppers import STEPPERS, StageDiverged, StageFailed, take
from .steps import TOO_FAST, TOO_MANY, WearControl
from .worn_mode import WornMode, WornState

#: Shortest step as a share of a first step at the present rates, and of the cycles done.
SHORTEST, LAST_DIGITS = 1e-10, 1e-14
#: Where the fastest rate grows, a step's error counts against so many times its own depths, too: less load slips more,
#: and what lies below any tolerance grows like e^t.
GROWING = 30.0
#: Depths that Newton leaves of such small ones, in those that take the mean load away.
LEFT = 1e-10
#: A step without a solution is cut to this share of a first step before the mode is taken to end there and to jump.
LAST_TRY = 1e-2
#: A step grows and shrinks by no more than this, and aims at this share of what is allowed.
GROWTH, SHRINKING, SAFETY = 3.0, 0.1, 0.85
#: A pair wears as it is loaded: its load fades like e^-t, and what a step is off by takes the last of it.
LOST = "contact lost: all pairs are open, at a cycle that depends on the tolerance where loads fade"
#: Lengths that a step may have in every factor of two.
GRID = 16


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

    def __repr__(self) -> str:
        what = f" {self.event}" if self.event else ""
        deepest = float(self.state.depth.max(initial=0.0))
        return f"WearPoint({self.cycles:.6g} cycles{what}: deepest {deepest:.3g}, step error {self.error:.1e})"


def _growth(values: object, shape: tuple[int, ...]) -> Array:
    """Exponents of rates, infinite where none is known."""
    found = array_of(values)
    if found.dtype.kind not in "biuf" or found.shape != shape or np.isnan(found).any():
        wanted = f"{shape} numbers, infinite where none is known"
        raise InputError("a number cannot be used", "growth", repr(values), wanted, "give such numbers")
    return found.astype(float)


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
    depth, at, step, load_scale, growth, points : (n_pairs,), cycles, length, [force], (n_pairs,) per cycle, number
        To go on from an earlier march's point; by default the surfaces are new.
    outcome : Newton and linear iterations and residual that y was found with
    """

    @of_their_kinds
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
        outcome: tuple[int, int, float] = (0, 0, 0.0),
        growth: Array | None = None,
        points: int = 1,
    ) -> None:
        self.mode, self.control, self.cycles = mode, control or WearControl(), positive("cycles", cycles)
        self.tableau = STEPPERS[self.control.stepper]
        self.asked = numbers("report_at", list(report_at), (len(report_at),), least=0.0)
        self.eta, self.reason, self.converged = not_negative("at", at), "", False
        self.reports = sorted({*(value for value in report_at if value > at), cycles})
        self.points = points
        pairs = mode.areas.shape
        start = np.zeros(pairs) if depth is None else numbers("depth", depth, pairs, least=0.0)
        given = None if load_scale is None else positive("load_scale", load_scale)
        first = self.control.first if step is None else positive("step", step)
        #: Of each pair's rate over the last step, as exponents by cycle; not known before one.
        self.growth = np.full(pairs, np.inf) if growth is None else _growth(growth, pairs)
        mode.wear(start)
        self.state = mode.measure(y.copy(), start, outcome)
        closed = self.state.load[self.state.load > 0]
        own = float(closed.mean()) if len(closed) else 1.0
        self.load_scale = own if given is None else given
        self.depth_scale = self.load_scale / mode.stiffness
        self.step = first or self._first_step()
        self._spent = [0, 0]

    def __repr__(self) -> str:
        return f"Wear({self.eta:g} of {self.cycles:g} cycles: {self.reason or 'under way'}, of {self.mode})"

    def _first_step(self) -> float:
        """A tenth of the allowed change at the present rates."""
        fastest = self._fastest(self.state)
        return self._on_grid(0.1 * self.control.pressure_change / fastest) if fastest else self.cycles

    def _on_grid(self, step: float) -> float:
        """The next length of a coarse grid: last digits of a mode, which differ with the ranks, change no step."""
        return float(self.cycles * 2.0 ** (np.round(GRID * np.log2(step / self.cycles)) / GRID))

    def __iter__(self) -> Iterator[WearPoint]:
        yield WearPoint(self.eta, 0.0, self.state, 0.0, "start", self.state.newton, self.state.linear)
        yield from self.go_on()

    def go_on(self) -> Iterator[WearPoint]:
        """The points after the present one."""
        while not self._finished():
            if self.points >= self.control.max_points:
                self.reason = TOO_MANY
                return
            point = self._advance()
            if point is None:
                return
            self.points += 1
            if self._finished():
                point.event = "stop"
            yield point

    def missed(self, unit: float = 1.0) -> list[str]:
        """Reports that were not met, each with its reason, in cycles of so many."""
        told = []
        for value in self.asked[self.asked > self.eta]:
            beyond = f"beyond the last of {self.cycles / unit:.6g} cycles"
            short = f"the march ended at {self.eta / unit:.6g}"
            told.append(f"report at {value / unit:.6g} cycles: {beyond if value > self.cycles else short}")
        return told

    def _finished(self) -> bool:
        """Stop rules: cycles done, contact lost, wear stopped.

        Rates that grow are taken to go on growing as they did.
        """
        remaining = self.cycles - self.eta
        with np.errstate(over="ignore", invalid="ignore"):
            to_come = np.maximum(self.growth, 0.0) * remaining
            times = np.where(to_come > LEFT, np.expm1(to_come) / to_come, 1.0)
            left = np.where(self.state.rate > 0, self.state.rate * remaining * np.nan_to_num(times, nan=np.inf), 0.0)
        if remaining <= 0:
            self.reason = "cycles done"
        elif (self.state.load <= 0).all():
            self.reason = LOST
        elif (left <= self.control.tolerance * self.depth_scale).all():
            self.reason = "wear has stopped: to the last cycle it changes nothing beyond the tolerance"
        self.converged = bool(self.reason)
        return self.converged

    def _advance(self) -> WearPoint | None:
        """One accepted step, shortened as often as needed; None when it becomes too short."""
        self._spent = [0, 0]
        target = next(value for value in self.reports if value > self.eta)
        tangent = self.mode.tangent(self.state, self.state.rate)
        why, first = TOO_FAST, self._first_step()
        least = LAST_TRY * min(first, self.cycles)
        shortest = max(SHORTEST * min(first, self.cycles, self.step), LAST_DIGITS * self.eta)
        while self.step >= shortest:
            meets = self.eta + self.step * (1 + 1e-12) >= target
            h = target - self.eta if meets else self.step
            try:
                found, state = self._try(h, tangent)
            except StageFailed as failure:
                if h < least and not isinstance(failure, StageDiverged):
                    tangent.destroy()
                    return self._jump(h)
                why, self.step = str(failure), h / 4
                continue
            error = self._error(np.abs(found), state)
            change = float(np.abs(state.load - self.state.load).max(initial=0.0)) / self.load_scale
            by_error = (error / self.control.tolerance) ** (1 / self.tableau.error_order)
            share = max(by_error, change / self.control.pressure_change)
            if self.control.fixed or share <= 1:
                tangent.destroy()
                return self._accept(h, target if meets else self.eta + h, state, error, share)
            why = TOO_FAST
            state.y.destroy()
            self.step = self._on_grid(h * max(SHRINKING, SAFETY / share))
        tangent.destroy()
        self.reason = f"step too small: {why}"
        return None

    def _error(self, found: Array, state: WornState) -> float:
        """Of a step to a state, by the errors (n_pairs,) found of its depths."""
        error = float((found / (self.depth_scale + state.depth)).max(initial=0.0))
        own = float(((state.depth - self.state.depth) / self.depth_scale).max(initial=0.0))
        if not own or not self._faster(state):
            return error
        seen = max(float((found / self.depth_scale).max()) - LEFT, 0.0)
        return max(error, seen / (GROWING * own))

    def _fastest(self, state: WornState) -> float:
        """In depths that take the mean load away, over a cycle."""
        return float((state.rate / self.depth_scale).max(initial=0.0))

    def _faster(self, state: WornState) -> bool:
        """Whether wear is faster there."""
        return self._fastest(state) > self._fastest(self.state) > 0.0

    def _accept(self, h: float, eta: float, state: WornState, error: float, share: float) -> WearPoint:
        with np.errstate(divide="ignore", invalid="ignore"):
            self.growth = np.nan_to_num(
                np.log(state.rate / self.state.rate) / h, nan=0.0, posinf=np.inf, neginf=-np.inf
            )
        self.state.y.destroy()
        self.state, self.eta = state, eta
        if not self.control.fixed:
            longer = self._on_grid(h * min(GROWTH, max(SHRINKING, SAFETY / max(share, 1e-12))))
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
        self.state, self.eta, self.growth = state, self.eta + h, np.full_like(self.growth, np.inf)
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

        moved = min(1.0, GROWING * h * self._fastest(self.state)) or 1.0
        stage_tolerance = max(1e-2 * self.control.tolerance * moved, LEFT) * self.depth_scale
        try:
            step = take(self.tableau, rate, self.state.depth, self.state.rate, h, stage_tolerance)
        except StageFailed:
            if last is not self.state:
                last.y.destroy()
            raise
        return step.error, last
