"""Frequencies of a reduced model against those of the unreduced one, in words."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def off_by(full_hz: Sequence[float], relative: Sequence[float | None]) -> str:
    """``100 to 400 Hz are off by 1.0e-05 (first) to 1.0e-03 (worst)``; motions at 0 Hz are counted, and left out.

    Parameters
    ----------
    full_hz : (count,) of the unreduced model [Hz]
    relative : (count,) relative errors; None or NaN of a motion that no stiffness holds
    """
    known = [(hz, error) for hz, error in zip(full_hz, relative) if error is not None and np.isfinite(error)]
    still = len(full_hz) - len(known)
    left = f"{still} at 0 Hz, rigid or unstable, left out"
    if not known:
        return f"no frequency is compared, {left}"
    worst = max((error for _, error in known), key=abs)
    said = f"{known[0][0]:.6g} to {known[-1][0]:.6g} Hz are off by {known[0][1]:.1e} (first) to {worst:.1e} (worst)"
    return f"{said}, {left}" if still else said
