"""The lumped blisk with its friction ring: closed forms with one harmonic, scaling, and the paper's trends."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg
from models.core_models import solve_at, states
from tolerances import ROUNDING, SOLVED

import fretwave as fw

FILE = Path(__file__).resolve().parents[2] / "cases" / "blisk_lumped" / "model.py"
DIAMETERS, FAMILY = 4, 3


@pytest.fixture(scope="module")
def case():
    spec = importlib.util.spec_from_file_location("blisk_lumped_model", FILE)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def wave(case, comm, orders=(1,), method="CNM", diameters=DIAMETERS, **options):
    """Mode of the disk's family in a travelling wave, and the stuck linear mode."""
    model = case.sector(**options).model(diameters, comm)
    stuck = fw.linear_modes(model, FAMILY)[-1]
    return fw.NonlinearMode(model, fw.Harmonics(orders, 4800), method, 0, stuck), stuck


def reported(problem, start: float, amplitudes):
    """Points at these amplitudes of a branch that starts in full stick. Collective."""
    branch = fw.Continuation(problem, problem.initial(start), (start, 1.1 * max(amplitudes)), report_at=amplitudes)
    points = [p.y for p in branch if p.event == "report"]
    assert branch.converged and len(points) == len(amplitudes), branch.reason
    return points


def stiffness(case, options) -> np.ndarray:
    """Of the wave without contact, from the paper's 3 x 3 matrix and the ring's own."""
    s = 4 * np.sin(np.pi * DIAMETERS / case.SECTORS) ** 2
    K = np.diag([case.GROUND + case.ROOT + s * case.NEIGHBOUR, case.ROOT + case.AEROFOIL, case.AEROFOIL, 0.0])
    K[3, 3] = s * options.ring_coupling
    K[0, 1] = K[1, 0] = -case.ROOT
    K[1, 2] = K[2, 1] = -case.AEROFOIL
    return K


def jenkins(a: float, kt: float, limit: float) -> complex:
    """Complex stiffness of a Jenkins element at relative amplitude a."""
    if a <= limit / kt:
        return complex(kt)
    th = np.arccos(1 - 2 * limit / (kt * a))
    return complex(kt / np.pi * (th - np.sin(2 * th) / 2), 4 * limit / (np.pi * a) * (1 - limit / (kt * a)))


def test_one_harmonic_is_a_linear_wave_with_the_slider_as_complex_spring(case, comm):
    """lambda = i sqrt(eigenvalue) of the 4 x 4 problem with kappa at the relative amplitude that the motion has."""
    options = case.Options()
    problem, stuck = wave(case, comm)
    threshold = case.slip_threshold(options, stuck.omega, DIAMETERS)
    b, M = np.array([1.0, 0, 0, -1.0]), np.diag([case.DISK, case.BLADE, case.TIP, options.ring_mass])
    for y in reported(problem, 0.3 * threshold, [times * threshold for times in (0.5, 1.1, 1.5, 5.0, 50.0)]):
        state, Q = problem.state(y), comm.bcast(problem.coefficients(y))
        relative = np.hypot(*(Q[0] - Q[3]))
        kappa = jenkins(relative, options.contact_stiffness, options.friction * options.normal_load)
        found = 1j * np.sqrt(scipy.linalg.eigvals(stiffness(case, options) + kappa * np.outer(b, b), M))
        value = complex(-state["beta"], state["omega"])
        assert min(abs(found - value)) < 1e-7 * abs(value)


def test_slip_begins_where_the_stuck_ring_needs_the_whole_friction_force(case, comm):
    problem, stuck = wave(case, comm, (1, 3))
    threshold = case.slip_threshold(case.Options(), stuck.omega, DIAMETERS)
    assert threshold == pytest.approx(1.905e-4, rel=1e-3)
    slips = [problem.diagnostics(solve_at(problem, times * threshold))["slip"] for times in (0.9999, 1.001)]
    assert slips[0] == 0 < slips[1]


def test_inertia_of_the_ring_outweighs_its_stiffness(case, comm):
    """The numbers that decide the picture; the stuck frequency lies below the free one."""
    options = case.Options()
    problem, stuck = wave(case, comm)
    free = fw.linear_modes(problem.model, 4, "free")
    assert free[1].frequency_hz == pytest.approx(options.ring_omega / (2 * np.pi), rel=SOLVED)
    assert options.ring_omega / (2 * np.pi) == pytest.approx(437.145, rel=1e-5)
    assert case.ring_stiffness(options, stuck.omega, DIAMETERS) == pytest.approx(-1.126e6, rel=1e-3)
    assert stuck.frequency_hz == pytest.approx(1031.644, rel=1e-6)
    assert free[3].frequency_hz == pytest.approx(1044.519, rel=1e-6)


@pytest.mark.ranks(1)
@pytest.mark.parametrize("method", ["CNM", "EPMC"])
def test_trends_of_the_paper(case, comm, method):
    """Constant, then a drop with rising damping, a maximum, and the frequency rising to the sliding asymptote."""
    model = case.sector().model(DIAMETERS, comm)
    stuck, free = (fw.linear_modes(model, 4, state)[n] for state, n in (("stuck", 2), ("free", 3)))
    problem = fw.NonlinearMode(model, fw.Harmonics((1, 3, 5, 7), 480), method, 0, stuck)
    branch = fw.Continuation(problem, problem.initial(5e-5), (5e-5, 0.05))
    points = [problem.state(p.y) for p in branch]
    assert branch.converged
    omega, zeta = (np.array([p[key] for p in points]) for key in ("omega", "zeta"))
    bottom, peak = int(np.argmin(omega)), int(np.argmax(zeta))
    assert 0 < bottom < peak < len(points) - 1
    assert omega[bottom] < stuck.omega * (1 - 2e-4) and (np.diff(omega[: bottom + 1]) <= SOLVED * omega[0]).all()
    assert (np.diff(omega[bottom : peak + 1]) > 0).all()
    assert omega[-1] == pytest.approx(free.omega, rel=2e-5)
    assert zeta[0] == pytest.approx(0, abs=ROUNDING) and 7.5e-3 < zeta[peak] < 8e-3 and zeta[-1] < 1e-4


@pytest.mark.ranks(1)
def test_friction_scales_amplitudes_and_nothing_else(case, comm):
    """Homogeneous law: the same omega and zeta at the same amplitude over mu N, over a factor 25."""
    found = []
    for mu in (0.06, 0.3, 1.5):
        model = case.sector(friction=mu).model(DIAMETERS, comm)
        problem = fw.NonlinearMode(model, fw.Harmonics((1, 3), 480), "CNM", 0, fw.linear_modes(model, FAMILY)[-1])
        points = states(problem, 5e-4 * mu, (5e-4 * mu, 5e-3 * mu), [1e-3 * mu, 3e-3 * mu])
        found.append([p[key] for p in points for key in ("omega", "zeta")])
    assert found[1] == pytest.approx(found[0], rel=SOLVED) and found[2] == pytest.approx(found[0], rel=SOLVED)


@pytest.mark.ranks(1)
def test_forward_and_backward_waves_are_alike_without_rotation(case, comm):
    found = []
    for diameters in (DIAMETERS, -DIAMETERS, case.SECTORS - DIAMETERS):
        problem, _ = wave(case, comm, (1, 3), diameters=diameters)
        found.append(list(problem.state(reported(problem, 1e-4, [3e-4])[0]).values()))
    assert found[1] == pytest.approx(found[0], rel=SOLVED) and found[2] == pytest.approx(found[0], rel=SOLVED)


def test_the_full_wheel_follows_the_branch_of_one_sector(case, comm):
    """24 sectors, 96 dofs, omega and beta to 1e-8 (1e-11 here) from stick to slip; the unfolding vanishes."""
    sector, h, reports = case.sector(), fw.Harmonics((1, 3), 480), [1e-4, 2.1e-4, 3e-4, 1e-3]
    with sector.model(DIAMETERS, comm) as model, sector.wheel(comm) as wheel:
        stuck = fw.linear_modes(model, FAMILY)[-1]
        start = sector.around(stuck, DIAMETERS)
        one = fw.NonlinearMode(model, h, "CNM", 0, stuck)
        around = fw.NonlinearMode(wheel, h, "CNM", 0, start, "wheel_", start.shape - 1j * start.imaginary)
        for a, b in zip(*(reported(problem, 5e-5, reports) for problem in (one, around))):
            expected, found = one.state(a), around.state(b)
            for key in ("omega", "beta"):
                assert found[key] == pytest.approx(expected[key], abs=1e-11 * expected["omega"])
            assert np.abs(around.unfolding(b)).max() < ROUNDING


def printed(launch, script: str) -> list[list[float]]:
    """Numbers of each line that a script of the case prints."""
    done = launch(1, str(FILE.parent / script), timeout=120)
    assert done.returncode == 0, done.stderr
    return [[float(n) for n in re.findall(r"-?\d+\.?\d*(?:e-?\d+)?", line)] for line in done.stdout.splitlines()]


@pytest.mark.ranks(1)
def test_script_finds_the_limit_cycles_where_friction_takes_what_the_flow_gives(case, comm, launch):
    """The friction's own damping of the wave of four is there what the flow takes from it, 0.2 %."""
    mode, _ = wave(case, comm, range(1, 10, 2))
    friction = fw.follow(mode, 2e-5, 0.1, unknowns=False).at(zeta=2e-3)
    lines = printed(launch, "flutter.py")
    of_four = lines[[line[0] for line in lines].index(4.0) + 1 :][:2]
    assert [len(line) for line in of_four] == [2, 2] and len(friction) == 2
    np.testing.assert_allclose([line[0] for line in of_four], friction["amplitude"], rtol=0.02)
    np.testing.assert_allclose([line[1] for line in of_four], friction["frequency_hz"], rtol=1e-3)
    assert lines[-1][0] == 5.0  # the flow damps this wave: there is none


@pytest.mark.ranks(1)
def test_script_finds_the_peak_of_the_engine_order_on_the_backbone(launch):
    """At 300 N the whole ring slides, and the response peaks where the periodic mode of its amplitude is."""
    *_, (level, amplitude, hz), (mode_hz, zeta) = printed(launch, "engine_order.py")
    assert level == 300.0 and amplitude > 5e-4 and zeta > 0
    assert hz == pytest.approx(mode_hz, rel=1e-4)
