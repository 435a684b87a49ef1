"""Amplitude, frequency and damping per cycle, and modal values read off a folded branch, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from tolerances import ROUNDING

from fretwave.post.cycles import extract, fundamental, peaks
from fretwave.post.mode_curve import ModeCurve
from fretwave.post.response_peaks import (
    amplitude_peak,
    distance,
    located_peak,
    peak_table,
    points_around_peak,
    quadrature,
)

pytestmark = pytest.mark.ranks(1)

OMEGA0, ZETA = 25.0, 0.04
#: samples of a period; the cubic Hermite interpolant between them is off by h^4/384 of the fourth derivative
SAMPLES = 128
INTERPOLATION = 1e-7


def decaying(zeta=ZETA, periods=20):
    beta, omega = zeta * OMEGA0, OMEGA0 * np.sqrt(1.0 - zeta**2)
    t = np.linspace(0.0, periods * 2.0 * np.pi / omega, periods * SAMPLES + 1)
    wave = np.exp((-beta + 1j * omega) * t + 0.3j)
    return t, wave.real, ((-beta + 1j * omega) * wave).real, beta, omega


@pytest.mark.parametrize("zeta", [0.04, 1e-4, -0.02])
def test_decaying_cosine_gives_its_own_amplitude_frequency_and_damping(zeta):
    t, x, v, beta, omega = decaying(zeta)
    cycles = extract(t, x, v)
    assert len(cycles) >= 18
    assert np.allclose(cycles.amplitude, np.exp(-beta * cycles.time), rtol=INTERPOLATION, atol=0.0)
    assert np.allclose(cycles.omega, omega, rtol=INTERPOLATION, atol=0.0)
    assert np.allclose(cycles.zeta, zeta, rtol=0.0, atol=INTERPOLATION)


@pytest.mark.parametrize("zeta", [0.02, 1e-4, -0.02])
@pytest.mark.parametrize("mean", [0.3, -0.999, 40.0])
@pytest.mark.parametrize("guess", [0.9, 1.0, 1.1])
def test_a_cosine_that_decays_about_another_place_gives_the_same(zeta, mean, guess):
    """Its crossings of zero end while it still swings, and before that they drift."""
    t, x, v, beta, omega = decaying(zeta)
    cycles = extract(t, x + mean, v, guess * 2.0 * np.pi / omega)
    assert len(cycles) >= 18
    assert np.allclose(cycles.omega, omega, rtol=INTERPOLATION * max(1.0, abs(mean)))
    assert np.allclose(cycles.zeta, zeta, rtol=0, atol=4.0 * zeta**2 * 1e-2 + 1e-6 * max(1.0, abs(mean)))
    assert np.allclose(cycles.amplitude, np.exp(-beta * cycles.time), rtol=3.0 * zeta**2 + 1e-5)


def test_a_mean_that_fades_with_the_motion_leaves_its_amplitude():
    """As where a contact opens at rest: x = e^(-beta t) (cos(omega t) + 0.5)."""
    t, x, v, beta, omega = decaying(0.02)
    mean = 0.5 * np.exp(-beta * t)
    cycles = extract(t, x + mean, v - beta * mean, 2.0 * np.pi / omega)
    assert np.allclose(cycles.amplitude, np.exp(-beta * cycles.time), rtol=3.0 * 0.02**2)
    assert np.allclose(cycles.zeta[2:-2], 0.02, rtol=1e-3)  # the mean's slope is one-sided at both ends


def test_third_harmonic_does_not_enter_the_amplitude_of_a_steady_motion():
    t = np.linspace(0.0, 10.0, 10 * SAMPLES + 1)
    turn = 2.0 * np.pi * t
    x = np.sin(turn) + 0.1 * np.sin(3.0 * turn)
    v = 2.0 * np.pi * (np.cos(turn) + 0.3 * np.cos(3.0 * turn))
    cycles = extract(t, x, v)
    assert np.allclose(cycles.amplitude, 1.0, rtol=1e-6)
    assert np.allclose(cycles.zeta, 0.0, atol=1e-6)


def test_short_signal_has_no_cycles():
    t = np.linspace(0.0, 0.4, 50)
    assert len(extract(t, np.sin(2.0 * np.pi * t), 2.0 * np.pi * np.cos(2.0 * np.pi * t))) == 0


def coulomb_slider(R=1.0, k=100.0, m=1.0, start=1.0, half_periods=20):
    """Exact free decay of a mass on a spring and a Coulomb slider: half cosines about +-R/k."""
    omega, t, x, v = np.sqrt(k / m), [], [], []
    amplitude, sign = start, 1.0
    tau = np.linspace(0.0, np.pi, SAMPLES + 1)[:-1]
    for n in range(half_periods):
        swing = amplitude - R / k
        t.append((n * np.pi + tau) / omega)
        x.append(sign * (R / k + swing * np.cos(tau)))
        v.append(-sign * swing * omega * np.sin(tau))
        amplitude, sign = swing - R / k, -sign
    return np.concatenate(t), np.concatenate(x), np.concatenate(v)


def test_coulomb_slider_loses_four_R_over_k_per_period():
    t, x, v = coulomb_slider()
    _, values = peaks(t, x, v)
    tops = values[values > 0.0]
    assert np.allclose(np.diff(tops), -4.0 * 1.0 / 100.0, rtol=2e-3)


def test_coulomb_slider_has_frequency_of_the_spring_and_damping_2R_over_pi_k_a():
    t, x, v = coulomb_slider()
    cycles = extract(t, x, v)
    large = cycles.amplitude > 0.6
    # the amplitude falls by 4 R/k over a cycle, so the law for a slow decay holds to (2 R/(k a))^2
    assert np.allclose(cycles.omega[large], 10.0, rtol=5e-3)
    assert np.allclose(cycles.zeta[large], 2.0 / (np.pi * 100.0 * cycles.amplitude[large]), rtol=1e-2)


def test_harmonic_amplitude_is_that_of_the_fundamental():
    phase = 2.0 * np.pi * np.arange(64) / 64
    found = fundamental(0.5 + 3.0 * np.cos(phase + 1.0) + np.sin(3.0 * phase))
    assert found == pytest.approx(3.0 * np.exp(1j), rel=ROUNDING)


def folded(count=400):
    """A curve that turns round twice in amplitude: log a = s + 1.2 sin(s) falls where cos(s) < -1/1.2."""
    s = np.linspace(0.0, 2.0 * np.pi, count)
    log_amplitude = s + 1.2 * np.sin(s)
    omega = 10.0 - s
    return ModeCurve(np.exp(log_amplitude), omega, omega, 0.01 * (s - 2.0)), np.exp(log_amplitude)


def test_a_folded_branch_has_three_values_between_its_folds_and_one_elsewhere():
    curve, amplitude = folded()
    turn = np.arccos(-1.0 / 1.2)
    low, high = (np.exp(s + 1.2 * np.sin(s)) for s in (2.0 * np.pi - turn, turn))
    inside, outside = curve.all_at(float(np.sqrt(low * high))), curve.all_at(float(amplitude[0]) * 2.0)
    assert [len(inside), len(outside)] == [3, 1]
    assert curve.at(float(np.sqrt(low * high)), falling=True).omega == inside[-1].omega < inside[0].omega
    assert curve.at(float(amplitude[-1]) * 2.0).sheets == 0


def test_values_between_points_follow_the_curve():
    curve, _ = folded()
    s = 0.7
    value = curve.at(float(np.exp(s + 1.2 * np.sin(s))))
    assert value.omega == pytest.approx(10.0 - s, rel=1e-6)


def test_zero_of_the_damping_is_found_and_stable_where_damping_grows():
    curve, _ = folded()
    (crossing,) = curve.crossings()
    assert crossing.amplitude == pytest.approx(np.exp(2.0 + 1.2 * np.sin(2.0)), rel=1e-4)
    assert crossing.stable


@pytest.mark.parametrize("seed", range(40))
def test_what_is_met_at_a_point_is_met_once(seed):
    """Rounding had two cycles at one, or two sheets at an amplitude of the table and none at its ends."""
    draw = np.random.default_rng(seed)
    amplitude = np.sort(10.0 ** draw.uniform(-2.0, 0.0, 9))
    amplitude[4] = amplitude[3] * (1.0 + 1e-6) if seed % 2 else amplitude[4]
    zeta, omega = np.sort(draw.uniform(-0.02, 0.02, 9)), draw.uniform(24.0, 26.0, 9)
    curve = ModeCurve(amplitude, omega, omega, zeta - zeta[4])
    (crossing,) = curve.crossings()
    assert crossing.amplitude == pytest.approx(amplitude[4], rel=ROUNDING)
    values = [curve.at(one) for one in amplitude]
    assert [value.sheets for value in values] == [1] * len(amplitude)
    assert [value.omega for value in values] == pytest.approx(omega, rel=ROUNDING)
    assert [len(curve.amplitudes_at(one)) for one in zeta - zeta[4]] == [1] * len(zeta)


def linear_response(zeta=0.02, omega0=25.0, count=401):
    top = omega0 * np.sqrt(1.0 - 2.0 * zeta**2)
    omega = np.sort(np.append(np.linspace(20.0, 30.0, count - 1), top))  # with its peak, as a branch has it
    q = 1.0 / (omega0**2 - omega**2 + 2j * zeta * omega0 * omega)
    event = np.where(omega == top, "peak", "")
    return {"level": np.ones(count), "omega": omega, "amplitude": np.abs(q), "phase": np.angle(q), "event": event}


def test_linear_resonance_peaks_at_the_resonance_frequency_and_is_in_quadrature_at_omega0():
    response = linear_response()
    peak = located_peak(response["omega"], response["amplitude"], response["event"])
    blade = amplitude_peak(response["omega"][::2], response["amplitude"][::2])
    turn = quadrature(response["omega"], response["amplitude"], response["phase"])
    assert peak.omega == pytest.approx(25.0 * np.sqrt(1.0 - 2.0 * 0.02**2), rel=1e-5)
    assert blade.omega == pytest.approx(peak.omega, rel=1e-5)
    assert peak.amplitude == pytest.approx(1.0 / (2.0 * 0.02 * np.sqrt(1.0 - 0.02**2) * 625.0), rel=1e-5)
    assert turn.omega == pytest.approx(25.0, rel=1e-5)


@pytest.mark.parametrize("step", [0.05, 0.2, 0.5])
def test_a_peak_read_off_between_points_states_its_error(step):
    """Of 1/a^2 = 1 + x^2 + 0.3 x^3 + 0.1 x^4, whose peak is 1 at x = 0: within a factor of 3 of the true one."""
    omega = 10 + step * (np.arange(-4, 5) + 0.37)
    x = omega - 10
    peak = amplitude_peak(omega, (1 + x**2 + 0.3 * x**3 + 0.1 * x**4) ** -0.5)
    assert 1 / 3 < peak.error / abs(peak.amplitude - 1) < 3
    assert np.isnan(amplitude_peak(omega[3:6], (1 + x[3:6] ** 2) ** -0.5).error), "no fourth point tells"


def test_peak_at_the_end_of_the_range_is_no_peak():
    nowhere = located_peak(np.arange(5.0), np.arange(5.0), np.array(["", "peak", "", "", ""]))
    assert np.isnan(nowhere.omega)
    assert np.isnan(amplitude_peak(np.arange(5.0), np.arange(5.0)).omega)


def test_peaks_of_a_linear_oscillator_lie_on_its_backbone():
    amplitude = np.geomspace(1e-3, 1.0, 20)
    omega = np.full(20, 25.0 * np.sqrt(1.0 - 0.02**2))
    mode = ModeCurve(amplitude, omega, np.full(20, 25.0), np.full(20, 0.02))
    response = linear_response()
    table = peak_table({**response, "amplitude_error": 0.01 * response["amplitude"]}, {"mode": mode})
    assert table["amplitude_error"] == pytest.approx(0.01 * table["amplitude"])
    # the largest amplitude is at omega0 sqrt(1 - 2 zeta^2), the damped frequency at omega0 sqrt(1 - zeta^2)
    assert table["distance_mode"][0] == pytest.approx(-0.5 * 0.02**2, rel=0.05)
    assert abs(table["quadrature_distance_mode"][0]) < 1e-5
    assert np.isnan(distance(amplitude_peak(np.arange(5.0), np.arange(5.0)), mode, False))


def test_time_points_are_spread_over_the_resonance_and_contain_the_peak():
    response = linear_response()
    chosen = points_around_peak(response["amplitude"], response["omega"], 3)
    assert len(chosen) == 3
    assert int(np.argmax(response["amplitude"])) in chosen
    assert (response["amplitude"][chosen] >= 0.9 * response["amplitude"].max()).all()


@pytest.mark.ranks(1)
def test_undamped_stretch_is_no_limit_cycle():
    """Damping that is rounding while the contact sticks has no sign; a real change of sign is found."""
    amplitude, omega = np.geomspace(1e-5, 1e-3, 21), np.full(21, 25.0)
    zeta = np.where(np.arange(21) < 8, -1e-21 * np.arange(21), 1e-4 * (np.arange(21) - 7.5))
    assert ModeCurve(amplitude, omega, omega, zeta).crossings() == []
    zeta[15:] = -1e-4
    (crossing,) = ModeCurve(amplitude, omega, omega, zeta).crossings()
    assert amplitude[14] < crossing.amplitude < amplitude[15] and not crossing.stable
