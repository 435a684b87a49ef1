"""The static state that the dynamics of an analysis move about."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Optional

import numpy as np
import scipy.sparse.linalg

from ...arrays import Array
from ...case.analysis import AnalysisSection
from ...case.harmonic import (
    LEAST_HARMONICS,
    LEAST_SAMPLES,
    HarmonicSection,
    nodal_diameter,
    retained_by,
    with_flow_forces,
)
from ...case.schema import PreloadSection
from ...errors import InputError, NothingMoves
from ...model.contact import Contact
from ...model.law_info import Role
from ...model.laws import own_load
from .asymptotes import MORE_MODES, closed_stiffness, limit_model, most_like, with_friction
from .context import AnalysisContext
from .still import held_by_flow, still_model

if TYPE_CHECKING:
    from ...case.load import Case
    from ...hb.harmonics import Harmonics
    from ...model.model import Model
    from ...model.modes import LinearMode
    from ...model.rest import Rest
    from ...results.results import AnalysisWriter

#: A mode below this share of the first frequency with closed contact is a rigid motion.
RIGID = 1e-6


def rest_state(context: AnalysisContext[AnalysisSection]) -> Optional[Rest]:
    """Solve the preload of an analysis; the contact laws take it as their rest state, the results keep it. Collective.

    Returns
    -------
    Rest or None
        None when there is no preload.

    Raises
    ------
    NotConverged
        There is no static equilibrium.
    """
    if context.case.preload_of(context.analysis) is None:
        return None
    rest = loaded_state(context)
    context.arrays["rest_displacement"] = rest.displacement
    return rest


def loaded_state(context: AnalysisContext[AnalysisSection], factor: float = 1.0) -> Rest:
    """The same also without [preload], where what pairs press with by themselves moves the structure. Collective.

    Coefficients of the flow are of vibrations: it stands as without them, and they act on what moves it from there.

    Parameters
    ----------
    factor : float
        On the loads; the pairs' own normal loads are as given.
    """
    from ...solve.preload import balanced, static_preload

    section = context.case.preload_of(context.analysis) or PreloadSection(balanced=False)
    reference = closed_mode(context)
    if not section.loads and (section.balanced or not pressed(context.case.contacts, section)):
        return balanced(context.model, reference)
    given = [context.case.loads[name] for name in section.loads]
    load = factor * np.sum([np.zeros(context.model.n_dof), *given], axis=0)
    closed = None if context.case.neighbours is not None else just_touching(context, section, load)
    names = context.case.dofs

    def under(model: Model, load: Array) -> Rest:
        return static_preload(model, load, reference, closed=closed, balance=section.balanced, names=names)

    if not with_flow_forces(context.analysis):
        return under(context.model, load)
    with still_model(context) as still:
        rest = under(still, load)
    rest = replace(rest, load=rest.load + held_by_flow(context, rest.displacement))
    context.model.settle(rest)  # it is not solved for again: with the flow's stiffness there may be another
    return rest


def pressed(contacts: Sequence[Contact], section: PreloadSection) -> bool:
    """Some pair presses without displacement: by its own load, or an interference."""
    return any((pressing(contact, section) > 0).any() for contact in contacts if contact.info.normal is not None)


def just_touching(context: AnalysisContext[AnalysisSection], section: PreloadSection, load: Array) -> Optional[Array]:
    """Displacement (n_dof,) under the load with the pairs that are not apart before it closed, where some only touch.

    These have no stiffness without load, and a structure that they hold has none.
    """
    contacts = [contact for contact in context.case.contacts if contact.info.normal is not None]
    presses = {contact.name: pressing(contact, section) for contact in contacts}
    if not any((force == 0).any() for force in presses.values()):
        return None
    K = context.case.K + closed_stiffness(context, {name: force >= 0 for name, force in presses.items()})
    if not section.balanced:
        for contact in contacts:
            rows = contact.pairs.own[contact.info.normal :: contact.components]
            load = load - rows.T @ np.maximum(presses[contact.name], 0.0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", scipy.sparse.linalg.MatrixRankWarning)  # they do not hold it
        found = np.asarray(scipy.sparse.linalg.spsolve(K.tocsc(), load))
    return found if np.isfinite(found).all() else None


def pressing(contact: Contact, section: PreloadSection) -> Array:
    """Normal force (n_pairs,) without displacement, N0 - kn gap; below zero where a gap is open."""
    load = contact.value(Role.LOAD) if section.pair_loads else None
    gap, stiffness = contact.value(Role.GAP), contact.value(Role.NORMAL_STIFFNESS)
    apart = 0.0 if gap is None or stiffness is None else np.multiply(stiffness, gap)
    return np.asarray(np.subtract(0.0 if load is None else load, apart) + np.zeros(contact.n_pairs))


def closed_mode(context: AnalysisContext[AnalysisSection]) -> LinearMode:
    """Lowest linear mode with every pair stuck, also those that do not touch before the load: a scale. Collective.

    Where contact that sticks leaves nothing to move, without it. Of a wheel it is that in which the sectors of the
    tuned one move alike.
    """
    wheel = context.case.wheel
    case, diameters = (context.case, nodal_diameter(context.analysis)) if wheel is None else (context.tuned, 0)
    try:
        mode = _lowest(case, context, "stuck", diameters)
    except NothingMoves:
        mode = _lowest(case, context, "free", diameters)
    if wheel is None:
        return mode
    from ...cyclic.sector import wave_mode

    return wave_mode(mode, 0, wheel.sectors)


def _lowest(case: Case, context: AnalysisContext[AnalysisSection], limit: str, diameters: int) -> LinearMode:
    """Mode with the contacts in a limit. Collective."""
    from ...model.modes import linear_modes

    with limit_model(case, context.comm, limit, diameters) as model:
        return linear_modes(model, 1)[0]


def start_mode(context: AnalysisContext[AnalysisSection], linear_mode: int) -> tuple[LinearMode, Optional[Rest]]:
    """The linear mode with the contact as it is at rest, stuck, and the rest state (or None). Collective.

    Where contact that sticks leaves nothing to move, the mode without it.
    """
    rest = rest_state(context)
    if rest is not None:
        context.console.line(
            f"{context.name}: at rest {100 * rest.stick:.3g} % of the pairs stick, {100 * rest.slip:.3g} % slip,"
            f" {100 * rest.open:.3g} % are open"
        )
    modes = stuck_or_no_modes(context, linear_mode)
    if not modes:
        context.console.line(f"{context.name}: contact that sticks leaves nothing to move: the mode without contact")
        return context.numbered(context.linear_mode("free", linear_mode), linear_mode), rest
    start = context.numbered(modes, linear_mode)
    if start.omega <= RIGID * closed_mode(context).omega:
        raise _rigid(context, linear_mode, start, rest)
    return start, rest


def _rigid(
    context: AnalysisContext[AnalysisSection], number: int, mode: LinearMode, rest: Optional[Rest]
) -> InputError:
    """What is wrong where a linear mode is a rigid motion; contact that can open may lack a load. Collective."""
    measured, fix = f"{mode.frequency_hz:.3g} Hz, dof {_leader(context, mode)} moves most", "hold the structure"
    if any(contact.info.normal is not None for contact in context.case.contacts):
        measured += f", {100 * (rest or loaded_state(context)).open:.3g} % of the pairs open at rest"
        load_name = own_load(context.case.contacts)
        fix = f"load the contact ({f'{load_name}, or ' if load_name else ''}[preload] loads), {fix}"
    return InputError(
        f"linear mode {number} is a rigid motion: nothing holds the structure at rest",
        f"analysis '{context.name}'",
        measured,
        "an elastic mode",
        f"{fix}, or take a higher linear_mode",
    )


def _leader(context: AnalysisContext[AnalysisSection], mode: LinearMode) -> str:
    """Name of the dof that moves most."""
    return context.case.dofs[int(np.argmax(np.hypot(mode.shape, mode.imaginary)))]


def modes_at_rest(context: AnalysisContext[AnalysisSection], count: int) -> list[LinearMode]:
    """Linear modes with the contact as it is at rest, by the numbers of stuck ones. Collective.

    Pairs without friction slide, and may leave rigid motions: then those most like the modes with friction in all pairs
    that are closed at rest.
    """
    if not any(contact.never_sticks for contact in context.case.contacts):
        return context.linear_mode("stuck", count)
    from ...model.modes import linear_modes

    diameters = nodal_diameter(context.analysis)
    with with_friction(context.case, context.model, diameters) as model:
        stuck = linear_modes(model, count)
    found = context.linear_mode("stuck", min(context.model.n_dof, count + MORE_MODES))
    return [most_like(context, found, mode, diameters) for mode in stuck]


def stuck_or_no_modes(context: AnalysisContext[AnalysisSection], count: int) -> list[LinearMode]:
    """None where contact that sticks leaves nothing to move. Collective."""
    try:
        return modes_at_rest(context, count)
    except NothingMoves:
        return []


def stuck_or_free(context: AnalysisContext[AnalysisSection], number: int) -> LinearMode:
    """A linear mode as `start_mode` has it, of a contact that is at rest already. Collective."""
    return context.numbered(modes_or_free(context, number), number)


def modes_or_free(context: AnalysisContext[AnalysisSection], count: int) -> list[LinearMode]:
    """The same of all up to a number. Collective."""
    return stuck_or_no_modes(context, count) or context.linear_mode("free", count)


def retained(
    context: AnalysisContext[HarmonicSection], highest: Optional[int] = None, samples: Optional[int] = None
) -> Harmonics:
    """Harmonics of an analysis in the frequency domain: with a preload the even ones too, unless told otherwise.

    Parameters
    ----------
    highest, samples : in place of the analysis' own
    """
    from ...hb.harmonics import choose_harmonics

    analysis = context.analysis
    retain = retained_by(analysis, context.case.preload_of(analysis) is not None)
    if analysis.accuracy is not None and highest is None:  # it begins with the least set
        highest, samples = LEAST_HARMONICS, LEAST_SAMPLES
    return choose_harmonics(context.model, highest or analysis.harmonics, samples or analysis.samples, retain)


def keep_pairs(context: AnalysisContext[AnalysisSection], writer: AnalysisWriter) -> None:
    """Keep with the results where the contact pairs are and their areas, for pictures and `fretwave probe`."""
    for contact in context.case.contacts:
        given = contact.pairs
        if given.positions is None and given.areas is None:
            continue
        faces = list(given.faces) if given.faces is not None else [contact.name] * given.n_pairs
        friction = contact.value(Role.FRICTION_COEFFICIENT)
        friction = np.broadcast_to(np.nan if friction is None else friction, (given.n_pairs,))
        place = f"pairs_{contact.name}"
        writer.dataset(f"{place}/face", np.array([str(face).encode() for face in faces]))
        writer.dataset(f"{place}/{Role.FRICTION_COEFFICIENT.value}", friction, units="1")
        if given.positions is not None:
            writer.dataset(f"{place}/position", given.positions, units="length", long_name="place on the face")
        if given.areas is not None:
            writer.dataset(f"{place}/area", given.areas, units="length^2", long_name="nodal area")
