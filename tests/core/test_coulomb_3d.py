"""3-D Coulomb contact: its cone, energy, symmetries and limits under imposed motion, and modes that carry it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from models.core_models import chain, dense, derivative, everywhere, mode_problem, solve_at, unknowns, whole
from mpi4py import MPI
from tolerances import LAST_DIGITS, REPEATED, ROUNDING, SOLVED, TIGHT

import fretwave as fw

KN, KT, MU = 2.0, 1.5, 0.4
SAMPLES = 64
LAWS = ["coulomb_3d", "coulomb_3d_uncoupled"]
#: On several ranks each must draw the same examples.
DRAWN = settings(max_examples=25, deadline=None, derandomize=True, database=None)
motions = st.lists(st.floats(-2.0, 2.0), min_size=21, max_size=21).map(lambda q: np.reshape(q, (3, 7)))
loads = st.floats(0.0, 3.0)


def pair(law="coulomb_3d", B=((1, 0, 0), (0, 1, 0), (0, 0, 1)), **changes):
    parameters = {"normal_stiffness": KN, "tangential_stiffness": KT, "friction_coefficient": MU, "normal_load": 1.0}
    return fw.Contact(law, np.array(B, dtype=float), {**parameters, **changes})


def imposed(contact, q, orders=(0, 1, 2, 3), samples=SAMPLES):
    """A problem and its unknowns for the motion with coefficients q (dofs, m), frequency 1, no decay."""
    n = np.shape(contact.B)[1]
    model = fw.Model(np.eye(n), np.eye(n), None, [contact], MPI.COMM_WORLD)
    start = fw.LinearMode(1.0, 0.0, np.ones(n), np.zeros(n))
    problem = fw.NonlinearMode(model, fw.Harmonics(orders, samples), "EPMC", 0, start)
    return problem, unknowns(problem, np.concatenate([np.ravel(q), [0.0, 1.0, 0.0]]))


def period(contact, q, **options):
    """u, f (samples, 3) of a single pair over one period, on every rank."""
    problem, y = imposed(contact, q, **options)
    found = everywhere(problem, problem.contact_period(y))[0]
    return found["u"][:, :, 0], found["f"][:, :, 0]


def motion(normal=(0,), tangent=(0,), other=(0,)):
    """Coefficients (3, 7) from the leading ones of each direction."""
    q = np.zeros((3, 7))
    for row, values in zip(q, (normal, tangent, other)):
        row[: len(values)] = values
    return q


def shifted(q, samples):
    """The motion read from another sample on."""
    out = np.array(q)
    for n in range(1, (np.shape(q)[1] - 1) // 2 + 1):
        c = (out[:, 2 * n - 1] - 1j * out[:, 2 * n]) * np.exp(2j * np.pi * n * samples / SAMPLES)
        out[:, 2 * n - 1], out[:, 2 * n] = c.real, -c.imag
    return out


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
    """The closed integral of f du: the springs give nothing, so its trapezoids tend to the slider's work, as 1/N_t^2
    where sliders are pulled along their paths and as 1/N_t where they are clipped at the samples."""
    q = motion((0.1, 0.3, 0.2), (0, 1.0, 0.1, 0.2), (0, 0.2, -0.7, 0, 0.3))
    errors = []
    for samples in (256, 1024, 4096):
        problem, y = imposed(pair(law, normal_load=load), q, samples=samples)
        u, f = period(pair(law, normal_load=load), q, samples=samples)
        area = np.sum((f + np.roll(f, -1, axis=0)) / 2 * (np.roll(u, -1, axis=0) - u))
        errors.append(abs(problem.diagnostics(y)["work"] / area - 1))
    least, order = (3e-3, 3) if law == "coulomb_3d_uncoupled" else (1e-5, 6)
    assert errors[2] < least and np.log2(errors[0] / errors[2]) > order


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
    assert problem.diagnostics(y)["open"] == np.count_nonzero(~closed) / SAMPLES


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
    samples at t = -acos 0.3. The path is taken as straight there: second order."""
    touch, errors = 2.0 * np.sin(-np.arccos(0.3)), []
    for samples in (66, 132, 264, 528):
        contact = pair(normal_load=0.0, gap=0.3, friction_coefficient=1e6)
        u, f = period(contact, motion((0, 1.0), (0, 0, 2.0)), samples=samples)
        closed = f[:, 0] > 0
        w = u[closed, 1] - f[closed, 1] / KT
        assert np.ptp(w) < ROUNDING
        errors.append((2 * np.pi / samples) ** -2 * abs(w[0] - touch))
    assert max(errors) < 0.5 and errors[0] > 0.01


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


def independent_of_the_first_sample(contact, q, tolerance):
    f = period(contact, q)[1]
    for samples in (5, 20, 40, 63):
        later = period(contact, shifted(q, samples))[1]
        assert np.abs(np.roll(later, samples, axis=0) - f).max() <= tolerance * np.abs(f).max()


@given(q=motions, load=loads)
@DRAWN
def test_uncoupled_law_does_not_depend_on_the_first_sample(q, load):
    """Started from rest and read on the second period (DESIGN fact 3)."""
    independent_of_the_first_sample(pair("coulomb_3d_uncoupled", normal_load=load), q, 1e-13)


@given(q=motions, load=loads)
@DRAWN
def test_coupled_law_does_not_depend_on_the_first_sample(q, load):
    """Its sliders close the period, after lift-off, in slip on curved paths and in shakedown alike."""
    independent_of_the_first_sample(pair(normal_load=load), q, 1e-11)


@given(q=motions, angle=st.floats(-3.2, 3.2))
@DRAWN
def test_coupled_law_does_not_depend_on_the_first_sample_along_a_line(q, angle):
    line = motion(q[0], np.cos(angle) * q[1], np.sin(angle) * q[1])
    independent_of_the_first_sample(pair(), line, 1e-12)


@pytest.mark.parametrize("size", [0.267, 0.28, 0.35, 0.5, 1.0])
def test_coupled_law_does_not_depend_on_the_first_sample_of_an_orbit(size):
    """An elliptic orbit just beyond the stick limit 0.26667, where a marched slider takes many periods to settle."""
    independent_of_the_first_sample(pair(), motion((0,), (0, 0, size), (0, 0.6 * size)), 1e-11)


REACH = MU / KT  #: the slider's disc at N0 = 1


def test_shakedown_takes_the_periodic_slider_nearest_to_rest():
    """A circle of radius r < R about c far from rest: all discs hold the one of radius R - r about c, and w is its
    point nearest to 0, c - (R - r), on the disc of the sample where u = c + r."""
    c, r = 1.0, 0.1
    u, f = period(pair(), motion((0,), (c, r), (0, 0, r)))
    w = c - (REACH - r)
    assert np.allclose(f[:, 1:], KT * (u[:, 1:] - [w, 0]), rtol=0, atol=1e-13)


@pytest.mark.parametrize("r", [1.1 * REACH, 1.0, 3.0])
def test_slider_on_a_circle_is_a_tractrix(r):
    """Pulled along a circle of radius r > R at distance R it moves along itself, on the circle of radius
    sqrt(r^2 - R^2): work per period 2 pi mu N sqrt(r^2 - R^2), and the force leads the motion by acos(R / r); both
    errors fall as 1/N_t^2."""
    path, lead = motion((0,), (0, r), (0, 0, r)), np.arccos(REACH / r)
    work, errors = 2 * np.pi * MU * np.sqrt(r**2 - REACH**2), []
    for samples in (256, 1024, 4096):
        problem, y = imposed(pair(), path, samples=samples)
        u, f = period(pair(), path, samples=samples)
        found = np.mean((f[:, 1] + 1j * f[:, 2]) * (u[:, 1] - 1j * u[:, 2])) / r
        errors.append([abs(problem.diagnostics(y)["work"] / work - 1), abs(found / (MU * np.exp(1j * lead)) - 1)])
    assert (np.array(errors[2]) < 3e-5).all() and (np.log2(np.divide(errors[:-1], errors[1:])) > 3.8).all()


#: Motions of a pair that never opens: which sliders close its period.
STEADY = {
    "shakedown on one disc": motion((0, 0.05), (1.0, 0.1), (0.3, 0, 0.1)),
    "shakedown on two discs": motion((0, 0, 0.02), (0.2, 0, 0, 0.05), (0.1, 0.24, 0.03)),
    "cycle near its onset": motion((0, 0, 0.02), (0.02, 0, 0.29), (0.05, 0.17)),
    "cycle": motion((0, 0.1, 0.1), (0.3, 0, 0.5, 0.2), (0.2, 0.6)),
}


@pytest.mark.parametrize("which", list(STEADY))
def test_tangent_of_the_closed_slider_is_exact(which):
    """Against central differences, in all directions of the motion; the period closes from any sample."""
    q = STEADY[which]
    independent_of_the_first_sample(pair(), q, 1e-11)
    problem, y0 = imposed(pair(), q)
    y, step, slip = whole(y0), 1e-6, problem.diagnostics(y0)["slip"]
    assert slip > 4 / SAMPLES if which.startswith("cycle") else 0 < slip <= 2 / SAMPLES
    for e in np.eye(len(y))[:21]:
        sides = [whole(problem.residual(unknowns(problem, y + s * step * e))) for s in (1, -1)]
        found = whole(problem.jacobian_product(y0, unknowns(problem, e)))
        assert np.allclose((sides[0] - sides[1]) / (2 * step), found, rtol=0, atol=2e-9 * np.abs(found).max())


@pytest.mark.parametrize("seed", range(8))
def test_tangent_on_a_bent_path_with_lift_off_is_exact(seed):
    """Random motions that stick, slip on bent paths under a varying load, open and land, against central differences;
    the assembled block too."""
    rng = np.random.default_rng(seed)
    problem, y0 = imposed(pair(), 0.35 * rng.standard_normal((3, 7)))
    y, step, states = whole(y0), 1e-7, problem.diagnostics(y0)
    assert min(states["stick"], states["slip"], states["open"]) > 0
    J = dense(problem.jacobian(y0))
    for dy in rng.standard_normal((4, 24)) * (np.arange(24) < 21):
        sides = [whole(problem.residual(unknowns(problem, y + s * step * dy))) for s in (1, -1)]
        found = whole(problem.jacobian_product(y0, unknowns(problem, dy)))
        assert np.allclose((sides[0] - sides[1]) / (2 * step), found, rtol=0, atol=1e-7 * np.abs(found).max())
        assert np.allclose(J @ dy, found, rtol=0, atol=ROUNDING * np.abs(found).max())


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


def random_map(pairs, n, seed=3):
    return 0.5 * np.random.default_rng(seed).standard_normal((3 * pairs, n))


def random_mode(law, method, seed, n=5):
    """A mode problem of 3 pairs seen through a full B, and a point where they stick, slip and open."""
    rng = np.random.default_rng(seed)
    model = fw.Model(np.eye(n), chain(n), 0.02 * chain(n), [pair(law, random_map(3, n))], MPI.COMM_WORLD)
    start = fw.LinearMode(1.0, 0.0, np.ones(n), np.zeros(n))
    problem = fw.NonlinearMode(model, fw.Harmonics([0, 1, 2], 32), method, 0, start)
    return problem, np.concatenate([0.5 * rng.standard_normal(5 * n), [0.05, 1.1, -0.2]])


def residual_of(problem):
    return lambda y: whole(problem.residual(unknowns(problem, y)))


@pytest.mark.ranks(1, 2, 3)
@pytest.mark.parametrize("method", ["CNM", "EPMC"])
@pytest.mark.parametrize("law", LAWS)
def test_jacobian_of_a_mode_is_exact(law, method):
    """Assembled against the product to rounding, and both against central differences, in stick, slip and lift-off."""
    for seed in range(3):
        problem, y = random_mode(law, method, seed)
        point = unknowns(problem, y)
        contact = problem.diagnostics(point)
        assert min(contact["stick"], contact["slip"], contact["open"]) > 0.01
        J, identity = dense(problem.jacobian(point)), np.eye(len(y))
        product = np.column_stack([whole(problem.jacobian_product(point, unknowns(problem, e))) for e in identity])
        step = 1e-6 if law == "coulomb_3d" else 3e-5  # the former has kinks where a sample changes its state
        difference = np.column_stack([derivative(residual_of(problem), y, e, step) for e in identity])
        assert np.allclose(product, J, rtol=0, atol=LAST_DIGITS * np.abs(J).max())
        assert np.allclose(difference, J, rtol=0, atol=SOLVED * np.abs(J).max())


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


@pytest.mark.parametrize("law", LAWS)
def test_mean_block_is_regular_when_stuck_under_preload(law):
    """DESIGN fact 3: a body held by contact alone. The mean's block is the stuck stiffness, kn and kt, not singular."""
    contact = pair(law, np.vstack([np.eye(3), np.diag([-1.0, 1.0, 1.0])]))
    model = fw.Model(np.eye(3), np.zeros((3, 3)), None, [contact], MPI.COMM_WORLD)
    start = fw.linear_modes(model, 1, "stuck")[0]
    problem = fw.NonlinearMode(model, fw.Harmonics([0, 1], 32), "EPMC", 1, start)
    y = np.zeros(12)
    y[3 + 1], y[-2:] = 1.0, [1.0, np.log(0.1)]
    J = dense(problem.jacobian(unknowns(problem, y)))[0:9:3, 0:9:3]
    k_ref = start.omega**2 / np.sum(start.shape**2)
    assert np.allclose(J * k_ref, 2 * np.diag([KN, KT, KT]), rtol=0, atol=ROUNDING)


def unilateral(comm, highest, samples=1024):
    """REFERENCE: k = 1, kn = 3, m = 1, zero gap, no friction."""
    contact = pair(B=((1.0,), (0.0,), (0.0,)), normal_stiffness=3.0, friction_coefficient=0.0, normal_load=0.0)
    model = fw.Model([[1.0]], [[1.0]], None, [contact], comm)
    return mode_problem(model, range(highest + 1), samples, "EPMC", start="free")


@pytest.mark.parametrize("amplitude", [1e-3, 1.0, 1e3])
def test_unilateral_spring(comm, amplitude):
    """REFERENCE: w = 2 w1 w2/(w1 + w2) = 4/3 at any amplitude, no damping."""
    problem = unilateral(comm, 15)
    state = problem.state(solve_at(problem, amplitude))
    assert state["omega0"] == pytest.approx(4 / 3, abs=1e-7)
    assert abs(state["zeta"]) < ROUNDING


def test_unilateral_spring_converges_with_the_harmonics(comm):
    """Acceleration is continuous, its slope is not: the error of the frequency falls as H^-4 and faster."""
    errors = []
    for highest in (3, 7, 15, 31):
        problem = unilateral(comm, highest, 4096)
        errors.append(abs(problem.state(solve_at(problem, 1.0))["omega0"] - 4 / 3))
    assert (np.log2(np.divide(errors[:-1], errors[1:])) > 4.5).all()
    assert errors[-1] < 3e-9


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("method", ["CNM", "EPMC"])
def test_stuck_mode_is_linear(comm, law, method):
    """No slip, no lift-off: the linear stuck mode, undamped, at every amplitude below the threshold."""
    contact = pair(law, np.random.default_rng(0).standard_normal((3, 4)), normal_load=50.0)
    model = fw.Model(np.eye(4), chain(4), None, [contact], comm)
    start = fw.linear_modes(model, 1, "stuck")[0]
    problem = fw.NonlinearMode(model, fw.Harmonics([0, 1, 2], 64), method, 0, start)
    problem.preload(np.zeros(4), np.asarray(contact.B)[0] * 50.0)
    for amplitude in (1e-3, 0.1, 1.0):
        y = solve_at(problem, amplitude)
        state = problem.state(y)
        assert problem.diagnostics(y)["stick"] == 1
        assert state["omega0"] == pytest.approx(start.omega, rel=TIGHT) and abs(state["zeta"]) < 1e-11


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


#: Parameters at their ends, and which stiffness then holds: shares of (kn, kt).
EXTREMES = {
    "open everywhere": ({"normal_load": 0.0, "gap": 1e3}, (0, 0)),
    "no friction": ({"friction_coefficient": 0.0}, (1, 0)),
    "rough": ({"friction_coefficient": 1e3}, (1, 1)),
    "soft": ({"normal_stiffness": 1e-6, "tangential_stiffness": 1e-6}, (1, 1)),
    "stiff": ({"normal_stiffness": 1e5, "tangential_stiffness": 1e5, "normal_load": 1e6}, (1, 1)),
}


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("which", list(EXTREMES))
def test_extremes_of_the_parameters(comm, law, which):
    """Issue 3. Each keeps one state of contact, so the mode is that linear structure's, undamped."""
    changes, (normal, tangential) = EXTREMES[which]
    contact = pair(law, random_map(1, 4), **changes)
    kn, kt = (normal * contact.parameters["normal_stiffness"], tangential * contact.parameters["tangential_stiffness"])
    stiffness = chain(4, ground=0.1)
    expected = np.sqrt(np.linalg.eigvalsh(stiffness + (contact.B.T * [kn, kt, kt]) @ contact.B)[0])
    model = fw.Model(np.eye(4), stiffness, None, [contact], comm)
    start = fw.linear_modes(model, 1, "stuck")[0]
    problem = fw.NonlinearMode(model, fw.Harmonics([0, 1, 2, 3], 64), "EPMC", 0, start)
    problem.preload(np.zeros(4), contact.B[0] * contact.parameters["normal_load"])
    y = solve_at(problem, 0.2)
    assert problem.state(y)["omega0"] == pytest.approx(expected, rel=REPEATED)
    assert abs(problem.state(y)["zeta"]) < TIGHT and problem.diagnostics(y)["work"] < ROUNDING


@pytest.mark.parametrize("law", LAWS)
def test_contact_without_load_or_gap(comm, law):
    """N0 = 0: scale-free, like the unilateral spring: frequency and damping do not depend on the amplitude."""
    model = fw.Model(np.eye(4), chain(4, ground=0.1), None, [pair(law, random_map(1, 4), normal_load=0.0)], comm)
    problem = mode_problem(model, range(4), 64, "EPMC")
    found = [problem.state(solve_at(problem, a)) for a in (1e-3, 1.0, 1e3)]
    assert found[0]["zeta"] > 0.01
    for state in found[1:]:
        assert state["omega0"] == pytest.approx(found[0]["omega0"], rel=SOLVED)
        assert state["zeta"] == pytest.approx(found[0]["zeta"], rel=REPEATED)


GOOD = {"normal_stiffness": 1.0, "tangential_stiffness": 1.0, "friction_coefficient": 0.3}


@pytest.mark.ranks(1)
@pytest.mark.parametrize("name, value", [("normal_stiffness", 0.0), ("tangential_stiffness", -1.0), ("gap", np.inf)])
def test_bad_parameters_are_refused(name, value):
    with pytest.raises(fw.InputError, match=f"(?s){name}.*out of bounds"):
        fw.Model(np.eye(3), np.eye(3), None, [fw.Contact("coulomb_3d", np.eye(3), {**GOOD, name: value})])
