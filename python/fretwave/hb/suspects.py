"""Contact parameters that may be why a solver stopped: what looks alike from inside is told apart by its numbers."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Array
from ..model.law_info import Role
from ..units import UnitSystem

if TYPE_CHECKING:
    from petsc4py import PETSc

    from ..model.contact import Contact
    from ..model.model import Model
    from .harmonic_problem import HarmonicProblem


#: What a reason begins with where no step led on.
TOO_SMALL = "step too small"
#: What a reason says where nothing holds a body, as `src/hb/mean_position.cpp` words it.
FREE = "mean position is free"
#: Ends of a branch that has left what it was asked for, as `src/solve` words them.
RETURNS = re.compile("comes back to|back onto itself|a closed loop")
#: What is said of a mode that loses no energy.
LEADS_OVER = "the motion loses no energy: a mode without damping leads over into another one at internal resonances"
#: What is said where rounding is no small part of the forces.
HIDES = "rounding beside the stiffest springs hides"
#: What is said of a law that gave infinity or nan.
NO_NUMBER = "gave no number"
#: And what helps.
NUMBER = "a law that gives a number at any motion, or a range in which the motion stays where it does"
#: Share of the forces that rounding leaves in them, above which steps may find no way on.
HIDDEN = 3e-8
#: Contact stiffness over the structure's from which a pair that opens, sticks or slips changes all forces.
STIFF = 1e4
#: Contact stiffness over the structure's below which it holds nothing.
SOFT = 1e-6
#: Net force of the pairs' own loads over the largest of them, above which they are no balanced set.
UNBALANCED = 0.1
#: Work of a pair that slips, over the ranges of its motion and force, below which its slip is about to vanish.
VANISHING = 1e-5


def suspects(contacts: Sequence[Contact], stiffness: float | None, units: UnitSystem) -> str:
    """What is extreme in the contacts' parameters, contact by contact, or nothing.

    Parameters
    ----------
    contacts : contacts of the model
    stiffness : of the structure [force/length], None where it is not known
    units : that they are in
    """
    return "".join(f"; contact '{c.name}' {words}" for c in contacts for words in _extremes(c, stiffness, units))


def vanishing(problem: HarmonicProblem, y: PETSc.Vec) -> str:
    """Contacts with a pair that hardly slips any more at y, where a branch stopped, or nothing. Collective.

    The place about which a slider moves to and fro is told by its slip alone: by ever fewer digits as that vanishes,
    and by where it stood at rest once nothing slips (`src/hb/slider_period.h`).
    """
    told, comm = problem.contact_history(y), problem.model.comm
    names = _hardly_slipping(problem.model.contacts, told) if comm.rank == 0 else []
    return "".join(
        f"; the slip of a pair of contact '{name}' vanishes here, which alone tells where its slider stands"
        for name in comm.bcast(names)
    )


def hidden(problem: HarmonicProblem, y: PETSc.Vec) -> str:
    """How much of the forces rounding hides at y, where a branch stopped, or nothing where that is little. Collective.

    Springs far stiffer than what moves, which join two dofs, leave eps times their force on each of them.
    """
    share = problem.core.rounding(y)
    return f"; {HIDES} {share:.0e} of the forces here" if share > HIDDEN else ""


def numberless(model: Model) -> str:
    """Contacts whose law, one of the user's own, gave no number at a motion that was tried, or nothing. Collective."""
    told = model.without_numbers()
    return "".join(f"; the law of contact '{name}' {NO_NUMBER} at {at}" for name, at in told.items())


def lossless(problem: HarmonicProblem, y: PETSc.Vec) -> str:
    """That a mode loses no energy at y, where its branch turned back, or nothing. Collective.

    Its branch goes along each internal resonance that it meets to a motion of the other mode alone, and ends there.
    """
    return "" if problem.core.damped(y) else f"; {LEADS_OVER}"


def _hardly_slipping(contacts: Sequence[Contact], told: Sequence[dict[str, Any]]) -> list[str]:
    """Names; `told` as of :meth:`HarmonicProblem.contact_history`."""
    names = []
    for contact, one in zip(contacts, told):
        reach = (np.ptp(one["u"], axis=0) * np.ptp(one["f"], axis=0)).sum(axis=0)
        slips = (one["shares"][1] > 0) & (_friction(contact) > 0)
        if contact.info.memory and np.any(slips & (np.abs(one["work"]) < VANISHING * reach)):
            names.append(contact.name)
    return names


def _friction(contact: Contact) -> Array:
    """What bounds the tangential force of each pair, or of all: a coefficient or a limit; inf where nothing does."""
    values = [contact.value(role) for role in (Role.FRICTION_COEFFICIENT, Role.FRICTION_LIMIT)]
    return np.atleast_1d(next((value for value in values if value is not None), np.inf))


def _extremes(contact: Contact, stiffness: float | None, units: UnitSystem) -> Iterator[str]:
    given = {role: np.atleast_1d(np.asarray(value, dtype=float)) for role, value in _values(contact)}
    if not np.any(_friction(contact)):
        yield "has no friction: nothing holds the structure along it"
    if Role.LOAD in given:
        name, gap = str(contact.info.named(Role.LOAD)), given.get(Role.GAP, np.zeros(1))
        yield from _loads(name, given[Role.LOAD], gap, units("force"))
    for role in (Role.NORMAL_STIFFNESS, Role.TANGENTIAL_STIFFNESS):
        if role in given and stiffness is not None:
            yield from _stiffness(str(contact.info.named(role)), given[role], stiffness, units("force/length"))


def _values(contact: Contact) -> Iterator[tuple[Role, Any]]:
    """Of the parameters with a role, those that have a value."""
    for parameter in contact.info.parameters:
        value = contact.value(parameter.role)
        if parameter.role != Role.NONE and value is not None:
            yield parameter.role, value


def _loads(name: str, load: Array, gap: Array, unit: str) -> Iterator[str]:
    if not np.any(load) and np.all(gap >= 0):
        yield f"has no {name} of its own: only an outer load presses its pairs, and none sticks without"
    elif np.ptp(load) > UNBALANCED * np.max(load):
        yield (
            f"has normal loads from {np.min(load):.3g} to {np.max(load):.3g} {unit}: given pair by pair they are taken"
            " as balanced, whatever their resultant"
        )


def _stiffness(name: str, values: Array, stiffness: float, unit: str) -> Iterator[str]:
    ratio = values / stiffness
    if np.max(ratio) > STIFF:
        yield (
            f"has {name} {np.max(values):.3g} {unit}, {np.max(ratio):.1g} times the structure's {stiffness:.2g}: a"
            " pair that opens, sticks or slips changes all forces; a softer contact helps"
        )
    if np.min(ratio) < SOFT:
        yield (
            f"has {name} {np.min(values):.3g} {unit}, {np.min(ratio):.1g} times the structure's {stiffness:.2g}: it"
            " holds nothing"
        )
