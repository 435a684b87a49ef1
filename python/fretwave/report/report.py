"""``fretwave report``: one HTML file that says what a run is of, how it was computed, what came out, how sure it is.

It is made of what the run's folder holds (run.json, results.h5 or journals, run.log, pictures) and of the copy of its
case there. Neither MPI nor PETSc is needed, and nothing is solved.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from ..case.plugins import load_recorded
from ..files.whole import replace_text
from ..results.file import journals_made_once
from ..results.overview import HEADINGS, Overview, overridden, overviews, status_of
from ..results.reader import Run
from ..results.results import has_results
from ..results.runfolder import read_record
from ..results.stamp import stamp_of
from ..texts import counted, display, own_version
from ..units import SI
from . import page
from .findings import derived_table, points_table
from .gauges import gauges_part
from .log import log_lines, shortened_log, warnings_of
from .model import model_part, read_case
from .pictures import Picture, pictures
from .provenance import provenance
from .settings import settings_part

NAME = "report.html"


def report_run(folder: Path, out: Path | None = None) -> Path:
    """Write the page of a run, done or not; returns its path. One rank only.

    Raises
    ------
    InputError
        The folder holds no run, or its results are damaged.
    FileError
        The disk does not take it.
    """
    path = out or folder / NAME
    with journals_made_once():
        text = report_text(folder)
    replace_text(path, text)
    return path


def report_text(folder: Path) -> str:
    """The page."""
    record = read_record(folder)
    failed = load_recorded(record)
    run = Run(folder)
    title, found = overviews(folder) if has_results(folder) else ("", [])
    images = pictures(run, failed)
    log = log_lines(folder, [*record["selected"], *run.analyses])
    title = title or str(record["case"]["resolved"].get("title", "")) or Path(record["case"]["path"]).parent.name
    parts = [
        _top(folder, title, record, found),
        _summary(folder, found),
        _warnings([*warnings_of(log), *failed], record, found),
        _model(run, record),
        _checks([line for line in log if not line.startswith(tuple(f"{one.name}: " for one in found))]),
        *_analyses(run, record, found, images, log),
        _others(run, images),
        page.section("What it was made with", "made", provenance(folder, record)),
    ]
    return page.page(title, f"fretwave {own_version()}", parts)


def _top(folder: Path, title: str, record: Mapping[str, Any], found: Sequence[Overview]) -> str:
    status = status_of(folder, record)
    started = record["started"][:16].replace("T", " ")
    machine = f"{counted(record['ranks'], 'MPI rank')} on {record.get('host', 'a machine without a name')}"
    version = f"fretwave {record.get('versions', {}).get('fretwave', 'of unknown version')}"
    said = f"{display(folder)}, started {started}, {machine}, {version}"
    mark = page.tag("span", page.text(status), "status" if status == "done" else "status bad")
    links = {"summary": "Summary", "model": "Model", "checks": "Checks", **{f"a-{one.name}": one.name for one in found}}
    anchors = [
        f'<a href="#{page.text(key)}">{page.text(text)}</a>' for key, text in {**links, "made": "Made with"}.items()
    ]
    return "\n".join(
        [
            page.tag("h1", page.text(title)),
            page.tag("p", f"{mark} {page.text(said)}"),
            page.tag("nav", " ".join(anchors)),
        ]
    )


def _summary(folder: Path, found: Sequence[Overview]) -> str:
    rows = [one.cells() for one in found]
    there = [k for k in range(len(HEADINGS)) if any(row[k] for row in rows)]
    table = page.table([HEADINGS[k] for k in there], [[row[k] for k in there] for row in rows]) if rows else ""
    notes = [*overridden(list(found)), *(line for one in found for line in (*one.notes, *one.lines()))]
    study = folder / "study.md"
    told = study.read_text(encoding="utf-8").splitlines() if study.exists() else []
    return page.section("Summary", "summary", table, page.lines(notes), page.lines(told))


def _warnings(said: Sequence[str], record: Mapping[str, Any], found: Sequence[Overview]) -> str:
    """What a reader must not miss: what is not complete, and why; then what the run said itself."""
    missing = [name for name in record["selected"] if name not in {one.name for one in found}]
    unfinished = [one.name for one in found if one.status == "running"]
    lines = [
        f"{one.name} stopped early after {counted(one.points, 'point')}: {one.reason}"
        for one in found
        if one.status == "stopped"
    ]
    if unfinished:
        lines.append(f"NOT FINISHED: {', '.join(unfinished)}. The points found so far are shown.")
    if record["status"] == "running":
        lines.append("The run was cut off or goes on: `fretwave resume` goes on with it.")
    lines += _never(record, missing)
    return page.section("Errors and warnings", "warnings", page.box(lines), page.lines(said) or _none(lines))


def _never(record: Mapping[str, Any], missing: Sequence[str]) -> list[str]:
    """Analyses without a point, with the reason where there is one."""
    reasons = {name: record["analyses"].get(name, {}).get("reason", "not begun") for name in missing}
    return [f"{name} has no results: {reason}" for name, reason in reasons.items()]


def _none(lines: Sequence[str]) -> str:
    return "" if lines else page.tag("p", "none", "soft")


def _model(run: Run, record: Mapping[str, Any]) -> str:
    case, problem = read_case(run.folder, record)
    return page.section("Model", "model", model_part(run, record, case, problem))


def _checks(log: Sequence[str]) -> str:
    return page.section("Checks and what the run said", "checks", page.lines(shortened_log(log)))


def _analyses(
    run: Run, record: Mapping[str, Any], found: Sequence[Overview], images: Sequence[Picture], log: Sequence[str]
) -> Iterator[str]:
    for one in found:
        own = [image for image in images if _belongs(image.owner, one.name, run)]
        said = [line.partition(": ")[2] for line in log if line.startswith(f"{one.name}: ")]
        yield _analysis(run, record, one, own, said)


def _belongs(owner: str, name: str, run: Run) -> bool:
    """A picture of the analysis, or of one of its further tables."""
    owners = [other for other in run.analyses if owner == other or owner.startswith(f"{other}_")]
    return max(owners, key=len, default="") == name


def _analysis(run: Run, record: Mapping[str, Any], one: Overview, images: Sequence[Picture], log: Sequence[str]) -> str:
    analysis, units = run[one.name], _symbols(run)
    resolved = stamp_of(analysis.attributes) or record["case"]["resolved"]
    settings = settings_part(one.name, resolved, one.overrides, units, one.unit)
    said = f"Rows of {page.text(one.name)}.csv, counted from 0; ± is the error that the run estimates itself."
    points = points_table(analysis, one)
    return page.section(
        f"{one.name}: {one.cells()[1]}",
        f"a-{one.name}",
        page.facts(_ending(record, one)),
        page.titled("Settings", settings),
        page.titled("Derived values", derived_table(analysis)),
        page.titled("Results", page.tag("p", said, "soft") + points if points else ""),
        gauges_part(run, analysis),
        *(page.picture(image.mime, image.content, image.name.replace("_", " ")) for image in images),
        page.titled("What the run said", page.lines(shortened_log(log))),
    )


def _symbols(run: Run) -> Callable[[str], str]:
    return next((analysis.unit_system for analysis in run.analyses.values()), SI)


def _ending(record: Mapping[str, Any], one: Overview) -> Iterator[tuple[str, object]]:
    """How it ended, and what it took."""
    entry = record["analyses"].get(one.name, {})
    yield "status", {"running": "not finished"}.get(one.status, one.status)
    yield "why it ended", one.reason
    yield "points", one.points
    took = "{:g} s, with what is before and after its points"
    yield "wall time", took.format(entry["wall_s"]) if "wall_s" in entry else ""


def _others(run: Run, images: Sequence[Picture]) -> str:
    """Pictures of no analysis."""
    others = [image for image in images if not any(_belongs(image.owner, name, run) for name in run.analyses)]
    shown = [page.picture(image.mime, image.content, image.name.replace("_", " ")) for image in others]
    return page.section("Further pictures", "further", *shown) if shown else ""
