"""Where a nonlinear mode of a whole wheel starts: a wave of the tuned sector, or a mode of the mistuned wheel."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Optional

import numpy as np
import scipy.sparse as sp

from ...arrays import Complex
from ...case.harmonic import nodal_diameter, with_flow_forces
from ...case.observed import dof_of
from ...cyclic.engine_order import folded
from ...post.largest import largest
from .asymptotes import MORE_MODES, most_like, other_asymptote
from .context import AnalysisContext
from .fed_modes import motions, shapes_of
from .gyroscopic import TOLD, gyroscopic_shift
from .observed import observed_by
from .rest import modes_or_free, rest_state, start_mode
from .tuned import nearest_modes, nearest_or_free, tuned_sector

if TYPE_CHECKING:
    from ...hb.observed import Observed
    from ...model.modes import LinearMode
    from ...model.rest import Rest
    from ..mode import ModeAnalysis

#: Families of the tuned sector looked through for that of a wheel's mode, beyond its number over N.
MORE_FAMILIES = 3
#: A motion with so many times the share of one wave than of that which runs the other way runs with it.
RUNS = 1.1
#: Motions whose shares in a wave differ by less are alike in it.
ALIKE = 1e-3


@dataclass(frozen=True)
class Start:
    """A linear mode to start from and what the branch needs beside it.

    Attributes
    ----------
    mode : LinearMode
        Stuck.
    rest : Rest or None
    asymptotes : dict
        As `other_asymptote` gives them.
    dof : int, (n_dof,), or LinearMode
        Normalised.
    avoid : (N n_dof,) complex, optional
        The other mode of a double one (`fretwave.NonlinearMode`).
    tuned : LinearMode, optional
        Mode of one sector that the wheel's is measured against.
    attributes : dict
        Of the results.
    """

    mode: LinearMode
    rest: Optional[Rest]
    asymptotes: dict[str, float]
    dof: Observed
    avoid: Optional[Complex] = None
    tuned: Optional[LinearMode] = None
    attributes: dict[str, Any] = field(default_factory=dict)


def start_of(context: AnalysisContext[ModeAnalysis]) -> Start:
    """Start of a mode analysis, of a sector or structure or of a wheel. Collective."""
    if context.case.wheel is not None:
        return _on_wheel(context)
    analysis = context.analysis
    stuck, rest = start_mode(context, analysis.linear_mode)
    observed = observed_by(context, analysis.normalise, stuck)
    return Start(stuck, rest, other_asymptote(context, stuck), observed)


def _on_wheel(context: AnalysisContext[ModeAnalysis]) -> Start:
    wheel, mistuned = context.wheel, context.wheel.deviations is not None
    analysis = context.analysis
    rest = rest_state(context)
    mode = None
    if mistuned and analysis.nodal_diameter is None:
        mode = _numbered(context)
        context = context.of(_family(context, mode))
    tuned, asymptotes = _tuned(context)
    analysis = context.analysis
    if mistuned:
        mode, avoid = mode or _most_alike(context, tuned), None
        asymptotes = _free(context, mode)
        sector = _largest(context, mode) if analysis.sector is None else analysis.sector
    else:
        sector = analysis.sector or 0
        mode, avoid = _wave(context, tuned, sector)
    dof = context.case.dof(dof_of(analysis.normalise), sector)
    attributes = {
        "normalise": context.case.dofs[dof],
        "sectors": wheel.sectors,
        "sector_dofs": wheel.unit,
        "tuned_omega": tuned.omega,
        "tuned_amplitude": tuned_amplitude(context, tuned),
        "deviations": wheel.deviations,
    }
    return Start(mode, rest, asymptotes, dof, avoid, tuned, attributes)


def _tuned(context: AnalysisContext[ModeAnalysis]) -> tuple[LinearMode, dict[str, float]]:
    """Linear mode of the tuned sector in the wave that the analysis names, and its other asymptote. Collective."""
    analysis = context.analysis
    with tuned_sector(context) as sector:
        stuck, _ = start_mode(sector, analysis.linear_mode)
        return stuck, other_asymptote(sector, stuck)


def tuned_amplitude(context: AnalysisContext[ModeAnalysis], tuned: LinearMode) -> float:
    """Of the normalised dof in each sector of the wheel in the tuned travelling wave of unit modal mass."""
    analysis = context.analysis
    dof = context.tuned.dof(dof_of(analysis.normalise))
    return float(abs(tuned.shape[dof] + 1j * tuned.imaginary[dof]) / np.sqrt(context.wheel.sectors))


def _numbered(context: AnalysisContext[ModeAnalysis]) -> LinearMode:
    """A mode of the mistuned wheel by its number; where waves are parted that of their motions. Collective.

    A standing shape is as near to one motion of a pair as to the other, and both would lead to the same branch.
    """
    number, sectors = context.analysis.linear_mode, context.wheel.sectors
    lowest = modes_or_free(context, number)
    standing = context.numbered(lowest, number)
    if not _parted(context, lowest):
        return standing
    family = sectors * -(-number // sectors)
    modes = modes_or_free(context, min(context.model.n_dof, family + MORE_MODES))
    values, shares, own = motions(context, modes)
    found = sorted(np.flatnonzero(own & (values.imag > 0)), key=lambda one: abs(values[one]))
    if len(found) < len(modes):  # some do not swing
        return standing
    motion = shapes_of(modes) @ shares[:, found[number - 1]]
    return replace(standing, shape=motion.real.copy(), imaginary=motion.imag.copy())


def _family(context: AnalysisContext[ModeAnalysis], mode: LinearMode) -> ModeAnalysis:
    """The analysis with the tuned wave that has the largest share in a mode of the mistuned wheel. Collective.

    Spatial indices n and N - n have equal shares in a real shape: the forward wave is named.
    """
    analysis = context.analysis
    wheel = context.wheel
    shape = wheel.by_sector(mode.shape + 1j * mode.imaginary)
    M = sp.csr_matrix(context.tuned.M)
    waves = np.fft.ifft(shape, axis=0)
    most = largest(np.array([np.real(c.conj() @ (M @ c)) for c in waves]))
    diameters = folded(most, wheel.sectors)
    named = analysis.model_copy(update={"nodal_diameter": diameters})
    count = min(wheel.unit, analysis.linear_mode // wheel.sectors + MORE_FAMILIES)
    with tuned_sector(context.of(named)) as sector:
        rest_state(sector)  # numbers are those of the pairs that it closes
        modes = modes_or_free(sector, count)
    shares = [abs((m.shape - 1j * m.imaginary) @ (M @ waves[most])) for m in modes]
    return named.model_copy(update={"linear_mode": 1 + int(np.argmax(shares))})


def _wave(
    context: AnalysisContext[ModeAnalysis], tuned: LinearMode, sector: int
) -> tuple[LinearMode, Optional[Complex]]:
    """A wave of the tuned wheel, and the other of its pair, to be avoided."""
    from ...cyclic.wheel_modes import standing_wave, travelling_wave

    analysis = context.analysis
    wheel, diameters = context.wheel, nodal_diameter(analysis)
    if analysis.wave == "travelling":
        return travelling_wave(tuned, diameters, wheel.sectors)
    return standing_wave(tuned, diameters, wheel.sectors, context.tuned.dof(dof_of(analysis.normalise)), sector)


def uneven_samples(samples: int, sectors: int, diameters: int) -> Optional[str]:
    """What to say when the sectors of a wave see its period at different samples; None when all see the same.

    The delay from one sector to the next, ND/N of a period, must be a whole number of samples. If not, each sector
    meets the kinks of a law in Python between other samples, and the wheel differs from one sector by aliasing. Forces
    in continuous time are the same in all, whatever the samples are.
    """
    from ...cyclic.aerodynamics import period_of

    period = period_of(diameters, sectors)
    if samples % period == 0:
        return None
    unit = math.lcm(2, period)  # even, as the number of samples is
    nearest = unit * -(-samples // unit)
    return (
        f"sectors see this wave at different samples: {samples} * {diameters} is no multiple of {sectors}"
        f" (samples = {nearest} would be the same in all)"
    )


def _largest(context: AnalysisContext[ModeAnalysis], mode: LinearMode) -> int:
    """Sector in which the normalised dof moves most."""
    analysis = context.analysis
    dof = context.tuned.dof(dof_of(analysis.normalise))
    return largest(np.abs(context.wheel.by_sector(mode.shape + 1j * mode.imaginary)[:, dof]))


def _most_alike(context: AnalysisContext[ModeAnalysis], tuned: LinearMode) -> LinearMode:
    """Of the N modes nearest in frequency the one with the largest share in the tuned pair's plane. Collective."""
    from ...cyclic.sector import wave_mode
    from ...cyclic.wheel_modes import most_alike

    analysis = context.analysis
    wheel = context.wheel
    wave = wave_mode(tuned, nodal_diameter(analysis), wheel.sectors)
    modes = nearest_or_free(context, tuned.omega, wheel.sectors)
    standing = most_alike(modes, wave, context.case.M)
    return _running(context, modes, wave, standing) if _parted(context, modes) else standing


def _parted(context: AnalysisContext[ModeAnalysis], modes: Sequence[LinearMode]) -> bool:
    """Whether the flow or gyroscopic forces part the waves that run forward from those that run backward."""
    C = context.case.damped(context.analysis.dampers).C
    return with_flow_forces(context.analysis) or gyroscopic_shift(modes, C) > TOLD


def _running(
    context: AnalysisContext[ModeAnalysis], modes: Sequence[LinearMode], wave: LinearMode, standing: LinearMode
) -> LinearMode:
    """A mode turned into the motion that the flow and gyroscopic forces make of it, if that runs as the wave does.

    They part the waves that run forward and backward, of which an undamped mode has as much of the one as of the other,
    unless the deviations part the standing ones further.
    """
    phi, (_, shares, own) = shapes_of(modes), motions(context, modes)
    motion, along = phi @ shares[:, own], wave.shape + 1j * wave.imaginary
    forward, backward = (np.abs(one @ (context.case.M @ motion)) ** 2 for one in (along.conj(), along))
    best = largest(forward, ALIKE)
    if forward[best] <= RUNS * backward[best]:
        return standing
    found = motion[:, best]
    return replace(standing, shape=found.real.copy(), imaginary=found.imag.copy())


def _free(context: AnalysisContext[ModeAnalysis], mode: LinearMode) -> dict[str, float]:
    """Frequency without contact of the mode most like one of the mistuned wheel. Collective."""
    if any(contact.components > 1 for contact in context.case.contacts) or not context.case.contacts:
        return {}
    free = nearest_modes(context, mode.omega, context.wheel.sectors, "free")
    return {"free_omega": most_like(context, free, mode).omega}
