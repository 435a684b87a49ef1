"""The Krylov route against the direct one on a blade held by two inclined flanks: first bending, from stick to slip."""

from __future__ import annotations

from itertools import groupby

import numpy as np
import pytest
from models.core_models import counting, options
from petsc4py import PETSc
from tolerances import REPEATED, ROUNDING, SOLVED

import fretwave as fw
from fretwave.solve.preload import balanced, static_preload

pytestmark = pytest.mark.ranks(1, 2, 3)

YOUNG, DENSITY = 1.1e11, 4400.0  #: titanium [Pa, kg/m3]
LENGTH, WIDTH, THICKNESS = 0.12, 0.03, 0.007  #: of the blade [m]
ELEMENTS = 4
ROOT = {"normal_stiffness": 3e7, "tangential_stiffness": 2.5e7, "friction_coefficient": 0.3, "normal_load": 2000.0}
FLANK = np.radians(55)  #: between the blade's axis and a flank's normal
#: Share of the root's stiffness beside the contact (bolt, axial stop). Without it the mean is held by friction alone.
SUPPORT = 0.3
TIP = 6 * ELEMENTS + 1  #: displacement across the thickness
AMPLITUDES = [1.5e-3, 2.2e-3, 2.35e-3, 2.5e-3, 2.8e-3, 3.5e-3, 6e-3, 1.2e-2]


def bending(h, stiffness, mass, sign):
    """Euler beam (v, rotation) x 2; stiffness EI, mass per length."""
    s = np.array([1, sign, 1, sign])
    K = [[12, 6 * h, -12, 6 * h], [6 * h, 4 * h**2, -6 * h, 2 * h**2]]
    K += [[-12, -6 * h, 12, -6 * h], [6 * h, 2 * h**2, -6 * h, 4 * h**2]]
    M = [[156, 22 * h, 54, -13 * h], [22 * h, 4 * h**2, 13 * h, -3 * h**2]]
    M += [[54, 13 * h, 156, -22 * h], [-13 * h, -3 * h**2, -22 * h, 4 * h**2]]
    return mass * h / 420 * np.array(M) * np.outer(s, s), stiffness / h**3 * np.array(K) * np.outer(s, s)


def bar(h, stiffness, mass):
    return mass * h / 6 * np.array([[2, 1], [1, 2]]), stiffness / h * np.array([[1, -1], [-1, 1]])


def beam():
    """M, K of a straight blade, six dofs a node (x y z and rotations about them)."""
    h, area = LENGTH / ELEMENTS, WIDTH * THICKNESS
    about_z, about_y = WIDTH * THICKNESS**3 / 12, THICKNESS * WIDTH**3 / 12
    twist = 0.3 * WIDTH * THICKNESS**3 * YOUNG / 2.6
    parts = [
        ([0, 6], bar(h, YOUNG * area, DENSITY * area)),
        ([3, 9], bar(h, twist, DENSITY * (about_y + about_z))),
        ([1, 5, 7, 11], bending(h, YOUNG * about_z, DENSITY * area, 1)),
        ([2, 4, 8, 10], bending(h, YOUNG * about_y, DENSITY * area, -1)),
    ]
    n = 6 * (ELEMENTS + 1)
    M, K = np.zeros((n, n)), np.zeros((n, n))
    for element in range(ELEMENTS):
        for dofs, (m, k) in parts:
            where = np.ix_(*[[6 * element + d for d in dofs]] * 2)
            M[where] += m
            K[where] += k
    return M, K


def root_map(n):
    """B of three pairs on each flank of a dovetail: relative displacement of points fixed to the root node."""
    rows = []
    for side in (1, -1):
        frame = [[np.cos(FLANK), side * np.sin(FLANK), 0], [-np.sin(FLANK), side * np.cos(FLANK), 0], [0, 0, 1]]
        for x, z in ((0.002, -0.011), (0.0, 0.001), (-0.002, 0.012)):
            y = 0.008 * side
            rigid = np.hstack([np.eye(3), [[0, z, -y], [-z, 0, x], [y, -x, 0]]])
            rows.append(np.array(frame) @ rigid)
    return np.hstack([np.vstack(rows), np.zeros((18, n - 6))])


def blade(comm, **changes):
    """30 dofs, 6 pairs in 3-D contact."""
    M, K = beam()
    B = root_map(len(K))
    kn, kt = ROOT["normal_stiffness"], ROOT["tangential_stiffness"]
    K += SUPPORT * (B.T * np.tile([kn, kt, kt], 6)) @ B
    return fw.Model(M, K, None, [fw.Contact("coulomb_3d", B, {**ROOT, **changes}, "root")], comm)


def preloaded(model, times=1.0):
    """First bending of the stuck blade, and the rest under a pull along the axis with a small push across."""
    first = fw.linear_modes(model, 1, "stuck")[0]
    return first, static_preload(model, times * np.tile([100.0, 1.0, 0, 0, 0, 0], ELEMENTS + 1), first)


#: Routes by name: the basis of stuck pairs, and dense blocks as without it.
KRYLOV = ("krylov", "dense")


def mode(model, first, rest, route, method="CNM", highest=5):
    PETSc.Options()[f"{route}_route"] = "krylov" if route in KRYLOV else route
    PETSc.Options()["dense_blocks"] = "dense"
    problem = fw.NonlinearMode(model, fw.Harmonics(range(highest + 1), 128), method, TIP, first, f"{route}_")
    problem.preload(rest.displacement, rest.load)
    return problem


def branch(problem, stop=(1e-3, 1.5e-2), report_at=AMPLITUDES):
    """Points as dicts: state, contact, counts. Collective."""
    followed = fw.Continuation(problem, problem.initial(stop[0]), stop, report_at=report_at)
    points = [
        {**problem.state(p.y), **problem.diagnostics(p.y), **{k: getattr(p, k) for k in ("event", "newton", "linear")}}
        for p in followed
    ]
    assert followed.converged, followed.reason
    return points


@pytest.fixture(scope="module")
def case(comm):
    """Model, its first stuck mode and its rest state."""
    model = blade(comm)
    return (model, *preloaded(model))


@pytest.fixture(scope="module", params=KRYLOV)
def krylov(case, request):
    return branch(mode(*case, request.param))


@pytest.mark.parametrize(
    "route, words",
    [("direct", "direct (asked"), ("krylov", "6 blocks of 30 modes of stuck pairs"), ("dense", "6 dense blocks of 30")],
)
def test_the_option_chooses_the_route(case, route, words):
    newton = fw._core.Newton(mode(*case, route).core, f"{route}_")
    assert newton.route.startswith("direct" if route == "direct" else "krylov (asked for)")
    assert words in newton.route


@pytest.mark.ranks(1)
def test_an_unknown_route_is_refused(case):
    PETSc.Options()["wrong_route"] = "quick"
    model, first, _ = case
    problem = fw.NonlinearMode(model, fw.Harmonics([1], 8), "CNM", TIP, first, "wrong_")
    with pytest.raises(fw.InputError, match="(?s)route.*quick"):
        fw._core.Newton(problem.core, "wrong_")


@pytest.mark.parametrize("method", ["CNM", "EPMC"])
def test_both_routes_find_the_same_branch(case, method):
    """To 1e-9 in omega and beta, from stick to slip and lift-off."""
    found = {
        route: [p for p in branch(mode(*case, route, method)) if p["event"] == "report"]
        for route in ("direct", *KRYLOV)
    }
    assert {len(points) for points in found.values()} == {len(AMPLITUDES)}
    assert found["direct"][0]["slip"] == 0 and found["direct"][-1]["slip"] > 0.3 and found["direct"][-1]["open"] > 0
    for direct, krylov in zip(2 * found["direct"], found["krylov"] + found["dense"]):
        assert krylov["omega"] == pytest.approx(direct["omega"], rel=SOLVED)
        assert krylov["beta"] == pytest.approx(direct["beta"], rel=SOLVED, abs=SOLVED * direct["omega"])


@pytest.mark.parametrize("route", KRYLOV)
def test_stuck_regime_needs_at_most_three_iterations(case, route):
    """2 iterations when stuck. From a perturbed point, as the linear mode itself needs none."""
    problem = mode(*case, route)
    y = problem.initial(1e-3)
    begin, end = y.getOwnershipRange()
    size = y.getSize() - 3
    rough = 1e-4 * np.random.default_rng(0).standard_normal(size) * (np.arange(size) % problem.harmonics.block_size < 3)
    y.setArray(y.getArray() + np.concatenate([rough, np.zeros(3)])[begin:end])
    newton, row = fw._core.Newton(problem.core, f"{route}_"), problem.core.unknowns()
    row.set(0)
    row.setValue(row.getSize() - 1, 1.0)
    row.assemble()
    newton.system.close(row, np.log(1e-3))
    converged, steps, iterations, _, reason = newton.solve(y)
    assert converged, reason
    assert problem.diagnostics(y)["stick"] == 1
    assert steps >= 1 and iterations <= 3 * steps, f"{iterations} GMRES iterations in {steps} Newton steps"


def test_iterations_do_not_grow_with_slip(krylov, comm):
    """GMRES iterations per Newton step (the mean of each point): 9.5 with pairs that do not know of each other."""
    moving = [p for p in krylov if p["newton"]]
    if comm.rank == 0:
        for share, points in groupby(sorted(moving, key=lambda p: p["slip"]), key=lambda p: round(p["slip"], 1)):
            counts = [p["linear"] / p["newton"] for p in points]
            print(f"slip {share:.1f}: {min(counts):.1f} to {max(counts):.1f} GMRES iterations per Newton step")
    assert max(p["slip"] for p in moving) > 0.75
    assert max(p["linear"] / p["newton"] for p in moving) <= 7


@pytest.mark.parametrize("method", ["CNM", "EPMC"])
def test_steps_of_a_large_problem_are_solved_as_far_as_they_lead(case, method):
    """The same points as to six digits, to all digits that those have, by fewer iterations of GMRES."""
    usual = branch(mode(*case, "krylov", method))
    with options(fw_linear_large=10):
        large = branch(mode(*case, "krylov", method))
    steps, iterations = ([sum(p[key] for p in points) for points in (large, usual)] for key in ("newton", "linear"))
    assert steps[0] <= 1.1 * steps[1] and iterations[0] <= 0.8 * iterations[1], (steps, iterations)
    met = [[p for p in points if p["event"] not in ("", "start")] for points in (large, usual)]
    assert [p["event"] for p in met[0]] == [p["event"] for p in met[1]]
    assert {"report", "peak_damping"} <= {p["event"] for p in met[0]}
    for one, other in zip(*met):
        assert one["amplitude"] == pytest.approx(other["amplitude"], rel=SOLVED)
        assert one["omega"] == pytest.approx(other["omega"], rel=SOLVED)
        assert one["beta"] == pytest.approx(other["beta"], rel=SOLVED, abs=SOLVED * other["omega"])


@pytest.mark.parametrize("amplitude", [3e-8, 1e-7, 3e-7])
def test_steps_of_a_large_problem_end_where_rounding_holds_the_residual(comm, amplitude):
    """No step foretells the next there: taken for hurried ones, all 25 were spent. (It may end on another branch.)"""
    stiff = {key: 1e3 * ROOT[key] for key in ("normal_stiffness", "tangential_stiffness")}
    model = blade(comm, **stiff)
    problem = mode(model, *preloaded(model, 1e8), "krylov")
    with options(fw_linear_large=10):
        followed = fw.Continuation(problem, problem.initial(amplitude), (amplitude, 1.02 * amplitude))
        points = list(followed)
    assert points and "MAX_IT" not in followed.reason, followed.reason


@pytest.mark.parametrize("digits", [1e-3, 1e-6])
def test_an_option_says_how_far_steps_are_solved(case, digits):
    """Of a large problem too, and of tangents: other systems than Newton's steps take as many iterations."""
    found = []
    for least in (10, 1e9):
        given = {"krylov_ksp_rtol": digits, "krylov_tangent_ksp_rtol": 1e-9}
        with options(fw_linear_large=least, **given), counting("KSPSolve") as solves, counting("PCApply") as applied:
            points = branch(mode(*case, "krylov"), (1.5e-3, 2.2e-3), ())
            found.append([solves(), applied(), *((p["newton"], p["linear"]) for p in points)])
    assert found[0] == found[1]


@pytest.mark.parametrize("route", KRYLOV)
def test_a_contact_far_stiffer_than_the_structure(comm, route):
    """30 times the contact stiffness, all pairs on one rigid root, slip to 60 %: averaged tangents stagnate.

    Pairs are coupled to 1e-3: to 3e-2 the basis of stuck pairs took 13 iterations in the mean, up to 33. By steps that
    pass over loops, in which one point takes 16 to 22 by the number of ranks.
    """
    stiff = {key: 30 * ROOT[key] for key in ("normal_stiffness", "tangential_stiffness")}
    model = blade(comm, **stiff)
    with options(fw_branch_other=1e300):
        points = branch(mode(model, *preloaded(model), route, highest=7), (1.5e-3, 2.6e-3), ())
    partial = [p["linear"] / p["newton"] for p in points if p["newton"] and p["slip"] > 0.1]
    # 31 at one point with dense blocks of pairs that do not know of each other; one point alone is up to rounding
    assert partial and np.mean(partial) <= 9 and max(partial) <= 20, (np.mean(partial), max(partial))


def test_stuck_asymptote_is_the_linear_mode(krylov, case):
    """To 1e-8."""
    assert krylov[0]["stick"] == 1
    assert krylov[0]["omega"] == pytest.approx(case[1].omega, rel=REPEATED)
    assert krylov[0]["zeta"] == pytest.approx(0, abs=ROUNDING)


def test_branch_has_the_shape_of_a_blade_root(krylov):
    """Constant frequency, threshold, drop with a rise of damping, maximum, then less damping."""
    zeta, omega = (np.array([p[k] for p in krylov]) for k in ("zeta", "omega"))
    peak = int(np.argmax(zeta))
    assert 0 < peak < len(zeta) - 1 and zeta[peak] > 0.01
    assert (np.diff(omega[: peak + 1]) <= SOLVED * omega[0]).all()


def test_stuck_rest_is_the_linear_static_solution(comm):
    model = blade(comm)
    first, rest = preloaded(model)
    M, K = beam()
    B = root_map(len(K))
    stiff = np.tile([ROOT["normal_stiffness"], *2 * [ROOT["tangential_stiffness"]]], 6)
    K += (1 + SUPPORT) * (B.T * stiff) @ B
    load = rest.load - balanced(model, first).load
    assert rest.stick == 1
    assert np.allclose(
        rest.displacement, np.linalg.solve(K, load), rtol=0, atol=1e-11 * np.abs(rest.displacement).max()
    )
