"""Room for what cannot fail in words: OpenBLAS waits for ever for its first buffer where there is no memory for it."""

from __future__ import annotations

import mmap

import numpy as np

from ..errors import FretwaveError

#: What OpenBLAS takes at its first call (Debian's: between 130 and 160 MB hang, measured), and a rest [bytes].
ROOM = 192 << 20


def check_room() -> None:
    """See that there is memory to begin with, and let OpenBLAS take its share of it.

    Raises
    ------
    FretwaveError
        There is not.
    """
    try:
        mmap.mmap(-1, ROOM).close()
    except (OSError, ValueError):
        raise FretwaveError(
            "there is not enough memory to begin with",
            measured=f"less than {ROOM >> 20} MB",
            fix="raise the limit (ulimit -v, the batch system's), or end other programs",
        ) from None
    small = np.ones((64, 64))
    _ = small @ small
