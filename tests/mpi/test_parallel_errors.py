"""An error on one rank ends all ranks within 5 s with one message; what all ranks know is said once."""

from __future__ import annotations

import os
import subprocess
import sys
import time

import pytest

pytestmark = pytest.mark.ranks(1)

#: Started on 2 ranks; `body` runs where {} stands, `comm` is the world.
PROGRAM = """
import sys
from mpi4py import MPI
from petsc4py import PETSc
from fretwave.errors import InputError
from fretwave.mpi.guard import guarded, install, on_first_rank
comm = MPI.COMM_WORLD
def main():
{}
    return 0
{}
"""
GUARDED = "sys.exit(guarded(main))"
SCRIPT = "install()\nmain()"


def run(launch, body: str, ending: str = GUARDED, ranks: int = 2):
    indented = "\n".join("    " + line for line in body.strip().splitlines())
    began = time.perf_counter()
    done = launch(ranks, "-c", PROGRAM.format(indented, ending), timeout=30)
    return done, time.perf_counter() - began


def messages(text: str, word: str) -> int:
    """How often a message was printed; tracebacks quote it once more as source text."""
    return sum(line.startswith(word) for line in text.splitlines())


@pytest.mark.parametrize("ending", [GUARDED, SCRIPT])
@pytest.mark.parametrize("failing", [0, 1])
def test_one_rank_raises(launch, failing: int, ending: str) -> None:
    body = f"if comm.rank == {failing}:\n    raise ValueError('boom')\ncomm.barrier()"
    done, seconds = run(launch, body, ending)
    assert done.returncode == 1
    assert messages(done.stderr, "error: ValueError") == 1
    assert f"on rank {failing}: boom" in done.stderr
    assert seconds < 5.0 + 3.0, "5 s to end, and the start of Python and MPI"


def test_one_rank_fails_while_the_other_computes(launch) -> None:
    """The other rank is in no MPI call at all."""
    body = "if comm.rank == 1:\n    raise ValueError('boom')\nimport time\ntime.sleep(20)"
    done, seconds = run(launch, body)
    assert done.returncode == 1
    assert messages(done.stderr, "error: ValueError") == 1
    assert seconds < 8.0


def test_input_error_on_one_rank_keeps_its_exit_code(launch) -> None:
    body = "if comm.rank == 1:\n    raise InputError('bad', 'here', 1, 2, 'mend it')\ncomm.barrier()"
    done, _ = run(launch, body)
    assert done.returncode == 2
    assert messages(done.stderr, "error: bad") == 1
    assert "rank:     1" in done.stderr


@pytest.mark.parametrize("ranks", [2, 3])
def test_error_known_on_all_ranks_is_said_once(launch, ranks: int) -> None:
    done, _ = run(launch, "raise InputError('bad', 'here', 1, 2, 'mend it')", ranks=ranks)
    assert done.returncode == 2
    assert messages(done.stderr, "error: bad") == 1
    assert "MPI_ABORT" not in done.stderr


@pytest.mark.parametrize("late", [0, 1])
@pytest.mark.parametrize("seconds", [1.4, 1.49])
def test_error_of_a_rank_that_comes_late_is_said_once(launch, late: int, seconds: float) -> None:
    """As the other rank gives up waiting for it, whose message is then the one: there were two on a loaded machine."""
    fails = "raise InputError('bad', 'here', 1, 2, 'mend it')"
    done, _ = run(launch, f"import time\ntime.sleep({seconds} if comm.rank == {late} else 0)\n{fails}")
    assert done.returncode == 2
    assert messages(done.stderr, "error: bad") == 1


def test_error_found_by_the_first_rank_reaches_all(launch) -> None:
    body = "def fail():\n    raise InputError('bad')\non_first_rank(comm, fail)"
    done, _ = run(launch, body)
    assert done.returncode == 2
    assert messages(done.stderr, "error: bad") == 1


@pytest.mark.parametrize("code", [0, 7])
def test_lone_exit_does_not_hang(launch, code: int) -> None:
    done, seconds = run(launch, f"if comm.rank == 1:\n    sys.exit({code})\ncomm.barrier()")
    assert done.returncode == (code or 1)
    assert messages(done.stderr, "error: rank 1 left") == 1
    assert seconds < 8.0


def test_wrong_command_line_is_said_once(launch) -> None:
    done = launch(2, "-m", "fretwave", "rum")
    assert done.returncode == 2
    assert messages(done.stderr, "error: the command line is wrong") == 1


def test_exit_of_all_ranks_is_quiet(launch) -> None:
    done, _ = run(launch, "sys.exit(0)")
    assert done.returncode == 0
    assert done.stderr == ""


def test_on_one_rank_nothing_is_aborted(launch) -> None:
    done, _ = run(launch, "raise InputError('bad', fix='mend it')", ranks=1)
    assert done.returncode == 2
    assert done.stderr == "error: bad\n  fix:      mend it\n"


def alone(code: str) -> subprocess.CompletedProcess[str]:
    """Python without mpirun, whatever this process was started by."""
    plain = {key: value for key, value in os.environ.items() if not key.startswith(("OMPI_", "PMIX_", "PRTE_"))}
    plain |= {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
    return subprocess.run([sys.executable, "-c", code], env=plain, capture_output=True, text=True, timeout=60)


def test_a_start_without_mpirun_needs_no_daemon() -> None:
    """Open MPI's own may get lost where several runs begin and end at once; MPI_Init then waits for it for ever."""
    children = "open(f'/proc/self/task/{os.getpid()}/children').read().split()"
    done = alone(f"import os, fretwave; from mpi4py import MPI; print(MPI.COMM_WORLD.size, len({children}))")
    assert done.stdout.split() == ["1", "0"], done.stderr


SESSION = """
import os, subprocess, sys
import fretwave
from fretwave.mpi.alone import FOLDER, session_folder
inside = "import fretwave, os; from fretwave.mpi.alone import *; print(session_folder() == os.environ[FOLDER])"
subprocess.run([sys.executable, "-c", inside])
ranks = "from mpi4py import MPI; import fretwave; n = MPI.COMM_WORLD.allreduce(1); MPI.COMM_WORLD.rank or print(n)"
subprocess.run(["mpirun", "-n", "2", sys.executable, "-c", ranks])
pid = os.fork()
if not pid:
    print(session_folder() == os.environ[FOLDER], flush=True)
    os._exit(0)
os.waitpid(pid, 0)
from mpi4py import MPI
print(os.path.isdir(session_folder() + f"/ompi.{os.uname().nodename}.{os.getuid()}/jf.0/1/0"), session_folder())
"""


def test_no_two_processes_share_the_folder_of_their_session() -> None:
    """Each removes it when it ends; one that began at that moment ended in `orte_session_dir failed`: 8 of 40 starts
    beside a process that did nothing but remove it. mpirun may be started from such a process all the same."""
    done = alone(SESSION)
    *said, folder = done.stdout.split()
    assert said == ["True", "2", "True", "True"], done
    assert not os.path.exists(folder)
