"""No linear mode is missed: double modes of wheels, families of close modes, many at one frequency; against numpy."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
from models.core_models import chain, single_dof
from petsc4py import PETSc
from tolerances import REPEATED, ROUNDING, SOLVED

import fretwave as fw
from fretwave import fe
from fretwave.errors import FretwaveError, InputError

#: Wheels and chains drawn by the property test; several ranks take every 25th.
DRAWN = 200


def wheel(rng):
    """A ring of equal or mistuned sectors of 1 to 3 dofs, coupled strongly, weakly or not at all."""
    sectors, size = int(rng.integers(2, 31)), int(rng.integers(1, 4))
    coupling = 10.0 ** rng.uniform(-9, 1)
    scatter = rng.choice([0.0, 1e-12, 1e-8, 1e-4])
    n = sectors * size
    K, M = np.zeros((n, n)), np.zeros((n, n))
    own, mass = chain(size, rng.uniform(0.5, 2.0), rng.uniform(0.0, 0.5)), np.diag(rng.uniform(0.5, 2.0, size))
    for j in range(sectors):
        here, there = j * size, (j + 1) % sectors * size
        block = slice(here, here + size)
        K[block, block] += own * (1 + scatter * rng.standard_normal())
        M[block, block] += mass
        tie = np.array([[1, -1], [-1, 1]]) * coupling
        K[np.ix_([here, there], [here, there])] += tie
    return K, M


def row(rng):
    """A chain of random springs, held or free."""
    n = int(rng.integers(2, 40))
    springs = 10.0 ** rng.uniform(-2, 2, n + 1)
    if rng.random() < 0.3:
        springs[0] = springs[-1] = 0.0
    K = np.diag(springs[:-1] + springs[1:]) - np.diag(springs[1:-1], 1) - np.diag(springs[1:-1], -1)
    return K, np.diag(rng.uniform(0.2, 5.0, n))


def squares(K, M):
    """Eigenvalues by dense linear algebra, ascending."""
    root = 1 / np.sqrt(np.diag(M))
    return np.linalg.eigvalsh(root[:, None] * K * root)


def check(comm, K, M, count):
    modes = fw.linear_modes(fw.Model(M, K, comm=comm), count, "free")
    expected = np.maximum(squares(K, M), 0.0)[:count]
    size = squares(K, M)[-1]
    assert len(modes) == min(count, len(K))
    assert np.allclose([mode.omega**2 for mode in modes], expected, rtol=SOLVED, atol=ROUNDING * size)
    shapes = np.column_stack([mode.shape for mode in modes])
    assert np.allclose(shapes.T @ M @ shapes, np.eye(len(modes)), rtol=0, atol=REPEATED)


@pytest.mark.ranks(1, 2, 3)
def test_random_wheels_and_chains_have_all_their_lowest_modes(comm):
    """Multiplicity and order of as many modes as are asked for."""
    for seed in range(0, DRAWN, 1 if comm.size == 1 else 25):
        rng = np.random.default_rng(seed)
        K, M = (wheel if seed % 2 else row)(rng)
        check(comm, K, M, int(rng.integers(1, min(len(K), 12) + 1)))


def test_many_modes_at_one_frequency(comm):
    """600 equal masses that nothing couples, above the size that each rank takes whole: one eigenvalue 600 times."""
    check(comm, 4.0 * np.eye(600), np.eye(600), 8)


def test_a_family_closer_than_the_eigensolver_resolves_by_its_first_vector(comm):
    """520 blades within 1e-9, and two single ones below them."""
    k = 1 + 1e-9 * np.arange(520) / 520
    k[:2] = 0.25, 0.5
    check(comm, np.diag(k), np.eye(520), 6)


def test_double_waves_of_a_sector_are_counted_once(comm):
    """A travelling wave's real form doubles every eigenvalue: two dofs have two modes."""
    model = fw.Model(
        {0: np.eye(2)},
        {0: np.array([[3.0, -1.0], [-1.0, 2.0]]), 1: -0.5 * np.eye(2), -1: -0.5 * np.eye(2)},
        comm=comm,
        sectors=12,
        nodal_diameter=5,
    )
    theta = 2 * np.pi * 5 / 12
    expected = np.linalg.eigvalsh(np.array([[3.0, -1.0], [-1.0, 2.0]]) - np.cos(theta) * np.eye(2))
    assert [m.omega**2 for m in fw.linear_modes(model, 9, "free")] == pytest.approx(expected, rel=1e-11)


def test_modes_that_do_not_converge_are_named(comm):
    """Before: the list was short, and nothing was said."""
    n = 700
    options = PETSc.Options("modes_")
    options["eps_max_it"], options["eps_ncv"] = 1, 14
    try:
        with pytest.raises(FretwaveError, match="linear modes.*converge"):
            fw.linear_modes(fw.Model(np.eye(n), chain(n), comm=comm), 10, "free")
    finally:
        del options["eps_max_it"], options["eps_ncv"]


def test_an_unstable_direction_does_not_count_as_missed(comm):
    """One negative stiffness: its mode has omega 0 as before, and nothing else is looked for."""
    K = np.diag([-2.0, 1.0, 4.0, 9.0])
    assert [m.omega for m in fw.linear_modes(fw.Model(np.eye(4), K, comm=comm), 3, "free")] == pytest.approx([0, 1, 2])


@pytest.mark.parametrize("n", [5, 40, 700])
@pytest.mark.parametrize("spring", [-0.6, -1.3, -30.0])
def test_a_structure_that_is_unstable_is_refused_where_it_has_to_be_stable(comm, n, spring):
    """A chain between two walls, and a spring beside one of its own that outdoes it and all others or does not."""
    K = chain(n)
    K[2:4, 2:4] += spring * np.array([[1.0, -1.0], [-1.0, 1.0]])
    model = fw.Model(np.eye(n), K, comm=comm)
    squares = np.linalg.eigvalsh(K)
    if squares[0] < 0:
        with pytest.raises(InputError, match="statically unstable"):
            fw.linear_modes(model, 3, "stuck", stable=True)
    else:
        modes = fw.linear_modes(model, 3, "stuck", stable=True)
        assert [mode.omega**2 for mode in modes] == pytest.approx(squares[:3], rel=1e-6, abs=1e-12)


@pytest.mark.parametrize("digits", [8, 9, 12, 15])
@pytest.mark.parametrize("count", [1, 3, 8])
def test_rigid_motions_that_printed_digits_make_negative_are_stable(comm, digits, count):
    """A free block of hexahedra, distorted: six motions at zero but for the digits that its K has lost."""
    M, K = (printed(A.toarray(), digits) for A in free_block())
    squares = scipy.linalg.eigh(K, M, eigvals_only=True)
    modes = fw.linear_modes(fw.Model(M, K, comm=comm), count, stable=True)
    assert digits > 9 or squares[0] < -1e-12 * squares[-1]
    if count == 8:
        assert [mode.omega for mode in modes[6:]] == pytest.approx(np.sqrt(squares[6:8]), rel=1e-4)


def free_block():
    """M and K of 3 x 2 x 2 cells."""
    block = fe.Block("block", (3, 2, 2), lambda u: u * [0.3, 0.2, 0.1] + 0.02 * np.sin(3 * u[:, ::-1]))
    return fe.assemble(fe.join([block], 2), fe.Material(210e9, 0.3, 7850.0))


def printed(A, digits):
    """Symmetric, each entry with so many significant digits."""
    return np.array([[float(f"{x:.{digits - 1}e}") for x in row] for row in (A + A.T) / 2])


def test_a_single_dof_has_one_mode(comm):
    assert [m.omega for m in fw.linear_modes(single_dof(comm, 4.0, 1.0), 5, "free")] == pytest.approx([0.5])


@pytest.mark.parametrize("beyond", [1.01, 1e3, 1e9, 1e40, 1e90])
def test_modes_near_a_frequency_beyond_all_are_the_highest(beyond, comm):
    """K is lost beside its shift times M otherwise: 5e51 Hz, or PETSc's own words."""
    n = 6
    K = 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    exact = 2 * np.sin(np.pi * np.arange(1, n + 1) / (2 * (n + 1)))  # of a chain between two walls
    found = fw.linear_modes(fw.Model(np.eye(n), K, comm=comm), 3, "free", near=beyond * exact[-1])
    assert [mode.omega for mode in found] == pytest.approx(exact[-3:], rel=1e-6)


@pytest.mark.parametrize("state", ["free", "stuck", "linearised"])
def test_a_ring_of_masses_turns_freely(comm, state):
    """m x'' = k (x_next + x_last - 2 x): omega = 2 (k/m)^(1/2) sin(pi d / N), whose terms cancel in the wave d = 0."""
    m, k, sectors = 2.0, 7.3e9, 7
    K = {0: np.array([[2 * k]]), 1: np.array([[-k]]), -1: np.array([[-k]])}
    for d in range(4):
        model = fw.Model(m * np.eye(1), K, comm=comm, sectors=sectors, nodal_diameter=d)
        found = [mode.omega for mode in fw.linear_modes(model, 1, state)]
        if state == "linearised" and d == 0:
            assert not found, "a motion that does not oscillate"
        else:
            assert found == pytest.approx([2 * np.sqrt(k / m) * np.sin(np.pi * d / sectors)], rel=SOLVED)


@pytest.mark.parametrize("state", ["free", "stuck", "linearised"])
@pytest.mark.parametrize("springs", [(0.1, 0.2), (0.1, 0.7), (0.3, 0.6)])
def test_terms_cancel_but_for_rounding(comm, state, springs):
    """Springs to the next and to the second next mass: 2 (0.1 + 0.2) - 0.2 - 0.4 is 5e-17."""
    one, two = springs
    parts = {1: -one, 0: 2 * (one + two), -1: -one, 2: -two, -2: -two}
    K = {k: np.array([[value]]) for k, value in parts.items()}
    model = fw.Model(np.eye(1), K, comm=comm, sectors=7, nodal_diameter=0)
    assert [mode.omega for mode in fw.linear_modes(model, 1, state)] == ([] if state == "linearised" else [0.0])
