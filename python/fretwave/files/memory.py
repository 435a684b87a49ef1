"""Room for what cannot fail in words: MPI ends or waits for ever where it cannot be mapped, and OpenBLAS waits for ever
for its first buffer."""

from __future__ import annotations

import mmap

from ..errors import FretwaveError

#: What OpenBLAS takes at its first call (Debian's: between 130 and 160 MB hang, measured), and a rest [bytes].
ROOM = 192 << 20
#: What MPI, PETSc and their libraries map when they are loaded (Debian 12's: 216 MB, measured) [bytes].
LIBRARIES = 224 << 20


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

    small = np.ones((64, 64))
    _ = small @ small
