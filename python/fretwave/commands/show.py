"""``fretwave show``: the branches of a run in one table, or as JSON.

``--json`` prints one object::

    folder, title, status, ranks, started     of the run; status is done, stopped, running now or not finished
    units                                     name, length, mass, force, energy, pressure of the case
    analyses                                  a list, in the order of the case, each with
        name, type, method, status, reason, points, folds, wall_s, overrides
        changed                               what the last run's case has in another way, of results of an earlier one
        resumes                               is of the last run, with which `fretwave resume` goes on
        unit                                  of amplitudes; wall_s of all points, without start and end of the analysis
        range                                 column, unit, low, high (and cycles of wear)
        peak                                  point (row of <name>.csv) and columns of this row; worn, worn_unit of wear
        error                                 of, value, unit: the largest estimated error
        limit_cycles                          amplitude, frequency_hz, stable (in its own amplitude; null: not known),
                                              runs_back, nodal_diameter, point; of a stable one fed, other linear modes
                                              that gain energy: mode, contact, frequency_hz, zeta
        notes                                 landmarks of a sweep, in lines
    notes                                     the lines below the table that `show` prints

Numbers are those of the tables with all their digits; what is not known is null, a table that an analysis has not is
empty. Of a study: folder, status, solved (runs so far) and table, the rows of study.csv.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..console import on_terminal
from ..files.lock import is_taken
from ..results.file import open_results
from ..results.overview import HEADINGS, Overview, heading, overridden, overviews, recorded, status_of
from ..results.reader import Run
from ..texts import display
from ..units import units_of


def show_run(folder: Path, as_json: bool = False) -> None:
    """Print a table of all analyses, and why any of them stopped early.

    Raises
    ------
    InputError
        The folder has no results.
    """
    record = recorded(folder)
    if "study" in record:
        show = _study_json if as_json else _show_study
        show(folder, record)
        return
    _load_plugins(record)
    title, found = overviews(folder)
    if as_json:
        print(json.dumps(_plain(folder, record, title, found), indent=2, allow_nan=False))
        return
    for line in heading(folder, title):
        print(line)
    rows = [one.cells() for one in found]
    if on_terminal():
        _print_rich(rows)
    else:
        _print_plain([HEADINGS, *rows])
    for note in _notes(found):
        print(note)


def _load_plugins(record: Mapping[str, Any]) -> None:
    """They say what their sweeps tell."""
    if record.get("case", {}).get("plugins"):
        from ..case.plugins import load_recorded

        load_recorded(record)


def _notes(found: list[Overview]) -> list[str]:
    return [*overridden(found), *(line for one in found for line in (*one.notes, *one.lines()))]


def _plain(folder: Path, record: Mapping[str, Any], title: str, found: list[Overview]) -> dict[str, Any]:
    with open_results(folder / "results.h5") as file:
        units = units_of(file.attrs)
    symbols = ("name", "length", "mass", "force", "energy", "pressure")
    return {
        "folder": str(folder),
        "title": title,
        "status": status_of(folder, record),
        "ranks": record.get("ranks"),
        "started": record.get("started"),
        "units": {key: getattr(units, key) for key in symbols},
        "analyses": [one.plain() for one in found],
        "notes": _notes(found),
    }


def _solved(folder: Path) -> int:
    """Runs of a study so far."""
    return len(list((folder / ".runs").glob("task_????.npz")))


def _show_study(folder: Path, record: Mapping[str, Any]) -> None:
    """Its table, or how far it is."""
    if record["status"] == "done" and (folder / "study.md").exists():
        print((folder / "study.md").read_text(encoding="utf-8"), end="")
        return
    goes_on = "it goes on now" if is_taken(folder) else f"`fretwave resume {display(folder)}` goes on with it"
    print(f"study, not finished: {_solved(folder)} runs are solved; {goes_on}")


def _study_json(folder: Path, record: Mapping[str, Any]) -> None:
    """Its table by rows."""
    table = Run(folder).table("study") or {}
    rows = [dict(zip(table, map(_number, values))) for values in zip(*table.values())]
    told = {"folder": str(folder), "status": status_of(folder, record), "solved": _solved(folder), "table": rows}
    print(json.dumps(told, indent=2, allow_nan=False))


def _number(value: np.generic) -> object:
    """Python's own; JSON knows no nan."""
    own = value.item()
    return None if own != own else own


def _print_rich(rows: Sequence[Sequence[str]]) -> None:
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.table import Table

    table = Table(box=SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
    kept = columns_with_text(rows)
    for column in kept:
        right = HEADINGS[column] in ("points", "folds", "error", "time of points")
        table.add_column(HEADINGS[column], justify="right" if right else "left", no_wrap=right)
    for row in rows:
        table.add_row(*(row[column] for column in kept))
    Console().print(table)


def columns_with_text(rows: Sequence[Sequence[str]]) -> list[int]:
    """Columns that tell something: not those that are empty, zero or ``done`` in every row."""
    return [column for column in range(len(HEADINGS)) if any(row[column] not in ("", "0", "done") for row in rows)]


def _print_plain(rows: Sequence[Sequence[str]]) -> None:
    kept = columns_with_text(rows[1:])
    widths = [max(len(row[column]) for row in rows) for column in kept]
    for row in rows:
        print("  ".join(row[column].ljust(width) for column, width in zip(kept, widths)).rstrip())
