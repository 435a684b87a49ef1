"""A law in Python that changes the arrays it is given, or takes them as scratch, is the law that leaves them."""

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


class Scratch(Cubic):
    def force(self, u: Any, v: Any) -> Any:
        size = np.abs(u, out=v)
        return 0.5 * u * size**2


class InTangent(Cubic):
    def tangent(self, u: Any, v: Any) -> Any:
        u *= u
        v[:] = 0.0
        return 1.5 * u[:, :, None], v[:, :, None]


class InStatus(Cubic):
    def status(self, u: Any, v: Any, f: Any) -> Any:
        for values in (u, v, f):
            values[:] = 0.0
        return super().status(u, v, f)

    def gap(self, u: Any, v: Any, f: Any) -> Any:
        assert np.any(f)
        f *= np.nan
        return super().gap(u, v, f)


def followed(law: Cubic) -> fw.Branch:
    model = fw.Model([[1.0]], [[1.0]], contacts=[fw.Contact(law, [[1.0]])])
    return fw.follow(fw.NonlinearMode(model, fw.choose_harmonics(model, 3, 64)), 0.1, 1.0, errors=False)


def test_one_that_leaves_it_is_followed() -> None:
    """omega^2 = 1 + 3/8 a^2 with one harmonic; with three within 1e-3."""
    assert followed(Cubic())["omega"][-1] == pytest.approx(np.sqrt(1 + 0.375), rel=2e-3)


@pytest.mark.parametrize("law", [InForce, Scratch, InTangent, InStatus])
def test_one_that_changes_it_is_followed_alike(law: type[Cubic]) -> None:
    """Its tangent was that of another motion, and no first point was found; then all of these were refused."""
    one, other = followed(law()), followed(Cubic())
    assert one.converged and one["omega"][-1] == pytest.approx(other["omega"][-1], rel=1e-8)


def test_what_its_status_changes_is_not_its_gap() -> None:
    """Nor what the next one that asks sees."""
    u = np.linspace(0.1, 1.0, 4)[:, None, None]
    given = [u.copy(), u.copy(), 0.5 * u**3]
    of_one, of_other = (fw.Contact(law(), [[1.0]]).states(*given) for law in (InStatus, Cubic))
    assert all(np.array_equal(a, b, equal_nan=True) for a, b in zip(of_one, of_other))
    assert np.array_equal(given[0], u) and np.array_equal(given[2], 0.5 * u**3)


@pytest.mark.parametrize("law", [InForce, Scratch, InTangent, InStatus])
def test_its_tangent_is_that_of_the_cubic(law: type[Cubic]) -> None:
    """3/2 u^2, by differences too: the displacement that a force has changed was taken for the next one's."""
    u, v = np.linspace(-1.0, 1.0, 7)[:, None, None], np.ones((7, 1, 1))
    f, df_du, df_dv = law()._evaluate(u, v)
    assert np.array_equal(v, np.ones((7, 1, 1)))
    np.testing.assert_allclose(f, 0.5 * u**3, rtol=1e-14)
    np.testing.assert_allclose(df_du[:, :, 0], 1.5 * u**2, atol=1e-8)
    np.testing.assert_allclose(df_dv, 0.0, atol=1e-8)
