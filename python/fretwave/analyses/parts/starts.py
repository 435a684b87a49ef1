"""Motions by direct time integration from the mode's own motion at several amplitudes."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...arrays import Array
from ...case.observed import label_of
from ...columns import Column, Value
from ...errors import InputError, NotConverged
from ...post.cycles import Cycles, above_noise, extract, noise_floor
from ...post.decays import mode_state
from ...post.settling import growth_trend
from ...solve.steady import STEPS_PER_PERIOD, Motion, free_motion, start_state
from ...texts import counted
from .context import AnalysisContext, Outcome
from .observed import row_on
from .several import ending_of
from .whole import integrated_model

if TYPE_CHECKING:
    from ..free_decay import TransientSection


#: Periods from the middle of the last cycle to the end of a motion that no longer swings; one and a half at most else.
QUIET = 3.0
#: Label of the mean in a mode's coefficients.
MEAN = "0"
#: A mean above this, in amplitudes, is no rounding.
ASIDE = 1e-9
#: Bounds of a motion, in largest coefficients of the mode's motions: of one that grows ever faster, and of any.
BEYOND, FAR = 2.0, 1e4


@dataclass(frozen=True)
class Followed:
    """A start's motion and its cycles, but those in the integration's noise.

    Attributes
    ----------
    floor : amplitude below which they are noise; 0 where none is
    about : in words, where cycles pass
    """

    motion: Motion
    cycles: Cycles
    floor: float
    about: str = " about zero"

    def end(self, unit: str) -> list[str]:
        """In words, where its cycles end before the motion does."""
        count = len(self.cycles)
        if self.floor:
            return [f"ends after {counted(count, 'cycle')}: below {self.floor:.1e} {unit} is the integration's noise"]
        if self.motion.diverged:
            when = f"after {counted(count, 'cycle')}" if count else "before four full cycles"
            return [f"stopped {when}: it grew to {np.abs(self.motion.x).max():.3g} {unit}"]
        if not count:
            return ["fewer than four full cycles"]
        quiet = self.motion.t[-1] - self.cycles.time[-1] > QUIET * 2.0 * np.pi / self.cycles.omega[-1]
        return [f"ends after {counted(count, 'cycle')}: it no longer swings{self.about}"] if quiet else []


class Starts:
    """Integrator, table and progress of one analysis; closes what it opened."""

    def __init__(self, context: AnalysisContext[TransientSection], columns: Sequence[str | Column]) -> None:
        from ...solve.transient import Transient

        self.context, self.section = context, context.analysis
        self.mode = context.analysis.mode_of(context.case)
        context.leave_out([])
        self.table = context.table(self.mode.name)
        self.labels, self.coefficients = context.coefficients(self.mode.name)
        given, case = self.mode.normalise, context.case
        self.seen = case.dof(given) if isinstance(given, str) else row_on(case, given)
        #: The mode swings about another place than zero.
        self.aside = self._has_a_mean()
        self._model = ExitStack()
        model = self._model.enter_context(integrated_model(context))
        self.integrator = Transient(model, prefix=context.prefix)
        self.writer = context.writer(columns, normalise=label_of(self.mode.normalise))
        self.stopped: dict[int, str] = {}

    def _has_a_mean(self) -> bool:
        if MEAN not in self.labels:
            return False
        mean = self.coefficients[:, :, self.labels.index(MEAN)]
        seen = mean[:, self.seen] if isinstance(self.seen, int) else mean @ self.seen
        return bool((np.abs(seen) > ASIDE * self.table["amplitude"]).any())

    def __enter__(self) -> Starts:
        return self

    def __exit__(self, *error: object) -> None:
        self.writer.abandon()
        self._model.close()

    def follow(self, number: int, amplitude: float, bounds: Sequence[float] = (BEYOND, FAR)) -> Followed:
        """The motion of the normalised dof from the mode's own motion at an amplitude. Collective.

        It is stopped when any dof exceeds the first of the bounds, in largest coefficients of the mode's motions, and
        grows ever faster there; else it begins anew with the next one.
        """
        coefficients, beta, omega = self._start(number, amplitude)
        state = start_state(self.labels, coefficients, beta, omega)
        self.context.console.line(
            f"{self.context.name}: start {number} from a = {amplitude:g} {self.context.units('length')}"
        )
        largest = float(np.abs(self.coefficients).max())
        for bound in bounds:
            found = self._followed(state, omega, bound * largest)
            if not found.motion.diverged or self._grows_faster(found.cycles):
                break
        if found.motion.implicit:
            self.context.console.line(f"{self.context.name}: the contact is stiff: implicit steps")
        if found.motion.stopped:
            self.stopped[number] = f"start {number}: {found.motion.stopped}"
        return found

    def _grows_faster(self, cycles: Cycles) -> bool:
        return growth_trend(np.log(cycles.amplitude), self.section.tolerance) > 0

    def _followed(self, state: tuple[Array, Array], omega: float, limit: float) -> Followed:
        """From a state (n_dof,) of displacement and velocity, until any dof exceeds the limit."""
        section = self.section
        step = 2.0 * np.pi / omega / section.samples_per_period
        count = section.periods * section.samples_per_period
        most = section.periods * STEPS_PER_PERIOD
        motion = free_motion(self.integrator, state, self.seen, step, count, section.tolerance, limit, most)
        cycles = extract(motion.t, motion.x, motion.v, 2.0 * np.pi / omega if self.aside else 0.0)
        size = max(float(np.abs(state[0]).max()), float(np.abs(state[1]).max()) / omega)
        floor = noise_floor(cycles, section.tolerance, size)
        kept = above_noise(cycles, floor)
        about = " about its mean" if self.aside else " about zero"
        return Followed(motion, kept, float(floor[len(kept)]) if len(kept) < len(cycles) else 0.0, about)

    def _start(self, number: int, amplitude: float) -> tuple[Array, float, float]:
        """Harmonic coefficients (n_dof, m), beta and omega of the mode's motion."""
        try:
            return mode_state(self.table, self.coefficients, amplitude, self.mode.method)
        except InputError as error:
            if not self.mode.amplitude[0] <= amplitude <= self.mode.amplitude[1]:
                raise
            # within what the mode was to reach: its branch stopped early
            raise NotConverged(
                f"the branch of '{self.mode.name}' does not reach start {number}",
                f"analysis '{self.context.name}'",
                error.measured,
                error.expected,
                f"other starts, or what lets '{self.mode.name}' go on",
            ) from None

    def write(self, number: int, motion: Motion, rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
        """Keep the cycles as rows and the motion (3, n: t, x, v) as a dataset. Collective."""
        for row in rows:
            self.writer.append(row)
        if rows:
            units = self.context.units
            history = np.stack([motion.t, motion.x, motion.v])
            self.writer.dataset(
                f"motion_{number}", history, rows=f"t [s], x [{units('length')}], v [{units('length/s')}]"
            )
        return rows

    def finish(self, lines: list[str], **attributes: Value) -> Outcome:
        """Close the table."""
        numbers = range(len(self.section.amplitude))
        status, reason, ended = ending_of(self.stopped, numbers, "all starts integrated")
        self.writer.close(status, reason, **ended, **attributes)
        goal = f"{self.section.periods} periods of every start"
        advice = f"--set {self.context.name}.tolerance=1e-6, fewer periods, or a smoother contact law"
        return Outcome(self.writer.rows, reason, not self.stopped, lines, goal, advice)
