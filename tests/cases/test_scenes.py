"""The judge of cases/scenes against closed forms, its own ability to say wrong, and the short list of scenes."""

from __future__ import annotations

import contextlib
import dataclasses
import io
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from command_line import call
from tolerances import ROUNDING

sys.path.insert(0, str(Path(__file__).parents[2] / "cases"))

from oracle import forces  # noqa: E402
from scenes import laws, list_random, pads, path  # noqa: E402
from scenes.circle import Slider, rate  # noqa: E402
from scenes.circle import waves as all_waves
from scenes.closed import jenkins_stiffness  # noqa: E402
from scenes.distance import Distance, distance  # noqa: E402
from scenes.equations import Contact, Equations  # noqa: E402
from scenes.judge import Run, errors  # noqa: E402
from scenes.run import all_scenes, one  # noqa: E402
from scenes.scene import Finished, Scene, write  # noqa: E402
from scenes.structures import mode  # noqa: E402

pytestmark = pytest.mark.ranks(1)
PAD = {
    "normal_stiffness": 2.0,
    "tangential_stiffness": 1.0,
    "friction_coefficient": 0.5,
    "normal_load": 2.0,
    "gap": 0.0,
}


def waves(tau):
    return np.array([np.ones_like(tau), np.cos(tau), np.sin(tau)]).T


def test_a_jenkins_element_has_its_complex_stiffness():
    for kt, limit, a in ((1.0, 1.0, 2.0), (1e10, 1.0, 0.3), (2.0, 3.0, 1.0)):
        motion, rate = np.array([[0], [a], [0]], complex), np.array([[0], [0], [-a]], complex)
        force = laws.jenkins(motion, rate, kt, limit, waves)[:, 0] / np.pi
        stiffness = (force[1] - 1j * force[2]) / a
        assert stiffness == pytest.approx(jenkins_stiffness(kt, limit, a), rel=1e-9, abs=1e-14 * kt)
        assert abs(force[0]) < 1e-9 * limit
    assert jenkins_stiffness(1.0, 1.0, 2.0) == pytest.approx(0.5 + 0.318310j, abs=1e-6)


def pad(Q, law=PAD, varied=0.0, rest=(0.0, 0.0)):
    """Coefficients of the force (3, m) for those of a motion; imaginary parts: the derivative along `varied`."""
    Q = np.asarray(Q, float)
    f = pads.coulomb_3d((Q + 1e-30j * varied)[..., None], law, list(range(Q.shape[1] // 2 + 1)), rest)[..., 0] / np.pi
    f[:, 0] /= 2
    return f.real + 1j * f.imag / 1e-30


def test_tanh_is_its_closed_forms_from_linear_to_coulomb():
    """mu N / eps times v for small v; 4 mu N / pi of Coulomb less (pi eps)^2 / 24 of it; a double zero goes through."""
    for eps in (1e3, 1e-4, 1e-8):
        force = laws.regularised_coulomb(np.array([[0.0], [1.0], [0.0]], complex), 3.0, eps, waves)[:, 0] / np.pi
        exact = 3.0 / eps if eps > 1 else 12 / np.pi * (1 - (np.pi * eps) ** 2 / 24)
        assert force.real == pytest.approx([0, exact, 0], abs=1e-6 * exact if eps > 1 else ROUNDING)
    v = np.array([[0.3], [1.0], [0.4]])
    dv, n = np.array([[0.2], [-0.3], [1.0]]), 1 << 14
    tau = 2 * np.pi * np.arange(n) / n
    for eps in (0.5, 0.02):  # sampling converges exponentially
        force = laws.regularised_coulomb(v + 1e-30j * dv, 2.0, eps, waves)[:, 0]
        at = (waves(tau) @ v)[:, 0] / eps
        sampled = (
            2
            * np.pi
            / n
            * waves(tau).T
            @ np.stack([2 * np.tanh(at), 2 * (waves(tau) @ dv)[:, 0] / eps / np.cosh(at) ** 2], 1)
        )
        np.testing.assert_allclose(force.real, sampled[:, 0], atol=ROUNDING)
        np.testing.assert_allclose(force.imag / 1e-30, sampled[:, 1], atol=1e-9)


def test_coulomb_in_three_dimensions_on_a_straight_path_is_a_jenkins_element():
    Q = np.zeros((3, 7))
    Q[1, 1:], Q[2, 1:] = (c * np.array([3.0, 0.5, 0.0, 0.7, -0.4, 0.0]) for c in (0.6, 0.8))
    u = (Q[1] / 0.6)[:, None].astype(complex)
    line = laws.jenkins(u, rate([0, 1, 2, 3], u[:, 0])[:, None], 1.0, 1.0, lambda t: all_waves([0, 1, 2, 3], t))
    line = line[:, 0].real / np.pi / np.r_[2.0, np.ones(6)]
    np.testing.assert_allclose(pad(Q).real, [[2.0, *np.zeros(6)], 0.6 * line, 0.8 * line], atol=ROUNDING)


@pytest.mark.parametrize("kt", [1.0, 1e3, 1e9])
def test_a_circle_lags_by_its_closed_form(kt):
    """T = R e^{i (tau + psi)}, cos psi = R / (kt a), R = 1: from R phi' = u' . e_phi with phi' = 1."""
    Q = np.array([[0.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 2.0]])
    T = np.exp(1j * np.arccos(0.5 / kt))
    exact = [[2.0, 0, 0], [0, T.real, -T.imag], [0, T.imag, T.real]]
    np.testing.assert_allclose(pad(Q, PAD | {"tangential_stiffness": kt}).real, exact, atol=ROUNDING)


BENT = np.array([[0.2, 1.0, 0.3, 0.2, -0.3], [0.0, 1.0, 0.5, -0.4, 0.3], [0.1, -0.4, 1.2, 0.3, 0.2]])


@pytest.mark.parametrize(
    "kt, load, rest",
    [
        (2.0, 0.0, 0.0),  # lifts off, lands in stick and slips
        (2.0, 0.9, 0.0),
        (1e4, 1.6, 0.0),  # lands in slip
        (3.0, 3.0, 0.0),  # never lifts off, slips
        (1e9, 4.0, 0.0),
        (3.0, 12.0, 3.0),  # nothing slips from the point of one disc, or of two, that is nearest to rest
        (3.0, 9.5, 0.5),
        (3.0, 50.0, 0.0),
    ],
)
def test_friction_on_a_bent_path_is_that_of_the_exact_oracle_and_its_derivative_is_right(kt, load, rest):
    p, rest = PAD | {"tangential_stiffness": kt, "normal_load": load}, (rest, 0.3 * rest)
    varied = np.random.default_rng(0).standard_normal(BENT.shape)
    found = pad(BENT, p, varied, rest)
    if kt < 10:  # the oracle takes seconds for stiff ones
        exact = forces(BENT, p["normal_stiffness"], kt, 0.5, load, rest=rest, harmonics=2)
        np.testing.assert_allclose(found.real, exact, atol=1e-10 * abs(exact).max())
    h = 1e-6
    difference = (pad(BENT + h * varied, p, rest=rest) - pad(BENT - h * varied, p, rest=rest)).real / (2 * h)
    np.testing.assert_allclose(found.imag, difference, atol=1e-6 * abs(difference).max())


def test_a_slider_that_hardly_creeps_is_closed_and_tends_to_where_nothing_slips():
    """Below the load at which all discs begin to have a common point the force goes there linearly, in few periods."""
    Q = np.array([[0.2, 0.3, 0.1, 0.05, -0.1], [0.0, 1.0, 0.1, -0.4, 0.1], [0.1, -0.1, 1.0, 0.1, 0.4]])
    law = {"normal_stiffness": 1.0, "tangential_stiffness": 1.0, "friction_coefficient": 0.5, "gap": 0.0}

    def stands(load):
        path = np.stack([Q[1], Q[2], 0.5 * (Q[0] + load * np.eye(5)[0])])
        return pads.common_point(Slider([0, 1, 2], path, False), np.zeros(2))[0] is not None

    low, high = 1.0, 10.0
    for _ in range(50):
        middle = (low + high) / 2
        low, high = (low, middle) if stands(middle) else (middle, high)
    at = pad(Q, law | {"normal_load": high}).real
    off = [abs(pad(Q, law | {"normal_load": high * (1 - e)}).real - at).max() for e in (1e-4, 1e-6, 1e-8)]
    assert off[0] / off[1] == pytest.approx(100, rel=0.1) and off[1] / off[2] == pytest.approx(100, rel=0.1)


def test_a_pad_that_lifts_off_has_no_force_and_reaches_the_unilateral_spring():
    c = np.arccos(-1 / 3)  # contact of max(0, 2 + 6 cos tau) until there
    Q = np.zeros((3, 3))
    Q[0, 1] = 3.0
    exact = [2 / np.pi * c + 6 / np.pi * np.sin(c), 4 / np.pi * np.sin(c) + 6 / np.pi * (c + np.sin(2 * c) / 2), 0.0]
    np.testing.assert_allclose(pad(Q).real, [exact, np.zeros(3), np.zeros(3)], atol=ROUNDING)
    assert not pad(Q, PAD | {"normal_load": -7.0}).any()


def test_a_stop_is_its_closed_form_to_rounding():
    """k max(0, cos tau - cos c): k / pi (sin c - c cos c), k / pi (c - sin c cos c); complex steps: dF/da, twice D."""

    for c in (1e-3, 0.3, 1.5, 3.0):
        a = np.array([[0.0], [1.0 + 1e-30j], [0.0]])
        mean, first, other = laws.stop(a, 3.0, -3.0 * np.cos(c), waves)[:, 0] / np.pi
        assert mean.real == pytest.approx(6 / np.pi * (np.sin(c) - c * np.cos(c)), rel=ROUNDING, abs=1e-15)
        assert first.real == pytest.approx(3 / np.pi * (c - np.sin(c) * np.cos(c)), rel=ROUNDING, abs=1e-15)
        assert first.imag / 1e-30 == pytest.approx(3 / np.pi * (c + np.sin(c) * np.cos(c)), rel=1e-9)
        assert other.real == pytest.approx(0, rel=ROUNDING, abs=1e-15)
    for load in (7.0, -7.0):  # closed all the time, and never
        force = laws.stop(np.array([[0.5], [1.0], [0.0]], complex), 3.0, load, waves)[:, 0] / np.pi
        np.testing.assert_allclose(force, [2 * load + 3.0, 3.0, 0.0] if load > 0 else 0, atol=1e-14)


def test_a_stuck_pad_moved_by_less_than_its_load_s_last_digits_is_linear():
    Q = 1e-17 * np.array([[3.0, 1.0, -2.0], [0.0, 2.0, 1.0], [0.0, 0.5, -1.0]])
    force = pad(Q, PAD | {"normal_load": 2e3}).real
    np.testing.assert_allclose(force[:, 1:], np.diag([2.0, 1.0, 1.0]) @ Q[:, 1:], rtol=ROUNDING)
    assert force[0, 0] == pytest.approx(2e3, rel=ROUNDING)


def test_a_slider_in_shakedown_rests_on_the_point_nearest_to_its_start():
    centres = np.array([[1.0, 0.0], [0.0, 1.0], [0.5, 0.5]])
    at = pads.nearest_common(centres, np.array([0.9, 0.9, 5.0]), np.zeros(2))
    gap = np.linalg.norm(at - centres[:2], axis=1)
    np.testing.assert_allclose(gap, 0.9, atol=ROUNDING)
    assert np.linalg.norm(at) < np.linalg.norm([0.5, 0.5])


def scene(law: str) -> Scene:
    if law == "coulomb_3d":
        contact = Contact("pad", law, np.eye(3), PAD)
        K = np.array([[3.0, 0.4, 0.1], [0.4, 1.0, 0.2], [0.1, 0.2, 1.5]])
        return Scene("", law, np.eye(3), K, [contact], mode(), preload=True)
    limits = {"friction_limit": 1.0}
    limits |= {"tangential_stiffness": 2.0} if law == "jenkins" else {"regularisation_velocity": 0.1}
    K = np.array([[3.0, -1.0], [-1.0, 2.0]])
    return Scene("", law, np.eye(2), K, [Contact("damper", law, np.array([[0.0, 1.0]]), limits)], mode())


def solved(law: str, method: str, amplitude: float) -> tuple[Equations, tuple]:
    """A solution that the judge itself finds from a linear mode."""
    s = scene(law)
    orders = [0, 1, 2, 3] if law == "coulomb_3d" else [1, 3]
    eq = Equations(s.M, s.K, s.C, s.contacts, orders, method, 0, None, True)
    stuck = np.asarray(s.K, float) + sum(np.asarray(c.B).T @ (c.stuck()[:, None] * c.B) for c in s.contacts)
    square, shapes = np.linalg.eigh(stuck)
    Q = np.zeros((len(s.M), eq.m))
    Q[:, eq.column[1]] = amplitude * shapes[:, 0] / shapes[0, 0]
    found = distance(eq, Q, 0.01, np.sqrt(square[0]))
    assert found.found
    return eq, found.solution


LAWS = pytest.mark.parametrize("law", ["regularised_coulomb", "jenkins", "coulomb_3d"])
METHODS = pytest.mark.parametrize("method", ["CNM", "EPMC"])


@LAWS
@METHODS
def test_the_jacobian_is_the_residuals_derivative(law, method):
    eq, (Q, beta, omega) = solved(law, method, 2.0)
    rng = np.random.default_rng(0)
    dQ, h = rng.standard_normal(Q.shape), 1e-7

    def residual(x):
        return eq.residual(Q + x * dQ, beta + 0.3 * x, omega + 0.7 * x)[0].ravel()

    difference = (residual(h) - residual(-h)) / (2 * h)
    exact = eq.linearise((Q, beta, omega))[2] @ np.r_[dQ.ravel(), 0.3, 0.7]
    np.testing.assert_allclose(difference, exact, atol=1e-5 * abs(exact).max())


def table(eq: Equations, method: str, states: list[tuple]) -> Run:
    Q, beta, omega = (np.array(x) for x in zip(*states))
    w0 = omega if method == "EPMC" else np.hypot(beta, omega)
    k = eq.column[1]
    columns = {
        "amplitude": np.hypot(Q[:, eq.dof, k], Q[:, eq.dof, k + 1]),
        "omega": omega if method == "CNM" else np.sqrt(omega**2 - beta**2),
        "omega0": w0,
        "frequency_hz": omega / 2 / np.pi,
        "beta": beta,
        "zeta": beta / w0,
        "residual": np.zeros(len(Q)),
        "event": np.array([""] * len(Q)),
    }
    return Run(scene("jenkins"), columns, Q, eq, method)


@LAWS
@METHODS
def test_a_right_point_is_right_and_one_off_by_a_thousandth_is_wrong(law, method):
    eq, (Q, beta, omega) = solved(law, method, 2.0)
    assert beta > 1e-3
    run = table(
        eq, method, [(Q, beta, omega), (Q, beta * 1.001, omega), (Q, beta, omega * 1.001), (Q * 1.001, beta, omega)]
    )
    assert not errors(run, 0, distance(eq, *run.state(0)))
    assert any("zeta" in text for text in errors(run, 1, distance(eq, *run.state(1))))
    assert any("omega" in text for text in errors(run, 2, distance(eq, *run.state(2))))
    assert errors(run, 3, distance(eq, *run.state(3)))


@LAWS
def test_the_sparse_step_is_the_dense_one(law, monkeypatch):
    eq, (Q, beta, omega) = solved(law, "CNM", 2.0)
    off = (Q, beta * 1.0001, omega)
    dense = distance(eq, *off)
    monkeypatch.setattr("scenes.distance.DENSE", 0)
    sparse = distance(eq, *off)
    assert dense.zeta > 1e-7 and sparse.zeta == pytest.approx(dense.zeta, rel=1e-3)
    assert sparse.motion == pytest.approx(dense.motion, rel=1e-3)


def test_a_friction_force_left_over_by_a_stiff_slider_is_wrong():
    """Stuck at 1e14 N/m, the whole limit of 10 N is 1e-13 m times the stuck stiffness: small only in that scale."""
    contact = Contact("damper", "jenkins", np.array([[1.0]]), {"tangential_stiffness": 1e14, "friction_limit": 10.0})
    eq = Equations(np.eye(1), 1e6 * np.eye(1), None, [contact], [1], "EPMC")
    a = 1e-4
    exact = 1e6 + jenkins_stiffness(1e14, 10.0, a)
    w, zeta = np.sqrt(exact.real), exact.imag / exact.real / 2
    right = distance(eq, np.array([[a, 0.0]]), zeta * w, w)
    wrong = distance(eq, np.array([[a, 0.0]]), 0.59 * zeta * w, w)
    # the least change is shared with the amplitude
    assert right.zeta < 1e-6 * zeta and wrong.zeta == pytest.approx(0.41 * zeta, rel=1e-2)


def circle(angles):
    """A table whose branch runs on a circle of amplitude and frequency."""
    eq = Equations(np.eye(1), np.eye(1), None, [], [1], "CNM")
    return table(eq, "CNM", [(np.array([[np.exp(np.sin(x)), 0.0]]), 0.1, 2 + np.cos(x)) for x in angles])


def test_a_branch_that_retraces_itself_and_one_that_stops_early_are_wrong():
    out, back = np.arange(0.0, 1.5, 0.1), np.arange(1.43, 0.0, -0.1)
    assert not path.retraced(circle(np.r_[out]))
    assert path.retraced(circle(np.r_[out, back]))
    run = dataclasses.replace(
        circle(out), scene=dataclasses.replace(scene("jenkins"), analysis=mode(amplitude=(1.0, 5.0)))
    )
    assert any("ends at" in line for line in path.complaints(run))


def test_a_table_that_goes_over_to_another_branch_jumps(monkeypatch):
    """Two lines omega = 2 and omega = 3, to the nearer of which every point is corrected."""

    def nearer(eq, Q, beta, omega):
        return Distance(0, 0, 0, 0, True, (Q, beta, 2.0 if omega < 2.5 else 3.0))

    monkeypatch.setattr(path, "distance", nearer)
    eq = Equations(np.eye(1), np.eye(1), None, [], [1], "CNM")
    states = [(np.array([[a, 0.0]]), 0.0, 2.0 if a < 1.35 else 3.0) for a in np.arange(1.0, 2.0, 0.1)]
    assert any("between rows 3 and 4" in line for line in path.jumps(table(eq, "CNM", states)))
    assert not path.jumps(table(eq, "CNM", states[:4]))


def test_a_table_with_values_that_cannot_be_is_wrong():
    run = circle(np.arange(0.0, 1.0, 0.1))
    assert not path.values(run)
    for name, value in (("zeta", np.nan), ("omega", -1.0), ("amplitude", np.inf), ("amplitude", 2.0)):
        broken = dataclasses.replace(run, columns={k: v.copy() for k, v in run.columns.items()})
        broken.columns[name][3] = value
        assert path.values(broken)


def run_here(scene: Scene, folder: Path) -> Finished:
    """`fretwave run` on a scene in this process; what it prints is told by its files."""
    begin, said = time.perf_counter(), io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        code = call("run", write(scene, folder), "--no-plots", "--out", folder / "out")
    return Finished(code, time.perf_counter() - begin, said.getvalue(), folder / "out")


@pytest.mark.parametrize("name", [s.name for s in all_scenes() if s.quick])
def test_scene(name, tmp_path):
    verdict = one(next(s for s in all_scenes() if s.name == name), tmp_path, run_here)
    assert verdict.word == "right", verdict.reasons


def test_a_scene_in_a_process_of_its_own(tmp_path):
    """As the list is run: with a limit on its processor time."""
    verdict = one(next(s for s in all_scenes() if s.quick and s.twin is None), tmp_path)
    assert verdict.word == "right", verdict.reasons


def test_a_window_that_ends_on_a_corner_is_right_at_its_amplitude(tmp_path):
    """A pad slips by 1e-8 of its arm, too little to tell its mean by: the nearest solution lies at another amplitude,
    where zeta is 5 % off."""
    corner = next(scene for scene in list_random.mixed(60, 47) if scene.name == "47_5_pad_tanh")
    window = {**corner.analysis, "amplitude": [1.145634e-6, 1.14565662e-6]}
    verdict = one(dataclasses.replace(corner, analysis=window), tmp_path, run_here)
    assert verdict.word == "right", verdict.reasons


def test_the_list_is_long_and_covers_every_axis():
    scenes = all_scenes()
    assert len(scenes) >= 150 and len({s.axis for s in scenes}) >= 12
