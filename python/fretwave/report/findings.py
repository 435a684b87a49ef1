"""What the tables of a run say: the rows of interest of each analysis, every number one of its table."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from ..arrays import Indices
from ..post.grid import Plan
from ..post.largest import largest
from ..post.limit_cycles import SHORT
from ..post.mode_curve import varies
from ..results.analysis import Analysis
from ..results.overview import Overview, peak_row, whose_amplitude
from ..results.parts import rows_of_branches
from ..results.sweep_summary import columns_of
from ..results.sweeps import parts_of, read_branch
from . import page

#: Columns shown of a row, in this order, where a table has them.
SHOWN = (
    *("value", "level", "nodal_diameter", "line", "start", "factor", "pair", "cycle", "cycles", "time"),
    *(
        "speed_rpm",
        "amplitude",
        "largest_amplitude",
        "frequency_hz",
        "other_hz",
        "omega_error",
        "zeta",
        "phase",
        "stick",
        "slip",
        "open",
    ),
    *("normal_force", "tangential_force", "gap", "work", "force_outside"),
)
#: Of columns whose names say too little, or their unit again.
HEADINGS = {"frequency_hz": "frequency", "other_hz": "frequency of the mode most like it, sliding or free"}
#: Shares, shown in percent.
PERCENT = ("zeta", "zeta_error", "stick", "slip", "open", "force_outside", "zeta_mode")
#: Digits of columns of which fewer than all say enough.
DIGITS = {"stick": 4, "slip": 4, "open": 4, "force_outside": 2}
#: Of the summary of a branch: what is no row of its table.
DERIVED = ("stuck_hz", "free_hz", "slip_threshold", "onset_amplitude")
MOST_ROWS, MOST_FOLDS = 60, 8

#: Words on rows that are left out first.
PLAIN = ("first row", "last row", "last before any slip", "largest error", "fold")

Marks = dict[int, list[str]]


def points_table(analysis: Analysis, overview: Overview) -> str:
    """The rows of interest, with what each is."""
    marks, more = _chosen(marked(analysis, overview))
    swept = _swept(analysis)
    without = {"value"} if swept else {"force_outside"} if "cycles" in analysis.columns else set()
    others = [name for name in SHOWN if name not in without]
    names = [*swept, *others, *(name for name in analysis.columns if name.startswith("worn_"))]
    names = [name for name in names if name in analysis.columns and _tells(analysis, name, marks)]
    head = ["what", "row", *(_heading(analysis, name) for name in names)]
    rows = [
        ["; ".join(words), str(row), *(_number(analysis, name, row) for name in names)] for row, words in marks.items()
    ]
    return page.table(head, rows) + more if rows else ""


def _chosen(marks: Marks) -> tuple[Marks, str]:
    """Of a table with very many branches those rows that matter most, and a line that says so."""
    if len(marks) <= MOST_ROWS:
        return marks, ""
    telling = {row: words for row, words in marks.items() if set(words) - set(PLAIN)}
    shown = dict(list((telling or marks).items())[:MOST_ROWS])
    said = f"{len(shown)} of {len(marks)} rows that might be asked for are shown; the table has all."
    return shown, page.tag("p", said, "soft")


def _swept(analysis: Analysis) -> list[str]:
    """Keys of a sweep."""
    over = analysis.attributes.get("over", {})
    return Plan(over).keys if isinstance(over, Mapping) else []


def _tells(analysis: Analysis, name: str, marks: Marks) -> bool:
    """A column that is known at some of the rows; a share that is not zero at all of them."""
    values = analysis[name][list(marks)]
    return bool(np.isfinite(values).any() and (name not in DIGITS or np.any(values)))


def _heading(analysis: Analysis, name: str) -> str:
    unit = "%" if name in PERCENT else analysis.unit(name)
    words = HEADINGS.get(name, name.rpartition(".")[2].replace("_", " "))
    return f"{words} [{unit}]" if unit else words


def _number(analysis: Analysis, name: str, row: int) -> page.Number:
    """A cell of the table, with its error where there is a column of it."""
    value, scale = float(analysis[name][row]), 100.0 if name in PERCENT else 1.0
    of = f"{name}_error"
    error = _number(analysis, of, row) if of in analysis.columns else None
    digits = 2 if name.endswith("_error") else DIGITS.get(name, 6)
    return page.Number(f"{analysis.name}/{name}/{row}", value, scale, digits, error)


def marked(analysis: Analysis, overview: Overview) -> Marks:
    """Words on rows of interest by row, in the order of the table."""
    found: Marks = {}
    for rows in rows_of_branches(analysis.columns):
        for row, word in _of_branch(analysis, rows):
            found.setdefault(row, []).append(word)
        for row in analysis.met("fold")[:MOST_FOLDS]:
            if row in rows:
                found.setdefault(row, []).append("fold")
        for cycle in overview.limit_cycles:
            if cycle.get("point") in rows:
                found.setdefault(int(cycle["point"]), []).append(f"limit cycle, {SHORT[cycle['stable']]}")
    return dict(sorted(found.items()))


def _of_branch(analysis: Analysis, rows: Indices) -> Iterator[tuple[int, str]]:
    """Rows of one branch that a reader asks for."""
    columns = analysis.columns
    # Linear modes: those of the first limit have beside them what they become.
    if "contact" in analysis.words and "mode" in columns:
        own = rows[analysis["contact"][rows] == analysis["contact"][0]]
        rigid = np.where(columns["frequency_hz"] == 0.0, ", rigid", "")
        yield from (
            (int(row), f"{analysis['contact'][row]}, mode {columns['mode'][row]:.0f}{rigid[row]}") for row in own
        )
        return
    yield int(rows[0]), "first row"
    if "slip" in columns and "amplitude" in columns:
        slips = np.flatnonzero(columns["slip"][rows] > 0)
        if len(slips) and slips[0] > 0:
            yield int(rows[slips[0] - 1]), "last before any slip"
            yield int(rows[slips[0]]), "first with slip"
    top = peak_row(columns, rows)
    if top is not None and ("level" in columns or varies(columns, rows)):
        yield top, "largest damping" if "zeta" in columns else f"largest amplitude{whose_amplitude(columns)}"
    for name in ("normal_force", "tangential_force") if "level" not in columns else ():
        # of a law without a normal direction none is known, of one without friction all are zero
        if name in columns and np.any(columns[name][rows] > 0):
            yield int(rows[largest(columns[name][rows])]), f"largest {name.replace('_', ' ')}"
    for name in ("zeta_error", "amplitude_error"):
        errors = columns.get(name, np.empty(0))
        if len(errors) and np.isfinite(errors[rows]).any():
            yield int(rows[np.nanargmax(errors[rows])]), "largest error"
    yield int(rows[-1]), "last row"


def derived_table(analysis: Analysis) -> str:
    """Of each branch what is no row of its table: linear frequencies, the threshold of slip, the onset of damping."""
    if analysis.kind == "sweep":
        return ""
    branch = read_branch(analysis.path.parent, analysis.name, 0, str(analysis.attributes.get("run_id")))
    if branch is None or not branch.points:
        return ""
    found = list(parts_of(analysis.kind, branch))
    columns = [c for c in columns_of(analysis.kind) if c.name in DERIVED]
    columns = [c.as_amplitude(analysis.units.get("amplitude", c.unit)).in_units(analysis.unit_system) for c in columns]
    known = [c for c in columns if any(np.isfinite(values[c.name]) for _, values in found)]
    if len(found) == 1:
        ((_, values),) = found
        return page.facts((c.long_name, f"{page.shown(values[c.name])} {c.symbol}") for c in known)
    head = [*(name.replace("_", " ") for name in found[0][0]), *(f"{c.long_name} [{c.symbol}]" for c in known)]
    rows = [
        [*(f"{v:g}" for v in part.values()), *(page.shown(values[c.name]) for c in known)] for part, values in found
    ]
    return page.table(head, rows) if known else ""
