"""A model of the core from a case."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from ..model.contact import Contact
from ..model.law_info import Role
from .analysis_tables import Damper
from .flow import with_flow
from .harmonic import nodal_diameter, with_flow_forces
from .schema import PreloadSection

if TYPE_CHECKING:
    from mpi4py import MPI

    from ..model.model import Model
    from .analysis import AnalysisSection
    from .load import Case


def build_model(
    case: Case,
    dampers: Sequence[Damper],
    comm: MPI.Comm,
    preload: PreloadSection | None = None,
    nodal_diameter: int = 0,
    aerodynamics: bool = False,
) -> Model:
    """``fretwave.Model`` of a case; a preload without pair loads sets the pairs' normal loads to zero. Collective.

    Parameters
    ----------
    nodal_diameter : of the wave, where the case is a sector of a wheel (that of `on_wheel` has all of them)
    aerodynamics : the forces of the flow act
    """
    contacts = [replace(contact, parameters=acting_parameters(contact, preload)) for contact in case.contacts]
    structure = case.damped(dampers)
    if aerodynamics:
        K, C = with_flow(case, structure.K, structure.C, nodal_diameter)
        structure = replace(structure, K=K, C=C)
    return structure.model(contacts, comm, nodal_diameter)


def model_of(case: Case, analysis: AnalysisSection, comm: MPI.Comm) -> Model:
    """``fretwave.Model`` of a case as an analysis takes it: its dampers, preload, wave and flow. Collective."""
    settings = analysis.settings(case)
    wave, flow = nodal_diameter(settings), with_flow_forces(settings)
    return build_model(case, analysis.acting_dampers(case), comm, case.preload_of(analysis), wave, flow)


def acting_parameters(contact: Contact, preload: PreloadSection | None) -> dict[str, Any]:
    """Parameters of a contact's law under a preload, which may take the place of the pairs' own loads."""
    replaced = preload is not None and not preload.pair_loads
    return {**contact.parameters, **(contact.info.with_roles({Role.LOAD: 0.0}) if replaced else {})}
