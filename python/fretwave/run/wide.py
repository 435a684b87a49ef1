"""PETSc options of a whole run: which of its analyses they are for, tried as far as they can be before it."""

from __future__ import annotations

from collections.abc import Container, Sequence

from ..case.load import Case
from ..mpi.petsc_options import AnalysisOptions
from ..mpi.petsc_share import RunWide, choosing, kind_of, prefix_of
from ..mpi.petsc_values import parse


def run_wide(case: Case, names: Sequence[str], petsc: str = "", read: Container[str] = ()) -> RunWide:
    """Those given for all analyses of a run, and which of the case's analyses (`names`) run."""
    pairs, known = parse(petsc), [prefix_of(name) for name in case.analyses]
    running = {prefix_of(name): case.analyses[name] for name in names}
    own = {prefix: choosing(pairs, parse(one.petsc), prefix, known) for prefix, one in running.items()}
    kinds = {prefix: kind_of(one) for prefix, one in running.items()}
    return RunWide(pairs, kinds, [prefix for prefix in known if prefix not in running], own, read)


def check_in_time(case: Case, names: Sequence[str], wide: RunWide) -> None:
    """Names of options of time integrations, before anything is solved. Collective.

    Raises
    ------
    InputError
        A time integration of one of the analyses reads no such option.
    """
    for analysis in (case.analyses[name] for name in names):
        if analysis.integrates():
            options = AnalysisOptions(prefix_of(analysis.name), [analysis.petsc], wide)
            options.check_in_time(f"analysis '{analysis.name}'", analysis.integrates() == "type")
