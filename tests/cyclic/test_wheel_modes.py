"""Waves of a tuned wheel to start from, modes of a mistuned one like them, and what a motion looks like around it."""

from __future__ import annotations

import numpy as np
import pytest
from tolerances import ROUNDING

import fretwave as fw

N, TIE = 12, 0.3


def sector():
    """Masses on springs, tied to their neighbours: omega^2 = 1 + 4 TIE sin^2(pi n / N)."""
    ties = {0: [[1 + 2 * TIE]], 1: [[-TIE]], -1: [[-TIE]]}
    return fw.Sector([[1.0]], {k: np.array(A) for k, A in ties.items()}, N)


def wave(comm, diameters):
    with sector().model(diameters, comm) as model:
        return fw.linear_modes(model, 1, "free")[0]


@pytest.mark.parametrize("diameters", [1, 3, -2])
def test_standing_and_travelling_waves_are_modes_of_the_wheel(comm, diameters):
    one = wave(comm, diameters)
    waves = [fw.travelling_wave(one, diameters, N), fw.standing_wave(one, diameters, N, 0, crest=2)]
    K = np.array([[(1 + 2 * TIE) * (i == j) - TIE * ((i - j) % N in (1, N - 1)) for j in range(N)] for i in range(N)])
    for mode, other in waves:
        phi = mode.shape + 1j * mode.imaginary
        assert np.abs(K @ phi - one.omega**2 * phi).max() < ROUNDING and np.vdot(phi, phi).real == pytest.approx(1.0)
        assert np.abs(K @ other - one.omega**2 * other).max() < ROUNDING and abs(np.vdot(other, phi)) < ROUNDING
    standing = waves[1][0].shape
    assert abs(standing[2]) == pytest.approx(np.abs(standing).max())


@pytest.mark.parametrize("diameters", [0, N // 2])
def test_a_single_mode_avoids_none(comm, diameters):
    one = wave(comm, diameters)
    assert fw.travelling_wave(one, diameters, N)[1] is None and fw.standing_wave(one, diameters, N, 0)[1] is None


def test_shape_of_pure_waves_and_of_one_blade(comm):
    """Participation 1, 2/3 and 1/N; amplification 1, sqrt(2) and sqrt(N)."""
    one = wave(comm, 2)
    shape = fw.WheelShape.of(sector(), 0, one)
    travelling, standing = fw.travelling_wave(one, 2, N)[0], fw.standing_wave(one, 2, N, 0)[0]
    motions = [travelling.shape + 1j * travelling.imaginary, standing.shape, np.eye(N)[5]]
    told = [shape(3.7 * q) for q in motions]
    assert [t["participation"] for t in told] == pytest.approx([1, 2 / 3, 1 / N])
    assert [t["amplification"] for t in told] == pytest.approx([1, np.sqrt(2), np.sqrt(N)])
    assert [t["diameters"] for t in told[:2]] == [2, 2] and told[2]["largest_sector"] == 5


def test_the_mode_most_like_a_wave_is_near_it(comm):
    """By a scatter of 1e-6 a pair splits, and both copies lie in the pair's plane."""
    one = wave(comm, 3)
    scatter = fw.deviations(N, 1e-6, seed=1)
    assert scatter.mean() == pytest.approx(0, abs=1e-18)
    with sector().wheel(comm, {"K": [[[d]] for d in scatter]}) as wheel:
        modes = fw.linear_modes(wheel, 4, "free", near=one.omega)
    assert all(abs(mode.omega / one.omega - 1) < 0.1 for mode in modes)
    found = fw.most_alike(modes, sector().around(one, 3), sector())
    assert found.omega == pytest.approx(one.omega, rel=1e-6)
