"""A process that no launcher started: what Open MPI is told before it begins, wherever it is imported first.

Without mpirun Open MPI starts a daemon for a process that might spawn others, which fretwave never does. Where several
begin and end at once that daemon may get lost, and MPI_Init waits for it for ever. Without the daemon all such
processes have one session folder, ``ompi.<host>.<uid>/jf.0/1/0``, which each removes when it ends: one that begins at
that moment finds its parent gone and ends in ``orte_session_dir failed``. So each has a folder of its own.
"""

from __future__ import annotations

import atexit
import os

#: Set by launchers for the processes they start: Open MPI and PMIx, MPICH, Slurm.
RANKS = ("OMPI_COMM_WORLD_RANK", "PMI_RANK", "PMIX_RANK", "SLURM_PROCID")
FOLDER = "OMPI_MCA_orte_tmpdir_base"
NAME = "fretwave-mpi-"


def session_folder() -> str:
    """Where this process's session is, until it ends."""
    return os.path.join(os.environ.get("TMPDIR", "/tmp"), f"{NAME}{os.getuid()}-{os.getpid()}")


def launched() -> bool:
    """Whether a launcher has started this process: known before MPI is started."""
    return any(name in os.environ for name in RANKS)


def prepare() -> None:
    """Tell Open MPI so by its variables, unless the user has set them."""
    if launched():
        return
    os.environ.setdefault("OMPI_MCA_ess_singleton_isolated", "1")
    if NAME in os.environ.get(FOLDER, NAME):  # one of ours there is of the process that started this one
        _take_folder()
        os.register_at_fork(after_in_child=_take_folder)
        atexit.register(_remove_folder)


def _take_folder() -> None:
    os.environ[FOLDER] = session_folder()


def _remove_folder() -> None:
    """MPI_Finalize, which comes later, leaves the outermost folder."""
    if os.path.isdir(session_folder()):
        import shutil

        shutil.rmtree(session_folder(), ignore_errors=True)
