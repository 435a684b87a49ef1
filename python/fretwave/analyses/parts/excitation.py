"""The force of an analysis on a structure, a sector or all sectors of a wheel, and the responses to it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Optional

import numpy as np

from ...arrays import Complex
from ...case.harmonic import nodal_diameter
from ...case.observed import dof_of
from ...cyclic.engine_order import speed_rpm
from ...post.largest import largest
from ...post.motion import complex_amplitudes
from .branch import continuation
from .context import AnalysisContext
from .observed import observed_by
from .rest import modes_or_free, rest_state, start_mode
from .tuned import tuned_sector

if TYPE_CHECKING:
    from petsc4py import PETSc

    from ...hb.forced_response import ForcedResponse
    from ...hb.harmonic_problem import HarmonicProblem
    from ...hb.harmonics import Harmonics
    from ...hb.observed import Observed
    from ...model.modes import LinearMode
    from ...model.rest import Rest
    from ...solve.continuation import Continuation
    from ..forced import ForcedAnalysis


#: Lowest modes among which a force finds the one that it moves, of models of at most so many dofs: where coordinates of
#: several units stand in one vector, as those of a reduction do.
DRIVEN, SMALL = 10, 2000
#: Times the static displacement that the reference mode's stiffness gives: a mode that is moved more scales instead.
FAR = 100.0


def forces(context: AnalysisContext[ForcedAnalysis]) -> dict[str, float]:
    """Amplitude [force] at level 1 of each excited dof at the speed of the model."""
    given, given_at = context.analysis.force, context.analysis.force_rpm
    grown = 1.0 if given_at is None else (context.case.speed_rpm / given_at) ** 2
    return {dof: grown * amplitude for dof, amplitude in given.items()}


def wave_of_forces(context: AnalysisContext[ForcedAnalysis]) -> Complex:
    """Amplitudes (n_dof,) [force] at level 1; on sector j of a wheel with the delay of the wave, e^{-i j theta}."""
    case = context.case
    force = np.zeros(len(case.dofs), dtype=complex)
    turn = 2j * np.pi * (context.analysis.nodal_diameter or 0) / (case.wheel.sectors if case.wheel else 1)
    for dof, amplitude in forces(context).items():
        for j, place in enumerate(case.places(dof)):
            force[place] = amplitude * np.exp(-j * turn)
    return force


def most_driven(reference: LinearMode, modes: Sequence[LinearMode], force: Complex) -> LinearMode:
    """The mode whose static displacement is largest, where it is far beyond what the reference's stiffness gives.

    A mode of unit modal mass is displaced statically by phi (phi^H P) / omega^2 under P; |P| over the stiffness
    omega^2 / |phi|^2 bounds that from above.
    """
    elastic = [mode for mode in modes if mode.omega > 0]
    shapes = [mode.shape + 1j * mode.imaginary for mode in elastic]
    sizes = [np.linalg.norm(x) * abs(np.vdot(x, force)) / mode.omega**2 for x, mode in zip(shapes, elastic)]
    shape = np.hypot(reference.shape, reference.imaginary)
    most = np.linalg.norm(force) * float(np.sum(shape**2)) / reference.omega**2
    return elastic[int(np.argmax(sizes))] if sizes and max(sizes) > FAR * most else reference


@dataclass
class Excitation:
    """What the responses of all levels share.

    Attributes
    ----------
    reference : LinearMode
        By its number, with the contact as it is at rest.
    rest : Rest or None
    phase : float or None
        Of the last point of the response [rad]: the next one's is the nearest to it, no jump by 2 pi.
    """

    context: AnalysisContext[ForcedAnalysis]
    harmonics: Harmonics
    reference: LinearMode
    rest: Optional[Rest]
    phase: float | None = None

    @cached_property
    def scale(self) -> LinearMode:
        """Scales the unknowns. Collective the first time."""
        if self.context.case.wheel is not None or self.context.model.n_dof > SMALL:
            return self.reference
        count = min(DRIVEN, self.context.model.n_dof)
        return most_driven(self.reference, modes_or_free(self.context, count), wave_of_forces(self.context))

    @property
    def analysis(self) -> ForcedAnalysis:
        return self.context.analysis

    @cached_property
    def observed(self) -> Observed:
        """As the problems take it. Collective the first time."""
        analysis = self.analysis
        return observed_by(self.context, analysis.observe, self.reference, analysis.sector or 0)

    def problem(self, level: float) -> ForcedResponse:
        """Steady response at a level. Collective."""
        from ...hb.forced_response import ForcedResponse

        return ForcedResponse(
            self.context.model,
            self.harmonics,
            force={1: wave_of_forces(self.context)},
            level=level,
            dof=self.observed,
            reference=self.scale,
            prefix=self.context.prefix,
            rest=self.rest,
        )

    def branch(
        self, problem: ForcedResponse, snapshot: Optional[dict[str, Any]] = None, go_on: bool = False
    ) -> Continuation:
        """From the first to the last frequency, or from where a snapshot was taken. Collective."""
        low, high = (2.0 * math.pi * hertz for hertz in self.analysis.frequency)
        report_at = [2.0 * math.pi * hertz for hertz in self.analysis.report_at]
        name = f"{self.context.name}: level {problem.level:g}"
        return continuation(self.context, problem, (low, high), report_at, snapshot, go_on, name)

    def columns(self) -> list[str]:
        """Further columns of the table."""
        names = ["speed_rpm"] if self.analysis.engine_order else []
        return names + (["largest_amplitude", "largest_sector"] if self.context.case.wheel else [])

    def row(self, problem: HarmonicProblem, y: PETSc.Vec) -> dict[str, Any]:
        """Their values at a point. Collective."""
        order = self.analysis.engine_order
        state = problem.state(y)
        # A first phase near -pi and pi, where undamped motion stands, reads as -pi.
        around = self.phase if self.phase is not None else -0.5 * math.pi
        self.phase = state["phase"] + 2.0 * math.pi * round((around - state["phase"]) / (2.0 * math.pi))
        row: dict[str, Any] = {"phase": self.phase}
        if order:
            row["speed_rpm"] = speed_rpm(state["omega"], order)
        if self.context.case.wheel is not None:
            observed = problem.coefficients_at(y, self.context.case.places(dof_of(self.analysis.observe)))
            blades = np.abs(complex_amplitudes(problem.harmonics.labels, observed)[1])
            row = {**row, "largest_amplitude": float(blades.max()), "largest_sector": largest(blades)}
        return row


def excitation_of(context: AnalysisContext[ForcedAnalysis], harmonics: Harmonics) -> Excitation:
    """Of a forced analysis; a wheel's unknowns are scaled by the tuned wave that its force drives. Collective."""
    analysis = context.analysis
    if context.case.wheel is None:
        return Excitation(context, harmonics, *start_mode(context, analysis.linear_mode))
    from ...cyclic.sector import wave_mode

    with tuned_sector(context) as sector:
        tuned, _ = start_mode(sector, analysis.linear_mode)
    rest = rest_state(context)
    return Excitation(context, harmonics, wave_mode(tuned, nodal_diameter(analysis), context.case.wheel.sectors), rest)


@contextmanager
def tuned_excitation(context: AnalysisContext[ForcedAnalysis], harmonics: Harmonics) -> Iterator[Excitation]:
    """The same on the tuned sector that a wheel is made of. Collective."""
    with tuned_sector(context) as sector:
        yield excitation_of(sector, harmonics)
