"""Status, gap and work of contact pairs from samples of a period, against the laws themselves."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from tolerances import LAST_BIT, LAST_DIGITS, ROUNDING, TIGHT

import fretwave as fw
from fretwave.model.law_info import Role
from fretwave.post.contact_history import OPEN, SLIP, STICK, ContactHistory, tangential_force

pytestmark = pytest.mark.ranks(1)


@pytest.mark.parametrize("law", ["regularised_coulomb", "jenkins"])
def test_status_of_a_law_is_its_own(two_dof, comm, law: str) -> None:
    """Shares as the law counts them, work as it integrates: for EPMC's periodic motion the same integral."""
    parameters = {
        "regularised_coulomb": {"friction_limit": 5.0, "regularisation_velocity": 0.05},
        "jenkins": {"friction_limit": 5.0, "tangential_stiffness": 40.0},
    }[law]
    contact = fw.Contact(law, B=[[0.0, 1.0]], parameters=parameters)
    model = fw.Model(two_dof.M, two_dof.K, contacts=[contact], comm=comm)
    start = fw.linear_modes(model, 1, "stuck")[0]
    problem = fw.NonlinearMode(model, fw.Harmonics(range(1, 16, 2), 2048), method="EPMC", dof=0, start=start)
    *_, last = fw.Continuation(problem, problem.initial(0.02), (0.02, 0.15 if law == "regularised_coulomb" else 0.4))
    told = problem.diagnostics(last.y)
    history = ContactHistory.of(problem.contact_history(last.y)[0], contact.info.normal)
    for status, word in ((STICK, "stick"), (SLIP, "slip"), (OPEN, "open")):
        assert history.share(status).mean() == pytest.approx(told[word], abs=LAST_DIGITS)
    assert 0.05 < told["slip"] < 0.95
    # Jenkins' own sum over its slips is of first order in the sample distance.
    assert history.work.sum() == pytest.approx(told["work"], rel=TIGHT if law == "regularised_coulomb" else 1e-2)


def test_gap_is_what_is_missing_to_contact() -> None:
    """u_n sweeps through contact: N = max(0, N0 + kn (u_n - g)), the gap is g - N0 / kn - u_n where it is open."""
    u = np.zeros((64, 3, 2))
    u[:, 0] = 1e-3 * np.cos(2 * np.pi * np.arange(64) / 64)[:, None]
    kn, load, gap = np.array([2e4, 1e4]), 5.0, np.array([1e-4, 0.0])
    f = np.zeros_like(u)
    f[:, 0] = np.maximum(0.0, load + kn * (u[:, 0] - gap))
    given = {"normal_stiffness": kn, "normal_load": load, "gap": gap, "friction_coefficient": 0.3}
    contact = fw.Contact("coulomb_3d", np.eye(6), {**given, "tangential_stiffness": 1e4})
    status, found = contact.states(u, 0 * u, f)
    missing = gap - load / kn - u[:, 0]
    assert found == pytest.approx(np.maximum(missing, 0.0), abs=1e-18)
    assert np.array_equal(status == OPEN, missing >= 0) and not np.any(status == SLIP)
    assert np.abs(ContactHistory(u, 0 * u, f, status, found, 0).work).max() < ROUNDING * load * 1e-3


def test_worn_depth_is_gap(comm) -> None:
    """Of a motion that opens, as the results keep it: N = max(0, N0 + kn (u_n - g - depth)) and what is missing."""
    given = {"normal_stiffness": 2.0, "tangential_stiffness": 1.5, "friction_coefficient": 0.4}
    contact = fw.Contact("coulomb_3d", np.eye(3), {**given, "normal_load": 0.5, "gap": 0.01})
    model = fw.Model(np.eye(3), 4 * np.eye(3), contacts=[contact], comm=comm)
    start = fw.LinearMode(2.0, 0.0, np.eye(3)[0], np.zeros(3))
    problem = fw.NonlinearMode(model, fw.Harmonics([0, 1], 64), "EPMC", 0, start)
    gaps = {}
    for depth in (0.0, 0.2):
        problem.core.wear([[depth]])
        kept = problem.contact_history(problem.initial(1.0))[0]
        normal, u = kept["f"][:, 0], kept["u"][:, 0]
        missing = 0.01 + depth - 0.25 - u
        assert normal == pytest.approx(np.maximum(-2.0 * missing, 0.0), abs=LAST_DIGITS)
        assert kept["gap"] == pytest.approx(np.maximum(missing, 0.0), abs=LAST_BIT)
        assert np.array_equal(kept["status"] == OPEN, normal <= 0)
        gaps[depth] = kept["gap"].max()
    assert gaps[0.2] - gaps[0.0] == pytest.approx(0.2) and gaps[0.0] > 0.5


def test_uncoupled_tangents_slip_one_by_one() -> None:
    f = np.array([[[10.0], [3.0], [2.9]], [[10.0], [2.0], [2.5]], [[50 / 0.3], [40.0], [40.0]]])
    given = {"normal_stiffness": 1.0, "tangential_stiffness": 1.0, "friction_coefficient": 0.3}
    found = {
        law: fw.Contact(law, np.eye(3), given).states(0 * f, 0 * f, f)[0].ravel().tolist()
        for law in ("coulomb_3d", "coulomb_3d_uncoupled")
    }
    assert found == {"coulomb_3d": [SLIP, SLIP, SLIP], "coulomb_3d_uncoupled": [SLIP, STICK, STICK]}


class Silent(fw.PythonLaw):
    """Says nothing of status and gap."""

    components = 3

    def force(self, u: Any, v: Any) -> Any:
        return u


def test_a_law_in_python_that_says_nothing_is_open_without_normal_force_and_slips_else() -> None:
    f = np.array([[[10.0, 0.0], [3.0, 0.0], [2.9, 0.0]]])
    status, gap = fw.Contact(Silent(), np.eye(6)).states(0 * f, 0 * f, f)
    assert status.tolist() == [[SLIP, OPEN]]
    assert gap[0, 0] == 0.0 and np.isnan(gap[0, 1])


class Wrong(Silent):
    """Gives a state that there is not."""

    def status(self, u: Any, v: Any, f: Any) -> Any:
        return np.full_like(f[:, 0], 3)


def test_a_state_that_there_is_not_is_refused() -> None:
    f = np.ones((1, 3, 1))
    with pytest.raises(fw.InputError, match="other than STICK, SLIP and OPEN"):
        fw.Contact(Wrong(), np.eye(3)).states(f, f, f)


@pytest.mark.parametrize("factor, status", [(1 - 1e-11, STICK), (1.0, SLIP), (1 - 1e-13, SLIP)])
@pytest.mark.parametrize("law", ["jenkins", "coulomb_3d", "coulomb_3d_uncoupled", "own"])
def test_one_tolerance_says_when_a_limit_is_reached(law: str, factor: float, status: int) -> None:
    if law == "own":
        assert bool(fw.PythonLaw.at_limit(factor * 6.0, 6.0)) == (status == SLIP)
        return
    info = fw.laws()[law]
    given = {Role.FRICTION_LIMIT: 6.0, Role.FRICTION_COEFFICIENT: 0.5}
    others = {p.name: 1.0 for p in info.parameters if p.default is None}
    f = np.array([[[6.0 * factor]]]) if info.normal is None else np.array([[[12.0], [6.0 * factor], [0.0]]])
    contact = fw.Contact(law, np.eye(info.components), {**others, **info.with_roles(given)})
    assert contact.states(0 * f, 0 * f, f)[0].item() == status


def test_a_history_without_its_law_s_word_has_no_status() -> None:
    u = np.zeros((4, 3, 2))
    assert ContactHistory(u, u, u, normal=0).status is None
    partly = np.array([[STICK, -1]] * 4, dtype=np.int8)
    assert ContactHistory(u, u, u, partly, normal=0).status is None
    assert ContactHistory(u, u, u, partly, normal=0).of_pairs(slice(0, 1)).status.tolist() == [[STICK]] * 4


def test_a_law_without_tangents_has_no_tangential_force() -> None:
    """A stop: a static state of it ended in a TypeError."""
    f = np.array([[[2.0, 0.0]], [[3.0, 1.0]]])
    assert tangential_force(f, 0).tolist() == [[0.0, 0.0], [0.0, 0.0]]


def test_normal_and_tangential_forces_follow_the_law_s_direction() -> None:
    f = np.array([[[5.0], [3.0], [-4.0]]])
    history = {normal: ContactHistory(f, f, f, normal=normal) for normal in (0, None)}
    assert (history[0].normal_force.item(), history[0].tangential_force.item()) == (5.0, 5.0)
    assert np.isnan(history[None].normal_force).all()
    assert history[None].tangential_force.item() == pytest.approx(np.sqrt(50.0))


@pytest.mark.parametrize("law", ["jenkins", "coulomb_2d", "coulomb_3d"])
def test_a_pair_that_a_load_brings_to_its_limit_in_an_instant_sticks(comm, law):
    """Its slider stands there all the period: the one sample at the limit, 1 of 64, was told as slip."""
    n, tangent = {"jenkins": (1, 0), "coulomb_2d": (2, 1), "coulomb_3d": (3, 1)}[law]
    friction = {"friction_limit": 0.3} if n == 1 else {"friction_coefficient": 0.3, "normal_load": 1.0, "gap": 0.0}
    normal = {} if n == 1 else {"normal_stiffness": 5.0}
    contact = fw.Contact(law, np.eye(n), {"tangential_stiffness": 2.0, **normal, **friction}, law)
    with fw.Model(np.eye(n), np.diag([3.0, 3.5, 4.0][:n]), None, [contact], comm) as model:
        rest = fw.static_preload(model, 1.5 * np.eye(n)[tangent])
        along = [mode for mode in fw.linear_modes(model, n) if abs(mode.shape[tangent]) > 0.9]
        problem = fw.NonlinearMode(model, fw.Harmonics(range(4), 64), dof=tangent, start=along[0], rest=rest)
        branch = fw.follow(problem, 1e-3, 1e-2, errors=False)
        told = problem.contact_history(branch.unknowns(0))[0]
        shares, status = told["shares"].ravel(), told["status"]
    assert shares.tolist() == [1, 0, 0] and not (status == SLIP).any()
    assert branch["slip"][0] == 0 and branch["zeta"][0] == 0
