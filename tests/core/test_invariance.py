"""The same branch in any units, on any number of ranks, and ever closer with more harmonics and samples."""

from __future__ import annotations

import numpy as np
import pytest
from models.core_models import TanhLaw, chain, friction, oscillator, whole
from mpi4py import MPI

import fretwave as fw

REPORTS = np.array([0.05, 0.1, 0.2, 0.5, 1.0])
SAME = 1e-9  #: relative, issue 2

#: length, mass and time measured in these units, i.e. numbers are multiplied by L, m, T
UNITS = {
    "mm-t-s": (1e3, 1e-3, 1.0),
    "forces and masses times 1e6": (1.0, 1e6, 1.0),
    "lengths times 1e6": (1e6, 1.0, 1.0),
    "microseconds": (1.0, 1.0, 1e6),
    "everything": (1e6, 1e6, 1e6),
    "nondimensional": (1 / 0.2, 1.0, np.sqrt(640.0)),
}


SERIAL = pytest.mark.ranks(1)


def scaled(two_dof, comm, L=1.0, m=1.0, T=1.0):
    """The paper's oscillator in other units: [M] = m, [K] = m / T^2, [R] = m L / T^2, [eps] = L / T."""
    contact = friction(two_dof.B, 5.0 * m * L / T**2, 0.05 * L / T)
    return fw.Model(two_dof.M * m, two_dof.K * m / T**2, None, [contact], comm)


def dimensionless(model, method="CNM", L=1.0, T=1.0, highest=21, samples=512, reports=REPORTS):
    """Rows (amplitude, omega, beta, zeta) in SI at the reported amplitudes, and (event, newton) of all points."""
    h = fw.Harmonics(range(1, highest + 1, 2), samples)
    problem = fw.NonlinearMode(model, h, method, 0, fw.linear_modes(model, 1, "stuck")[0])
    branch = fw.Continuation(problem, problem.initial(0.02 * L), (0.02 * L, 2.0 * L), report_at=list(reports * L))
    points = list(branch)
    assert branch.converged, branch.reason
    found = [problem.state(p.y) for p in points if p.event == "report"]
    rows = [(s["amplitude"] / L, s["omega"] * T, s["beta"] * T, s["zeta"]) for s in found]
    return np.array(rows), [(p.event, p.newton) for p in points]


def assert_same_iterations(found, expected):
    """A fold or peak is found to half the digits: whether the last guess is exact there, rounding decides."""
    assert [event for event, _ in found] == [event for event, _ in expected]
    for (event, newton), (_, newton_expected) in zip(found, expected):
        assert abs(newton - newton_expected) <= (event in ("fold", "peak_damping"))


@pytest.mark.parametrize("method", ["CNM", "EPMC"])
@pytest.mark.parametrize("units", [pytest.param(u, marks=[] if u == "everything" else SERIAL) for u in UNITS])
def test_same_branch_in_all_units(two_dof, comm, units, method):
    """The branch without dimensions to 1e-9, in the same Newton iterations."""
    L, m, T = UNITS[units]
    expected, newton = dimensionless(scaled(two_dof, comm), method)
    found, newton_found = dimensionless(scaled(two_dof, comm, L, m, T), method, L, T)
    assert np.allclose(found, expected, rtol=SAME, atol=0)
    assert_same_iterations(newton_found, newton)


@pytest.mark.ranks(2, 3)
@pytest.mark.parametrize("method", ["CNM", "EPMC"])
def test_same_branch_on_any_number_of_ranks(two_dof, comm, method):
    """Against the same run on one rank, inside this one."""
    serial, _ = dimensionless(oscillator(two_dof, MPI.COMM_SELF), method)
    parallel, _ = dimensionless(oscillator(two_dof, comm), method)
    assert np.allclose(parallel, serial, rtol=SAME, atol=0)


def chain_model(comm):
    """Five masses; three friction pairs, two of them between masses that other ranks may own."""
    B = np.zeros((3, 5))
    B[0, 0], B[1, [1, 2]], B[2, [4, 3]] = 1.0, (-1.0, 1.0), (1.0, -1.0)
    M, contact = np.diag([1.0, 1.2, 0.9, 1.1, 1.0]), friction(B, [1.0, 2.0, 0.5], 0.1)
    return fw.Model(M, chain(5, 100.0), None, [contact], comm)


def chain_problem(comm):
    model = chain_model(comm)
    return fw.NonlinearMode(model, fw.Harmonics([0, 1, 2, 3], 64), "CNM", 3, fw.linear_modes(model, 1, "free")[0])


@pytest.mark.ranks(2, 3)
def test_motion_contact_and_diagnostics_on_any_number_of_ranks(comm):
    """Gathered arrays are in the order of B's rows and of the dofs, whoever owns them."""
    found = {}
    for name, ranks in (("serial", MPI.COMM_SELF), ("parallel", comm)):
        problem = chain_problem(ranks)
        y = next(iter(fw.Continuation(problem, problem.initial(0.5), (0.1, 2.0)))).y
        arrays = [problem.coefficients(y), *problem.contact_period(y)[0].values()]
        found[name] = ranks.bcast(arrays), list(problem.diagnostics(y).values()), whole(y)
    for a, b in zip(found["serial"][0], found["parallel"][0]):
        assert a.shape == b.shape and np.allclose(a, b, rtol=0, atol=SAME * np.abs(a).max())
    assert found["parallel"][1] == pytest.approx(found["serial"][1], rel=1e-7)
    assert np.allclose(found["serial"][2], found["parallel"][2], rtol=0, atol=SAME)


@pytest.mark.ranks(1, 2, 3)
def test_coefficients_of_some_dofs_are_on_every_rank(comm):
    problem = chain_problem(comm)
    y = problem.initial(0.5)
    Q = comm.bcast(problem.coefficients(y))
    last = len(Q) - 1
    assert np.array_equal(problem.coefficients_at(y, [last, 0, 2]), Q[[last, 0, 2]])
    model, q = problem.model, Q[:, 1] - 1j * Q[:, 2]
    Mq = model.inertia(q.real) + 1j * model.inertia(q.imag)
    assert np.array_equal(model.local_inertia(model.distribute(q)), model.distribute(Mq))
    problem.destroy()


@pytest.mark.ranks(2, 3)
def test_branch_restored_on_other_numbers_of_ranks(comm):
    """A snapshot taken on one rank goes on here: the same branch to solver tolerance."""
    arguments = {"stop": (0.1, 2.0), "report_at": [0.4, 0.8, 1.6]}
    serial = chain_problem(MPI.COMM_SELF)
    branch = fw.Continuation(serial, serial.initial(0.1), **arguments)
    for point in branch:
        if point.index == 4:
            break
    snapshot = branch.snapshot()
    expected = [serial.state(p.y)["zeta"] for p in branch if p.event == "report"]
    here = chain_problem(comm)
    restored = fw.Continuation.restore(here, snapshot, **arguments)
    found = [here.state(p.y)["zeta"] for p in restored if p.event == "report"]
    assert len(found) == 3 and found == pytest.approx(expected, rel=SAME)


def peak_zeta(model, highest, samples=4096):
    h = fw.Harmonics(range(1, highest + 1, 2), samples)
    problem = fw.NonlinearMode(model, h, "CNM", 0, fw.linear_modes(model, 1, "stuck")[0])
    branch = fw.Continuation(problem, problem.initial(0.05), (0.05, 0.5))
    return max(problem.state(p.y)["zeta"] for p in branch if p.event == "peak_damping")


@SERIAL
def test_peak_damping_converges_with_the_harmonics(two_dof, comm):
    """One harmonic underestimates the peak by 40 %, H = 7 by 8 %."""
    model = oscillator(two_dof, comm)
    best = peak_zeta(model, 81)
    errors = [1 - peak_zeta(model, H) / best for H in (1, 7, 21, 61)]
    assert errors[:2] == pytest.approx([0.40, 0.08], abs=0.005)
    assert abs(errors[2]) < 1e-3 and abs(errors[3]) < 2e-4


@SERIAL
def test_branch_converges_with_the_samples(two_dof, comm):
    """The tanh law is analytic: sampled, as in Python, its distance from the law in continuous time falls faster than
    any power, so each doubling gains more than the last."""
    up_to = REPORTS[:3]
    best, _ = dimensionless(oscillator(two_dof, comm), samples=20, highest=9, reports=up_to)
    model = oscillator(two_dof, comm, law=TanhLaw(5.0, 0.05))
    found = [dimensionless(model, samples=N, highest=9, reports=up_to)[0] for N in (128, 256, 512, 1024)]
    errors = np.array([np.abs(rows / best - 1).max() for rows in found])
    gains = errors[:-1] / errors[1:]
    assert gains[0] > 4 and (np.diff(gains) > 0).all() and errors[-1] < 1e-6


@SERIAL
def test_force_outside_falls_with_the_harmonics(two_dof, comm):
    """On a slipping motion of the branch, as on an imposed one: more harmonics, less of the force outside."""
    model = oscillator(two_dof, comm)
    reference = fw.linear_modes(model, 1, "stuck")[0]
    estimates = []
    for H in (1, 3, 7, 21, 41):
        problem = fw.NonlinearMode(model, fw.Harmonics(range(1, H + 1, 2), 1024), "EPMC", 0, reference)
        branch = fw.Continuation(problem, problem.initial(0.05), (0.05, 0.3), report_at=[0.2])
        estimates.append([problem.diagnostics(p.y)["force_outside"] for p in branch if p.event == "report"][0])
    assert estimates == sorted(estimates, reverse=True) and estimates[-1] < estimates[0] / 4
