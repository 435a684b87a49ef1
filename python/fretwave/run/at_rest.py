"""States at rest of a case's analyses, solved before anything runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from ..analyses.parts.context import AnalysisContext
from ..case.analysis import AnalysisSection
from ..case.build import model_of
from ..case.load import Case
from ..case.wheel import on_wheel, solver_room
from ..console import Console
from ..errors import FretwaveError, InputError, NotConverged
from ..mpi.petsc_options import AnalysisOptions
from ..mpi.petsc_share import prefix_of

if TYPE_CHECKING:
    from mpi4py import MPI


#: Of a whole wheel that is looked at before it runs.
MOST_DOFS = 20_000


@dataclass
class AtRest:
    """What was found, by analysis; the same on every rank."""

    lines: dict[str, list[str]] = field(default_factory=dict)
    warnings: list[InputError] = field(default_factory=list)
    failures: list[FretwaveError] = field(default_factory=list)


def at_rest(case: Case, names: Sequence[str], comm: MPI.Comm) -> AtRest:
    """Solve the states at rest of some analyses of a case that is reduced already. Collective."""
    found = AtRest()
    for name in names:
        analysis = case.analyses[name]
        try:
            found.lines[name], warnings = _look(case, analysis, comm)
        except (InputError, NotConverged) as error:
            error.where = f"analysis '{name}'"
            found.failures.append(error)
            continue
        found.warnings += warnings
    return found


def _look(case: Case, analysis: AnalysisSection, comm: MPI.Comm) -> tuple[list[str], list[InputError]]:
    wheel, _ = analysis.whole_wheel()
    sectors = case.neighbours.sectors if case.neighbours is not None and wheel else 1
    if sectors > 1 and sectors * len(case.dofs) > MOST_DOFS:
        size = f"{sectors * len(case.dofs):,} dofs, more than {MOST_DOFS:,}"
        return [f"at rest: left to the run: the wheel has {size}"], []
    prefix = prefix_of(analysis.name)
    case = on_wheel(case, analysis)
    with (
        model_of(case, analysis, comm) as model,
        AnalysisOptions(prefix, [analysis.petsc]).inserted(),
        solver_room(case, analysis, prefix),
    ):
        return analysis.at_rest(AnalysisContext(model, case, analysis, comm, Path(), Console(False)))
