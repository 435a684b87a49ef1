"""One message and a quick end on all ranks, whatever goes wrong on any of them.

Open MPI hangs when one rank raises (or calls ``sys.exit``) and the others wait in a collective. Every
entry point therefore runs inside :func:`guarded`, and scripts get the same through ``sys.excepthook``.
"""

from __future__ import annotations

import os
import re
import sys
import time
import traceback
from collections.abc import Callable
from io import TextIOWrapper
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, TextIO, TypeVar

from ..errors import EXIT_OTHER, FretwaveError, PetscError, exit_code_of
from ..files.whole import file_error
from ..texts import display
from .alone import RANKS

if TYPE_CHECKING:
    from mpi4py import MPI

Result = TypeVar("Result")

#: How long a failed rank waits for the others to fail too before it ends them [s].
AGREEMENT_WAIT = 1.0
#: Head start of the lower rank, so that one message is printed when several but not all fail [s].
RANK_DELAY = 0.25
#: Of a rank that waits for the first one's work [s].
LONGEST_SLEEP = 5e-3
#: Environment variable that adds the traceback to the message of an unexpected error.
TRACEBACK = "FRETWAVE_TRACEBACK"
#: How Python knows files that a case brings, and what to do about an exception of theirs.
PLUGIN, CORRECT = "fretwave_plugin_", f"correct the plug-in; {TRACEBACK}=1 shows how it was called"


def world() -> MPI.Comm | None:
    """``MPI.COMM_WORLD``, or None where MPI is not running (so that ``--help`` never starts it)."""
    module = sys.modules.get("mpi4py.MPI")
    if module is None or not module.Is_initialized() or module.Is_finalized():
        return None
    comm: MPI.Comm = module.COMM_WORLD
    return comm


def launched_rank() -> int:
    """This process's rank as its launcher says, 0 without one: known before MPI is started."""
    return int(next((os.environ[name] for name in RANKS if name in os.environ), "0"))


def all_ranks_failed(comm: MPI.Comm) -> bool:
    """True when every rank gets here within `AGREEMENT_WAIT` seconds; False on one rank after the other.

    A barrier on the world would match a barrier of ranks that are well, so private messages are used: rank 0 hears
    from all and answers, and hears whether its answer was waited for. A rank that has none in time prints its message
    and ends all: rank 0, when it comes late, leaves both to it.
    """
    tag, heard = 32001, 32002
    if comm.rank:
        comm.isend(None, dest=0, tag=tag)
        complete = _wait([comm.irecv(source=0, tag=tag)], AGREEMENT_WAIT + RANK_DELAY * (1 + comm.rank))
        comm.isend(complete, dest=0, tag=heard)
        return complete
    others = range(1, comm.size)
    complete = _wait([comm.irecv(source=rank, tag=tag) for rank in others], AGREEMENT_WAIT)
    if complete:
        for request in [comm.isend(None, dest=rank, tag=tag) for rank in others]:
            request.wait()
        if not all([comm.recv(source=rank, tag=heard) for rank in others]):
            time.sleep(AGREEMENT_WAIT)
    return complete


def _wait(requests: list[Any], seconds: float) -> bool:
    deadline = time.monotonic() + seconds
    waiting = list(requests)
    while waiting and time.monotonic() < deadline:
        waiting = [request for request in waiting if not request.test()[0]]
        time.sleep(0.002)
    return not waiting


def describe(error: BaseException, rank: int | None = None, traced: bool = False) -> str:
    """The message for an exception; an unexpected one brings its traceback if `traced`, else the place it came from."""
    plain = in_words(error)
    if plain is not None:
        return describe(plain, rank)
    if isinstance(error, FretwaveError):
        text = error.render()
        return text if rank is None else f"{text}\n  {'rank:':<10}{rank}"
    if isinstance(error, KeyboardInterrupt):
        kept = ": finished points are kept; `fretwave resume RUNDIR` goes on from there"
        return f"interrupted{'' if traced else kept}"  # nobody knows what a script keeps
    place = "" if rank is None else f" on rank {rank}"
    text = f"error: {type(error).__name__}{place}: {error}\n"
    if traced or os.environ.get(TRACEBACK):
        text = "".join(traceback.format_exception(type(error), error, error.__traceback__)) + text
        return f"{text}  fix:      this is a defect of the script, or of fretwave; report it with the lines above"
    frames = traceback.extract_tb(error.__traceback__)
    theirs = [frame for frame in frames if frame.filename in _plugins()]
    if theirs:
        return f"{text}  where:    {display(Path(theirs[-1].filename))}:{theirs[-1].lineno}\n  fix:      {CORRECT}"
    if frames:
        text += f"  where:    {os.path.basename(frames[-1].filename)}:{frames[-1].lineno}, {frames[-1].name}\n"
    return f"{text}  fix:      this is a defect of fretwave; report it with what {TRACEBACK}=1 adds to this message"


def _plugins() -> set[str]:
    """Files that a case has brought (`fretwave.case.plugins`)."""
    return {str(module.__file__) for name, module in list(sys.modules.items()) if name.startswith(PLUGIN)}


#: What libraries say where there is no memory: PETSc, the system, C++, Python (of a thread's stack), MUMPS.
SHORT = re.compile(
    r"out of memory|cannot allocate memory|bad_alloc|can't start new thread|INFOG\(1\) ?= ?-(5|7|13)\b", re.IGNORECASE
)


def in_words(error: BaseException) -> FretwaveError | None:
    """The message of an error that the machine makes, not fretwave: disk, memory, libraries; else None."""
    if isinstance(error, FretwaveError) and not isinstance(error, PetscError):
        return None
    if isinstance(error, OSError):
        return file_error(error)
    text = " ".join(str(error).split())
    if isinstance(error, MemoryError) or SHORT.search(text):
        return FretwaveError(
            "there is not enough memory",
            measured=text or None,
            fix="fewer harmonics or samples, a reduction, or more memory (ulimit -v, the batch system's limit);"
            " finished points are kept: then `fretwave resume RUNDIR`",
        )
    if isinstance(error, ImportError) and "shared object" in text:
        return FretwaveError("a library cannot be loaded", None, text, None, "`fretwave doctor`; is there memory left?")
    return None


def end_all_ranks(error: BaseException, traced: bool = False) -> int:
    """Print one message, end the other ranks if they have not failed too, return the exit code."""
    comm = world()
    code = exit_code_of(error)
    if comm is None or comm.size == 1:
        # Before MPI runs only the command line can be wrong, and it is the same on all ranks.
        if launched_rank() == 0 or comm is not None or not isinstance(error, FretwaveError):
            _print(describe(error, None, traced))
        return code
    if all_ranks_failed(comm):
        if comm.rank == 0:
            _print(describe(error, None, traced))
        return code
    _print(describe(error, comm.rank, traced))
    comm.Abort(code)
    return code


def _print(text: str) -> None:
    for stream, said in ((sys.stdout, ""), (sys.stderr, f"{text}\n")):
        try:
            stream.write(said)
            stream.flush()
        except OSError:  # nobody reads it, or its disk is full: the other stream may do
            _drop(stream)


def _drop(stream: TextIO) -> None:
    """Send what is left unread nowhere, else it is an error again at Python's end."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def _lone_exit(exit_: SystemExit) -> int:
    """Exit of one rank alone: the others must not wait for it."""
    code = exit_.code if isinstance(exit_.code, int) else EXIT_OTHER * bool(exit_.code)
    comm = world()
    if comm is None or comm.size == 1 or all_ranks_failed(comm):
        if isinstance(exit_.code, str) and (comm is None or comm.rank == 0):
            _print(exit_.code)
        return code
    _print(f"error: rank {comm.rank} left (exit code {code}) while other ranks went on")
    comm.Abort(code or EXIT_OTHER)
    return code


def open_streams() -> None:
    """What a shell has closed (`>&-`) leads nowhere: else the next file to be opened took what is printed.

    Letters that standard output's encoding has not are escaped there, as they are on standard error.
    """
    for number, name, mode in ((0, "stdin", "r"), (1, "stdout", "w"), (2, "stderr", "w")):
        try:
            os.fstat(number)
        except OSError:
            # takes the lowest number that is free, which is this one
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(number, mode, encoding="utf-8", closefd=False))
    if isinstance(sys.stdout, TextIOWrapper) and sys.stdout.errors == "strict":
        sys.stdout.reconfigure(errors="backslashreplace")  # a title's letter that its encoding has not ended the run


def guarded(main: Callable[[], int]) -> int:
    """Run an entry point; no exception and no lone exit leaves another rank waiting.

    Returns
    -------
    int
        The exit code of the process.
    """
    try:
        return _all_printed(main)
    except SystemExit as exit_:
        return _lone_exit(exit_)
    except BrokenPipeError as error:
        _drop(sys.stdout)
        _drop(sys.stderr)  # `... | head` ends without a word, as other commands do
        return end_all_ranks(error)
    except BaseException as error:
        return end_all_ranks(error)


def _all_printed(main: Callable[[], int]) -> int:
    """Its exit code, with nothing left to be printed at Python's end, where an error has no words."""
    try:
        code = main()
    except SystemExit:  # of --help, --version
        sys.stdout.flush()
        raise
    sys.stdout.flush()
    return code


def _excepthook(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    end_all_ranks(error.with_traceback(trace), traced=True)


def install() -> None:
    """Make uncaught exceptions of scripts end all ranks with one message."""
    sys.excepthook = _excepthook


def caught_by_all(comm: MPI.Comm, error: FretwaveError) -> None:
    """Return where every rank has caught this error and goes on; end all of them where some only have. Collective.

    For those who catch a `FretwaveError` and go on with collective calls: the others may wait in one of before.
    """
    if comm.size == 1 or all_ranks_failed(comm):
        return
    _print(describe(error, comm.rank))
    comm.Abort(exit_code_of(error))


def _meet_quietly(comm: MPI.Comm) -> None:
    """A barrier in which who is early sleeps, an eighth of its wait at a time: MPI's own takes a core. Collective.

    Rank 0 draws pictures for seconds; the others' cores may have other work.
    """
    if comm.size == 1:
        return
    request, begin = comm.Ibarrier(), time.monotonic()
    while not request.Test():
        time.sleep(min(max((time.monotonic() - begin) / 8, 2e-5), LONGEST_SLEEP))


def on_first_rank(comm: MPI.Comm, work: Callable[[], Result]) -> Result:
    """Do `work` on rank 0 and give its result, or its error in words, to every rank. Collective.

    What only one rank reads (case file, matrices, earlier results) cannot differ between ranks then.
    """
    outcome: tuple[Exception | None, Any] = (None, None)
    if comm.rank == 0:
        try:
            outcome = (None, work())
        except FretwaveError as error:
            outcome = (error, None)
        except BrokenPipeError as error:
            outcome = (error, None)
        except (OSError, MemoryError) as error:
            outcome = (in_words(error), None)
    _meet_quietly(comm)
    problem, result = comm.bcast(outcome, root=0)
    if problem is not None:
        raise problem
    answer: Result = result
    return answer
