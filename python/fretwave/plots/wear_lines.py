"""Wear as the pictures read it: a line for each amplitude, and what kind of history each contact pair has."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from ..arrays import Array
from ..model.law_info import Role
from ..results.analysis import Analysis, Table
from ..results.reader import Run
from ..units import SI, UnitSystem
from . import scales, style

#: slack of the rule by which wear has stopped: each amplitude has its own scale of the normal load, the first is kept
SLACK = 2.0
#: shares of the deepest depth, and of a pair's own largest rate, that count as nothing
UNWORN, STOPPED = 1e-3, 0.05
#: a second spell begins when the rate at least doubles after a fall below this share of what it was, and counts when
#: this share of the depth comes from then on
FALLEN, SECOND = 0.1, 0.2

NEVER, STOPS, COMPLEX, ONWARDS = "never wears", "stops wearing", "wears again", "keeps wearing"
KINDS = {NEVER: style.GREY, STOPS: style.BLUE, COMPLEX: style.ORANGE, ONWARDS: style.GREEN}
RULE = (
    f"never wears: under {100 * UNWORN:g} % of the deepest;"
    f"  stops: the last rate is under {100 * STOPPED:g} % of its peak;\n"
    f"wears again: over {100 * SECOND:g} % of the depth comes in a second spell, when the rate at least doubles\n"
    f"after it was under {100 * FALLEN:g} % of its peak;  keeps wearing: all others"
)


@dataclass(frozen=True)
class WearLine:
    """One amplitude of a wear analysis.

    Attributes
    ----------
    columns : of its table, (n,) each
    depth, rate, load : contact -> (n, n_pairs)
        Worn depth [length], its growth in a vibration cycle [length], mean normal force [force].
    held : wear has stopped before, the last row is that before it
    jumps : (n_jumps,)
        Cycles at which the mode went over to another sheet.
    units : that all numbers are in
    """

    amplitude: float
    columns: Table
    depth: Table
    rate: Table
    load: Table
    jumps: Array = field(default_factory=lambda: np.empty(0))
    held: bool = False
    units: UnitSystem = SI

    @property
    def called(self) -> str:
        """As the results name it in front of a reason."""
        return f"a = {self.amplitude:g} {self.units('length')}"

    @property
    def cycles(self) -> Array:
        """Normalised wear cycles (n,)."""
        return self.columns["cycles"]

    def at(self, values: Array, cycles: Array) -> Array:
        """Values (n,) at other cycles, nan behind an early end."""
        behind = cycles > self.cycles[-1] * (1 + 1e-9)
        return np.where(behind, np.nan, np.interp(cycles, self.cycles, values))


def lines_of(wear: Analysis) -> list[WearLine]:
    """All amplitudes, the smallest first; one whose wear has stopped goes on unchanged to the last cycle of all."""
    numbers = wear.columns["line"].astype(int)
    contacts = wear.worn_contacts()
    fields = {key: {name: wear.field(f"{key}_{name}") for name in contacts} for key in ("depth", "rate", "load")}
    last, unit = float(wear.columns["cycles"].max()), float(wear.attributes["cycle_unit"])
    found = []
    for number in np.unique(numbers):
        rows = np.flatnonzero(numbers == number)
        left = last - float(wear.columns["cycles"][rows[-1]])
        held = left > 0 and _has_stopped(wear, fields["rate"], rows[-1], unit * left)
        rows = np.append(rows, rows[-1]) if held else rows
        columns = {key: values[rows] for key, values in wear.columns.items()}
        if held:
            columns["cycles"][-1] = last
        jumps = np.array([wear.columns["cycles"][row] for row in rows if wear.events[row] == "jump"])
        parts = {key: {name: values[rows] for name, values in table.items()} for key, table in fields.items()}
        found.append(
            WearLine(float(columns["amplitude"][0]), columns, **parts, units=wear.unit_system, jumps=jumps, held=held)
        )
    return sorted(found, key=lambda line: line.amplitude)


def _has_stopped(wear: Analysis, rates: Table, row: int, vibrations: float) -> bool:
    """The march's own rule: up to the last cycle no pair loses more than the tolerance of the mean normal load."""
    lost = float(wear.attributes["tolerance"]) * float(wear.attributes.get("load_scale", 0.0))
    stiffness = {name: wear.parameter(name, Role.NORMAL_STIFFNESS) for name in rates}
    if any(value is None for value in stiffness.values()):
        return False  # results that do not say what their laws' parameters are
    return all((stiffness[name] * rate[row] * vibrations <= SLACK * lost).all() for name, rate in rates.items())


def wears(run: Run) -> Iterator[tuple[Analysis, list[WearLine]]]:
    """Wear analyses that have any cycles behind them."""
    for wear in run.of_kind("wear"):
        if wear.columns["cycles"].max() > 0:
            yield wear, lines_of(wear)


def kinds(depth: Array, rate: Array) -> list[str]:
    """Kind of each pair's history, by `RULE`.

    Parameters
    ----------
    depth, rate : (n, n_pairs)
    """
    deepest = float(depth[-1].max(initial=0.0))
    return [_kind(d, r, deepest) for d, r in zip(depth.T, rate.T)]


def _kind(depth: Array, rate: Array, deepest: float) -> str:
    if depth[-1] <= UNWORN * deepest:
        return NEVER
    if second_spell(depth, rate) > SECOND:
        return COMPLEX
    return STOPS if rate[-1] < STOPPED * rate.max() else ONWARDS


def second_spell(depth: Array, rate: Array) -> float:
    """Share of a pair's depth (n,) that comes from the trough on out of which its rate (n,) rises most, 0 without."""
    fallen = np.flatnonzero(rate < FALLEN * np.maximum.accumulate(rate))
    if not len(fallen):
        return 0.0
    later = rate[fallen[0] :]
    lowest = np.minimum.accumulate(later)
    top = int(np.argmax(later - lowest))
    if later[top] < 2 * lowest[top] or later[top] <= 0:
        return 0.0
    trough = fallen[0] + int(np.argmin(later[: top + 1]))
    return float((depth[-1] - depth[trough]) / depth[-1])


def examples(line: WearLine, contact: str) -> dict[str, int]:
    """A pair of each kind there is, a clear one: of those that stop a deep one with the smallest last rate."""
    depth, rate = line.depth[contact], line.rate[contact]
    found: dict[str, int] = {}
    words = np.array(kinds(depth, rate))
    for kind in KINDS:
        pairs = np.flatnonzero(words == kind)
        if len(pairs):
            found[kind] = int(max(pairs, key=lambda pair: _clear(kind, depth[:, pair], rate[:, pair], depth[-1].max())))
    return found


def _clear(kind: str, depth: Array, rate: Array, deepest: float) -> float:
    """How well a pair shows its kind."""
    if kind == STOPS:
        return float(min(depth[-1], deepest / 2) / deepest - rate[-1] / rate.max())
    if kind == COMPLEX:  # both spells are large
        share = second_spell(depth, rate)
        return float(min(share, 1 - share) * depth[-1])
    return float(depth[-1])


def telling_line(lines: Sequence[WearLine], contact: str) -> WearLine:
    """The line with most kinds of pairs; of several the one of largest amplitude."""
    return max(lines, key=lambda line: (len(examples(line, contact)), line.amplitude))


def amplitudes(lines: Sequence[WearLine]) -> tuple[Array, str]:
    """Of all lines in a unit that suits the largest, and the unit."""
    values, units = np.array([line.amplitude for line in lines]), lines[0].units
    scale = scales.linear(units, units("length"), values)
    return scale(values), scale.unit


def amplitude_text(line: WearLine) -> str:
    """As "a = 1.2 mm"."""
    values, unit = amplitudes([line])
    return f"a = {values[0]:.4g} {unit}"


def amplitude_label(wear: Analysis, unit: str) -> str:
    """Axis label with the dof that the mode normalises."""
    case = wear.attributes.get("case", {})
    of_case = case.get(f"{wear.attributes.get('mode')}.normalise", "") if isinstance(case, dict) else ""
    name = wear.attributes.get("normalise", of_case)  # results of an earlier version have it in the case alone
    return style.label(f"Modal amplitude of {name}" if name else "Modal amplitude", unit)


def cycle_label(wear: Analysis) -> str:
    """Axis label that says how many vibrations a normalised cycle is."""
    return f"Wear cycles (1 = {power(float(wear.attributes.get('cycle_unit', 1.0)))} vibrations)"


def power(value: float) -> str:
    """A number as 1.36 x 10^7."""
    digits, exponent = f"{value:.3g}".partition("e")[::2]
    if not exponent:
        return digits
    return rf"{digits} $\times$ 10$^{{{int(exponent)}}}$" if digits != "1" else f"10$^{{{int(exponent)}}}$"
