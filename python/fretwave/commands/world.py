"""MPI with PETSc started on it."""

from __future__ import annotations

import sys
from typing import Any


def world() -> Any:
    """MPI with PETSc started on it; collective, so it comes before anything one rank could fail in alone."""
    from ..files.memory import LIBRARIES, check_room

    check_room(0 if "mpi4py.MPI" in sys.modules else LIBRARIES)
    from mpi4py import MPI

    from .doctor import check_runtime

    check_runtime()
    from .. import _core  # noqa: F401

    return MPI.COMM_WORLD


def world_if_any() -> Any:
    """The same where there is MPI, else None: for what reads results and asks little of the solver."""
    try:
        import mpi4py  # noqa: F401
    except ImportError:
        return None
    return world()
