"""A model of the core from a case."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from ..model.laws import Role
from .contacts import ContactSpec
from .flow import with_flow
from .schema import PreloadSection

if TYPE_CHECKING:
    from .load import Case


def build_model(
    case: Case,
    dampers: Sequence[Any],
    comm: Any,
    preload: PreloadSection | None = None,
    nodal_diameter: int = 0,
    aerodynamics: bool = False,
) -> Any:
    """``fretwave.Model`` of a case; a preload without pair loads sets the pairs' normal loads to zero. Collective.

    Parameters
    ----------
    nodal_diameter : of the wave, where the case is a sector of a wheel (that of `on_wheel` has all of them)
    aerodynamics : the forces of the flow act
    """
    from ..model.model import Contact, Model

    neighbours = case.neighbours
    contacts = [
        Contact(
            contact.law,
            contact.rows if neighbours is None else neighbours.rows(contact),
            acting_parameters(contact, preload),
            name=contact.name,
        )
        for contact in case.contacts
    ]
    M, K, C = case.M, case.K, case.damping_with(dampers)
    if neighbours is None:
        K, C = with_flow(case, K, C, nodal_diameter) if aerodynamics else (K, C)
        return Model(M, K, C, contacts, comm, unit=case.wheel.unit if case.wheel else 1)
    M, K, C = neighbours.with_own("M", M), neighbours.with_own("K", K), case.ahead_damping(C)
    K, C = with_flow(case, K, C, nodal_diameter) if aerodynamics else (K, C)
    return Model(M, K, C, contacts, comm, neighbours.sectors, nodal_diameter)


def acting_parameters(contact: ContactSpec, preload: PreloadSection | None) -> dict[str, Any]:
    """Parameters of a contact's law under a preload, which may take the place of the pairs' own loads."""
    replaced = preload is not None and not preload.pair_loads
    return {**contact.parameters, **(contact.info.with_roles({Role.LOAD: 0.0}) if replaced else {})}
