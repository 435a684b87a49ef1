"""What `fretwave check` says of an analysis before it runs: its state at rest, and where its first pair will slip."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Optional

import numpy as np

from ...arrays import Array
from ...case.harmonic import nodal_diameter, with_flow_forces
from ...case.observed import label_of, unit_of
from ...errors import InputError
from ...model.contact import Contact
from ...model.law_info import STATUS, STICK, Limit, Role
from ...model.sectors import in_wave
from ...post.contact_history import normal_force
from ...post.slip_threshold import lasting_factors, slip_factors
from .beside_flow import beside_flow
from .context import AnalysisContext
from .flutter_wave import in_wave_of, raise_if_all, without_those
from .observed import normalised_amplitude, observed_by
from .rest import loaded_state, start_mode
from .wheel_start import Start, start_of

if TYPE_CHECKING:
    from ...model.modes import LinearMode
    from ...model.rest import Rest
    from ..flutter import FlutterAnalysis
    from ..mode import ModeAnalysis

#: Of a period: they miss the extremes of a harmonic motion by (pi / SAMPLES)^2 / 2 of its amplitude.
SAMPLES = 256

#: Pairs that slip with the first but for rounding, which is another on other ranks: the first of them is named.
TIED = 1 + 1e-9

NO_LIMIT = "first slip: no pair sticks at rest with a sharp friction limit"

States = list[dict[str, Array]]
Told = tuple[list[str], list[InputError]]


@dataclass(frozen=True)
class FirstSlip:
    """The pair of all that slips first as a linear mode grows.

    Attributes
    ----------
    amplitude : of first slip, from the sliders at rest
    lasting : from which some pair slips in every period; nearer to rest the sliders settle where all stick
    """

    amplitude: float
    contact: str
    pair: int
    lasting: float


def static_at_rest(context: AnalysisContext[Any], factor: float) -> Told:
    """The static state at a factor on the loads. Collective."""
    began = time.perf_counter()
    states = context.comm.bcast(loaded_state(context, factor).contacts)
    return [rest_line(context, states, time.perf_counter() - began)], []


def mode_at_rest(context: AnalysisContext[ModeAnalysis]) -> Told:
    """State at rest, stuck frequency, and amplitude of first slip against those of the analysis. Collective."""
    if not context.case.contacts:
        return [], []
    states, start, seconds = _solved(context)
    slip = first_slip(context, states, start.mode, normalised_amplitude(context, start.dof, start.mode))
    seen = start.attributes.get("normalise", label_of(context.analysis.normalise))
    lines = [rest_line(context, states, seconds), stuck_line(context, start.mode)]
    if with_flow_forces(context.analysis):
        lines[-1] += beside_flow(context, start.mode, context.analysis.nodal_diameter)
    return lines + _slip_lines(context, slip, seen), _never_slips(context, slip)


def flutter_at_rest(context: AnalysisContext[FlutterAnalysis], diameters: Sequence[int]) -> Told:
    """The same of every wave of a flutter analysis, the state at rest once. Collective."""
    if not context.case.contacts:
        return [], []
    lines: list[str] = []
    slips = []
    cannot: dict[int, InputError] = {}
    for diameter in diameters:
        with in_wave_of(context, diameter) as wave:
            try:
                states, mode, seconds, slip = _wave_at_rest(wave)
            except InputError as error:  # on all ranks; the run goes on with the other waves
                cannot[diameter] = error
                continue
        lines = lines or [rest_line(context, states, seconds)]
        found = f"{mode.frequency_hz:.6g} Hz{beside_flow(context, mode, diameter)}"
        lines.append(f"nodal diameter {diameter}: {found}, {_slip_lines(wave, slip)[0]}")
        slips.append(slip)
    raise_if_all(cannot, diameters)
    known = [slip for slip in slips if slip is not None]
    least = min(known, key=lambda slip: slip.lasting) if len(known) == len(slips) and known else None
    return lines, without_those(context.name, cannot, diameters) + _never_slips(context, least)


def _wave_at_rest(
    wave: AnalysisContext[FlutterAnalysis],
) -> tuple[States, LinearMode, float, Optional[FirstSlip]]:
    states, mode, _, seconds = rest_and_mode(wave)
    seen = observed_by(wave, wave.analysis.normalise, mode)
    return states, mode, seconds, first_slip(wave, states, mode, normalised_amplitude(wave, seen, mode))


def rest_and_mode(context: AnalysisContext[Any]) -> tuple[States, LinearMode, Optional[Rest], float]:
    """Contacts at rest, the linear mode about it of a structure or one sector, and the seconds it took. Collective."""
    began = time.perf_counter()
    mode, rest = start_mode(context, context.analysis.linear_mode)
    states = context.comm.bcast((rest or loaded_state(context)).contacts)
    return states, mode, rest, time.perf_counter() - began


def _solved(context: AnalysisContext[ModeAnalysis]) -> tuple[States, Start, float]:
    """The same with what a mode starts from, also that of all sectors of a wheel."""
    if context.case.wheel is None:
        states, mode, rest, seconds = rest_and_mode(context)
        return states, Start(mode, rest, {}, observed_by(context, context.analysis.normalise, mode)), seconds
    began = time.perf_counter()
    start = start_of(context)
    states = context.comm.bcast((start.rest or loaded_state(context)).contacts)
    return states, start, time.perf_counter() - began


def rest_line(context: AnalysisContext[Any], states: States, seconds: float) -> str:
    """How many pairs stick, slip and are open, and the sum of their normal forces."""
    status = np.concatenate([state["status"] for state in states])
    text = "at rest: " + ", ".join(f"{int(np.sum(status == code))} {word}" for word, code in STATUS.items())
    normals = [(c.info.normal, s["f"]) for c, s in zip(context.case.contacts, states) if c.info.normal is not None]
    if normals:
        total = sum(float(np.sum(normal_force(f, normal))) for normal, f in normals)
        text += f"; normal forces sum to {total:.5g} {context.units('force')}"
    return f"{text} (solved in {seconds:.2g} s)"


def stuck_line(context: AnalysisContext[Any], mode: LinearMode) -> str:
    """Of a whole wheel it is the wave's or, mistuned, the mode most like it."""
    which = f"linear mode {context.analysis.linear_mode}"
    if context.case.wheel is not None:
        which += " of the whole wheel" if context.analysis.nodal_diameter is None else " of this wave on the wheel"
    return f"{which} with contact as at rest: {mode.frequency_hz:.6g} Hz"


def first_slip(context: AnalysisContext[Any], states: States, mode: LinearMode, unit: float) -> Optional[FirstSlip]:
    """The pair that slips first; None where no pair sticks at rest under a law with a sharp limit.

    Parameters
    ----------
    states : contacts of the state at rest, u and f (components, n_pairs), status (n_pairs,)
    unit : amplitude of the mode as it is scaled
    """
    found = []
    for contact, state in zip(context.case.contacts, states):
        factors = pair_factors(context, contact, state, mode)
        if factors is not None and np.any(state["status"] == STICK):
            first, lasting = unit * factors
            pair = int(np.flatnonzero(first <= TIED * np.min(first))[0])
            found.append(FirstSlip(float(first[pair]), contact.name, pair, float(np.min(lasting))))
    if not found:
        return None
    lasting = min(slip.lasting for slip in found)
    least = TIED * min(slip.amplitude for slip in found)
    return replace(next(slip for slip in found if slip.amplitude <= least), lasting=lasting)


def pair_factors(
    context: AnalysisContext[Any], contact: Contact, state: dict[str, Array], mode: LinearMode
) -> Optional[Array]:
    """Factors (2, n_pairs) on a linear mode at which each pair slips first, and from which in every period.

    inf of pairs that do not stick at rest; None of a law without a sharp limit.
    """
    stiffness = [contact.value(contact.info.stiffness_along(row)) for row in range(contact.components)]
    role = Role.FRICTION_LIMIT if contact.info.normal is None else Role.FRICTION_COEFFICIENT
    bound = contact.value(role)
    if contact.info.limit == Limit.NONE or bound is None or any(k is None for k in stiffness):
        return None
    swing = _swing(context, contact, mode) * np.stack([np.broadcast_to(k, contact.n_pairs) for k in stiffness])
    each = contact.info.limit == Limit.EACH
    first = slip_factors(state["f"] + swing, limit=bound, friction=bound, each=each)
    lasting = lasting_factors(state["f"] + swing, limit=bound, friction=bound, each=each)
    return np.where(state["status"] == STICK, [first, np.maximum(first, lasting)], np.inf)


def _swing(context: AnalysisContext[Any], contact: Contact, mode: LinearMode) -> Array:
    """Relative motion (samples, components, n_pairs) over a period."""
    sectors = context.case.neighbours.sectors if context.case.neighbours is not None else 1
    theta = 2 * np.pi * nodal_diameter(context.analysis) / sectors
    u = in_wave(contact.B, mode.shape + 1j * mode.imaginary, theta).reshape(-1, contact.components).T
    tau = 2 * np.pi * np.arange(SAMPLES) / SAMPLES
    return np.asarray(np.real(np.exp(1j * tau)[:, None, None] * u))


def place_of(context: AnalysisContext[Any], slip: FirstSlip) -> str:
    """The pair by its number; on a wheel, whose pairs stand sector by sector, that in its sector."""
    if context.case.wheel is None:
        return f"pair {slip.pair} of '{slip.contact}'"
    each = next(c.n_pairs for c in context.tuned.contacts if c.name == slip.contact)
    return f"pair {slip.pair % each} of '{slip.contact}' in sector {slip.pair // each}"


def _slip_lines(context: AnalysisContext[Any], slip: Optional[FirstSlip], seen: str = "") -> list[str]:
    if slip is None:
        return [NO_LIMIT]
    if not np.isfinite(slip.amplitude):
        return ["first slip: the linear mode makes no pair slip"]
    unit, seen = context.units(unit_of(context.analysis.normalise)), seen or label_of(context.analysis.normalise)
    low, high = context.analysis.amplitude
    side = "below" if slip.lasting < low else "above" if slip.lasting > high else "within"
    return [
        f"first slip expected at a = {slip.amplitude:.3g} {unit} of {seen} ({place_of(context, slip)}), in"
        f" every period from about {slip.lasting:.3g} {unit}: {side} the amplitudes asked for"
    ]


def _never_slips(context: AnalysisContext[Any], slip: Optional[FirstSlip]) -> list[InputError]:
    """A branch that ends before pairs slip in every period has the linear mode's frequency and damping."""
    low, high = context.analysis.amplitude
    if slip is None or not slip.lasting > high:
        return []
    unit, name = context.units(unit_of(context.analysis.normalise)), context.name
    expected, fix = "a mode that moves pairs along their tangents", "another linear_mode, or other friction limits"
    if np.isfinite(slip.lasting):
        expected = f"more than about {slip.lasting:.3g} {unit}, from where the linear mode expects slip in every period"
        fix = f"--set '{name}.amplitude=[{low:g}, {10 * slip.lasting:.2g}]'"
    what = f"no amplitude of '{name}' is expected to make a pair slip in every period"
    return [InputError(what, f"{name}.amplitude", f"at most {high:g} {unit}", expected, fix)]
