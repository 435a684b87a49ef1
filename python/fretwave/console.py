"""What a person sees while a run goes on: a progress bar on a terminal, one plain line a point otherwise."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any


class Console:
    """Output of rank 0; silent on the others.

    Parameters
    ----------
    active : bool
        True on rank 0.
    sink : callable
        Takes every plain line as well (run.log).
    terminal : bool, optional
        Draw a progress bar; default: whether standard output is a terminal.
    quiet : bool
        Print nothing; lines still go to the sink.
    """

    def __init__(
        self,
        active: bool,
        sink: Callable[[str], None] = lambda line: None,
        terminal: bool | None = None,
        quiet: bool = False,
    ) -> None:
        self.active = active
        self.quiet = quiet
        self.sink = sink
        self.terminal = on_terminal() if terminal is None else terminal
        self._progress: Any = None
        self._task: Any = None

    def line(self, text: str) -> None:
        """A line that stays."""
        if not self.active:
            return
        self.sink(text)
        if self.quiet:
            return
        if self._progress is not None:
            self._progress.console.print(text, markup=False, highlight=False, soft_wrap=True)
        else:
            print(text, flush=True)

    def point(self, text: str, short: str, fraction: float, notable: bool = False) -> None:
        """A continuation point: a plain line, or the moving bar with only notable points left standing.

        Parameters
        ----------
        short : str
            What is said beside the bar.
        fraction : float
            Share of the way done, 0 to 1.
        notable : bool
            An event happened here: the line stays on a terminal too.
        """
        if not self.active:
            return
        if self._progress is None or notable:
            self.line(text)
        else:
            self.sink(text)
        if self._progress is not None:
            self._progress.update(self._task, completed=min(max(fraction, 0.0), 1.0), shown=short)

    @contextmanager
    def progress(self, name: str) -> Iterator[None]:
        """Draw the bar of one analysis."""
        if self.quiet or not (self.active and self.terminal):
            yield
            return
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

        columns = (
            TextColumn("[bold]{task.description}"),
            BarColumn(bar_width=24),
            TextColumn("{task.fields[shown]}"),
            TimeElapsedColumn(),
        )
        with Progress(*columns, transient=True) as self._progress:
            self._task = self._progress.add_task(name, total=1.0, shown="")
            try:
                yield
            finally:
                self._progress, last = None, self._progress
                last.refresh()


def on_terminal() -> bool:
    """Whether a person sees standard output as it is written.

    Open MPI gives every rank a pseudo-terminal, also when its own output goes to a file: then the output of
    mpirun, the parent process, decides.
    """
    if not sys.stdout.isatty() or os.environ.get("TERM", "dumb") == "dumb":
        return False
    if "OMPI_COMM_WORLD_RANK" not in os.environ:
        return True
    try:
        with open(f"/proc/{os.getppid()}/fd/1", "rb", buffering=0) as launcher:
            return launcher.isatty()
    except OSError:
        return False
