"""The reduction that a case asks for: which dofs are kept, the reduced case, and its error."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from .contacts import ContactSpec, closed_contacts
from .reduction_report import ReductionReport
from .schema import ReductionSection

if TYPE_CHECKING:
    from ..model.reduction import Reduction
    from .analysis import AnalysisSection
    from .load import Case


def kept_dofs(
    named: Mapping[str, int],
    contacts: Sequence[ContactSpec],
    analyses: Mapping[int, AnalysisSection],
    dofs: Sequence[str],
) -> list[int]:
    """Numbers of the dofs that a reduction keeps: of contacts, and those named by the model or an analysis."""
    asked = {name for analysis in analyses.values() for name in analysis.kept_dofs()}
    numbers = {k for k, name in enumerate(dofs) if name in asked} | set(named.values())
    return sorted(numbers.union(*(np.unique(contact.rows.indices).tolist() for contact in contacts)))


def reduce_case(case: Case, comm: Any, modes: int | None = None) -> Case:
    """The case on its reduced matrices, itself when it asks for no reduction. Collective.

    Parameters
    ----------
    modes : int, optional
        Component modes, in place of the case's.
    """
    if case.reduction is None:
        return case
    if case.neighbours is not None:
        from .reduce_sector import reduce_sector_case

        return reduce_sector_case(case, comm, modes)
    began = time.perf_counter()
    with reduction_of(case, case.reduction, comm, modes) as reduction:
        small = _on(case, reduction)
        wall = time.perf_counter() - began
    kept = case if case.reduction.error_at is not None else None
    return replace(small, reduced=_report(case, small, reduction.component_hz, wall, comm), unreduced=kept)


def nonlinear_error_at(case: Case, analysis: AnalysisSection, problem: Any, y: Any) -> Any:
    """Estimate of what the unreduced model would change at a point of a mode; the reduction is made again. Collective.

    Returns
    -------
    fretwave.NonlinearError
    """
    from ..hb.reduction_error import nonlinear_error
    from ..model.reduction import reduce

    full = case.unreduced
    assert full is not None and case.reduced is not None
    if full.neighbours is not None:
        from .reduce_sector import wave_error_at

        return wave_error_at(case, analysis, problem, y)
    preload = full.preload_of(analysis)
    loads = [full.loads[name] for name in preload.loads] if preload is not None else []
    C = full.damping_with(analysis.dampers)
    modes = case.reduced.component_modes
    with reduce(full.M, full.K, C, keep=np.array(full.keep), comm=problem.model.comm, modes=modes) as reduction:
        return nonlinear_error(reduction, problem, y, np.sum(loads, axis=0) if loads else None)


def reduction_of(case: Case, section: ReductionSection, comm: Any, modes: int | None = None) -> Reduction:
    """The reduction that a section asks for; the same whenever and on whatever ranks it is made. Collective."""
    from ..model.reduction import reduce

    chosen = {"modes": section.modes, "highest_hz": section.up_to_hz} if modes is None else {"modes": modes}
    return reduce(case.M, case.K, case.C, keep=np.array(case.keep), comm=comm, **chosen)


def _on(case: Case, reduction: Reduction) -> Case:
    """Matrices, contacts and loads in the reduced coordinates."""
    component_modes = reduction.size - len(case.keep)
    names = [case.dofs[k] for k in case.keep] + [f"component_{k + 1}" for k in range(component_modes)]
    padding = sp.csr_matrix
    contacts = [
        replace(c, rows=sp.hstack([c.rows[:, case.keep], padding((c.rows.shape[0], component_modes))]).tocsr())
        for c in case.contacts
    ]
    return replace(
        case,
        dofs=names,
        M=sp.csr_matrix(reduction.M),
        K=sp.csr_matrix(reduction.K),
        C=None if reduction.C is None else sp.csr_matrix(reduction.C),
        contacts=contacts,
        loads={name: reduction.project(load) for name, load in case.loads.items()},
    )


def _report(case: Case, small: Case, component_hz: Any, wall: float, comm: Any) -> ReductionReport:
    began = time.perf_counter()
    assert case.reduction is not None
    count = min(case.reduction.compare, len(small.dofs))
    full, reduced = ([], []) if not count else (_stuck_hz(which, count, comm) for which in (case, small))
    return ReductionReport(
        unreduced=len(case.dofs),
        kept=len(case.keep),
        component_modes=len(small.dofs) - len(case.keep),
        highest_component_hz=float(component_hz[-1]) if len(component_hz) else 0.0,
        full_hz=full,
        reduced_hz=reduced,
        relative=[r / f - 1 if f else 0.0 for f, r in zip(full, reduced)],
        wall_s=round(wall, 3),
        compare_wall_s=round(time.perf_counter() - began, 3),
    )


def _stuck_hz(case: Case, count: int, comm: Any) -> list[float]:
    from ..model.modes import linear_modes
    from .build import build_model

    plain = replace(case, C=None, damping=(0.0, 0.0), contacts=closed_contacts(case.contacts))
    with build_model(plain, (), comm) as model:
        return [float(mode.frequency_hz) for mode in linear_modes(model, count, "stuck")]
