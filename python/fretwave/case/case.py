"""A case that passed every check: a structure, the tables beside it, and analyses."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..arrays import Array
from ..model.contact import Contact
from ..model.sectors import Sparse
from ..model.structure import SPIN, Structure
from ..model.wheel_matrix import Matrix
from ..texts import readable, toml
from ..units import UnitSystem
from .analysis import Analyses, AnalysisSection
from .analysis_tables import Damper
from .at_speed import omega_squared
from .damping import around_wheel, damping_by_mode
from .gauges import Gauges
from .reduction_report import ReductionReport
from .schema import AerodynamicsSection, DampingSection, MaterialSection, PreloadSection, ReductionSection, StudySection
from .toml.source import Source
from .uncertainty import Uncertainty

if TYPE_CHECKING:
    from ..cyclic.reduction import SectorReduction
    from ..model.reduction import Reduction


@dataclass(frozen=True)
class Tables:
    """The tables of a case beside its model and its analyses; None where it has none.

    Attributes
    ----------
    reduction : how to reduce
    preload : the static state of all analyses without one of their own
    damping : loss mode by mode
    aerodynamics : forces of the flow on a sector's blades
    study : what ``fretwave study`` sweeps
    gauges : what ``fretwave stress`` reads; no result depends on it
    """

    reduction: ReductionSection | None = None
    preload: PreloadSection | None = None
    damping: DampingSection | None = None
    aerodynamics: AerodynamicsSection | None = None
    study: StudySection = field(default_factory=StudySection)
    gauges: Gauges = field(default_factory=lambda: Gauges(MaterialSection()))


@dataclass
class Case:
    """A case that passed every check.

    Attributes
    ----------
    source : Source
        The case file and its text as read.
    structure : Structure
        Matrices, names of dofs, loads, and the pairs of the contacts; of a sector tied to the next ones.
    contacts : list of Contact
        On the dofs of the structure.
    tables : Tables
    analyses : Analyses
        Validated analyses by name, in the order of the file.
    resolved : dict
        Every value that decides the results, defaults included, by its address (``mode.harmonics``).
    notes : list of str
        What a user should know although nothing is wrong.
    keep : list of int
        Dofs that a reduction keeps; of a sector with both its faces.
    reduced : ReductionReport
        What a reduction did; None for the model as given.
    unreduced : Structure
        Before the reduction, where its error is asked for.
    basis : Reduction or SectorReduction
        Of the reduction, if it was kept (`fretwave.case.reduce.reduce_case`); to be destroyed.
    sector : Case
        Of a case put on its whole wheel (`fretwave.case.wheel.on_wheel`), that of the tuned sector.
    uncertainty : Uncertainty
        What is drawn; None without ``[uncertainty]``.
    """

    source: Source
    structure: Structure
    contacts: list[Contact]
    analyses: Analyses
    resolved: dict[str, Any]
    tables: Tables = field(default_factory=Tables)
    notes: list[str] = field(default_factory=list)
    keep: list[int] = field(default_factory=list)
    reduced: ReductionReport | None = None
    unreduced: Structure | None = None
    basis: Reduction | SectorReduction | None = None
    sector: Case | None = None
    uncertainty: Uncertainty | None = None

    @property
    def path(self) -> Path:
        """The case file."""
        return self.source.path

    @property
    def text(self) -> str:
        """Of the case file, as read."""
        return self.source.text

    @property
    def title(self) -> str:
        """What the case file calls itself."""
        return str(self.source.data.get("title", ""))

    @property
    def has_quick(self) -> bool:
        """The case has a short form."""
        return "quick" in self.source.data

    @property
    def dofs(self) -> list[str]:
        """Names of the dofs, in the order of the matrices."""
        return self.structure.dof_names

    @property
    def M(self) -> Matrix:
        """(n_dof, n_dof) [mass], of a sector its own part."""
        return self.structure.matrix("M")

    @property
    def K(self) -> Sparse:
        """(n_dof, n_dof) [force/length], of a sector its own part."""
        return self.structure.own("K")

    @property
    def C(self) -> Sparse | None:
        """(n_dof, n_dof) [force s/length] as it is given, of a sector its own part; None where it is not."""
        return self.structure.own("C")

    @property
    def loads(self) -> Mapping[str, Array]:
        """Static loads (n_dof,) [force] by name."""
        return self.structure.loads

    @property
    def units(self) -> UnitSystem:
        """The system that all its numbers are in."""
        return self.structure.unit_system

    @property
    def neighbours(self) -> Structure | None:
        """The structure where it is one sector of a wheel, tied to the next ones."""
        return self.structure if self.structure.sectors and not self.structure.whole else None

    @property
    def wheel(self) -> Structure | None:
        """The structure where it is a whole wheel."""
        return self.structure if self.structure.whole else None

    @property
    def speed_rpm(self) -> float:
        """Speed at which the model turns [rev/min]."""
        return float(self.resolved.get("model.speed_rpm", 0.0))

    @property
    def reduction(self) -> ReductionSection | None:
        """How to reduce; None for not at all."""
        return self.tables.reduction

    @property
    def aerodynamics(self) -> AerodynamicsSection | None:
        """Forces of the flow on a sector's blades; None for none."""
        return self.tables.aerodynamics

    @property
    def study(self) -> StudySection:
        """What ``fretwave study`` sweeps."""
        return self.tables.study

    @property
    def name(self) -> str:
        """Name of the case: that of its folder, or of the file if it is not ``case.toml``."""
        return readable(self.path.resolve().parent.name if self.path.stem == "case" else self.path.stem)

    @property
    def digest(self) -> str:
        """Hash of everything that decides the results."""
        return hashlib.sha256(json.dumps(self.resolved, sort_keys=True).encode()).hexdigest()

    def dof(self, name: str, sector: int = 0) -> int:
        """Index of a dof; on a wheel the case's names are those of a sector's dofs."""
        return self.structure.dof(name, sector)

    def places(self, name: str) -> list[int]:
        """Indices of a dof in all sectors of a wheel; of a structure or of one sector that of `dof` alone."""
        return self.structure.places(name)

    @cached_property
    def modal_damping(self) -> Mapping[int, Matrix]:
        """What ``[damping]`` adds to C, of a wheel from its tuned sector; computed once."""
        if self.tables.damping is None:
            return {}
        if self.sector is not None:
            return around_wheel(self.sector.modal_damping, self.structure.sectors)
        where = self.source.where(("damping",))
        return damping_by_mode(self.tables.damping, self.structure, self.contacts, where)

    def damped(self, dampers: Sequence[Damper]) -> Structure:
        """The structure with its shares of K and M, its damping by mode and viscous dampers to ground in C."""
        places = [(place, damper.c) for damper in dampers for place in self.places(damper.dof)]
        damped = self.structure.damped(places)
        if not self.modal_damping:
            return damped
        from ..cyclic.aerodynamics import with_terms

        return replace(damped, C=with_terms(damped.C, self.modal_damping))

    def turns_at(self, part: str) -> float:
        """Speed [rev/min] whose share of a part of the stiffness K has already."""
        return self.speed_rpm if part == SPIN else 0.0

    def turning(self, part: str, speed_rpm: float) -> Case:
        """The same at another speed [rev/min], where a part of the stiffness grows with its square."""
        own = self.turns_at(part)
        return replace(self, structure=self.structure.stiffened(part, omega_squared(speed_rpm) - omega_squared(own)))

    def damping_with(self, dampers: Sequence[Damper]) -> Sparse | None:
        """C of `damped`, of a sector its own part; None when there is no damping at all."""
        return self.damped(dampers).own("C")

    def preload_of(self, analysis: AnalysisSection) -> PreloadSection | None:
        """The preload of an analysis: its own, or that of the case."""
        return analysis.settings(self).own_preload() or self.tables.preload

    @property
    def acting_loads(self) -> list[str]:
        """Names of the static loads that act in some analysis."""
        preloads = [self.preload_of(analysis) for analysis in self.analyses.values()]
        return list(dict.fromkeys(name for preload in preloads if preload is not None for name in preload.loads))


def changed_keys(then: Mapping[str, Any], now: Mapping[str, Any]) -> list[str]:
    """``key: then -> now`` for every value that differs between two resolved cases."""
    lines = []
    for key in [*now, *(key for key in then if key not in now)]:
        before, after = then.get(key), now.get(key)
        if before != after:
            shown = [toml(value) if value is not None else "(absent)" for value in (before, after)]
            lines.append(f"{key}: {shown[0]} then, {shown[1]} now")
    return lines
