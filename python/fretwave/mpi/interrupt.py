"""How a command ends that is told to: by Ctrl-C, a batch system's SIGTERM, a closed terminal, a limit on time."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import EXIT_INTERRUPTED
from ..texts import display

if TYPE_CHECKING:
    from mpi4py import MPI

#: mpirun is given this long to read the last words [s]; it ends its ranks a second after it was told to end.
LAST_WAIT = 0.8
#: The progress bar hides the cursor.
SHOW_CURSOR = "\x1b[?25h"


@contextmanager
def ending_in_words(comm: MPI.Comm) -> Iterator[None]:
    """End at once on a signal, saying on the first rank how to go on."""
    from .. import _core

    _say(comm, ": nothing has been written yet\n  fix:      start again")
    _core.end_on_signals(EXIT_INTERRUPTED, LAST_WAIT if comm.size > 1 else 0.0)
    try:
        yield
    finally:
        _core.restore_signals()


def say_how_to_go_on(comm: MPI.Comm, folder: Path) -> None:
    """From now on there are results in a folder that can be gone on with."""
    words = f"finished points are kept in {display(folder)}"
    _say(comm, f": {words}\n  fix:      `fretwave resume {display(folder)}` goes on from there")


def _say(comm: MPI.Comm, text: str) -> None:
    from .. import _core

    cursor = SHOW_CURSOR if sys.stderr.isatty() else ""
    _core.set_last_words(f"{text}\n{cursor}" if comm.rank == 0 else "")
