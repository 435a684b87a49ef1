"""Linear modes of a whole wheel: what they look like around it, and how far mistuning amplifies a forced response."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ...arrays import Array, Complex
from ...columns import Column
from ...cyclic.engine_order import folded
from ...errors import InputError
from ...model.sectors import in_wave
from ...post.amplification import WIDTHS, Family, Largest, largest_peak
from ...post.blade_peaks import whitehead
from ...post.largest import largest
from ...post.wave_content import participation, wave_content
from .asymptotes import limit_model
from .context import AnalysisContext

if TYPE_CHECKING:
    from ...model.model import Model
    from ...model.modes import LinearMode
    from ..linear import LinearAnalysis

#: Of a mode around the wheel, from the amplitudes of one dof in all sectors.
AROUND = (
    Column("participation", "1", "participation ratio of the sectors; nan where the dof stands still"),
    Column("largest_sector", "1", "sector that moves most; -1 where the dof stands still", "i"),
    Column("diameters", "1", "nodal diameters of the largest wave; -1 where the dof stands still", "i"),
    Column("diameters_share", "1", "share of this wave, forward and backward, in the sum of squares"),
)
#: Of the largest amplitude of a mode, what is left of a dof that does not move in it: digits that mean nothing.
STILL = 1e-9
NOT_AROUND = {"participation": np.nan, "largest_sector": -1, "diameters": -1, "diameters_share": np.nan}
#: Of the table of amplifications.
AMPLIFICATION = (
    "contact",
    "mode",
    "tuned_frequency_hz",
    "tuned_amplitude",
    "frequency_hz",
    "amplitude",
    "sector",
    "amplification",
)
NO_PEAK = Largest(np.nan, np.nan, -1)


def around_wheel(context: AnalysisContext[LinearAnalysis], mode: LinearMode) -> dict[str, Any]:
    """Values of :data:`AROUND` for a mode; none where no dof is observed, nan and -1 where it stands still."""
    if context.analysis.observe is None:
        return {}
    a = _observed(context, mode)
    if np.abs(a).max() <= STILL * np.hypot(mode.shape, mode.imaginary).max():
        return NOT_AROUND
    content = np.abs(wave_content(a)) ** 2
    n = len(a)
    share = np.array([content[d] + (content[n - d] if 0 < 2 * d < n else 0.0) for d in range(n // 2 + 1)])
    most = largest(share)
    return {
        "participation": participation(a),
        "largest_sector": largest(np.abs(a)),
        "diameters": most,
        "diameters_share": float(share[most] / share.sum()),
    }


def amplifications(
    context: AnalysisContext[LinearAnalysis], found: Mapping[str, Sequence[LinearMode]]
) -> list[dict[str, Any]]:
    """Of a unit force of the engine order at the observed dof, by limit of the contact and mode of its wave.

    The largest peak of any sector over that of the tuned wheel, both at frequencies about that of the mode: as far off
    as the largest deviation, where its peaks are after mistuning. Where one of them has no peak there, on the flank of
    another mode's, its numbers are nan and its sector is -1. Modes at the end of those found have no row. Collective.
    """
    rows, sectors = [], context.wheel.sectors
    wave = folded(context.analysis.engine_order or 0, sectors)
    force = np.exp(-2j * np.pi * wave * np.arange(sectors) / sectors)
    for limit, modes in found.items():
        with limit_model(context.tuned, context.comm, limit, wave) as model:
            tuned = _tuned(context, model, wave)
        places = np.array([_observed(context, mode) for mode in modes])
        every = _damped(context.analysis, modes, places, _damping(context, modes))
        last = min(tuned.omega.max(), every.omega.max()) if len(modes) < context.case.structure.n_dof else np.inf
        for number, window in enumerate(_windows(context, tuned), 1):
            if (
                window[1] <= last
                or number == len(tuned.omega) == len(modes) // sectors == context.tuned.structure.n_dof
            ):
                before = largest_peak(tuned, np.ones(1, dtype=complex), window) or NO_PEAK
                after = largest_peak(every, force, window) or NO_PEAK
                values = (limit, number, before.hz, before.amplitude, after.hz, after.amplitude, after.place)
                rows.append(dict(zip(AMPLIFICATION, (*values, after.amplitude / before.amplitude))))
    return rows


def _windows(context: AnalysisContext[LinearAnalysis], tuned: Family) -> Array:
    """Frequencies (R, 2) [rad/s] about the modes of a wave among which their peaks are after mistuning.

    Each is nearer to its own mode than to the next; modes nearer to each other than their widths have one peak.
    """
    deviations = context.wheel.deviations
    spread = 0.0 if deviations is None else float(np.abs(deviations).max())
    omega, width = tuned.omega, np.real(np.diagonal(tuned.damping))
    room, middle = spread * omega + WIDTHS * width, 0.5 * (omega[1:] + omega[:-1])
    apart = np.diff(omega) > width[1:] + width[:-1]
    low = np.maximum(omega - room, np.concatenate([[0.0], np.where(apart, middle, 0.0)]))
    return np.column_stack([low, np.minimum(omega + room, np.concatenate([np.where(apart, middle, np.inf), [np.inf]]))])


def _tuned(context: AnalysisContext[LinearAnalysis], model: Model, wave: int) -> Family:
    """Modes of the tuned sector in the wave that the engine order drives, at the observed dof. Collective."""
    from ...model.modes import linear_modes

    case, analysis = context.tuned, context.analysis
    modes = linear_modes(model, min(model.n_dof, analysis.modes))
    shapes = np.array([mode.shape + 1j * mode.imaginary for mode in modes])
    C, theta = case.damped(analysis.dampers).C, 2 * np.pi * wave / context.wheel.sectors
    damping = np.zeros((len(modes), len(modes))) if C is None else shapes.conj() @ in_wave(C, shapes.T, theta)
    dof = case.dof(str(analysis.observe))
    return _damped(analysis, modes, shapes[:, dof : dof + 1], np.asarray(damping, dtype=complex))


def _damping(context: AnalysisContext[LinearAnalysis], modes: Sequence[LinearMode]) -> Complex:
    """phi_r^H C phi_s of modes of the wheel."""
    C = context.case.damped(context.analysis.dampers).matrix("C")
    shapes = np.array([mode.shape + 1j * mode.imaginary for mode in modes])
    none = np.zeros((len(modes), len(modes)), dtype=complex)
    return none if C is None else np.asarray(shapes.conj() @ (C @ shapes.T))


def undamped(name: str, measured: str) -> InputError:
    """What is said of a response that has no peak."""
    what = "the response of a mode without damping has no peak"
    fix = "add for example `[damping]` with `zeta = 0.001`"
    return InputError(what, f"analysis '{name}', engine_order", measured, "damping of every mode", fix)


def _damped(analysis: LinearAnalysis, modes: Sequence[LinearMode], places: Complex, damping: Complex) -> Family:
    """Modes whose response is bounded: all that are not rigid are damped."""
    found = Family(np.array([mode.omega for mode in modes]), places, damping)
    own = np.where(found.omega > 0, np.real(np.diagonal(damping)), np.inf)
    if (own <= 0).any():
        raise undamped(analysis.name, f"mode {int(np.argmin(own)) + 1} is not damped")
    return found


def _observed(context: AnalysisContext[LinearAnalysis], mode: LinearMode) -> Complex:
    """Amplitudes (N,) of the observed dof in all sectors."""
    places = context.case.places(str(context.analysis.observe))
    return np.asarray(mode.shape[places] + 1j * mode.imaginary[places])


def amplification_lines(name: str, rows: Sequence[Mapping[str, Any]], sectors: int) -> list[str]:
    """A line for each mode and limit."""
    return [
        f"{name}: {row['contact']}: about mode {row['mode']} of the wave: {_amplification(row, sectors)}"
        for row in rows
    ]


def _amplification(row: Mapping[str, Any], sectors: int) -> str:
    if np.isnan(row["amplification"]):
        words = {"tuned_amplitude": "the tuned wheel", "amplitude": "any sector"}
        none = [text for key, text in words.items() if np.isnan(row[key])]
        return f"no peak of {' or of '.join(none)} on the flanks of the others'"
    return (
        f"largest peak in sector {row['sector']} at {row['frequency_hz']:.6g} Hz, {row['amplification']:.4f} times that"
        f" of the tuned wheel at {row['tuned_frequency_hz']:.6g} Hz (Whitehead's bound {whitehead(sectors):.3f})"
    )
