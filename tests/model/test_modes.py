"""Linear modes against closed forms and numpy's dense eigenvalues."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse as sp
from models.core_models import LinearLaw, chain, counting, distributed, friction, oscillator, single_dof
from models.hexahedra import bar
from tolerances import LAST_BIT, ROUNDING, SOLVED, TIGHT

import fretwave as fw
from fretwave.errors import NothingMoves

pytestmark = pytest.mark.ranks(1, 2, 3)

CHAIN = 12
M3 = np.array([[2.0, 0.1, 0.0], [0.1, 1.0, 0.2], [0.0, 0.2, 0.5]])
K3 = chain(3, 40.0, 5.0)
C3 = np.array([[0.5, -0.1, 0.0], [-0.1, 0.3, -0.2], [0.0, -0.2, 0.4]])


def chain_frequencies(n, k, m):
    """Chain between two walls: 2 sqrt(k/m) sin(j pi / (2 (n + 1))), j = 1..n (Meirovitch)."""
    return 2 * np.sqrt(k / m) * np.sin(np.arange(1, n + 1) * np.pi / (2 * (n + 1)))


def state_eigenvalues(M, C, K):
    """Oscillating eigenvalues of [x, x'], by dense linear algebra, ascending in Im."""
    n, inverse = len(M), np.linalg.inv(M)
    values = np.linalg.eigvals(np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ K, -inverse @ C]]))
    return sorted((v for v in values if v.imag > 1e-9), key=lambda v: v.imag)


def test_stuck_and_free_asymptotes_of_the_paper_s_oscillator(two_dof, comm):
    """sqrt(640) stuck; 24.1562 and 45.3484 rad/s free."""
    model = oscillator(two_dof, comm)
    stuck, free = fw.linear_modes(model, 2, "stuck"), fw.linear_modes(model, 2, "free")
    high = np.sqrt(1320.0 + np.sqrt(1320.0**2 - 1.2e6))
    assert [mode.omega for mode in stuck] == pytest.approx([two_dof.omega_stuck], rel=ROUNDING)
    assert [mode.omega for mode in free] == pytest.approx([two_dof.omega_free, high], rel=ROUNDING)
    assert [two_dof.omega_free, high] == pytest.approx([24.1562, 45.3484], abs=5e-5)


def test_stuck_shape_keeps_the_contact_closed(two_dof, comm):
    """The tanh law is rigid when stuck: m2 does not move, and m1 = 1 has unit modal mass."""
    shape = fw.linear_modes(oscillator(two_dof, comm), 1, "stuck")[0].shape
    assert np.abs(shape) == pytest.approx([1.0, 0.0], abs=ROUNDING)


@pytest.mark.parametrize("mass", [1e3, 1e9, 1e12, 1e15, 1e18, 1e22])
def test_a_mass_however_large_that_rigid_contact_holds_does_not_move(comm, mass):
    """The others' modes as without it (at 1e12 times their mass omega was 1e-7 off, at 1e15 39 %); two sliders."""
    others = [0, 2, 4]
    M, K = np.diag([1.0, mass, 2.0, 0.5 * mass, 3.0]), chain(5, 40.0, 2.0)
    model = fw.Model(M, K, None, [friction(np.eye(5)[[1, 3]])], comm)
    expected = scipy.linalg.eigh(K[np.ix_(others, others)], M[np.ix_(others, others)])
    modes = fw.linear_modes(model, 3, "stuck")
    assert [mode.omega for mode in modes] == pytest.approx(np.sqrt(expected[0]), rel=ROUNDING)
    found = np.abs([mode.shape for mode in modes])
    np.testing.assert_allclose(found[:, others], np.abs(expected[1].T), atol=SOLVED)
    assert found[:, [1, 3]].max() <= ROUNDING


def test_rigid_contact_that_says_nothing_more_is_left_out(comm):
    """Two dampers on one dof, the second by a factor; three round a loop of dofs, of which two hold them together."""
    M, K = np.diag([1.0, 3.0, 2.0, 0.5, 3.0]), chain(5, 40.0, 2.0)
    loop = np.array([[1.0, -1.0, 0.0, 0.0, 0.0], [0.0, 1.0, -1.0, 0.0, 0.0], [1.0, 0.0, -1.0, 0.0, 0.0]])
    contacts = [friction(np.eye(5)[[3]]), friction(2.0 * np.eye(5)[[3]], name="again"), friction(loop, name="loop")]
    free = np.array([[1.0, 1.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0, 1.0]])
    expected = scipy.linalg.eigh(free @ K @ free.T, free @ M @ free.T)
    modes = fw.linear_modes(fw.Model(M, K, None, contacts, comm), 5, "stuck")
    assert [mode.omega for mode in modes] == pytest.approx(np.sqrt(expected[0]), rel=SOLVED)
    found = np.abs([mode.shape for mode in modes])
    np.testing.assert_allclose(found, np.abs(expected[1].T @ free), atol=SOLVED)


def test_elastic_contact_adds_its_stiffness_when_stuck(comm):
    """A closed contact of stiffness kt on each mass: eigenvalues of K + kt."""
    law = LinearLaw(0.0, 0.0)
    law.stuck_stiffness = 7.0
    model = fw.Model(M3, K3, None, [fw.Contact(law, np.eye(3))], comm)
    expected = np.sqrt(np.linalg.eigvals(np.linalg.solve(M3, K3 + 7.0 * np.eye(3))).real)
    assert [m.omega for m in fw.linear_modes(model, 3, "stuck")] == pytest.approx(sorted(expected), rel=1e-11)
    assert fw.linear_modes(model, 1, "free")[0].omega < 0.99 * min(expected)


@pytest.mark.parametrize("k, m", [(1.0, 1.0), (4e9, 2e-3)])
def test_chain_of_masses_has_its_closed_form(comm, k, m):
    model = fw.Model(m * np.eye(CHAIN), chain(CHAIN, k), comm=comm)
    found = [mode.omega for mode in fw.linear_modes(model, 6, "free")]
    assert found == pytest.approx(chain_frequencies(CHAIN, k, m)[:6], rel=1e-11)


def test_sparse_dense_and_petsc_matrices_give_the_same_modes(comm):
    M, K = np.eye(CHAIN), chain(CHAIN)
    models = [
        fw.Model(M, K, comm=comm),
        fw.Model(sp.csr_matrix(M), sp.coo_matrix(K), comm=comm),
        fw.Model(distributed(M, comm), distributed(K, comm)),
    ]
    found = [[mode.omega for mode in fw.linear_modes(model, 4, "free")] for model in models]
    assert found[0] == found[1] == found[2]


def test_shapes_have_unit_modal_mass_and_are_orthogonal(comm):
    model = fw.Model(M3, K3, comm=comm)
    modes = fw.linear_modes(model, 3, "free")
    shapes = np.column_stack([mode.shape for mode in modes])
    assert np.allclose(shapes.T @ M3 @ shapes, np.eye(3), rtol=0, atol=ROUNDING)
    assert np.allclose(shapes.T @ K3 @ shapes, np.diag([m.omega**2 for m in modes]), rtol=0, atol=ROUNDING * 200)
    assert [mode.zeta for mode in modes] == [0, 0, 0]


def test_rigid_body_mode_has_no_frequency(comm):
    """Free-free chain: omega = 0 with all masses moving alike, then 2 sqrt(k/m) sin(pi j / (2 n)), j = 1, 2."""
    n = 6
    K = chain(n, 100.0)
    K[0, 0] = K[-1, -1] = 100.0
    modes = fw.linear_modes(fw.Model(np.eye(n), K, comm=comm), 3, "free")
    assert modes[0].omega == 0
    assert np.abs(modes[0].shape) == pytest.approx(np.full(n, 1 / np.sqrt(n)), rel=SOLVED)
    assert [m.omega for m in modes[1:]] == pytest.approx(20 * np.sin(np.pi * np.array([1, 2]) / (2 * n)), rel=1e-11)


def test_modes_above_rigid_motions_are_those_of_a_dense_solver(comm):
    """A free bar beside heavy oscillators (component modes of a reduced model): the shift is next to zero."""
    body = bar((8, 2, 1), (0.16, 0.02, 0.004))
    parts = [1e-4 * body.K.toarray(), np.diag(1e9 * np.arange(1.0, 9.0))], [1e-4 * body.M.toarray(), np.eye(8)]
    K, M = (scipy.linalg.block_diag((A + A.T) / 2, B) for A, B in parts)
    found = [mode.omega for mode in fw.linear_modes(fw.Model(M, K, comm=comm), 10, "free")]
    exact = np.sqrt(scipy.linalg.eigh(K, M, eigvals_only=True, subset_by_index=[6, 9]))
    np.testing.assert_allclose(found[6:], exact, rtol=SOLVED)
    assert found[:6] == [0] * 6  # whatever rounding leaves of them, on any number of ranks


def test_a_soft_motion_beside_stiff_ones_is_not_rigid(comm):
    """Two chains of springs 1e6 times apart: what is soft is known by its own entries, not by the largest."""
    K = scipy.linalg.block_diag(chain(3, 1e6), chain(3, 1.0, 1e-6))
    K[3, 3] = K[-1, -1] = 1.0 + 1e-6
    modes = fw.linear_modes(fw.Model(np.eye(6), K, comm=comm), 2, "free")
    assert [m.omega for m in modes] == pytest.approx([1e-3, np.sqrt(1 + 1e-6)], rel=1e-6)


@pytest.mark.parametrize("stiffness", [1e6, 1e8, 1e10, 1e12, 1e14])
@pytest.mark.parametrize("count", [2, 3, 5])
def test_soft_motions_beside_stiff_contact_are_exact(comm, stiffness, count):
    """A chain of six, three held by stiff springs: 2 sin(pi (j - 1/2) / 7) of the other three, to 1 / stiffness."""
    K = 2 * np.eye(6) - np.eye(6, k=1) - np.eye(6, k=-1)
    K[5, 5] = 1.0
    C = 0.01 * K
    K[:3, :3] += stiffness * np.eye(3)
    exact = 2 * np.sin(np.pi * (np.arange(1, 4) - 0.5) / 7)[: min(count, 3)]
    found = fw.linear_modes(fw.Model(np.eye(6), K, comm=comm), count, "free")[:3]
    np.testing.assert_allclose([mode.omega for mode in found], exact, rtol=1 / stiffness + ROUNDING)
    damped = fw.linear_modes(fw.Model(np.eye(6), K, C, comm=comm), len(exact), "linearised")
    np.testing.assert_allclose(
        [np.hypot(mode.omega, mode.beta) for mode in damped], exact, rtol=1 / stiffness + ROUNDING
    )
    np.testing.assert_allclose([mode.zeta for mode in damped], 0.005 * exact, rtol=1 / stiffness + SOLVED)


@pytest.mark.parametrize("contact", [1e2, 1e5, 1e9, 1e13, 1e18, np.inf])
@pytest.mark.parametrize("unit", [1.0, 1e9])
def test_stuck_contact_however_stiff_keeps_all_digits(comm, contact, unit):
    """1 on a spring of 1, and 2 behind contact: w^2 = 2 / (b + (b^2 - 8 / k)^(1/2)), b = 3 + 2 / k."""
    stiffness = {"tangential_stiffness": unit * contact, "friction_limit": 1.0}
    pair = friction([[1.0, -1.0]]) if np.isinf(contact) else fw.Contact("jenkins", [[1.0, -1.0]], stiffness)
    model = fw.Model(unit * np.diag([1.0, 2.0]), unit * np.diag([1.0, 0.0]), None, [pair], comm)
    b = 3 + 2 / contact
    exact = np.sqrt(2 / (b + np.sqrt(b**2 - 8 / contact)))
    assert fw.linear_modes(model, 1, "stuck")[0].omega == pytest.approx(exact, rel=ROUNDING)


@pytest.mark.parametrize(("stiffness", "searches"), [(1e7, 1), (1e3, 2), (1e11, 1)])
def test_one_search_finds_a_bending_mode_far_below_the_highest(comm, stiffness, searches):
    """Its frequency is far below the mean of a mesh, yet above the shift; softer motions are sought about again."""
    made = bar((25, 2, 2), (0.25, 0.02, 0.021))  # no double modes, which may take another search
    held = np.bincount(made.layer(0.0), minlength=made.K.shape[0]) * stiffness
    K, M = made.K + sp.diags(held), made.M
    with counting("EPSSolve") as solves:
        found = [mode.omega for mode in fw.linear_modes(fw.Model(M, K, comm=comm), 6, "free")]
        assert solves() == searches
    theta = scipy.linalg.eigh(M.toarray(), K.toarray(), eigvals_only=True)[::-1]  # K is positive definite
    np.testing.assert_allclose(found, 1 / np.sqrt(theta[:6]), rtol=1e-5 if stiffness < 1e7 else SOLVED)


def test_double_mode_is_found_twice(comm):
    """Ring of masses: nodal diameters 1 and 2 come as pairs, 2 sqrt(k/m) sin(pi ND / n) above the ground spring."""
    n = 6
    K = chain(n, 3.0, 1.0)
    K[0, -1] = K[-1, 0] = -3.0
    expected = [np.sqrt(1 + 12 * np.sin(np.pi * nd / n) ** 2) for nd in (0, 1, 1, 2, 2, 3)]
    modes = fw.linear_modes(fw.Model(np.eye(n), K, comm=comm), n, "free")
    assert [m.omega for m in modes] == pytest.approx(expected, rel=1e-11)


def check_quadratic_modes(modes, M, C, K):
    expected = state_eigenvalues(M, C, K)
    assert [-m.beta + 1j * m.omega for m in modes] == pytest.approx(expected, rel=TIGHT)
    for mode in modes:
        s, phi = -mode.beta + 1j * mode.omega, mode.shape + 1j * mode.imaginary
        residual = (K + s * C + s**2 * M) @ phi
        assert np.abs(residual).max() < SOLVED * np.abs(K).max() * np.abs(phi).max()


def test_damped_modes_are_those_of_the_state_matrix(comm):
    """(K + s C + s^2 M) phi = 0 against the eigenvalues of the first-order form."""
    check_quadratic_modes(fw.linear_modes(fw.Model(M3, K3, C3, comm=comm), 3, "linearised"), M3, C3, K3)


@pytest.mark.parametrize("damping", [0.0, 0.01])
@pytest.mark.parametrize("count", [1, 2])
def test_damped_modes_beside_a_free_motion(comm, damping, count):
    """Three masses that nothing holds: s^2 + damping w^2 s + w^2 = 0 with w = 1 and 3^(1/2), and no third."""
    K = np.array([[1.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
    for asked in (count, 3):
        modes = fw.linear_modes(fw.Model(np.eye(3), K, damping * K, comm=comm), asked, "linearised")
        w = np.sqrt([1.0, 3.0])[: min(asked, 2)]
        np.testing.assert_allclose([m.beta for m in modes], damping / 2 * w**2, atol=SOLVED)
        np.testing.assert_allclose([m.omega for m in modes], w * np.sqrt(1 - (damping / 2 * w) ** 2), rtol=SOLVED)


def test_friction_at_rest_is_a_viscous_damper(comm):
    """As a -> 0 the tanh law is a damper mu N / eps."""
    B = np.array([[0.0, 1.0, -1.0]])
    model = fw.Model(M3, K3, C3, [friction(B, 0.3, 2.0)], comm)
    check_quadratic_modes(fw.linear_modes(model, 3, "linearised"), M3, C3 + 0.15 * B.T @ B, K3)


def test_laws_with_memory_stick_at_rest(comm):
    """A Jenkins slider of 3 N/m on 1 N/m: omega^2 = 4 - (c/2)^2, and not of the spring alone."""
    slider = fw.Contact("jenkins", [[1.0]], {"tangential_stiffness": 3.0, "friction_limit": 1.0})
    mode = fw.linear_modes(fw.Model([[1.0]], [[1.0]], [[0.2]], [slider], comm), 1, "linearised")[0]
    assert (mode.beta, mode.omega) == pytest.approx((0.1, np.sqrt(4 - 0.1**2)), rel=SOLVED)


def test_damping_ratio_and_frequency_of_a_single_dof(comm):
    """lambda = -c/(2m) +- i sqrt(k/m - c^2/(4m^2))."""
    m, k, c = 2.0, 50.0, 0.8
    mode = fw.linear_modes(single_dof(comm, m, k, c), 1, "linearised")[0]
    assert (mode.beta, mode.zeta) == pytest.approx((c / (2 * m), c / (2 * np.sqrt(k * m))), rel=ROUNDING)
    assert mode.omega == pytest.approx(np.sqrt(k / m - (c / (2 * m)) ** 2), rel=ROUNDING)
    assert mode.frequency_hz == pytest.approx(mode.omega / (2 * np.pi), rel=LAST_BIT)


def test_negative_damping_is_reported_as_such(comm):
    mode = fw.linear_modes(single_dof(comm, 1.0, 1.0, -0.04), 1, "linearised")[0]
    assert mode.zeta == pytest.approx(-0.02, rel=ROUNDING)


@pytest.mark.parametrize("circulation", [0.0, 6.0, 60.0])
@pytest.mark.parametrize("state", ["free", "stuck"])
def test_circulatory_forces_make_undamped_modes_flutter(comm, circulation, state):
    """K with +c above and -c below its diagonal, C left out: two frequencies meet, then beta is of both signs."""
    K = K3 + circulation * (np.eye(3, k=1) - np.eye(3, k=-1)) * [[1.0, 1.0, 1.0], [1.0, 1.0, 0.3], [1.0, 0.3, 1.0]]
    B = np.array([[0.0, 1.0, -1.0]])
    slider = fw.Contact("jenkins", B, {"tangential_stiffness": 7.0, "friction_limit": 1.0})
    model = fw.Model(M3, K, C3, [slider], comm)
    modes = fw.linear_modes(model, 3, state)
    K = K + (7.0 * B.T @ B if state == "stuck" else 0.0)
    values = -np.array([m.beta for m in modes]) + 1j * np.array([m.omega for m in modes])
    exact = state_eigenvalues(M3, 0.0 * C3, K)
    assert (max(v.real for v in exact) > 0.1) == (circulation > 10)
    np.testing.assert_allclose(sorted(values, key=ascending), sorted(exact, key=ascending), rtol=1e-8)
    for mode, value in zip(modes, values):
        phi = mode.shape + 1j * mode.imaginary
        np.testing.assert_allclose(K @ phi + value**2 * M3 @ phi, 0.0, atol=1e-8)
        assert np.vdot(phi, M3 @ phi) == pytest.approx(1.0, rel=SOLVED)


def test_what_rounding_leaves_of_symmetry_is_none(comm):
    """Reduced matrices have it of their largest entries: their soft rows are off by far more of themselves."""
    K = np.array([[1e9, 0.0, 0.0], [0.0, 200.0, -100.0], [0.0, -100.0 * (1 + 1e-9), 200.0]])
    modes = fw.linear_modes(fw.Model(4.0 * np.eye(3), K, comm=comm), 2, "free")
    assert [mode.omega for mode in modes] == pytest.approx([5.0, np.sqrt(75.0)], rel=1e-8)
    for mode in modes:
        assert not mode.imaginary.any() and 4 * mode.shape @ mode.shape == pytest.approx(1.0, rel=SOLVED)


def test_penalties_hide_no_circulatory_forces(comm):
    """A dof held by 1e12 beside two that flutter: omega^2 = 210 +- i (900 - 100)^(1/2)."""
    K = np.zeros((3, 3))
    K[0, 0], K[1:, 1:] = 1e12, [[200.0, 30.0], [-30.0, 220.0]]
    modes = fw.linear_modes(fw.Model(np.eye(3), K, comm=comm), 2, "free")
    exact = np.sqrt(210 + 1j * np.sqrt(800.0))
    assert [mode.omega for mode in modes] == pytest.approx([exact.real] * 2, rel=1e-8)
    assert sorted(mode.beta for mode in modes) == pytest.approx([-exact.imag, exact.imag], rel=1e-6)


def ascending(value):
    return round(value.imag, 6), value.real


def test_circulatory_forces_leave_some_requests_unanswered(comm):
    K = K3 + np.array([[0.0, 5.0, 0.0], [-5.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    with pytest.raises(fw.InputError, match="near a frequency"):
        fw.linear_modes(fw.Model(M3, K, comm=comm), 1, "free", near=3.0)
    with pytest.raises(fw.InputError, match="rigid contact"):
        fw.linear_modes(fw.Model(M3, K, None, [friction([[0.0, 1.0, -1.0]])], comm), 1, "stuck")


def test_no_more_modes_than_degrees_of_freedom(comm):
    assert len(fw.linear_modes(fw.Model(M3, K3, comm=comm), 10, "free")) == 3


def test_unusable_requests_are_refused(comm):
    with pytest.raises(fw.InputError, match="state of contact"):
        fw.linear_modes(single_dof(comm), 1, "sticking")
    with pytest.raises(NothingMoves, match="no degree of freedom"):
        fw.linear_modes(single_dof(comm, law=friction([[1.0]])), 1, "stuck")


def test_a_factor_larger_than_the_machine_is_refused_in_words(comm, monkeypatch):
    """200 entries in each of 1,000 rows, as of solid elements: their factors take 16 MB, twice the whole matrix."""
    n = 1000
    far = sp.diags([np.full(n - k, -1.0) for k in range(1, 101)], range(1, 101))
    K = sp.csr_matrix(far + far.T + 201.0 * sp.identity(n))
    with fw.Model(sp.identity(n, format="csr"), K, comm=comm) as model:
        assert model.entries == K.nnz
        assert len(fw.linear_modes(model, 1)) == 1
        monkeypatch.setattr("fretwave.model.modes.machine_memory", lambda: 15.9e6)
        with pytest.raises(fw.InputError, match="factor larger than the memory") as refused:
            fw.linear_modes(model, 1)
        assert refused.value.measured == "about 16 MB for 1,000 dofs"
        monkeypatch.setattr("fretwave.model.modes.machine_memory", lambda: 16.1e6)
        assert len(fw.linear_modes(model, 1)) == 1
