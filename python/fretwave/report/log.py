"""What run.log says of a run besides its points: checks, and what a reader must not miss."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

#: Words of lines that warn.
WARNING = re.compile(r"\b(note|missed|warning|error)s?:|GMRES failed|gave up|not estimated|no picture|is not kept\b")
MOST_LINES = 250


def log_lines(folder: Path, names: Sequence[str]) -> list[str]:
    """Of run.log without points, which are in the tables."""
    path = folder / "run.log"
    if not path.exists():
        return []
    point = re.compile(rf"({'|'.join(map(re.escape, names))}) .*\bnewton +\d+ +[.\d]+ s") if names else None
    found = path.read_text(encoding="utf-8", errors="replace").splitlines()
    return [line for line in found if point is None or not point.match(line)]


def warnings_of(lines: Sequence[str]) -> list[str]:
    """Those that warn, each once."""
    return list(dict.fromkeys(line for line in lines if WARNING.search(line)))


def shortened_log(lines: Sequence[str]) -> list[str]:
    """Begin and end of a long log."""
    if len(lines) <= MOST_LINES:
        return list(lines)
    half = MOST_LINES // 2
    return [*lines[:half], f"... {len(lines) - 2 * half} lines are in run.log ...", *lines[-half:]]
