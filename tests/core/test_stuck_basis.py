"""The real basis of stuck pairs: which models have it, and that one is as good as another to the result."""

from __future__ import annotations

import numpy as np
import pytest
from models.core_models import counting, options
from petsc4py import PETSc
from tolerances import REPEATED, SOLVED

import fretwave as fw
from fretwave import _core, balanced
from fretwave.mpi.gather import on_all_ranks

pytestmark = pytest.mark.ranks(1, 2, 3)

N, PAIRS = 18, 4
SLIDER = {"tangential_stiffness": 2.0, "friction_limit": 0.05}
PADS = {"normal_stiffness": 3.0, "tangential_stiffness": 2.0, "friction_coefficient": 0.4, "normal_load": 0.3}


def chain(free=0.0):
    """M, K of masses on springs, each joined to the next three, the first held but for `free`."""
    generator = np.random.default_rng(4)
    K = np.diag([3.0 - free] + [0.4] * (N - 1))
    for i in range(N):
        for j in range(i + 1, min(i + 4, N)):
            stiffness = generator.uniform(2, 5)
            K[np.ix_([i, j], [i, j])] += stiffness * np.array([[1, -1], [-1, 1]])
    return np.diag(generator.uniform(1, 2, N)), K


def sliders(law="jenkins", parameters=SLIDER, components=1):
    """Contact between dofs and their neighbours but one."""
    B = np.zeros((PAIRS * components, N))
    for row in range(PAIRS * components):
        B[row, row], B[row, row + 2] = 1.0, -1.0
    return fw.Contact(law, B, parameters)


def problem_of(model, prefix="basis_", highest=7, method="CNM"):
    options = PETSc.Options(prefix)
    options["route"] = "krylov"
    first = fw.linear_modes(model, 1, "stuck")[0]
    problem = fw.NonlinearMode(model, fw.Harmonics(range(highest + 1), 64), method, N - 1, first, prefix)
    if model.contacts[0].info.normal is not None:
        rest = balanced(model, first)
        problem.preload(rest.displacement, rest.load)
    return problem


def branch(problem, levels):
    followed = fw.Continuation(problem, problem.initial(levels[0] / 2), (levels[0] / 2, levels[-1]), report_at=levels)
    points = [(p.event, p.newton, p.linear, problem.state(p.y), problem.diagnostics(p.y)) for p in followed]
    assert followed.converged, followed.reason
    return points


def reported(points):
    """States by amplitude; at the last one the branch stops."""
    return {round(state["amplitude"], 9): state for event, *_, state, _ in points if event in ("report", "stop")}


def unsymmetric(K):
    K = K.copy()
    K[0, 1] += 0.5
    return K


@pytest.mark.parametrize(
    "why, change",
    [
        (
            "a law without a stuck stiffness",
            ("regularised_coulomb", {"friction_limit": 1.0, "regularisation_velocity": 1e-2}),
        ),
        ("pairs that leave the structure nothing to slip by", ("jenkins", {**SLIDER, "tangential_stiffness": 1e9})),
        ("K without symmetry", None),
    ],
)
def test_other_models_have_dense_blocks(comm, why, change) -> None:
    M, K = chain()
    with fw.Model(M, K if change else unsymmetric(K), 0.01 * K, [sliders(*change or ())], comm) as model:
        start = fw.LinearMode(0.5, 0.0, np.ones(N), np.zeros(N))
        PETSc.Options("basis_")["route"] = "krylov"
        problem = fw.NonlinearMode(model, fw.Harmonics(range(8), 64), "CNM", N - 1, start, "basis_")
        assert f"8 dense blocks of {N} dofs" in _core.Newton(problem.core, "basis_").route, why


@pytest.mark.parametrize("method", ["CNM", "EPMC"])
@pytest.mark.parametrize("contact", [sliders(), sliders("coulomb_3d", PADS, 3)], ids=["jenkins", "coulomb_3d"])
@pytest.mark.parametrize("damping", ["none", "of K", "a damper"])
def test_branches_are_those_of_the_direct_route(comm, method, contact, damping) -> None:
    """Through slip, with motions without mass, and damping that the basis makes diagonal or does not."""
    M, K = chain()
    M[3, 3] = M[7, 7] = 0.0
    C = {"none": None, "of K": 0.002 * K, "a damper": np.diag([0.1] + [0.0] * (N - 1))}[damping]
    levels = [0.1, 1.0, 4.0]
    with fw.Model(M, K, C, [contact], comm) as model:
        problem = problem_of(model, "basis_", method=method)
        assert "modes of stuck pairs" in _core.Newton(problem.core, "basis_").route
        ours = branch(problem, levels)
        other = problem_of(model, "basis_direct_", method=method)
        PETSc.Options("basis_direct_")["route"] = "direct"
        theirs = branch(other, levels)
    assert max(state["slip"] for *_, state in ours) > 0.2
    mine, others = (reported(points) for points in (ours, theirs))
    assert sorted(mine) == sorted(others) == levels
    for level in levels:
        one, same = mine[level], others[level]
        assert one["omega"] == pytest.approx(same["omega"], rel=SOLVED)
        assert one["beta"] == pytest.approx(same["beta"], rel=SOLVED, abs=SOLVED * same["omega"])
    moving = [(newton, linear) for _, newton, linear, *_ in ours if newton]
    assert max(linear / newton for newton, linear in moving) <= (12 if damping == "a damper" else 8)


@pytest.mark.ranks(1, 2)
def test_modes_that_all_move_with_inertia_are_all_in_the_blocks(comm) -> None:
    """A chain of equal masses: even its highest mode is below the ninth harmonic."""
    masses = 150
    K = 2.4 * np.identity(masses) - np.eye(masses, k=1) - np.eye(masses, k=-1)
    B = np.eye(PAIRS, masses)
    stuck = np.linalg.eigvalsh(K + SLIDER["tangential_stiffness"] * B.T @ B)
    assert stuck[-1] < 9**2 * stuck[0]
    PETSc.Options("inertial_")["route"] = "krylov"
    with fw.Model(np.identity(masses), K, None, [fw.Contact("jenkins", B, SLIDER)], comm) as model:
        first = fw.linear_modes(model, 1, "stuck")[0]
        problem = fw.NonlinearMode(model, fw.Harmonics(range(1, 16, 2), 64), "CNM", 2, first, "inertial_")
        points = branch(problem, [0.05, 0.5])
        assert "modes of stuck pairs" in _core.Newton(problem.core, "inertial_").route
    assert max(state["slip"] for *_, state in points) > 0.2
    moving = [(newton, linear) for _, newton, linear, *_ in points if newton]
    assert max(linear / newton for newton, linear in moving) <= 8


@pytest.mark.ranks(1, 2)
@pytest.mark.parametrize(
    "heavy, ground, damping, number",
    [(6, 0.1, "none", 1), (6, 0.1, "of K", 1), (6, 0.1, "a damper", 1), (6, 1e-9, "none", 4), (100, 1e-9, "none", 25)],
    ids=["undamped", "of K", "a damper", "all but free", "many and all but free"],
)
def test_modes_that_move_are_as_good_as_all_where_the_others_hardly_do(comm, heavy, ground, damping, number) -> None:
    """Some masses of 300 on springs: the other modes lie 1e4 times higher, one without mass at all.

    Beside a motion that is all but free the inertia of any other is small: where a mode is missed, all are made.
    """
    dofs, generator = 300, np.random.default_rng(5)
    K = (2 + ground) * np.identity(dofs) - np.eye(dofs, k=1) - np.eye(dofs, k=-1)
    K[0, 0] = K[-1, -1] = 1 + ground
    masses = generator.uniform(1e-8, 2e-8, dofs)
    masses[:: dofs // heavy], masses[11] = 1.0, 0.0
    B = np.zeros((PAIRS, dofs))
    B[range(PAIRS), range(2, 2 + PAIRS)], B[range(PAIRS), range(12, 12 + PAIRS)] = 1, -1
    C = {"none": None, "of K": 0.002 * K, "a damper": np.diag([0.1] + [0.0] * (dofs - 1))}[damping]
    levels, found, routes = [0.05, 2.0 if ground == 0.1 else 20.0], {}, []
    PETSc.Options("moving_")["route"], PETSc.Options("moving_")["pc_type"] = "krylov", "fwbasis"
    for least in (100, 1000):
        with (
            options(fw_stuck_all_modes=least),
            fw.Model(np.diag(masses), K, C, [fw.Contact("jenkins", B, SLIDER)], comm) as model,
        ):
            mode = fw.linear_modes(model, number, "stuck")[number - 1]
            problem = fw.NonlinearMode(model, fw.Harmonics(range(1, 8, 2), 64), "CNM", 0, mode, "moving_")
            routes.append(_core.Newton(problem.core, "moving_").route)
            found[least] = branch(problem, levels)
    assert "static motions" in routes[0] and "blocks of 300 modes of stuck pairs" in routes[1]
    assert max(state["slip"] for *_, state in found[100]) > 0.2
    counts = [sum(linear for _, _, linear, *_ in points) for points in found.values()]
    assert counts[0] <= 1.1 * counts[1], counts
    one, other = (reported(points) for points in found.values())
    for level in levels:
        for key in ("omega", "beta"):
            assert one[level][key] == pytest.approx(other[level][key], rel=SOLVED)


@pytest.mark.ranks(1, 2)
@pytest.mark.parametrize("of", ["K", "M"])
def test_damping_in_proportion_is_in_the_basis_as_any_other(comm, of) -> None:
    """Known from K or M without a product, or by one, where an entry's twelfth digit is another: equal GMRES."""
    M, K = chain()
    alike = {"K": 0.3 * K, "M": 0.3 * M}[of]
    other = alike.copy()
    other[0, 0] *= 1 + 1e-12
    counts = []
    for C in (alike, other, None):
        with fw.Model(M, K, C, [sliders("coulomb_3d", PADS, 3)], comm) as model:
            points = branch(problem_of(model, "share_"), [1.0, 2.5])
        counts.append([(newton, linear) for _, newton, linear, *_ in points])
    assert counts[0] == counts[1] != counts[2]


@pytest.mark.ranks(1, 2)
def test_directions_of_the_pairs_coupling_serve_the_next_right_hand_side(comm) -> None:
    """Fewer products than where only the first direction is kept, and the same motions."""
    M, K = chain()
    levels, products, points = [2.0, 2.5], [], []
    with fw.Model(M, K, np.diag([0.1] + [0.0] * (N - 1)), [sliders("coulomb_3d", PADS, 3)], comm) as model:
        for changes in ({}, {"fw_pairs_kept": 1}):
            with options(**changes), counting("FwCompliance") as coupled:
                points.append(branch(problem_of(model, "kept_"), levels))
                products.append(coupled())
    assert 0 < products[0] < 0.9 * products[1], products
    assert max(found["slip"] for *_, found in points[0]) > 0.2
    shared, alone = (reported(found) for found in points)
    for level in levels:
        for name in ("omega", "beta"):
            expected, size = alone[level][name], SOLVED * alone[level]["omega"]
            assert shared[level][name] == pytest.approx(expected, rel=SOLVED, abs=size)


def test_a_preconditioner_stays_where_a_step_leaves_next_to_nothing(comm) -> None:
    """It follows fewer points than where it follows each, with hardly more iterations, and motions are the same."""
    M, K = chain()
    levels, follows, points = [2.0, 2.5], [], []
    with fw.Model(M, K, np.diag([0.1] + [0.0] * (N - 1)), [sliders("coulomb_3d", PADS, 3)], comm) as model:
        for changes in ({}, {"fw_linear_straight": 1e-12}):
            with options(**changes), counting("FwPCFollow") as followed:
                points.append(branch(problem_of(model, "stays_"), levels))
                follows.append(followed())
    assert 0 < follows[0] < 0.9 * follows[1], follows
    iterations = [sum(linear for _, _, linear, *_ in found) for found in points]
    assert iterations[0] < 1.2 * iterations[1], iterations
    stays, each = (reported(found) for found in points)
    for level in levels:
        for name in ("omega", "beta"):
            expected, size = each[level][name], SOLVED * each[level]["omega"]
            assert stays[level][name] == pytest.approx(expected, rel=SOLVED, abs=size)


def motions_and_correctors(problem):
    """Unknowns of a small motion and of a large one, and two correctors at a fixed amplitude. Collective."""
    followed = fw.Continuation(problem, problem.initial(0.1), (0.1, 4.0))
    ys = [p.y.copy() for p in followed]
    row = ys[0].duplicate()
    row.set(0.0)
    row.setValue(row.getSize() - 1, 1.0)
    row.assemble()
    correctors = [_core.Newton(problem.core, "basis_") for _ in range(2)]
    for corrector in correctors:
        corrector.system.close(row, 0.0)
    return ys[0], ys[-1], correctors


def slipping(problem, still, moving, pairs):
    """Unknowns as `still`, but for the motion of the first pairs, which is that of `moving`. Collective."""
    contact, m = problem.model.contacts[0], problem.harmonics.block_size
    B = contact.B.toarray() if hasattr(contact.B, "toarray") else np.asarray(contact.B)
    one, other = (problem.model.comm.bcast(problem.coefficients(y)) for y in (still, moving))
    goal, rows = B @ one, pairs * contact.components
    goal[:rows] = (B @ other)[:rows]
    entries = on_all_ranks(problem.model.comm, still)
    scale = np.abs(one).max() / np.abs(entries[: N * m]).max()
    entries[: N * m] = ((one + np.linalg.pinv(B) @ (goal - B @ one)) / scale).ravel()
    y = still.copy()
    begin, end = y.getOwnershipRange()
    y.setArray(entries[begin:end])
    return y


def preconditioned(newton, problem, y):
    """P^-1 of a random vector, P as it is for y."""
    given, moved = problem.core.unknowns(), problem.core.unknowns()
    begin, end = given.getOwnershipRange()
    given.setArray(np.random.default_rng(1).standard_normal(given.getSize())[begin:end])
    assert newton.linear(y, given, moved)
    newton.snes.getKSP().getPC().apply(given, moved)
    return moved


def assert_same_inverse(comm, contact, changes, apart) -> None:
    """With options and without, the same preconditioner to `apart`, as pairs begin to slip one by one."""
    M, K = chain()
    static = {"fw_modes_fewest": 2, "fw_modes_follows": 1e9}  # all but two modes are in the inverse
    with fw.Model(M, K, 0.002 * K, [contact], comm) as model:
        problem = problem_of(model)
        still, moving, correctors = motions_and_correctors(problem)
        for pairs in range(PAIRS + 1):
            y, found = slipping(problem, still, moving, pairs), []
            for corrector, given in zip(correctors, ({}, changes)):
                with options(**static, **given):
                    found.append(preconditioned(corrector, problem, y))
            found[1].axpy(-1.0, found[0])
            assert found[1].norm() < apart * found[0].norm(), f"{pairs} pairs"


@pytest.mark.parametrize("contact", [sliders(), sliders("coulomb_3d", PADS, 3)], ids=["jenkins", "coulomb_3d"])
def test_pairs_that_begin_to_slip_are_added_to_the_inverse(comm, contact) -> None:
    """Behind those that slip as before, however many, instead of making it anew."""
    assert_same_inverse(comm, contact, {"fw_basis_cheap": 0.5, "fw_basis_few": 100}, 1e-6)


@pytest.mark.parametrize("contact", [sliders(), sliders("coulomb_3d", PADS, 3)], ids=["jenkins", "coulomb_3d"])
def test_an_inverse_in_single_precision_is_the_same(comm, contact) -> None:
    """As of many slipping rows: what is made of it is made in that precision, too."""
    assert_same_inverse(comm, contact, {"fw_modes_single": 1}, 1e-5)


def test_an_inverse_that_cannot_be_added_to_is_made_anew(comm) -> None:
    """A singular block there, met on one rank: the system is solved, and the next one."""
    M, K = chain()
    options = PETSc.Options()
    with fw.Model(M, K, 0.002 * K, [sliders()], comm) as model:
        problem = problem_of(model)
        still, moving, correctors = motions_and_correctors(problem)
        corrector, other = correctors
        options["fw_basis_cheap"], options["fw_basis_few"] = 0.5, 100
        options["fw_pairs_tolerance"] = 1e-8  # directions kept of one application change the next within it
        for pairs in (0, 2):
            preconditioned(corrector, problem, slipping(problem, still, moving, pairs))
        y = slipping(problem, still, moving, 3)
        if comm.rank == 0:
            _core.arm_fault("harmonic block", "value", 1)
        found = [preconditioned(corrector, problem, y) for _ in range(2)]
        options.delValue("fw_basis_cheap"), options.delValue("fw_basis_few")
        expected = preconditioned(other, problem, y)
        options.delValue("fw_pairs_tolerance")
        for one in found:
            one.axpy(-1.0, expected)
            assert one.norm() < 1e-6 * expected.norm()
    _core.arm_fault("", "error", 0)


def test_stuck_pairs_are_solved_by_one_iteration(comm) -> None:
    """Blocks are exact there, with damping by K; the columns of the scalars reach the fundamental alone."""
    M, K = chain()
    with fw.Model(M, K, 0.002 * K, [sliders()], comm) as model:
        points = branch(problem_of(model), [1e-4, 1e-3])
    assert all(found["stick"] == 1 for *_, found in points)
    assert sum(linear for _, _, linear, *_ in points) <= sum(newton for _, newton, *_ in points)
    assert points[0][3]["omega"] == pytest.approx(points[-1][3]["omega"], rel=REPEATED)
