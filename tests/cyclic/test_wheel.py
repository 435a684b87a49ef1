"""The full tuned wheel: the same branch as one sector, its double modes unfolded by a force that vanishes."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
from models.core_models import dense, filled, unknowns, whole
from models.cyclic_models import MASSES, NEIGHBOUR, lumped_blisk, rich_sector
from petsc4py import PETSc
from test_jacobian import difference
from tolerances import ROUNDING, SOLVED, TIGHT

import fretwave as fw

SECTORS, DIAMETERS = 6, 2
ORDERS, SAMPLES = [1, 3, 5], 240  #: a multiple of the sectors: all see the kinks between the same samples
REPORTS = [2e-5, 1e-4, 1.3e-4, 1e-3]  #: stick, slip onset, near the largest damping, slip


def rubbing_blisk(sectors: int = SECTORS) -> fw.Sector:
    """Tips that rub on those of the next blades, rims that rub on the ground."""
    ahead = {0: [[0, 0, -1.0]], 1: [[0, 0, 1.0]]}
    shroud = fw.Contact("jenkins", ahead, {"tangential_stiffness": 1e5, "friction_limit": 10.0}, "shroud")
    rim = fw.Contact("jenkins", [[1.0, 0, 0]], {"tangential_stiffness": 5e5, "friction_limit": 2.0}, "rim")
    return lumped_blisk(sectors, [shroud, rim])


def unfolded(wheel, start, method="CNM", prefix="mode_"):
    """The wheel's mode in the direction of `start`, the counter-rotating wave avoided."""
    counter = start.shape - 1j * start.imaginary
    return fw.NonlinearMode(wheel, fw.Harmonics(ORDERS, SAMPLES), method, 2, start, prefix, counter)


def reported(problem):
    branch = fw.Continuation(problem, problem.initial(1e-5), (1e-5, 1e-2), report_at=REPORTS)
    points = [p for p in branch if p.event == "report"]
    assert branch.converged and len(points) == len(REPORTS), branch.reason
    return points


@pytest.mark.ranks(1, 2, 3)
@pytest.mark.parametrize("method", ["CNM", "EPMC"])
def test_the_wheel_follows_the_branch_of_its_sector(comm, method):
    """omega and beta to 1e-8 along the branch (1e-12 here); tau at rounding."""
    sector = rubbing_blisk()
    with sector.model(DIAMETERS, comm) as model, sector.wheel(comm) as wheel:
        stuck = fw.linear_modes(model, 1)[0]
        one = fw.NonlinearMode(model, fw.Harmonics(ORDERS, SAMPLES), method, 2, stuck)
        around = unfolded(wheel, sector.around(stuck, DIAMETERS), method)
        for a, b in zip(reported(one), reported(around)):
            expected, found = one.state(a.y), around.state(b.y)
            assert found["omega"] == pytest.approx(expected["omega"], rel=ROUNDING)
            assert found["beta"] == pytest.approx(expected["beta"], abs=ROUNDING * expected["omega"])
            assert np.abs(around.unfolding(b.y)).max() < 1e-13
        assert max(one.state(p.y)["zeta"] for p in reported(one)) > 0.01


def first(problem, amplitude):
    """The branch's first point."""
    return next(fw.Continuation(problem, problem.initial(amplitude), (amplitude, 1e-2)))


@pytest.mark.ranks(1, 2, 3)
@pytest.mark.parametrize(
    ("method", "diameters", "dof"), [("CNM", 2, 2), ("EPMC", -1, 14), ("CNM", 0, 5), ("CNM", 3, 2)]
)
def test_the_motion_of_the_sector_solves_the_equations_of_the_wheel(comm, method, diameters, dof):
    """In slip, whichever sector is normalised, on a wave that runs either way or stands still (0, N/2)."""
    sector = rubbing_blisk()
    with sector.model(diameters, comm) as model, sector.wheel(comm) as wheel:
        stuck, harmonics = fw.linear_modes(model, 1)[0], fw.Harmonics(ORDERS, SAMPLES)
        one = fw.NonlinearMode(model, harmonics, method, 2, stuck)
        start, other = fw.travelling_wave(stuck, diameters, SECTORS)
        around = fw.NonlinearMode(wheel, harmonics, method, dof, start, "wheel_", other)
        point = first(one, 1.3e-4)
        y = fw.around_wheel(around, one, point.y, diameters)
        assert one.diagnostics(point.y)["slip"] > 0.1
        assert around.residual(y).norm() < SOLVED * around.residual(around.initial(1.3e-4)).norm()
        assert around.state(y) == pytest.approx(one.state(point.y), rel=ROUNDING)
        c, s = around.scalars(y)[3:5]
        assert (c, s) == pytest.approx((1.0, 0.0), abs=ROUNDING)


def test_what_is_no_wheel_of_the_sector_is_refused(comm):
    sector, harmonics = rubbing_blisk(), fw.Harmonics(ORDERS, SAMPLES)
    with sector.model(DIAMETERS, comm) as model, sector.wheel(comm) as wheel:
        one = fw.NonlinearMode(model, harmonics, "CNM", 2)
        other = unfolded(wheel, sector.around(one.start, DIAMETERS), "EPMC")
        with pytest.raises(fw.InputError, match="other method"):
            fw.around_wheel(other, one, one.initial(1e-5), DIAMETERS)
        few = fw.NonlinearMode(model, fw.Harmonics([1], 8), "EPMC", 2)
        with pytest.raises(fw.InputError, match="other harmonics"):
            fw.around_wheel(other, few, few.initial(1e-5), DIAMETERS)
        with pytest.raises(fw.InputError, match="not made of such sectors"):
            fw.around_wheel(one, unfolded(wheel, sector.around(one.start, DIAMETERS)), one.initial(1e-5), DIAMETERS)


def test_a_wave_of_the_sector_starts_the_wheel(comm):
    """Unit modal mass of the wheel, the sector's frequency, and no component on the wave running the other way."""
    sector = rubbing_blisk()
    with sector.model(DIAMETERS, comm) as model, sector.wheel(comm) as wheel:
        around = sector.around(fw.linear_modes(model, 1)[0], DIAMETERS)
        pair = fw.linear_modes(wheel, 6)
    phi = around.shape + 1j * around.imaginary
    M = np.kron(np.eye(SECTORS), sector.M)
    assert phi.conj() @ M @ phi == pytest.approx(1.0, rel=ROUNDING)
    assert phi @ M @ phi == pytest.approx(0.0, abs=ROUNDING)
    assert sum(abs(mode.omega / around.omega - 1) < SOLVED for mode in pair) == 2


@pytest.mark.ranks(1)
def test_unfolding_keeps_the_equations_of_a_double_mode_regular(comm):
    """Rank 2 is lost at small amplitude without it; with it the conditioning does not depend on it."""
    sector = rubbing_blisk()
    with sector.model(DIAMETERS, comm) as model, sector.wheel(comm) as wheel:
        start = sector.around(fw.linear_modes(model, 1)[0], DIAMETERS)
        plain = fw.NonlinearMode(wheel, fw.Harmonics(ORDERS, SAMPLES), "CNM", 2, start)
        for amplitude in (1e-6, 1e-5):
            for problem, defect in ((plain, 2), (unfolded(wheel, start), 0)):
                sizes = np.linalg.svd(dense(problem.jacobian(problem.initial(amplitude))), compute_uv=False)
                assert np.count_nonzero(sizes < ROUNDING * sizes[0]) == defect
                assert sizes[len(sizes) - 1 - defect] > 1e-5 * sizes[0]


def unfolded_problem(comm):
    """A small wheel with all kinds of terms and contacts, and a random point of it."""
    wheel = rich_sector(3).wheel(comm)
    rng = np.random.default_rng(5)
    shape, imaginary, *counter = rng.standard_normal((4, 9))
    start = fw.LinearMode(1.3, 0.0, shape, imaginary)
    problem = fw.NonlinearMode(wheel, fw.Harmonics([0, 1, 2], 32), "CNM", 1, start, avoid=counter[0] + 1j * counter[1])
    return problem, np.concatenate([0.3 * rng.standard_normal(45), [0.2, -0.3], [0.06, 1.1, -0.4]])


@pytest.mark.ranks(1, 2, 3)
def test_unfolded_jacobian_is_the_derivative_of_the_residual(comm):
    problem, y = unfolded_problem(comm)
    J = dense(problem.jacobian(unknowns(problem, y)))
    assert J.shape == (49, 50)
    residual = lambda v: whole(problem.residual(unknowns(problem, v)))  # noqa: E731
    expected = np.column_stack([difference(residual, y, e) for e in np.eye(50)])
    assert np.allclose(J, expected, rtol=0, atol=SOLVED * np.abs(expected).max())
    dy = np.random.default_rng(6).standard_normal(50)
    product = whole(problem.jacobian_product(unknowns(problem, y), unknowns(problem, dy)))
    assert np.allclose(product, J @ dy, rtol=0, atol=ROUNDING * np.abs(J @ dy).max())


def test_the_rows_are_the_component_on_the_avoided_mode(comm):
    """phi^H M q_1 of the motion as (cos, sin), in the convention q_1 = Qc - i Qs."""
    sector = rubbing_blisk()
    with sector.model(DIAMETERS, comm) as model, sector.wheel(comm) as wheel:
        start = sector.around(fw.linear_modes(model, 1)[0], DIAMETERS)
        problem = unfolded(wheel, start)
        counter, M = start.shape - 1j * start.imaginary, np.kron(np.eye(SECTORS), sector.M)
        y = whole(problem.initial(1e-5))
        Q = np.zeros((18, 6))
        Q[:, 0], Q[:, 1] = np.random.default_rng(1).standard_normal((2, 18))
        y[:108] = Q.ravel()
        r = whole(problem.residual(filled(problem.core.unknowns(), y)))
        length = np.linalg.norm(M @ np.column_stack([counter.real, counter.imag]))
        assert complex(r[-2], -r[-1]) * length == pytest.approx(
            counter.conj() @ M @ (Q[:, 0] - 1j * Q[:, 1]), rel=TIGHT
        )


@pytest.mark.ranks(1, 2, 3, 4)
def test_ranks_take_whole_sectors_with_their_contact(comm):
    with rubbing_blisk().wheel(comm) as wheel:
        begin, end = wheel.core.first_dof, wheel.core.first_dof + wheel.core.local_dofs
        assert begin % 3 == 0 == end % 3
        shroud, rim = wheel._pairs  # the shroud's last pair touches sector 0, whose dofs come first
        assert np.array_equal(rim, np.arange(begin // 3, end // 3))
        assert set(shroud) - {SECTORS - 1} == set(rim) - {SECTORS - 1}


def deviations(share, seed=2) -> list[np.ndarray]:
    """Random shares of the outer blade stiffness, the same for a seed."""
    delta = share * np.random.default_rng(seed).uniform(-1, 1, SECTORS)
    return [d * 2e6 * np.array([[0, 0, 0], [0, 1, -1], [0, -1, 1.0]]) for d in delta]


def test_modes_of_a_mistuned_wheel_are_those_of_its_matrices(comm):
    """Linear limit, from a dense eigenproblem assembled apart; double modes split."""
    changes = deviations(0.02)
    K = np.kron(np.eye(SECTORS), rubbing_blisk().K[0])
    for j in range(SECTORS):
        for other in (j - 1, j + 1):
            K[3 * j, 3 * (other % SECTORS)] -= NEIGHBOUR
        K[3 * j : 3 * j + 3, 3 * j : 3 * j + 3] += changes[j]
    expected = np.sqrt(scipy.linalg.eigvalsh(K, np.kron(np.eye(SECTORS), np.diag(MASSES))))
    with rubbing_blisk().wheel(comm, {"K": changes}) as wheel:
        found = [mode.omega for mode in fw.linear_modes(wheel, 18, "free")]
    assert found == pytest.approx(list(expected), rel=TIGHT)
    assert min(np.diff(found) / found[:-1]) > 1e-9


def test_mistuned_modes_tend_to_the_tuned_ones(comm):
    """Linearly in the deviation (first-order perturbation of the frequencies)."""
    with rubbing_blisk().wheel(comm) as wheel:
        tuned = np.array([mode.omega for mode in fw.linear_modes(wheel, 12)])
    distance = []
    for share in (1e-3, 1e-4, 1e-5):
        with rubbing_blisk().wheel(comm, {"K": deviations(share)}) as wheel:
            mistuned = np.array([mode.omega for mode in fw.linear_modes(wheel, 12)])
        distance.append(np.abs(mistuned / tuned - 1).max())
    assert distance[0] / distance[1] == pytest.approx(10, rel=0.02)
    assert distance[1] / distance[2] == pytest.approx(10, rel=0.02)


@pytest.mark.ranks(1)
def test_changes_that_do_not_fit_are_refused(comm):
    for changes in ({"K": deviations(0.1)[:-1]}, {"K": [np.eye(2)] * SECTORS}, {"Q": deviations(0.1)}):
        with pytest.raises(fw.InputError, match="do not fit its sectors"):
            rubbing_blisk().wheel(comm, changes)


@pytest.mark.ranks(1, 2, 3, 4)
@pytest.mark.parametrize("method", ["CNM", "EPMC"])
def test_the_krylov_route_finds_the_same_branch(comm, method):
    """The tuned wheel's blocks by nodal diameters precondition a tuned and a mistuned wheel."""
    sector = rubbing_blisk()
    rng = np.random.default_rng(3)
    mistuned = {"K": [0.02 * e * np.asarray(sector.K[0]) for e in rng.standard_normal(SECTORS)]}
    with sector.model(DIAMETERS, comm) as model:
        start = sector.around(fw.linear_modes(model, 1)[0], DIAMETERS)
    for changes in (None, mistuned):
        with sector.wheel(comm, changes=changes) as wheel:
            found = {}
            for route in ("direct", "krylov"):
                PETSc.Options()[f"{route}_route"] = route
                problem = (
                    unfolded(wheel, start, method, f"{route}_")
                    if changes is None
                    else mode_of(wheel, method, f"{route}_")
                )
                points = reported(problem)
                found[route] = [problem.state(p.y) for p in points]
                if route == "krylov":
                    assert max(p.linear / max(1, p.newton) for p in points) < 40
            for direct, krylov in zip(found["direct"], found["krylov"]):
                assert krylov["omega"] == pytest.approx(direct["omega"], rel=SOLVED)
                assert krylov["beta"] == pytest.approx(direct["beta"], rel=SOLVED, abs=SOLVED * direct["omega"])


@pytest.mark.ranks(1, 2)
def test_iterations_do_not_grow_with_the_number_of_sectors(comm):
    """About a travelling wave on a tuned wheel the preconditioner is exact, however many modes lie beside."""
    PETSc.Options()["around_route"] = "krylov"
    mean = {}
    for sectors in (6, 24):
        sector = rubbing_blisk(sectors)
        with sector.model(sectors // 3, comm) as model, sector.wheel(comm) as wheel:
            start = sector.around(fw.linear_modes(model, 1)[0], sectors // 3)
            problem = unfolded(wheel, start, prefix="around_")
            points = list(fw.Continuation(problem, problem.initial(1e-5), (1e-5, 1e-2)))
            mean[sectors] = sum(p.linear for p in points) / sum(p.newton for p in points)
    assert max(mean.values()) < 6
    assert mean[24] < 1.5 * mean[6]


def mode_of(wheel, method, prefix):
    """The lowest mode of a mistuned wheel, which is not double."""
    first = fw.linear_modes(wheel, 1)[0]
    dof = int(np.argmax(np.abs(first.shape)))
    return fw.NonlinearMode(wheel, fw.Harmonics(ORDERS, SAMPLES), method, dof, first, prefix)
