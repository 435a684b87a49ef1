"""``fretwave probe``: contact pairs, a node or a dof at one point of a branch."""

from __future__ import annotations

import argparse
import csv
import sys
from collections.abc import Iterator, Mapping, Sequence
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..case.kept import refuse_sweep
from ..columns import Column
from ..errors import InputError
from ..files.csv_table import table_text
from ..files.whole import replace_text
from ..results.file import open_results
from ..results.overview import recorded
from ..results.pair_table import pair_table
from ..results.reader import Run
from ..texts import counted, display
from ..view.at import At, analysis_with
from ..view.node import NodeMotion, of_dof, of_node
from ..view.points import kept_points

if TYPE_CHECKING:
    import h5py

#: Harmonics below this share of the largest are not printed; a CSV has all.
SMALL = 1e-6
#: Values below this share of the largest are rounding, and printed as zero.
ZERO = 1e-12


def probe(options: argparse.Namespace) -> None:
    """Print what is asked for, or write it as CSV. One rank only.

    Raises
    ------
    InputError
        There is no such analysis, point, node or dof, or an option that does nothing to what is asked for.
    """
    folder: Path = options.folder
    _check_effect(options)
    refuse_sweep(folder, recorded(folder))
    at = At.read(options.at)
    if options.pairs:
        _pairs(folder, options.analysis, at, options.out)
        return
    with open_results(folder / "results.h5") as file:
        name = analysis_with(file, folder, options.analysis, lambda group: "coefficients" in group, "harmonics")
        point, said = at.point(file[name], None, _where(name, folder))
        line = _point_line(file[name], name, point, said)
        found = None if options.dof is None else of_dof(file[name], folder, options.dof, point)
    moved = of_node(folder, name, options.node, point, options.sector or 0) if found is None else found
    _show_motion(moved, line, options)


def _check_effect(options: argparse.Namespace) -> None:
    """What is of a node or a dof alone is not of pairs: their table would look as if it were."""
    if options.sector is not None and options.node is None:
        measured = "--pairs has all sectors" if options.pairs else "a dof is of the sector in its name"
        raise InputError("the sector is that of a node", "--sector", measured, "--node beside it", "leave it out")
    if options.steps is not None and options.pairs:
        what, fix = "the table of the pairs is of a whole period", "leave it out"
        raise InputError(what, "--steps", options.steps, "--node or --dof beside it", fix)


def _where(name: str, folder: Path) -> str:
    return f"analysis '{name}' in {display(folder)}"


def _pairs(folder: Path, asked: str | None, at: At, out: Path | None) -> None:
    """The table of the pairs, as CSV."""

    def has(group: h5py.Group) -> bool:
        return any(key.startswith("contact_") for key in group)

    with open_results(folder / "results.h5") as file:
        name = analysis_with(file, folder, asked, has, "motion of contact pairs")
        point, said = at.point(file[name], kept_points(file[name]), _where(name, folder))
        line = _point_line(file[name], name, point, said)
    columns, rows = pair_table(Run(folder)[name], point)
    _write(_csv(columns, rows), [line], out)


def _point_line(group: h5py.Group, name: str, point: int, said: str) -> str:
    """Which point it is."""
    table = group["points"]
    unit, of_any = table["amplitude"].attrs.get("units", ""), "largest_amplitude" in table
    values = [f"{name}: point {point}"]
    if "contact" in table:  # of a linear analysis
        values.append(f"contact {table['contact'][point].decode()}")
    for column, text, scale in (
        ("nodal_diameter", "nodal diameter {:g}", 1.0),
        ("mode", "mode {:g}", 1.0),
        ("level", "level {:g}", 1.0),
        ("cycles", "{:.4g} cycles", 1.0),
        ("amplitude", f"amplitude {{:.6g}} {unit}", 1.0),
        ("largest_amplitude", f"largest of all sectors {{:.6g}} {unit}", 1.0),
        ("largest_sector", f"{'in ' * of_any}sector {{:g}}{' moves most' * (not of_any)}", 1.0),
        ("frequency_hz", "{:.6g} Hz", 1.0),
        ("zeta", "zeta {:.4g} %", 100.0),
    ):
        if column in table:
            values.append(text.format(scale * table[column][point]).strip())
    return ", ".join(values) + said


def _show_motion(moved: NodeMotion, line: str, options: argparse.Namespace) -> None:
    said = [line, *moved.note.splitlines()]
    if options.steps is not None:
        _write(_period_csv(moved, options.steps), [*said, moved.what], options.out)
    elif options.csv or options.out is not None:
        _write(_csv(moved.columns(), moved.rows()), [*said, moved.what], options.out)
    else:
        print("\n".join([*said, *_screen(moved)]))


def _csv(columns: Sequence[Column], rows: Sequence[Mapping[str, Any]]) -> str:
    return table_text(columns, ({c.name: row.get(c.name, _missing(c)) for c in columns} for row in rows))


def _missing(column: Column) -> Any:
    """Of a contact whose law does not know it."""
    return "" if column.kind == "s" else np.nan


def _period_csv(moved: NodeMotion, steps: int) -> str:
    """Displacement over the period."""
    if steps < 1:
        raise InputError("a period has no instants", "--steps", steps, ">= 1", "--steps 64")
    columns = [Column("period", "1", "share of the period that has passed")]
    columns += [Column(name, "length", f"displacement along {name}") for name in moved.directions]
    values = moved.over_period(steps)
    rows = [{"period": k / steps, **dict(zip(moved.directions, x))} for k, x in enumerate(values)]
    return _csv([column.in_units(moved.units) for column in columns], rows)


def _write(text: str, said: Sequence[str], out: Path | None) -> None:
    """CSV to a file; or to standard output, what it is of beside it, so that a pipe gets the table alone."""
    if out is None:
        print("\n".join(said), file=sys.stderr)
        sys.stdout.write(text)
        return
    replace_text(out, text)
    rows = sum(1 for _ in csv.reader(StringIO(text))) - 1
    print("\n".join([*said, f"{display(out)}: {counted(rows, 'row')}"]))


def _screen(moved: NodeMotion) -> Iterator[str]:
    """Amplitude and phase of the harmonics that count, and the extremes of the period."""
    rows, names = moved.rows(), moved.directions
    largest = max(_size(row, moved) for row in rows)
    shown = [row for row in rows if not row["harmonic"] or _size(row, moved) >= SMALL * largest]
    yield f"{moved.what}, amplitude [{moved.units('length')}] (of harmonic 0 the mean) and phase of a cosine [deg]"
    yield f"{'harmonic':>8}{'Hz':>12}" + "".join(f"{name:>12}{'phase':>9}" for name in names)
    for row in shown:
        cells = [_cell(row[f"{name}_amplitude"], row[f"{name}_phase_deg"], largest, row["harmonic"]) for name in names]
        yield f"{row['harmonic']:8d}{row['frequency_hz']:12.6g}{''.join(cells)}".rstrip()
    if len(shown) < len(rows):
        yield f"{counted(len(rows) - len(shown), 'further harmonic')} below {SMALL:.0e} of the largest: --csv has all"
    path = moved.over_period(1024)
    for word, values in (("least", path.min(axis=0)), ("largest", path.max(axis=0))):
        yield f"{word:>8}{'':>12}{''.join(_cell(value, 0.0, largest, 0) for value in values)}".rstrip()


def _size(row: Mapping[str, float], moved: NodeMotion) -> float:
    return max(abs(row[f"{name}_amplitude"]) for name in moved.directions)


def _cell(value: float, phase: float, largest: float, harmonic: float) -> str:
    """Amplitude and phase; what is rounding is zero."""
    if abs(value) < ZERO * largest:
        return f"{'0':>12}{'':>9}"
    return f"{value:12.4g}" + (f"{round(phase, 2) + 0.0:9.2f}" if harmonic else f"{'':>9}")
