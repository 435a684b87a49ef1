"""Retained harmonics and the alternating frequency-time step, against Fourier series written out by hand."""

from __future__ import annotations

import numpy as np
import pytest
from models.core_models import (
    CoupledLaw,
    CubicLaw,
    LinearLaw,
    TanhLaw,
    chain,
    everywhere,
    friction,
    oscillator,
    unknowns,
    whole,
)
from tolerances import LAST_BIT, LAST_DIGITS

import fretwave as fw

W_REF = 1.3  #: angular frequency of the starting mode
BETA, OMEGA, AMPLITUDE = 0.05, 1.1, 0.7  #: scalars of the problems, the first two in units


class LinearCoupledLaw(CoupledLaw):
    """f = G u."""

    c = 0.0


def mode(model, harmonics, method="CNM"):
    """A mode whose motion is 1 on every dof at first."""
    linear = fw.LinearMode(W_REF, 0.0, np.ones(model.n_dof), np.zeros(model.n_dof))
    return fw.NonlinearMode(model, harmonics, method, 0, linear)


def random_motion(problem, seed=0):
    """The same random unknowns on every number of ranks."""
    q = np.random.default_rng(seed).standard_normal(problem.model.n_dof * problem.harmonics.block_size)
    return unknowns(problem, np.concatenate([q, [BETA, OMEGA, np.log(AMPLITUDE)]]))


def test_labels_and_block_follow_the_retained_orders():
    """[Q0, Qc1, Qs1, ...] restricted to the retained set."""
    h = fw.Harmonics([0, 1, 3], 16)
    assert (h.orders, h.samples, h.block_size) == ((0, 1, 3), 16, 5)
    assert h.labels == ["0", "1c", "1s", "3c", "3s"]


@pytest.mark.parametrize(
    "orders, samples",
    [([], 16), ([0, 2], 16), ([1, 1], 16), ([3, 1], 16), ([-1, 1], 16), ([1, 3], 6), ([1], 7), ([1], -8)],
)
def test_unusable_harmonics_are_refused(orders, samples):
    with pytest.raises(fw.InputError, match="harmonics|samples"):
        fw.Harmonics(orders, samples)


def test_choice_of_harmonics_leaves_out_what_an_odd_law_does_not_need(two_dof, comm):
    """Odd harmonics only when the law is odd, said in words, and forced on by `all`."""
    model = oscillator(two_dof, comm)
    auto, everything = fw.choose_harmonics(model, 5), fw.choose_harmonics(model, 5, retain="all")
    assert auto.orders == (1, 3, 5) and "even" in auto.left_out[0]
    assert everything.orders == (0, 1, 2, 3, 4, 5) and everything.left_out == []
    assert fw.choose_harmonics(model, 5, retain="odd").orders == auto.orders


def test_law_that_is_not_odd_keeps_all_harmonics(two_dof, comm):
    law = TanhLaw(5.0, 0.05)
    law.odd = False
    assert fw.choose_harmonics(oscillator(two_dof, comm, law=law), 3).orders == (0, 1, 2, 3)


@pytest.mark.parametrize("arguments", [{"highest": 0}, {"highest": 3, "retain": "evn"}, {"highest": 3, "samples": 6}])
def test_unusable_choices_are_refused(two_dof, comm, arguments):
    with pytest.raises(fw.InputError):
        fw.choose_harmonics(oscillator(two_dof, comm), **arguments)


def test_period_samples_are_the_fourier_series(comm):
    """x = sum Re q_n e^{i n tau}, v = sum Re s_n q_n e^{i n tau}, q_n = Qc - i Qs."""
    model = fw.Model(np.eye(2), chain(2), None, [fw.Contact(LinearLaw(1.0, 0.0), np.eye(2))], comm)
    problem = mode(model, fw.Harmonics([0, 1, 2], 8))
    y = random_motion(problem)
    Q, period = everywhere(problem, (problem.coefficients(y), problem.contact_period(y)))
    tau, lambda_ = 2 * np.pi * np.arange(8) / 8, W_REF * (-BETA + 1j * OMEGA)
    waves = [np.exp(1j * n * tau)[:, None] * (Q[:, 2 * n - 1] - 1j * Q[:, 2 * n]) for n in (1, 2)]
    x = Q[:, 0] + sum(wave.real for wave in waves)
    v = sum((n * lambda_ * wave).real for n, wave in zip((1, 2), waves))
    assert np.allclose(period[0]["u"][:, 0], x, rtol=0, atol=LAST_DIGITS)
    assert np.allclose(period[0]["v"][:, 0], v, rtol=0, atol=LAST_DIGITS)
    dofs = everywhere(problem, problem.dof_period(y, 8))
    assert np.allclose(dofs["x"], x, rtol=0, atol=LAST_DIGITS) and np.allclose(dofs["v"], v, rtol=0, atol=LAST_DIGITS)


@pytest.mark.ranks(1, 2, 3)
@pytest.mark.parametrize("method", ["CNM", "EPMC"])
def test_linear_law_gives_exactly_its_stiffness_and_damping(comm, method):
    """f = k u + c v transforms to k Q + c s Q: the same residual as in K + B^T k B, C + B^T c B."""
    k, c = 2.0, 0.3
    B = np.random.default_rng(3).standard_normal((3, 4))
    h = fw.Harmonics([0, 1, 2, 3], 16)
    law = fw.Model(np.eye(4), chain(4), None, [fw.Contact(LinearLaw(k, c), B)], comm)
    matrices = fw.Model(np.eye(4), chain(4) + k * B.T @ B, c * B.T @ B, comm=comm)
    residuals = [whole(p.residual(random_motion(p))) for p in (mode(law, h, method), mode(matrices, h, method))]
    assert np.allclose(*residuals, rtol=0, atol=1e-13 * np.abs(residuals[1]).max())


@pytest.mark.ranks(1, 2, 3)
@pytest.mark.parametrize("pairs", [1, 2])
def test_linear_law_of_three_components_gives_its_full_stiffness(comm, pairs):
    """As above with f = G u, G full: components and pairs must not be interchanged anywhere."""
    B = np.random.default_rng(4).standard_normal((3 * pairs, 4))
    G = np.kron(np.eye(pairs), LinearCoupledLaw.G)
    h = fw.Harmonics([0, 1, 2], 8)
    law = fw.Model(np.eye(4), chain(4), None, [fw.Contact(LinearCoupledLaw(), B)], comm)
    matrices = fw.Model(np.eye(4), chain(4) + B.T @ G @ B, comm=comm)
    residuals = [whole(p.residual(random_motion(p))) for p in (mode(law, h), mode(matrices, h))]
    assert np.allclose(*residuals, rtol=0, atol=1e-13 * np.abs(residuals[1]).max())


def cubic_diagnostics(comm, orders, samples):
    model = fw.Model([[1.0]], [[1.0]], None, [fw.Contact(CubicLaw(), [[1.0]])], comm)
    problem = mode(model, fw.Harmonics(orders, samples))
    return problem.diagnostics(problem.initial(AMPLITUDE))


def test_force_outside_is_the_share_outside_by_parseval(comm):
    """cos^3 = 3/4 cos + 1/4 cos 3: a share of (1/4) / sqrt(9/16 + 1/16) = 1/sqrt(10) falls outside one harmonic."""
    assert cubic_diagnostics(comm, [1], 16)["force_outside"] == pytest.approx(1 / np.sqrt(10), rel=LAST_DIGITS)
    assert cubic_diagnostics(comm, [1, 3], 16)["force_outside"] < LAST_BIT


@pytest.mark.parametrize("highest", [1, 3, 7, 21])
def test_force_outside_of_coulomb_friction_is_that_of_a_square_wave(comm, highest):
    """As eps -> 0 the force is a square wave: outside H lies 1 - (8/pi^2) sum 1/n^2 of its energy, n odd up to H."""
    model = fw.Model([[1.0]], [[1.0]], None, [friction([[1.0]], 1.0, 1e-9)], comm)
    problem = mode(model, fw.Harmonics(range(1, highest + 1, 2), 8192))
    inside = 8 / np.pi**2 * sum(1 / n**2 for n in range(1, highest + 1, 2))
    found = problem.diagnostics(problem.initial(1.0))["force_outside"]
    assert found**2 == pytest.approx(1 - inside, abs=4 / 8192)  # two samples of a period lie on the jumps


def test_aliasing_is_what_doubled_samples_change(comm):
    """On 4 samples cos 3 is seen as cos: the coefficient is 1, and 3/4 on 8 samples."""
    assert cubic_diagnostics(comm, [1], 4)["aliasing"] == pytest.approx(0.25, rel=LAST_DIGITS)
    assert cubic_diagnostics(comm, [1], 8)["aliasing"] < LAST_BIT


def test_half_a_period_gives_the_residual_and_jacobian_of_the_whole(two_dof, comm):
    """Odd law and odd harmonics: f(t + T/2) = -f(t), only half of the samples are evaluated."""
    problems = []
    for odd in (True, False):
        law = TanhLaw(5.0, 0.5)
        law.odd = odd
        problems.append(mode(oscillator(two_dof, comm, law=law), fw.Harmonics([1, 3, 5], 64)))
    y, dy = (random_motion(problems[0], seed) for seed in (1, 2))
    residuals = [whole(p.residual(y)) for p in problems]
    products = [whole(p.jacobian_product(y, dy)) for p in problems]
    for half, full in (residuals, products):
        assert np.allclose(half, full, rtol=0, atol=LAST_DIGITS * np.abs(full).max())


@pytest.mark.parametrize("method", ["CNM", "EPMC"])
def test_everything_forced_on_changes_nothing(two_dof, comm, method):
    """Even harmonics and the mean come out zero, all else the same to rounding."""
    model = oscillator(two_dof, comm)
    linear = fw.linear_modes(model, 1)[0]
    found = []
    for retain in ("auto", "all"):
        problem = fw.NonlinearMode(model, fw.choose_harmonics(model, 7, 256, retain), method, 0, linear)
        branch = fw.Continuation(problem, problem.initial(0.1), (0.02, 1.0), report_at=[0.2, 0.6])
        points = [p for p in branch if p.event == "report"]
        found.append([(problem.state(p.y), everywhere(problem, problem.coefficients(p.y))) for p in points])
    odd = [label in ("1c", "1s", "3c", "3s", "5c", "5s", "7c", "7s") for label in problem.harmonics.labels]
    for (small, Q), (large, Q_all) in zip(*found):
        assert [large[k] for k in ("omega", "zeta")] == pytest.approx([small[k] for k in ("omega", "zeta")], rel=1e-11)
        assert np.allclose(Q_all[:, odd], Q, rtol=0, atol=1e-11 * small["amplitude"])
        assert np.abs(Q_all[:, ~np.array(odd)]).max() < 1e-13 * small["amplitude"]
