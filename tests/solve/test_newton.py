"""The corrector: what counts as converged, and how its linear systems fail and are solved."""

from __future__ import annotations

import numpy as np
import pytest
from models.core_models import CubicLaw, chain, options
from petsc4py import PETSc
from scipy.linalg import eigh
from test_krylov import TIP, blade, preloaded
from tolerances import REPEATED, SOLVED, TIGHT

import fretwave as fw
from fretwave.solve.preload import StaticPreload

M, K, LIMIT = 1.0, 1e6, 10.0  #: of the single mass [kg, N/m, N]


def jenkins(kt, amplitude):
    """Complex stiffness of a Jenkins element under one harmonic: its force over its motion."""
    if kt * amplitude <= LIMIT:
        return complex(kt, 0)
    y = LIMIT / (kt * amplitude)
    angle = 2 * np.arcsin(np.sqrt(y))  # of sticking; the difference below cancels where it is short
    area = angle - np.sin(2 * angle) / 2 if y > 1e-4 else 2 / 3 * angle**3 * (1 - angle**2 / 5)
    return complex(kt / np.pi * area, 4 * LIMIT / (np.pi * amplitude) * (1 - y))


def closed_form(method, friction):
    """(omega0, zeta) of the single mass with one harmonic and the complex stiffness of its friction."""
    k = K + friction
    if method == "EPMC":
        return np.sqrt(k.real / M), k.imag / (2 * k.real)
    return np.sqrt(abs(k) / M), np.sin(np.angle(k) / 2)


def slider(comm, kt):
    one = np.eye(1)
    contact = fw.Contact("jenkins", one, {"tangential_stiffness": kt, "friction_limit": LIMIT})
    return fw.Model(M * one, K * one, None, [contact], comm)


@pytest.mark.parametrize("method", ["CNM", "EPMC"])
@pytest.mark.parametrize("kt", [1e2, 1e4, 1e6, 1e8, 1e10, 1e12, 1e14])
def test_a_slider_of_any_stiffness_has_its_closed_form(comm, kt, method):
    """From stick to a thousand times the slip; at 1e14 N/m friction was lost beside the stuck stiffness' force."""
    model = slider(comm, kt)
    problem = fw.NonlinearMode(model, fw.Harmonics([1], 8), method, 0, fw.linear_modes(model, 1)[0])
    ends = (0.5 * LIMIT / kt, 1e3 * LIMIT / min(kt, K))
    branch = fw.Continuation(problem, problem.initial(ends[0]), ends)
    for point in branch:
        p = problem.state(point.y)
        omega, zeta = closed_form(method, jenkins(kt, p["amplitude"]))
        cancelled = 1e-16 * kt * p["amplitude"] / LIMIT  # of the slider's force where it sticks
        assert p["omega0"] == pytest.approx(omega, rel=REPEATED + cancelled)
        assert p["zeta"] == pytest.approx(zeta, rel=1e-6 + cancelled, abs=SOLVED)
        assert point.accepted or point.rounding > 1e-10
    assert branch.converged, branch.reason


@pytest.mark.ranks(1)
@pytest.mark.parametrize("kt", [1e8, 1e12, 1e14])
def test_stiff_kinks_between_masses_are_passed(comm, kt):
    """A slider between two of three: far beyond slip zeta is 4 R |dphi| / (2 pi w^2 a phi^T M phi) of the free mode."""
    springs, B = chain(3, 1e6), np.array([[-1.0, 1.0, 0.0]])
    contact = fw.Contact("jenkins", B, {"tangential_stiffness": kt, "friction_limit": LIMIT})
    model = fw.Model(np.eye(3), springs, None, [contact], comm)
    problem = fw.NonlinearMode(model, fw.Harmonics([1], 256), "CNM", 0, fw.linear_modes(model, 1)[0])
    branch = fw.Continuation(problem, problem.initial(1e-6), (1e-6, 1e-2))
    for point in branch:
        last = problem.state(point.y)
    assert branch.converged, branch.reason
    square, shape = 1e6 * (2 - np.sqrt(2)), np.array([1, np.sqrt(2), 1])
    loss = 4 * LIMIT * (shape[1] - shape[0]) / (2 * np.pi * square * 1e-2 * shape @ shape)
    assert last["amplitude"] == pytest.approx(1e-2)
    assert last["omega"] == pytest.approx(np.sqrt(square), rel=1e-5)
    assert last["zeta"] == pytest.approx(loss, rel=1e-3)


@pytest.mark.parametrize("method", ["CNM", "EPMC"])
def test_any_number_of_samples_gives_the_continuous_closed_form(comm, method):
    """At twice the amplitude of first slip."""
    kt = 1e6
    for samples in (4, 64, 256):
        model = slider(comm, kt)
        problem = fw.NonlinearMode(model, fw.Harmonics([1], samples), method, 0, fw.linear_modes(model, 1)[0])
        amplitude = 2 * LIMIT / kt
        point = next(iter(fw.Continuation(problem, problem.initial(amplitude), (amplitude / 2, 2 * amplitude))))
        omega, zeta = closed_form(method, jenkins(kt, amplitude))
        assert problem.state(point.y)["zeta"] == pytest.approx(zeta, rel=TIGHT)


@pytest.mark.parametrize("level", [1e-6, 1e-7])
@pytest.mark.parametrize(("mass", "kt"), [(1e-2, 1e3), (1e-2, 1e4), (1e-4, 1e3), (1e-4, 1e4)])
def test_a_resonance_beside_static_loads_is_solved_to_its_last_digits(comm, mass, kt, level):
    """Stuck pads under far more than the force: their rounding hid the rest, up to 4e-6 of the motion."""
    masses, B = np.array([mass, 1.0, 1.0, 1.0]), np.eye(4)[1:]
    springs = np.diag([1e2 * mass, 1.0, 1.0, 1.0])
    springs[0, 1:] = springs[1:, 0] = -10 * mass
    pad = {"normal_stiffness": kt, "tangential_stiffness": kt, "friction_coefficient": 0.5, "normal_load": 1.0}
    contact = fw.Contact("coulomb_3d", B, {**pad, "gap": 0.0})
    model = fw.Model(np.diag(masses), springs, 1e-3 * springs, [contact], comm)
    force, mode = np.array([0.0, 0.0, 0.0, 1.0]), fw.linear_modes(model, 1)[0]
    problem = fw.ForcedResponse(model, fw.Harmonics(range(4), 16), {1: force}, level, 3, mode)
    for point in fw.Continuation(problem, problem.initial(8.0), (8.0, 12.0)):
        w = point.parameter
        dynamic = springs + kt * B.T @ B + 1e-3j * w * springs - w * w * np.diag(masses)
        exact = level * np.linalg.solve(dynamic, force)
        q = problem.coefficients_at(point.y, range(4))
        assert abs(q[:, 1] - 1j * q[:, 2] - exact).max() < REPEATED * abs(exact).max()


def counts(comm, case, **given):
    """Points, Newton steps and linear iterations of a branch on the Krylov route. Collective."""
    model, first, rest = case
    database = PETSc.Options("loose_")
    for name, value in {"route": "krylov", **given}.items():
        database.setValue(name, value)
    problem = fw.NonlinearMode(model, fw.Harmonics(range(8), 128), "CNM", TIP, first, "loose_")
    problem.preload(rest.displacement, rest.load)
    branch = fw.Continuation(problem, problem.initial(1e-3), (1e-3, 6e-3), fw.StepControl(max_points=50))
    found = np.array([(1, p.newton, p.linear) for p in branch]).sum(axis=0)
    for name in given:
        database.delValue(name)
    assert branch.converged, branch.reason
    return found


def test_how_roughly_newton_steps_are_solved_for_does_not_shape_the_branch(comm):
    """A tangent is solved to its own tolerance, and steps are measured as exact ones: it was 12 to 4,247 points."""
    model = blade(comm)
    case = (model, *preloaded(model))
    usual = counts(comm, case)
    for given in ({"ksp_rtol": 1e-3}, {"ksp_rtol": 1e-2}, {"snes_ksp_ew": None}):
        found = counts(comm, case, **given)
        assert abs(found[0] - usual[0]) < 0.2 * usual[0], f"{given}: {found} against {usual}"
        assert found[2] < 1.5 * usual[2], f"{given}: {found} against {usual}"


@pytest.mark.ranks(1)
def test_tangents_end_at_the_rounding_of_the_residual(comm, tmp_path):
    """Stiff elements round it to 1e-6, here; solved for below that, a tangent took up to a hundred iterations."""
    masses, reasons = 100, tmp_path / "reasons"
    springs = chain(masses, 1e12, 1e3) - np.diag([1e12, *np.zeros(masses - 2), 1e12])
    contact = fw.Contact("jenkins", np.eye(1, masses), {"tangential_stiffness": 1e4, "friction_limit": LIMIT})
    model = fw.Model(np.eye(masses), springs, None, [contact], comm)
    database = PETSc.Options("rounded_")
    given = {"route": "krylov", "tangent_ksp_converged_reason": f":{reasons}::append"}
    for name, value in given.items():
        database.setValue(name, value)
    problem = fw.NonlinearMode(
        model, fw.Harmonics([1, 3, 5, 7], 64), "CNM", 0, fw.linear_modes(model, 1)[0], "rounded_"
    )
    branch = fw.Continuation(problem, problem.initial(1e-5), (1e-5, 1e-3))
    residuals = [p.residual for p in branch]
    for name in given:
        database.delValue(name)
    assert branch.converged and 1e-7 < max(residuals) < 1e-5
    branch.destroy()
    lines = reasons.read_text().splitlines()
    assert len(lines) > 10 and all("CONVERGED_ATOL" in line for line in lines)


def newton_at(problem, amplitude, prefix):
    """The corrector at a fixed amplitude, its row, and the starting mode."""
    newton, row = fw._core.Newton(problem.core, prefix), problem.core.unknowns()
    row.set(0)
    row.setValue(row.getSize() - 1, 1.0)
    row.assemble()
    newton.system.close(row, np.log(amplitude))
    return newton, row, problem.initial(amplitude)


@pytest.mark.ranks(1)
def test_a_guess_that_gmres_finds_nothing_to_do_at_is_a_solution(comm):
    """Every guess while all sticks has the residual of the first point, 8e-14, which is a hundred roundings or not.

    Where it was not, a branch took 340 points.
    """
    masses, springs = np.diag([0.1139, 0.2528]), np.array([[9.240, 0.872], [0.872, 7.512]])
    squares, shapes = eigh(springs, masses)
    damping = masses @ shapes @ np.diag(2 * 0.002 * np.sqrt(squares)) @ shapes.T @ masses
    pad = {"normal_stiffness": 1.574e5, "tangential_stiffness": 1.643e4}
    contact = fw.Contact("coulomb_3d", np.eye(3, 2), {**pad, "friction_coefficient": 0.3868, "normal_load": 0.02161})
    model = fw.Model(masses, springs, damping, [contact], comm)
    first = fw.linear_modes(model, 1)[0]
    rest, count = fw.balanced(model, first), {}
    for route in ("direct", "krylov"):
        PETSc.Options("sticks_")["route"] = route
        problem = fw.NonlinearMode(model, fw.Harmonics(range(8), 128), "CNM", 1, first, "sticks_")
        problem.preload(rest.displacement, rest.load)
        branch = fw.Continuation(problem, problem.initial(1.8e-9), (1.8e-9, 5e-7), fw.StepControl(maximum=0.0859))
        with options(fw_newton_near=10):
            count[route] = len(list(branch))
        assert branch.converged
    assert count["krylov"] == count["direct"]


@pytest.mark.parametrize("size", [3, 700], ids=["dense", "sparse"])
def test_a_singular_jacobian_is_a_failed_step_and_no_more(comm, size):
    """LAPACK, KLU and MUMPS each tell it in their own way; the next solve starts from clean factors."""
    springs = 2 * np.eye(size) - np.eye(size, k=1) - np.eye(size, k=-1)
    contact = fw.Contact("jenkins", np.eye(1, size), {"tangential_stiffness": 1.0, "friction_limit": 1.0})
    model = fw.Model(np.eye(size), springs + np.eye(size), None, [contact], comm)
    problem = fw.NonlinearMode(model, fw.Harmonics([1], 16), "EPMC", 0, fw.linear_modes(model, 1)[0], "singular_")
    PETSc.Options("singular_")["route"] = "direct"
    newton, row, y = newton_at(problem, 0.1, "singular_")
    none = row.duplicate()
    none.set(0)
    for _ in range(3):
        newton.system.close(none, 1.0)
        converged, *_, reason = newton.solve(y.copy())
        assert not converged and "singular" in reason
        assert not newton.linear(y, row, none.duplicate())
        newton.system.close(row, np.log(0.1))
        trial = y.copy()
        converged, *_, reason = newton.solve(trial)
        assert converged, reason


@pytest.mark.parametrize("rung, iterations, beside", [("condensed", 3, 1e-9), ("whole", 1, 1e-9), ("whole", 3, 1e9)])
def test_a_linear_solve_that_fails_is_solved_in_a_dearer_way(comm, rung, iterations, beside):
    """GMRES is cut short, so that the dense blocks, then the condensed system too, are not enough.

    The whole system comes first where its factor is not much larger than the condensed one.
    """
    model = blade(comm)
    case = (model, *preloaded(model))
    _, first, rest = case
    found = {}
    for prefix, limit in (("usual_", 200), ("cut_", iterations)):
        database = PETSc.Options(prefix)
        database["route"], database["ksp_max_it"] = "krylov", limit
        problem = fw.NonlinearMode(model, fw.Harmonics(range(6), 128), "CNM", TIP, first, prefix)
        problem.preload(rest.displacement, rest.load)
        branch = fw.Continuation(problem, problem.initial(2e-3), (2e-3, 3e-3), report_at=[2.5e-3])
        with options(fw_linear_whole=beside):
            points = [(problem.state(p.y), p.event) for p in branch]
        assert branch.converged, branch.reason
        found[prefix] = next(state for state, event in points if event == "report"), branch.fallbacks
    assert not any(found["usual_"][1][key] for key in ("rebuilt", "condensed", "whole"))
    assert found["cut_"][1]["rebuilt"] and found["cut_"][1][rung] and "factorised" in found["cut_"][1]["said"]
    assert bool(found["cut_"][1]["condensed"]) == (beside < 1)
    for key in ("omega", "zeta"):
        assert found["cut_"][0][key] == pytest.approx(found["usual_"][0][key], rel=REPEATED)


def test_a_motion_that_does_not_oscillate_has_no_frequency(comm):
    """A mass with zeta = 1.5 by its damper, and -1.5: EPMC's omega is 0 there, never nan; omega0 and beta stay."""
    one = np.eye(1)
    for damping in (1.5, -1.5, 0.5):
        contact = fw.Contact("jenkins", one, {"tangential_stiffness": 1e-9, "friction_limit": 1.0})
        model = fw.Model(one, one, 2 * damping * one, [contact], comm)
        problem = fw.NonlinearMode(model, fw.Harmonics([1], 16), "EPMC", 0, fw.linear_modes(model, 1)[0])
        branch = fw.Continuation(problem, problem.initial(0.1), (0.1, 0.2))
        states = [problem.state(p.y) for p in branch]
        assert branch.converged, branch.reason
        for state in states:
            assert state["zeta"] == pytest.approx(damping) and state["omega0"] == pytest.approx(1)
            assert state["omega"] == pytest.approx(np.sqrt(max(0, 1 - damping**2)))


def test_a_route_that_cannot_be_taken_is_said(comm):
    """A static problem has no preconditioner; it was an error without being asked for."""
    model = slider(comm, 1.0)
    problem = StaticPreload(model, np.ones(1), fw.linear_modes(model, 1)[0], prefix="asked_")
    PETSc.Options("asked_")["route"] = "krylov"
    route = fw._core.Newton(problem.core, "asked_").route
    assert route == "direct (krylov asked for, but this problem has no preconditioner)"
    PETSc.Options("asked_")["blocks"] = "sparse"
    with pytest.raises(fw.InputError, match="sparse blocks"):
        fw._core.Newton(problem.core, "asked_")


class BrokenLaw(CubicLaw):
    """A cubic spring whose force is not a number beyond an elongation of 1."""

    def force(self, u, v):
        return np.where(np.abs(u) > 1, np.nan, super().force(u, v))


def test_a_force_that_is_not_a_number_is_a_failed_step(comm):
    one = np.eye(1)
    model = fw.Model(one, one, None, [fw.Contact(BrokenLaw(), one)], comm)
    problem = fw.NonlinearMode(model, fw.Harmonics([1, 3], 64), "EPMC", 0, fw.linear_modes(model, 1, "free")[0])
    branch = fw.Continuation(problem, problem.initial(0.1), (0.1, 2.0))
    amplitudes = [problem.state(p.y)["amplitude"] for p in branch]
    assert not branch.converged and "step too small" in branch.reason
    assert 0.9 < max(amplitudes) < 1.2
