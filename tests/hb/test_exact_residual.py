"""Residuals are as exact as the matrices: the terms of a sparse stiffness cancel without their rounding."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
from models.hexahedra import Bar, bar

import fretwave as fw

SIZE = (0.25, 0.02, 0.02)


def model(made: Bar, order: np.ndarray) -> fw.Model:
    """With its dofs in this order; its root stuck."""
    M, K = (sp.csr_matrix(A)[order][:, order] for A in (made.M, made.K))
    B = sp.eye(len(order)).tocsr()[np.argsort(order)[made.layer(0.0)]]
    return fw.Model(M, K, contacts=[fw.Contact("jenkins", B, {"tangential_stiffness": 1e8, "friction_limit": 1e9})])


def residual(made: Bar, order: np.ndarray, mode: fw.LinearMode, highest: int) -> np.ndarray:
    """Of a linear mode (in the first order), in the first order: dofs x coefficients."""
    shape = fw.LinearMode(mode.omega, mode.beta, mode.shape[order], mode.imaginary[order])
    harmonics, back = fw.Harmonics(range(highest + 1), 4 * highest + 4), np.argsort(order)
    problem = fw.NonlinearMode(model(made, order), harmonics, "EPMC", int(back[made.layer(SIZE[0])[2]]), shape)
    y, r = problem.initial(1e-5), problem.core.unknowns()
    problem.core.residual(y, r)
    return r.array[: len(order) * harmonics.block_size].reshape(len(order), -1)[back]


@pytest.mark.ranks(1)
@pytest.mark.parametrize("cells", [(60, 2, 2), (200, 1, 1)], ids=["thick", "slender"])
@pytest.mark.parametrize("highest", [1, 16])
def test_residual_does_not_know_the_order_of_the_dofs(cells: tuple[int, int, int], highest: int) -> None:
    """What is left of a mode, to 2e-6 of itself; with rounded products to 0.7. 33 coefficients: three strips."""
    made = bar(cells, SIZE)
    given, drawn = np.arange(made.K.shape[0]), np.random.default_rng(4).permutation(made.K.shape[0])
    mode = fw.linear_modes(model(made, given), 1)[0]
    one, other = (residual(made, order, mode, highest) for order in (given, drawn))
    assert np.abs(other - one).max() <= 1e-5 * np.abs(one).max()
