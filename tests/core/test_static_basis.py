"""Finite elements by one real factor, the lowest modes of stuck pairs and static corrections."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp
import test_sparse_route as solid
import test_stuck_basis as chains
from models.core_models import options
from petsc4py import PETSc

import fretwave as fw
from fretwave import _core

pytestmark = pytest.mark.ranks(1, 2)

ONE_RANK = pytest.mark.ranks(1)
STEPS = 8  #: GMRES iterations a Newton step, at the most


def lifting(comm, turning):
    """The bar of solid elements on pairs whose planes lie askew to its bending, so that they slip and open."""
    M, K, C, B, tip = solid.structure(solid.SMALL, turning)
    askew = np.kron(np.eye(3), [[0.6, 0.8, 0], [-0.8, 0.6, 0], [0, 0, 1]])
    contact = fw.Contact("coulomb_3d", askew @ B, {**solid.STIFFNESS, **solid.LOADS}, "root")
    return fw.Model(M, K, C, [contact], comm), tip


@pytest.mark.parametrize(
    "method, turning",
    [("CNM", 0.0), pytest.param("EPMC", 0.0, marks=ONE_RANK), pytest.param("CNM", 50.0, marks=ONE_RANK)],
)
def test_motions_are_those_of_the_direct_route(comm, method, turning):
    """From stick into slip and lift-off; damping by K, and with gyroscopic terms that the modes leave out."""
    model, tip = lifting(comm, turning)
    amplitudes = [solid.STICK, solid.SLIP, 2.5e-4]
    one = solid.mode(model, tip, "static_one_", route="krylov", pc_type="fwstatic", method=method)
    found, route = solid.solve(one, amplitudes)
    direct, _ = solid.solve(solid.mode(model, tip, "static_direct_", route="direct", method=method), amplitudes)
    assert "4 blocks of 30 modes of stuck pairs and 9 static motions, one real factor" in route
    assert found[0]["slip"] == 0 and found[1]["slip"] > 0.05 and found[2]["open"] > 0.05
    assert max(state["iterations"] / state["steps"] for state in found) <= STEPS
    solid.assert_same(found, direct)


HELD = {  #: dofs between ranks, a share of all, up to which there are substructures, and megabytes held whole
    "spread": (1e-9, 1e-3),
    "whole": (1e-9, 1000.0),
    "substructures": (0.9, 1000.0),
    "too large": (0.9, 1e-3),
}


@pytest.mark.ranks(2, 3)
@pytest.mark.parametrize("kind", HELD)
def test_ranks_hold_the_factor_in_parts_or_whole(comm, kind):
    """Spread, MUMPS solves over all ranks; whole, each for its share of the columns; or each has a substructure."""
    between, held = HELD[kind]
    with options(fw_static_between=between, fw_static_held=held):
        model, tip = lifting(comm, 0.0)
        one = solid.mode(model, tip, f"held_{kind}_", route="krylov", pc_type="fwstatic")
        found, route = solid.solve(one, [solid.STICK, solid.SLIP])
    direct, _ = solid.solve(solid.mode(model, tip, f"direct_{kind}_", route="direct"), [solid.STICK, solid.SLIP])
    words = rf"one real factor( in {comm.size} parts and \d+ dofs between)? \(\d+ MB\)"
    assert bool(re.search(words, route)[1]) == (kind == "substructures"), route
    assert found[1]["slip"] > 0.05 and max(state["iterations"] / state["steps"] for state in found) <= STEPS
    solid.assert_same(found, direct)


@pytest.mark.ranks(2)
@pytest.mark.parametrize(
    "given", [{"pc_type": "none"}, {"ksp_type": "gmres", "pc_type": "jacobi"}], ids=["none", "gmres"]
)
def test_options_of_the_users_own_solver_leave_it_alone(comm, given):
    """Without a prefix: SLEPc set the solver of substructures by them, and iterations went from 24 to 224."""
    with options(fw_static_between=0.9):
        model, tip = lifting(comm, 0.0)
        problem = solid.mode(model, tip, "plain_", route="krylov", pc_type="fwstatic")
        with options(**given):
            found, route = solid.solve(problem, [solid.STICK, solid.SLIP])
    assert "dofs between" in route and max(state["iterations"] / state["steps"] for state in found) <= STEPS


@pytest.mark.ranks(2)
def test_options_of_mumps_steer_substructures_too(comm):
    """By the names that they have on one rank; what is not the user's to say is left unread, and told."""
    with options(fw_static_between=0.9, static_mat_mumps_icntl_7=0, static_mat_mumps_icntl_20=1):
        model, tip = lifting(comm, 0.0)
        found, route = solid.solve(
            solid.mode(model, tip, "steered_", route="krylov", pc_type="fwstatic"), [solid.STICK, solid.SLIP]
        )
        unread = [name for name in _core.unused_options() if name.startswith("static_")]
    assert "dofs between" in route and unread == ["static_mat_mumps_icntl_20"]
    assert max(state["iterations"] / state["steps"] for state in found) <= STEPS


@pytest.mark.ranks(4)
@pytest.mark.parametrize("between", [1e-9, 0.9])
def test_ranks_without_dofs_take_part(comm, between):
    """3 dofs on 4 ranks: one waited where the others did not."""
    K = np.array([[3.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 2.0]])
    B = np.array([[0.0, 1.0, 0.0]])
    with options(fw_static_between=between):
        model = fw.Model(np.eye(3), K, 0.01 * K, [fw.Contact("jenkins", B, chains.SLIDER)], comm)
        found, route = {}, ""
        for kind in ("fwstatic", "direct"):
            given = {"route": "direct"} if kind == "direct" else {"route": "krylov", "pc_type": kind}
            for name, value in given.items():
                PETSc.Options()[f"none_{kind}_{name}"] = value
            first = fw.linear_modes(model, 1, "stuck")[0]
            problem = fw.NonlinearMode(model, fw.Harmonics(range(4), 64), "CNM", 2, first, f"none_{kind}_")
            found[kind], said = solid.solve(problem, [0.01, 0.3])
            route = route or said
    assert "one real factor" in route and found["direct"][1]["slip"] > 0.05
    solid.assert_same(found["fwstatic"], found["direct"])


def line(dofs):
    """Springs of 1 N/m from one dof to the next, and of 0.5 N/m to the ground."""
    return 2.5 * np.eye(dofs) - np.eye(dofs, k=1) - np.eye(dofs, k=-1)


def shuffled(K):
    order = np.random.default_rng(3).permutation(len(K))
    return K[np.ix_(order, order)]


GRAPHS = {
    "a line": line(60),
    "a line at random": shuffled(line(60)),
    "parts that nothing joins": shuffled(np.kron(np.eye(5), line(12))),
    "dofs on their own": np.diag(np.linspace(1.0, 2.0, 60)),
    "one that all are coupled to": line(60) + 0.01 * (np.eye(60)[7][:, None] + np.eye(60)[7]),
}


@pytest.mark.ranks(2, 3)
@pytest.mark.parametrize("graph", GRAPHS)
def test_any_graph_is_divided(comm, graph):
    """Of a line few dofs lie between the ranks, however it is numbered; of dofs that nothing joins none."""
    K = GRAPHS[graph]
    with options(fw_static_between=0.9):
        model = fw.Model(np.eye(60), K, 0.01 * K, [fw.Contact("jenkins", np.eye(60)[[5]], chains.SLIDER)], comm)
        first = fw.linear_modes(model, 1, "stuck")[0]
        dof = int(abs(first.shape).argmax())
        found, route = {}, ""
        for kind, given in {
            "static": {"route": "krylov", "pc_type": "fwstatic"},
            "direct": {"route": "direct"},
        }.items():
            prefix = f"{graph.replace(' ', '_')}_{kind}_"
            with options(**{prefix + name: value for name, value in given.items()}):
                problem = fw.NonlinearMode(model, fw.Harmonics(range(4), 64), "CNM", dof, first, prefix)
                found[kind], said = solid.solve(problem, [0.1, 1.0])
            route = route or said
    between = int(re.search(r"and (\d+) dofs between", route)[1])
    most = {"a line": 1, "a line at random": 1, "parts that nothing joins": 1, "dofs on their own": 0}
    assert between <= most.get(graph, 60) * (comm.size - 1), route
    solid.assert_same(found["static"], found["direct"])


@pytest.mark.ranks(2)
@pytest.mark.parametrize("beside", ["a long line", "4000 dofs on their own"])
def test_long_graphs_and_many_parts_are_divided(comm, beside):
    """More levels than are counted, and more parts than are sought one by one: still few dofs lie between."""
    long = beside == "a long line"
    n, count = (7000, 7000) if long else (4500, 500)
    place = np.random.default_rng(3).permutation(n) if long else np.arange(n)
    main = 2.5 + 0.05 * np.arange(n)[::-1]  # the last dofs move, in modes far apart
    off = np.where(np.arange(n - 1) < n - count, 0.0, -1.0)
    K = sp.diags([off, main, off], [-1, 0, 1], format="csr")[place][:, place]
    B = sp.csr_matrix(([1.0], ([0], [n - 1])), shape=(1, n))[:, place]
    with options(fw_static_between=0.1):
        model = fw.Model(sp.identity(n, format="csr"), K, 0.01 * K, [fw.Contact("jenkins", B, chains.SLIDER)], comm)
        first = fw.linear_modes(model, 1, "stuck")[0]
        problem = solid.mode(model, int(abs(first.shape).argmax()), "divided_", route="krylov", pc_type="fwstatic")
        _, route = solid.solve(problem, [0.1])
    assert int(re.search(r"and (\d+) dofs between", route)[1]) <= 2, route


@pytest.mark.ranks(2, 3)
def test_rounding_that_couples_two_substructures_one_way_alone(comm):
    """An entry of 1e-18 of the stiffness in one triangle: K is symmetric to rounding."""
    M, K, C, B, tip = solid.structure(solid.SMALL)
    K = K.tolil()
    K[0, -1] = K[-1, 3] = 1e-18 * abs(K).max()
    contact = fw.Contact("coulomb_3d", B, {**solid.STIFFNESS, **solid.LOADS}, "root")
    with options(fw_static_between=0.9):
        one = solid.mode(
            fw.Model(M, K.tocsr(), C, [contact], comm), tip, "one_way_", route="krylov", pc_type="fwstatic"
        )
        found, route = solid.solve(one, [solid.SLIP])
    direct, _ = solid.solve(
        solid.mode(solid.solid(comm, solid.SMALL)[0], tip, "two_way_", route="direct"), [solid.SLIP]
    )
    assert "dofs between" in route
    solid.assert_same(found, direct)


@pytest.mark.ranks(2, 3)
@pytest.mark.parametrize("numbered", ["along", "at random"])
def test_substructures_are_sought_where_numbers_do_not_tell_them(comm, numbered):
    """Of 3660 dofs numbered at random nearly all have a neighbour on another rank: a partition finds the cuts across
    the bar, 60 dofs each."""
    M, K, C, B, tip = solid.structure(solid.LARGE)
    order = np.arange(K.shape[0]) if numbered == "along" else np.random.default_rng(7).permutation(K.shape[0])
    M, K, C = ((A.tocsr()[order][:, order]) for A in (M, K, C))
    contact = fw.Contact("coulomb_3d", B[:, order], {**solid.STIFFNESS, **solid.LOADS}, "root")
    model = fw.Model(M, K, C, [contact], comm)
    tip = int(np.nonzero(order == tip)[0][0])
    found, route = solid.solve(solid.mode(model, tip, f"sought_{comm.size}_", pc_type="fwstatic"), [solid.SLIP])
    parts, between = map(int, re.search(r"in (\d+) parts and (\d+) dofs between", route).groups())
    assert parts == comm.size and between <= 2 * 60 * (comm.size - 1), route
    direct, _ = solid.solve(solid.mode(model, tip, f"sought_direct_{comm.size}_", pc_type="fwcondensed"), [solid.SLIP])
    solid.assert_same(found, direct)


@ONE_RANK
def test_solid_model_takes_it_for_its_memory(comm):
    """3660 dofs: chosen, with less than a quarter of the memory of four complex factors, and as PCView says it."""
    model, tip = solid.solid(comm, solid.LARGE)
    auto = solid.mode(model, tip, "static_auto_")
    found, route = solid.solve(auto, [solid.STICK, solid.SLIP])
    sparse = solid.mode(model, tip, "static_sparse_", pc_type="fwcondensed")
    other, condensed = solid.solve(sparse, [solid.STICK, solid.SLIP])
    one, four = (float(re.search(r"\((\d+) MB\)", text)[1]) for text in (route, condensed))
    assert re.match(r"krylov \(\d+ unknowns\), 4 blocks of 30 modes of stuck pairs", route), route
    assert one < four / 4
    assert max(state["iterations"] / state["steps"] for state in found) <= STEPS
    solid.assert_same(found, other)


@ONE_RANK
def test_few_dofs_some_without_mass(comm, tmp_path):
    """Fewer modes than asked for, through slip, and what PCView says."""
    M, K = chains.chain()
    M[3, 3] = M[7, 7] = 0.0
    levels = [0.1, 1.0, 4.0]
    found = {}
    for kind in ("fwstatic", "direct"):
        options = PETSc.Options(f"few_{kind}_")
        if kind == "fwstatic":
            options["pc_type"] = kind
        with fw.Model(M, K, 0.002 * K, [chains.sliders()], comm) as model:
            problem = chains.problem_of(model, f"few_{kind}_")
            options["route"] = "direct" if kind == "direct" else "krylov"
            points = chains.branch(problem, levels)
            found[kind] = chains.reported(points)
            if kind == "fwstatic":
                said = viewed(problem, tmp_path, comm)
    assert "type: fwstatic" in said and re.search(r"6 modes .* and 4 static motions, one real factor \(\d+ MB\)", said)
    assert max(contact["slip"] for *_, contact in points) > 0.2
    for level in levels:
        one, same = (found[kind][level] for kind in ("fwstatic", "direct"))
        solid.assert_same([one], [same])


def viewed(problem, folder, comm):
    """What PCView says, on every rank. Collective."""
    newton, path = _core.Newton(problem.core, problem.prefix), comm.bcast(str(folder / "pc.txt"))
    viewer = PETSc.Viewer().createASCII(path, comm=comm)
    newton.snes.getKSP().getPC().view(viewer)
    viewer.destroy()
    return comm.bcast(Path(path).read_text() if comm.rank == 0 else None)


def problem_with(K, contact, comm):
    model = fw.Model(chains.chain()[0], K, 0.01 * K, [contact], comm)
    start = fw.LinearMode(0.5, 0.0, np.ones(chains.N), np.zeros(chains.N))
    return fw.NonlinearMode(model, fw.Harmonics(range(4), 64), "CNM", chains.N - 1, start, "refused_")


REFUSED = ["a law without a stuck stiffness", "K without symmetry", "K not definite", "a free motion"]


@pytest.mark.parametrize("between", [1e-9, 0.9])
@pytest.mark.parametrize("why", REFUSED)
def test_other_models_are_refused(comm, why, between):
    """By a factor of all ranks and by substructures, of which no one alone need tell."""
    K = chains.chain()[1] - (5.0 * np.eye(chains.N) if why == "K not definite" else 0.0)
    contact = chains.sliders()
    if why == "a free motion":
        K -= np.diag(K.sum(1))
    if why == "K without symmetry":
        K = chains.unsymmetric(K)
    if why == "a law without a stuck stiffness":
        contact = chains.sliders("regularised_coulomb", {"friction_limit": 1.0, "regularisation_velocity": 1e-2})
    given = PETSc.Options("refused_")
    given["route"], given["pc_type"] = "krylov", "fwstatic"
    named = "no fwstatic for a model without a basis of stuck pairs"
    with options(fw_static_between=between), pytest.raises(fw.InputError, match=named):
        _core.Newton(problem_with(K, contact, comm).core, "refused_")


def test_what_is_beyond_memory_is_refused_in_words(comm):
    """Before it is allocated: the route says why it takes none; asked for, it is an error."""
    model, tip = solid.solid(comm, solid.SMALL)
    words = r"takes \S+ GB, of \S+ GB free"
    with options(fw_linear_memory_share=1e-9):
        problem = solid.mode(model, tip, "static_large_", route="krylov")
        route = _core.Newton(problem.core, "static_large_").route
        for what, kind in (
            ("static compliance", "fwstatic"),
            ("condensed system", "fwcondensed"),
            ("dense blocks", "fwblocks"),
        ):
            assert re.search(f"{what} {words}: no {kind}", route), route
        asked = solid.mode(model, tip, "static_asked_", route="krylov", pc_type="fwstatic")
        with pytest.raises(fw.InputError, match=f"takes no fwstatic.*static compliance {words}"):
            _core.Newton(asked.core, "static_asked_")
