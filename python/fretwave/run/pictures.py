"""Pictures of a run folder, with the plug-ins that its run had."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..case.plugins import load_recorded
from ..console import Console
from ..results.runfolder import RECORD, read_record
from ..texts import counted, display


def plot(folder: Path, console: Console, only: Sequence[str] | None = None, formats: Sequence[str] = ("png",)) -> int:
    """Make the pictures of a run folder; returns how many."""
    from ..plots import check_names, plot_run

    failed = load_recorded(read_record(folder)) if (folder / RECORD).exists() else []
    check_names(folder, only or ())
    files = plot_run(folder, only, failed, formats)
    for line in failed:
        console.line(line)
    console.line(f"{counted(len(files), 'picture')} in {display(folder)}")
    return len(files)
