"""``type = "free_decay"`` and ``"limit_cycle"``: direct time integration of the unreduced equations."""

from __future__ import annotations

import json
from collections.abc import Sequence
from contextlib import ExitStack
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from ..case.schema import ModeAnalysis, TransientSection
from ..columns import Column
from ..errors import InputError, NotConverged
from ..post.cycles import extract
from ..post.decays import (
    Ending,
    compare,
    cycle_rows,
    decay_rows,
    divergence_factor,
    ending,
    largest_differences,
    mode_state,
)
from ..post.mode_curve import Crossing, ModeCurve
from ..solve.steady import STEPS_PER_PERIOD, Motion, free_motion, start_state
from .parts.context import AnalysisContext, Outcome
from .parts.shifted import shifted_damping
from .parts.whole import integrated_model

Array = npt.NDArray[np.float64]

SHEETS = Column("sheets", "1", "solutions of the mode at this amplitude", "i")
FREE_DECAY = ("start", "cycle", "time", "amplitude", "omega", "zeta", "omega_mode", "zeta_mode", SHEETS)
LIMIT_CYCLE = ("start", "cycle", "time", "amplitude", "frequency_hz")


def run_free_decay(context: AnalysisContext) -> Outcome:
    """Let the motion of the mode decay from each start; every cycle is compared with the mode. Collective."""
    mode = ModeCurve.from_table(context.table(_mode(context).name))
    rows: list[dict[str, Any]] = []
    with _Starts(context, FREE_DECAY) as starts:
        for number, amplitude in enumerate(_section(context).amplitude):
            motion = starts.integrate(number, amplitude, np.inf)
            rows += starts.write(number, motion, decay_rows(number, extract(motion.t, motion.x, motion.v), mode))
        omega, zeta = largest_differences(rows)
        line = (
            f"{context.name}: {len(rows)} cycles; where the damping changes slowly the frequency differs "
            f"from the mode's by up to {omega:.1e} (relative), the damping ratio by up to {zeta:.1e}"
        )
        return starts.finish([line], omega_difference=omega, zeta_difference=zeta)


def run_limit_cycle(context: AnalysisContext) -> Outcome:
    """Follow each start until it has settled or diverges, and compare with the zeros of the damping. Collective."""
    crossings = ModeCurve.from_table(context.table(_mode(context).name)).crossings()
    endings: list[dict[str, Any]] = []
    lines: list[str] = []
    with _Starts(context, LIMIT_CYCLE) as starts:
        for number, amplitude in enumerate(_section(context).amplitude):
            motion = starts.integrate(number, amplitude, divergence_factor(amplitude, crossings))
            cycles = extract(motion.t, motion.x, motion.v)
            starts.write(number, motion, cycle_rows(number, cycles))
            found = ending(cycles, motion.diverged)
            endings.append({"start": amplitude, **vars(found), **compare(found, crossings)})
            lines.append(_ending_line(context.name, amplitude, found, crossings))
        done = starts.finish(lines, endings=json.dumps(endings))
    # only now: results.h5 can be read again when the writer has closed it
    done.summary += shifted_damping(context, _mode(context))
    return done


class _Starts:
    """Integrator, table and progress of one analysis; closes what it opened."""

    def __init__(self, context: AnalysisContext, columns: Sequence[str | Column]) -> None:
        from ..solve.transient import Transient

        self.context, self.section, self.mode = context, _section(context), _mode(context)
        context.leave_out([])
        self.table = context.table(self.mode.name)
        self.labels, self.coefficients = context.coefficients(self.mode.name)
        self.dof = context.case.dof(self.mode.normalise)
        self._model = ExitStack()
        model = self._model.enter_context(integrated_model(context))
        self.integrator = Transient(model, prefix=context.prefix)
        self.writer = context.writer(columns, normalise=self.mode.normalise)
        self.stopped: list[str] = []

    def __enter__(self) -> _Starts:
        return self

    def __exit__(self, *error: object) -> None:
        self.writer.abandon()
        self._model.close()

    def integrate(self, number: int, amplitude: float, factor: float) -> Motion:
        """The motion of the normalised dof from the mode's own motion at an amplitude. Collective.

        It is stopped when any dof exceeds `factor` times the largest coefficient of the start.
        """
        try:
            coefficients, beta, omega = mode_state(self.table, self.coefficients, amplitude, self.mode.method)
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
        state = start_state(self.labels, coefficients, beta, omega)
        section = self.section
        self.context.console.line(f"{self.context.name}: start {number} from a = {amplitude:g} m")
        step = 2.0 * np.pi / omega / section.samples_per_period
        count = section.periods * section.samples_per_period
        limit = factor * float(np.abs(coefficients).max())
        most = section.periods * STEPS_PER_PERIOD
        motion = free_motion(self.integrator, state, self.dof, step, count, section.tolerance, limit, most)
        if motion.implicit:
            self.context.console.line(f"{self.context.name}: the contact is stiff: implicit steps")
        if motion.stopped:
            self.stopped.append(f"start {number}: {motion.stopped}")
        return motion

    def write(self, number: int, motion: Motion, rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
        """Keep the cycles as rows and the motion (3, n: t, x, v) as a dataset. Collective."""
        for row in rows:
            self.writer.append(row)
        if rows:
            history = np.stack([motion.t, motion.x, motion.v])
            self.writer.dataset(f"motion_{number}", history, rows="t [s], x [m], v [m/s]")
        return rows

    def finish(self, lines: list[str], **attributes: Any) -> Outcome:
        """Close the table."""
        reason = "; ".join(self.stopped) or "all starts integrated"
        self.writer.close("stopped" if self.stopped else "done", reason, **attributes)
        goal = f"{self.section.periods} periods of every start"
        advice = f"--set {self.context.name}.tolerance=1e-6, fewer periods, or a smoother contact law"
        return Outcome(self.writer.rows, reason, not self.stopped, lines, goal, advice)


def _section(context: AnalysisContext) -> TransientSection:
    return cast(TransientSection, context.analysis)


def _mode(context: AnalysisContext) -> ModeAnalysis:
    return cast(ModeAnalysis, context.case.analyses[_section(context).mode])


def _ending_line(name: str, start: float, found: Ending, crossings: Sequence[Crossing]) -> str:
    differences = compare(found, crossings)
    line = f"{name}: from a = {start:g} m: {found.text}, a = {found.amplitude:.5g} m, "
    line += f"{found.omega / (2.0 * np.pi):.5g} Hz"
    if not np.isfinite(differences["predicted"]):
        return line
    return line + (
        f"; predicted {differences['predicted']:.5g} m: amplitude {differences['amplitude_difference']:+.1e}, "
        f"frequency {differences['frequency_difference']:+.1e} (relative)"
    )
