"""A law in Python may not change the motion that it is asked about."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import fretwave as fw

pytestmark = pytest.mark.ranks(1)


class Cubic(fw.PythonLaw):
    """Of the displacement."""

    odd, stuck_stiffness = True, 0.0

    def force(self, u: Any, v: Any) -> Any:
        return 0.5 * u**3


class InForce(Cubic):
    def force(self, u: Any, v: Any) -> Any:
        f = 0.5 * u**3
        u *= 2.0
        return f


class InStatus(Cubic):
    def status(self, u: Any, v: Any, f: Any) -> Any:
        f[:] = 0.0
        return np.zeros((len(u), u.shape[2]))


def followed(law: Cubic) -> fw.Branch:
    model = fw.Model([[1.0]], [[1.0]], contacts=[fw.Contact(law, [[1.0]])])
    return fw.follow(fw.NonlinearMode(model, fw.choose_harmonics(model, 3, 64)), 0.1, 1.0, errors=False)


def test_one_that_leaves_it_is_followed() -> None:
    """omega^2 = 1 + 3/8 a^2 with one harmonic; with three within 1e-3."""
    assert followed(Cubic())["omega"][-1] == pytest.approx(np.sqrt(1 + 0.375), rel=2e-3)


@pytest.mark.parametrize("law", [InForce, InStatus])
def test_one_that_changes_it_is_told(law: type[Cubic]) -> None:
    """Its tangent was that of another motion, and no first point was found; or what was shown of it was nothing."""
    with pytest.raises(ValueError, match="read-only"):
        followed(law())
