"""Modes of a mistuned wheel by waves of the tuned one, against the dense eigenproblem of the wheel."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse as sp
from tolerances import TIGHT

import fretwave as fw
from fretwave.cyclic.nominal_modes import Mistuning, mistuned_frequencies, mistuned_modes

N, CHAIN = 7, 8
DEVIATIONS = np.array([0.05, -0.02, 0.03, -0.04, 0.01, 0.02, -0.05])


def tied() -> fw.Structure:
    """A hub between two faces, with a chain of masses on it; what is mistuned reaches the hub and both faces."""
    n = CHAIN + 3  # low face, hub, chain, high face
    links = [(0, 1, 4.0), (1, n - 1, 4.0), *((k, k + 1, 9.0) for k in range(1, CHAIN + 1))]
    K, part = np.diag([1.0] + [0.2] * (n - 1)), np.zeros((n, n))
    for a, b, k in links:
        row = np.zeros(n)
        row[[a, b]] = 1.0, -1.0
        K += k * np.outer(row, row)
        part += k * np.outer(row, row)
    M = np.diag([0.5] + [1.0] * (n - 2) + [0.5])
    return fw.Structure(
        M, K, sectors=N, low=np.array([0]), high=np.array([n - 1]), parts={"links": sp.csr_matrix(part)}
    ).tied()


def dense() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    whole = tied().around(DEVIATIONS, "links")
    K, M = (whole.own(letter).toarray() for letter in "KM")
    square, shapes = scipy.linalg.eigh(K, M)
    return np.sqrt(square), shapes, M


def found(comm, kept: int, near: float) -> list[fw.LinearMode]:
    one = tied()
    waves = {}
    for d in range(N // 2 + 1):
        with one.model((), comm, d) as model:
            waves[d] = fw.linear_modes(model, kept, "free", near)
    mistuning = Mistuning(DEVIATIONS, one.parts["links"], one.ties)
    modes = mistuned_modes(waves, mistuning, near, N)
    assert [mode.omega for mode in modes] == pytest.approx(mistuned_frequencies(waves, mistuning, near, N))
    return modes


def test_all_waves_give_the_modes_of_the_wheel(comm) -> None:
    omega, shapes, M = dense()
    modes = found(comm, CHAIN + 2, omega[N])
    nearest = np.sort(np.argsort(np.abs(omega - omega[N]))[:N])
    for mode, k in zip(modes, nearest):
        assert mode.omega == pytest.approx(omega[k], rel=TIGHT)
        assert abs(mode.shape @ M @ shapes[:, k]) == pytest.approx(1, abs=1e-9)


@pytest.mark.ranks(1)
def test_more_waves_give_better_modes(comm) -> None:
    """From above, as those of Rayleigh and Ritz are."""
    omega = dense()[0]
    off = []
    for kept in (2, 4, 6):
        off.append(np.array([mode.omega for mode in found(comm, kept, omega[0])]) / omega[:N] - 1)
        assert off[-1].min() > -1e-12
    worst = [one.max() for one in off]
    assert worst[0] > 1e-6 and worst[1] < worst[0] / 2 and worst[2] < worst[1] / 2
