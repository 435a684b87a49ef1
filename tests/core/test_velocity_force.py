"""Friction that follows the velocity, in continuous time: exact harmonics however thin its layer is, at any N_t."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from models.core_models import derivative, friction, unknowns, whole
from mpi4py import MPI
from scipy.integrate import quad
from tolerances import LAST_BIT, LAST_DIGITS, ROUNDING

import fretwave as fw

#: What differences err by where a higher derivative is large
DIFFERENCES = 1e-7
EPS = [10.0, 1.0, 0.3, 0.05, 1e-2, 1e-4, 1e-6, 1e-8, 1e-12]
LIMIT = 2.0


class Forces:
    """F(Q) and dF/dQ of a pair on a unit mass, at a frequency and a decay."""

    def __init__(self, eps: float, orders, samples: int = 0, method: str = "EPMC", beta: float = 0.0) -> None:
        self.orders, self.method, self.beta = list(orders), method, beta
        model = fw.Model([[1.0]], [[1.0]], None, [friction([[1.0]], LIMIT, eps)], MPI.COMM_WORLD)
        start = fw.LinearMode(1.0, 0.0, np.ones(1), np.zeros(1))
        harmonics = fw.Harmonics(self.orders, samples or 2 * self.orders[-1] + 2)
        self.problem = fw.NonlinearMode(model, harmonics, method, 0, start)
        self.n = sum(1 if k == 0 else 2 for k in self.orders)

    def at(self, q):
        return unknowns(self.problem, np.concatenate([q, [self.beta, 1.0, 0.0]]))

    def linear(self, q):
        """What is left without friction: R is linear in F."""
        model = fw.Model([[1.0]], [[1.0]], None, [friction([[1.0]], 0.0, 1.0)], MPI.COMM_WORLD)
        start = fw.LinearMode(1.0, 0.0, np.ones(1), np.zeros(1))
        free = fw.NonlinearMode(model, self.problem.harmonics, self.method, 0, start)
        return whole(free.residual(self.at(q)))[: self.n]

    def __call__(self, q):
        return whole(self.problem.residual(self.at(q)))[: self.n] - self.linear(q)

    def product(self, q, dq):
        """Of the residual."""
        dy = unknowns(self.problem, np.concatenate([dq, np.zeros(3)]))
        return whole(self.problem.jacobian_product(self.at(q), dy))[: self.n]

    def told(self, q):
        return self.problem.diagnostics(self.at(q))


def motion(seed: int, H: int, roughness: float = 1.5):
    n = np.repeat(np.arange(H + 1), 2)[1:].clip(1)
    return np.random.default_rng(seed).standard_normal(2 * H + 1) / n**roughness


def velocity(q, rates=None):
    """v_k of v = Re sum v_k e^{i k tau}, v_k = s_k q_k."""
    k = np.arange(len(q) // 2 + 1)
    return (1j * k if rates is None else rates) * np.concatenate([q[:1], q[1::2] - 1j * q[2::2]])


def zeros(p):
    """Times at which Re sum p_k e^{i k tau} is zero: roots of a polynomial, and Newton's last digits."""
    k = np.arange(len(p))
    full = np.concatenate([np.conj(p[:0:-1]), [2 * p[0].real], p[1:]])
    tau = np.angle(np.roots(np.trim_zeros(full[::-1])))
    for _ in range(3):
        waves = np.exp(1j * np.multiply.outer(tau, k))
        value, slope = (waves @ p).real, (waves @ (1j * k * p)).real
        tau = tau - np.clip(value / np.where(slope == 0, np.inf, slope), -1e-3, 1e-3)
    return tau[np.abs((np.exp(1j * np.multiply.outer(tau, k)) @ p).real) < 1e-8 * np.abs(p).sum()] % (2 * np.pi)


def expected(v, eps):
    """Harmonic block of R tanh(v/eps): Gauss's quadrature on panels that grow by a third from each zero and each
    turning point of v, where v is summed from what it is there."""
    k = np.arange(len(v))
    anchors = np.sort(np.concatenate([zeros(v), zeros(1j * k * v)]))
    anchors = anchors[np.diff(anchors, prepend=anchors[-1] - 2 * np.pi) > 1e-12]
    edges = np.concatenate([[0], np.geomspace(1e-16, 1, 130)])
    x, w = np.polynomial.legendre.leggauss(20)
    F = np.zeros(len(v), complex)
    for a, after, before in zip(anchors, np.roll(anchors, -1) - anchors, anchors - np.roll(anchors, 1)):
        turned = v * np.exp(1j * k * a)
        value = turned.sum().real if abs(turned.sum().real) > 1e-14 * np.abs(v).sum() else 0.0
        for length in (after % (2 * np.pi) / 2, -(before % (2 * np.pi)) / 2):
            half = length * np.diff(edges)[:, None] / 2
            s = (length * (edges[1:] + edges[:-1])[:, None] / 2 + half * x).ravel()
            d = np.expm1(1j * np.multiply.outer(s, k))
            f = LIMIT * np.tanh(((d @ turned).real + value) / eps)
            F += np.exp(1j * k * a) * (((np.abs(half) * w).ravel() * f) @ (1 + d)) / np.pi
    return np.concatenate([[F[0].real / 2], np.column_stack([F[1:].real, F[1:].imag]).ravel()])


@pytest.mark.parametrize("eps", EPS)
def test_force_of_one_harmonic_is_the_integral(eps):
    """v = -a sin: F_s(n) = -(4 / pi) int_0^(pi/2) R tanh(a sin / eps) sin(n tau), odd n, by another's quadrature."""
    a = 1.5
    layer = min(40 * eps / a, 1.0)
    for n, found in zip((1, 3, 5), Forces(eps, range(6))(a * np.eye(11)[1])[2::4]):
        whole_way = 0.0
        for low, high in [(0, layer / 8), (layer / 8, layer / 2), (layer / 2, layer), (layer, np.pi / 2)]:
            whole_way += quad(lambda t, n=n: np.tanh(a * np.sin(t) / eps) * np.sin(n * t), low, high, epsabs=1e-14)[0]
        assert found == pytest.approx(-4 * LIMIT / np.pi * whole_way, abs=ROUNDING)


@pytest.mark.parametrize("n", [1, 3, 7, 101])
def test_it_tends_to_coulomb_s_friction(n):
    """4 R / (pi n), less R n pi / 6 (eps / a)^2: int (1 - tanh x) x dx = pi^2 / 24, twice a root."""
    a, H = 2.0, 101
    for eps in (1e-5, 1e-8, 1e-14):
        F = Forces(eps, range(1, H + 1, 2))(a * np.eye(H + 1)[0])
        assert F[n] == pytest.approx(-4 * LIMIT / np.pi / n + LIMIT * n * np.pi / 6 * (eps / a) ** 2, abs=LAST_DIGITS)
        assert np.abs(F[::2]).max() < LAST_DIGITS


@pytest.mark.parametrize("H, roughness", [(1, 1), (3, 1), (3, 3), (7, 1), (15, 2), (31, 2), (31, 1.2)])
def test_force_is_the_integral(H, roughness):
    """Of motions with few roots and with dozens."""
    for seed, eps in enumerate(EPS[:-1]):
        q = motion(seed, H, roughness)
        found = Forces(eps, range(H + 1))(q)
        assert np.allclose(found, expected(velocity(q), eps), rtol=0, atol=ROUNDING * LIMIT), eps


def of_velocity(v):
    """Coefficients of the motion that has it, frequency 1."""
    q = np.conj(v[1:] / (1j * np.arange(1, len(v))))
    return np.concatenate([[0.0], np.column_stack([q.real, q.imag]).ravel()])


@pytest.mark.parametrize("short", [0.3, 1e-2, 1e-5, 1e-9, 0.0, -1e-9, -1e-5, -1e-2, -0.3])
def test_velocity_that_nearly_touches_zero(short):
    """(1 + s - cos tau) (cos tau + 1 / 2 (1 + s)) is 1.5 s at tau = 0: two zeros close together, a double one, none. Of
    a layer as wide as sqrt(eps) rounding of v moves 1e-16 / sqrt(eps)."""
    v = np.array([0, 1 + short - 0.5 / (1 + short), -0.5, 0, 0, 0], complex) * np.exp(0.4j * np.arange(6))
    for eps in (1.0, 1e-3, 1e-6, 1e-8):
        found = Forces(eps, range(6))(of_velocity(v))
        assert np.allclose(found, expected(v, eps), rtol=0, atol=LIMIT * (ROUNDING + 4e-16 / np.sqrt(eps))), eps


@pytest.mark.parametrize("eps", [1.0, 0.05, 1e-3, 1e-8])
@pytest.mark.parametrize("beta", [0.0, 0.3])
def test_tangent_is_the_derivative(eps, beta):
    """Of complex modes too, whose s_n are complex."""
    for H, seed in [(1, 0), (3, 1), (9, 2)]:
        forces, q = Forces(eps, range(H + 1), method="CNM" if beta else "EPMC", beta=beta), motion(seed + 10, H, 2.0)
        residual = lambda x, f=forces: f(x) + f.linear(x)  # noqa: E731
        for dq in np.random.default_rng(3).standard_normal((3, len(q))):
            dF = forces.product(q, dq)
            assert np.allclose(derivative(residual, q, dq), dF, rtol=0, atol=DIFFERENCES * np.abs(dF).max())


@pytest.mark.parametrize("method, beta", [("EPMC", 0.2), ("CNM", 0.2), ("CNM", -0.1)])
def test_the_velocity_is_that_of_the_exponents(method, beta):
    """A complex mode's is s_n q_n with s_n = n (-beta + i); EPMC's motion does not decay."""
    q = motion(5, 5)
    v = velocity(q, np.arange(6) * complex(-beta if method == "CNM" else 0.0, 1.0))
    forces = Forces(0.01, range(6), method=method, beta=beta)
    assert np.allclose(forces(q), expected(v, 0.01), rtol=0, atol=ROUNDING)


@pytest.mark.parametrize("eps", [3.0, 0.05, 1e-6])
def test_the_number_of_samples_does_not_matter(eps):
    q = motion(3, 5)
    found = [Forces(eps, range(6), n) for n in (12, 64, 1024)]
    assert np.array_equal(found[0](q), found[1](q)) and np.array_equal(found[0](q), found[2](q))
    first, last = found[0].told(q), found[2].told(q)
    assert first["work"] == last["work"] and first["aliasing"] == last["aliasing"] == 0


@pytest.mark.parametrize("eps", [3.0, 0.3, 0.05, 1e-6])
def test_odd_orders_alone_are_what_all_orders_give(eps):
    """Of a half-wave symmetric motion half the period is integrated."""
    for seed in range(3):
        q = motion(seed, 11, 1.2)
        odd = np.concatenate([q[2 * k - 1 : 2 * k + 1] for k in range(1, 12, 2)])
        full, places = np.zeros(23), np.concatenate([[2 * k - 1, 2 * k] for k in range(1, 12, 2)])
        full[places] = odd
        half, every = Forces(eps, range(1, 12, 2)), Forces(eps, range(12))
        F = every(full)
        assert np.allclose(F[places], half(odd), rtol=0, atol=ROUNDING * LIMIT)
        assert np.abs(np.delete(F, places)).max() < ROUNDING * LIMIT
        dq = np.zeros(23)
        dq[places] = motion(seed + 5, 11)[places]
        whole_way, dF = every.product(full, dq), half.product(odd, dq[places])
        assert np.allclose(whole_way[places], dF, rtol=0, atol=1e-10 * np.abs(dF).max())


@pytest.mark.parametrize("eps", [0.3, 1e-2, 1e-4, 1e-6])
def test_panels_come_and_go_unseen(eps):
    """Along a line of motions through touching velocities the force has no jump: what is left of its second differences
    after a parabola through the finest steps is rounding."""
    base, way = motion(1, 3, 2.0), motion(2, 3, 2.0)
    forces, step = Forces(eps, range(4)), 1e-9
    for at in np.linspace(0, 3, 40):
        F = np.array([forces(base + (at + k * step) * way) for k in range(4)])
        assert np.abs(np.diff(F, 3, axis=0)).max() < 1e-11 * LIMIT


@pytest.mark.parametrize("omega", [1.0, 5.0])
@pytest.mark.parametrize("eps", [1.0, 0.01, 1e-6])
def test_work_and_slip_path_are_integrals(eps, omega):
    """Of v = -a w sin over a period in seconds: 4 a R int sin tanh(a w sin / eps), and slip from |v| = 2 eps on."""
    a = 1.5
    problem = Forces(eps, range(4), 8).problem
    found = problem.diagnostics(unknowns(problem, np.concatenate([a * np.eye(7)[1], [0.0, omega, 0.0]])))
    share = 0.0
    layer = min(20 * eps / a / omega, 1.0)
    for low, high in ((0, layer), (layer, np.pi / 2)):
        share += quad(lambda t: np.sin(t) * np.tanh(a * omega * np.sin(t) / eps), low, high, epsabs=1e-14)[0]
    assert found["work"] == pytest.approx(4 * a * LIMIT * share, rel=1e-11)
    onset = min(2 * eps / a / omega, 1.0)
    assert found["slip_path"] == pytest.approx(4 * a * np.sqrt(1 - onset**2), rel=ROUNDING)


@pytest.mark.parametrize("eps", [1.0, 1e-8])
def test_a_motion_that_stands_still_or_hardly_moves(eps):
    """tanh x = x keeps its digits where v is small beside eps, and nothing divides by zero."""
    forces = Forces(eps, range(4))
    assert not forces(np.zeros(7)).any() and not forces(np.eye(7)[0]).any()
    for size in (1e-3, 1e-8, 1e-13):
        q = size * eps * motion(4, 3)
        model, at = forces.problem, forces.at(q)
        F = whole(model.residual(at))[:7] - forces.linear(q)
        v = velocity(q)
        F_linear = LIMIT / eps * np.concatenate([[v[0].real], np.column_stack([v[1:].real, -v[1:].imag]).ravel()])
        assert np.allclose(F, F_linear, rtol=0, atol=(10 * size**2 + LAST_BIT) * np.abs(F_linear).max())


WILD = """
import sys
import numpy as np
import fretwave as fw
given = {"friction_limit": 1.0, "regularisation_velocity": 1e-6}
model = fw.Model([[1.0]], [[1.0]], None, [fw.Contact("regularised_coulomb", [[1.0]], given)])
for H in (3, 7, 15):
    problem = fw.NonlinearMode(model, fw.Harmonics(range(H + 1), 2 * H + 2), start=fw.linear_modes(model, 1, "free")[0])
    y, r = problem.core.unknowns(), problem.core.equations()
    for seed in range(100):
        values = np.random.default_rng(seed).standard_normal(y.getSize())
        values[:-2] *= float(sys.argv[1])
        values[-3:] = [0.01, 1.0, 0.1]
        y.setArray(values)
        problem.core.residual(y, r)
        assert r.norm() >= 0
"""


@pytest.mark.ranks(1)
@pytest.mark.parametrize("size", ["1e12", "1e47"])
def test_motions_of_a_wild_step_come_to_an_end(size):
    """Roots between samples, beside which rounding of v leaves no panel that is short enough: it went on for ever."""
    subprocess.run([sys.executable, "-c", WILD, size], check=True, timeout=60)


def test_pairs_with_their_own_parameters_on_any_number_of_ranks(comm):
    """Forty pairs, wide layers beside thin ones, as each alone."""
    n, H = 40, 3
    eps = np.geomspace(1e-8, 10.0, n)
    q = np.array([motion(seed, H) for seed in range(n)])
    model = fw.Model(np.eye(n), np.eye(n), None, [friction(np.eye(n), LIMIT, eps)], comm)
    start = fw.LinearMode(1.0, 0.0, np.ones(n), np.zeros(n))
    problem = fw.NonlinearMode(model, fw.Harmonics(range(H + 1), 8), "EPMC", 0, start)
    y = unknowns(problem, np.concatenate([q.ravel(), [0.0, 1.0, 0.0]]))
    rows = whole(problem.residual(y))[: q.size].reshape(n, -1)
    k = np.repeat(np.arange(H + 1), 2)[1:]
    for i in range(0, n, 7):
        assert np.allclose(rows[i] - (1 - k**2) * q[i], expected(velocity(q[i]), eps[i]), rtol=0, atol=ROUNDING * LIMIT)
