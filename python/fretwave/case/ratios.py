"""Numbers of a case that are allowed and look wrong beside each other: contact and structure, amplitude and size."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg

from ..arrays import Array
from ..errors import InputError
from ..hb.suspects import STIFF
from ..model.contact import span
from ..model.law_info import Role
from ..model.sectors import by_sector
from .odd_material import odd_material

if TYPE_CHECKING:
    from ..model.contact import Contact
    from .analysis import AnalysisSection
    from .case import Case

#: Contact stiffness over the structure's below which its pairs hold nothing.
SOFT = 1e-4
#: Dofs and rows up to which it is looked at what pairs bear of a force, by a factor of K.
FEW = 20_000, 500
#: Of these rows at a time: the first of them often tell.
AT_ONCE = 20
#: Largest amplitude over the model's size: linear elasticity and contact of fixed pairs end before.
LARGE = 0.1
#: Of dry metals 0.1 to 1.5.
LARGEST_FRICTION = 2.0


def odd_ratios(case: Case) -> list[InputError]:
    """Warnings about a case without errors, before it is reduced."""
    found = [warning for contact in case.contacts for warning in _of_contact(case, contact)]
    for analysis in case.analyses.values():
        found += [*_of_amplitude(case, analysis), *_of_deviations(analysis)]
    return found + list(odd_material(case.tables.gauges.material, case.source, case.structure))


def own_stiffness(case: Case, contact: Contact) -> Array:
    """Stiffness (n_pairs, components) [force/length] of the structure along each row of B, all other dofs held.

    1 / sum b_i^2 / K_ii, with K of the structure without contact; nan where it has none.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        softness = 1 / np.asarray(case.K.diagonal())
        total = sum(sp.csr_matrix(B).power(2) @ softness for B in by_sector(contact.B).values())
        stiffness = 1 / np.asarray(total)
    stiffness[~np.isfinite(stiffness) | (stiffness <= 0)] = np.nan
    return stiffness.reshape(-1, contact.components)


def borne(K: sp.spmatrix, B: sp.spmatrix, stiffness: Array) -> float:
    """Largest share of the stiffness of any motion that springs k along rows of B can be, at most.

    That is the largest eigenvalue of (K + B^T k B)^-1 B^T k B, below its trace sum k_i b_i^T (K + B^T k B)^-1 b_i; 1
    where nothing else holds K. Summed up to `SOFT`: no term is negative.
    """
    held = sp.csc_matrix(K + B.T @ sp.diags(stiffness) @ B)
    try:
        factor = scipy.sparse.linalg.splu(held, "MMD_AT_PLUS_A", 0.0, options={"SymmetricMode": True})
    except RuntimeError:  # singular
        return 1.0
    total = 0.0
    for first in range(0, len(stiffness), AT_ONCE):
        rows = B[first : first + AT_ONCE].toarray()
        total += float(stiffness[first : first + AT_ONCE] @ np.einsum("ij,ji->i", rows, factor.solve(rows.T)))
        if total > SOFT:
            break
    return total


def _of_contact(case: Case, contact: Contact) -> Iterator[InputError]:
    own = own_stiffness(case, contact)
    for row in range(min(contact.components, 2)):  # both tangents have one stiffness
        yield from _of_stiffness(case, contact, contact.info.stiffness_along(row), own[:, row])
    friction = contact.value(Role.FRICTION_COEFFICIENT)
    if friction is not None and np.max(friction) > LARGEST_FRICTION:
        yield InputError(
            f"contact '{contact.name}' has an unusual coefficient of friction",
            _key(contact, Role.FRICTION_COEFFICIENT),
            span(friction),
            f"at most {LARGEST_FRICTION:g}; of dry metals 0.1 to 1.5",
            "look whether it is in percent, or an angle in degrees",
        )
    if friction is not None and not np.any(friction):
        yield InputError(
            f"no pair of contact '{contact.name}' has friction: none sticks, and nothing damps",
            _key(contact, Role.FRICTION_COEFFICIENT),
            "0 in every pair",
            "> 0 in some pair",
            'give it a value; `type = "linear"` has the modes that slide without friction',
        )
    yield from _of_loads(case, contact)


def _key(contact: Contact, role: Role) -> str:
    return f"contact.{contact.name}.{contact.info.named(role)}"


def _of_stiffness(case: Case, contact: Contact, role: Role, own: Array) -> Iterator[InputError]:
    given = contact.value(role)
    ratio = np.full(1, np.nan) if given is None else given / own
    if np.all(np.isnan(ratio)):
        return
    for extreme, beyond, word, fix in (
        (np.nanargmax, np.nanmax(ratio) > STIFF, "stiffer", "a softer contact, which solvers bear better"),
        (np.nanargmin, np.nanmin(ratio) < SOFT, "softer", "a stiffer contact: this one holds nothing"),
    ):
        if beyond and not (word == "softer" and _holds_something(case, contact, role)):
            pair, unit = int(extreme(ratio)), case.units("force/length")
            value = float(np.broadcast_to(given, own.shape)[pair])
            yield InputError(
                f"contact '{contact.name}' is far {word} than the structure at its pairs",
                _key(contact, role),
                f"{value:.3g} {unit} at pair {pair}, {ratio[pair]:.1g} times the structure's own {own[pair]:.3g}",
                f"{SOFT:g} to {STIFF:g} times",
                f"look at its units; else {fix}",
            )


def _holds_something(case: Case, contact: Contact, role: Role) -> bool:
    """Whether a contact that is far softer than its nodes is not so beside the structure: a beam's tip is soft too."""
    rows = [k for k in range(contact.components) if contact.info.stiffness_along(k) == role]
    B = sp.csr_matrix(by_sector(contact.B)[0])
    n_pairs = B.shape[0] // contact.components
    along = B[np.add.outer(contact.components * np.arange(n_pairs), rows).ravel()]
    if case.K.shape[0] > FEW[0] or along.shape[0] > FEW[1]:
        return False
    given = np.broadcast_to(contact.value(role), n_pairs)
    return borne(case.K, along, np.repeat(given, len(rows))) > SOFT


def _of_loads(case: Case, contact: Contact) -> Iterator[InputError]:
    """Pairs without load never stick: a limit of 0, or no load, no interference and no static load of the model."""
    limit, load, gap = (contact.value(role) for role in (Role.FRICTION_LIMIT, Role.LOAD, Role.GAP))
    sections = [case.preload_of(analysis) for analysis in case.analyses.values()]
    pressed = any(section is not None and section.loads for section in sections)
    unloaded = load is not None and not np.any(load) and (gap is None or np.min(gap) >= 0) and not pressed
    if unloaded or (limit is not None and not np.any(limit)):
        role = Role.LOAD if unloaded else Role.FRICTION_LIMIT
        still = [f"{key} = 0" for key, value in case.resolved.items() if "speed" in key and value == 0]
        yield InputError(
            f"no pair of contact '{contact.name}' is loaded: none sticks, and friction does no work",
            _key(contact, role),
            " at ".join(["0 in every pair", *still]),
            "> 0 in some pair" + (", a gap < 0, or static loads in [preload]" if unloaded else ""),
            "give a speed above 0" if still else f"give {contact.info.named(role)} a value",
        )


def _of_amplitude(case: Case, analysis: AnalysisSection) -> Iterator[InputError]:
    largest, size = analysis.largest_amplitude(), model_size(case)
    if largest is not None and size and largest > LARGE * size:
        unit = case.units("length")
        yield InputError(
            f"'{analysis.name}' goes to amplitudes of the model's own size",
            f"{analysis.name}.amplitude",
            f"{largest:g} {unit}, {largest / size:.2g} of the model's {size:.3g} {unit}",
            f"at most {LARGE:g} of it",
            "look at the units of both; else end the branch before",
        )


def _of_deviations(analysis: AnalysisSection) -> Iterator[InputError]:
    """Ratios of stiffness in place of what they are above 1: all of them lie about 1."""
    mistuning = analysis.whole_wheel()[1]
    given = mistuning.deviations if mistuning is not None else None
    if isinstance(given, list) and min(given) > 0.5:
        yield InputError(
            f"the stiffness deviations of '{analysis.name}' look like ratios",
            f"{analysis.name}.mistuning.deviations",
            f"{min(given):g} to {max(given):g}: each sector's stiffness is multiplied by {1 + min(given):g} or more",
            "numbers about 0: 0.02 for 2 % more than the tuned sector",
            "take 1 off each",
        )


def model_size(case: Case) -> float:
    """Diagonal [length] of the box around all nodes; 0 where the model has no places."""
    nodes = case.structure.coordinates
    return 0.0 if nodes is None else float(np.linalg.norm(np.ptp(nodes, axis=0)))
