"""Estimated error of a reduced nonlinear mode, against the unreduced model solved."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
from models.core_models import solve_at
from models.hexahedra import bar
from petsc4py import PETSc

import fretwave as fw
from fretwave.errors import InputError, NotConverged
from fretwave.hb import reduction_error
from fretwave.hb.reduction_error import nonlinear_error
from fretwave.solve.preload import balanced

pytestmark = pytest.mark.ranks(1, 2)

STIFFNESS = {"normal_stiffness": 4e7, "tangential_stiffness": 3e7}
LOADS = {"friction_coefficient": 0.4, "normal_load": 100.0}
AMPLITUDE = 4e-4  #: partial slip


@pytest.fixture(scope="module")
def block():
    """630 dofs: a bar on six friction pairs and a few springs, damped by its stiffness."""
    made = bar((34, 2, 1), (0.2, 0.02, 0.008))
    nodes = made.nodes
    root = np.flatnonzero((nodes[:, 0] < 0.007) & (np.isclose(nodes[:, 2], 0)))
    B = np.zeros((3 * len(root), made.K.shape[0]))
    for k, node in enumerate(root):
        B[3 * k : 3 * k + 3, 3 * node : 3 * node + 3] = np.eye(3)[[1, 2, 0]]  # across the bar: bending slips
    K = made.K.toarray() + 0.3 * STIFFNESS["tangential_stiffness"] * B.T @ B
    tip = 3 * int(np.argmax(nodes @ [1.0, 1e-3, 1e-3])) + 2
    return made.M, sp.csr_matrix(K), 1e-6 * sp.csr_matrix(K), B, tip


def mode(M, K, C, B, dof, comm, method, prefix, omitted=None):
    model = fw.Model(M, K, C, [fw.Contact("coulomb_3d", B, {**STIFFNESS, **LOADS}, "root")], comm, omitted=omitted)
    first = fw.linear_modes(model, 1, "stuck")[0]
    rest = balanced(model, first)
    problem = fw.NonlinearMode(model, fw.Harmonics(range(4), 64), method, dof, first, prefix)
    problem.preload(rest.displacement, rest.load)
    return problem


@pytest.mark.parametrize("method", ["CNM", "EPMC"])
def test_estimate_is_the_true_difference(block, comm, method):
    M, K, C, B, tip = block
    keep = np.union1d(np.flatnonzero(np.abs(B).sum(axis=0)), [tip])
    full = mode(M, K, C, B, tip, comm, method, "full_")
    y = solve_at(full, AMPLITUDE)
    true = full.state(y)
    assert full.diagnostics(y)["slip"] > 0.02
    for modes in (1, 3):
        with fw.reduce(M, K, C, keep=keep, modes=modes, comm=comm) as reduction:
            Br = np.hstack([B[:, keep], np.zeros((len(B), modes))])
            at = int(np.searchsorted(keep, tip))
            small = mode(reduction.M, reduction.K, reduction.C, Br, at, comm, method, "small_")
            y = solve_at(small, AMPLITUDE)
            found, estimate = small.state(y), nonlinear_error(reduction, small, y)
        for key in ("omega", "beta", "zeta"):
            difference = true[key] - found[key]
            assert 0.5 * abs(difference) <= abs(getattr(estimate, key)) <= 2 * abs(difference), key


def test_the_damping_of_another_analysis_takes_the_same_basis(block, comm):
    """Component modes do not know C: that of an analysis with dampers of its own may come later."""
    M, K, C, B, tip = block
    keep, modes = np.union1d(np.flatnonzero(np.abs(B).sum(axis=0)), [tip]), 2
    Br, at = np.hstack([B[:, keep], np.zeros((len(B), modes))]), int(np.searchsorted(keep, tip))
    with (
        fw.reduce(M, K, C, keep=keep, modes=modes, comm=comm) as own,
        fw.reduce(M, K, keep=keep, modes=modes, comm=comm) as plain,
        fw.reduce(M, K, 3 * C, keep=keep, modes=modes, comm=comm) as other,
    ):
        small = mode(own.M, own.K, own.C, Br, at, comm, "CNM", "damped_")
        y = solve_at(small, AMPLITUDE)
        expected = nonlinear_error(own, small, y)
        found = [nonlinear_error(reduction, small, y, C=C) for reduction in (plain, other)]
        undamped = nonlinear_error(plain, small, y)
    for key in ("omega", "beta", "zeta"):
        size = abs(expected.omega if key != "zeta" else expected.zeta)
        for one in found:
            assert getattr(one, key) == pytest.approx(getattr(expected, key), rel=1e-6, abs=1e-6 * size)
    assert abs(undamped.beta - expected.beta) > 1e-3 * abs(expected.beta)


def test_an_estimate_that_fails_frees_its_factor(block, comm, monkeypatch):
    M, K, C, B, tip = block
    freed, destroy = [], reduction_error._Interior.destroy
    monkeypatch.setattr(reduction_error, "MOST_ROUNDS", 0)
    monkeypatch.setattr(reduction_error._Interior, "destroy", lambda self: (freed.append(1), destroy(self)))
    keep = np.union1d(np.flatnonzero(np.abs(B).sum(axis=0)), [tip])
    with fw.reduce(M, K, C, keep=keep, modes=1, comm=comm) as reduction:
        Br, at = np.hstack([B[:, keep], np.zeros((len(B), 1))]), int(np.searchsorted(keep, tip))
        small = mode(reduction.M, reduction.K, reduction.C, Br, at, comm, "CNM", "failing_")
        with pytest.raises(NotConverged, match="the reduction's error cannot be estimated"):
            nonlinear_error(reduction, small, solve_at(small, AMPLITUDE))
    assert freed == [1]


@pytest.mark.parametrize("fuller", [3, 1e9])
def test_damping_that_is_full_leaves_the_others_sparse(block, comm, monkeypatch, fuller):
    """Blocks on the pattern of all, and as they are: the same sums."""
    M, K, C, B, tip = block
    monkeypatch.setattr(reduction_error, "FULLER", fuller)
    full = sp.csr_matrix(C.toarray() + 1e-9 * np.abs(C).max())
    keep = np.union1d(np.flatnonzero(np.abs(B).sum(axis=0)), [tip])
    factors = {0: 1.0, 1: 0.3, 2: -2e5}
    with fw.reduce(M, K, C, keep=keep, modes=1, comm=comm) as reduction:
        interior = reduction_error._Interior(reduction, full)
        Z, blocks = interior.solver.Z, interior.blocks
        used = {order: A.getInfo(PETSc.Mat.InfoType.GLOBAL_SUM)["nz_used"] for order, (A, _) in blocks.items()}
        interior.solver.factorise(factors, blocks)
        right, out = Z.createVecs()
        right.setRandom()
        Z.mult(right, out)
        x = np.concatenate(comm.allgather(right.getArray()))
        found = np.concatenate(comm.allgather(out.getArray()))
        interior.destroy()
    inside = np.setdiff1d(np.arange(M.shape[0]), keep)
    expected = sum(f * A[inside][:, inside] @ x for f, A in zip(factors.values(), (K, full, M)))
    assert found == pytest.approx(expected, rel=1e-10, abs=1e-12 * np.abs(expected).max())
    assert used[1] == len(inside) ** 2 and (used[0] < used[1] / 3) == (fuller == 3)


@pytest.mark.parametrize("method, modes", [("CNM", 1), ("EPMC", 3)])
def test_every_point_has_its_own(block, comm, method, modes):
    """By the modes next to those that are kept, within the 7 % that all others add; of the full model it is none."""
    M, K, C, B, tip = block
    keep = np.union1d(np.flatnonzero(np.abs(B).sum(axis=0)), [tip])
    full = mode(M, K, C, B, tip, comm, method, "full_")
    true = full.meaning.eigenvalue(full.scalars(solve_at(full, AMPLITUDE)))
    with fw.reduce(M, K, C, keep=keep, modes=modes, comm=comm) as r:
        Br, at = np.hstack([B[:, keep], np.zeros((len(B), modes))]), int(np.searchsorted(keep, tip))
        small = mode(r.M, r.K, r.C, Br, at, comm, method, "small_", r.omitted)
        assert len(r.omitted.omega) == 10
    point = next(iter(fw.Continuation(small, small.initial(AMPLITUDE), (0.5 * AMPLITUDE, 2 * AMPLITUDE))))
    errors = small.errors(point.y, point.tangent)
    difference = abs(small.meaning.eigenvalue(small.scalars(point.y)) - true)
    assert errors["lambda_error_reduction"] == pytest.approx(difference, rel=0.1)
    assert errors["omega_error"] > 0.5 * difference


def test_a_problem_on_other_dofs_is_refused(block, comm):
    M, K, C, B, tip = block
    full = mode(M, K, C, B, tip, comm, "CNM", "full_")
    keep = np.union1d(np.flatnonzero(np.abs(B).sum(axis=0)), [tip])
    reduction = fw.reduce(M, K, C, keep=keep, modes=1, comm=comm)
    with reduction, pytest.raises(InputError, match="reduced coordinates"):
        nonlinear_error(reduction, full, full.initial(AMPLITUDE))
