"""``fretwave show``: the branches of a run in one table."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..console import on_terminal
from ..files.lock import is_taken
from ..results.file import OVERRIDES, open_results, unit_of_amplitudes
from ..results.record import RECORD, read_record
from ..texts import counted, display
from ..units import UnitSystem, units_of

if TYPE_CHECKING:
    import h5py


HEADINGS = ("analysis", "type", "status", "points", "range", "peak", "folds", "error", "wall")


def show_run(folder: Path) -> None:
    """Print a table of all analyses, and why any of them stopped early.

    Raises
    ------
    InputError
        The folder has no results.
    """
    record = read_record(folder) if (folder / RECORD).exists() else {}
    if "study" in record:
        _show_study(folder, record)
        return
    if record.get("case", {}).get("plugins"):  # they say what their sweeps tell
        from ..case.plugins import load_recorded

        load_recorded(record)
    with open_results(folder / "results.h5") as file:
        title = str(file.attrs.get("title", ""))
        names = [name for name in _in_order(folder, list(file)) if "type" in file[name].attrs]
        rows = [describe(name, file[name]) for name in names]
        changed = {name: str(file[name].attrs.get(OVERRIDES, "")) for name in names}
        notes = [note for name in names for note in _notes(name, file[name])]
    for line in _heading(folder, title):
        print(line)
    if on_terminal():
        _print_rich(rows)
    else:
        _print_plain([HEADINGS, *rows])
    for note in [*_overridden(changed), *notes]:
        print(note)


def _overridden(changed: Mapping[str, str]) -> list[str]:
    """What was not as in the case file; said once where it is the same for all analyses."""
    if len(changed) > 1 and len(set(changed.values())) == 1:
        changed = {"all": next(iter(changed.values()))}
    return [f"{name}: with {text}" for name, text in changed.items() if text]


def _show_study(folder: Path, record: Mapping[str, Any]) -> None:
    """Its table, or how far it is."""
    if record["status"] == "done" and (folder / "study.md").exists():
        print((folder / "study.md").read_text(encoding="utf-8"), end="")
        return
    solved = len(list((folder / ".runs").glob("task_????.npz")))
    goes_on = "it goes on now" if is_taken(folder) else f"`fretwave resume {display(folder)}` goes on with it"
    print(f"study, not finished: {solved} runs are solved; {goes_on}")


def _in_order(folder: Path, names: list[str]) -> list[str]:
    """Analyses in the order of the case."""
    keys = read_record(folder)["case"]["resolved"] if (folder / RECORD).exists() else {}
    order = list(dict.fromkeys(key.split(".")[0] for key in keys))
    return sorted(names, key=lambda name: order.index(name) if name in order else len(order))


def _heading(folder: Path, title: str) -> list[str]:
    if not (folder / RECORD).exists():
        return [title] if title else []
    record = read_record(folder)
    ranks = counted(record["ranks"], "rank")
    started = record["started"][:16].replace("T", " ")
    going = "running now" if is_taken(folder) else "not finished"
    status = going if record["status"] == "running" else record["status"]
    return [line for line in (title, f"{status}, {ranks}, started {started}") if line]


def describe(name: str, group: h5py.Group) -> tuple[str, ...]:
    """One row of the table."""
    points, unit = group["points"], unit_of_amplitudes(group)
    table = {key: points[key][()] for key in points}
    kind = str(group.attrs["type"])
    method = group.attrs.get("method")
    return (
        name,
        f"{kind} {method}" if method else kind.replace("_", " "),
        str(group.attrs["status"]),
        str(len(next(iter(table.values())))),
        _range(table, unit),
        _largest(table, unit, units_of(group.attrs)),
        str(_count(table, "fold")) if "event" in table else "",
        _error(table, unit),
        f"{table['wall_s'].sum():.2f} s" if "wall_s" in table else "",
    )


def _error(table: dict[str, Any], unit: str) -> str:
    """The largest estimated one, where there is one."""
    for name, text in (("zeta_error", "{:.2g} % zeta"), ("amplitude_error", "{:.2g} " + unit)):
        found = table.get(name, np.empty(0))
        if np.isfinite(found).any():
            return text.format((100 if "%" in text else 1) * np.nanmax(found))
    return ""


def _range(table: dict[str, Any], of_amplitude: str) -> str:
    over_frequency = "level" in table or "other_hz" in table  # responses, linear modes
    key, unit = ("frequency_hz", "Hz") if over_frequency else ("amplitude", of_amplitude)
    values = table.get(key, np.empty(0))
    if not len(values):
        return ""
    one = "cycles" in table and np.ptp(values) <= 1e-9 * values.max()
    text = f"{values.max():.4g} {unit}" if one else f"{values.min():.4g} - {values.max():.4g} {unit}"
    return f"{text}, {table['cycles'].max():.4g} cycles" if "cycles" in table else text


def _largest(table: dict[str, Any], unit: str, units: UnitSystem) -> str:
    if "zeta" in table and "omega0" in table and len(table["zeta"]):
        top = int(np.argmax(table["zeta"]))
        if "cycles" in table:
            factor, cubic = units.of_volumes
            worn = factor * np.sum([table[name] for name in table if name.startswith("worn_")], axis=0).max()
            return f"zeta {100 * table['zeta'][top]:.3g} %, {table['cycles'][top]:.3g} cycles; worn {worn:.3g} {cubic}"
        return f"zeta {100 * table['zeta'][top]:.3g} %, {table['amplitude'][top]:.4g} {unit}"
    if "level" in table and len(table["amplitude"]):
        top = int(np.argmax(table["amplitude"]))
        return f"a {table['amplitude'][top]:.4g} {unit}, {table['frequency_hz'][top]:.4g} Hz"
    return ""


def _count(table: dict[str, Any], event: str) -> int:
    return sum(event in text.decode().split() for text in table["event"])


def _wave(cycle: Mapping[str, Any]) -> str:
    """Which of several waves has a limit cycle."""
    return f"nodal diameter {cycle['nodal_diameter']}, " if "nodal_diameter" in cycle else ""


def _notes(name: str, group: h5py.Group) -> list[str]:
    """Limit cycles, and why an analysis is not complete."""
    words = {True: "stable", False: "unstable", None: "stability unknown"}
    if group.attrs["type"] == "sweep":
        from ..results.sweep_summary import read_landmarks

        notes = read_landmarks(name, group)
    else:
        notes = []
    unit = unit_of_amplitudes(group)
    notes += [
        f"{name}: {_wave(cycle)}limit cycle at a = {cycle['amplitude']:.5g} {unit},"
        f" {cycle['frequency_hz']:.5g} Hz: " + words[cycle["stable"]]
        for cycle in json.loads(group.attrs.get("events", "[]"))
    ]
    status, reason = str(group.attrs["status"]), str(group.attrs["reason"])
    if status == "running":
        notes.append(f"{name}: not finished; `fretwave resume` goes on with it when it is cut off")
    return [*notes, f"{name}: stopped early: {reason}"] if status == "stopped" else notes


def _print_rich(rows: Sequence[Sequence[str]]) -> None:
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.table import Table

    table = Table(box=SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
    kept = _columns_with_text(rows)
    for column in kept:
        right = HEADINGS[column] in ("points", "folds", "error", "wall")
        table.add_column(HEADINGS[column], justify="right" if right else "left", no_wrap=right)
    for row in rows:
        table.add_row(*(row[column] for column in kept))
    Console().print(table)


def _columns_with_text(rows: Sequence[Sequence[str]]) -> list[int]:
    """Columns that tell something: not those that are empty, zero or ``done`` in every row."""
    return [column for column in range(len(HEADINGS)) if any(row[column] not in ("", "0", "done") for row in rows)]


def _print_plain(rows: Sequence[Sequence[str]]) -> None:
    kept = _columns_with_text(rows[1:])
    widths = [max(len(row[column]) for row in rows) for column in kept]
    for row in rows:
        print("  ".join(row[column].ljust(width) for column, width in zip(kept, widths)).rstrip())
