"""Where a nonlinear mode of a whole wheel starts: a wave of the tuned sector, or a mode of the mistuned wheel."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any, Optional

import numpy as np
import numpy.typing as npt

from ..modes import LinearMode
from .asymptotes import other_asymptote
from .context import AnalysisContext
from .rest import rest_state, start_mode

Complex = npt.NDArray[np.complex128]

#: Modes of a mistuned wheel whose shares in a tuned wave differ by less are alike in it: the lower one is taken.
ALIKE = 1e-3


@dataclass(frozen=True)
class Start:
    """A linear mode to start from and what the branch needs beside it.

    Attributes
    ----------
    mode : LinearMode
        Stuck.
    rest : Preload or None
    asymptotes : dict
        As `other_asymptote` gives them.
    dof : int
        Normalised.
    avoid : (N n_dof,) complex, optional
        The other mode of a double one (`fretwave.NonlinearMode`).
    tuned : LinearMode, optional
        Mode of one sector that the wheel's is measured against.
    attributes : dict
        Of the results.
    """

    mode: LinearMode
    rest: Any
    asymptotes: dict[str, float]
    dof: int
    avoid: Optional[Complex] = None
    tuned: Optional[LinearMode] = None
    attributes: dict[str, Any] = field(default_factory=dict)


def start_of(context: AnalysisContext) -> Start:
    """Start of a mode analysis, of a sector or structure or of a wheel. Collective."""
    if context.case.wheel is not None:
        return _on_wheel(context)
    analysis: Any = context.analysis
    stuck, rest = start_mode(context, analysis.linear_mode)
    return Start(stuck, rest, other_asymptote(context, stuck), context.case.dof(analysis.normalise))


def _on_wheel(context: AnalysisContext) -> Start:
    analysis, wheel = context.analysis, context.case.wheel
    tuned, asymptotes = _tuned(context)
    rest = rest_state(context)
    if rest is not None:
        context.arrays["rest_displacement"] = rest.displacement
    name = analysis.normalise
    mode, avoid, sector = (_wave if wheel.deviations is None else _mistuned)(context, tuned)
    attributes = {"normalise": f"{name}@{sector}", "sectors": wheel.sectors, "sector_dofs": wheel.unit}
    return Start(mode, rest, asymptotes, context.case.dof(name, sector), avoid, tuned, attributes)


@contextmanager
def _sector(context: AnalysisContext) -> Iterator[AnalysisContext]:
    """The same analysis of the tuned sector alone. Collective."""
    from ..run import build_model

    case, diameters = context.case.wheel.sector, context.analysis.nodal_diameter or 0
    preload = case.preload_of(context.analysis)
    with build_model(case, context.analysis.dampers, context.comm, preload, diameters) as model:
        yield replace(context, model=model, case=case, arrays={})


def _tuned(context: AnalysisContext) -> tuple[LinearMode, dict[str, float]]:
    """Linear mode of the tuned sector in the wave that the analysis names, and its other asymptote. Collective."""
    with _sector(context) as sector:
        stuck, _ = start_mode(sector, context.analysis.linear_mode)
        return stuck, other_asymptote(sector, stuck)


def _wave(context: AnalysisContext, tuned: LinearMode) -> tuple[LinearMode, Optional[Complex], int]:
    """A wave of the tuned wheel, the other of its pair (DESIGN fact 6), and the sector normalised.

    Of a double mode, motions A phi + B conj(phi) with any A and B solve the linear equations. A travelling wave has
    B = 0: it avoids conj(phi). A standing wave A = B e^{i alpha} has its crest somewhere; with phi real at the
    normalised dof, Re(phi) has it there, and avoids Im(phi), the same wave moved by a quarter of its length.
    """
    from ..cyclic import wave_mode

    analysis, wheel = context.analysis, context.case.wheel
    sector = analysis.sector or 0
    mode = wave_mode(tuned, analysis.nodal_diameter, wheel.sectors)
    if 2 * analysis.nodal_diameter % wheel.sectors == 0:
        return mode, None, sector
    phi = mode.shape + 1j * mode.imaginary
    if analysis.wave == "travelling":
        return mode, phi.conj(), sector
    crest = phi[context.case.dof(analysis.normalise, sector)]
    phi *= np.sqrt(2) * abs(crest) / crest
    return LinearMode(mode.omega, mode.beta, phi.real.copy(), np.zeros(len(phi))), phi.imag + 0j, sector


def _mistuned(context: AnalysisContext, tuned: LinearMode) -> tuple[LinearMode, None, int]:
    """A mode of the mistuned wheel by its number, or the one most like a tuned wave, and where it moves most."""
    analysis, case = context.analysis, context.case
    if analysis.nodal_diameter is None:
        mode = context.linear_mode("stuck", analysis.linear_mode)[-1]
    else:
        mode = _most_alike(context, tuned)
    blades = case.wheel.by_sector(mode.shape)[:, case.dof(analysis.normalise)]
    sector = int(np.argmax(np.abs(blades))) if analysis.sector is None else analysis.sector
    return mode, None, sector


def _most_alike(context: AnalysisContext, tuned: LinearMode) -> LinearMode:
    """Of the N modes nearest in frequency the one with the largest share in the tuned pair's plane. Collective."""
    from ..cyclic import wave_mode

    wheel = context.case.wheel
    wave = wave_mode(tuned, context.analysis.nodal_diameter, wheel.sectors)
    phi, M = wave.shape + 1j * wave.imaginary, context.case.M
    modes = nearest_modes(context, tuned.omega, wheel.sectors)
    shares = np.array([abs(phi.conj() @ (M @ mode.shape)) ** 2 for mode in modes])
    alike = np.flatnonzero(shares > (1 - ALIKE) * shares.max())
    return modes[int(alike[0])]


def nearest_modes(context: AnalysisContext, omega: float, count: int) -> list[LinearMode]:
    """Stuck modes nearest to a frequency, by shift-invert there, in ascending order. Collective."""
    from petsc4py import PETSc

    options, key = PETSc.Options(), "modes_eps_target"
    given = options.getString(key, "")
    options[key] = (1 - 1e-9) * omega**2  # not on an eigenvalue
    try:
        return context.linear_mode("stuck", count)
    finally:
        options.delValue(key)
        if given:
            options[key] = given
