"""Craig-Bampton reduction: what it must keep exactly, how it converges, and what it refuses."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse as sp
import scipy.sparse.linalg
from models.core_models import counting
from models.hexahedra import Bar, bar
from mpi4py import MPI
from petsc4py import PETSc
from tolerances import REPEATED, ROUNDING, SOLVED, TIGHT

import fretwave as fw
from fretwave.errors import InputError, PetscError
from fretwave.model import residual_statics
from fretwave.model.reduction import Reduction, reduce
from fretwave.model.residual_statics import held_displacement


@pytest.fixture(scope="module")
def block() -> Bar:
    """189 dofs: component modes by LAPACK."""
    return bar((6, 2, 2), (0.12, 0.02, 0.03))


@pytest.fixture(scope="module")
def blade() -> Bar:
    """702 dofs of square section, hence double bending modes; component modes by Krylov-Schur."""
    return bar((25, 2, 2), (0.25, 0.02, 0.02))


def root_and_tip(made: Bar) -> np.ndarray:
    """All of the root, and one node of the tip."""
    return np.append(made.layer(0.0), made.layer(made.nodes[:, 0].max())[:3])


@contextmanager
def reduced(made: Bar, **options: Any) -> Iterator[Reduction]:
    options.setdefault("keep", root_and_tip(made))
    with reduce(made.M, made.K, **options) as reduction:
        yield reduction


def squares(K: np.ndarray, M: np.ndarray) -> np.ndarray:
    return scipy.linalg.eigh(K, M, eigvals_only=True)


def held(made: Bar, stiffness: float = 1e9) -> sp.csr_matrix:
    """Springs on the root, as of stuck contact."""
    on_root = np.bincount(made.layer(0.0), minlength=made.K.shape[0])
    return sp.diags(on_root * stiffness).tocsr()


def on_kept(extra: sp.csr_matrix, reduction: Reduction) -> np.ndarray:
    out, n = np.zeros_like(reduction.K), len(reduction.keep)
    out[:n, :n] = extra[reduction.keep][:, reduction.keep].toarray()
    return out


@pytest.mark.ranks(1, 2, 3)
@pytest.mark.parametrize("modes", [0, 5])
def test_static_displacement_under_loads_on_internal_dofs(block: Bar, modes: int) -> None:
    """With what lies beyond the component modes it is the unreduced one, which they alone miss."""
    extra, f = held(block), np.random.default_rng(3).normal(size=(block.K.shape[0], 2))
    exact = scipy.sparse.linalg.spsolve((block.K + extra).tocsc(), f)
    with reduced(block, modes=modes) as reduction:
        coordinates = np.linalg.solve(reduction.K + on_kept(extra, reduction), reduction.project(f))
        alone, beyond = reduction.expand(coordinates), reduction.beyond(f)
        assert reduction.beyond(f[:, 0]) == pytest.approx(beyond[:, 0])
    assert not beyond[root_and_tip(block)].any()
    size = abs(exact).max()
    assert abs(alone - exact).max() > 1e-3 * size
    np.testing.assert_allclose(alone + beyond, exact, rtol=0, atol=SOLVED * size)


@pytest.fixture
def factors(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Numbers of the columns that each factorisation for static displacements serves."""
    made, original = [], residual_statics._solved

    def noted(A: PETSc.Mat, b: np.ndarray) -> np.ndarray:
        made.append(b.shape[1])
        return original(A, b)

    monkeypatch.setattr(residual_statics, "_solved", noted)
    return made


@pytest.mark.ranks(1, 2, 3)
def test_one_factorisation_serves_all_loads(block: Bar, factors: list[int]) -> None:
    """None of loads on kept dofs alone, which leave the internal dofs where these put them."""
    f = np.random.default_rng(4).normal(size=(block.K.shape[0], 4))
    keep = root_and_tip(block)
    f[np.setdiff1d(np.arange(len(f)), keep), 1:3] = 0.0
    with reduced(block, modes=2) as reduction:
        together, alone = reduction.beyond(f), reduction.beyond(f[:, 1:3])
        assert factors == [2] and not alone.any() and not together[:, 1:3].any()
        np.testing.assert_allclose(together[:, 3], reduction.beyond(f[:, 3]), rtol=0, atol=ROUNDING * abs(f).max())
    assert np.abs(together[:, [0, 3]]).max(axis=0).min() > 0


@pytest.mark.ranks(1, 2)
def test_internal_dofs_that_nothing_holds_are_told(comm: MPI.Comm) -> None:
    """The last dof has no stiffness: PETSc goes on with numbers that are none."""
    K = sp.diags([2.0, 2.0, 2.0, 0.0]).tocsr()
    with fw.Model(sp.identity(4), K, comm=comm) as model:
        f = model.distribute(np.ones((4, 1)))
        with pytest.raises(PetscError, match="cannot be solved for"):
            held_displacement(model._matrices[0], np.array([0]), f)


@pytest.mark.ranks(1, 2, 3)
def test_all_component_modes_give_the_exact_frequencies(block: Bar) -> None:
    extra, n = held(block), block.K.shape[0]
    exact = np.sqrt(squares((block.K + extra).toarray(), block.M.toarray()))
    with reduced(block, modes=n - len(root_and_tip(block))) as reduction:
        assert reduction.size == n
        found = np.sqrt(squares(reduction.K + on_kept(extra, reduction), reduction.M))
    np.testing.assert_allclose(found, exact, rtol=TIGHT)


def test_what_is_omitted_is_what_the_structure_has_and_the_reduction_has_not(block: Bar) -> None:
    """Where all other modes are among them, the dynamic stiffness of the kept dofs is exact, damped too."""
    keep, s = root_and_tip(block), 300.0 + 1.5e6j  # among them
    K, M = block.K.toarray(), block.M.toarray()
    share, mass = 1e-7, 50.0
    C = share * K + mass * M
    inside = np.setdiff1d(np.arange(len(K)), keep)
    exact = condensed(K + s * C + s * s * M, keep, inside)
    count = (len(inside) + 1) // 2
    with reduced(block, modes=count) as without, reduce(block.M, block.K, C, keep=keep, modes=count) as damped:
        assert len(without.omitted.omega) == len(inside) - count and without.omitted.omega[0] < abs(s)
        C_r = share * without.K + mass * without.M
        for r, damping, omitted in (
            (damped, damped.C, damped.omitted),
            (without, C_r, without.omitted.damped(share, mass)),
        ):
            Z = r.K + s * damping + s * s * r.M
            forces = np.column_stack([omitted.forces(s, s * s, x) for x in np.eye(r.size, dtype=complex)])
            kept, modes = np.arange(len(keep)), np.arange(len(keep), r.size)
            scale = np.abs(exact).max()
            assert np.abs(condensed(Z + forces, kept, modes) - exact).max() < TIGHT * scale
            assert np.abs(condensed(Z, kept, modes) - exact).max() > 1e-4 * scale


def condensed(Z: np.ndarray, kept: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """Dynamic stiffness of the kept dofs, no force on the others."""
    one, other = Z[np.ix_(kept, kept)], Z[np.ix_(inside, kept)]
    return one - Z[np.ix_(kept, inside)] @ np.linalg.solve(Z[np.ix_(inside, inside)], other)


def test_frequencies_fall_to_the_exact_ones_as_modes_are_added(block: Bar) -> None:
    errors = []
    for modes in (0, 2, 5, 10, 20, 40, 80):
        with reduced(block, modes=modes) as reduction:
            errors.append(reduction.error(4, held(block)).relative)
    assert np.all(np.array(errors) > -1e-10)
    assert np.all(np.diff(errors, axis=0) < TIGHT)
    assert np.all(errors[0] > 1e-4) and errors[0].max() > 1e-2
    assert np.all(errors[-1] < 1e-5)


def test_static_response_is_exact(block: Bar) -> None:
    extra, rng = held(block), np.random.default_rng(1)
    load = np.zeros(block.K.shape[0])
    load[root_and_tip(block)] = rng.normal(size=len(root_and_tip(block)))
    exact = scipy.sparse.linalg.spsolve((block.K + extra).tocsc(), load)
    with reduced(block, modes=3) as reduction:
        found = reduction.expand(np.linalg.solve(reduction.K + on_kept(extra, reduction), reduction.project(load)))
    np.testing.assert_allclose(found, exact, rtol=0, atol=ROUNDING * np.abs(exact).max())


def test_rigid_motions_are_reproduced(block: Bar) -> None:
    motions = block.rigid_motions()
    with reduced(block, modes=4) as reduction:
        x_r = np.zeros((reduction.size, 6))
        x_r[: len(reduction.keep)] = motions[reduction.keep]
        np.testing.assert_allclose(reduction.expand(x_r), motions, atol=ROUNDING)
        np.testing.assert_allclose(reduction.K @ x_r, 0, atol=ROUNDING * np.abs(block.K).max())
        mass = motions.T @ block.M @ motions
        np.testing.assert_allclose(x_r.T @ reduction.M @ x_r, mass, atol=ROUNDING * mass.max())


def test_reduced_matrices_are_the_congruence_with_the_expanded_unit_vectors(block: Bar) -> None:
    C = 1e-6 * block.K + sp.random(*block.K.shape, density=0.01, random_state=3, format="csr")  # not symmetric
    with reduced(block, C=C, modes=6) as reduction:
        T, n = reduction.expand(np.eye(reduction.size)), len(reduction.keep)
        for found, A in ((reduction.K, block.K), (reduction.M, block.M), (reduction.C, C)):
            expected = T.T @ (A @ T)
            np.testing.assert_allclose(found, expected, atol=SOLVED * np.abs(expected).max())
        np.testing.assert_array_equal(T[reduction.keep], np.eye(n, reduction.size))
        np.testing.assert_allclose(reduction.project(block.M @ T), reduction.M, atol=SOLVED)
        for A in (reduction.K, reduction.M):
            np.testing.assert_array_equal(A, A.T)
        np.testing.assert_array_equal(reduction.K[:n, n:], 0)
        np.testing.assert_allclose(reduction.K[n:, n:], np.diag((2 * np.pi * reduction.component_hz) ** 2))
        np.testing.assert_array_equal(reduction.M[n:, n:], np.eye(6))


@pytest.mark.skipif(np.finfo(np.longdouble).eps > 1e-18, reason="no numbers of more digits to compare with")
@pytest.mark.ranks(1, 2, 3)
@pytest.mark.parametrize("cells", [(6, 2, 2), (25, 2, 2), (200, 1, 1)])
def test_stiffness_of_the_kept_dofs_is_rounded_once(cells: tuple[int, int, int]) -> None:
    """Terms of K are up to 1e8 times what is left of them: with every product rounded 7 to 700 last digits off."""
    made = bar(cells, (0.25, 0.02, 0.02))
    keep, K = root_and_tip(made), sp.csr_matrix((made.K + made.K.T) / 2)  # its rounding is not symmetric
    inside = np.setdiff1d(np.arange(K.shape[0]), keep)
    factor = scipy.sparse.linalg.splu(K[inside][:, inside].tocsc())
    x = np.zeros((K.shape[0], len(keep)), np.longdouble)
    x[keep] = np.eye(len(keep))
    for _ in range(4):
        x[inside] -= factor.solve((K.astype(np.longdouble) @ x)[inside].astype(float))
    exact = (K.astype(np.longdouble) @ x)[keep]
    with reduce(made.M, K, keep=keep, modes=1) as reduction:
        off = np.abs(reduction.K[: len(keep), : len(keep)] - exact).max()
        assert off <= np.spacing(float(np.abs(exact).max()))


def test_kept_dofs_stand_in_the_order_given(block: Bar) -> None:
    keep = root_and_tip(block)
    order = np.random.default_rng(2).permutation(len(keep))
    with reduced(block, modes=3) as plain, reduced(block, keep=keep[order], modes=3) as mixed:
        full_order = np.append(order, len(keep) + np.arange(3))
        np.testing.assert_allclose(
            mixed.M, plain.M[np.ix_(full_order, full_order)], atol=SOLVED * np.abs(plain.M).max()
        )
        np.testing.assert_array_equal(mixed.keep, keep[order])


def fixed_interface_hz(made: Bar, count: int) -> np.ndarray:
    inside = np.setdiff1d(np.arange(made.K.shape[0]), root_and_tip(made))
    K, M = (A[inside][:, inside].toarray() for A in (made.K, made.M))
    return np.sqrt(scipy.linalg.eigh(K, M, eigvals_only=True, subset_by_index=(0, count - 1))) / (2 * np.pi)


@pytest.mark.ranks(1, 2, 3)
@pytest.mark.parametrize("model", ["block", "blade"])
def test_component_modes_by_count_and_by_frequency(model: str, request: pytest.FixtureRequest) -> None:
    made = request.getfixturevalue(model)
    exact = fixed_interface_hz(made, 12)
    limit = 0.5 * (exact[7] + exact[8]) if exact[8] > 1.001 * exact[7] else 0.5 * (exact[8] + exact[9])
    with reduced(made, modes=9) as by_count, reduced(made, highest_hz=limit) as by_frequency:
        np.testing.assert_allclose(by_count.component_hz, exact[:9], rtol=SOLVED)
        np.testing.assert_allclose(by_frequency.component_hz, exact[exact < limit], rtol=SOLVED)


def test_one_factorisation_serves_constraint_and_component_modes_and_one_counts_these(blade: Bar) -> None:
    with counting("MatCholFctrNum") as factorisations, reduced(blade, modes=6):
        assert factorisations() == 2


def test_no_component_mode_lies_below_a_low_limit(blade: Bar) -> None:
    with reduced(blade, highest_hz=1.0) as reduction:
        assert reduction.size == len(reduction.keep)


@pytest.mark.ranks(2, 3)
@pytest.mark.parametrize("model", ["block", "blade"])
@pytest.mark.parametrize("keep", ["root", "root_and_tip"])
def test_reduction_is_the_same_on_every_number_of_ranks(model: str, keep: str, request: pytest.FixtureRequest) -> None:
    """Component modes included, double ones too (root alone held: bending of a square section)."""
    made = request.getfixturevalue(model)
    dofs = made.layer(0.0) if keep == "root" else root_and_tip(made)
    options = {"keep": dofs, "modes": 9, "C": 1e-6 * made.K}
    with reduced(made, **options) as shared, reduced(made, comm=MPI.COMM_SELF, **options) as alone:
        np.testing.assert_allclose(shared.component_hz, alone.component_hz, rtol=TIGHT)
        for name in ("K", "M", "C"):
            ours, theirs = getattr(shared, name), getattr(alone, name)
            np.testing.assert_allclose(ours, theirs, atol=REPEATED * np.abs(theirs).max(), err_msg=name)
        unit = np.eye(shared.size)
        for T, other in zip(shared.expand(unit).T, alone.expand(unit).T):
            np.testing.assert_allclose(T, other, atol=REPEATED * np.abs(other).max())


def test_square_section_has_double_component_modes(blade: Bar) -> None:
    with reduced(blade, keep=blade.layer(0.0), modes=2) as reduction:
        assert reduction.component_hz[1] / reduction.component_hz[0] - 1 < 1e-11


def test_error_finds_the_elastic_modes_of_a_free_model(block: Bar) -> None:
    exact = np.sqrt(squares(block.K.toarray(), block.M.toarray())[6:9]) / (2 * np.pi)
    with reduced(block, modes=20) as reduction:
        error = reduction.error(3)
        assert error.largest == np.abs(error.relative).max() < 1e-2
        assert error.wall_s > 0 and reduction.wall_s["total"] > 0
    np.testing.assert_allclose(error.full_hz, exact, rtol=REPEATED)


@pytest.mark.ranks(1, 2, 3)
def test_most_dofs_may_be_kept(block: Bar) -> None:
    """Ranks without internal dofs of their own."""
    n = block.K.shape[0]
    with reduced(block, keep=np.arange(n - 3)) as reduction:
        assert reduction.size == n
        found = squares(reduction.K, reduction.M)
    np.testing.assert_allclose(found[6:], squares(block.K.toarray(), block.M.toarray())[6:], rtol=SOLVED)


@pytest.mark.parametrize(
    ("options", "what", "measured"),
    [
        ({"keep": [0, 1, 5, 1]}, "kept twice", "1"),
        ({"keep": [0, 189]}, "does not exist", "189"),
        ({"keep": [-1, 3]}, "does not exist", "-1"),
        ({"keep": []}, "no dof is kept", None),
        ({"keep": [0.5, 1.5]}, "not whole numbers", None),
        ({"keep": np.arange(189)}, "nothing to reduce", "189"),
        ({"keep": [0, 1, 2]}, "move freely", None),
        ({"modes": 1000}, "number of component modes", "1000"),
        ({"modes": -1}, "number of component modes", "-1"),
        ({"highest_hz": 0.0}, "no frequency", None),
        ({"highest_hz": np.inf}, "no frequency", None),
        ({"modes": 3, "highest_hz": 10.0}, "chosen twice", None),
    ],
)
@pytest.mark.ranks(1, 2, 3)
def test_unusable_input_is_refused(block: Bar, options: dict[str, Any], what: str, measured: str | None) -> None:
    with pytest.raises(InputError, match=what) as caught, reduced(block, **options):
        pass
    assert caught.value.fix
    if measured is not None:
        assert caught.value.measured == measured


def test_half_a_matrix_is_refused(block: Bar) -> None:
    with pytest.raises(InputError, match="K is not symmetric"):
        reduce(block.M, sp.triu(block.K), keep=root_and_tip(block))


def test_negative_stiffness_is_refused(block: Bar) -> None:
    with pytest.raises(InputError, match="not positive definite"):
        reduce(block.M, -block.K, keep=root_and_tip(block))


@pytest.mark.ranks(2, 3)
def test_kept_dofs_that_differ_between_ranks_are_refused(block: Bar, comm: MPI.Comm) -> None:
    with pytest.raises(InputError, match="differ between the ranks"):
        reduce(block.M, block.K, keep=[0, 1, 2, 10 + comm.rank])


def test_contact_stiffness_outside_the_kept_dofs_is_refused(block: Bar) -> None:
    extra = sp.diags(np.ones(block.K.shape[0])).tocsr()
    with reduced(block, modes=3) as reduction:
        with pytest.raises(InputError, match="not kept"):
            reduction.error(2, extra)
        with pytest.raises(InputError, match="elastic modes"):
            reduction.error(1000, held(block))
        with pytest.raises(InputError, match="does not fit"):
            reduction.expand(np.zeros(3))


@pytest.mark.parametrize("copies", [1, 7, 30])
@pytest.mark.parametrize("spread", [0.0, 1e-9])
def test_no_component_mode_is_missed(copies: int, spread: float, comm: MPI.Comm) -> None:
    """Equal blades on one kept hub: modes as many-fold as blades, which a Krylov space from one vector has but once."""
    size = 600 // copies  # beyond those that are solved dense
    one = 2 * np.eye(size) - np.eye(size, k=1) - np.eye(size, k=-1)
    stiffness = [1 + spread * k for k in range(copies)]
    K = np.zeros((copies * size + 1,) * 2)
    for k, of in enumerate(stiffness):
        blade = slice(1 + k * size, 1 + (k + 1) * size)
        K[blade, blade] = of * one
        K[0, blade.start] = K[blade.start, 0] = -of
        K[0, 0] += of
    # a chain of unit springs and masses, both ends held: omega^2 = 4 sin^2(j pi / (2 (n + 1)))
    chain = 4 * np.sin(np.arange(1, size + 1) * np.pi / (2 * (size + 1))) ** 2
    expected = np.sqrt(np.sort(np.outer(stiffness, chain).ravel()))
    count = 2 * copies + 3
    with reduce(sp.eye(len(K), format="csr"), sp.csr_matrix(K), keep=[0], modes=count, comm=comm) as reduction:
        assert np.allclose(2 * np.pi * reduction.component_hz, expected[:count], rtol=SOLVED)
        left = reduction.omitted.omega
        assert len(left) == max(10, count)
        assert np.allclose(left, expected[count : count + len(left)], rtol=SOLVED)
