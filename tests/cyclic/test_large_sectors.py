"""Wheels of large sectors: their waves' lowest modes beside the factor of one sector, which all waves share."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
from models.core_models import counting, options
from models.cyclic_models import GROUND, NEIGHBOUR
from petsc4py import PETSc
from tolerances import ROUNDING, TIGHT

import fretwave as fw
from fretwave.model.sectors import around

SECTORS, DIAMETERS, BLADE = 6, 2, 40
ORDERS, SAMPLES = [1, 3, 5], 240
REPORTS = [2e-5, 1e-4, 1.3e-4, 1e-3]  #: [m] of the tip, from stick into slip


def long_blades(damping: float = 0.0) -> fw.Sector:
    """A disk's mass with a blade of 40 more, whose tips rub on those of the next blades and rims on the ground."""
    n, spring = BLADE + 1, 2e6 * BLADE
    link = sp.diags([np.r_[1.0, np.full(BLADE - 1, 2.0), 1.0], -np.ones(BLADE), -np.ones(BLADE)], [0, 1, -1])
    tie = sp.csr_matrix(([NEIGHBOUR], ([0], [0])), (n, n))
    K = {0: spring * link + sp.csr_matrix(([GROUND], ([0], [0])), (n, n)) + 2 * tie, 1: -tie, -1: -tie}
    tip, rim = np.eye(1, n, n - 1), np.eye(1, n)
    shroud = fw.Contact("jenkins", {0: -tip, 1: tip}, {"tangential_stiffness": 1e5, "friction_limit": 10.0}, "shroud")
    ground = fw.Contact("jenkins", rim, {"tangential_stiffness": 5e5, "friction_limit": 2.0}, "rim")
    M = sp.diags(np.r_[1.2, np.full(BLADE, 0.6 / BLADE)])
    C = {k: damping * A for k, A in K.items()} if damping else None
    return fw.Sector(M, K, SECTORS, C, [shroud, ground])


@pytest.fixture(autouse=True)
def lowest_modes():
    """A sector of 41 dofs is large, and its waves have 8 modes."""
    with options(fw_wheel_whole=20, fw_wheel_modes=8):
        yield


def mode(wheel, prefix, start=None):
    """Of the wheel from a wave, whose counter-rotating one is avoided, or from its lowest mode."""
    counter = None if start is None else start.shape - 1j * start.imaginary
    first = start or fw.linear_modes(wheel, 1)[0]
    return fw.NonlinearMode(wheel, fw.Harmonics(ORDERS, SAMPLES), "CNM", BLADE, first, prefix, counter)


def followed(problem):
    """States where the branch reports, how it was solved, and GMRES a Newton step."""
    branch = fw.Continuation(problem, problem.initial(1e-5), (1e-5, 1e-3), report_at=REPORTS)
    points = list(branch)
    assert branch.converged, branch.reason
    states = [problem.state(p.y) for p in points if p.event == "report" or p.y is points[-1].y]
    return states, branch.route, sum(p.linear for p in points) / sum(p.newton for p in points)


def assert_alike(found, expected):
    assert len(found) == len(expected) >= len(REPORTS)
    for a, b in zip(found, expected):
        assert a["omega"] == pytest.approx(b["omega"], rel=ROUNDING)
        assert a["beta"] == pytest.approx(b["beta"], abs=ROUNDING * b["omega"])


@pytest.mark.ranks(1, 2, 3)
@pytest.mark.parametrize("damping", [0.0, 1e-8])
def test_a_wave_of_large_sectors_is_that_of_one(comm, damping):
    PETSc.Options()["large_route"] = "krylov"
    sector = long_blades(damping)
    with sector.model(DIAMETERS, comm) as model, sector.wheel(comm) as wheel:
        stuck = fw.linear_modes(model, 1)[0]
        one = fw.NonlinearMode(model, fw.Harmonics(ORDERS, SAMPLES), "CNM", BLADE, stuck)
        expected, _, _ = followed(one)
        found, route, iterations = followed(mode(wheel, "large_", sector.around(stuck, DIAMETERS)))
    assert_alike(found, expected)
    assert max(state["zeta"] for state in found) > 0.01
    assert "lowest modes and a sector's factor" in route
    assert iterations < 6


@pytest.mark.ranks(1, 2, 3)
def test_each_basis_is_made_on_one_rank(comm):
    """Eigenproblems of all ranks: one for each of 0 to 3 nodal diameters."""
    PETSc.Options()["shared_route"] = "krylov"
    with long_blades().wheel(comm) as wheel:
        problem = mode(wheel, "shared_")
        with counting("EPSSolve") as solves:
            branch = fw.Continuation(problem, problem.initial(1e-5), (1e-5, 2e-5))
            next(branch)
            made = solves()
    assert comm.allreduce(made) == SECTORS // 2 + 1


@pytest.mark.ranks(1, 2, 3)
def test_a_mistuned_wheel_of_large_sectors_is_that_of_the_direct_route(comm):
    sector, rng = long_blades(), np.random.default_rng(3)
    changes = {"K": [0.02 * e * sector.K[0] for e in rng.standard_normal(SECTORS)]}
    found = {}
    for route in ("direct", "krylov"):
        PETSc.Options()[f"{route}_route"] = route
        with sector.wheel(comm, changes) as wheel:
            found[route] = followed(mode(wheel, f"{route}_"))
    assert_alike(found["krylov"][0], found["direct"][0])
    assert "lowest modes" in found["krylov"][1]
    assert found["krylov"][2] < 15


@pytest.mark.ranks(1)
def test_few_modes_make_more_iterations_and_the_same_points(comm):
    """One mode of a wave, or all: the rest is static, which no answer shows."""
    sector, found = long_blades(), {}
    for count in (1, 8, BLADE):
        PETSc.Options()["fw_wheel_modes"] = count
        PETSc.Options()["few_route"] = "krylov"
        with sector.model(DIAMETERS, comm) as model, sector.wheel(comm) as wheel:
            stuck = fw.linear_modes(model, 1)[0]
            found[count] = followed(mode(wheel, "few_", sector.around(stuck, DIAMETERS)))
    for states, _, _ in found.values():
        for a, b in zip(states, found[8][0]):
            assert a["beta"] == pytest.approx(b["beta"], abs=TIGHT * b["omega"])
    assert found[BLADE][2] <= found[8][2] < found[1][2]


@pytest.mark.ranks(1)
@pytest.mark.parametrize("sectors", [2, 3, 7])
def test_rows_of_some_sectors_are_those_of_the_wheel(sectors):
    """The block-circulant matrix by Kronecker products, also where the sectors ahead and behind are one."""
    rng = np.random.default_rng(4)
    parts = {k: sp.random(5, 4, 0.5, "csr", random_state=rng) for k in (0, 1, -1)}
    step = np.roll(np.eye(sectors), 1, axis=1)
    expected = sum(
        np.kron(np.linalg.matrix_power(step if k > 0 else step.T, abs(k)), A.toarray()) for k, A in parts.items()
    )
    np.testing.assert_array_equal(around(parts, sectors).toarray(), expected)
    np.testing.assert_array_equal(around(parts, sectors, 1, 2).toarray(), expected[5:10])
    assert around(parts, sectors).has_canonical_format
