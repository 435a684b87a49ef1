"""A case of one sector on the whole wheel: sector after sector, tuned, or with stiffness deviations of each."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Optional

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from .contacts import ContactSpec
from .schema import MistuningSection

if TYPE_CHECKING:
    from .analysis import AnalysisSection
    from .load import Case

Array = npt.NDArray[np.float64]

#: Iterations before GMRES restarts on a tuned wheel.
FIRST_RESTART = 100
#: A mistuned wheel of fewer coefficients is solved directly.
DIRECT_UNKNOWNS = 2000


@dataclass(frozen=True)
class Wheel:
    """What a case on a wheel was made from.

    Attributes
    ----------
    sector : Case
        The tuned sector.
    sectors : int
        N.
    deviations : (N,), optional
        Relative stiffness deviations; None for a tuned wheel.
    """

    sector: Case
    sectors: int
    deviations: Optional[Array] = None

    @property
    def unit(self) -> int:
        """Dofs of a sector."""
        return len(self.sector.dofs)

    def dof(self, name: str, sector: int) -> int:
        """Index of a sector's dof in the wheel."""
        return sector * self.unit + self.sector.dofs.index(name)

    def by_sector(self, values: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """Values (N n_dof, ...) of all dofs as (N, n_dof, ...)."""
        return values.reshape(self.sectors, self.unit, *values.shape[1:])


def on_wheel(case: Case, analysis: AnalysisSection) -> Case:
    """The case as an analysis takes it: the sector (or structure) itself, or with `wheel = true` all sectors.

    Dofs are numbered sector by sector and named `tip@0`, `tip@1`, ...; names in the case file are those of a sector.
    """
    section = analysis.harmonic()
    if case.neighbours is None or section is None or not section.wheel:
        return case
    from ..cyclic.sector import around

    neighbours, n = case.neighbours, case.neighbours.sectors
    C = neighbours.with_own("C", case.C) if case.C is not None else None
    deviations = None if section.mistuning is None else deviations_of(section.mistuning, n)
    K = around(neighbours.with_own("K", case.K), n)
    if section.mistuning is not None and deviations is not None:
        K = sp.csr_matrix(K + stiffness_change(neighbours, section.mistuning.of, deviations))
    return replace(
        case,
        dofs=[f"{name}@{j}" for j in range(n) for name in case.dofs],
        M=around(neighbours.with_own("M", case.M), n),
        K=K,
        C=None if C is None else around(C, n),
        contacts=[_around(contact, neighbours.rows(contact), n) for contact in case.contacts],
        loads={name: np.tile(load, n) for name, load in case.loads.items()},
        built=None,
        neighbours=None,
        wheel=Wheel(case, n, deviations),
    )


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
        direct = len(case.dofs) * (2 * section.harmonics + 1) <= DIRECT_UNKNOWNS
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
    """Relative stiffness deviations (N,): those given, or normally distributed ones (PCG64) less their mean.

    Without its mean a pattern leaves the family's mean frequency, to first order, where it was.
    """
    if mistuning.deviations is not None:
        return np.array(mistuning.deviations)
    drawn = np.random.Generator(np.random.PCG64(mistuning.seed)).standard_normal(sectors)
    return np.asarray(mistuning.standard_deviation * (drawn - drawn.mean()))


def stiffness_change(neighbours: Any, of: str, deviations: Array) -> sp.csr_matrix:
    """What deviations delta_j of a part of K add to the wheel's: sum_j delta_j T_j^T K_part T_j.

    T_j gives the dofs of sector j, both faces among them, from those of the wheel: a part that reaches a face is
    shared with the next sector.
    """
    from ..cyclic.sector import around

    ties = around(neighbours.ties, neighbours.sectors)
    return sp.csr_matrix(ties.T @ sp.kron(sp.diags(deviations), neighbours.parts[of]) @ ties)


def _around(contact: ContactSpec, rows: Any, sectors: int) -> ContactSpec:
    """The pairs of all sectors."""
    from ..cyclic.sector import around

    parameters = {
        key: np.tile(value, sectors) if np.size(value) > 1 else value for key, value in contact.parameters.items()
    }
    return replace(contact, rows=around(rows, sectors), parameters=parameters, pairs=[])
