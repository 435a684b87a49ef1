"""3-D Coulomb contact under imposed motion: its cone, energy, symmetries and limits."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from models.core_models import dense, everywhere, unknowns, whole
from models.coulomb_pair import DRAWN, KN, KT, LAWS, MU, SAMPLES, imposed, loads, motion, motions, pair, period
from tolerances import LAST_DIGITS, ROUNDING

import fretwave as fw


@pytest.mark.parametrize("law", LAWS)
@given(q=motions, load=loads, gap=st.floats(-1.0, 1.0))
@DRAWN
def test_force_stays_in_the_friction_cone(law, q, load, gap):
    """N = max(0, N0 + kn (u_n - gap)): no tension; |T| <= mu N, in all directions or tangent by tangent."""
    u, f = period(pair(law, normal_load=load, gap=gap), q)
    assert np.allclose(f[:, 0], np.maximum(0, load + KN * (u[:, 0] - gap)), rtol=LAST_DIGITS, atol=LAST_DIGITS)
    size = np.hypot(f[:, 1], f[:, 2]) if law == "coulomb_3d" else np.abs(f[:, 1:]).max(axis=1)
    assert (f[:, 0] >= 0).all()
    assert (size <= MU * f[:, 0] * (1 + 1e-14)).all()


@pytest.mark.parametrize("law", LAWS)
@given(q=motions, load=loads, gap=st.floats(-1.0, 1.0))
@DRAWN
def test_dissipation_is_not_negative(law, q, load, gap):
    """Any periodic motion; the shares of stick, slip and open make one."""
    problem, y = imposed(pair(law, normal_load=load, gap=gap), q)
    found = problem.diagnostics(y)
    assert found["work"] >= 0
    assert found["stick"] + found["slip"] + found["open"] == pytest.approx(1, abs=LAST_DIGITS)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("load", [0.0, 1.0, 3.0])
def test_dissipation_is_the_work_of_the_whole_contact(law, load):
    """The closed integral of f du: springs give nothing, so its trapezoids tend to the slider's work, as 1/N_t^2."""
    q = motion((0.1, 0.3, 0.2), (0, 1.0, 0.1, 0.2), (0, 0.2, -0.7, 0, 0.3))
    errors = []
    for samples in (256, 1024, 4096):
        problem, y = imposed(pair(law, normal_load=load), q, samples=samples)
        u, f = period(pair(law, normal_load=load), q, samples=samples)
        area = np.sum((f + np.roll(f, -1, axis=0)) / 2 * (np.roll(u, -1, axis=0) - u))
        errors.append(abs(problem.diagnostics(y)["work"] / area - 1))
    assert errors[2] < 1e-5 and np.log2(errors[0] / errors[2]) > 6


@given(q=motions, load=loads)
@DRAWN
def test_coupled_and_uncoupled_are_equal_along_one_tangent(q, load):
    """One tangent moves: the circle and the square limit alike, to what a sample leaves in which it closes."""
    for still in (1, 2):
        line = np.array(q)
        line[still] = 0
        fastest = (np.abs(line) @ np.repeat([0, 1, 2, 3], 2)[1:]).sum()
        for samples in (64, 1024):
            forces = [period(pair(law, normal_load=load), line, samples=samples)[1] for law in LAWS]
            of_a_sample = (KT + MU * KN) * fastest * 2 * np.pi / samples
            assert np.allclose(*forces, rtol=0, atol=of_a_sample + ROUNDING)
            assert np.abs(forces[0][:, still]).max() == np.abs(forces[1][:, still]).max() == 0


def test_coupled_and_uncoupled_differ_along_a_diagonal():
    """The square admits sqrt(2) mu N."""
    q = motion((0,), (0, 5.0), (0, 5.0))
    sizes = [np.hypot(*period(pair(law), q)[1][:, 1:].T).max() for law in LAWS]
    assert sizes == pytest.approx([MU, np.sqrt(2) * MU], rel=LAST_DIGITS)


@given(q=motions, load=loads, angle=st.floats(-3.2, 3.2))
@DRAWN
def test_coupled_law_is_the_same_in_all_tangential_directions(q, load, angle):
    """Turning the motion about the normal turns the force."""
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    f, turned = (period(pair(normal_load=load), x)[1] for x in (q, turn @ q))
    assert np.allclose(turned, f @ turn.T, rtol=0, atol=1e-11)


@pytest.mark.parametrize("law", LAWS)
def test_gap_and_lift_off(law):
    """u_n = cos against a gap of 1/2, N0 = 0: closed for the third of the period where cos > 1/2."""
    q = motion((0, 1.0), (0, 0, 2.0))
    contact = pair(law, normal_load=0.0, gap=0.5)
    u, f = period(contact, q)
    closed = u[:, 0] > 0.5
    problem, y = imposed(contact, q)
    assert f[closed, 0] == pytest.approx(KN * (u[closed, 0] - 0.5), rel=1e-13)
    assert (f[~closed] == 0).all()
    assert problem.diagnostics(y)["open"] == pytest.approx(2 / 3, rel=ROUNDING)


@pytest.mark.parametrize("law", LAWS)
def test_slider_follows_while_open(law):
    """At contact again the tangential force starts from zero: with mu huge it is kt times the way since."""
    u, f = period(pair(law, normal_load=0.0, friction_coefficient=1e6), motion((0, 1.0), (0, 0, 2.0)))
    closed = np.nonzero(u[:, 0] > 0)[0]
    landing = SAMPLES + 1 - np.argmax(u[::-1, 0] <= 0) - 1  # first closed sample of the run that ends the period
    last_open = u[landing - 1, 1]
    assert f[closed, 1] == pytest.approx(KT * (u[closed, 1] - last_open), rel=ROUNDING, abs=ROUNDING)


def test_slider_starts_where_the_pair_touches():
    """u_n = cos t against a gap of 0.3, friction without bound: w is the path's point where it closes, between two
    samples at t = -acos 0.3."""
    touch = 2.0 * np.sin(-np.arccos(0.3))
    for samples in (8, 66, 132):
        contact = pair(normal_load=0.0, gap=0.3, friction_coefficient=1e6)
        u, f = period(contact, motion((0, 1.0), (0, 0, 2.0)), samples=samples)
        closed = f[:, 0] > 0
        w = u[closed, 1] - f[closed, 1] / KT
        assert np.ptp(w) < ROUNDING
        assert w == pytest.approx(touch, rel=ROUNDING)


@given(st.lists(st.floats(-3.0, 3.0), min_size=7, max_size=7), st.floats(0.1, 5.0))
@DRAWN
def test_constant_normal_load_is_the_jenkins_element(q, load):
    """R = mu N0."""
    law = "coulomb_3d_uncoupled"
    f = period(pair(law, normal_load=load), motion((0,), q))[1]
    element = fw.Contact("jenkins", np.eye(3)[1:2], {"tangential_stiffness": KT, "friction_limit": MU * load})
    problem, y = imposed(element, motion((0,), q))
    expected = everywhere(problem, problem.contact_period(y))[0]["f"][:, 0, 0]
    assert np.allclose(f[:, 1], expected, rtol=0, atol=1e-13)
    assert (f[:, 0] == load).all()
    uncoupled, y = imposed(pair(law, normal_load=load), motion((0,), q))
    assert uncoupled.diagnostics(y)["work"] == pytest.approx(problem.diagnostics(y)["work"], rel=1e-11, abs=ROUNDING)


@pytest.mark.parametrize("law", LAWS)
def test_without_friction_there_is_no_tangential_force(law):
    f = period(pair(law, friction_coefficient=0.0), motion((0, 0.3), (0, 1.0), (0, 0, 2.0)))[1]
    assert (f[:, 1:] == 0).all() and (f[:, 0] > 0).all()


@pytest.mark.parametrize("law", [*LAWS, "jenkins"])
def test_many_pairs_are_as_each_alone(law):
    """Marched in tiles of up to 64 pairs: residual, product and assembled Jacobian of the pairs beside the joints."""
    pairs, components = 70, 1 if law == "jenkins" else 3
    q, dq = np.random.default_rng(1).standard_normal((2, pairs, components, 7))

    def evaluated(chosen):
        B = np.eye(len(chosen) * components)
        element = {"tangential_stiffness": KT, "friction_limit": MU}
        contact = fw.Contact("jenkins", B, element) if law == "jenkins" else pair(law, B)
        problem, y = imposed(contact, q[chosen])
        dy = np.concatenate([dq[chosen].ravel(), np.zeros(3)])
        product = whole(problem.jacobian_product(y, unknowns(problem, dy)))
        parts = [whole(problem.residual(y)), product, dense(problem.jacobian(y)) @ dy]
        return np.array([part[: q[chosen].size] for part in parts]).reshape(3, len(chosen), -1)

    together = evaluated(list(range(pairs)))
    for chosen in (0, 63, 64, pairs - 1):
        assert np.allclose(together[:, [chosen]], evaluated([chosen]), rtol=0, atol=ROUNDING)


def test_few_harmonics_by_table_and_many_by_fft_are_the_same():
    """N_t = 1024: 199 coefficients go through a table of cosines, 201 through FFTW."""
    q = motion((0.1, 0.3, 0.2), (0, 1.0, 0.1, 0.2), (0, 0.2, -0.7, 0, 0.3))
    found = []
    for highest in (99, 100):
        wide = np.zeros((3, 2 * highest + 1))
        wide[:, :7] = q
        problem, y = imposed(pair(), wide, orders=range(highest + 1), samples=1024)
        found.append(whole(problem.residual(y))[: wide.size].reshape(3, -1)[:, :199])
    assert np.allclose(*found, rtol=0, atol=1e-13)


#: Pairs that do not move along their tangents, and carry nothing there: (parameters, normal motion).
CARRIES_NOTHING = {
    "no friction": ({"friction_coefficient": 0.0}, (0, 0.3)),
    "open all the time": ({"normal_load": 0.0, "gap": 10.0}, (0, 1.0)),
}


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("which", list(CARRIES_NOTHING))
def test_tangent_is_zero_where_no_tangential_force_can_be(law, which):
    """Also for a pair whose tangential motion is exactly zero: its force stays zero whatever is added."""
    parameters, normal = CARRIES_NOTHING[which]
    problem, y = imposed(pair(law, **parameters), motion(normal))
    sideways = np.zeros(24)
    sideways[7] = 1.0  # the mean of the first tangent: inertia and damping see nothing of it, the ground spring is 1
    found = whole(problem.jacobian_product(y, unknowns(problem, sideways)))
    assert found[7] == pytest.approx(1.0, abs=1e-13)
    assert np.abs(np.delete(found, 7)).max() < 1e-13


def test_parameters_belong_to_their_pairs(comm):
    """One value per pair, whichever rank holds the pair: forces of 4 pairs at rest displaced by one unit."""
    kn, kt, gap = np.array([1.0, 2.0, 3.0, 4.0]), np.array([5.0, 6.0, 7.0, 8.0]), np.array([0.0, 0.1, -0.2, 9.0])
    contact = pair(B=np.eye(12), normal_stiffness=kn, tangential_stiffness=kt, gap=gap, friction_coefficient=1e3)
    model = fw.Model(np.eye(12), np.eye(12), None, [contact], comm)
    start = fw.LinearMode(1.0, 0.0, np.ones(12), np.zeros(12))
    problem = fw.NonlinearMode(model, fw.Harmonics([0, 1], 8), "EPMC", 0, start)
    y = np.zeros(39)
    y[:36:3], y[-2] = 1.0, 1.0
    f = everywhere(problem, problem.contact_period(unknowns(problem, y)))[0]["f"]
    normal = np.maximum(0, 1.0 + kn * (1 - gap))
    assert np.allclose(f, [normal, kt * (normal > 0), kt * (normal > 0)], rtol=1e-13, atol=0)


GOOD = {"normal_stiffness": 1.0, "tangential_stiffness": 1.0, "friction_coefficient": 0.3}


@pytest.mark.ranks(1)
@pytest.mark.parametrize("name, value", [("normal_stiffness", 0.0), ("tangential_stiffness", -1.0), ("gap", np.inf)])
def test_bad_parameters_are_refused(name, value):
    with pytest.raises(fw.InputError, match=f"(?s){name}.*out of bounds"):
        fw.Model(np.eye(3), np.eye(3), None, [fw.Contact("coulomb_3d", np.eye(3), {**GOOD, name: value})])
