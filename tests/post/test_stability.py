"""Stability of limit cycles as a branch's table and its curve have it."""

from __future__ import annotations

import numpy as np
import pytest
from tolerances import SOLVED

from fretwave.post.limit_cycles import limit_cycles, place, stability
from fretwave.post.mode_curve import ModeCurve

pytestmark = pytest.mark.ranks(1)


def branch(roots, backwards=False):
    """log a = s + 1.2 sin s turns round at s = 2.556 and 3.727; the damping has these roots, rising at the first."""
    s = np.unique(np.concatenate([np.linspace(0.0, 6.0, 61), roots]))
    zeta = 1e-3 * np.prod([s - root for root in roots], axis=0) * (-1) ** (len(roots) + 1)
    zeta[np.isin(s, roots)] = 0.0
    amplitude = np.exp(s + 1.2 * np.sin(s))
    columns = {"amplitude": amplitude, "omega": 10.0 - s, "omega0": 10.0 - s, "zeta": zeta, "frequency_hz": 10.0 - s}
    columns["event"] = np.where(np.isin(s, roots), "zero_damping", "")
    return {name: column[::-1] if backwards else column for name, column in columns.items()}


def both(table):
    """Stability by the table and by the curve through its points."""
    return (
        [cycle["stable"] for cycle in limit_cycles(table)],
        [crossing.stable for crossing in ModeCurve.from_table(table).crossings()],
    )


@pytest.mark.parametrize("backwards", (False, True))
def test_a_branch_that_runs_back_says_nothing_of_stability_there(backwards):
    """Upwards and downwards: rising before the folds and behind them, and a cycle between them."""
    expected = [True, None, True]
    table = branch([1.05, 3.05, 5.05], backwards)
    assert both(table) == (expected, expected)
    assert [cycle["runs_back"] for cycle in limit_cycles(table)] == [False, True, False]
    falling = {**table, "zeta": -table["zeta"]}
    expected = [False, None, False]
    assert both(falling) == (expected, expected)


@pytest.mark.parametrize("folds", ([2.55590711], [3.72727819]))
def test_a_cycle_at_a_fold_is_of_unknown_stability(folds):
    table = branch(folds)
    assert both(table)[0] == [None]
    errors = dict.fromkeys(("zeta_error", "omega_error"), np.full(len(table["zeta"]), 1e-5))
    assert limit_cycles({**table, **errors})[0]["amplitude_error"] is None


@pytest.mark.parametrize("backwards", (False, True))
def test_a_cycle_at_an_end_of_a_branch_is_one(backwards):
    table = branch([6.0], backwards)
    table["zeta"] = table["zeta"] + 2.7e-17
    table["event"] = np.full(len(table["zeta"]), "stop")
    assert both(table) == ([None], [None])
    (cycle,) = limit_cycles(table)
    assert cycle["amplitude"] == pytest.approx(np.exp(6.0 + 1.2 * np.sin(6.0)), rel=1e-14)
    assert stability(cycle) == "stability unknown (branch end)"


@pytest.mark.parametrize("end", (False, True))
def test_the_error_of_damping_moves_a_cycle_along_the_branch(end):
    """zeta = 1e-3 (a^2 - 4), f = 10 - a^2: slopes 4e-3 and -4 at a = 2, exact of parabolas through three points."""
    a = np.array([1.5, 1.9, 2.0, 2.2, 2.9])[: 3 if end else 5]
    table = {"amplitude": a, "zeta": 1e-3 * (a**2 - 4), "frequency_hz": 10 - a**2, "zeta_error": np.full(len(a), 1e-5)}
    table |= {"event": np.where(a == 2, "zero_damping", ""), "omega_error": np.full(len(a), 0.02 * np.pi)}
    (cycle,) = limit_cycles(table)
    rel = 0.1 if end else SOLVED  # one side alone has the slope of a chord
    assert cycle["amplitude_error"] == pytest.approx(1e-5 / 4e-3, rel=rel)
    assert cycle["frequency_hz_error"] == pytest.approx(0.01 + 4 * 1e-5 / 4e-3, rel=rel)
    assert place(cycle, "m").startswith("a = 2 +- 0.00") and place(cycle, "m").endswith("m, 6 +- 0.02 Hz")
    (unknown,) = limit_cycles({**table, "zeta_error": np.full(len(a), np.nan)})
    assert unknown["amplitude_error"] is None and place(unknown, "m") == "a = 2 m, 6 Hz"


def test_nothing_is_told_of_a_cycle_whose_damping_only_touches_zero():
    a = np.array([1.0, 2.0, 3.0])
    table = {"amplitude": a, "zeta": np.array([0.01, 0.0, 0.01]), "frequency_hz": np.ones(3), "zeta_error": 1e-5 * a}
    table |= {"event": np.array(["", "zero_damping", ""]), "omega_error": 1e-5 * a}
    assert limit_cycles(table)[0]["amplitude_error"] is None


def test_a_start_that_sticks_undamped_is_no_cycle():
    table = branch([0.0])
    table |= {"event": np.full(len(table["zeta"]), ""), "stick": np.minimum(1.0, 1.1 - table["amplitude"] / 10.0)}
    assert table["zeta"][0] == 0.0 and limit_cycles(table) == []
    values = {**table, "omega": np.full(len(table["zeta"]), 1.0), "omega0": np.full(len(table["zeta"]), 1.0)}
    assert ModeCurve.from_table(values).crossings() == []


def test_a_point_that_is_there_twice_has_no_direction():
    """A located zero at which a motion is reported too, a rounding below."""
    table = branch([1.05])
    place = int(np.flatnonzero(table["zeta"] == 0.0)[0])
    table = {name: np.insert(column, place, column[place]) for name, column in table.items()}
    table["amplitude"][place + 1] *= 1 - 1e-14
    table["event"][place + 1] = "report"
    assert [cycle["stable"] for cycle in limit_cycles(table)] == [True]


def test_words_name_other_modes_by_the_state_of_the_contact():
    one = {"mode": 2, "contact": "stuck", "frequency_hz": 0.591, "zeta": -0.022}
    cycle = {"stable": True, "fed": [one]}
    said = (
        "stable in its own amplitude (damping rises), but linear mode 2, 0.591 Hz, gains energy by itself: zeta -2.2 %"
    )
    assert stability(cycle) == f"{said} (stuck)"
    more = [one, {**one, "mode": 3, "zeta": -0.001}, {**one, "contact": "contact free"}]
    assert stability({"stable": True, "fed": more}) == f"{said} (stuck, as does 1 other; contact free)"
    loose = {"stable": True, "fed": [{**one, "contact": "contact free"}]}
    assert stability(loose) == f"{said} (contact free)".replace("but", "though")
    assert stability({"stable": True, "not_looked_at": "why"}).endswith(", other modes not looked at (why)")
    assert stability({"stable": False}) == "unstable (damping falls)"


@pytest.mark.parametrize("unit", [1.0, 2.0**-13, 1e3])
def test_states_of_the_contact_share_their_words_in_any_unit_of_time(unit):
    """196.34 and 196.28 Hz are 196.3 Hz both, and in another unit 0.02397 and 0.02396."""
    stuck = {"mode": 1, "contact": "stuck", "frequency_hz": 196.34 * unit, "zeta": -0.131}
    free = {**stuck, "contact": "contact free", "frequency_hz": 196.28 * unit}
    said = stability({"stable": True, "fed": [stuck, free]})
    assert said.count("gains energy") == 1 and said.endswith("(stuck; contact free)")
    other = stability({"stable": True, "fed": [stuck, {**free, "frequency_hz": 197.0 * unit}]})
    assert other.count("gains energy") == 2
