"""The reduction that a case asks for: which dofs are kept, the reduced case, and its error."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from ..model.sectors import by_sector
from ..model.structure import Structure
from .component_modes import Choice, choice_of
from .contacts import on
from .reduction_report import report_of

if TYPE_CHECKING:
    from mpi4py import MPI
    from petsc4py import PETSc

    from ..cyclic.reduction import SectorReduction
    from ..hb.nonlinear_mode import NonlinearMode
    from ..hb.reduction_error import NonlinearError
    from ..model.reduction import Reduction
    from .analysis import AnalysisSection
    from .load import Case


#: Dofs of a structure up to which every rank reduces it alone: many are not quicker, and each number of them rounds
#: K_r otherwise, of which a first bending may be 1e-8 (frequency of a lap joint: 1e-10 apart, its phase 6e-7).
ALONE = 5000
#: Modes of all ranks up to which a reduction is kept, with its matrices [bytes]; a larger one is made again.
KEPT = 256e6


def kept_dofs(structure: Structure, analyses: Mapping[int, AnalysisSection]) -> list[int]:
    """Numbers of the dofs that a reduction keeps: of contacts, and those named by the model or an analysis."""
    asked = {name for analysis in analyses.values() for name in analysis.kept_dofs()}
    numbers = {k for k, name in enumerate(structure.dof_names) if name in asked}
    return sorted(numbers.union(structure.kept.tolist()))


def reduce_case(
    case: Case,
    comm: MPI.Comm,
    modes: int | None = None,
    look: Callable[[Reduction | SectorReduction], None] | None = None,
    keep: bool = False,
    only: Sequence[str] | None = None,
) -> Case:
    """The case on its reduced matrices, itself when it asks for no reduction. Collective.

    Parameters
    ----------
    modes : int, optional
        Component modes, in place of the case's.
    look : callable, optional
        Gets the reduction while it lives. Collective.
    keep : bool
        Whether it lives on as the case's `basis` if it is small: an analysis will ask for its error.
    only : sequence of str, optional
        Analyses that run, where not all do: at the speeds of others no error is stated. A number of component modes
        that is to be chosen takes all into account, so that it is the same whichever run.
    """
    if case.reduction is None:
        return case
    choice = None if modes is not None else choice_of(case)
    names = case.analyses if only is None or choice is not None else only
    reduced = None
    while reduced is None:
        reduced, modes = _reduced(case, comm, modes, look, choice, keep, list(names))
    return replace(reduced, unreduced=case.structure if case.reduction.error_at is not None else None)


def _reduced(
    case: Case,
    comm: MPI.Comm,
    modes: int | None,
    look: Callable[[Reduction | SectorReduction], None] | None,
    choice: Choice | None,
    keep: bool,
    names: Sequence[str],
) -> tuple[Case | None, int | None]:
    """With this many component modes; or, where they are not enough, none and how many to take. Collective."""
    began = time.perf_counter()
    assert case.reduction is not None
    with ExitStack() as stack:
        reduction = reduction_of(case, comm, modes)
        stack.enter_context(reduction)
        full = case.structure
        small = full.reduced(reduction) if full.cut is None else full.cut.reduced(reduction).tied()
        reduced = replace(case, structure=small, contacts=on(case.contacts, small))
        wall = time.perf_counter() - began
        known = (case, reduced, reduction, wall, comm, {} if choice is None else choice.full_hz, names)
        report = report_of(*known, case.reduction.compare if choice is None else choice.compare)
        if choice is not None:
            while choice.looks_further(report):
                report = report_of(*known, choice.compare)
            more = choice.next(report)
            if more is not None:
                return None, more
            report = replace(report, chosen=choice.line())
        if look is not None:
            look(reduction)
        n_dof = (full.cut or full).n_dof
        if keep and 8 * n_dof * reduction.size * (comm.size if n_dof <= ALONE else 1) <= KEPT:
            stack.pop_all()
            reduced = replace(reduced, basis=reduction)
    return replace(reduced, reduced=report), modes


def nonlinear_error_at(case: Case, analysis: AnalysisSection, problem: NonlinearMode, y: PETSc.Vec) -> NonlinearError:
    """Estimate of what the unreduced model would change at a point of a mode. Collective.

    Of a sector in a wave as of a structure; a reduction that was not kept is made again.
    """
    from ..cyclic.reduction_error import sector_nonlinear_error
    from ..hb.reduction_error import nonlinear_error

    assert case.unreduced is not None and case.reduced is not None
    full = replace(case, structure=case.unreduced, contacts=on(case.contacts, case.unreduced))
    preload = full.preload_of(analysis)
    given = [full.loads[name] for name in preload.loads] if preload is not None else []
    load = np.sum(given, axis=0) if given else None
    damped = full.damped(analysis.dampers)
    with ExitStack() as stack:
        reduction = case.basis or reduction_of(full, problem.model.comm, case.reduced.component_modes)
        if case.basis is None:
            stack.enter_context(reduction)
        if full.neighbours is None:
            return nonlinear_error(cast("Reduction", reduction), problem, y, load, damped.own("C"))
        terms = (by_sector(damped.K), by_sector(damped.C), by_sector(damped.M))
        return sector_nonlinear_error(cast("SectorReduction", reduction), terms, problem, y, load)


def reduction_of(case: Case, comm: MPI.Comm, modes: int | None = None) -> Reduction | SectorReduction:
    """The reduction that a case asks for; the same whenever and on whatever ranks it is made. Collective.

    Parameters
    ----------
    modes : int, optional
        Component modes, in place of the case's.
    """
    from mpi4py import MPI

    from ..cyclic.reduction import reduce_sector
    from ..model.reduction import reduce

    section, cut = case.reduction, case.structure.cut
    assert section is not None
    chosen: dict[str, Any] = (
        {"modes": section.modes, "highest_hz": section.up_to_hz} if modes is None else {"modes": modes}
    )
    if cut is None or cut.low is None or cut.high is None:
        full = case.structure
        ranks = MPI.COMM_SELF if full.n_dof <= ALONE else comm
        return reduce(full.M, full.K, full.C, keep=np.array(case.keep), comm=ranks, **chosen)
    return reduce_sector(
        cut.M,
        cut.K,
        cut.low,
        cut.high,
        cut.sectors,
        cut.C,
        contacts=on(case.contacts, cut),
        keep=np.array(case.keep, dtype=np.intp),
        axis=None if cut.expansion is not None else cut.axis,
        interface_diameters=section.interface_diameters if section.interface == "modes" else None,
        interface_waves=section.interface_waves,
        interface_tolerance=section.interface_tolerance,
        comm=comm,
        **chosen,
    )
