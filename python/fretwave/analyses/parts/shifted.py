"""Linear damping added to a mode afterwards, against the mode computed with it (paper, remark in section 2.4)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Optional

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from ...arrays import Array
from ...case.analysis import AnalysisSection
from ...post.mode_curve import ModeCurve
from ...post.motion import complex_amplitudes
from .context import AnalysisContext

if TYPE_CHECKING:
    from ..mode import ModeAnalysis


def added_ratio(phi: npt.NDArray[np.complex128], omega0: float, M: sp.spmatrix, C: sp.spmatrix) -> float:
    """Damping ratio phi^H C phi / (2 omega0 phi^H M phi) that a damping matrix adds to a motion of shape phi."""
    loss, mass = np.real(phi.conj() @ (C @ phi)), np.real(phi.conj() @ (M @ phi))
    return float(loss / (2.0 * omega0 * mass))


def shifted_damping(
    context: AnalysisContext[AnalysisSection], damped: ModeAnalysis, modes: Iterable[ModeAnalysis]
) -> list[str]:
    """Add the damping to every undamped twin of a mode among others; a table and a line for each. Collective.

    Writes `<name>_shifted_<twin>.csv` with the columns of :func:`_compare`.
    """
    return [_shift(context, damped, twin) for twin in twins_of(damped, modes) if context.has_results(twin.name)]


def _shift(context: AnalysisContext[AnalysisSection], damped: ModeAnalysis, twin: ModeAnalysis) -> str:
    table, (labels, coefficients) = context.table(twin.name), context.coefficients(twin.name)
    dampers = context.case.damping_with(damped.dampers) - _or_zero(context.case.damping_with([]), context.case.M)
    added = [
        added_ratio(complex_amplitudes(labels, q)[1], omega0, context.case.M, dampers)
        for q, omega0 in zip(coefficients, table["omega0"])
    ]
    rows = _compare(table, np.array(added), ModeCurve.from_table(context.table(damped.name)))
    context.write_table(f"shifted_{twin.name}", {key: [row[key] for row in rows] for key in rows[0]})
    worst = max(min(row["difference"] / max(table["zeta"]), row["displacement"]) for row in rows)
    return (
        f"{damped.name}: {twin.name} with the dampers added afterwards follows it to within {100.0 * worst:.2g} % "
        f"(of the peak damping of {twin.name}, or of the amplitude where the curve is steep)"
    )


def _compare(table: Mapping[str, Array], added: Array, damped: ModeCurve) -> list[dict[str, float]]:
    """Each point of the shifted curve: |difference of zeta| at its amplitude, and relative distance to its zeta."""
    rows = []
    for amplitude, zeta in zip(table["amplitude"], table["zeta"] + added):
        values = [value.zeta for value in damped.all_at(float(amplitude))]
        places = damped.amplitudes_at(float(zeta))
        rows.append(
            {
                "amplitude": float(amplitude),
                "zeta_shifted": float(zeta),
                "zeta": min(values, key=lambda value: abs(value - zeta), default=np.nan),
                "difference": min((abs(value - float(zeta)) for value in values), default=np.inf),
                "displacement": min((abs(place / float(amplitude) - 1.0) for place in places), default=np.inf),
            }
        )
    return rows


def twins_of(damped: ModeAnalysis, others: Iterable[ModeAnalysis]) -> list[ModeAnalysis]:
    """Analyses of the same linear mode on the same dof without dampers; none of a mode that has none."""
    key = (damped.linear_mode, damped.normalise)
    twins = [other for other in others if not other.dampers and (other.linear_mode, other.normalise) == key]
    return twins if damped.dampers else []


def _or_zero(C: Optional[sp.spmatrix], M: sp.spmatrix) -> sp.spmatrix:
    return sp.csr_matrix(M.shape) if C is None else C
