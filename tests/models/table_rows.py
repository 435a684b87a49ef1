"""Values for the columns that a synthetic table of a branch needs and its test does not look at."""

from __future__ import annotations

from typing import Any

from fretwave.columns import COLUMNS

ERRORS = [name for name in COLUMNS if "_error" in name and name not in ("energy_error", "step_error")]
SHARED: dict[str, Any] = {
    **dict.fromkeys(ERRORS, 1e-4),
    "stick": 0.5,
    "slip": 0.5,
    "open": 0.0,
    "force_outside": 1e-3,
    "unclosed": 0.0,
    "residual": 1e-12,
}
SHARED |= {"newton": 3, "linear": 3, "rounding": 1e-14, "accepted": 1}
