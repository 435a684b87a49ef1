"""Sliders of 3-D Coulomb contact close their period: wherever it begins, in shakedown and in cycles; their tangent."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from models.core_models import dense, unknowns, whole
from models.coulomb_pair import DRAWN, KT, LAWS, MU, SAMPLES, STEADY, imposed, loads, motion, motions, pair, period
from tolerances import ROUNDING

REACH = MU / KT  #: the slider's disc at N0 = 1


def shifted(q, samples):
    """The motion read from another sample on."""
    out = np.array(q)
    for n in range(1, (np.shape(q)[1] - 1) // 2 + 1):
        c = (out[:, 2 * n - 1] - 1j * out[:, 2 * n]) * np.exp(2j * np.pi * n * samples / SAMPLES)
        out[:, 2 * n - 1], out[:, 2 * n] = c.real, -c.imag
    return out


def independent_of_the_first_sample(contact, q, tolerance, at_samples=None):
    """Force's harmonics of the motion begun at any time, and its samples (`at_samples`: their own tolerance)."""
    problem, y = imposed(contact, q)
    n = np.size(q)
    stiffness = np.tile(1 - np.array([0, 1, 1, 2, 2, 3, 3]) ** 2, 3)

    def harmonics(q):
        return (whole(problem.residual(imposed(contact, q)[1]))[:n] - stiffness * np.ravel(q)).reshape(3, 7)

    F = harmonics(q)
    for angle in (0.1, 2.0, 5.0):
        later = harmonics(shifted(q, angle * SAMPLES / (2 * np.pi)))
        assert np.abs(later - shifted(F, angle * SAMPLES / (2 * np.pi))).max() <= tolerance * np.abs(F).max()
    f = period(contact, q)[1]
    for samples in (5, 20, 40, 63):
        later = period(contact, shifted(q, samples))[1]
        assert np.abs(np.roll(later, samples, axis=0) - f).max() <= (at_samples or tolerance) * np.abs(f).max()


@given(q=motions, load=loads)
@DRAWN
def test_uncoupled_law_does_not_depend_on_the_first_sample(q, load):
    """Its changes of state lie where the motion has them, not at samples."""
    independent_of_the_first_sample(pair("coulomb_3d_uncoupled", normal_load=load), q, 1e-13)


@given(q=motions, load=loads)
@DRAWN
def test_coupled_law_does_not_depend_on_the_first_sample(q, load):
    """Its sliders close the period, after lift-off, in slip on curved paths and in shakedown alike. Just before it
    opens a force that goes to nothing turns the fastest, and counts by what it is worth in the harmonics."""
    independent_of_the_first_sample(pair(normal_load=load), q, 1e-11, at_samples=2e-8)


@pytest.mark.parametrize("law", LAWS)
def test_a_slider_that_stops_stays_wherever_its_law_looks_next(law):
    """Cosines alone stop at 0 and pi, at the edge: there whether the slider is dragged is smaller than its own rounding
    for some 1e-8 of the period, and a node of the law in that time told it to go on (0.4 % of the force)."""
    q = motion((0, 0.05, 0, 0.1), (0, 10.0, 0, 2.0, 0, 1.0), (0, 3.0, 0, 2.0))
    rng, panels = np.random.default_rng(1), 12
    problem, _ = imposed(pair(law), q)

    def turned_back(angle):
        samples = angle * SAMPLES / (2 * np.pi)
        later = unknowns(problem, np.concatenate([shifted(q, samples).ravel(), [0.0, 1.0, 0.0]]))
        return shifted(whole(problem.residual(later))[:21].reshape(3, 7), -samples)

    expected = turned_back(0.3)
    before = 2 * np.pi / panels * rng.integers(panels, size=600) + 10.0 ** rng.uniform(-11, -8, 600)
    furthest = max(np.abs(turned_back(angle) - expected).max() for angle in before)
    assert furthest < 1e-11 * np.abs(expected).max()


@given(q=motions, angle=st.floats(-3.2, 3.2))
@DRAWN
def test_coupled_law_does_not_depend_on_the_first_sample_along_a_line(q, angle):
    line = motion(q[0], np.cos(angle) * q[1], np.sin(angle) * q[1])
    independent_of_the_first_sample(pair(), line, 1e-12)


@pytest.mark.parametrize("size", [0.267, 0.28, 0.35, 0.5, 1.0])
def test_coupled_law_does_not_depend_on_the_first_sample_of_an_orbit(size):
    """An elliptic orbit just beyond the stick limit 0.26667, where a marched slider takes many periods to settle."""
    independent_of_the_first_sample(pair(), motion((0,), (0, 0, size), (0, 0.6 * size)), 1e-11)


def test_shakedown_takes_the_periodic_slider_nearest_to_rest():
    """A circle of radius r < R about c far from rest: all discs hold the one of radius R - r about c, and w is its
    point nearest to 0, c - (R - r), on the disc of the time when u = c + r."""
    c, r = 1.0, 0.1
    u, f = period(pair(), motion((0,), (c, r), (0, 0, r)))
    w = c - (REACH - r)
    assert np.allclose(f[:, 1:], KT * (u[:, 1:] - [w, 0]), rtol=0, atol=1e-13)


@pytest.mark.parametrize("r", [1.1 * REACH, 1.0, 3.0])
def test_slider_on_a_circle_is_a_tractrix(r):
    """Pulled along a circle of radius r > R at distance R it moves along itself, on the circle of radius
    sqrt(r^2 - R^2): work per period 2 pi mu N sqrt(r^2 - R^2), and the force leads the motion by acos(R / r)."""
    path, lead = motion((0,), (0, r), (0, 0, r)), np.arccos(REACH / r)
    work = 2 * np.pi * MU * np.sqrt(r**2 - REACH**2)
    for samples in (8, 64, 256):
        problem, y = imposed(pair(), path, samples=samples)
        u, f = period(pair(), path, samples=samples)
        found = np.mean((f[:, 1] + 1j * f[:, 2]) * (u[:, 1] - 1j * u[:, 2])) / r
        assert problem.diagnostics(y)["work"] == pytest.approx(work, rel=ROUNDING)
        assert found == pytest.approx(MU * np.exp(1j * lead), rel=ROUNDING)


@pytest.mark.parametrize("which", list(STEADY))
def test_tangent_of_the_closed_slider_is_exact(which):
    """Against central differences, in all directions of the motion; the period closes from any sample. In shakedown
    the slider touches its limit at one time or two, between samples, and does not slip."""
    q = STEADY[which]
    independent_of_the_first_sample(pair(), q, 1e-11)
    problem, y0 = imposed(pair(), q)
    y, step, slip = whole(y0), 1e-6, problem.diagnostics(y0)["slip"]
    assert slip > 4 / SAMPLES if which.startswith("cycle") else slip <= 2 / SAMPLES
    for e in np.eye(len(y))[:21]:
        near, far = (
            [whole(problem.residual(unknowns(problem, y + s * times * step * e))) for s in (1, -1)] for times in (1, 2)
        )
        difference = (8 * (near[0] - near[1]) - (far[0] - far[1])) / (12 * step)
        found = whole(problem.jacobian_product(y0, unknowns(problem, e)))
        assert np.allclose(difference, found, rtol=0, atol=2e-9 * np.abs(found).max())


@pytest.mark.parametrize("seed", range(8))
def test_tangent_on_a_bent_path_with_lift_off_is_exact(seed):
    """Random motions that stick, slip on bent paths under a varying load, open and land, against central differences;
    the assembled block too."""
    rng = np.random.default_rng(seed)
    problem, y0 = imposed(pair(), 0.35 * rng.standard_normal((3, 7)))
    y, step, states = whole(y0), 1e-7, problem.diagnostics(y0)
    assert min(states["stick"], states["slip"], states["open"]) > 0
    J = dense(problem.jacobian(y0))
    for dy in rng.standard_normal((4, 24)) * (np.arange(24) < 21):
        sides = [whole(problem.residual(unknowns(problem, y + s * step * dy))) for s in (1, -1)]
        found = whole(problem.jacobian_product(y0, unknowns(problem, dy)))
        assert np.allclose((sides[0] - sides[1]) / (2 * step), found, rtol=0, atol=1e-7 * np.abs(found).max())
        assert np.allclose(J @ dy, found, rtol=0, atol=ROUNDING * np.abs(found).max())
