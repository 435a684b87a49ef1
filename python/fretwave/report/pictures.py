"""Pictures of a run as they go into a page: those of the folder, and drawn anew where there are none."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

from ..results.journal import unfinished
from ..results.reader import Run

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Bytes of a vector picture above which dots are smaller.
LARGEST_SVG = 300_000


@dataclass(frozen=True)
class Picture:
    """An image; `owner` is the analysis or the table that it shows, "" for none."""

    name: str
    owner: str
    mime: str
    content: bytes


def pictures(run: Run, failed: list[str]) -> list[Picture]:
    """All pictures, by analysis; `failed` gets a line for each family that cannot be drawn.

    One that is older than the results is of other ones, and drawn anew.
    """
    from ..plots import drawn, picture_of

    newest = max((path.stat().st_mtime for path in _results(run.folder)), default=0.0)
    files = [path for path in sorted(run.folder.glob("*.png")) if path.stat().st_mtime >= newest]
    found = [Picture(path.stem, picture_of(path.stem, run), "image/png", path.read_bytes()) for path in files]
    there = {one.owner for one in found}
    missing = [name for name, analysis in run.analyses.items() if len(analysis) and name not in there]
    if missing:
        found += drawn(run, lambda name, figure: _made(name, picture_of(name, run), figure), missing, failed)
    return found


def _results(folder: Path) -> Iterator[Path]:
    """Files that pictures are made from."""
    yield from (path for path in (folder / "results.h5", folder / "study.csv") if path.exists())
    yield from unfinished(folder).values()


def _made(name: str, owner: str, figure: Figure) -> Picture:
    """As vectors, which print well, where these are few."""
    content = _saved(figure, "svg")
    if len(content) <= LARGEST_SVG:
        return Picture(name, owner, "image/svg+xml", content)
    return Picture(name, owner, "image/png", _saved(figure, "png"))


def _saved(figure: Figure, form: str) -> bytes:
    buffer = BytesIO()
    figure.savefig(buffer, format=form)
    return buffer.getvalue()
