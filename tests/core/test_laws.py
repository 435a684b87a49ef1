"""Contact laws as the core evaluates them: regularised Coulomb friction, its tangent, its energy, bad parameters."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from models.core_models import LinearLaw, TanhLaw, friction, single_dof, unknowns, whole
from mpi4py import MPI
from tolerances import LAST_BIT, LAST_DIGITS, SOLVED

import fretwave as fw

SAMPLES = 32
#: On several ranks each must draw the same examples.
DRAWN = settings(max_examples=15, deadline=None, derandomize=True, database=None)
coefficients = st.lists(st.floats(-3.0, 3.0), min_size=7, max_size=7)
positive = st.floats(0.01, 100.0)


def problem(contact, method="EPMC", comm=MPI.COMM_WORLD):
    linear = fw.LinearMode(1.0, 0.0, np.ones(1), np.zeros(1))
    return fw.NonlinearMode(single_dof(comm, law=contact), fw.Harmonics([0, 1, 2, 3], SAMPLES), method, 0, linear)


def motion(problem, q, amplitude=1.0):
    """Unknowns of x = a (q0 + sum q_n ...) at frequency 1 without decay."""
    return unknowns(problem, np.concatenate([q, [0.0, 1.0, np.log(amplitude)]]))


def period(contact, q):
    """u, v, f over one period, on every rank."""
    p = problem(contact)
    samples = p.contact_period(motion(p, q))[0]
    return p.model.comm.bcast({name: None if s is None else s[:, 0, 0] for name, s in samples.items()})


@given(coefficients, positive, positive)
@DRAWN
def test_force_is_regularised_coulomb(q, limit, velocity):
    """mu N tanh(v / eps) (Laxalde et al. 2008, eq. 2b)."""
    found = period(friction([[1.0]], limit, velocity), q)
    assert np.allclose(found["f"], limit * np.tanh(found["v"] / velocity), rtol=LAST_DIGITS, atol=LAST_DIGITS * limit)


def test_force_tends_to_coulomb_friction():
    """As eps -> 0 the force is mu N sign(v)."""
    found = period(friction([[1.0]], 5.0, 1e-6), [0, 1.0, 0.5, 0, 0, 0, 0])
    assert np.allclose(found["f"], 5.0 * np.sign(found["v"]), rtol=0, atol=LAST_BIT)


@given(coefficients)
@DRAWN
def test_law_is_odd(q):
    contact = friction([[1.0]], 2.0, 0.7)
    forward, backward = period(contact, q), period(contact, [-x for x in q])
    assert np.array_equal(backward["f"], -forward["f"])


@given(coefficients, positive, positive)
@DRAWN
def test_friction_never_gives_energy_back(q, limit, velocity):
    """f v >= 0 at every sample; work is its integral, whatever the motion: 1e5 times with a kink of |v| in some."""
    contact = friction([[1.0]], limit, velocity)
    found = period(contact, q)
    p = problem(contact)
    work = p.diagnostics(motion(p, q))["work"]
    assert (found["f"] * found["v"] >= 0).all()
    tau, n = np.linspace(0, 2 * np.pi, 100_000, endpoint=False)[:, None], np.arange(1, 4)
    v = (np.cos(n * tau) * n) @ q[2::2] - (np.sin(n * tau) * n) @ q[1::2]
    expected = 2 * np.pi * limit * np.mean(v * np.tanh(v / velocity))
    assert work == pytest.approx(expected, rel=1e-6, abs=1e-300)


@pytest.mark.parametrize("law", [friction([[1.0]], 2.0, 0.7), fw.Contact(TanhLaw(2.0, 0.7), [[1.0]])])
def test_tangent_is_the_derivative_of_the_force(law):
    """Central difference of the residual in a motion, which K and M enter linearly."""
    p, rng, step = problem(law), np.random.default_rng(5), 1e-6
    y, dy = rng.standard_normal(10) * 0.3, rng.standard_normal(10) * 0.3
    y[-2], dy[-3:] = 1.0, 0.0
    plus, minus = (whole(p.residual(unknowns(p, y + s * step * dy))) for s in (1, -1))
    product = whole(p.jacobian_product(unknowns(p, y), unknowns(p, dy)))
    assert np.allclose((plus - minus) / (2 * step), product, rtol=0, atol=SOLVED * np.abs(product).max())


def test_tangent_of_a_python_law_may_be_left_to_differences():
    """`PythonLaw` promises about 1e-9 without `tangent`."""

    class WithoutTangent(TanhLaw):
        tangent = fw.PythonLaw.tangent

    rng = np.random.default_rng(6)
    y, dy = rng.standard_normal(10) * 0.3, rng.standard_normal(10)
    y[-2] = 1.0
    products = []
    for law in (TanhLaw(2.0, 0.7), WithoutTangent(2.0, 0.7)):
        p = problem(fw.Contact(law, [[1.0]]))
        products.append(whole(p.jacobian_product(unknowns(p, y), unknowns(p, dy))))
    assert np.allclose(*products, rtol=0, atol=SOLVED * np.abs(products[0]).max())


def test_slip_and_stick_are_counted_by_velocity():
    """A sample slips where |v| > 2 eps: with v = -sin(tau), eps = 1/4 for two thirds of a period."""
    p = problem(friction([[1.0]], 1.0, 0.25))
    found = p.diagnostics(motion(p, [0, 1, 0, 0, 0, 0, 0]))
    slipping = np.count_nonzero(np.abs(np.sin(2 * np.pi * np.arange(SAMPLES) / SAMPLES)) > 0.5) / SAMPLES
    assert found["slip"] == slipping and found["open"] == 0
    assert found["slip"] + found["stick"] == pytest.approx(1, abs=LAST_BIT)


def test_parameters_belong_to_their_pairs(comm):
    """One limit and one velocity per pair, whichever rank holds the pair."""
    limits, velocities = np.array([1.0, 2.0, 5.0]), np.array([0.5, 1.0, 3.0])
    model = fw.Model(np.eye(3), np.eye(3), None, [friction(np.eye(3), limits, velocities)], comm)
    p = fw.NonlinearMode(model, fw.Harmonics([1], 8), "EPMC", 0, fw.LinearMode(1.0, 0.0, np.ones(3), np.zeros(3)))
    found = comm.bcast(p.contact_period(p.initial(1.0))[0])
    assert np.allclose(found["f"], limits * np.tanh(found["v"] / velocities), rtol=LAST_DIGITS, atol=0)


def test_table_of_laws_tells_units_bounds_and_components():
    info = fw.laws()["regularised_coulomb"]
    limit, velocity = info.parameters
    assert info.components == 1
    assert (limit.name, limit.unit, limit.lower, limit.strict) == ("friction_limit", "force", 0, False)
    assert (velocity.name, velocity.unit) == ("regularisation_velocity", "length/s")
    assert (velocity.lower, velocity.strict) == (0, True)


GOOD = {"friction_limit": 1.0, "regularisation_velocity": 0.1}


@pytest.mark.parametrize(
    "law, parameters, message",
    [
        ("coulomb", GOOD, "unknown contact law"),
        ("regularised_coulomb", {"friction_limit": 1.0}, "regularisation_velocity"),
        ("regularised_coulomb", {**GOOD, "mu": 0.5}, "mu"),
        ("regularised_coulomb", {**GOOD, "friction_limit": -1.0}, "friction_limit.*out of bounds"),
        ("regularised_coulomb", {**GOOD, "friction_limit": -1e-9}, "friction_limit.*out of bounds.*-1e-09"),
        ("regularised_coulomb", {**GOOD, "regularisation_velocity": 0.0}, "regularisation_velocity.*out of bounds"),
        ("regularised_coulomb", {**GOOD, "friction_limit": np.nan}, "friction_limit.*out of bounds"),
        ("regularised_coulomb", {**GOOD, "friction_limit": [1.0, 2.0]}, "wrong length"),
    ],
)
@pytest.mark.ranks(1)
def test_bad_parameters_are_refused(law, parameters, message):
    with pytest.raises(fw.InputError, match=f"(?s){message}"):
        single_dof(MPI.COMM_WORLD, law=fw.Contact(law, [[1.0]], parameters))


@pytest.mark.ranks(1)
def test_b_of_a_wrong_width_is_refused():
    with pytest.raises(fw.InputError, match="does not fit"):
        single_dof(MPI.COMM_WORLD, law=fw.Contact(LinearLaw(1.0, 0.0), [[1.0, 0.0]]))


@pytest.mark.ranks(1)
def test_an_exception_in_a_python_law_reaches_the_caller():
    class Broken(TanhLaw):
        def force(self, u, v):
            raise RuntimeError("the law is broken")

    p = problem(fw.Contact(Broken(1.0, 1.0), [[1.0]]))
    with pytest.raises(RuntimeError, match="the law is broken"):
        list(fw.Continuation(p, p.initial(1.0), (0.5, 2.0)))
