"""What a sweep says of each value in a few numbers: onset of slip, largest damping, lowest frequency, peaks."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from ..columns import Column
from ..files.dimensions import names_of_data
from ..post.grid import Plan
from ..post.largest import largest
from ..post.limit_cycles import SHORT, limit_cycles
from ..post.mode_curve import ModeCurve, lowest, most_damped, varies, without_rounding
from ..post.slip_threshold import slip_threshold
from ..registry import kind_named
from ..texts import counted
from .file import unit_of_amplitudes
from .sweep_quantiles import AMPLITUDE_AT, over_seeds, quantile_lines

if TYPE_CHECKING:
    import h5py

#: Limit cycles by what is known of their stability.
CYCLES = {"stable": True, "unstable": False, "unknown": None}
#: Damping has set in where this share of its rise to the maximum is reached.
ONSET = 0.1

COMMON = (
    Column("done", "1", "1: the branch came to its end; 0: it stopped early", "i"),
    Column("points", "1", "points of the branch", "i"),
    Column("newton", "1", "Newton iterations of the branch", "i"),
    Column("wall_s", "s", "wall time of the branch"),
)
MODE = (
    Column("stuck_hz", "Hz", "linear frequency with the contact stuck"),
    Column("free_hz", "Hz", "linear frequency without friction (contact free, or closed and sliding)"),
    Column("slip_threshold", "length", "amplitude at which the first pair slips"),
    Column("stick_until", "length", "last amplitude of the branch before any slip"),
    Column("slip_from", "length", "first amplitude of the branch with slip"),
    Column("onset_amplitude", "length", "amplitude at which a tenth of the damping's rise is reached"),
    Column("largest_zeta", "1", "largest modal damping ratio"),
    Column("amplitude_of_largest_zeta", "length", "amplitude of the largest damping, nan where all is the same"),
    Column("lowest_frequency_hz", "Hz", "lowest frequency of the branch"),
    Column("amplitude_of_lowest_frequency", "length", "amplitude of the lowest frequency, nan at an end of the branch"),
    Column("last_frequency_hz", "Hz", "frequency at the end of the branch"),
    Column("stable_limit_cycle", "length", "smallest amplitude of a limit cycle stable in its own: damping rises"),
    Column("unstable_limit_cycle", "length", "smallest amplitude at which damping falls through zero"),
    Column("unknown_limit_cycle", "length", "smallest amplitude of a limit cycle of unknown stability"),
)
WHEEL_MODE = (
    Column("largest_amplification", "1", "largest amplitude of a sector over that of the tuned wave, along the branch"),
    Column("smallest_participation", "1", "smallest participation ratio of the sectors along the branch"),
)
#: Of the amplitudes of `report_at`, by their numbers along the branch, which end the name: ``zeta_at_1``.
AT = (
    Column(AMPLITUDE_AT, "length", "amplitude that was asked for"),
    Column("frequency_hz_at_", "Hz", "frequency at this amplitude"),
    Column("zeta_at_", "1", "modal damping ratio at this amplitude"),
    Column("amplification_at_", "1", "largest amplitude of a sector over that of the tuned wave, at this amplitude"),
)
FORCED = (
    Column("largest_amplitude", "length", "largest amplitude of the response"),
    Column("frequency_of_largest_amplitude", "Hz", "frequency of the largest amplitude"),
    Column("peak_within", "1", "1: the largest amplitude is a peak; 0: it is at an end of the frequency range", "i"),
)
WHEEL_FORCED = (
    Column("largest_blade_amplitude", "length", "peak of the sector that moves most"),
    Column("largest_blade_frequency_hz", "Hz", "frequency of that peak"),
    Column("largest_blade", "1", "sector that moves most", "i"),
    Column("blade_amplification", "1", "its peak over that of the tuned wheel"),
)

Table = Mapping[str, Any]
Row = Mapping[str, Any]


@dataclass(frozen=True)
class Summary:
    """What a sweep says of each branch of a kind of analysis.

    Attributes
    ----------
    columns : tuple of Column
        Beside those that all have.
    numbers : callable
        Their values by name, from the columns of the branch (n_points,), the attributes of its group, and the forces of
        the contacts over the period of its first point, where they are kept.
    words : callable
        A row of the summary in words, for the terminal; `unit` in it is that of the amplitudes.
    split : str
        Column of the table whose values tell several branches of one run apart; empty where there is one.
    on_wheel : tuple of Column
        Further ones that the branches of a whole wheel have.
    spread : tuple of str
        Columns whose quantiles are shown where a sweep goes over draws.
    numbered : tuple of Column
        As many as a branch has of each: numbers have names that begin with those of the columns; all of them are shown.
    cut_off : tuple of str
        Columns that a value lacks where they would be beyond its branch: quantiles of the others would be too small or
        too large, and are made where all have them alone.
    note : callable
        What is to be known of all rows beside their words; empty where there is nothing.
    """

    columns: tuple[Column, ...] = ()
    numbers: Callable[[Table, Table, Table], Mapping[str, float]] = lambda table, attributes, forces: {}
    words: Callable[[Row], str] = lambda row: f"{row['points']:.0f} points"
    split: str = ""
    on_wheel: tuple[Column, ...] = ()
    spread: tuple[str, ...] = ()
    numbered: tuple[Column, ...] = ()
    cut_off: tuple[str, ...] = ()
    note: Callable[[Sequence[Row]], str] = lambda rows: ""


COUNTS = Summary()


def summary_of(kind: str) -> Summary:
    """That of a kind of analysis; points and cost alone where the kind is not known here."""
    known = kind_named(kind)
    return COUNTS if known is None else known.summary


def columns_of(kind: str) -> tuple[Column, ...]:
    """What is said of each branch in a sweep of this kind of analysis."""
    return (*COMMON, *summary_of(kind).columns)


def columns_in(kind: str, rows: Sequence[Row]) -> list[Column]:
    """Those that the rows of a summary have."""
    here = dict.fromkeys(name for row in rows for name in row)
    known = [*columns_of(kind), *summary_of(kind).on_wheel]
    several = [_one_of(column, name) for column in summary_of(kind).numbered for name in here if _is_of(name, column)]
    at = [replace(column, name=name) for column in AT for name in here if _is_of(name, column)]
    return [column for column in known if column.name in here] + several + at


def _is_of(name: str, column: Column) -> bool:
    return name.startswith(column.name)


def _one_of(column: Column, name: str) -> Column:
    """The column of one number: its long name says which."""
    return replace(column, name=name, long_name=f"{column.long_name}, {name[len(column.name) :].replace('_', ' ')}")


def spread_of(kind: str, columns: Sequence[Column]) -> list[Column]:
    """Columns whose quantiles are shown; of a driven wheel those of the blade that moves most."""
    of_wheel = any(column.name in (WHEEL_FORCED[0].name,) for column in columns)
    names = [name for name in summary_of(kind).spread if not (of_wheel and name in _OF_ONE)]
    several = tuple(column.name for column in (*summary_of(kind).numbered, *AT[1:]))
    return [column for column in columns if column.name in names or column.name.startswith(several)]


def split_of(kind: str) -> str:
    """Column that tells the branches of one table apart; empty where there is one branch."""
    return summary_of(kind).split


def summarise(
    kind: str, table: Table, attributes: Mapping[str, Any], start_forces: Mapping[str, Any] | None = None
) -> dict[str, float]:
    """The numbers of one branch.

    Parameters
    ----------
    kind : of the analysis
    table : its columns (n_points,)
    attributes : of its group in the results
    start_forces : of the contacts over the period of the first point, where they are kept
    """
    common = {
        "done": int(attributes.get("status") == "done"),
        "points": len(next(iter(table.values()))),
        "newton": int(np.sum(table.get("newton", 0))),
        "wall_s": float(np.sum(table.get("wall_s", 0.0))),
    }
    return {**common, **summary_of(kind).numbers(table, attributes, start_forces or {})}


def _mode(table: Table, attributes: Mapping[str, Any], forces: Mapping[str, Any]) -> dict[str, float]:
    amplitude, frequency, zeta = (np.asarray(table[name]) for name in ("amplitude", "frequency_hz", "zeta"))
    top, low = most_damped(zeta), lowest(frequency)
    error = float(np.nan_to_num(np.asarray(table["zeta_error"], dtype=float)[0])) if "zeta_error" in table else 0.0
    rises = top > 0 and float(zeta[top] - zeta[0]) > error  # what the first point is wrong by is no rise
    slips = np.flatnonzero(table["slip"] > 0)
    first = int(slips[0]) if len(slips) else len(zeta)
    other = attributes.get("free_omega", attributes.get("sliding_omega", np.nan))
    return {
        "stuck_hz": float(attributes.get("stuck_omega", np.nan)) / (2 * np.pi),
        "free_hz": float(other) / (2 * np.pi),
        "slip_threshold": slip_threshold(float(amplitude[0]), forces, attributes) if first and forces else np.nan,
        "stick_until": float(amplitude[first - 1]) if first else np.nan,
        "slip_from": float(amplitude[first]) if len(slips) else np.nan,
        "onset_amplitude": _onset(table, float(zeta[0]), float(zeta[top])) if first and rises else np.nan,
        "largest_zeta": float(zeta[top]),
        "amplitude_of_largest_zeta": float(amplitude[top]) if varies(table) else np.nan,
        "lowest_frequency_hz": float(frequency[low]),
        "amplitude_of_lowest_frequency": float(amplitude[low]) if 0 < low < len(zeta) - 1 else np.nan,
        "last_frequency_hz": float(frequency[-1]),
        **_limit_cycles(table),
        **_wheel(table),
        **_at_reports(table),
    }


def _wheel(table: Table) -> dict[str, float]:
    """Of a mode of a whole wheel."""
    if "amplification" not in table:
        return {}
    largest, smallest = np.max(table["amplification"]), np.min(table["participation"])
    return {"largest_amplification": float(largest), "smallest_participation": float(smallest)}


def _at_reports(table: Table) -> dict[str, float]:
    """At each amplitude that is reported, where the branch comes to it first."""
    first: dict[str, int] = {}
    for row in np.flatnonzero(["report" in event.split() for event in _events(table)]):
        first.setdefault(f"{table['amplitude'][row]:.6g}", row)
    return {
        f"{column.name}{number}": float(table[quantity][row])
        for column in AT
        for number, row in enumerate(first.values(), 1)
        if (quantity := column.name.removesuffix("_at_")) in table
    }


def _events(table: Table) -> list[str]:
    return [text_of(text) for text in table.get("event", ())]


def text_of(value: object) -> str:
    """A text of a table as HDF5 or a CSV has it."""
    return value.decode() if isinstance(value, bytes) else str(value)


def _limit_cycles(table: Table) -> dict[str, float]:
    cycles = limit_cycles({**table, "event": _events(table)})
    return {
        f"{word}_limit_cycle": min((c["amplitude"] for c in cycles if c["stable"] is stable), default=np.nan)
        for word, stable in CYCLES.items()
    }


def _onset(table: Table, start: float, largest: float) -> float:
    """Amplitude at which damping has risen by a share of its whole rise."""
    found = ModeCurve.from_table(table).amplitudes_at(start + ONSET * (largest - start))
    return found[0] if found else float("nan")


def _forced(table: Table, attributes: Table, forces: Table) -> dict[str, float]:
    top = largest(np.asarray(table["amplitude"]))
    return {
        "largest_amplitude": float(table["amplitude"][top]),
        "frequency_of_largest_amplitude": float(table["frequency_hz"][top]),
        "peak_within": int(0 < top < len(table["amplitude"]) - 1),
        **_largest_blade(table, attributes),
    }


def _largest_blade(table: Table, attributes: Table) -> dict[str, float]:
    """Of the level of a driven wheel, from the peaks of all its blades."""
    level = float(table["level"][0])
    peak = next((peak for peak in attributes.get("peaks", ()) if peak["level"] == level), None)
    if peak is None:
        return {}
    own = ("amplitude", "frequency_hz", "sector", "amplification")
    return {column.name: float(peak[key]) for column, key in zip(WHEEL_FORCED, own)}


def in_words(name: str, plan: Plan, rows: Sequence[Row], kind: str, columns: Sequence[Column], unit: str) -> list[str]:
    """A sweep's summary for the terminal: a line for each row, of draws the quantiles, and what is to be known of all.

    Parameters
    ----------
    columns : of the summary
    unit : of the amplitudes
    """
    of = summary_of(kind)
    if over_seeds(plan):
        told = quantile_lines(name, plan, rows, spread_of(kind, columns), of.split)
    else:
        told = landmarks(name, plan, rows, of, unit)
    note = of.note(rows)
    return [*told, f"{name}: {note}"] if note else told


def landmarks(name: str, plan: Plan, rows: Sequence[Row], of: Summary, unit: str) -> list[str]:
    """A line for each row of a sweep's summary, for the terminal; `unit` of the amplitudes."""
    labels = plan.labels()
    told = [{**row, "unit": unit} for row in rows]
    return [f"{name}: {labels[row['value']]}{_part(row, of)}: {_said(row, of)}" for row in told]


def _said(row: Row, of: Summary) -> str:
    """In words; older results may lack what they say."""
    try:
        return of.words(row)
    except KeyError:
        return COUNTS.words(row)


def read_plan(group: h5py.Group) -> Plan:
    """Of a sweep's group in results.h5; older ones have no units of keys."""
    over = json.loads(group.attrs["over"])
    return Plan(over, {key: str(group["over"][key].attrs.get("units", "")) for key in over})


def read_landmarks(name: str, group: h5py.Group) -> list[str]:
    """The same from a sweep's group in results.h5."""
    plan, kind = read_plan(group), str(group.attrs["of_type"])
    summary, of = group["summary"], summary_of(kind)
    data = {key: summary[key][()] for key in names_of_data(summary)}
    parts = [{of.split: part} for part in summary[of.split][()]] if of.split in summary else [{}]
    rows = []
    for number, (k, part) in product(range(len(plan)), enumerate(parts)):
        row = {key: float(values.reshape(len(plan), -1)[number, k]) for key, values in data.items()}
        if not math.isnan(row["points"]):
            rows.append({"value": number, **part, **row})
    columns = [replace(c, unit=summary[c.name].attrs["units"]) for c in columns_in(kind, rows)]
    return in_words(name, plan, rows, kind, columns, unit_of_amplitudes(group))


def _part(row: Row, of: Summary) -> str:
    """Which of a value's branches a row is of."""
    return f", {of.split.replace('_', ' ')} {row[of.split]:g}" if of.split in row else ""


def _mode_words(row: Row) -> str:
    unit = row["unit"]
    starts = next((row[key] for key in ("slip_threshold", "slip_from") if math.isfinite(row[key])), None)
    slip = "no slip" if starts is None else f"slip from {starts:.4g} {unit}"
    at = row["amplitude_of_largest_zeta"]
    place = f"at {at:.4g} {unit}" if math.isfinite(at) else "throughout"
    top = f"{'largest ' * math.isfinite(at)}zeta {100 * without_rounding(row['largest_zeta']):.4g} % {place}"
    words = [slip, top, f"lowest {row['lowest_frequency_hz']:.6g} Hz"]
    for word, stable in CYCLES.items():
        amplitude = row.get(f"{word}_limit_cycle", math.nan)  # not all are in older results
        place = f"limit cycle at {amplitude:.4g} {unit}"
        words += [] if math.isnan(amplitude) else [f"{place}, {SHORT[stable]}"]
    return ", ".join(words)


def _forced_words(row: Row) -> str:
    amplitude, frequency, place = row["largest_amplitude"], row["frequency_of_largest_amplitude"], ""
    if row.get("largest_blade", math.nan) >= 0:  # of a wheel, where a blade has a peak
        amplitude, frequency = row["largest_blade_amplitude"], row["largest_blade_frequency_hz"]
        place = f" of sector {row['largest_blade']:.0f}"
    return f"largest {amplitude:.4g} {row['unit']}{place} at {frequency:.6g} Hz"


def _forced_note(rows: Sequence[Row]) -> str:
    """How many responses have no peak within the range: what is told of them, and quantiles, are too small."""
    ended = [row for row in rows if row.get("done", 1) == 1 and not row.get("largest_blade", math.nan) >= 0]
    beyond = sum(row.get("peak_within", 1) == 0 for row in ended)  # not of older results
    if not beyond:
        return ""
    return (
        f"{beyond} of {counted(len(rows), 'response')} move most at an end of the frequency range (peak_within = 0):"
        " their peaks are beyond it, and higher than what is told of them; widen `frequency`"
    )


#: Of one dof, where a wheel has the blade that moves most.
_OF_ONE = tuple(column.name for column in FORCED if column.kind == "f")
#: Amplitudes of a branch that may lie below or above those that it has.
_WITHIN_BRANCH = (
    *("slip_threshold", "stick_until", "slip_from", "onset_amplitude", "amplitude_of_lowest_frequency"),
    *(f"{word}_limit_cycle" for word in CYCLES),
)
MODE_BRANCH = Summary(
    MODE,
    _mode,
    _mode_words,
    on_wheel=WHEEL_MODE,
    spread=("largest_zeta", "last_frequency_hz", "largest_amplification"),
    cut_off=_WITHIN_BRANCH,
)
FLUTTER_WAVES = replace(MODE_BRANCH, split="nodal_diameter")
FORCED_LEVELS = Summary(
    FORCED,
    _forced,
    _forced_words,
    "level",
    WHEEL_FORCED,
    (*_OF_ONE, "largest_blade_amplitude", "largest_blade_frequency_hz", "blade_amplification"),
    note=_forced_note,
)
