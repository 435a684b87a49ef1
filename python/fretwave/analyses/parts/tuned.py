"""The tuned sector of a wheel under analysis, and linear modes of the wheel near a frequency."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
import scipy.sparse as sp

from ...case.harmonic import HarmonicSection, nodal_diameter
from ...errors import NothingMoves
from ...model.structure import WHOLE
from .context import AnalysisContext
from .rest import rest_state

if TYPE_CHECKING:
    from ...model.modes import LinearMode

Harmonic = TypeVar("Harmonic", bound=HarmonicSection)

#: Modes of each wave that those of a wheel are made of, where its factor does not fit the memory.
NOMINAL = 12


@contextmanager
def tuned_sector(context: AnalysisContext[Harmonic]) -> Iterator[AnalysisContext[Harmonic]]:
    """The same analysis of the tuned sector alone. Collective."""
    from ...case.build import build_model

    analysis = context.analysis
    case = context.tuned
    preload, flow = case.preload_of(analysis), analysis.aerodynamics
    with build_model(case, analysis.dampers, context.comm, preload, nodal_diameter(analysis), flow) as model:
        yield replace(context, model=model, case=case, arrays={})


def in_waves(
    context: AnalysisContext[Harmonic], diameters: Iterable[int]
) -> Iterator[tuple[int, AnalysisContext[Harmonic]]]:
    """The tuned sector at rest in each wave, as long as the next is not asked for. Collective."""
    rest = None
    for d in diameters:
        with tuned_sector(context.of(context.analysis.model_copy(update={"nodal_diameter": d}))) as tuned:
            rest = rest_state(tuned) if rest is None else rest
            if rest is not None:
                tuned.model.settle(rest)
            yield d, tuned


def nearest_modes(context: AnalysisContext[Any], omega: float, count: int, contact: str = "stuck") -> list[LinearMode]:
    """Linear modes nearest to a frequency, in ascending order. Collective."""
    from ...model.modes import factor_fits

    if context.case.wheel is not None and not factor_fits(context.model):
        return _by_waves(context, omega, count, contact)
    return context.linear_mode(contact, count, omega)


def nearest_or_free(context: AnalysisContext[Any], omega: float, count: int) -> list[LinearMode]:
    """The same with contact that sticks or, where that leaves nothing to move, without it. Collective."""
    try:
        return nearest_modes(context, omega, count)
    except NothingMoves:
        return nearest_modes(context, omega, count, "free")


def _by_waves(context: AnalysisContext[Any], omega: float, count: int, contact: str) -> list[LinearMode]:
    """Those of a wheel whose factor does not fit, by waves of the tuned sector with its contact at rest. Collective."""
    from ...cyclic.nominal_modes import Mistuning, mistuned_frequencies, mistuned_modes

    sector, (_, mistuning) = context.tuned.structure, context.analysis.whole_wheel()
    waves = _waves(context, omega, contact)
    few = {d: sorted(modes, key=lambda mode: abs(mode.omega - omega))[: NOMINAL // 2] for d, modes in waves.items()}
    given, of = context.wheel.deviations, WHOLE if mistuning is None else mistuning.of
    deviations = np.zeros(sector.sectors) if given is None else np.asarray(given)
    mistuned = Mistuning(deviations, sp.csr_matrix(sector.parts[of]), sector.onto_parts)
    found = mistuned_modes(waves, mistuned, omega, count)
    before = mistuned_frequencies(few, mistuned, omega, count)
    apart = max(abs(mode.omega - other) for mode, other in zip(found, before)) / omega
    context.console.line(
        f"{context.name}: a factor of the wheel does not fit the memory: its linear modes ({contact}) by the {NOMINAL}"
        f" nearest of each wave of the tuned one; half of them give frequencies that differ by {apart:.1g}"
    )
    return found


def _waves(context: AnalysisContext[Any], omega: float, contact: str) -> dict[int, list[LinearMode]]:
    """Modes of the tuned sector nearest to a frequency, in 0 to N/2 nodal diameters. Collective."""
    return {
        d: tuned.linear_mode(contact, min(tuned.model.n_dof, NOMINAL), omega)
        for d, tuned in in_waves(context, range(context.wheel.sectors // 2 + 1))
    }
