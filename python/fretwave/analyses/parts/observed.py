"""What an analysis normalises by or observes, on its model."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Optional, Union

import numpy as np

from ...arrays import Array
from ...case.analysis import AnalysisSection
from ...case.harmonic import HarmonicSection
from ...case.observed import ObservedTable, label_of, unit_of
from ...columns import Column, columns_named, over
from ...errors import InputError
from ...results.analysis import ROW
from ...results.results import AnalysisWriter
from .context import AnalysisContext
from .rest import stuck_or_free

if TYPE_CHECKING:
    from ...case.load import Case
    from ...hb.observed import Observed
    from ...model.model import Model
    from ...model.modes import LinearMode

#: Share of the largest displacement below which a motion is rounding.
STANDS_STILL = 1e-10


def observed_by(
    context: AnalysisContext[HarmonicSection], given: Union[str, ObservedTable], start: LinearMode, sector: int = 0
) -> Observed:
    """As the problems of harmonic balance take it. Collective.

    Parameters
    ----------
    start : the linear mode of the analysis, whose contact is as at rest
    sector : of a wheel
    """
    case = context.case
    if isinstance(given, str):
        return case.dof(given, sector)
    if given.mode is None:
        return row_on(case, given)
    return start if given.mode == context.analysis.linear_mode else stuck_or_free(context, given.mode)


def observed_amplitude(context: AnalysisContext[AnalysisSection], seen: Observed, mode: LinearMode) -> float:
    """What an analysis sees of a linear motion as it is scaled. Collective."""
    from ...hb.observed import row_of

    return _along(row_of(context.model, seen), mode)


def _along(row: Sequence[tuple[int, float]], mode: LinearMode) -> float:
    """Modulus of a linear motion along a row of (dof, weight)."""
    phi = mode.shape + 1j * mode.imaginary
    return float(abs(sum(weight * phi[dof] for dof, weight in row)))


def normalised_amplitude(context: AnalysisContext[Any], seen: Observed, mode: LinearMode) -> float:
    """The same of what is to be normalised. Collective.

    Raises
    ------
    InputError
        It does not move, as the core has it when the branch is to begin (`NonlinearMode`).
    """
    from ...hb.observed import row_of

    row = row_of(context.model, seen)
    heaviest = max((abs(weight) for _, weight in row), default=0.0)
    largest = heaviest * max(np.abs(mode.shape).max(), np.abs(mode.imaginary).max())
    amplitude = _along(row, mode)
    if amplitude < STANDS_STILL * largest:
        raise InputError(
            "what is normalised does not move in the starting mode",
            f"analysis '{context.name}', normalised by {label_of(context.analysis.normalise)}",
            f"{amplitude / largest:.6g} of the largest displacement",
            f"> {STANDS_STILL:g}",
            "normalise on a dof or row that takes part in the mode",
        )
    return amplitude


def row_on(case: Case, given: ObservedTable) -> Array:
    """Weights (n_dof,) of dofs."""
    entries = [(case.dof(dof), weight) for dof, weight in zip(given.dofs or (), given.weights or ())]
    return _spread(entries, len(case.dofs))


def dense(model: Model, observed: Observed) -> Union[int, Array]:
    """A dof's number, or weights (n_dof,). Collective."""
    from ...hb.observed import row_of

    return observed if isinstance(observed, int) else _spread(row_of(model, observed), model.n_dof)


def _spread(row: Sequence[tuple[int, float]], n_dof: int) -> Array:
    weights = np.zeros(n_dof)
    for dof, weight in row:
        weights[dof] = weight
    return weights


def named(columns: Sequence[str], given: Union[str, ObservedTable]) -> list[Column]:
    """Columns whose amplitude is what the analysis looks at."""
    known = columns_named(columns)
    return known if isinstance(given, str) else over(known, unit_of(given), label_of(given))


def keep_row(
    context: AnalysisContext[AnalysisSection],
    writer: AnalysisWriter,
    given: Union[str, ObservedTable],
    row: Optional[Sequence[tuple[int, float]]],
) -> None:
    """Keep with the results the weights (n_dof,) of what is no dof, for the pictures."""
    if isinstance(given, str) or row is None:
        return
    unit = "1" if given.mode is None else "sqrt(mass)"
    writer.dataset(
        ROW, _spread(row, len(context.case.dofs)), units=unit, long_name="weights of the dofs in the amplitude"
    )
