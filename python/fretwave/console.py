"""What a person sees while a run goes on: few lines that stay, with a progress bar on a terminal.

Every line is in run.log whatever is shown (`Shown`): points of a branch too, of which only notable ones are printed.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from enum import IntEnum
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.progress import Progress

#: Where nobody sees a bar, how far an analysis is is said after so long, then whenever that much more time has passed.
FIRST_WORD, LATER = 30.0, 1.5
#: Share of the way after which the time that is left can be guessed.
ENOUGH = 0.02


class Shown(IntEnum):
    """How much is printed: nothing (``-q``), what stays, or every line of run.log (``-v``)."""

    NOTHING = 0
    SHORT = 1
    ALL = 2


class Console:
    """Output of rank 0; silent on the others.

    Parameters
    ----------
    active : bool
        True on rank 0.
    sink : callable
        Takes every line (run.log).
    terminal : bool, optional
        Draw a progress bar; default: whether standard output is a terminal.
    shown : Shown
        How much is printed; all of it goes to the sink.
    """

    def __init__(
        self,
        active: bool,
        sink: Callable[[str], None] = lambda line: None,
        terminal: bool | None = None,
        shown: Shown = Shown.SHORT,
    ) -> None:
        self.active = active
        self.shown = shown
        self.sink = sink
        self.terminal = on_terminal() if terminal is None else terminal
        self._track: Any = None

    def line(self, text: str) -> None:
        """A line that stays."""
        self._take(text, Shown.SHORT)

    def detail(self, text: str) -> None:
        """A line for run.log, printed only where everything is."""
        self._take(text, Shown.ALL)

    def _take(self, text: str, least: Shown) -> None:
        if not self.active:
            return
        self.sink(text)
        if self.shown >= least:
            _print(text) if self._track is None else self._track.say(text)

    def point(self, text: str, short: str, fraction: float, notable: bool = False) -> None:
        """A continuation point: how far the analysis is, and a line that stays if it is notable.

        Parameters
        ----------
        short : str
            What is said beside the bar.
        fraction : float
            Share of the way done, 0 to 1.
        notable : bool
            An event happened here.
        """
        self._take(text, Shown.SHORT if notable else Shown.ALL)
        if self._track is not None:
            self._track.tell(short, min(max(fraction, 0.0), 1.0))

    @contextmanager
    def progress(self, name: str) -> Iterator[None]:
        """Show how far one analysis is: a bar on a terminal, else now and then a line."""
        if self.shown is Shown.NOTHING or not self.active:
            yield
            return
        shown: AbstractContextManager[Any] = _bar(name) if self.terminal else nullcontext(_Words(name))
        with shown as self._track:
            try:
                yield
            finally:
                self._track = None


class Estimate:
    """The time that is left, if the rest of the way takes as long as what has been done since the beginning.

    Parameters
    ----------
    start : float, optional
        Share of the way done at the beginning; by default that of the first question.
    """

    def __init__(self, start: float | None = None) -> None:
        self.began, self._start = time.perf_counter(), start

    def passed(self) -> float:
        """Since the beginning [s]."""
        return time.perf_counter() - self.began

    def left(self, fraction: float) -> str:
        """In words; nothing where too little is done to tell."""
        self._start = fraction if self._start is None else self._start
        done = fraction - self._start
        return f"about {duration(self.passed() * (1.0 - fraction) / done)} left" if done >= ENOUGH else ""


def duration(seconds: float) -> str:
    """``12 s``, ``5 min 12 s``, ``2 h 05 min``."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60} s"
    return f"{whole // 3600} h {whole % 3600 // 60:02d} min"


class _Words:
    """How far an analysis is, said the more seldom the longer it takes: 18 lines in 12 hours."""

    def __init__(self, name: str) -> None:
        self.name, self.estimate, self.next = name, Estimate(), FIRST_WORD

    def say(self, text: str) -> None:
        _print(text)

    def tell(self, short: str, fraction: float) -> None:
        left, passed = self.estimate.left(fraction), self.estimate.passed()
        if passed < self.next:
            return
        self.next = LATER * passed
        so_far = [f"{100 * fraction:.0f} % of the way after {duration(passed)}", short, left]
        _print(f"{self.name}: {', '.join(text for text in so_far if text)}")


class _Bar:
    """The same beside a bar of `rich`."""

    def __init__(self, progress: Progress, name: str) -> None:
        self.progress, self.estimate = progress, Estimate()
        self.task = progress.add_task(name, total=1.0, shown="", left="")

    def say(self, text: str) -> None:
        self.progress.console.print(text, markup=False, highlight=False, soft_wrap=True)

    def tell(self, short: str, fraction: float) -> None:
        self.progress.update(self.task, completed=fraction, shown=short, left=self.estimate.left(fraction))


@contextmanager
def _bar(name: str) -> Iterator[_Bar]:
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
    from rich.table import Column

    columns = (
        TextColumn("[bold]{task.description}"),
        BarColumn(bar_width=None),  # gives way to the texts on a narrow terminal
        TextColumn("{task.fields[shown]}"),
        TimeElapsedColumn(table_column=Column(no_wrap=True)),
        TextColumn("{task.fields[left]}"),
    )
    with Progress(*columns, transient=True) as progress:
        yield _Bar(progress, name)


def _print(text: str) -> None:
    print(text, flush=True)


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
