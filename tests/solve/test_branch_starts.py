"""How a branch begins where Newton alone does not: more excitation, closing gaps, exact derivatives on the way."""

from __future__ import annotations

import itertools
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.linalg
from models.core_models import friction, mode_problem, options, single_dof, whole
from models.followed import follow, response, stop
from petsc4py import PETSc
from tolerances import REPEATED, ROUNDING, SOLVED, TIGHT

import fretwave as fw
from fretwave import _core
from fretwave.solve import afar
from fretwave.solve.afar import STALLED, last_of
from fretwave.solve.starting import Way, mode_start, starts

# Den Hartog's oscillator with a limit of 0.3: most frequencies start in a motion that Newton does not find from zero.
SLIDERS = [("jenkins", 1e2), ("jenkins", 1e3), ("jenkins", 1e4), ("regularised_coulomb", 1e-3)]


@pytest.mark.ranks(1)
@pytest.mark.parametrize("omega", [0.3, 0.5, 0.7, 0.8])
@pytest.mark.parametrize("law, stiffness", SLIDERS)
def test_a_textbook_response_starts(comm, law, stiffness, omega):
    keys = {"jenkins": "tangential_stiffness", "regularised_coulomb": "regularisation_velocity"}
    model = single_dof(comm, law=fw.Contact(law, [[1.0]], {"friction_limit": 0.3, keys[law]: stiffness}))
    problem, branch = response(model, 1.0, (omega, 1.001 * omega), (1, 3, 5, 7), 256)
    first = next(iter(branch))
    assert problem.state(first.y)["amplitude"] > 0.9  # it slides: 1 / (1 - omega^2) less what friction takes
    assert first.residual < TIGHT


def test_raising_the_excitation_leads_to_the_response(comm):
    """The way's end solves the equations of the response, in slip, and is the point that Newton finds from there."""
    model = single_dof(comm, law=friction([[1.0]], 0.3, 1e-3))
    problem, branch = response(model, 1.0, (0.7, 0.71), (1, 3, 5, 7), 256)
    reasons: list[str] = []
    ((how, y),) = starts(fw.Continuation, problem, problem.initial(0.7), reasons)
    assert how.startswith("by raising the excitation from zero in ") and reasons == []
    assert np.linalg.norm(whole(problem.residual(y))) < SOLVED
    first = next(iter(branch))
    assert problem.state(first.y)["amplitude"] == pytest.approx(problem.state(y)["amplitude"], rel=REPEATED)


@pytest.mark.ranks(1)
def test_a_solution_that_is_given_is_where_a_branch_begins(comm):
    """However far from the linear mode: looked for from small amplitudes it was another one's, or found at a cost."""
    slider = fw.Contact("jenkins", [[1.0]], {"tangential_stiffness": 1.0, "friction_limit": 0.3})
    problem = mode_problem(single_dof(comm, law=slider), [1, 3, 5], 128, start="stuck")
    *_, last = fw.Continuation(problem, problem.initial(0.1), (0.1, 3.0))
    branch = fw.Continuation(problem, last.y, (0.5, 4.0), upwards=True)
    first = next(iter(branch))
    assert abs(problem.state(last.y)["omega0"] / problem.start.omega - 1) > 0.1
    assert branch.started == ""
    assert problem.state(first.y)["zeta"] == pytest.approx(problem.state(last.y)["zeta"], rel=REPEATED)


@pytest.mark.ranks(1)
def test_a_response_at_a_stiff_stop_starts_by_closing_its_gap(comm):
    """Its equations are the same at every level: raising the excitation leads nowhere."""
    problem, branch = response(stop(comm, 1e4), 1.0, (0.9, 0.91), range(8), 128)
    first = next(iter(branch))
    assert branch.started.startswith("by closing the gaps from where nothing touches in ")
    assert np.linalg.norm(whole(problem.residual(first.y))) < REPEATED


@pytest.mark.ranks(1)
def test_a_mode_at_a_stiff_stop_is_the_bilinear_oscillator(comm):
    """Half a period on each spring, w = 2 / (1 + 1/sqrt(1 + kn)), at every amplitude; 5e-3 for harmonics left out."""
    model = fw.Model(np.eye(1), np.eye(1), None, stop(comm, 100.0).contacts, comm)
    problem = mode_problem(model, range(16), 512, "EPMC", start="free")
    branch, points = follow(problem, 0.1, 0.2)
    assert branch.converged and branch.started.startswith("by closing the gaps")
    found = [problem.state(p.y)["omega0"] for p in points]
    assert np.allclose(found, 2 / (1 + 1 / np.sqrt(101.0)), rtol=5e-3, atol=0)


def ways(comm):
    """Problems on the way to a response and to a mode whose stop is in touch."""
    problem, _ = response(stop(comm, 3.0), 1.0, (0.9, 0.91), range(4), 64)
    yield Way(problem, _core.ForcedStart(problem.core, problem.initial(0.9), True)), problem
    yield Way(problem, _core.ForcedStart(problem.core, problem.initial(0.9), False)), problem
    mode = mode_problem(stop(comm, 3.0), range(4), 64, "EPMC", start="free")
    yield Way(mode, mode_start(mode, mode.initial(0.7))), mode


@pytest.mark.ranks(1)
def test_ways_to_a_start_have_exact_derivatives(comm):
    for way, problem in ways(comm):
        y = way.core.initial()
        values, rng = y.getArray().copy(), np.random.default_rng(3)
        values[: 2 * 4 - 1] = 0.4 * rng.standard_normal(7)
        values[-1] = 0.1

        def residual(x, way=way, y=y):
            at = y.copy()
            at.setArray(x)
            return whole(way.residual(at)).copy()

        step = rng.standard_normal(len(values))
        there, direction = y.copy(), y.copy()
        there.setArray(values), direction.setArray(step)
        exact = whole(way.jacobian_product(there, direction))
        assembled = way.jacobian(there).convert("dense").getDenseArray() @ step
        differences = (residual(values + 1e-7 * step) - residual(values - 1e-7 * step)) / 2e-7
        assert np.allclose(exact, differences, rtol=0, atol=1e-5 * abs(exact).max())
        assert np.allclose(exact, assembled, rtol=0, atol=ROUNDING * abs(exact).max())
        # the law they share stands where it stood once the problem itself is evaluated
        problem.residual(y)


class Tangle:
    """A branch that goes up to 0.2 and runs about there for ever."""

    converged, reason = False, "under way"

    def __iter__(self):
        for k in itertools.count():
            unknowns = PETSc.Vec().createSeq(1, comm=PETSc.COMM_SELF)
            parameter = min(0.001 * k, 0.15 + 0.05 * np.sin(k))
            yield SimpleNamespace(y=unknowns, tangent=unknowns.duplicate(), parameter=parameter)


@pytest.mark.ranks(1)
def test_a_way_that_comes_no_nearer_to_its_end_is_given_up():
    """Regularised friction of many samples: a way ran about at 5 % of its range for its 20,000 points."""
    last, count, reason = last_of(Tangle(), goal=1.0)
    assert last is not None and STALLED < count < 1000
    assert reason == f"it comes no nearer in {STALLED} points"


@pytest.mark.parametrize("stop_stiffness", [0.0, 0.2], ids=["linear", "cubic"])
def test_a_light_damper_is_no_support(comm, stop_stiffness):
    """Regularised friction halfway up a chain: stuck modes are none of it, at any amplitude; no first point was found.

    At small ones friction is viscous, R / eps: there the mode is the lowest damped one.
    """
    n, at, limit, eps = 40, 20, 0.8, 0.1
    random = np.random.default_rng(2)
    k, masses = 1600 * random.uniform(0.8, 1.2, n), random.uniform(0.8, 1.2, n)
    M, K = np.diag(masses), np.diag(k + np.r_[k[1:], 0]) - np.diag(k[1:], 1) - np.diag(k[1:], -1)
    damper = friction(np.eye(n)[at : at + 1], limit, eps)
    tip = fw.Contact("cubic_spring", np.eye(n)[-1:], {"cubic_stiffness": stop_stiffness}, "tip")
    model = fw.Model(M, K, 2e-4 * K, [damper, tip], comm)
    mode = fw.NonlinearMode(model, fw.choose_harmonics(model, 5, 128), dof=n - 1, start=fw.linear_modes(model, 1)[0])
    branch = fw.follow(mode, 0.3, (1e-3, 0.5), errors=False)
    C = 2e-4 * K + np.diag(limit / eps * (np.arange(n) == at))
    roots = np.linalg.eigvals(np.vstack([np.eye(n, 2 * n, k=n), -np.linalg.solve(M, np.hstack([K, C]))]))
    lowest = min(roots[roots.imag > 0], key=abs)
    assert branch.converged and "without contact" in branch.started
    assert branch["omega"][-1] == pytest.approx(lowest.imag, rel=1e-4)
    assert branch["beta"][-1] == pytest.approx(-lowest.real, rel=1e-3)


@pytest.mark.ranks(1)
@pytest.mark.parametrize("unit", [1.0, 1e-3], ids=["metres", "every-second-dof-in-mm"])
@pytest.mark.parametrize(("number", "alike"), [(4, False), (7, True), (10, True)], ids=["4th", "7th", "10th"])
def test_the_mode_without_contact_is_alike_or_none(comm, unit, number, alike):
    """In inertia, whatever units dofs have: the tenth stuck mode of a chain was followed to the first free one."""
    n, random = 24, np.random.default_rng(3)
    k, masses = 1600 * random.uniform(0.3, 3, n), random.uniform(0.3, 3, n)
    M, K = np.diag(masses), np.diag(k + np.r_[k[1:], 0]) - np.diag(k[1:], 1) - np.diag(k[1:], -1)
    T = np.diag(np.where(np.arange(n) % 2, 1.0, unit))
    model = fw.Model(T @ M @ T, T @ K @ T, contacts=[friction(np.eye(n)[[5, 14]] @ T, 1.0, 1e-3)], comm=comm)
    start = fw.linear_modes(model, number)[-1]
    dof = int(np.argmax(np.abs(start.shape)))
    free = afar._without_contact(fw.NonlinearMode(model, fw.Harmonics([1], 16), dof=dof, start=start))
    squares, shapes = scipy.linalg.eigh(K, M)
    shares = np.abs(shapes.T @ M @ T @ start.shape)
    assert (free is not None) == alike == (shares.max() > 0.65)  # 0.60, 0.74, 0.99
    if free is not None:
        assert free.start.omega == pytest.approx(np.sqrt(squares[np.argmax(shares)]), rel=SOLVED)


def test_a_wave_beside_which_another_is_avoided_does_not_start_without_contact(comm):
    """The unknowns of its unfolding are not in a guess of one mode: PETSc ended the run."""
    n, phases = 12, 2 * np.pi * 2 * np.arange(12) / 12
    K = 90 * np.eye(n) - 20 * (np.eye(n, k=1) + np.eye(n, k=-1) + np.eye(n, k=n - 1) + np.eye(n, k=1 - n))
    model = fw.Model(np.eye(n), K, 1e-4 * K, [friction(np.eye(n), 0.8, 0.1)], comm)
    cosine, sine = np.cos(phases) / np.sqrt(n), np.sin(phases) / np.sqrt(n)
    wave = fw.LinearMode(np.sqrt(90 - 40 * np.cos(2 * np.pi / 6)), 0.0, cosine, sine)
    with options(wave_snes_max_it=0):
        harmonics = fw.choose_harmonics(model, 3, 64)
        mode = fw.NonlinearMode(model, harmonics, dof=0, start=wave, prefix="wave_", avoid=cosine - 1j * sine)
        branch = fw.follow(mode, 0.3, (0.2, 0.5), errors=False)
    assert not branch.converged and branch.reason.startswith("no solution at the start")
