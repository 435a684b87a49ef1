"""Matrices times all coefficients of a dof at once, for numbers of them that fill registers or do not."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
from models.core_models import distributed, unknowns, whole
from test_transpose import assert_adjoint
from tolerances import ROUNDING

import fretwave as fw

N = 60  #: masses: sparse enough not to be held dense
FULL, LARGE = 135, 603  #: of dense models: columns by four, and three more
OMEGA = 0.7  #: [rad/s]


def matrices() -> tuple[sp.csr_matrix, sp.csr_matrix, sp.csr_matrix]:
    """Mass, damping and stiffness of long-reaching springs, each with entries of its own."""
    rng = np.random.default_rng(5)
    far = sp.random(N, N, 0.05, random_state=3)
    K = sp.diags([rng.uniform(4, 5, N)], [0]) + far + far.T
    C = sp.diags([rng.uniform(0.1, 0.2, N - 3)], [3])
    return sp.diags([rng.uniform(1, 2, N)], [0]).tocsr(), C.tocsr(), K.tocsr()


def full_matrices(n: int = FULL) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mass, damping and stiffness without zeros."""
    rng = np.random.default_rng(6)
    M, C, K = ((A @ A.T) / n for A in rng.standard_normal((3, n, n)))
    return M + np.eye(n), 0.1 * C, K + 3 * np.eye(n)


def large_matrices() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The same, of more than a million products with 9 coefficients on three ranks."""
    return full_matrices(LARGE)


@pytest.mark.ranks(1, 2, 3)
@pytest.mark.parametrize(
    "orders", [[1], [1, 3], range(4), range(5), range(8), range(9), range(17), range(18), range(35)]
)
@pytest.mark.parametrize("of", [matrices, full_matrices, large_matrices])
def test_dynamic_stiffness_of_every_harmonic(comm, orders, of):
    """K + i n w C - (n w)^2 M of each harmonic's q = qc - i qs, and its transpose."""
    M, C, K = of()
    n_dof = M.shape[0]
    model = fw.Model(M, K, C, [], comm)
    harmonics = fw.Harmonics(orders, 128)
    problem = fw.ForcedResponse(model, harmonics, {1: np.eye(n_dof)[0]}, 1.0, 0, fw.linear_modes(model, 1)[0])
    m = harmonics.block_size
    q = np.random.default_rng(1).standard_normal((n_dof, m))
    y = problem.initial(OMEGA)
    assert y.getSize() == n_dof * m + 1
    found = whole(problem.jacobian_product(y, unknowns(problem, np.append(q.ravel(), 0.0)))).reshape(n_dof, m)
    expected, at = np.zeros_like(q), 0
    for n in orders:
        Z = K + 1j * n * OMEGA * C - (n * OMEGA) ** 2 * M
        if n == 0:
            expected[:, 0] = (Z @ q[:, 0]).real
            at = 1
            continue
        z = Z @ (q[:, at] - 1j * q[:, at + 1])
        expected[:, at], expected[:, at + 1] = z.real, -z.imag
        at += 2
    scale = np.vdot(found, expected) / np.vdot(found, found)
    np.testing.assert_allclose(scale * found, expected, rtol=0, atol=ROUNDING * np.abs(expected).max())
    assert_adjoint(problem, np.append(q.ravel(), OMEGA))


@pytest.mark.ranks(1, 2, 3)
@pytest.mark.parametrize("kind", ["aijperm", "aijsell"])
def test_types_derived_from_aij_are_taken(comm, kind):
    """A residual and a reduction of matrices as a user of PETSc may hold them."""
    M, _, K = matrices()
    given = [distributed(A.toarray(), comm, kind) for A in (M, K)]
    model = fw.Model(*given, None, [], comm)
    problem = fw.ForcedResponse(model, fw.Harmonics([1], 8), {1: np.eye(N)[0]}, 1.0, 0, fw.linear_modes(model, 1)[0])
    q = np.random.default_rng(1).standard_normal((N, 2))
    found = whole(problem.jacobian_product(problem.initial(OMEGA), unknowns(problem, np.append(q.ravel(), 0.0))))
    expected = ((K - OMEGA**2 * M) @ q).ravel()
    scale = expected[0] / found[0]
    np.testing.assert_allclose(scale * found[: 2 * N], expected, rtol=0, atol=ROUNDING * abs(expected).max())
    with fw.reduce(*given, keep=[11, 0, 5], modes=2) as derived, fw.reduce(M, K, keep=[11, 0, 5], modes=2) as plain:
        np.testing.assert_allclose(derived.K, plain.K, atol=ROUNDING * abs(plain.K).max())
        np.testing.assert_allclose(derived.M, plain.M, atol=ROUNDING)
