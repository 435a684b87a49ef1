"""What a sweep says of linear modes, states at rest, wear, and motions in time: a few numbers of each branch."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from ..arrays import Array
from ..columns import Column
from ..model.contact import LIMITS
from ..post.decays import LIMIT_CYCLE
from ..post.mode_curve import most_damped, without_rounding
from ..texts import counted
from .sweep_summary import Row, Summary, Table, text_of

#: Attribute of a linear analysis with engine order: its table of amplifications, as JSON.
AMPLIFIED = "amplifications"
WEAR = (
    Column("amplitude", "length", "modal amplitude"),
    Column("last_cycles", "1", "normalised wear cycles at the end"),
    Column("cycle_unit", "1", "vibrations in a normalised wear cycle"),
    Column("worn_volume", "length^3", "worn volume of all faces at the end"),
    Column("new_zeta", "1", "modal damping ratio when new"),
    Column("largest_zeta", "1", "largest modal damping ratio over wear"),
    Column("last_zeta", "1", "modal damping ratio at the end of wear"),
    Column("new_frequency_hz", "Hz", "frequency when new"),
    Column("last_frequency_hz", "Hz", "frequency at the end of wear"),
)
#: Of normalised cycles that are the same but for the rounding of the loads that they are made of.
SAME_UNIT = 1 + 1e-6
STATIC = (
    Column("slip_share", "1", "share of the pairs that slip"),
    Column("open_share", "1", "share of the pairs that are open"),
    Column("smallest_normal_force", "force", "smallest normal force of a pair"),
    Column("largest_normal_force", "force", "largest normal force of a pair"),
    Column("normal_force", "force", "sum of the normal forces of all pairs"),
)
LIMIT = (
    Column("settled", "1", "1: the motion settled on a limit cycle; 0: not", "i"),
    Column("limit_cycle", "length", "amplitude of the limit cycle that the motion settled on"),
    Column("limit_cycle_hz", "Hz", "frequency of the limit cycle that the motion settled on"),
    Column("last_amplitude", "length", "amplitude of the last cycles"),
)
DECAY = (
    Column("half_time", "s", "time in which the first cycle's amplitude falls to its half"),
    Column("largest_zeta", "1", "largest damping ratio of a cycle between two others"),
    Column("last_amplitude", "length", "amplitude of the last cycle"),
)
#: Of linear modes, by contact and number, which end the name: ``hz_stuck_1``.
LINEAR = (
    Column("amplification_", "1", "largest peak of a sector over that of the tuned wheel"),
    Column("hz_", "Hz", "frequency"),
)


def _wear(table: Table, attributes: Table, forces: Table) -> dict[str, float]:
    worn = [values for name, values in table.items() if name.startswith("worn_")]
    zeta, hz = (np.asarray(table[name]) for name in ("zeta", "frequency_hz"))
    return {
        "amplitude": float(table["amplitude"][-1]),
        "last_cycles": float(table["cycles"][-1]),
        "cycle_unit": float(attributes.get("cycle_unit", math.nan)),
        "worn_volume": float(sum(values[-1] for values in worn)),
        "new_zeta": float(zeta[0]),
        "largest_zeta": float(zeta[most_damped(zeta)]),
        "last_zeta": float(zeta[-1]),
        "new_frequency_hz": float(hz[0]),
        "last_frequency_hz": float(hz[-1]),
    }


def _wear_words(row: Row) -> str:
    new, top, last = (100 * without_rounding(row[f"{name}_zeta"]) for name in ("new", "largest", "last"))
    return (
        f"a = {row['amplitude']:.4g} {row['unit']}: zeta {new:.4g} % when new, largest {top:.4g} %, {last:.4g} % after"
        f" {row['last_cycles']:.4g} cycles, {row['last_frequency_hz']:.6g} Hz"
    )


def _wear_note(rows: Sequence[Row]) -> str:
    """Where what is compared has not worn for equally many vibrations."""
    units = [unit for row in rows if math.isfinite(unit := row.get("cycle_unit", math.nan))]  # not of older results
    if not units or not max(units) > SAME_UNIT * min(units):
        return ""
    return (
        f"a normalised cycle is {min(units):.4g} to {max(units):.4g} vibrations, by the value: wear is not compared"
        " after equally many vibrations unless `cycle_unit` is given"
    )


def _static(table: Table, attributes: Table, forces: Table) -> dict[str, float]:
    """Pairs by their state; of laws without a normal force there is none."""
    status, normal = np.asarray(table["status"]), np.asarray(table["normal_force"], dtype=float)
    known = normal[np.isfinite(normal)]
    return {
        "slip_share": float(np.mean(status == b"slip")),
        "open_share": float(np.mean(status == b"open")),
        "smallest_normal_force": float(known.min()) if len(known) else math.nan,
        "largest_normal_force": float(known.max()) if len(known) else math.nan,
        "normal_force": float(known.sum()) if len(known) else math.nan,
    }


def _static_words(row: Row) -> str:
    return f"{100 * row['slip_share']:.3g} % of the pairs slip, {100 * row['open_share']:.3g} % are open"


def _limit_cycle(table: Table, attributes: Table, forces: Table) -> dict[str, float]:
    """Of a start; its verdict stands in the attributes."""
    found = json.loads(attributes["endings"])[int(table["start"][0])]
    settled = found["text"] == LIMIT_CYCLE
    return {
        "settled": int(settled),
        "limit_cycle": float(found["amplitude"]) if settled else math.nan,
        "limit_cycle_hz": float(found["omega"]) / (2 * np.pi) if settled else math.nan,
        "last_amplitude": float(table["amplitude"][-1]),
    }


def _limit_cycle_words(row: Row) -> str:
    if row["settled"] != 1:
        return f"no limit cycle, {row['last_amplitude']:.4g} {row['unit']} at the end"
    return f"limit cycle at {row['limit_cycle']:.5g} {row['unit']}, {row['limit_cycle_hz']:.6g} Hz"


def _decay(table: Table, attributes: Table, forces: Table) -> dict[str, float]:
    """The first and the last cycle's damping is a decrement continued beyond the cycles: it is no largest one."""
    zeta, amplitude = np.asarray(table["zeta"])[1:-1], np.asarray(table["amplitude"])
    return {
        "half_time": _half_time(np.asarray(table["time"]), np.log(amplitude)),
        "largest_zeta": float(zeta[most_damped(zeta)]) if len(zeta) else math.nan,
        "last_amplitude": float(amplitude[-1]),
    }


def _half_time(time: Array, level: Array) -> float:
    """From the first cycle on; the logarithm of the amplitude is linear from a cycle to the next."""
    fallen = level[0] - level
    below = np.flatnonzero(fallen >= math.log(2.0))
    if not len(below):
        return math.nan
    k = int(below[0])
    return float(np.interp(math.log(2.0), fallen[k - 1 : k + 1], time[k - 1 : k + 1]) - time[0])


def _decay_words(row: Row) -> str:
    half = f"half of it after {row['half_time']:.5g} s" if math.isfinite(row["half_time"]) else "half of it not reached"
    zeta = row["largest_zeta"]
    words = f", largest zeta {100 * without_rounding(zeta):.4g} %" if math.isfinite(zeta) else ""
    return f"{half}{words}, {row['last_amplitude']:.4g} {row['unit']} at the end"


def _linear(table: Table, attributes: Table, forces: Table) -> dict[str, float]:
    """Frequencies by contact and number, of several speeds at the highest, and how far mistuning amplifies."""
    speed = np.asarray(table.get("speed_rpm", np.zeros(len(table["mode"]))))
    rows = np.flatnonzero(speed == speed.max())
    hz = {f"hz_{text_of(table['contact'][k])}_{table['mode'][k]}": float(table["frequency_hz"][k]) for k in rows}
    return {**hz, **dict(_amplified(attributes))}


def _amplified(attributes: Mapping[str, Any]) -> Iterator[tuple[str, float]]:
    for row in json.loads(attributes.get(AMPLIFIED, "[]")):
        value = row["amplification"]
        yield f"amplification_{row['contact']}_{row['mode']}", math.nan if value is None else float(value)


def _linear_words(row: Row) -> str:
    factors, hz = (_known(row, column.name) for column in LINEAR)
    if not hz:
        raise KeyError(LINEAR[1].name)
    words = ", ".join(f"{limit} {_modes(own)}" for limit in LIMITS if (own := _known(row, f"hz_{limit}_")))
    return words + (f"; largest amplification {max(factors):.4f}" if factors else "")


def _modes(hz: Sequence[float]) -> str:
    low, high = f"{min(hz):.6g}", f"{max(hz):.6g}"
    return f"{counted(len(hz), 'mode')} {low if low == high else f'{low} to {high}'} Hz"


def _known(row: Row, begin: str) -> list[float]:
    """Numbers whose names begin so; nan stands in results.h5 where another value has more of them."""
    return [row[key] for key in row if key.startswith(begin) and math.isfinite(row[key])]


WEAR_LINES = Summary(
    WEAR, _wear, _wear_words, "line", spread=("last_zeta", "last_frequency_hz", "worn_volume"), note=_wear_note
)
STATES_AT_REST = Summary(
    STATIC, _static, _static_words, "factor", spread=("slip_share", "open_share", "smallest_normal_force")
)
CYCLES_IN_TIME = Summary(LIMIT, _limit_cycle, _limit_cycle_words, "start", spread=("limit_cycle", "limit_cycle_hz"))
DECAYS = Summary(
    DECAY, _decay, _decay_words, "start", spread=("largest_zeta", "last_amplitude"), cut_off=("half_time",)
)
LINEAR_MODES = Summary((), _linear, _linear_words, "nodal_diameter", numbered=LINEAR)
