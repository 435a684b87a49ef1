"""Amplitudes over a period and Goodman's factor against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tolerances import LAST_DIGITS, ROUNDING

from fretwave.fe.strain import COMPONENTS
from fretwave.post.fatigue import (
    first_reaching,
    goodman,
    mean_stress,
    stress_amplitude,
    swing,
    von_mises_square,
)

pytestmark = pytest.mark.ranks(1)

LABELS = ["0", "1c", "1s", "3c", "3s"]


def one(**components: list[float]) -> np.ndarray:
    """A stress (1, 6, m) by its components."""
    names = ("xx", "yy", "zz", "xy", "xz", "yz")
    return np.array([[components.get(name, [0.0] * len(LABELS)) for name in names]])


def test_von_mises_of_tension_shear_and_pressure() -> None:
    stress = np.array([[2.0, 0, 0, 0, 0, 0], [0, 0, 0, 0, 3.0, 0], [5.0, 5.0, 5.0, 0, 0, 0]])
    np.testing.assert_allclose(np.sqrt(von_mises_square(stress)), [2.0, 3.0 * np.sqrt(3), 0.0], atol=LAST_DIGITS)


def test_one_harmonic_has_the_amplitude_of_its_ellipse() -> None:
    """Of s e^{i tau}: VM^2 = (s^H V s + |s^T V s|) / 2, whatever the phases of the components."""
    rng = np.random.default_rng(2)
    s = rng.normal(size=(50, 6)) + 1j * rng.normal(size=(50, 6))
    V = np.array([[1, -0.5, -0.5], [-0.5, 1, -0.5], [-0.5, -0.5, 1]])
    V = np.block([[V, np.zeros((3, 3))], [np.zeros((3, 3)), 3 * np.eye(3)]])
    wanted = np.sqrt((np.einsum("na,ab,nb->n", s.conj(), V, s).real + abs(np.einsum("na,ab,nb->n", s, V, s))) / 2)
    stress = np.stack([s.real, -s.imag], axis=-1)
    np.testing.assert_allclose(stress_amplitude(["1c", "1s"], stress), wanted, rtol=1e-5)


def test_harmonics_with_any_phase_are_read_between_samples() -> None:
    """Against two hundred times as many instants."""
    rng = np.random.default_rng(3)
    stress = rng.normal(size=(200, 6, len(LABELS)))
    tau = 2 * np.pi * np.arange(40_000) / 40_000
    basis = np.stack([np.cos(tau), np.sin(tau), np.cos(3 * tau), np.sin(3 * tau)])
    wanted = np.array([np.sqrt(von_mises_square((s[:, 1:] @ basis)[None])[0].max()) for s in stress])
    np.testing.assert_allclose(stress_amplitude(LABELS, stress), wanted, rtol=2e-5)
    strain = rng.normal(size=(200, len(LABELS)))
    half, mean = swing(LABELS, strain)
    over = strain[:, 1:] @ basis
    np.testing.assert_allclose(half, (over.max(axis=1) - over.min(axis=1)) / 2, rtol=2e-5)
    np.testing.assert_array_equal(mean, strain[:, 0])


def test_odd_harmonics_have_half_the_range_of_the_difference_of_two_instants() -> None:
    stress = np.random.default_rng(4).normal(size=(1, 6, len(LABELS)))
    tau = 2 * np.pi * np.arange(240) / 240
    basis = np.stack([np.ones(240), np.cos(tau), np.sin(tau), np.cos(3 * tau), np.sin(3 * tau)])
    over = (stress[0] @ basis).T
    ranges = von_mises_square((over[:, None] - over[None]).reshape(-1, 6))
    assert stress_amplitude(LABELS, stress)[0] == pytest.approx(np.sqrt(ranges.max()) / 2, rel=1e-3)


def test_shear_counts_as_a_mean_in_every_frame() -> None:
    """Its trace is rounding, whose sign left half of the frames without a mean stress."""
    shear, turns = np.zeros((3, 3)), Rotation.random(50, random_state=5).as_matrix()
    shear[0, 1] = shear[1, 0] = 2.0
    turned = turns @ shear @ turns.transpose(0, 2, 1)
    stress = np.stack([turned[:, a, b] for a, b in COMPONENTS], axis=1)[..., None]
    np.testing.assert_allclose(mean_stress(["0"], stress), 2.0 * np.sqrt(3), rtol=ROUNDING)
    assert not np.signbit(mean_stress(["0"], -0.0 * stress)).any()
    np.testing.assert_allclose(mean_stress(["0"], stress - 0.1 * (np.arange(6) < 3)[:, None]).max(), -2.0 * np.sqrt(3))


def test_mean_has_the_sign_of_its_trace_and_counts_under_tension_alone() -> None:
    pulled, pressed = one(xx=[3.0, 1, 0, 0, 0]), one(xx=[-3.0, 1, 0, 0, 0])
    assert mean_stress(LABELS, pulled)[0] == pytest.approx(3.0, rel=LAST_DIGITS)
    assert mean_stress(LABELS, pressed)[0] == pytest.approx(-3.0, rel=LAST_DIGITS)
    assert mean_stress(LABELS[1:], pulled[..., 1:])[0] == 0
    amplitude = stress_amplitude(LABELS, pulled)
    assert amplitude[0] == pytest.approx(1.0, rel=ROUNDING)
    np.testing.assert_allclose(
        goodman(np.array([1.0, 1.0]), np.array([3.0, -3.0]), 4.0, 12.0), [0.5, 0.25], rtol=LAST_DIGITS
    )


def test_the_limit_is_read_between_points() -> None:
    amplitude = np.array([1.0, 2.0, 4.0, 8.0])
    found = first_reaching(0.2 * amplitude, 1.0, amplitude, 100 - amplitude)
    assert found == pytest.approx((5.0, 95.0), rel=LAST_DIGITS)
    assert first_reaching(0.1 * amplitude, 1.0, amplitude) is None
    assert first_reaching(2.0 * amplitude, 1.0, amplitude) is None
    folded = np.array([0.5, 1.5, 0.7, 1.3])
    assert first_reaching(folded, 1.0, amplitude) == pytest.approx((1.5,), rel=LAST_DIGITS)
