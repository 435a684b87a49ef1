"""A case of one sector on the whole wheel: sector after sector, tuned, or with stiffness deviations of each."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Array
from ..model.structure import WHOLE
from .analysis_tables import MistuningSection

if TYPE_CHECKING:
    from .analysis import AnalysisSection
    from .load import Case


#: Iterations before GMRES restarts on a tuned wheel.
FIRST_RESTART = 100
#: A mistuned wheel of fewer coefficients is solved directly.
DIRECT_UNKNOWNS = 2000


def on_wheel(case: Case, analysis: AnalysisSection) -> Case:
    """The case as an analysis takes it: the sector (or structure) itself, or with `wheel = true` all sectors.

    Dofs are numbered sector by sector and named `tip@0`, `tip@1`, ...; names in the case file are those of a sector.
    """
    sector, (wheel, mistuning) = case.neighbours, analysis.whole_wheel()
    if sector is None or not wheel:
        return case
    n = sector.sectors
    deviations, of = (None, WHOLE) if mistuning is None else (deviations_of(mistuning, n), mistuning.of)
    contacts = [contact.around(n) for contact in case.contacts]
    return replace(case, structure=sector.around(deviations, of), contacts=contacts, sector=case)


@contextmanager
def solver_room(case: Case, analysis: AnalysisSection, prefix: str) -> Iterator[None]:
    """How a mistuned wheel's linear systems are solved, unless PETSc options say otherwise.

    The tuned wheel's operator preconditions the mistuned one. Near a resonance it leaves the modes of a family, whose
    frequencies lie within the deviations of each other, as 2 N outliers; GMRES must find them all before it restarts.
    Small systems are cheaper to factorise.
    """
    from petsc4py import PETSc

    database: Any = PETSc.Options(prefix)
    wanted: dict[str, Any] = {}
    section = analysis.harmonic()
    if case.wheel is not None and case.wheel.deviations is not None and section is not None:
        direct = case.wheel.n_dof * (2 * section.harmonics + 1) <= DIRECT_UNKNOWNS
        room = FIRST_RESTART + 4 * case.wheel.sectors
        wanted = {"route": "direct"} if direct else {"ksp_gmres_restart": room, "ksp_max_it": 2 * room}
    added = [name for name in wanted if not database.hasName(name)]
    for name in added:
        database[name] = wanted[name]
    try:
        yield
    finally:
        for name in added:
            database.delValue(name)


def deviations_of(mistuning: MistuningSection, sectors: int) -> Array:
    """Relative stiffness deviations (N,): those given, or drawn ones."""
    if mistuning.deviations is not None:
        return np.array(mistuning.deviations, dtype=float)
    from ..cyclic.wheel_modes import deviations

    return deviations(sectors, mistuning.standard_deviation or 0.0, mistuning.seed)
