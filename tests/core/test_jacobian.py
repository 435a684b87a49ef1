"""Exact derivatives: assembled Jacobian, matrix-free product, bordered system, against central differences."""

from __future__ import annotations

import numpy as np
import pytest
from models.core_models import CoupledLaw, LinearLaw, chain, dense, friction, unknowns, whole
from models.cyclic_models import rich_sector
from tolerances import ROUNDING, SOLVED

import fretwave as fw

pytestmark = pytest.mark.ranks(1, 2, 3)

VARIANTS = ["CNM", "EPMC", "forced"]
W_REF = 1.3  #: angular frequency of the starting mode
#: Scaled scalars (beta, omega, log amplitude), or (omega) for a forced response.
SCALARS = {"CNM": [0.06, 1.1, -0.4], "EPMC": [0.06, 1.1, -0.4], "forced": [1.1]}
#: Fourth-order differences with this step: truncation and rounding both stay below 1e-10 for these laws.
STEP = 1e-3


class MixedLaw(LinearLaw):
    """f = k u + u^2 v: even and odd in turn, uses both arguments."""

    odd = False

    def force(self, u, v):
        return self.k * u + u**2 * v + 0.3 * u**2

    def tangent(self, u, v):
        return (self.k + 2 * u * v + 0.6 * u)[:, None], (u**2)[:, None]


def two_dampers(comm):
    """Three masses, a damping matrix, two friction contacts with several pairs each, odd harmonics."""
    C = 0.05 * chain(3) + np.diag([0.1, 0.0, 0.2])
    relative = np.array([[1.0, -1.0, 0.0], [0.0, 1.0, -1.0]])
    contacts = [friction(relative, [1.0, 2.0], [2.0, 3.0], "between"), friction(np.eye(3), 0.7, 1.5, "ground")]
    return fw.Model(np.diag([1.0, 0.5, 2.0]), chain(3), C, contacts, comm), [1, 3]


def mean_and_even(comm):
    """Three masses, friction and a law of displacement and velocity that is not odd: mean and even harmonics."""
    contacts = [friction(np.eye(3)[:1], 1.0, 2.0), fw.Contact(MixedLaw(0.8, 0.0), np.eye(3)[1:], name="mixed")]
    return fw.Model(np.diag([1.0, 0.5, 2.0]), chain(3), None, contacts, comm), [0, 1, 2]


def three_components(comm, pairs):
    """A law that couples three components, displacement and velocity, seen through a full B."""
    B = 0.5 * np.random.default_rng(7).standard_normal((3 * pairs, 3))
    contact = fw.Contact(CoupledLaw(), B)
    return fw.Model(np.eye(3), chain(3), 0.02 * chain(3), [contact], comm), [0, 1, 2]


def sector_of_a_wheel(comm):
    """A travelling wave: phases in every linear term and in contacts that reach sectors ahead and behind."""
    return rich_sector().model(2, comm), [0, 1, 2]


MODELS = {
    "two dampers": two_dampers,
    "mean and even": mean_and_even,
    "three components": lambda comm: three_components(comm, 1),
    "three components, two pairs": lambda comm: three_components(comm, 2),
    "sector of a wheel": sector_of_a_wheel,
}


def problem_of(variant, model, orders):
    n = model.n_dof
    linear = fw.LinearMode(W_REF, 0.0, np.ones(n), np.zeros(n))
    h = fw.Harmonics(orders, 32)
    if variant != "forced":
        return fw.NonlinearMode(model, h, variant, 1, linear)
    force = {order: np.random.default_rng(order).standard_normal(n) * (1 + 0.5j) for order in orders if order}
    return fw.ForcedResponse(model, h, force, 1.5, 1, linear)


@pytest.fixture(params=VARIANTS)
def variant(request):
    """Residual variant."""
    return request.param


@pytest.fixture(params=list(MODELS))
def problem(request, variant, comm):
    """Each residual variant of each model."""
    return problem_of(variant, *MODELS[request.param](comm))


def random_point(problem, variant, seed=0):
    rng = np.random.default_rng(seed)
    q = rng.standard_normal(problem.model.n_dof * problem.harmonics.block_size)
    return np.concatenate([0.5 * q, SCALARS[variant]])


def difference(function, y, direction):
    """Fourth-order central difference of `function` at y."""
    weights = {-2: 1 / 12, -1: -2 / 3, 1: 2 / 3, 2: -1 / 12}
    return sum(w * function(y + k * STEP * direction) for k, w in weights.items()) / STEP


def residual_of(problem):
    return lambda y: whole(problem.residual(unknowns(problem, y)))


def test_assembled_jacobian_is_the_derivative_of_the_residual(problem, variant):
    """Every column against differences, the columns of the scalars among them."""
    y = random_point(problem, variant)
    J = dense(problem.jacobian(unknowns(problem, y)))
    expected = np.column_stack([difference(residual_of(problem), y, e) for e in np.eye(len(y))])
    assert J.shape == (len(y) - 1, len(y))
    assert np.allclose(J, expected, rtol=0, atol=SOLVED * np.abs(expected).max())


def test_product_is_the_derivative_along_a_direction(problem, variant):
    y, dy = (random_point(problem, variant, seed) for seed in (0, 1))
    product = whole(problem.jacobian_product(unknowns(problem, y), unknowns(problem, dy)))
    expected = difference(residual_of(problem), y, dy)
    assert np.allclose(product, expected, rtol=0, atol=SOLVED * np.abs(expected).max())


def test_product_equals_the_assembled_jacobian_to_rounding(problem, variant):
    """Matrix-free Jacobian product exact to rounding."""
    y = random_point(problem, variant)
    J = dense(problem.jacobian(unknowns(problem, y)))
    for seed in range(3):
        dy = np.random.default_rng(seed + 10).standard_normal(len(y))
        product = whole(problem.jacobian_product(unknowns(problem, y), unknowns(problem, dy)))
        assert np.allclose(product, J @ dy, rtol=0, atol=ROUNDING * np.abs(J @ dy).max())


def test_product_belongs_to_its_own_point(problem, variant):
    """A line search evaluates elsewhere: the residual taken last must not move the linearisation."""
    y, elsewhere, dy = (random_point(problem, variant, seed) for seed in (0, 1, 2))
    first = whole(problem.jacobian_product(unknowns(problem, y), unknowns(problem, dy)))
    problem.residual(unknowns(problem, elsewhere))
    again = whole(problem.jacobian_product(unknowns(problem, y), unknowns(problem, dy)))
    assert np.array_equal(first, again)


def test_diagnostics_do_not_move_the_linearisation(problem, variant):
    y, elsewhere, dy = (random_point(problem, variant, seed) for seed in (0, 1, 2))
    first = whole(problem.jacobian_product(unknowns(problem, y), unknowns(problem, dy)))
    problem.diagnostics(unknowns(problem, elsewhere))
    problem.contact_period(unknowns(problem, elsewhere))
    again = whole(problem.jacobian_product(unknowns(problem, y), unknowns(problem, dy)))
    assert np.array_equal(first, again)


def closed_system(problem, variant):
    """Bordered system closed by a random row, and that row. The solver must outlive its system."""
    newton = fw._core.Newton(problem.core, "bordered_")
    row = np.random.default_rng(4).standard_normal(len(random_point(problem, variant)))
    newton.system.close(unknowns(problem, row), 0.7)
    return newton, row


def augmented(problem, newton):
    def function(y):
        g = problem.core.unknowns()
        newton.system.residual(unknowns(problem, y), g)
        return whole(g)

    return function


def test_bordered_residual_is_the_augmented_map(problem, variant):
    """(r(y), row . y - value), the closing row last."""
    newton, row = closed_system(problem, variant)
    y = random_point(problem, variant)
    g = augmented(problem, newton)(y)
    assert np.array_equal(g[:-1], residual_of(problem)(y))
    assert g[-1] == pytest.approx(row @ y - 0.7, abs=1e-13)


def test_bordered_system_is_the_derivative_of_the_augmented_map(problem, variant):
    """Product against differences of the augmented map, assembled matrix against the product to rounding."""
    newton, _ = closed_system(problem, variant)
    y, dy = random_point(problem, variant), random_point(problem, variant, 9)
    product = problem.core.unknowns()
    newton.system.product(unknowns(problem, y), unknowns(problem, dy), product)
    expected = difference(augmented(problem, newton), y, dy)
    assert np.allclose(whole(product), expected, rtol=0, atol=SOLVED * np.abs(expected).max())
    J = dense(newton.system.jacobian(unknowns(problem, y)))
    assert J.shape == (len(y), len(y))
    assert np.allclose(whole(product), J @ dy, rtol=0, atol=ROUNDING * np.abs(J @ dy).max())
