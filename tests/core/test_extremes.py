"""Contact at its extremes: a correct answer, or exit 3 with the reason; closed forms and limits."""

from __future__ import annotations

import csv
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.linalg
from petsc4py import PETSc
from test_built import BUILDER, TEXT
from test_krylov import ROOT, SUPPORT, TIP, beam, blade, preloaded, root_map
from tolerances import REPEATED, ROUNDING, SOLVED

import fretwave as fw
from fretwave.commands.main import main
from fretwave.solve.preload import balanced

KN, KT = ROOT["normal_stiffness"], ROOT["tangential_stiffness"]
ONE = np.array([1e6, 1, 1, 1, 1, 1])  #: one pair a million times the others
SLIDING = {"friction_coefficient": 0.0}
ROUTES = pytest.mark.parametrize("route", ["direct", "krylov"])
METHODS = pytest.mark.parametrize("method", ["CNM", "EPMC"])


def first_point(model, start, rest, amplitude, route="direct", method="CNM", dof=0, highest=3, samples=32):
    """State and contact of the first point of a branch. Collective."""
    PETSc.Options()[f"{route}_route"] = route
    problem = fw.NonlinearMode(model, fw.Harmonics(range(highest + 1), samples), method, dof, start, f"{route}_")
    problem.preload(rest.displacement, rest.load)
    branch = fw.Continuation(problem, problem.initial(amplitude), (0.5 * amplitude, 2 * amplitude))
    point = next(iter(branch), None)
    assert point is not None, branch.reason
    return {**problem.state(point.y), **problem.diagnostics(point.y), "residual": point.residual}


def mass(comm, k=(1.0, 1.2, 1.5), **parameters):
    """A unit mass on three springs k, with one pair in contact in its three directions."""
    chosen = {"normal_stiffness": 3.0, "tangential_stiffness": 2.0, "friction_coefficient": 0.5, **parameters}
    return fw.Model(np.eye(3), np.diag(k), None, [fw.Contact("coulomb_3d", np.eye(3), chosen)], comm)


def along(axis, omega=1.0):
    return fw.LinearMode(omega, 0.0, np.eye(3)[axis], np.zeros(3))


def at_rest(model):
    return balanced(model, along(0))


def blade_omega(normal, tangential):
    """First bending of the blade with springs in place of its contact, by LAPACK."""
    M, K = beam()
    B = root_map(len(K))
    support = SUPPORT * np.tile([KN, KT, KT], 6)
    springs = np.column_stack([np.broadcast_to(k, 6) for k in (normal, tangential, tangential)]).ravel()
    # the largest 1/w^2: beside springs of 1e14 N/m the smallest w^2 would be lost
    inverse, shapes = scipy.linalg.eigh(M, K + (B.T * (support + springs)) @ B)
    shapes = shapes[:, ::-1]
    bending = int(np.argmax(np.abs(shapes[TIP]) > 0.5 * np.abs(shapes).max(axis=0)))
    return float(1 / np.sqrt(inverse[::-1][bending]))


# ---- one mass: closed forms at any amplitude


@ROUTES
@METHODS
@pytest.mark.parametrize("amplitude", [1e-9, 1.0, 10.0])
def test_without_load_a_pair_is_a_unilateral_spring(comm, amplitude, method, route):
    """Zero gap: w = 2 w1 w2 / (w1 + w2) = 4/3 at any amplitude, within what H = 15 leaves out."""
    model = mass(comm)
    case = {"route": route, "method": method, "highest": 15, "samples": 256}
    point = first_point(model, along(0, 1.4), at_rest(model), amplitude, **case)
    assert point["omega"] == pytest.approx(4 / 3, rel=2e-5)
    assert point["zeta"] == pytest.approx(0, abs=SOLVED)


@METHODS
def test_a_gap_never_reached_leaves_the_free_mode(comm, method):
    model = mass(comm, gap=20.0)
    for axis in range(3):
        free = np.sqrt((1.0, 1.2, 1.5)[axis])
        point = first_point(model, along(axis, free), at_rest(model), 10.0, method=method, dof=axis)
        assert point["open"] == 1
        assert point["omega"] == pytest.approx(free, rel=ROUNDING) and point["zeta"] == pytest.approx(0, abs=ROUNDING)


@pytest.mark.parametrize("amplitude", [1e-9, 0.5])
@pytest.mark.parametrize(
    "friction, axis, square", [(0.0, 0, 4.0), (0.0, 1, 1.2), (1e3, 0, 4.0), (1e3, 1, 3.2)], ids=str
)
def test_no_friction_and_much_friction_are_linear(comm, friction, axis, square, amplitude):
    """Without friction a closed pair is a normal spring alone; with mu = 1000 all three springs stay."""
    for load in ({"normal_load": 2.0}, {"gap": -2.0 / 3.0}):  # an interference is a load
        model = mass(comm, friction_coefficient=friction, **load)
        rest = fw.static_preload(model, np.array([1.0, 0, 0]), along(0)) if "gap" in load else at_rest(model)
        point = first_point(model, along(axis, np.sqrt(square)), rest, amplitude, dof=axis)
        rounding = np.finfo(float).eps * 2.0 / amplitude  # of the load, beside forces k a
        assert point["omega"] == pytest.approx(np.sqrt(square), rel=SOLVED + rounding)
        assert point["zeta"] == pytest.approx(0, abs=SOLVED + rounding)


@pytest.mark.parametrize("stiffness, square", [(1e2, 1e9), (1e14, 1e14)])
def test_from_a_soft_to_a_bonded_contact(comm, stiffness, square):
    """On a structure of 1e9 N/m: 1e2 N/m leaves it free, 1e14 N/m is all there is (first order in the ratio)."""
    load = 1e9 * stiffness  # holds the pair at an amplitude of 1 mm
    model = mass(
        comm, (1e9, 1.2e9, 1.5e9), normal_stiffness=stiffness, tangential_stiffness=stiffness, normal_load=load
    )
    start = along(0, np.sqrt(1e9 + stiffness))
    point = first_point(model, start, at_rest(model), 1e-3)
    assert point["stick"] == 1
    assert point["omega"] == pytest.approx(np.sqrt(square), rel=1e-5)


# ---- a blade on two flanks: linear modes at a small amplitude


@pytest.mark.parametrize("times", [0.7, 1.05, 1.2, 1.3, 1.5, 2.0])
def test_a_state_at_rest_balances_its_load_about_small_motions(comm, times):
    """To the last digits, beside a pair 1e6 times as stiff: rounded otherwise, up to 1e-5 of a motion's force."""
    model = blade(comm, normal_stiffness=KN * ONE, tangential_stiffness=KT * ONE)
    first, rest = preloaded(model, times)
    problem = fw.NonlinearMode(model, fw.Harmonics(range(4), 32), "CNM", TIP, first)
    problem.preload(rest.displacement, rest.load)
    mean = problem.residual(problem.initial(1e-6)).array[: model.core.local_dofs * problem.harmonics.block_size]
    assert np.linalg.norm(mean[:: problem.harmonics.block_size]) < ROUNDING


@ROUTES
@pytest.mark.parametrize(
    "changes, normal, tangential",
    [
        ({}, KN, KT),
        (SLIDING, KN, 0),
        ({"friction_coefficient": 1e3}, KN, KT),
        ({"friction_coefficient": [0, 1, 0, 1, 0, 1]}, KN, KT * np.array([0, 1, 0, 1, 0, 1])),
        ({"tangential_stiffness": 1e14}, KN, 1e14),
        ({"normal_stiffness": 1e2, "tangential_stiffness": 1e2}, 1e2, 1e2),
        ({"normal_stiffness": 1e14, "tangential_stiffness": 1e14}, 1e14, 1e14),
        ({"normal_stiffness": KN * ONE, "tangential_stiffness": KT * ONE}, KN * ONE, KT * ONE),
        ({"normal_load": 0.0, "gap": -1e-4}, KN, KT),
    ],
    ids=["given", "mu=0", "mu=1e3", "mu=0,1", "kt=1e14", "k=1e2", "k=1e14", "one-stiff", "interference"],
)
def test_small_motion_is_linear(comm, changes, normal, tangential, route):
    """Also where rounding keeps the residual above its tolerance: the frequency is that of the springs."""
    model = blade(comm, **changes)
    found = first_point(model, *preloaded(model), 1e-6, route, dof=TIP)
    assert found["omega"] == pytest.approx(blade_omega(normal, tangential), rel=REPEATED)
    assert found["zeta"] == pytest.approx(0, abs=SOLVED)
    assert found["residual"] < 1e-5 and found["open"] == 0


@ROUTES
@METHODS
def test_a_nanometre_beside_a_preload_of_kilonewtons(comm, route, method):
    """Forces cancel that are 1e7 times those of the motion: Newton ends at the rounding of those at the latest."""
    model = blade(comm)
    found = first_point(model, *preloaded(model), 1e-9, route, method, TIP)
    assert found["omega"] == pytest.approx(blade_omega(KN, KT), rel=REPEATED)
    assert found["residual"] < 1e-6


def test_a_load_a_million_times_the_others_on_one_pair(comm):
    model = blade(comm, normal_load=2e3 * ONE)
    found = first_point(model, *preloaded(model), 1e-4, dof=TIP)
    assert found["omega"] == pytest.approx(blade_omega(KN, KT), rel=REPEATED)


def test_a_pair_that_slips_at_rest_sticks_in_a_small_motion(comm):
    """No load of their own, pulled at: all pairs slip under the pull and shake down to stick."""
    model = blade(comm, normal_load=0.0)
    first, rest = preloaded(model)
    found = first_point(model, first, rest, 1e-6, dof=TIP)
    assert rest.slip == 1 and found["stick"] > 0.9
    assert found["omega"] == pytest.approx(blade_omega(KN, KT), rel=1e-6)


def test_twice_the_pairs_of_half_the_size_are_the_same(comm):
    """In partial slip."""
    pairs = {key: 0.5 * ROOT[key] for key in ("normal_stiffness", "tangential_stiffness", "normal_load")}
    M, K = beam()
    B = root_map(len(K))
    K += SUPPORT * (B.T * np.tile([KN, KT, KT], 6)) @ B
    twice = fw.Contact("coulomb_3d", np.vstack([B, B]), {**ROOT, **pairs}, "root")
    found = []
    for model in (blade(comm), fw.Model(M, K, None, [twice], comm)):
        found.append(first_point(model, *preloaded(model), 2.5e-3, dof=TIP, highest=3, samples=64))
    assert 0 < found[0]["slip"] < 1
    for key in ("omega", "beta", "slip"):
        assert found[1][key] == pytest.approx(found[0][key], rel=REPEATED)


@ROUTES
def test_a_mode_that_moves_no_pair(comm, route):
    """Two masses on a third, in opposite motion: the contact of the third feels nothing at any amplitude."""
    K = np.array([[2.0, 0, -1], [0, 2.0, -1], [-1, -1, 3.0]])
    friction = {"normal_stiffness": 1e9, "tangential_stiffness": 1e9, "friction_coefficient": 0.5, "normal_load": 1.0}
    B = np.kron([[0, 0, 1.0]], np.eye(3))
    model = fw.Model(np.eye(9), np.kron(K, np.eye(3)), None, [fw.Contact("coulomb_3d", B, friction)], comm)
    shape = np.kron([1.0, -1.0, 0], [0, 1.0, 0])
    start = fw.LinearMode(np.sqrt(2), 0.0, shape, np.zeros(9))
    for amplitude in (1e-6, 10.0):
        point = first_point(model, start, balanced(model, start), amplitude, route, dof=1)
        assert point["stick"] == 1 and point["omega"] == pytest.approx(np.sqrt(2), rel=SOLVED)


def test_long_steps_still_end_at_the_stop_value(comm):
    """From 1 nm into slip in steps of e^2: the last one is shortened until its end is found."""
    model = blade(comm)
    first, rest = preloaded(model)
    problem = fw.NonlinearMode(model, fw.Harmonics(range(4), 64), "CNM", TIP, first, "long_")
    problem.preload(rest.displacement, rest.load)
    steps = fw.StepControl(initial=2.0, maximum=2.0)
    branch = fw.Continuation(problem, problem.initial(1e-9), (1e-9, 6e-3), steps)
    points = list(branch)
    assert branch.converged, branch.reason
    assert points[-1].event == "stop" and points[-1].parameter == pytest.approx(6e-3, rel=ROUNDING)
    assert problem.diagnostics(points[-1].y)["slip"] > 0.5


# ---- what a user sees


def test_a_pair_without_stiffness_is_named(comm):
    """By its number in the case, on any rank."""
    stiffness = np.array([KN] * 5 + [0.0])
    with pytest.raises(
        fw.InputError, match=r"(?s)normal_stiffness.*out of bounds.*contact 'root', pair 5.*> 0 \[force/length\]"
    ):
        blade(comm, normal_stiffness=stiffness)


@pytest.fixture
def chain_case(tmp_path: Path):
    """A chain that contact alone holds in the normal direction."""
    (tmp_path / "model.py").write_text(BUILDER.read_text(encoding="utf-8"), encoding="utf-8")
    (tmp_path / "case.toml").write_text(TEXT, encoding="utf-8")
    return tmp_path / "case.toml"


@pytest.mark.ranks(1)
@pytest.mark.parametrize("ranks", [1, 2])
def test_a_singular_structure_ends_with_code_3(chain_case, tmp_path, launch, ranks):
    """Pulled at while nothing touches: no pivot, whatever factorises (LAPACK on one rank, KLU on two)."""
    words = ["run", str(chain_case), "--only", "static", "--no-plots", "--out", str(tmp_path / "run")]
    words += ["--set", "contact.pads.normal_load=0", "--set", "contact.pads.gap=1e9"]
    done = launch(ranks, "-m", "fretwave", *words)
    assert done.returncode == 3, done.stderr
    assert "the structure moves without load" in done.stderr and "hold the structure" in done.stderr
    assert "Traceback" not in done.stderr and "PETSc error" not in done.stderr


#: `fretwave`, where Python's collector has not come by the end.
UNCOLLECTED = """
import gc, sys
gc.set_threshold(10**6)
from fretwave.commands.main import main
sys.exit(main(sys.argv[1:]))
"""


@pytest.mark.ranks(1)
def test_what_an_exception_holds_on_one_rank_leaves_no_other_waiting(chain_case, tmp_path, launch):
    """PETSc cleans up as it ends, and waited there for a rank that had objects left: after all was said, for ever."""
    words = ["run", str(chain_case), "--only", "static", "--no-plots", "--out", str(tmp_path / "run")]
    words += ["--set", "contact.pads.normal_load=0", "--set", "contact.pads.gap=1e9"]
    assert launch(2, "-c", UNCOLLECTED, *words, timeout=40.0).returncode == 3


#: A script that catches an error, which the first rank alone holds: by a cycle, or to its end.
CAUGHT = """
import gc
gc.set_threshold(10**6)
import numpy as np
from mpi4py import MPI
import fretwave as fw

kept = []

def load_what_is_free():
    free = np.diag([1.0, 2.0, 1.0]) - np.eye(3, k=1) - np.eye(3, k=-1)
    regularised = {"friction_limit": 1.0, "regularisation_velocity": 0.1}
    pad = fw.Contact("regularised_coulomb", B=[[0.0, 0.0, 1.0]], parameters=regularised)
    model = fw.Model(np.eye(3), free, contacts=[pad])
    try:
        fw.static_preload(model, np.ones(3))
    except fw.NotConverged as error:
        if MPI.COMM_WORLD.rank == 0:
            HELD
        print("caught", flush=True)

load_what_is_free()
"""


@pytest.mark.ranks(1)
@pytest.mark.parametrize("held", ["held = [error]", "kept.append(error)"], ids=["by a cycle", "to the end"])
def test_what_a_script_has_caught_on_one_rank_leaves_no_other_waiting(launch, held):
    done = launch(2, "-c", CAUGHT.replace("HELD", held), timeout=40.0)
    assert done.returncode == 0 and done.stdout.count("caught") == 2, done.stderr


@pytest.mark.ranks(1)
def test_each_analysis_gives_its_reason_and_keeps_its_points(chain_case, tmp_path, capsys):
    """Two analyses stop early; table, results.h5 and `show` work with what was found."""
    text = TEXT + TEXT[TEXT.index('[[analysis]]\nname = "mode"') :].replace('"mode"\ntype', '"again"\ntype')
    chain_case.write_text(text.replace("harmonics = 3", "step = { max_points = 3 }\nharmonics = 3"), encoding="utf-8")
    out = tmp_path / "run"
    assert main(["run", str(chain_case), "--only", "mode,again", "--no-plots", "--out", str(out)]) == 3
    said = capsys.readouterr().err
    for name in ("mode", "again"):
        assert f"analysis '{name}', after point" in said
        with open(out / f"{name}.csv", encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        assert len(rows) >= 3 and all(np.isfinite(float(row["omega"])) for row in rows)
        with h5py.File(out / "results.h5", "r") as file:
            assert file[name].attrs["status"] == "stopped" and len(file[name]["points"]["omega"]) == len(rows)
    assert main(["show", str(out)]) == 0


@pytest.mark.ranks(1)
@pytest.mark.parametrize("value", [-1e-9, -1e12])
def test_numbers_of_any_size_are_said_in_their_digits(comm, value):
    """None of them reads 0.000000 or has a dozen digits that say nothing."""
    model = fw.Model([[1.0]], [[1.0]], comm=comm)
    mode = fw.linear_modes(model, 1)[0]
    problem = fw.NonlinearMode(model, fw.Harmonics([1], 8), "CNM", 0, mode)
    forced = fw.ForcedResponse(model, fw.Harmonics([1], 8), {1: np.ones(1)}, 1.0, 0, mode)
    for wrong in (lambda: problem.initial(value), lambda: forced.initial(value)):
        with pytest.raises(fw.InputError, match=f"(?s)is not positive.*{value:g}".replace("+", ".")):
            wrong()
