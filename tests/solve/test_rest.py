"""The state at rest, given: the same branch when it is the one that was found, the closed form when it is another."""

from __future__ import annotations

import numpy as np
import pytest
from models.core_models import unknowns, whole
from tolerances import LAST_BIT, ROUNDING, SOLVED, TIGHT

import fretwave as fw

K, KN, KT, MU, N0 = 2.0, 3.0, 1.5, 0.5, 2.0
LIMIT = MU * N0
LOAD = 1.0
LAWS = ["jenkins", "coulomb_3d", "coulomb_3d_uncoupled"]


def held(comm, law):
    """A mass on a spring, held along its tangent by a pair that bears LIMIT."""
    if law == "jenkins":
        contact = fw.Contact(law, [[1.0]], {"tangential_stiffness": KT, "friction_limit": LIMIT}, "pad")
    else:
        parameters = {"normal_stiffness": KN, "tangential_stiffness": KT, "friction_coefficient": MU}
        contact = fw.Contact(law, [[0.0], [1.0], [0.0]], {**parameters, "normal_load": N0}, "pad")
    return fw.Model([[1.0]], [[K]], None, [contact], comm)


def history(law, w):
    return {"pad": [[w]] if law == "jenkins" else [[w, 0.0]]}


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("w", [0.0, -0.3, 0.4])
def test_sliders_before_the_load_shift_the_state(comm, law, w):
    """K x + KT (x - w) = P while it sticks."""
    with held(comm, law) as model:
        rest = fw.static_preload(model, [LOAD], sliders=history(law, w))
        assert rest.displacement == pytest.approx((LOAD + KT * w) / (K + KT), rel=ROUNDING)
        assert rest.sliders["pad"][0, 0] == pytest.approx(w, abs=LAST_BIT) and rest.stick == 1
        assert model.sliders()["pad"][0, 0] == rest.sliders["pad"][0, 0]


def test_sliders_too_far_off_are_dragged_along(comm):
    """K x + LIMIT = P: the slider follows at x - LIMIT / KT."""
    with held(comm, "jenkins") as model:
        rest = fw.static_preload(model, [LOAD], sliders=history("jenkins", -2.0))
        x = (LOAD - LIMIT) / K
        assert rest.displacement == pytest.approx(x, abs=ROUNDING) and rest.slip == 1
        assert rest.sliders["pad"][0, 0] == pytest.approx(x - LIMIT / KT, rel=ROUNDING)


def backbone(model, rest):
    with fw.NonlinearMode(model, fw.Harmonics([0, 1], 256), start=fw.linear_modes(model, 1)[0], rest=rest) as mode:
        branch = fw.follow(mode, 0.02, 0.6, report_at=[0.1, 0.5])
        means = [model.comm.bcast(branch.coefficients(row))[0, 0] for row in range(len(branch))]
    assert branch.converged, branch.reason
    return branch, np.array(means)


@pytest.mark.parametrize("law", LAWS)
def test_the_state_found_and_the_same_state_given_have_one_branch(comm, law):
    """Also on another model of the same, and after another problem has moved the model's sliders."""
    with held(comm, law) as one, held(comm, law) as other:
        found = fw.static_preload(one, [LOAD])
        mode = fw.NonlinearMode(one, fw.Harmonics([0, 1], 256), start=fw.linear_modes(one, 1)[0])
        mode.preload(found.displacement, found.load)
        before = fw.follow(mode, 0.02, 0.6, report_at=[0.1, 0.5])
        given = fw.Rest(found.displacement, found.load, found.sliders)
        after, _ = backbone(other, given)
        for name in ("amplitude", "omega", "zeta", "stick"):
            np.testing.assert_array_equal(after[name], before[name])


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("w", [0.0, 0.2, -0.1])
def test_the_mean_shakes_down_from_the_given_state(comm, law, w):
    """Stuck about x_s = (P + KT w) / (K + KT) until KT a + |T| = LIMIT; beyond, K x = P - sign(T) (LIMIT - KT a)."""
    with held(comm, law) as model:
        x = (LOAD + KT * w) / (K + KT)
        rest = fw.Rest(np.array([x]), np.array([LOAD]), history(law, w))
        branch, means = backbone(model, rest)
    held_by, a = KT * (x - w), branch["amplitude"]
    stuck = a <= (LIMIT - abs(held_by)) / KT
    whole_reach = a <= LIMIT / KT
    shaken = (LOAD - np.sign(held_by) * (LIMIT - KT * a)) / K
    assert stuck.any() and (whole_reach & ~stuck).any()
    np.testing.assert_allclose(means[stuck], x, rtol=SOLVED)
    np.testing.assert_allclose(means[whole_reach & ~stuck], shaken[whole_reach & ~stuck], rtol=2e-4)


def test_two_problems_of_one_model_keep_their_own_states(comm):
    """Evaluated in turn, each moves about its own sliders."""
    with held(comm, "jenkins") as model:
        states = [fw.static_preload(model, [LOAD], sliders=history("jenkins", w)) for w in (0.0, 0.3)]
        start = fw.linear_modes(model, 1)[0]
        modes = [fw.NonlinearMode(model, fw.Harmonics([0, 1], 64), start=start, rest=rest) for rest in states]
        y = np.array([0.0, 0.5, 0.0, 0.0, 1.0, 0.0])  # beyond the reach of the first, within that of the second
        alone = [whole(mode.residual(unknowns(mode, y))) for mode in modes]
        again = [whole(mode.residual(unknowns(mode, y))) for mode in modes]
        assert all(np.array_equal(a, b) for a, b in zip(alone, again))
        assert np.abs(alone[0] - alone[1]).max() > 1e-2
        periods = [mode.contact_period(unknowns(mode, y)) for mode in modes]
        if comm.rank == 0:
            assert not np.array_equal(periods[0][0]["f"], periods[1][0]["f"])


def test_a_forced_response_moves_about_its_state(comm):
    with held(comm, "jenkins") as model:
        rest = fw.static_preload(model, [LOAD], sliders=history("jenkins", 0.2))
        start = fw.linear_modes(model, 1)[0]
        response = fw.ForcedResponse(model, fw.Harmonics([0, 1], 64), {1: [1e-3]}, 1.0, 0, start, rest=rest)
        branch = fw.follow(response, 0.8, 1.2)
        mean = comm.bcast(branch.coefficients(0))[0, 0]
    assert mean == pytest.approx((LOAD + KT * 0.2) / (K + KT), rel=TIGHT)


@pytest.mark.parametrize(
    "sliders, words",
    [({"other": [[0.0]]}, "of other contacts"), ({"pad": [[0.0, 0.0]]}, "do not fit"), ({"pad": [[np.nan]]}, "finite")],
)
def test_sliders_that_do_not_fit_are_refused(comm, sliders, words):
    with held(comm, "jenkins") as model, pytest.raises(fw.InputError, match=words):
        fw.NonlinearMode(model, fw.Harmonics([0, 1], 64), rest=fw.Rest(np.zeros(1), np.zeros(1), sliders))
