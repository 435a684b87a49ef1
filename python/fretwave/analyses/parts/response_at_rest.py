"""What `fretwave check` says of a forced response: the level at which its linear response first makes a pair slip."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Optional

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg

from ...arrays import Complex
from ...case.flow import with_flow
from ...case.harmonic import nodal_diameter
from ...case.observed import label_of, unit_of
from ...errors import InputError, NothingMoves
from ...model.law_info import OPEN
from ...model.sectors import by_sector
from ...model.wheel_matrix import entries_of
from .at_rest import (
    NO_LIMIT,
    FirstSlip,
    States,
    Told,
    first_slip,
    place_of,
    rest_and_mode,
    rest_line,
    stuck_line,
)
from .excitation import wave_of_forces
from .fed_modes import motions, shapes_of
from .observed import observed_amplitude, observed_by
from .others import fed_under_force
from .rest import loaded_state
from .tuned import nearest_modes, tuned_sector

if TYPE_CHECKING:
    from ...model.modes import LinearMode
    from ...model.sectors import Term
    from ..forced import ForcedAnalysis
    from .context import AnalysisContext

    Forced = AnalysisContext[ForcedAnalysis]

#: Modes in the range at whose frequencies the response is taken: its peaks, but for (zeta omega)^2; the largest alone.
MOST_PEAKS = 8
#: A smaller damping ratio is none.
UNDAMPED = 1e-12


@dataclass(frozen=True)
class Linear:
    """(K + i omega C - omega^2 M) X = P of the complex amplitudes of a structure, a wave or a wheel.

    K has the flow's forces where they act, and the pairs that are not open at rest, stuck.
    """

    K: sp.csc_matrix
    C: sp.csc_matrix
    M: sp.csc_matrix
    P: Complex

    def response(self, omega: float) -> LinearMode:
        """At a frequency, level 1, as a motion."""
        from ...model.modes import LinearMode

        Z = sp.csc_matrix(self.K + 1j * omega * self.C - omega**2 * self.M)
        X = scipy.sparse.linalg.spsolve(Z, self.P)
        return LinearMode(omega, 0.0, X.real.copy(), X.imag.copy())

    def drives(self, mode: LinearMode) -> bool:
        """Whether the force does work on it."""
        phi = mode.shape + 1j * mode.imaginary
        return bool(abs(phi.conj() @ self.P) > 1e-9 * np.linalg.norm(phi) * np.linalg.norm(self.P))

    def peak(self, mode: LinearMode) -> float:
        """Coordinate of a mode of unit modal mass at its frequency, |phi^H P| / (omega phi^H C phi)."""
        phi = mode.shape + 1j * mode.imaginary
        loss = float(np.real(phi.conj() @ (self.C @ phi)))
        return float(abs(phi.conj() @ self.P)) / (mode.omega * loss) if loss > 2 * UNDAMPED * mode.omega else np.inf

    def on(self, phi: Complex) -> Linear:
        """The same of motions in the space of columns (n_dof, n)."""
        K, C, M = (sp.csc_matrix(phi.conj().T @ (A @ phi)) for A in (self.K, self.C, self.M))
        return Linear(K, C, M, phi.conj().T @ self.P)


@dataclass(frozen=True)
class ResponseSlip:
    """A first slip as the level grows, at a frequency [Hz]; the amplitude that is observed at level 1."""

    slip: FirstSlip
    hertz: float
    seen: float


def response_at_rest(context: Forced) -> Told:
    """State at rest, stuck frequency, and level of first slip against those of the analysis. Collective."""
    if not context.case.contacts:
        return [], []
    states, mode, seconds = _solved(context)
    lines = [rest_line(context, states, seconds), stuck_line(context, mode), *fed_under_force(context)]
    closed = _closed(context, states)
    if closed is None:
        return [*lines, NO_LIMIT], []
    linear = _linear(context, closed)
    sizes = _peaks(context, linear)
    peaks = [mode for _, mode in sizes]
    undamped = next((mode for size, mode in sizes if not np.isfinite(size)), None)
    if undamped is not None:
        return [*lines, _undamped_line(context, _slip_at(context, states, undamped, mode))], []
    ends = [2 * np.pi * hertz for hertz in context.analysis.frequency]
    found = [_slip_at(context, states, linear.response(omega), mode) for omega in [*(m.omega for m in peaks), *ends]]
    known = [item for item in found if item is not None]
    if not known:
        return [*lines, NO_LIMIT], []
    lasting = min(item.slip.lasting for item in known)
    first = min(known, key=lambda item: item.slip.amplitude)
    first = replace(first, slip=replace(first.slip, lasting=lasting))
    return [*lines, _slip_line(context, first)], _never_slips(context, lasting)


def _solved(context: Forced) -> tuple[States, LinearMode, float]:
    """Of a wheel the mode is that of the tuned sector's wave. Collective."""
    if context.case.wheel is None:
        states, mode, _, seconds = rest_and_mode(context)
        return states, mode, seconds
    began = time.perf_counter()
    with tuned_sector(context) as sector:
        _, mode, _, _ = rest_and_mode(sector)
    states = context.comm.bcast(loaded_state(context).contacts)
    return states, mode, time.perf_counter() - began


def _peaks(context: Forced, linear: Linear) -> list[tuple[float, LinearMode]]:
    """Stuck modes with frequencies in the range that answer the force most, and how much. Collective."""
    low, high = (2 * np.pi * hertz for hertz in context.analysis.frequency)
    count = MOST_PEAKS if context.case.wheel is None else max(MOST_PEAKS, 2 * context.wheel.sectors)
    try:
        modes = nearest_modes(context, 0.5 * (low + high), min(context.model.n_dof, count))
    except NothingMoves:
        return []
    flow = context.analysis.aerodynamics
    sizes = _under_flow(context, linear, modes) if flow else [(linear.peak(mode), mode) for mode in modes]
    inside = [item for item in sizes if low <= item[1].omega <= high and linear.drives(item[1])]
    return sorted(inside, key=lambda item: item[0], reverse=True)[:MOST_PEAKS]


def _under_flow(context: Forced, linear: Linear, modes: Sequence[LinearMode]) -> list[tuple[float, LinearMode]]:
    """What the flow, which moves their frequencies and damps or feeds them, makes of modes."""
    from ...model.modes import LinearMode

    phi, (values, shares, own) = shapes_of(modes), motions(context, modes)
    few, found = linear.on(phi), []
    for value, share in zip(values[own], shares[:, own].T):
        damped, motion = abs(value.real) > UNDAMPED * abs(value), phi @ share
        if value.imag > 0:
            answer = few.response(value.imag) if damped else None
            size = np.inf if answer is None else float(np.linalg.norm(answer.shape + 1j * answer.imaginary))
            found.append((size, LinearMode(float(value.imag), -float(value.real), motion.real, motion.imag)))
    return found


def _linear(context: Forced, closed: sp.csc_matrix) -> Linear:
    case, analysis = context.case, context.analysis
    structure = case.damped(analysis.dampers)
    K, C = structure.K, structure.C
    if analysis.aerodynamics:
        K, C = with_flow(case, K, C, nodal_diameter(analysis))
    damping = sp.csc_matrix(closed.shape, dtype=complex) if C is None else _in_wave(context, C)
    return Linear(_in_wave(context, K) + closed, damping, _in_wave(context, structure.M), wave_of_forces(context))


def _in_wave(context: Forced, given: Term) -> sp.csc_matrix:
    """sum_k A_k e^{-i k theta}."""
    sectors = context.case.neighbours.sectors if context.case.neighbours is not None else 1
    theta = 2 * np.pi * nodal_diameter(context.analysis) / sectors
    return sp.csc_matrix(sum(np.exp(-1j * k * theta) * entries_of(A) for k, A in by_sector(given).items()))


def _closed(context: Forced, states: States) -> Optional[sp.csc_matrix]:
    """Stiffness of the pairs that are not open at rest, stuck, in the wave, sum B^H k B; None where one is rigid."""
    n = context.model.n_dof
    total = sp.csc_matrix((n, n), dtype=complex)
    for contact, state in zip(context.case.contacts, states):
        stiffness = np.where((state["status"] != OPEN)[:, None], contact.stuck_stiffness(), 0.0)
        if not np.isfinite(stiffness).all():
            return None
        B = _in_wave(context, contact.B)
        total = total + B.conj().T @ sp.diags(stiffness.ravel()) @ B
    return total


def _slip_at(context: Forced, states: States, response: LinearMode, mode: LinearMode) -> Optional[ResponseSlip]:
    """Of the response at a frequency; None where no pair has a sharp limit. Collective."""
    slip = first_slip(context, states, response, 1.0)
    if slip is None:
        return None
    seen = observed_by(context, context.analysis.observe, mode, context.analysis.sector or 0)
    return ResponseSlip(slip, response.frequency_hz, observed_amplitude(context, seen, response))


def _slip_line(context: Forced, found: ResponseSlip) -> str:
    slip = found.slip
    if not np.isfinite(slip.amplitude):
        return "first slip: the linear response makes no pair slip at any level"
    low, high = min(context.analysis.levels), max(context.analysis.levels)
    side = "below" if slip.lasting < low else "above" if slip.lasting > high else "within"
    seen = f"{slip.amplitude * found.seen:.3g} {_seen(context)}"
    return (
        f"first slip expected at level {slip.amplitude:.3g} ({found.hertz:.6g} Hz, {seen}, {place_of(context, slip)}),"
        f" in every period from about level {slip.lasting:.3g}: {side} the levels asked for"
    )


def _undamped_line(context: Forced, found: Optional[ResponseSlip]) -> str:
    """Of a resonance without damping, where the motion is the mode's."""
    if found is None:
        return NO_LIMIT
    if not np.isfinite(found.slip.amplitude):
        return f"first slip: the linear mode of {found.hertz:.6g} Hz, which nothing damps, makes no pair slip"
    seen = f"{found.slip.amplitude * found.seen:.3g} {_seen(context)}"
    return (
        f"first slip expected at any level: nothing damps the linear response at {found.hertz:.6g} Hz, where pairs slip"
        f" from a = {seen} on ({place_of(context, found.slip)})"
    )


def _seen(context: Forced) -> str:
    """Unit and name of what is observed, on a wheel in one sector."""
    given = context.analysis.observe
    sector = "" if context.case.wheel is None else f"@{context.analysis.sector or 0}"
    return f"{context.units(unit_of(given))} of {label_of(given)}{sector}"


def _never_slips(context: Forced, lasting: float) -> list[InputError]:
    """Levels whose responses all are linear."""
    name, high = context.name, max(context.analysis.levels)
    if not lasting > high:
        return []
    expected, fix = "a force that moves pairs along their tangents", "another force, or other friction limits"
    if np.isfinite(lasting):
        expected = f"more than about {lasting:.3g}, from where the linear response expects slip in every period"
        fix = f"--set '{name}.levels=[{10 * lasting:.2g}]'"
    what = f"no level of '{name}' is expected to make a pair slip in every period"
    return [InputError(what, f"{name}.levels", f"at most {high:g}", expected, fix)]
