"""Room for what cannot fail in words: MPI ends or waits for ever where it cannot be mapped, and OpenBLAS waits for ever
for its first buffer."""

from __future__ import annotations

import contextlib
import mmap
import os
import resource
from pathlib import Path

from ..errors import FretwaveError

#: What OpenBLAS takes at its first call (Debian's: between 130 and 160 MB hang, measured), and a rest [bytes].
ROOM = 192 << 20
#: What MPI, PETSc and their libraries map when they are loaded (Debian 12's: 216 MB, measured) [bytes].
LIBRARIES = 224 << 20
#: Rows of a product that takes this buffer: one of 64 rows does without (Debian's on AVX-512, measured).
PRODUCT = 256
CGROUP = Path("/sys/fs/cgroup/memory.max")


def check_room(libraries: int = 0) -> None:
    """See that there is memory to begin with, beside that of libraries not yet loaded, and let OpenBLAS take its share.

    Raises
    ------
    FretwaveError
        There is not.
    """
    try:
        mmap.mmap(-1, ROOM + libraries).close()
    except (OSError, ValueError):
        raise FretwaveError(
            "there is not enough memory to begin with",
            measured=f"less than {(ROOM + libraries) >> 20} MB",
            fix="raise the limit (ulimit -v, the batch system's), or end other programs",
        ) from None
    import numpy as np

    product = np.ones((PRODUCT, PRODUCT))
    _ = product @ product


def machine_memory() -> float:
    """What all ranks can have at most [bytes]: of the machine, of its container, of their limits, on all machines."""
    found = [float(os.sysconf("SC_PHYS_PAGES")) * os.sysconf("SC_PAGE_SIZE")]
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    ranks, here = ranks_started()
    if limit != resource.RLIM_INFINITY:
        found.append(float(limit) * here)
    with contextlib.suppress(OSError, ValueError):  # "max", or no such container
        found.append(float(CGROUP.read_text(encoding="ascii")))
    return min(found) * max(1, ranks // here)


def ranks_started() -> tuple[int, int]:
    """Ranks that a launcher (Open MPI's, MPICH's) has started, and those of them on this machine."""
    for names in (("OMPI_COMM_WORLD_SIZE", "OMPI_COMM_WORLD_LOCAL_SIZE"), ("PMI_SIZE", "MPI_LOCALNRANKS")):
        with contextlib.suppress(KeyError, ValueError):
            ranks, here = (int(os.environ[name]) for name in names)
            if ranks >= here > 0:
                return ranks, here
    return 1, 1


def size(count: float) -> str:
    """Bytes in the unit that suits them."""
    units = ("B", "kB", "MB", "GB", "TB", "PB", "EB", "ZB", "YB")
    power = 0
    while count >= 1000 and power < len(units) - 1:
        count, power = count / 1000, power + 1
    return f"{count:.3g} {units[power]}"
