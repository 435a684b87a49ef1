"""The adjoint of the Jacobian: <J x, y> = <x, J^T y> of every law, variant, wheel and wave, and KSPs that need it."""

from __future__ import annotations

import numpy as np
import pytest
from models.core_models import CoupledLaw, chain, unknowns, whole
from petsc4py import PETSc
from test_jacobian import MODELS, VARIANTS, problem_of, random_point
from test_wheel import unfolded_problem
from tolerances import REPEATED, ROUNDING, SOLVED

import fretwave as fw
from fretwave.errors import InputError

pytestmark = pytest.mark.ranks(1, 2)
#: Two pairs of every law of the package, with friction, lift-off, gaps and stops within the motion.
PARAMETERS = {
    "normal_stiffness": 2.0,
    "tangential_stiffness": 1.5,
    "friction_coefficient": 0.4,
    "normal_load": [0.6, 2.0],
    "friction_limit": [0.3, 1.0],
    "regularisation_velocity": 0.3,
    "gap": 0.1,
    "stiffness": 1.2,
}


def law_model(comm, name):
    info = fw.laws()[name]
    given = {p.name: PARAMETERS.get(p.name, 0.7) for p in info.parameters if p.name in PARAMETERS or p.default is None}
    B = 0.5 * np.random.default_rng(3).standard_normal((2 * info.components, 3))
    return fw.Model(np.diag([1.0, 0.5, 2.0]), chain(3), 0.05 * chain(3), [fw.Contact(name, B, given)], comm)


def assert_adjoint(problem, y, seed=0):
    """Relative to the lengths of both."""
    rng = np.random.default_rng(seed)
    at, n = unknowns(problem, y), len(y)
    x, p = rng.standard_normal(n), rng.standard_normal(n - 1)
    r = problem.core.equations()
    begin, end = r.getOwnershipRange()
    r.setArray(p[begin:end])
    forward = whole(problem.jacobian_product(at, unknowns(problem, x)))
    backward = whole(problem.transposed_product(at, r))
    assert len(backward) == n and np.linalg.norm(backward) > 0
    size = max(np.linalg.norm(forward) * np.linalg.norm(p), np.linalg.norm(backward) * np.linalg.norm(x))
    assert abs(forward @ p - x @ backward) < ROUNDING * size


@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("name", list(MODELS))
def test_of_every_variant_and_wave(comm, name, variant):
    problem = problem_of(variant, *MODELS[name](comm))
    for seed in range(2):
        assert_adjoint(problem, random_point(problem, variant, seed), seed)


@pytest.mark.parametrize("name", sorted(fw.laws()))
def test_of_every_law(comm, name):
    problem = problem_of("CNM", law_model(comm, name), [0, 1, 2, 3])
    for seed in range(3):
        assert_adjoint(problem, random_point(problem, "CNM", seed), seed)


def test_of_a_law_that_couples_all(comm):
    B = np.random.default_rng(7).standard_normal((3, 3))
    model = fw.Model(np.eye(3), chain(3), 0.02 * chain(3), [fw.Contact(CoupledLaw(), B)], comm)
    problem = problem_of("EPMC", model, [0, 1, 2])
    assert_adjoint(problem, random_point(problem, "EPMC"))


def test_of_an_unfolded_wheel(comm):
    problem, y = unfolded_problem(comm)
    assert_adjoint(problem, y)


def test_it_follows_the_point(comm):
    """A residual taken elsewhere must not move it."""
    problem = problem_of("CNM", *MODELS["two dampers"](comm))
    for seed in (0, 1, 0):
        y = random_point(problem, "CNM", seed)
        problem.residual(unknowns(problem, random_point(problem, "CNM", 5)))
        assert_adjoint(problem, y)


def krylov_newton(comm, prefix, **options):
    """Newton's linear systems of small equations on the Krylov route, closed by a random row; a point, a right side."""
    for name, value in {"route": "krylov", "pc_type": "none", **options}.items():
        PETSc.Options(prefix)[name] = value
    problem = problem_of("CNM", *MODELS["two dampers"](comm))
    newton = fw._core.Newton(problem.core, prefix)
    y, b, row = (unknowns(problem, random_point(problem, "CNM", seed)) for seed in range(3))
    newton.system.close(row, 0.0)
    return problem, newton, y, b


def solved(newton, y, b):
    """How far the solution is from solving, relative."""
    x, left = b.duplicate(), b.duplicate()
    x.set(0)
    assert newton.linear(y, b, x)
    newton.system.product(y, x, left)
    left.axpy(-1, b)
    return left.norm() / b.norm()


def test_the_shell_has_the_transpose_of_the_assembled_system(comm):
    _, newton, y, b = krylov_newton(comm, "adjoint_")
    assert solved(newton, y, b) < SOLVED
    found, expected = b.duplicate(), b.duplicate()
    newton.snes.getJacobian()[0].multTranspose(b, found)
    newton.system.jacobian(y).multTranspose(b, expected)
    np.testing.assert_allclose(whole(found), whole(expected), rtol=0, atol=ROUNDING * abs(whole(expected)).max())


def test_ksps_that_need_a_transpose(comm):
    """As a step and as the adjoint's solve; without a preconditioner, as ours have no transpose, and say so."""
    _, newton, y, b = krylov_newton(comm, "bicg_", tangent_ksp_type="bicg")
    assert solved(newton, y, b) < REPEATED
    J, x, left = newton.snes.getJacobian()[0], b.duplicate(), b.duplicate()
    ksp = PETSc.KSP().create(comm)
    ksp.setOperators(J)
    ksp.setType("gmres")
    ksp.pc.setType("none")
    ksp.setTolerances(rtol=1e-11, max_it=200)
    ksp.solveTranspose(b, x)
    J.multTranspose(x, left)
    left.axpy(-1, b)
    assert left.norm() < REPEATED * b.norm()
    _, newton, y, b = krylov_newton(comm, "refused_", tangent_ksp_type="bicg", pc_type="fwblocks")
    with pytest.raises(InputError, match="fwblocks has no transpose") as caught:
        newton.linear(y, b, b.duplicate())
    assert "-<analysis>_pc_type none" in str(caught.value)
