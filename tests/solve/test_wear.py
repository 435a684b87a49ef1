"""The march over wear cycles: closed form of one node, orders of the steppers, error control, when it stops."""

from __future__ import annotations

import numpy as np
import pytest
from models.core_models import solve_at
from tolerances import ROUNDING, SOLVED

import fretwave as fw
from fretwave.solve.steppers import STEPPERS

pytestmark = pytest.mark.ranks(1)

#: One Jenkins node at imposed amplitude, the normal load constant over a period.
A, B, C, P0 = 1.0, 0.5, 4e-3, 1.5


def worn_load(eta, amplitude=A):
    return 1 / (B / amplitude + (1 / P0 - B / amplitude) * np.exp(C * amplitude * eta))


def node(comm, samples=64, amplitude=A):
    """A mass whose only motion is tangential: P = P0 - kn depth, and one harmonic keeps the motion a cosine."""
    contact = fw.Contact(
        "coulomb_3d",
        np.array([[0.0], [1.0], [0.0]]),
        {"normal_stiffness": 1.0, "tangential_stiffness": 1.0, "friction_coefficient": B, "normal_load": P0},
    )
    model = fw.Model([[1.0]], [[1.0]], None, [contact], comm)
    problem = fw.NonlinearMode(model, fw.Harmonics([0, 1], samples), "CNM", 0, fw.linear_modes(model, 1, "stuck")[0])
    y = solve_at(problem, amplitude)
    return fw.WornMode(problem, C / 4, {"contact": np.ones(1)}), y


def marched(mode, y, cycles, control, **options):
    """(cycles, load, depth, work, event) of all points."""
    march = fw.Wear(mode, y, cycles, control, **options)
    found = [
        (p.cycles, p.state.load.copy(), p.state.depth.copy(), mode.problem.diagnostics(p.state.y)["work"], p.event)
        for p in march
    ]
    assert march.converged, march.reason
    return found


@pytest.mark.parametrize("stepper, tolerance", [("bogacki_shampine", 1e-8), ("tr_bdf2", 3e-9)])
def test_closed_form_of_one_node(comm, stepper, tolerance):
    """P(100) = 1.33576005, P(1000) = 0.10417001; the work 4 mu P (a - bP) has its peak kt a^2 at 274.653."""
    mode, y = node(comm)
    control = fw.WearControl(stepper, tolerance)
    found = {p[0]: p for p in marched(mode, y, 1000.0, control, report_at=[100.0, 274.653])}
    assert found[100.0][1][0] == pytest.approx(1.33576005, abs=1e-6)
    assert found[1000.0][1][0] == pytest.approx(0.10417001, abs=1e-6)
    assert found[274.653][1][0] == pytest.approx(A / (2 * B), abs=2e-6)
    assert found[274.653][3] == pytest.approx(1.0, abs=SOLVED)
    assert max(p[3] for p in found.values()) <= 1 + 1e-12
    for eta, load, depth, work, _ in found.values():
        assert load[0] == pytest.approx(worn_load(eta), abs=1e-6)
        assert depth[0] == pytest.approx(P0 - load[0], abs=ROUNDING)
        assert work == pytest.approx(4 * B * load[0] * (A - B * load[0]), abs=1e-11)


@pytest.mark.parametrize("stepper", list(STEPPERS))
def test_order_of_the_steppers(comm, stepper):
    """Errors at eta = 100 on halved steps."""
    mode, y = node(comm)
    errors = []
    for step in (20.0, 10.0, 5.0, 2.5):
        end = marched(mode, y, 100.0, fw.WearControl(stepper, 1e-9, first=step, fixed=True))[-1]
        errors.append(abs(end[1][0] - worn_load(100.0)))
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert np.allclose(orders, STEPPERS[stepper].order, atol=0.04)


@pytest.mark.parametrize("stepper", list(STEPPERS))
def test_tableaux_are_consistent(stepper):
    """Order conditions of the method and of its companion, and no negative coefficient: depths cannot fall."""
    t = STEPPERS[stepper]
    companion = t.A[-1] - t.error
    assert (t.A >= 0).all() and t.c[-1] == pytest.approx(1)
    for weights, order in ((t.A[-1], t.order), (companion, t.error_order - 1 if t.order != 2 else None)):
        assert weights.sum() == pytest.approx(1)
        if order is not None and order >= 2:
            assert weights @ t.c == pytest.approx(1 / 2)
        if order is not None and order >= 3:
            assert weights @ t.c**2 == pytest.approx(1 / 3)
            assert weights @ t.A @ t.c == pytest.approx(1 / 6)


def test_the_error_control_keeps_its_tolerance(comm):
    """The global error falls with a step's tolerance to the power 2/3; no pressure changes by more than it may."""
    mode, y = node(comm)
    errors = []
    for tolerance in (1e-3, 1e-5, 1e-7):
        control = fw.WearControl("bogacki_shampine", tolerance, pressure_change=1.0)
        errors.append(abs(marched(mode, y, 400.0, control)[-1][1][0] - worn_load(400.0)))
    assert errors[0] < 1e-2 and errors[2] < errors[0] / 200
    loads = np.array([p[1][0] for p in marched(mode, y, 400.0, fw.WearControl("heun", 1e-2, pressure_change=0.05))])
    assert 0.03 * P0 < np.abs(np.diff(loads)).max() <= 0.05 * P0


def test_last_digits_change_no_step(comm):
    """Rates that differ as they do between numbers of ranks: the same points, not points that drift apart."""
    marches, control = [], fw.WearControl(tolerance=1e-4)
    for factor in (1.0, 1.0 + 1e-10, 1.0 - 1e-10):
        mode, y = node(comm)
        mode.coefficient *= factor
        marches.append([point.cycles for point in fw.Wear(mode, y, 400.0, control)])
    assert len(marches[0]) == 8 and marches[0] == marches[1] == marches[2]


def test_stop_rules(comm):
    """A load that has gone, a rate that will change nothing any more, a node that sticks from the start."""
    mode, y = node(comm)
    for tolerance, cycles, why in ((1e-2, 1e5, "contact lost"), (1e-3, 2.1e3, "wear has stopped")):
        march = fw.Wear(mode, y, cycles, fw.WearControl(tolerance=tolerance))
        assert [point.event for point in march][-1] == "stop"
        assert march.converged and 1e3 < march.eta < cycles and why in march.reason
    small = solve_at(mode.problem, 0.5)  # 0.5 < b P0: stuck
    march = fw.Wear(mode, small, 1e9)
    assert len(list(march)) == 1 and march.eta == 0 and "stopped" in march.reason


def test_a_lost_contact_has_no_cycle_of_its_own(comm):
    """In closed form load is left at any cycle: each tolerance loses the last of it at another one, and it is said."""
    ends = []
    for tolerance in (1e-2, 1e-4):
        mode, y = node(comm)
        march = fw.Wear(mode, y, 1e5, fw.WearControl(tolerance=tolerance))
        *_, last = march
        assert last.state.load[0] == 0 and 0 < worn_load(march.eta) < 10 * tolerance * P0
        assert "contact lost" in march.reason and "depends on the tolerance" in march.reason
        ends.append(march.eta)
    assert ends[1] > 1.5 * ends[0]


def test_a_march_that_has_stopped_goes_no_further_when_it_is_gone_on_with(comm):
    mode, y = node(comm)
    march = fw.Wear(mode, y, 2.1e3, fw.WearControl(tolerance=1e-3))
    points = [(point.state.y.copy(), point.state.depth, point.cycles, march.step, march.growth) for point in march]
    assert "wear has stopped" in march.reason
    again = {"load_scale": march.load_scale, "step": points[-1][3], "growth": points[-1][4]}
    more = fw.Wear(mode, points[-1][0], 2.1e3, march.control, (), points[-1][1], points[-1][2], **again)
    assert list(more.go_on()) == [] and more.reason == march.reason


def test_a_slow_pair_that_grows_stops_no_march(comm):
    """A rate's growth over the last step goes on: e^40 of what is far below the tolerance."""
    mode, y = node(comm)
    march = fw.Wear(mode, y, 100.0)
    march.growth, march.state.rate = np.array([-1.0]), np.array([1e-12])
    assert march._finished() and "stopped" in march.reason
    march.reason, march.growth = "", np.array([0.4])
    assert not march._finished()


@pytest.mark.parametrize("cycles", [1e9, 1e18])
def test_a_march_is_as_long_as_it_is_wanted(comm, cycles):
    """Steps are short beside what wears, not beside all cycles: these ended before the first one."""
    mode, y = node(comm)
    march = fw.Wear(mode, y, cycles, fw.WearControl(tolerance=1e-2))
    assert [point.event for point in march][-1] == "stop"
    assert march.converged and "contact lost" in march.reason and march.eta < 1e5


@pytest.mark.parametrize("stepper", list(STEPPERS))
@pytest.mark.parametrize("above", [1e-4, 1e-6])
def test_wear_that_accelerates_from_nothing_has_not_stopped(comm, stepper, above):
    """Just above the onset of slip less than the tolerance is lost at first, and all of it in the end."""
    amplitude = B * P0 * (1 + above)
    mode, y = node(comm, amplitude=amplitude)
    cycles = 40 / (C * amplitude)
    off = []
    for tolerance in (1e-3, 1e-4):
        found = marched(mode, y, cycles, fw.WearControl(stepper, tolerance))
        assert found[-1][1][0] < 1e-2 * P0
        off.append(max(abs(load[0] - worn_load(eta, amplitude)) for eta, load, *_ in found) / P0)
    assert off[0] < 0.1 and off[1] < 0.4 * off[0] + 1e-4


def test_a_march_has_an_end(comm):
    """1e9 cycles in steps of one did not end."""
    mode, y = node(comm)
    march = fw.Wear(mode, y, 1e9, fw.WearControl(first=1e-3, fixed=True, max_points=20), [5e-3, 1.0, 2e9])
    points = [(point.cycles, point.event) for point in march]
    assert len(points) == 20 and not march.converged and march.reason == "largest number of points"
    assert [event for _, event in points if event] == ["start", "report"] and points[-1][0] == march.eta < 1.0
    assert [text.split(": ")[1].split(" of ")[0] for text in march.missed()] == [
        f"the march ended at {march.eta:.6g}",
        "beyond the last",
    ]
    assert list(march.go_on()) == []


@pytest.mark.parametrize("reports", [[np.nan], [-1.0], ["soon"], [np.inf]])
def test_reports_are_numbers_of_cycles(comm, reports):
    mode, y = node(comm)
    with pytest.raises(fw.InputError, match="report_at"):
        fw.Wear(mode, y, 1.0, None, reports)


@pytest.mark.parametrize(
    "going",
    [{"depth": [0.1, 0.2]}, {"depth": [-0.1]}, {"depth": [np.nan]}, {"at": -1.0}, {"at": np.nan}]
    + [{name: value} for name in ("step", "load_scale") for value in (0.0, -1.0, np.nan)],
    ids=lambda going: f"{next(iter(going))} {np.size(next(iter(going.values())))}",
)
def test_a_march_goes_on_from_numbers(comm, going):
    """A step below zero ended it where it began; depths of more pairs were taken, with rates of fewer."""
    mode, y = node(comm)
    before = mode.problem.energy(y)
    with pytest.raises(fw.InputError, match=rf"where: +{next(iter(going))}\b"):
        fw.Wear(mode, y, 1.0, **{"depth": [0.2], **going})
    assert mode.problem.energy(y) == before  # nothing is worn


def test_depths_are_those_of_the_pairs(comm):
    mode, y = node(comm)
    for depth in (np.zeros(2), np.zeros(0), np.zeros((1, 1)), [np.nan], ["a"]):
        with pytest.raises(fw.InputError, match=r"where: +depth\b"):
            mode.solve(depth, y)


@pytest.mark.parametrize("orders", [[1], [1, 3]], ids=["one", "odd"])
def test_wear_needs_the_mean(comm, orders):
    """Without it mean loads, and what is made of them, were the cosine of the lowest harmonic."""
    side = {"normal_stiffness": 1.0, "tangential_stiffness": 1.0, "friction_coefficient": B, "normal_load": P0}
    model = fw.Model(np.eye(2), np.eye(2), None, [fw.Contact("coulomb_2d", np.eye(2), side)], comm)
    problem = fw.NonlinearMode(model, fw.Harmonics(orders, 16), "CNM", 1, fw.linear_modes(model, 1, "stuck")[0])
    with pytest.raises(fw.InputError, match="mean, which is not retained"):
        fw.WornMode(problem, C, {"contact": np.ones(1)})


def test_what_ends_before_a_report_says_so(comm):
    mode, y = node(comm)
    march = fw.Wear(mode, y, 1e5, fw.WearControl(tolerance=1e-2), [0.0, 1.0, 9e4, 2e5])
    list(march)
    assert "contact lost" in march.reason
    assert [text.split(":")[0] for text in march.missed()] == ["report at 90000 cycles", "report at 200000 cycles"]
    assert "2000 cycles" in march.missed(100.0)[1] and "beyond the last of 1000 cycles" in march.missed(100.0)[1]


def test_errors(comm):
    mode, y = node(comm)
    with pytest.raises(fw.InputError, match="unknown stepper"):
        fw.Wear(mode, y, 1.0, fw.WearControl("euler"))
    with pytest.raises(fw.InputError, match="no such contact"):
        fw.WornMode(mode.problem, 1.0, {"root": np.ones(1)})
    jenkins = fw.Contact("jenkins", [[1.0]], {"tangential_stiffness": 1.0, "friction_limit": 1.0})
    model = fw.Model([[1.0]], [[1.0]], None, [jenkins], comm)
    problem = fw.NonlinearMode(model, fw.Harmonics([1], 16))
    with pytest.raises(fw.InputError, match="cannot wear"):
        fw.WornMode(problem, 1.0, {"contact": np.ones(1)})
