"""The Krylov route on sparse harmonic factors, for models that are not reduced: bars of solid elements on friction."""

from __future__ import annotations

import re

import numpy as np
import pytest
import scipy.sparse as sp
import test_krylov as beam
from models.core_models import options
from models.hexahedra import bar
from petsc4py import PETSc
from scipy.sparse.linalg import spsolve
from tolerances import SOLVED

import fretwave as fw
from fretwave.solve.preload import balanced, static_preload

pytestmark = pytest.mark.ranks(1, 2, 3)

STIFFNESS = {"normal_stiffness": 4e7, "tangential_stiffness": 3e7}
LOADS = {"friction_coefficient": 0.4, "normal_load": 100.0}
STICK, SLIP = 2e-5, 1.5e-4  #: amplitudes of the tip [m]
SMALL, LARGE = (12, 2, 2), (60, 4, 3)  #: cells: 351 and 3660 dofs


def structure(cells, turning=0.0):
    """M, K, C, B of a bar on three friction pairs near its root, and the tip's dof; `turning` [1/s]: C unsymmetric."""
    made = bar(cells, (0.2, 0.02, 0.008))
    places = [[x, 0.0, 0.0] for x in (0.0, 0.2 / 12, 0.4 / 12)]
    root = [int(np.argmin(np.linalg.norm(made.nodes - place, axis=1))) for place in places]
    B = sp.lil_matrix((9, made.K.shape[0]))
    for k, node in enumerate(root):
        for row, axis in enumerate((1, 2, 0)):  # normal across the bar: bending slips
            B[3 * k + row, 3 * node + axis] = 1
    B = B.tocsr()
    held = made.layer(0.0)
    K = made.K + 1e7 * sp.diags(np.bincount(held, minlength=made.K.shape[0]))
    spin = sp.kron(sp.eye(len(made.nodes)), [[0, -1.0, 0], [1.0, 0, 0], [0, 0, 0]])
    C = 1e-6 * K + turning * (made.M @ spin + spin @ made.M) / 2
    return made.M, K, C, B, 3 * int(np.argmax(made.nodes @ [1.0, 1e-3, 1e-3])) + 2


def solid(comm, cells, turning=0.0):
    """Model and the tip's dof."""
    M, K, C, B, tip = structure(cells, turning)
    return fw.Model(M, K, C, [fw.Contact("coulomb_3d", B, {**STIFFNESS, **LOADS}, "root")], comm), tip


def mode(model, dof, prefix, highest=3, method="CNM", **options):
    for name, value in options.items():
        PETSc.Options()[f"{prefix}{name}"] = value
    first = fw.linear_modes(model, 1, "stuck")[0]
    rest = balanced(model, first)
    problem = fw.NonlinearMode(model, fw.Harmonics(range(highest + 1), 64), method, dof, first, prefix)
    problem.preload(rest.displacement, rest.load)
    return problem


def solve(problem, parameters):
    """State at each amplitude or frequency, with Newton's counts, and the route. Collective."""
    newton, row = fw._core.Newton(problem.core, problem.prefix), problem.core.unknowns()
    row.set(0)
    row.setValue(row.getSize() - 1, 1.0)
    row.assemble()
    found = []
    for parameter in parameters:
        y = problem.initial(parameter)
        newton.system.close(row, problem.core.parameter_entry(parameter))
        converged, steps, iterations, _, reason = newton.solve(y)
        assert converged, reason
        contact = {key: problem.diagnostics(y)[key] for key in ("slip", "open")}
        found.append({**problem.state(y), **contact, "steps": steps, "iterations": iterations})
    return found, newton.route


def assert_same(found, expected):
    for a, b in zip(found, expected):
        assert a["omega"] == pytest.approx(b["omega"], rel=SOLVED)
        assert a["beta"] == pytest.approx(b["beta"], abs=SOLVED * b["omega"])


def test_sparse_factors_take_few_iterations(comm):
    """3660 dofs, 25,620 unknowns: agrees with the direct route, and says its memory."""
    model, tip = solid(comm, LARGE)
    found, route = solve(mode(model, tip, "sparse_", blocks="sparse"), [STICK, SLIP])
    direct, other = solve(mode(model, tip, "direct_", route="direct"), [STICK, SLIP])
    assert re.match(r"krylov \(\d+ unknowns\), 4 sparse symmetric factors \(\d+ MB\)", route), route
    assert other == "direct (asked for)"
    assert found[0]["slip"] == 0 and found[1]["slip"] > 0.02
    assert found[0]["iterations"] <= 4 * found[0]["steps"]
    assert_same(found, direct)


@pytest.mark.parametrize("method", ["CNM", "EPMC"])
def test_unsymmetric_terms_take_general_factors(comm, method):
    model, tip = solid(comm, SMALL, turning=50.0)
    options = dict(method=method, highest=2)
    found, route = solve(mode(model, tip, "general_", route="krylov", blocks="sparse", **options), [STICK, SLIP])
    direct, _ = solve(mode(model, tip, "direct_", route="direct", **options), [STICK, SLIP])
    assert "sparse general factors" in route
    assert found[1]["slip"] > 0.02
    assert_same(found, direct)


def test_dense_and_sparse_blocks_find_the_same_mode(comm):
    """The blade of beams, whose 30 dofs take dense blocks unless told otherwise."""
    model = beam.blade(comm)
    case = (model, *beam.preloaded(model))
    found = {}
    for blocks in ("dense", "sparse"):
        with options(krylov_blocks=blocks):
            found[blocks], route = solve(beam.mode(*case, "krylov"), [1e-3, 2.2e-3])
        assert blocks in route
    assert found["dense"][1]["slip"] > 0.02
    assert_same(found["sparse"], found["dense"])


@pytest.mark.ranks(1)
def test_unknown_blocks_are_refused(comm):
    model, tip = solid(comm, SMALL)
    problem = mode(model, tip, "thick_", blocks="thick")
    with pytest.raises(fw.InputError, match="(?s)preconditioner.*thick"):
        fw._core.Newton(problem.core, "thick_")


def test_forced_response_has_no_normalisation(comm):
    """One scalar: the border is the closing row alone."""
    model, tip = solid(comm, SMALL)
    first = fw.linear_modes(model, 1, "stuck")[0]
    rest = balanced(model, first)
    force = np.zeros(model.n_dof)
    force[tip] = 2.0
    low, at, high = (share * first.omega for share in (0.8, 0.88, 0.881))
    found = {}
    for route in ("krylov", "direct"):
        PETSc.Options()[f"{route}_route"] = route
        problem = fw.ForcedResponse(model, fw.Harmonics(range(4), 64), {1: force}, 1.0, tip, first, f"{route}_")
        problem.preload(rest.displacement, rest.load)
        branch = fw.Continuation(problem, problem.initial(low), (0.9 * low, high), report_at=[at], upwards=True)
        found[route] = [{**problem.state(p.y), **problem.diagnostics(p.y)} for p in branch if p.event == "report"][0]
        assert branch.converged, branch.reason
    assert found["krylov"]["slip"] > 0.02
    for key in ("amplitude", "phase"):
        assert found["krylov"][key] == pytest.approx(found["direct"][key], rel=SOLVED)


def test_static_preload_of_a_solid_model_is_direct(comm):
    """Harmonic 0 alone: stuck pairs carry the load as springs do."""
    model, tip = solid(comm, LARGE)
    first = fw.linear_modes(model, 1, "stuck")[0]
    load = np.zeros(model.n_dof)
    load[tip] = 0.5
    rest = static_preload(model, load, first)
    assert rest.stick == 1
    _, K, _, B, _ = structure(LARGE)
    stuck = (
        K + B.T @ sp.diags(np.tile([STIFFNESS["normal_stiffness"], *2 * [STIFFNESS["tangential_stiffness"]]], 3)) @ B
    )
    assert rest.displacement == pytest.approx(spsolve(stuck.tocsc(), load), abs=1e-7 * np.abs(rest.displacement).max())
