"""What a run found, analysis by analysis, in a few values: `fretwave show` prints them, reports begin with them."""

from __future__ import annotations

import json
from collections.abc import Container, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Indices
from ..files.lock import is_taken
from ..post.largest import largest
from ..post.limit_cycles import place, stability
from ..post.mode_curve import most_damped, without_rounding
from ..texts import counted, without_nan
from ..units import units_of
from .file import OVERRIDES, open_results, unit_of_amplitudes
from .record import RECORD, read_record
from .stamp import changed_since, stamp_of

if TYPE_CHECKING:
    import h5py

HEADINGS = ("analysis", "type", "status", "points", "range", "peak", "folds", "error", "time of points")
Values = Mapping[str, Any]
#: What is below this share of the largest of a range is rounding.
ZERO = 1e-12


@dataclass(frozen=True)
class Overview:
    """One analysis in a few values; those that it has not are left out.

    Attributes
    ----------
    kind, method : of the analysis, as the case names them
    status : ``done``, ``stopped`` or ``running`` (also of one that was cut off); `reason` in the solver's words
    unit : of amplitudes
    range : column, unit, low, high, and `cycles` of wear
    peak : what is largest and where: `point` is the row of the table, all else its columns
    folds : number of them, None of a table without events
    error : the largest estimated one: column, value, unit, and whether the reduction's share is not known
    limit_cycles : amplitude, frequency_hz, stable in its own amplitude (None: not known), nodal_diameter where there
        are several waves, fed (other linear modes that gain energy by themselves) of a stable one
    overrides : what the command line changed, as it was typed
    changed : what the case of the last run has in another way, where these results are of an earlier one
    notes : what else is said, in lines
    peak_beyond : the largest amplitude of a response is at an end of its range
    resumes : of the last run, with which `fretwave resume` goes on
    """

    name: str
    kind: str
    method: str
    status: str
    reason: str
    points: int
    unit: str
    range: Values
    peak: Values
    folds: int | None
    error: Values
    wall_s: float | None
    limit_cycles: list[dict[str, Any]] = field(default_factory=list)
    overrides: str = ""
    changed: str = ""
    notes: list[str] = field(default_factory=list)
    peak_beyond: bool = False
    resumes: bool = True

    def cells(self) -> tuple[str, ...]:
        """Its row of the table, under `HEADINGS`."""
        return (
            self.name,
            f"{self.kind} {self.method}" if self.method else self.kind.replace("_", " "),
            self.status,
            str(self.points),
            self._range(),
            self._peak(),
            "" if self.folds is None else str(self.folds),
            self._error(),
            "" if self.wall_s is None else f"{self.wall_s:.2f} s",
        )

    def lines(self) -> list[str]:
        """What is said below the table: landmarks, limit cycles, and why it is not complete."""
        return [f"{self.name}: {text}" for text in (*self._cycles(), *self._ending())]

    def plain(self) -> dict[str, Any]:
        """For JSON: numbers as they are in the tables, null where there is none."""
        told = {key: value for key, value in vars(self).items() if key != "kind"}
        return {"name": told.pop("name"), "type": self.kind, **{k: without_nan(v) for k, v in told.items()}}

    def _range(self) -> str:
        if not self.range:
            return ""
        low, high, unit = (self.range[key] for key in ("low", "high", "unit"))
        one = "cycles" in self.range and high - low <= 1e-9 * high
        low = 0.0 if abs(low) < ZERO * abs(high) else low  # rigid motions
        text = f"{high:.4g} {unit}" if one else f"{low:.4g} - {high:.4g} {unit}"
        return f"{text}, {self.range['cycles']:.4g} cycles" if "cycles" in self.range else text

    def _peak(self) -> str:
        top = self.peak
        if "worn" in top:
            damping = f"zeta {100 * without_rounding(top['zeta']):.3g} %, {top['cycles']:.3g} cycles"
            return f"{damping}; worn {top['worn']:.3g} {top['worn_unit']}"
        if "zeta" in top:
            return f"zeta {100 * without_rounding(top['zeta']):.3g} %, {top['amplitude']:.4g} {self.unit}"
        if not top:
            return ""
        sector = f" of sector {top['largest_sector']:.0f}" if "largest_sector" in top else ""
        beyond = " (at an end of the range: the peak is beyond)" if self.peak_beyond else ""
        return f"a {top[amplitude_column(top)]:.4g} {self.unit}{sector}, {top['frequency_hz']:.4g} Hz{beyond}"

    def _error(self) -> str:
        if not self.error:
            return ""
        value, lacks = self.error["value"], " without the reduction's" if self.error["without_reduction"] else ""
        if self.error["of"] == "zeta":
            return f"{100 * value:.2g} % zeta{lacks}"
        return f"{value:.2g} {self.error['unit']}{lacks}"

    def _cycles(self) -> list[str]:
        return [
            f"{_wave(cycle)}limit cycle at {place(cycle, self.unit)}: {stability(cycle)}" for cycle in self.limit_cycles
        ]

    def _ending(self) -> list[str]:
        if self.status == "running":
            anew = f"not finished, and not of the last run: `fretwave run CASE --only {self.name}` does it anew"
            return ["not finished; `fretwave resume` goes on with it when it is cut off" if self.resumes else anew]
        return [f"stopped early: {self.reason}"] if self.status == "stopped" else []


def _wave(cycle: Mapping[str, Any]) -> str:
    """Which of several waves has a limit cycle."""
    return f"nodal diameter {cycle['nodal_diameter']}, " if "nodal_diameter" in cycle else ""


def overview_of(name: str, group: h5py.Group, record: Values = MappingProxyType({})) -> Overview:
    """Of an analysis' group of the results; `record` is that of the last run in its folder."""
    table, unit = {key: data[()] for key, data in group["points"].items()}, unit_of_amplitudes(group)
    attributes = group.attrs
    return Overview(
        name=name,
        kind=str(attributes["type"]),
        method=str(attributes.get("method", "")),
        status=str(attributes["status"]),
        reason=str(attributes["reason"]),
        points=len(next(iter(table.values()))),
        unit=unit,
        range=_range(table, unit),
        peak=_peak(table, group),
        folds=sum("fold" in text.decode().split() for text in table["event"]) if "event" in table else None,
        error=_error(table, unit),
        wall_s=float(table["wall_s"].sum()) if "wall_s" in table else None,
        limit_cycles=json.loads(attributes.get("events", "[]")),
        overrides=str(attributes.get(OVERRIDES, "")),
        changed=changed_since(stamp_of(attributes), record.get("case", {}).get("resolved", {})),
        notes=_landmarks(name, group),
        peak_beyond="over" not in group and _peak_beyond(table),
        resumes=attributes.get("run_id") == record.get("run_id"),
    )


def _range(table: Mapping[str, Any], unit: str) -> dict[str, Any]:
    over_frequency = "level" in table or "other_hz" in table  # responses, linear modes
    column, unit = ("frequency_hz", "Hz") if over_frequency else ("amplitude", unit)
    values = table.get(column, np.empty(0))
    if not len(values):
        return {}
    cycles = {"cycles": float(table["cycles"].max())} if "cycles" in table else {}
    return {"column": column, "unit": unit, "low": float(values.min()), "high": float(values.max()), **cycles}


def amplitude_column(table: Container[str]) -> str:
    """Of a whole wheel's response that of the sector that moves most."""
    return "largest_amplitude" if "largest_amplitude" in table else "amplitude"


def whose_amplitude(table: Container[str]) -> str:
    """Behind the word amplitude: nothing of the observed dof."""
    return "" if amplitude_column(table) == "amplitude" else " of any sector"


def peak_row(table: Mapping[str, Any], rows: Indices | None = None) -> int | None:
    """Row of the largest damping of a mode, of the largest amplitude of a response; None where there is neither.

    Parameters
    ----------
    rows : those looked at; None for all
    """
    of = "zeta" if "zeta" in table and "omega0" in table else amplitude_column(table) if "level" in table else None
    if of is None:
        return None
    values = np.asarray(table[of], dtype=float)
    rows = np.arange(len(values)) if rows is None else rows
    top = most_damped if of == "zeta" else largest
    return int(rows[top(values[rows])]) if np.isfinite(values[rows]).any() else None


def _peak(table: Mapping[str, Any], group: h5py.Group) -> dict[str, Any]:
    top = peak_row(table)
    if top is None:
        return {}
    wanted = (
        *("zeta", "zeta_error", "level", "cycles", "amplitude", "amplitude_error"),
        *("largest_amplitude", "largest_sector", "frequency_hz", "omega_error"),
    )
    found: dict[str, Any] = {"point": top, **{key: float(table[key][top]) for key in wanted if key in table}}
    if "cycles" in table:
        factor, found["worn_unit"] = units_of(group.attrs).of_volumes
        found["worn"] = float(factor * np.sum([table[key] for key in table if key.startswith("worn_")], axis=0).max())
    return found


def _peak_beyond(table: Mapping[str, Any]) -> bool:
    """Of a run; in a table of a sweep branches of several values have one level."""
    top = peak_row(table) if "level" in table else None
    if top is None:
        return False
    rows = np.flatnonzero(table["level"] == table["level"][top])
    return not rows[0] < top < rows[-1]


def _error(table: Mapping[str, Any], unit: str) -> dict[str, Any]:
    """The largest estimated one, where there is one."""
    for of, symbol in (("zeta", "1"), ("amplitude", unit)):
        found = table.get(f"{of}_error", np.empty(0))
        known = np.isfinite(found)
        if known.any():
            shares = [values[known] for name, values in table.items() if name.endswith("_error_reduction")]
            lacks = bool(np.isnan(shares).any())  # the reduction's share, where it is not known
            return {"of": of, "value": float(np.nanmax(found)), "unit": symbol, "without_reduction": lacks}
    return {}


def _landmarks(name: str, group: h5py.Group) -> list[str]:
    if group.attrs["type"] != "sweep":
        return []
    from .sweep_summary import read_landmarks

    return read_landmarks(name, group)


def recorded(folder: Path) -> dict[str, Any]:
    """run.json, empty where there is none."""
    return read_record(folder) if (folder / RECORD).exists() else {}


def overviews(folder: Path) -> tuple[str, list[Overview]]:
    """Title of the case, and its analyses in the order of the case, unfinished ones among them.

    Raises
    ------
    InputError
        The folder has no results.
    """
    with open_results(folder / "results.h5") as file:
        names = [name for name in in_order(folder, list(file)) if "type" in file[name].attrs]
        record = recorded(folder)
        return str(file.attrs.get("title", "")), [overview_of(name, file[name], record) for name in names]


def in_order(folder: Path, names: list[str]) -> list[str]:
    """Analyses in the order of the case."""
    record = recorded(folder)
    keys = record["case"]["resolved"] if record else {}
    order = list(dict.fromkeys(key.split(".")[0] for key in keys))
    return sorted(names, key=lambda name: order.index(name) if name in order else len(order))


def status_of(folder: Path, record: Mapping[str, Any]) -> str:
    """Of a run: ``done``, ``stopped``, ``running now``, ``not finished``; empty without a record."""
    going = "running now" if is_taken(folder) else "not finished"
    return "" if not record else going if record["status"] == "running" else str(record["status"])


def heading(folder: Path, title: str) -> list[str]:
    """Title and status of a run, in lines."""
    record = recorded(folder)
    if not record:
        return [title] if title else []
    started = record["started"][:16].replace("T", " ")
    status = f"{status_of(folder, record)}, {counted(record['ranks'], 'rank')}, started {started}"
    return [line for line in (title, status) if line]


def overridden(found: list[Overview]) -> list[str]:
    """What was not as in the case file, or is not any more; said once where it is the same for several analyses."""
    return [
        f"{names}: {words} {text}"
        for words, texts in (
            ("with", {one.name: one.overrides for one in found}),
            ("results of an earlier case, with", {one.name: one.changed for one in found}),
        )
        for text, names in _by_text(texts)
    ]


def _by_text(texts: Mapping[str, str]) -> list[tuple[str, str]]:
    """Each text with the names of the analyses that have it, or ``all``; not the empty one."""
    found: dict[str, list[str]] = {}
    for name, text in texts.items():
        found.setdefault(text, []).append(name)
    every = len(found) == 1 and len(texts) > 1
    return [(text, "all" if every else ", ".join(names)) for text, names in found.items() if text]
