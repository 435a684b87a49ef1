"""Pictures of a run folder, with the plug-ins that its run had."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..case.plugins import load_recorded
from ..console import Console
from ..errors import InputError
from ..results.runfolder import RECORD, read_record
from ..texts import counted, display

#: Pictures from before.
MOST_NAMED = 8


def plot(folder: Path, console: Console, only: Sequence[str] | None = None, formats: Sequence[str] = ("png",)) -> int:
    """Make the pictures of a run folder; returns how many.

    Raises
    ------
    InputError
        A name of `only` is of no pictures at all, or of none of these results; then the others are made.
    """
    from ..plots import check_names, plot_run

    failed = load_recorded(read_record(folder)) if (folder / RECORD).exists() else []
    check_names(folder, only or ())
    drawable: set[str] = set()
    files = plot_run(folder, only, failed, list(dict.fromkeys(formats)), drawable)
    for line in failed:
        console.line(line)
    console.line(f"{counted(len(files), 'picture')} in {display(folder)}")
    if only is None and not failed:
        _tell_others(folder, files, console)
    _expect(only or (), sorted(drawable - {""}), folder)
    return len(files)


def _tell_others(folder: Path, files: Sequence[Path], console: Console) -> None:
    """Pictures of analyses that are not here any more, or of settings that had others; nobody's file is removed."""
    from ..plots.style import is_from

    names = {path.stem for path in files}
    others = sorted(path.name for path in folder.glob("*.*") if path.stem not in names and is_from(path))
    if others:
        shown = ", ".join(others[:MOST_NAMED]) + (", ..." if others[MOST_NAMED:] else "")
        console.line(f"note: {counted(len(others), 'picture')} from before that these results do not make: {shown}")


def _expect(only: Sequence[str], drawable: Sequence[str], folder: Path) -> None:
    """Who names a picture waits for it."""
    missing = [name for name in only if name not in drawable]
    if missing:
        listed, fix = ", ".join(drawable), f"--only {drawable[0]}" if drawable else "let the run go on first"
        expected = f"one of {listed}" if drawable else "results that have pictures"
        raise InputError(
            "these results have no such picture", f"--only in {display(folder)}", ", ".join(missing), expected, fix
        )
