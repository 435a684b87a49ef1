"""What becomes of motions, by the amplitudes of their cycles: linear and van der Pol oscillators in closed form."""

from __future__ import annotations

import numpy as np
import pytest

import fretwave as fw
from fretwave.post.cycles import Cycles, extract
from fretwave.post.decays import DIVERGES, FALLS, KEPT, LEAVES, LIMIT_CYCLE, NOT_SETTLED, Ending, compare, ending
from fretwave.post.mode_curve import Crossing
from fretwave.post.settling import growth_trend, has_settled
from fretwave.solve.steady import free_motion

pytestmark = pytest.mark.ranks(1)
OMEGA = 25.0
TOLERANCE = 1e-10
#: relative noise of the cycles of a motion with friction that has settled: it lies between samples
SAMPLED = 1e-5


def cycles_of(amplitude: np.ndarray) -> Cycles:
    n = len(amplitude)
    return Cycles(0.25 * np.arange(n), np.asarray(amplitude), np.full(n, OMEGA), np.full(n, np.nan))


def end_of(amplitude: np.ndarray, stopped: bool = False, **known) -> Ending:
    return ending(cycles_of(amplitude), stopped, tolerance=TOLERANCE, **known)


def linear(zeta: float, count: int) -> np.ndarray:
    """a e^{-beta t}, cycle by cycle."""
    return np.asarray(np.exp(-2.0 * np.pi * zeta * np.arange(count)))


def van_der_pol(start: float, rate: float, count: int) -> np.ndarray:
    """Averaged, with a limit cycle at 1: growth of log a per cycle is rate (1 - a^2)."""
    return np.asarray(1.0 / np.sqrt(1.0 + (start**-2 - 1.0) * np.exp(-2.0 * rate * np.arange(count))))


def noise(count: int, size: float = SAMPLED) -> np.ndarray:
    return 1.0 + size * np.random.default_rng(1).uniform(-1.0, 1.0, count)


@pytest.mark.parametrize("zeta", [1e-5, -1e-5, 1e-6, -1e-6, 1.5e-5, 1e-7])
@pytest.mark.parametrize("count", [40, 200, 1000])
def test_slow_linear_motions_never_settle(zeta, count):
    """Over ten cycles a zeta of 1.6e-5 is 1e-3 in amplitude."""
    found = end_of(linear(zeta, count))
    assert found.text == NOT_SETTLED
    assert found.zeta == pytest.approx(zeta, rel=1e-6)


@pytest.mark.parametrize("zeta", [1e-5, -1e-5, 3e-6])
@pytest.mark.parametrize("count", [200, 1000])
def test_noise_hides_no_slow_motion_that_goes_further(zeta, count):
    assert end_of(linear(zeta, count) * noise(count)).text in (NOT_SETTLED, KEPT)
    assert end_of(linear(zeta, 1000) * noise(1000)).text == NOT_SETTLED


@pytest.mark.parametrize("periods", [5.0, 16.0, 30.0, 80.0])
@pytest.mark.parametrize("gone", [1e-4, 2e-3, 5e-3])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_motion_that_grows_away_from_the_beginning_has_not_settled(periods, gone, sign):
    """It grows away by a factor of e in so many periods: its own curvature is no swing."""
    amplitude = 1.0 + sign * gone * np.exp((np.arange(300) - 299) / periods)
    assert not any(end_of(amplitude[:count]).text == LIMIT_CYCLE for count in range(290, 301))


@pytest.mark.parametrize("start", [0.1, 0.5, 0.9, 2.0])
@pytest.mark.parametrize("size", [0.0, SAMPLED])
def test_a_motion_settles_when_less_than_the_tolerance_is_to_come(start, size):
    """0.1 a cycle: what remains falls by e^-0.2 each."""
    amplitude = van_der_pol(start, 0.1, 200) * noise(200, size)
    assert end_of(amplitude).text == LIMIT_CYCLE and abs(end_of(amplitude).amplitude - 1.0) < 2e-5
    verdicts = [end_of(amplitude[:count]).text == LIMIT_CYCLE for count in range(12, 200)]
    settled = 12 + verdicts.index(True)
    assert abs(amplitude[settled - 1] - 1.0) < 1e-3 and all(verdicts[settled - 12 :])
    assert abs(amplitude[settled - 12] - 1.0) > 1e-4, "no later than needed"


@pytest.mark.parametrize("cycles", [3.3, 17.0, 28.0, 60.0, 110.0])
@pytest.mark.parametrize("size, text", [(4e-7, LIMIT_CYCLE), (1e-4, LIMIT_CYCLE), (4e-3, NOT_SETTLED)])
def test_a_swing_that_does_not_grow_is_judged_by_its_size(cycles, size, text):
    """Of a motion at its cycle whose 64 samples drift along the period: 4e-7, over 28 cycles."""
    phases = np.arange(0.0, 2.0 * np.pi, 0.2)
    wave = size * np.sin(2.0 * np.pi * np.arange(400) / cycles + phases[:, None])
    assert [end_of(van_der_pol(0.8, 0.1, 400) * np.exp(one)).text for one in wave] == [text] * len(wave)


@pytest.mark.parametrize("rate", [0.005, 0.01, 0.03, 0.1, 0.3])
@pytest.mark.parametrize("size", [1e-5, 1e-4, 1e-3])
def test_a_motion_that_leaves_an_unstable_cycle_has_not_settled(rate, size):
    """log a = d e^(rate n), grown to `size`, after it came there from elsewhere."""
    grown = size * np.exp(rate * np.arange(-399, 1))
    assert end_of(np.exp(grown)).text != LIMIT_CYCLE
    assert end_of(np.exp(grown + 0.3 * np.exp(-0.2 * np.arange(400)))).text == NOT_SETTLED


@pytest.mark.parametrize("start", [0.5, 0.9, 1.2])
def test_a_slow_van_der_pol_oscillator_far_from_its_cycle_has_not_settled(start):
    """The last ten cycles agree to 1e-3, the cycle is 10 % to 50 % away."""
    amplitude = van_der_pol(start, 5e-5, 200)
    assert np.ptp(amplitude[-10:]) < 1e-3
    found = end_of(amplitude, crossings=[Crossing(1.0, OMEGA, True)])
    assert found.text == NOT_SETTLED and np.sign(found.zeta) == np.sign(start - 1.0)


def test_a_spiral_into_the_cycle_settles_and_does_not_before():
    n = np.arange(200)
    amplitude = 1.0 + 0.1 * np.exp(-0.05 * n) * np.cos(2 * np.pi * n / 8.5)
    assert end_of(amplitude).text == LIMIT_CYCLE
    before = end_of(amplitude[:60])
    assert before.text == NOT_SETTLED and np.isnan(before.zeta) and 0.005 < before.spread < 0.02


@pytest.mark.parametrize("amplitude", [linear(0.0, 100), linear(1e-10, 100), noise(100, 1e-7)])
def test_a_motion_that_never_moved_is_a_limit_cycle_only_where_one_is_predicted(amplitude):
    assert end_of(amplitude).text == KEPT
    assert end_of(amplitude, crossings=[Crossing(2.0, OMEGA, True)]).text == KEPT
    assert end_of(amplitude, crossings=[Crossing(1.01, OMEGA, True)]).text == LIMIT_CYCLE
    assert end_of(amplitude, crossings=[Crossing(1.0, OMEGA, False), Crossing(0.2, OMEGA, True)]).text == KEPT


def test_growth_diverges_unless_it_slows_down():
    """A motion that feeds on a cubic force settles at 1: at 0.3 its growth has lost a tenth."""
    settling = van_der_pol(0.01, 0.1, 100)
    settling = settling[settling < 0.3]
    assert growth_trend(np.log(settling), TOLERANCE) == -1
    assert growth_trend(np.log(linear(-0.02, 50)), TOLERANCE) == 0
    friction = 0.5 + 0.5 * np.exp(0.1 * np.arange(50))  # da/dn = 0.1 (a - 0.5): fed, less the loss of dry friction
    assert growth_trend(np.log(friction[:20]), TOLERANCE) == 1
    assert growth_trend(np.log(friction[:20] - 0.6), TOLERANCE) == -1  # 0.1 (a + 0.1)
    assert end_of(settling, stopped=True).text == LEAVES
    assert end_of(linear(-0.02, 50), stopped=True).text == DIVERGES


def test_beyond_the_mode_nothing_is_known():
    growing = van_der_pol(0.01, 0.1, 30)
    assert growing[-1] > 0.15
    assert end_of(growing, reach=0.1).text == LEAVES
    assert end_of(growing, reach=1.0).text == NOT_SETTLED
    assert end_of(van_der_pol(0.01, 0.1, 200), reach=0.1).text == LIMIT_CYCLE
    found = end_of(growing, reach=0.1)
    assert np.isnan(compare(found, [Crossing(0.09, OMEGA, True)])["predicted"])


def test_without_cycles_there_is_a_word():
    assert ending(cycles_of(np.empty(0)), True).text == DIVERGES
    assert ending(cycles_of(np.empty(0)), False).text == NOT_SETTLED
    assert ending(cycles_of(np.empty(0)), False, faded=True).text == FALLS
    assert ending(cycles_of(linear(0.1, 20)), False, faded=True).text == FALLS
    assert not has_settled(np.zeros(9))


@pytest.mark.parametrize(("zeta", "text"), [(0.0, KEPT), (1e-5, NOT_SETTLED), (-1e-6, NOT_SETTLED)])
@pytest.mark.parametrize("samples", [16, 64])
def test_integrated_oscillators_have_the_words_of_their_closed_form(zeta, text, samples):
    with fw.Model(np.eye(1), np.array([[OMEGA**2]]), C=np.array([[2.0 * zeta * OMEGA]]), contacts=[]) as model:
        state = np.array([1.0]), np.array([0.0])
        step = 2.0 * np.pi / OMEGA / samples
        found = free_motion(fw.Transient(model), state, 0, step, 100 * samples, TOLERANCE)
    end = ending(extract(found.t, found.x, found.v), False, tolerance=TOLERANCE)
    assert end.text == text
    if zeta:
        assert end.zeta == pytest.approx(zeta, rel=1e-2)
