"""What a response says of its points by time integration."""

from __future__ import annotations

import numpy as np
import pytest

from fretwave.analyses.parts.forced_time import _compared


@pytest.mark.parametrize(
    ("differences", "steady", "words"),
    [
        ([1e-6, -3e-5], [1, 1], "2 points by time integration, amplitude differs by up to 3.0e-05 (relative)"),
        ([np.nan, -3e-5], [1, 1], "2 points by time integration, amplitude differs by up to 3.0e-05 (relative)"),
        ([0.2, 1e-5], [0, 1], "amplitude differs by up to 1.0e-05 (relative); 1 did not become steady"),
        ([0.2], [0], "1 point by time integration, no amplitude to compare; 1 did not become steady"),
        ([np.nan], [1], "1 point by time integration, no amplitude to compare"),
    ],
    ids=["two", "one at rest", "one unsteady", "none steady", "at rest"],
)
def test_words(differences: list[float], steady: list[int], words: str) -> None:
    """No "nan": a point where nothing moves, or that never became steady, is none to compare."""
    rows = [{"relative_difference": one, "steady": s} for one, s in zip(differences, steady)]
    assert _compared(rows).endswith(words)
